"""The other side of vtk_matrix.rs: writes files with the packages that users have, and reads ours with them.

    vtk_matrix.py write FOLDER    fills FOLDER with files and, for each, the arrays that a reader must find
    vtk_matrix.py read FOLDER     reads the files in FOLDER and compares them with the arrays beside them

The arrays of `case.ending` lie in `case.ending.arrays/`: one file of little-endian bytes per array, called
`number,type,components,name`; number 0 is the points. With DIFFUSPH_WITHOUT=pyvista, what pyvista does is left out.
"""

import itertools
import os
import shutil
import sys

import meshio
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

pyvista = None
if os.environ.get("DIFFUSPH_WITHOUT") != "pyvista":
    import pyvista

TYPES = {"f8": "Float64", "f4": "Float32", "i8": "Int64", "u8": "UInt64", "i4": "Int32", "u4": "UInt32",
         "i2": "Int16", "u2": "UInt16", "i1": "Int8", "u1": "UInt8"}
TIME = 0.1 + 0.2
LOST_SIGN = 0.0 if vtk.vtkVersion.GetVTKVersion().startswith("9.1.") else -0.0
# 4096 doubles are 32768 bytes: a block of VTK's compressors, without a rest.
SIZES = [0, 1, 1000, 4096]

# Folders of arrays by cloud; the arrays are kept so that their ids stay theirs.
stored = {}


