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
fn a_damaged_array_is_missed_by_those_who_need_it() {
    let folder = Folder::new();
    let damaged = [
        array("Float64", "vel", "NumberOfComponents=\"3\" format=\"binary\"", "**AAAAAAAA"),
        array("Float64", "vel", "NumberOfComponents=\"3\" format=\"binary\"", "YAAA"),
        array("Float64", "vel", "", "1 2 nonsense 4"),
    ];
    for vel in &damaged {
        let file = folder.write("a.vtu", square("", &(temperature() + vel)));
        let got = io::read(&file).unwrap();
        assert!(got.field("T").is_some() && got.left_aside.len() == 1, "{vel}");
        let needed =
            folder.write("b.vtu", square("", &vel.replace("vel", "T").replace("NumberOfComponents=\"3\"", "")));
        let mut s = diffusph::Solver::new("heat dim=2").unwrap();
        let error = s.read_vtk(&needed).unwrap_err();
        assert!(error.name() == "BAD_FILE" && error.to_string().contains("b.vtu"), "{error}");
    }
}

#[test]
fn an_array_that_nobody_needs_refuses_no_file() {
    let folder = Folder::new();
    for (other, reason) in [
        (array("Float64", "p", "", "-nan(ind) 1 2 3"), "'-nan(ind)' is no Float64"),
        (array("Float64", "p", "", "1 2 3 4 5"), "more than 4"),
        (array("Float64", "p", "", ""), "0 numbers where 4"),
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
    let odd = array("Float64", "p", "NumberOfComponents=\"3\"", "1 2 3 4");
    let told = solver.read_vtk(folder.write("b.vtu", square("", &(vector + &odd + &temperature())))).unwrap();
    assert!(told.len() == 2 && told[0].contains("'p' is left aside") && told[1].contains("not 3"), "{told:?}");
    let other = array("Float64", "temperature", "", "1 2 3 4");
    let told = solver.read_vtk(folder.write("c.vtu", square("", &(other + &temperature())))).unwrap();
    assert!(told.len() == 1 && told[0].contains("'temperature' is left aside"), "{told:?}");
    assert_eq!(solver.get_all("T").unwrap(), [1.0, 2.0, 3.0, 4.0]);
    assert!(solver.get_all("m").is_err());
}

/// What a host's log is told, by its level.
type Told = std::sync::Mutex<Vec<(i32, String)>>;

unsafe extern "C-unwind" fn hears(told: *mut std::ffi::c_void, level: i32, text: *const std::ffi::c_char) {
    // SAFETY: the test's word, and the library's.
    let (told, text) = unsafe { (&*told.cast::<Told>(), std::ffi::CStr::from_ptr(text)) };
    told.lock().unwrap().push((level, text.to_str().unwrap().into()));
}

#[test]
fn a_host_is_told_what_its_file_has_that_is_not_taken() {
    use diffusph::ffi::*;
    let (folder, told) = (Folder::new(), Told::default());
    let odd = array("Float64", "p", "NumberOfComponents=\"3\"", "1 2 3 4");
    let path = folder.write("a.vtu", square("", &(odd + &temperature())));
    let path = std::ffi::CString::new(path.to_str().unwrap()).unwrap();
    let (mut s, mut why) = (std::ptr::null_mut(), [0; 99]);
    // SAFETY: all places are ours and outlive the solver.
    unsafe {
        assert_eq!(diffusph_create(c"heat dim=2 threads=1".as_ptr(), &mut s, why.as_mut_ptr(), 99), 0);
        let user = std::ptr::from_ref(&told).cast_mut().cast();
        assert_eq!(diffusph_set_log_callback(s, Some(hears), user), 0);
        assert_eq!((diffusph_read_vtk(s, path.as_ptr()), diffusph_destroy(s)), (0, 0));
    }
    let told = told.into_inner().unwrap();
    assert!(told.len() == 1 && told[0].0 == DIFFUSPH_LOG_WARNING && told[0].1.contains("'p'"), "{told:?}");
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

#[test]
fn a_list_names_its_pieces_from_windows_too() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("sub")).unwrap();
    folder.write("sub/0.vtu", square("", &temperature()));
    let list = "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid><FieldData><DataArray type=\"Float64\" \
                Name=\"TimeValue\">0.5</DataArray></FieldData><Piece Source=\"sub\\0.vtu\"/></PUnstructuredGrid></VTKFile>";
    let got = io::read(folder.write("a.pvtu", list)).unwrap();
    assert_eq!((got.points.len(), got.time), (4, Some(0.5)));
}

#[test]
#[cfg(unix)]
fn what_is_no_file_is_refused_at_once() {
    let folder = Folder::new();
    let fifo = folder.path("fifo.vtu");
    assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    for path in [&fifo, Path::new("/dev/zero"), folder.0.path()] {
        for error in [io::read(path).unwrap_err(), io::Series::read(path).unwrap_err(), io::words(path).unwrap_err()] {
            assert!(error.name() == "IO" && error.to_string().contains("not a file"), "{error}");
        }
    }
}

