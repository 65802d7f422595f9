"""The other side of vtk_matrix.rs: writes files with the packages that users have, and reads ours with them.

    vtk_matrix.py write FOLDER    fills FOLDER with files and, for each, the arrays that a reader must find
    vtk_matrix.py layouts FOLDER  fills FOLDER with files laid out in every way that programs do it and, for each, the arrays
                                  that VTK finds in it, T among them
    vtk_matrix.py read FOLDER     reads the files in FOLDER and compares them with the arrays beside them

The arrays of `case.ending` lie in `case.ending.arrays/`: one file of little-endian bytes per array, called
`number,type,components,name`; number 0 is the points. With DIFFUSPH_WITHOUT=pyvista, what pyvista does is left out.
"""

import base64
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


def stored_by_vtk(path):
    """What VTK finds: points and the numbers of each of them, or None where it finds no points or no T."""
    if path.endswith(".vtk"):
        reader = vtk.vtkGenericDataObjectReader()
        for what in ["Scalars", "Vectors", "Normals", "Tensors", "ColorScalars", "TCoords", "Fields"]:
            getattr(reader, f"ReadAll{what}On")()
    else:
        reader = {"vtu": vtk.vtkXMLUnstructuredGridReader, "vtp": vtk.vtkXMLPolyDataReader}[path[-3:]]()
    reader.SetFileName(path)
    reader.Update()
    data = reader.GetOutput()
    if not data or not data.GetNumberOfPoints() or not data.GetPointData().GetArray("T"):
        return None
    arrays = [data.GetPointData().GetArray(i) for i in range(data.GetPointData().GetNumberOfArrays())]
    numbers = [a for a in arrays if a and a.GetDataTypeAsString() != "bit"]
    whole = [a for a in numbers if a.GetNumberOfTuples() == data.GetNumberOfPoints()]
    return vtk_to_numpy(data.GetPoints().GetData()), {a.GetName(): vtk_to_numpy(a) for a in whole}


def layout(path, content):
    """Lays out one file, with what VTK reads from it beside it."""
    with open(path, "wb") as file:
        file.write(content)
    found = stored_by_vtk(path)
    assert found, f"VTK does not read {path}: {content[:2000]}"
    expect(path, found[0], found[1])


LEGACY_TYPES = {"double": ">f8", "float": ">f4", "long": ">i8", "vtktypeint64": ">i8", "unsigned_long": ">u8", "int": ">i4",
                "unsigned_int": ">u4", "short": ">i2", "unsigned_short": ">u2", "char": ">i1", "signed_char": ">i1",
                "unsigned_char": ">u1", "vtkIdType": ">i4", "DOUBLE": ">f8", "Float": ">f4"}
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
# Words between which any white space may stand; numbers, of the type whose name is the last word before them.
LEGACY_ARRAYS = {
    "components": ["SCALARS T double 1 LOOKUP_TABLE default", [1, 2, 3, 4]],
    "no components": ["SCALARS T float LOOKUP_TABLE default", [1, 2, 3, 4]],
    "field": ["FIELD f 1 T 1 4 double", [1, 2, 3, 4]],
    "two fields": ["FIELD f 2 v 3 4 float", range(12), "T 1 4 int", [1, 2, 3, 4]],
    "vectors": ["VECTORS v double", range(12), "SCALARS T double LOOKUP_TABLE default", [1, 2, 3, 4]],
    "normals": ["NORMALS n float", range(12), "SCALARS T double LOOKUP_TABLE default", [1, 2, 3, 4]],
    "tensors": ["TENSORS t float", range(36), "SCALARS T double LOOKUP_TABLE default", [1, 2, 3, 4]],
    "six": ["TENSORS6 t float", range(24), "SCALARS T double LOOKUP_TABLE default", [1, 2, 3, 4]],
    "textures": ["TEXTURE_COORDINATES c 2 float", range(8), "FIELD f 1 T 1 4 double", [1, 2, 3, 4]],
    "ids": ["GLOBAL_IDS id vtkIdType", range(4), "PEDIGREE_IDS p int", range(4), "FIELD f 1 T 1 4 double", [1, 2, 3, 4]],
    "edges": ["EDGE_FLAGS e int", range(4), "FIELD f 1 T 1 4 double", [1, 2, 3, 4]],
    "null": ["FIELD f 2 NULL_ARRAY T 1 4 double", [1, 2, 3, 4]],
    "five": ["FIELD f 2 odd 5 4 unsigned_char", range(20), "T 1 4 double", [1, 2, 3, 4]],
    "long": ["FIELD f 2 short 1 2 double", range(2), "T 1 4 double", [1, 2, 3, 4]],
    "metadata": ["SCALARS T double LOOKUP_TABLE default", [1, 2, 3, 4], "METADATA", b"\nCOMPONENT_NAMES\nkelvin\n\n",
                 "VECTORS v double", range(12)],
    "texts": ["FIELD f 2 words 1 2 string", b"\na%20b\n\n", "T 1 4 double", [1, 2, 3, 4]],
    "cells": ["CELL_DATA 4 SCALARS T int LOOKUP_TABLE default", [5, 6, 7, 8], "POINT_DATA 4 SCALARS T double LOOKUP_TABLE x",
              [1, 2, 3, 4], "LOOKUP_TABLE x 0"],
}
LEGACY_CELLS = {
    "UNSTRUCTURED_GRID": ["CELLS 4 8", [1, 0, 1, 1, 1, 2, 1, 3], "CELL_TYPES 4", [1, 1, 1, 1]],
    "POLYDATA": ["VERTICES 1 5", [4, 0, 1, 2, 3]],
    "UNSTRUCTURED_GRID ": ["CELLS 5 4 OFFSETS vtktypeint64", range(5), "CONNECTIVITY vtktypeint64", range(4), "CELL_TYPES 4",
                           b"", [1, 1, 1, 1]],
    "STRUCTURED_GRID": [],
}
CASES = {"upper": str.upper, "lower": str.lower, "title": str.title}
KEYWORD = "DATASET POINTS CELLS CELL_TYPES VERTICES POINT_DATA CELL_DATA SCALARS LOOKUP_TABLE FIELD VECTORS NORMALS TENSORS " \
          "TENSORS6 TEXTURE_COORDINATES GLOBAL_IDS PEDIGREE_IDS EDGE_FLAGS METADATA DIMENSIONS"


