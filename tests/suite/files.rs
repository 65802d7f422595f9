//! Files of other programs, read as VTK reads them or refused with the reason; and what writing leaves on the disk.

use diffusph::io::{self, Data};
use std::path::{Path, PathBuf};

/// A folder with files.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
        std::fs::write(self.path(name), text).unwrap();
        self.path(name)
    }
}

/// A file of four points in a square, with these arrays of points, after this about the whole.
fn square(about: &str, arrays: &str) -> String {
    format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"><UnstructuredGrid>{about}\
         <Piece NumberOfPoints=\"4\" NumberOfCells=\"0\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\">\
         0 0 0 1 0 0 0 1 0 1 1 0</DataArray></Points><PointData>{arrays}</PointData></Piece></UnstructuredGrid></VTKFile>"
    )
}

fn array(kind: &str, name: &str, more: &str, values: &str) -> String {
    format!("<DataArray type=\"{kind}\" Name=\"{name}\" {more}>{values}</DataArray>")
}

fn temperature() -> String {
    array("Float64", "T", "", "1 2 3 4")
}

fn refused(path: &Path) -> String {
    let error = io::read(path).unwrap_err();
    assert!(["BAD_FILE", "IO"].contains(&error.name()), "{error}");
    error.to_string()
}

#[test]
fn an_array_that_nobody_needs_refuses_no_file() {
    let folder = Folder::new();
    for (other, reason) in [
        (array("Float64", "p", "", "-nan(ind) 1 2 3"), "'-nan(ind)' is no Float64"),
        (array("Float64", "p", "", "1 2 3 4 5"), "more than 4"),
        (array("Float64", "p", "", ""), "do not fit"),
        (array("Float64", "p", "NumberOfComponents=\"-1\"", "1"), "components"),
        (array("Float64", "p", "NumberOfComponents=\"0\"", ""), "components"),
        (array("Float64", "p", "format=\"binary\"", "CAAAAAAAAAAAAAAA"), "8 bytes where 4 values of 8"),
        (array("Float16", "p", "", "1 2 3 4"), "'Float16'"),
        (array("String", "p", "", "65 0 66 0 67 0 68 0"), "'String'"),
        (array("Bit", "p", "", "1 0 1 0"), "'Bit'"),
        ("<Array type=\"String\" Name=\"p\">65 0</Array>".into(), "'Array'"),
        (array("Float64", "p", "", "1 2 3 4").repeat(2), "several arrays"),
    ] {
        let got = io::read(folder.write("a.vtu", square("", &(other.clone() + &temperature())))).unwrap();
        assert_eq!(got.field("T").unwrap().data, Data::F64(vec![1.0, 2.0, 3.0, 4.0]));
        let error = got.usable("p").unwrap_err().to_string();
        assert!(error.contains(reason) && error.contains("'p'"), "{other}: {error}");
    }
}

#[test]
fn what_a_solver_needs_and_cannot_use_is_refused() {
    let folder = Folder::new();
    let mut solver = diffusph::Solver::new("heat dim=2 threads=1").unwrap();
    let path = folder.write("a.vtu", square("", &array("Float64", "T", "", "1 2 3 4 5")));
    let error = solver.read_vtk(&path).unwrap_err().to_string();
    assert!(error.contains("array 'T'") && error.contains("more than 4"), "{error}");
    // Three numbers each are no mass, whatever they are called.
    let vector = array("Float64", "m", "NumberOfComponents=\"3\"", &"0 0 1 ".repeat(4));
    solver.read_vtk(folder.write("b.vtu", square("", &(vector + &temperature())))).unwrap();
    assert_eq!(solver.get_all("T").unwrap(), [1.0, 2.0, 3.0, 4.0]);
    assert!(solver.get_all("m").is_err());
}

#[test]
fn pieces_share_what_all_of_them_have() {
    let folder = Folder::new();
    let rank = array("Float64", "rank", "", "0 0 0 0");
    folder.write("0.vtu", square("", &(temperature() + &rank)));
    folder.write("1.vtu", square("", &array("Float32", "T", "", "5 6 7 8")));
    let list = |pieces: &str| {
        format!("<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid>{pieces}</PUnstructuredGrid></VTKFile>")
    };
    let got = io::read(folder.write("a.pvtu", list("<Piece Source=\"0.vtu\"/><Piece Source=\"1.vtu\"/>"))).unwrap();
    assert_eq!(got.field("T").unwrap().data, Data::F64((1..9).map(f64::from).collect()));
    assert!(got.usable("rank").unwrap_err().to_string().contains("not the same in all pieces"));
    let twice = folder.write("b.pvtu", list(&"<Piece Source=\"./0.vtu\"/>".repeat(2000)));
    assert!(refused(&twice).contains("twice"));
}

#[test]
fn ghosts_are_no_particles() {
    let folder = Folder::new();
    for kind in ["UInt8", "Int8"] {
        let marks = array(kind, "vtkGhostType", "", "0 1 0 2");
        let flow = array("Float32", "v", "NumberOfComponents=\"2\"", "1 2 3 4 5 6 7 8");
        let got = io::read(folder.write("a.vtu", square("", &(temperature() + &marks + &flow)))).unwrap();
        assert_eq!(got.points, [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(got.field("T").unwrap().data, Data::F64(vec![1.0, 3.0]));
        assert_eq!(got.field("v").unwrap().data, Data::F32(vec![1.0, 2.0, 5.0, 6.0]));
        assert!(got.ghosts == 2 && got.remarks[0].contains("2 points are ghosts"), "{:?}", got.remarks);
    }
}

#[test]
fn of_several_time_steps_the_first_is_read() {
    let folder = Folder::new();
    let step = |k: usize, values| array("Float64", "T", &format!("TimeStep=\"{k}\""), values);
    let arrays = step(0, "1 2 3 4") + &step(1, "11 12 13 14") + &step(2, "21 22 23 24");
    let text = square("", &arrays).replace("<UnstructuredGrid>", "<UnstructuredGrid TimeValues=\"0.5 1 1.5\">");
    let got = io::read(folder.write("a.vtu", text)).unwrap();
    assert_eq!((got.time, &got.field("T").unwrap().data), (Some(0.5), &Data::F64(vec![1.0, 2.0, 3.0, 4.0])));
    assert!(got.remarks[0].contains("3 time steps"), "{:?}", got.remarks);
}

#[test]
fn the_time_has_two_names() {
    let folder = Folder::new();
    let about = |arrays: &str| square(&format!("<FieldData>{arrays}</FieldData>"), "");
    let time = |name, value| array("Float64", name, "NumberOfTuples=\"1\"", value);
    for (arrays, expected) in [
        (time("TIME", "0.5"), Some(0.5)),
        (time("TimeValue", "0.25") + &time("TIME", "0.5"), Some(0.25)),
        (time("TIME", "0.5") + &time("TimeValue", "0.25"), Some(0.25)),
        (time("TIME", "nan"), None),
    ] {
        assert_eq!(io::read(folder.write("a.vtu", about(&arrays))).unwrap().time, expected, "{arrays}");
    }
    let legacy = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nFIELD FieldData 2\nTIME 1 1 double\n0.5\n\
                  CYCLE 1 1 int\n7\nPOINTS 1 double\n0 0 0\n";
    assert_eq!(io::read(folder.write("a.vtk", legacy)).unwrap().time, Some(0.5));
}