#[test]
fn a_text_of_nothing_but_lines_is_stepped_over() {
    let folder = Folder::new();
    let lines = 20 << 20;
    let head = format!("# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nFIELD f 1\nnote 1 {lines} string\n");
    let text = head + &"\n".repeat(lines) + "POINTS 1 double\n0 0 0\n";
    let got = io::read(folder.write("a.vtk", text)).unwrap();
    assert!(got.notes.is_empty() && got.remarks[0].contains("too long"), "{:?}", got.remarks);
}

#[test]
fn a_file_made_to_take_long_is_refused_at_once() {
    let folder = Folder::new();
    let many = |prefix: &str| (0..200_000).map(|i| format!(" {prefix}{i}=\"1\"")).collect::<String>();
    let start = std::time::Instant::now();
    for attributes in [many("a"), many("xmlns:a")] {
        let text = square("", &temperature()).replace("<PointData>", &format!("<PointData{attributes}>"));
        assert!(refused(&folder.write("a.vtu", &text)).contains("no VTK file has"));
    }
    let words: String = (0..200_000).map(|i| format!(" w{i}=1")).collect();
    assert!(diffusph::Solver::new(&format!("heat dim=2{words}")).is_err());
    assert!(start.elapsed().as_secs_f64() < 2.0, "{:?}", start.elapsed());
}

#[test]
fn other_encodings_are_read_as_declared() {
    let folder = Folder::new();
    let name = |declared: &str| {
        format!("<?xml version=\"1.0\"{declared}?>{}", square("", &array("Float64", "T_#", "", "1 2 3 4")))
    };
    let latin = |text: String| text.bytes().map(|b| if b == b'#' { 0xfc } else { b }).collect::<Vec<u8>>();
    let got = io::read(folder.write("a.vtu", latin(name(" encoding=\"ISO-8859-1\"")))).unwrap();
    assert_eq!(got.fields[0].name, "T_ü");
    assert!(refused(&folder.write("b.vtu", latin(name("")))).contains("save it as UTF-8"));
    let doctype = square("", &temperature()).replace("<VTKFile", "<!DOCTYPE VTKFile SYSTEM \"vtk.dtd\"><VTKFile");
    assert_eq!(io::read(folder.write("c.vtu", doctype)).unwrap().fields.len(), 1);
}

#[test]
fn vectors_are_written_with_three_components_along_the_axes_of_the_file() {
    let folder = Folder::new();
    let mut solver = diffusph::Solver::new("heat dim=2 threads=1 kernel=C2").unwrap();
    // In the plane of x and z.
    let points: Vec<[f64; 3]> = (0..64).map(|i| [f64::from(i % 8), 5.0, f64::from(i / 8)]).collect();
    let number = |name: &str, values: Vec<f64>| io::Field { name: name.into(), components: 1, data: Data::F64(values) };
    let t = points.iter().map(|p| p[2]).collect();
    let fields = vec![number("T", t), number("m", vec![1.0; 64]), number("kappa", vec![1.0; 64])];
    solver.set_snapshot(&io::Snapshot { points: points.clone(), fields, ..io::Snapshot::default() }).unwrap();
    let path = folder.path("a.vtu");
    solver.write_vtk_with(&path, io::Options::default(), &["grad_T", "x"]).unwrap();
    let got = io::read(&path).unwrap();
    let of = |name: &str| (got.field(name).unwrap().components, got.field(name).unwrap().data.to_f64().unwrap());
    assert_eq!(of("x"), (3, points.as_flattened().to_vec()));
    let (components, gradient) = of("grad_T");
    assert_eq!(components, 3);
    for g in gradient.as_chunks::<3>().0 {
        assert!(g[0].abs() < 1e-9 && g[1] == 0.0 && (g[2] - 1.0).abs() < 1e-9, "{g:?}");
    }
}

/// A solver that can be written.
fn small() -> diffusph::Solver {
    let mut solver = diffusph::Solver::new("heat dim=2 threads=1 kernel=C2").unwrap();
    let number =
        |name: &str, value: f64| io::Field { name: name.into(), components: 1, data: Data::F64(vec![value; 64]) };
    let points = (0..64).map(|i| [f64::from(i % 8), f64::from(i / 8), 0.0]).collect();
    let fields = vec![number("T", 300.0), number("m", 1.0), number("kappa", 1.0)];
    solver.set_snapshot(&io::Snapshot { points, fields, ..io::Snapshot::default() }).unwrap();
    solver
}