def legacy(parts, between, case, binary):
    """The parts with white space `between` the words."""
    keywords = set(KEYWORD.split())
    version = b"5.1" if any(isinstance(part, str) and "OFFSETS" in part for part in parts) else b"3.0"
    out = b"# vtk DataFile Version " + version + b"\ntitle\n" + (b"BINARY" if binary else b"ASCII")
    kind = "int"
    for part in parts:
        if isinstance(part, bytes):
            out += part
        elif isinstance(part, str):
            words = [CASES[case](w) if w in keywords else w for w in part.split()]
            out += between.encode() + between.join(words).encode()
            kind = next((w for w in reversed(words) if w in LEGACY_TYPES), "int")
        elif binary:
            out += b"\n" + np.array(part).astype(LEGACY_TYPES[kind]).tobytes() + b"\n"
        else:
            out += between.encode() + between.join(str(v) for v in part).encode()
    return out + b"\n"


def legacy_layouts(folder):
    count = itertools.count()
    path = lambda: f"{folder}/layout_{next(count)}.vtk"
    spaces = [" ", "\n", "\t", "\r\n", "\n\n ", " \n", "\v "]
    grid = lambda kind, of: ["DATASET " + kind] + (["DIMENSIONS 2 2 1"] if kind == "STRUCTURED_GRID" else []) \
        + ["POINTS 4 " + of, SQUARE.ravel()] + LEGACY_CELLS[kind]
    for (name, arrays), binary in itertools.product(LEGACY_ARRAYS.items(), [False, True]):
        if binary and name == "texts":
            continue  # they have lengths there: see write_legacy
        data = [] if name == "cells" else ["POINT_DATA 4"]
        for between, case, kind in itertools.product(spaces, CASES, LEGACY_CELLS):
            if binary and "\r" in between:
                continue
            if name == "cells" and kind.strip() != "UNSTRUCTURED_GRID":
                continue
            layout(path(), legacy(grid(kind, "double") + data + arrays, between, case, binary))
    for of, binary in itertools.product(LEGACY_TYPES, [False, True]):
        arrays = ["POINT_DATA 4", f"SCALARS T {of} LOOKUP_TABLE default", [1, 2, 3, 4]]
        layout(path(), legacy(grid("POLYDATA", of) + arrays, "\n", "upper", binary))
    for number in ["1.0", "1e0", "+1", "1.", ".5", "-.5e-3", "1E+2", "nan", "001"]:
        arrays = ["POINT_DATA 4", "SCALARS T double LOOKUP_TABLE default", [number] * 4]
        layout(path(), legacy(grid("POLYDATA", "float") + arrays, " ", "upper", False))


XML_TYPES = {"Float64": "f8", "Float32": "f4", "Int64": "i8", "UInt64": "u8", "Int32": "i4", "UInt32": "u4", "Int16": "i2",
             "UInt16": "u2", "Int8": "i1", "UInt8": "u1"}