def cloud(n):
    """Points and named arrays of every type; doubles that only their bits identify."""
    rng = np.random.default_rng(n)
    doubles = rng.standard_normal(n)
    doubles[: n // 4] = rng.integers(0, 1 << 63, n // 4).view("f8")
    odd = [np.nan, np.inf, -np.inf, -0.0, 5e-324]
    doubles[: min(n, 5)] = odd[:n]
    fields = {
        "T": doubles,
        "v": rng.standard_normal((n, 3)).astype("f4"),
        "stress": rng.standard_normal((n, 9)),
        "id": rng.integers(-(1 << 62), 1 << 62, n),
        "count": rng.integers(-9, 9, n).astype("i4"),
        "kind": rng.integers(0, 255, n).astype("u1"),
    }
    return rng.random((n, 3)), fields


def tame(n):
    """A cloud of numbers that survive a few decimals."""
    rng = np.random.default_rng(n)
    eighths = lambda *shape: rng.integers(-8000, 8000, shape) / 8.0
    fields = {"T": eighths(n), "v": eighths(n, 3).astype("f4"), "count": rng.integers(-9, 9, n).astype("i4")}
    return eighths(n, 3), fields


def expect(path, points, fields):
    """Lays the arrays beside the file; those of the same cloud are stored once."""
    known = (id(points), *map(id, fields.values()))
    folder = path + ".arrays"
    if known in stored:
        return os.symlink(stored[known][0], folder)
    stored[known] = os.path.basename(folder), points, fields
    os.mkdir(folder)
    for number, (name, array) in enumerate([("points", points.astype("f8"))] + list(fields.items())):
        array = np.ascontiguousarray(array)
        components = 1 if array.ndim == 1 else array.shape[1]
        label = f"{number},{TYPES[array.dtype.str[1:]]},{components},{name}"
        array.astype(array.dtype.newbyteorder("<")).tofile(os.path.join(folder, label))


def vtk_array(name, array):
    out = numpy_to_vtk(np.ascontiguousarray(array), deep=True)
    out.SetName(name)
    return out


def data_set(kind, points, fields):
    out = kind()
    positions = vtk.vtkPoints()
    positions.SetData(vtk_array("Points", points))
    out.SetPoints(positions)
    cells = vtk.vtkCellArray()
    for i in range(len(points)):
        cells.InsertNextCell(1, [i])
    if kind is vtk.vtkPolyData:
        out.SetVerts(cells)
    else:
        out.SetCells(vtk.VTK_VERTEX, cells)
    for name, array in fields.items():
        out.GetPointData().AddArray(vtk_array(name, array))
    out.GetFieldData().AddArray(vtk_array("TimeValue", np.array([TIME])))
    text = vtk.vtkStringArray()
    text.SetName("note")
    text.InsertNextValue("two words")
    out.GetFieldData().AddArray(text)
    return out


def write_xml(folder):
    kinds = {"vtu": (vtk.vtkUnstructuredGrid, vtk.vtkXMLUnstructuredGridWriter),
             "vtp": (vtk.vtkPolyData, vtk.vtkXMLPolyDataWriter)}
    modes = ["ascii", "binary", "raw", "base64"]
    for n, (ending, (kind, writer_of)) in itertools.product(SIZES, kinds.items()):
        points, fields = cloud(n)
        data = data_set(kind, points, fields)
        choices = itertools.product(modes, ["none", "zlib", "lz4"], [32, 64], ["little", "big"], [0, 32768])
        for mode, packer, bits, order, block in choices:
            if (mode == "ascii" and (packer, bits, order) != ("none", 64, "little")) or (packer == "none" and block):
                continue
            writer = writer_of()
            arrays = fields
            if mode == "ascii":
                # In digits all NaNs are one; VTK 9.1 writes -0 without its sign, which adding 0 takes away.
                arrays = fields | {"T": np.where(np.isnan(fields["T"]), np.nan, fields["T"]) + LOST_SIGN}
                data.GetPointData().AddArray(vtk_array("T", arrays["T"]))
            else:
                data.GetPointData().AddArray(vtk_array("T", fields["T"]))
            path = f"{folder}/vtk_{n}_{mode}_{packer}_{bits}_{order}_{block}.{ending}"
            writer.SetFileName(path)
            writer.SetInputData(data)
            writer.SetDataMode({"ascii": writer.Ascii, "binary": writer.Binary}.get(mode, writer.Appended))
            writer.SetEncodeAppendedData(mode == "base64")
            writer.SetHeaderType(writer.UInt32 if bits == 32 else writer.UInt64)
            writer.SetByteOrder(writer.LittleEndian if order == "little" else writer.BigEndian)
            writer.SetCompressorType({"none": writer.NONE, "zlib": writer.ZLIB, "lz4": writer.LZ4}[packer])
            if block:
                writer.SetBlockSize(block)
            assert writer.Write() == 1, path
            expect(path, points, arrays)


def point_cloud(points, fields, data):
    """pyvista's own way to make one: its cells have other types than those of VTK's arrays."""
    out = pyvista.PolyData(points)
    for name, array in fields.items():
        out.point_data[name] = array
    out.GetFieldData().ShallowCopy(data.GetFieldData())
    return out if data.IsA("vtkPolyData") else out.cast_to_unstructured_grid()


def write_defaults(folder):
    for n in SIZES:
        points, fields = cloud(n)
        for kind, ending in [(vtk.vtkUnstructuredGrid, "vtu"), (vtk.vtkPolyData, "vtp")]:
            data = data_set(kind, points, fields)
            writer = vtk.vtkXMLUnstructuredGridWriter() if ending == "vtu" else vtk.vtkXMLPolyDataWriter()
            path = f"{folder}/default_{n}.{ending}"
            writer.SetFileName(path)
            writer.SetInputData(data)
            assert writer.Write() == 1
            expect(path, points, fields)
            if n and pyvista:
                path = f"{folder}/pyvista_{n}.{ending}"
                pyvista.wrap(data).save(path)
                expect(path, points, fields)
                path = f"{folder}/pyvista_{n}_{ending}.vtk"
                point_cloud(points, fields, data).save(path)
                expect(path, points, fields)
        # meshio cannot compress an empty array.
        for name, options in [("ascii", dict(binary=False)), ("plain", dict(compression=None)), ("zlib", {})]:
            if n:
                path = f"{folder}/meshio_{name}_{n}.vtu"
                cells = [("vertex", np.arange(n).reshape(n, 1))]
                chosen, arrays = tame(n) if name == "ascii" else (points, fields)
                meshio.vtu.write(path, meshio.Mesh(chosen, cells, point_data=arrays), **options)
                expect(path, chosen, arrays)


def write_pieces(folder):
    """One file of several pieces, and a list of files: both from VTK's own parallel writer."""
    points, fields = cloud(1000)
    cuts = [0, 300, 300, 1000]
    for a, b, number in zip(cuts, cuts[1:], range(3)):
        part = data_set(vtk.vtkUnstructuredGrid, points[a:b], {k: v[a:b] for k, v in fields.items()})
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetFileName(f"{folder}/piece.{number}.part")
        writer.SetInputData(part)
        writer.SetDataModeToBinary()
        assert writer.Write() == 1
    texts = [open(f"{folder}/piece.{number}.part").read() for number in range(3)]
    inside = [t[t.index("<Piece") : t.index("</Piece>") + 8] for t in texts]
    first = texts[0]
    joined = first[: first.index("<Piece")] + "\n".join(inside) + first[first.index("</Piece>") + 8 :]
    with open(f"{folder}/pieces.vtu", "w") as file:
        file.write(joined)
    expect(f"{folder}/pieces.vtu", points, fields)
    sources = "".join(f'<Piece Source="piece.{number}.part"/>' for number in range(3))
    with open(f"{folder}/pieces.pvtu", "w") as file:
        file.write(f'<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid>{sources}</PUnstructuredGrid></VTKFile>')
    expect(f"{folder}/pieces.pvtu", points, fields)


def bits(n):
    out = vtk.vtkBitArray()
    out.SetName("bits")
    for i in range(n):
        out.InsertNextValue(i % 3 == 0)
    return out


def write_legacy(folder):
    for n, binary, version in itertools.product([1, 1000], [False, True], [42, 51]):
        points, fields = cloud(n) if binary else tame(n)
        fields = {"T in K" if name == "T" else name: array for name, array in fields.items()}
        for kind, writer_of in [(vtk.vtkUnstructuredGrid, vtk.vtkUnstructuredGridWriter),
                                (vtk.vtkPolyData, vtk.vtkPolyDataWriter)]:
            data = data_set(kind, points, fields)
            data.GetPointData().AddArray(bits(n))  # to be left aside
            bare = kind()
            bare.SetPoints(data.GetPoints())
            bare.GetPointData().ShallowCopy(data.GetPointData())
            bare.GetFieldData().ShallowCopy(data.GetFieldData())
            for cells, grid in [("vertices", data), ("bare", bare)]:
                writer = writer_of()
                path = f"{folder}/legacy_{n}_{'binary' if binary else 'ascii'}_{version}_{kind.__name__}_{cells}.vtk"
                writer.SetFileName(path)
                writer.SetInputData(grid)
                writer.SetFileVersion(version)
                writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
                assert writer.Write() == 1
                expect(path, points, fields)
    for n, binary, kind in itertools.product([1, 1000], [False, True], ["vtk", "vtk42"]):
        points, fields = cloud(n) if binary else tame(n)
        path = f"{folder}/meshio_{n}_{'binary' if binary else 'ascii'}_{kind}.vtk"
        cells = [("vertex", np.arange(n).reshape(n, 1))]
        meshio.write(path, meshio.Mesh(points, cells, point_data=fields), file_format=kind, binary=binary)
        expect(path, points, fields)


def write_structured(folder):
    points, fields = cloud(1000)
    grid = vtk.vtkStructuredGrid()
    grid.SetDimensions(10, 10, 10)
    positions = vtk.vtkPoints()
    positions.SetData(vtk_array("Points", points))
    grid.SetPoints(positions)
    for name, array in fields.items():
        grid.GetPointData().AddArray(vtk_array(name, array))
    for name in ["structured_plain.vts", "structured_zlib.vts"]:
        writer = vtk.vtkXMLStructuredGridWriter()
        writer.SetFileName(f"{folder}/{name}")
        writer.SetInputData(grid)
        writer.SetDataModeToBinary()
        writer.SetHeaderTypeToUInt32()
        if "plain" in name:
            writer.SetCompressorTypeToNone()
        assert writer.Write() == 1
        expect(f"{folder}/{name}", points, fields)


def copy_data(folder):
    """The particles that this repository keeps, as meshio reads them."""
    data = os.path.join(os.path.dirname(os.path.abspath(__file__)), "data")
    for name in ["dam_break.vtu", "glass_24.vtu"]:
        path = f"{folder}/meshio_{name}"
        shutil.copy(os.path.join(data, name), path)
        mesh = meshio.read(path)
        expect(path, mesh.points, mesh.point_data)


def read_expected(path):
    folder = path + ".arrays"
    arrays = []
    for label in sorted(os.listdir(folder), key=lambda label: int(label.split(",")[0])):
        _, kind, components, name = label.split(",", 3)
        code = next(c for c, t in TYPES.items() if t == kind)
        array = np.fromfile(os.path.join(folder, label), "<" + code)
        arrays.append((name, array if components == "1" else array.reshape(-1, int(components))))
    return arrays


def same(path, who, got, wanted):
    assert got.shape == wanted.shape, f"{who} {path}: {got.shape} instead of {wanted.shape}"
    assert got.dtype.itemsize == wanted.dtype.itemsize and got.dtype.kind == wanted.dtype.kind, f"{who} {path} {got.dtype}"
    got = got.astype(got.dtype.newbyteorder("<"))  # of the same numbers: no bit of them changes
    assert np.ascontiguousarray(got).tobytes() == wanted.tobytes(), f"{who} {path}: other bits"


def read_with_vtk(path, wanted):
    if path.endswith(".vtu"):
        reader = vtk.vtkXMLUnstructuredGridReader()
    else:
        reader = vtk.vtkUnstructuredGridReader()
        reader.ReadAllFieldsOn()
    failures = []
    reader.AddObserver("ErrorEvent", lambda *_: failures.append(path))
    reader.SetFileName(path)
    reader.Update()
    data = reader.GetOutput()
    n = len(wanted[0][1])
    assert not failures, failures
    assert data.GetNumberOfPoints() == n and sum(data.GetCell(i).GetNumberOfPoints() for i in range(data.GetNumberOfCells())) == n
    assert all(data.GetCellType(i) == vtk.VTK_VERTEX for i in range(n)), path
    assert all(data.GetCell(i).GetPointId(0) == i for i in range(min(n, 1000)))
    if n:
        same(path, "vtk", vtk_to_numpy(data.GetPoints().GetData()), wanted[0][1])
    arrays = data.GetPointData()
    assert arrays.GetNumberOfArrays() == len(wanted) - 1, f"{path}: {arrays.GetNumberOfArrays()} arrays"
    for name, array in wanted[1:]:
        same(path + " " + name, "vtk", vtk_to_numpy(arrays.GetArray(name)).reshape(array.shape), array)
    if path.endswith(".vtu"):
        assert vtk_to_numpy(data.GetFieldData().GetArray("TimeValue"))[0] == TIME, path
        note = bytes(vtk_to_numpy(data.GetFieldData().GetArray("diffusph")).astype("u1")).decode()
        assert note == "kernel=M6 <κ>", note


def read_with_meshio(path, wanted):
    mesh = meshio.read(path)
    n = len(wanted[0][1])
    assert sum(len(block.data) for block in mesh.cells) == n, path
    assert all(block.type == "vertex" for block in mesh.cells), path
    same(path, "meshio", mesh.points, wanted[0][1])
    assert len(mesh.point_data) == len(wanted) - 1, path
    for name, array in wanted[1:]:
        # meshio leaves the code of a blank in legacy names as it is.
        name = name.replace(" ", "%20") if path.endswith(".vtk") else name
        same(path + " " + name, "meshio", mesh.point_data[name].reshape(array.shape), array)


def read(folder):
    count = 0
    for name in sorted(os.listdir(folder)):
        path = os.path.join(folder, name)
        if name.endswith((".vtu", ".vtk")):
            wanted = read_expected(path)
            read_with_vtk(path, wanted)
            if name.endswith(".vtu") or len(wanted[0][1]):
                read_with_meshio(path, wanted)
            if pyvista and name.endswith(".vtu") and len(wanted[0][1]):
                same(path, "pyvista", np.asarray(pyvista.read(path).points), wanted[0][1])
            count += 1
    if pyvista:
        series = pyvista.get_reader(os.path.join(folder, "series.pvd"))
        assert series.time_values == [0.0, TIME], series.time_values
    print(count)


if __name__ == "__main__":
    task, folder = sys.argv[1:]
    if task == "write":
        write_xml(folder)
        write_defaults(folder)
        write_pieces(folder)
        write_legacy(folder)
        write_structured(folder)
        copy_data(folder)
    else:
        read(folder)