#[test]
fn a_series_that_cannot_go_on_stays_as_it_was() {
    let folder = Folder::new();
    let mut solver = small();
    let list = folder.path("run.pvd");
    for time in [0.0, 1.0, 2.0] {
        solver.set_number("time", time).unwrap();
        solver.write_series(&list).unwrap();
    }
    let before =
        ["run.pvd", "run_0000.vtu", "run_0001.vtu", "run_0002.vtu"].map(|n| std::fs::read(folder.path(n)).unwrap());
    // A rerun, the list of which cannot be replaced.
    solver.set_number("time", 1.0).unwrap();
    solver.set_number("T", 400.0).unwrap();
    let mut series = io::Series::open_or_create(&list).unwrap();
    std::fs::remove_file(&list).unwrap();
    std::fs::create_dir(&list).unwrap();
    assert_eq!(solver.write_in(&mut series, io::Options::default(), &[]).unwrap_err().name(), "IO");
    std::fs::remove_dir(&list).unwrap();
    std::fs::write(&list, &before[0]).unwrap();
    let after =
        ["run.pvd", "run_0000.vtu", "run_0001.vtu", "run_0002.vtu"].map(|n| std::fs::read(folder.path(n)).unwrap());
    assert!(before == after);
    // When it can, what came after goes.
    solver.write_series(&list).unwrap();
    let listed: Vec<f64> = io::Series::read(&list).unwrap().entries().iter().map(|e| e.time).collect();
    assert_eq!((listed, folder.path("run_0002.vtu").exists()), (vec![0.0, 1.0], false));
}

#[test]
#[cfg(target_os = "linux")]
fn a_folder_that_may_not_be_read_may_be_written() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    std::fs::set_permissions(folder.0.path(), std::fs::Permissions::from_mode(0o333)).unwrap();
    let written = small().write_vtk(folder.path("a.vtu"));
    std::fs::set_permissions(folder.0.path(), std::fs::Permissions::from_mode(0o700)).unwrap();
    written.unwrap();
    assert!(io::read(folder.path("a.vtu")).is_ok());
}

#[cfg(feature = "cli")]
mod program {
    use super::*;
    use std::process::{Command, Output};

    fn run(folder: &Folder, arguments: &[&str]) -> (bool, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_diffusph"));
        let Output { status, stdout, stderr } = command.args(arguments).current_dir(folder.0.path()).output().unwrap();
        (status.success(), String::from_utf8_lossy(&[stdout, stderr].concat()).into_owned())
    }

    #[test]
    fn check_tells_what_it_leaves_aside_and_what_may_be_meant() {
        let folder = Folder::new();
        let long = "a_name_of_more_than_twelve_characters";
        let arrays = array("Float64", "T_ambient", "", "1 2 3 4")
            + &array("Float64", "Temperature", "", "1 2 3 4")
            + &array("UInt8", long, "", "1 2 3 4")
            + &array("Float64", "m", "NumberOfComponents=\"3\"", &"0 0 1 ".repeat(4))
            + &array("Float64", "p", "", "1 2 3");
        let cells = "</PointData><CellData><DataArray type=\"Float64\" Name=\"kappa\"/></CellData>";
        folder.write("a.vtu", square("", &arrays).replace("</PointData>", cells));
        let (good, text) = run(&folder, &["check", "a.vtu"]);
        assert!(good, "{text}");
        for expected in [
            "1 x UInt8",
            "p                                     left aside: it has 3 numbers",
            "left aside: a quantity has one component",
            "of cells, not of points",
            "perhaps T = \"Temperature\"",
        ] {
            assert!(text.contains(expected), "{expected}: {text}");
        }
        assert!(text.contains(&format!("{long} 1 x UInt8")), "{text}");
        folder.write("empty.vtu", "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid/></VTKFile>");
        let (good, text) = run(&folder, &["check", "empty.vtu"]);
        assert!(!good && text.contains("no particles") && !text.contains("usable"), "{text}");
    }

    #[test]
    fn arrays_of_cells_are_named_with_the_remedy() {
        let folder = Folder::new();
        let cells = "</PointData><CellData><DataArray type=\"Float64\" Name=\"T\"/></CellData>";
        folder.write("a.vtu", square("", "").replace("</PointData>", cells));
        let scene = |set: &str| {
            format!(
                "words = \"heat dim=2\"\n[particles]\nfile = \"a.vtu\"\n[set]\nm = 1\nkappa = 1\n{set}[time]\nend = 1\n"
            )
        };
        folder.write("a.toml", scene(""));
        let (good, text) = run(&folder, &["run", "a.toml"]);
        assert!(!good && text.contains("'T'") && text.contains("Cell Data to Point Data"), "{text}");
        folder.write("b.toml", scene("T = 1\n"));
        let (good, text) = run(&folder, &["run", "b.toml"]);
        assert!(good, "{text}");
    }

    #[test]
    fn a_scene_replaces_what_its_file_has_wrong() {
        let folder = Folder::new();
        folder.write("a.vtu", square("", &(temperature() + &array("Float64", "m", "", "1 2 3"))));
        let scene = |set: &str| {
            format!("words = \"heat dim=2\"\n[particles]\nfile = \"a.vtu\"\n[set]\nkappa = 1\n{set}[time]\nend = 1\n")
        };
        folder.write("a.toml", scene(""));
        let (good, text) = run(&folder, &["run", "a.toml"]);
        assert!(!good && text.contains("array 'm'") && text.contains("3 numbers where 4"), "{text}");
        folder.write("b.toml", scene("m = 1\n"));
        let (good, text) = run(&folder, &["run", "b.toml"]);
        assert!(good, "{text}");
    }
}