XML_OTHERS = {
    "nothing": "",
    "texts": '<Array type="String" Name="words" format="ascii">65 0 66 0 67 0 68 0</Array>',
    "bits": '<DataArray type="Bit" Name="bits" format="ascii">1 0 1 0</DataArray>',
    "five": '<DataArray type="UInt8" Name="odd" NumberOfComponents="5" format="ascii">' + "1 2 3 4 5 " * 4 + "</DataArray>",
    "longer": '<DataArray type="Float64" Name="p" format="ascii">1 2 3 4 5 6</DataArray>',
    "nine": '<DataArray type="Float64" Name="S" format="ascii">' + "1 2 3 4 5 6 7 8 9 " * 4 + "</DataArray>",
    "outside": '<DataArray type="UInt8" Name="c" format="ascii">300 -1 2 3</DataArray>',
}
# Each head with what it does to the bytes of a file.
XML_HEADS = {
    "none": lambda text: text,
    "plain": lambda text: b'<?xml version="1.0"?>\n' + text,
    "mark": lambda text: b"\xef\xbb\xbf" + text,
    "latin": lambda text: b'<?xml version="1.0" encoding="ISO-8859-1"?>' + text.replace(b"Name='v'", b"Name='v\xfc'"),
    "ascii": lambda text: b'<?xml version="1.0" encoding="US-ASCII"?>' + text,
    "doctype": lambda text: b'<?xml version="1.0"?>\n<!DOCTYPE VTKFile SYSTEM "vtk.dtd">\n' + text,
    "comment": lambda text: b"<!-- <VTKFile a='>'> -->" + text,
}
XML_FORMATS = {
    "digits": ["ascii", "ASCII", "Ascii", "", None, "append", "appended", "Binary"],
    "base64": ["binary"],
    "offset": ["appended", "append", "ascii", "binary", "", None],
}


def xml(how, form, word, encoding, kinds, more):
    """A file of a square with T and v, each array stored in the same way."""
    appended, offset = b"", 0

    def array(name, kind, components, values):
        nonlocal appended, offset
        values = np.array(values).astype("<" + XML_TYPES[kind])
        head = f"<DataArray type='{kind}' Name='{name}' NumberOfComponents='{components}'"
        head += "" if form is None else f" format='{form}'"
        stored = np.array([values.nbytes]).astype("<u8" if word == "UInt64" else "<u4").tobytes() + values.tobytes()
        if how == "digits":
            return f"{head}>\n {' '.join(str(v) for v in values.ravel())}\n</DataArray>"
        if how == "base64":
            return f"{head}>\n{base64.b64encode(stored).decode()}\n</DataArray>"
        stored = base64.b64encode(stored) if encoding == "base64" else stored
        head += f" offset='{offset}'/>"
        appended, offset = appended + stored, offset + len(stored)
        return head

    points = array("Points", kinds[0], 3, SQUARE)
    data = array("T", kinds[1], 1, [1, 2, 3, 4]) + array("v", "Float32", 3, np.arange(12).reshape(4, 3)) + more
    text = f"<VTKFile type='UnstructuredGrid' version='1.0' byte_order='LittleEndian' header_type='{word}'>" \
           f"<UnstructuredGrid><Piece NumberOfPoints='4' NumberOfCells='0'><PointData>{data}</PointData>" \
           f"<Points>{points}</Points></Piece></UnstructuredGrid>"
    tail = f"<AppendedData encoding='{encoding}'>_".encode() + appended + b"</AppendedData>" if how == "offset" else b""
    return text.encode() + tail + b"</VTKFile>"


def xml_layouts(folder):
    count = itertools.count()
    path = lambda: f"{folder}/layout_{next(count)}.vtu"
    for how, forms in XML_FORMATS.items():
        for form, word, encoding in itertools.product(forms, ["UInt32", "UInt64"], ["raw", "base64"]):
            for other, head in itertools.product(XML_OTHERS.values(), XML_HEADS.values()):
                if how == "offset" or encoding == "raw":
                    layout(path(), head(xml(how, form, word, encoding, ["Float64", "Float64"], other)))
        for kinds in itertools.product(XML_TYPES, XML_TYPES):
            layout(path(), xml(how, forms[0], "UInt64", "raw", kinds, ""))


def resave(folder):
    """A snapshot of ours as VTK writes it again, in every format that it has for it."""
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(f"{folder}/ours.vtu")
    reader.Update()
    for binary in (False, True):
        writer = vtk.vtkUnstructuredGridWriter()
        writer.SetFileType(vtk.VTK_BINARY if binary else vtk.VTK_ASCII)
        writer.SetFileName(f"{folder}/legacy_{str(binary).lower()}.vtk")
        writer.SetInputData(reader.GetOutput())
        assert writer.Write()
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(f"{folder}/again.vtu")
    writer.SetInputData(reader.GetOutput())
    assert writer.Write()


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
    elif task == "resave":
        resave(folder)
    elif task == "layouts":
        vtk.vtkObject.GlobalWarningDisplayOff()
        legacy_layouts(folder)
        xml_layouts(folder)
    else:
        read(folder)
