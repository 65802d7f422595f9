//! Files of real packages, read by us to the bit, and ours read by them: VTK (which is ParaView's and pyvista's reader and
//! writer), pyvista and meshio. The other half is `vtk_matrix.py`.

use diffusph::io::{self, Data, Encoding, Field, Options, Series, Snapshot};
use diffusph::{Solver, Strided};
use std::path::{Path, PathBuf};
use std::process::Command;

fn python(task: &str, folder: &Path) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let interpreter = std::env::var_os("DIFFUSPH_PYTHON").map_or(root.join("target/venv/bin/python"), PathBuf::from);
    let script = root.join("tests/vtk_matrix.py");
    let run = Command::new(&interpreter).arg(script).arg(task).arg(folder).output();
    let run = run.unwrap_or_else(|e| {
        panic!(
            "cannot run {} ({e}); this test needs Python with VTK, pyvista and meshio:\n    python3 -m venv target/venv \
             && target/venv/bin/pip install meshio vtk pyvista numpy\nor set DIFFUSPH_PYTHON to an interpreter that has them",
            interpreter.display()
        )
    });
    assert!(run.status.success(), "{task}: {}", String::from_utf8_lossy(&run.stderr));
    String::from_utf8(run.stdout).unwrap()
}

/// `path.arrays/number,type,components,name`: the exchange format of this test.
fn expected(path: &Path) -> Snapshot {
    let mut folder = path.to_path_buf().into_os_string();
    folder.push(".arrays");
    let mut fields: Vec<(usize, Field)> =
        std::fs::read_dir(folder).unwrap().map(|file| array(&file.unwrap().path())).collect();
    fields.sort_by_key(|(number, _)| *number);
    let mut fields = fields.into_iter().map(|(_, field)| field);
    let points = fields.next().unwrap().data.to_f64().unwrap();
    Snapshot { points: points.as_chunks::<3>().0.to_vec(), fields: fields.collect(), ..Snapshot::default() }
}

fn array(path: &Path) -> (usize, Field) {
    let label = path.file_name().unwrap().to_str().unwrap();
    let parts: Vec<&str> = label.splitn(4, ',').collect();
    let [number, kind, components, name] = parts[..] else { panic!("{label}") };
    let bytes = std::fs::read(path).unwrap();
    macro_rules! values {
        ($type:ty) => {
            bytes.as_chunks().0.iter().map(|b| <$type>::from_le_bytes(*b)).collect()
        };
    }
    let data = match kind {
        "Float64" => Data::F64(values!(f64)),
        "Float32" => Data::F32(values!(f32)),
        "Int64" => Data::I64(values!(i64)),
        "UInt64" => Data::U64(values!(u64)),
        "Int32" => Data::I32(values!(i32)),
        "UInt32" => Data::U32(values!(u32)),
        "Int16" => Data::I16(values!(i16)),
        "UInt16" => Data::U16(values!(u16)),
        "Int8" => Data::I8(values!(i8)),
        "UInt8" => Data::U8(bytes),
        other => panic!("{other}"),
    };
    (number.parse().unwrap(), Field { name: name.into(), components: components.parse().unwrap(), data })
}

/// The little-endian bytes of an array.
fn bytes(data: &Data) -> Vec<u8> {
    match data {
        Data::F64(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
        Data::F32(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
        Data::I64(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
        Data::I32(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
        Data::U8(v) => v.clone(),
        other => panic!("{}", other.type_name()),
    }
}

/// The first difference in bits, if there is one.
fn difference(got: &Snapshot, wanted: &Snapshot) -> Option<String> {
    let flat = |s: &Snapshot| bytes(&Data::F64(s.points.as_flattened().to_vec()));
    if flat(got) != flat(wanted) {
        return Some(format!("{} points differ from {}", got.points.len(), wanted.points.len()));
    }
    if got.fields.len() != wanted.fields.len() {
        return Some(format!("{} arrays instead of {}", got.fields.len(), wanted.fields.len()));
    }
    wanted.fields.iter().find_map(|w| {
        let same = |g: &Field| {
            let kind = (g.components, g.data.type_name()) == (w.components, w.data.type_name());
            kind && bytes(&g.data) == bytes(&w.data)
        };
        (!got.field(&w.name).is_some_and(same)).then(|| format!("array {}", w.name))
    })
}

#[test]
fn we_read_what_others_write() {
    let dir = tempfile::tempdir().unwrap();
    python("write", dir.path());
    let entries = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().path());
    let files: Vec<PathBuf> = entries
        .filter(|p| ["vtu", "vtp", "vtk", "pvtu", "vts"].iter().any(|e| p.extension().is_some_and(|x| x == *e)))
        .collect();
    let mut wrong = Vec::new();
    for file in &files {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        match io::read(file) {
            Ok(got) => {
                wrong.extend(difference(&got, &expected(file)).map(|d| format!("{name}: {d}")));
                // VTK's files carry time and a text; meshio's, lists of pieces and structured grids (.vts) do not.
                let ours = !name.starts_with("meshio") && !name.ends_with(".pvtu") && !name.ends_with(".vts");
                // VTK writes eleven digits into its legacy ascii.
                let time = if name.contains("legacy") && name.contains("ascii") { 0.3 } else { 0.1 + 0.2 };
                if ours && got.time != Some(time) {
                    wrong.push(format!("{name}: time {:?}", got.time));
                }
                if ours && got.notes != [("note".into(), "two words".into())] {
                    wrong.push(format!("{name}: notes {:?}", got.notes));
                }
            }
            Err(e) => wrong.push(e.to_string()),
        }
    }
    assert!(wrong.is_empty(), "{} of {} files:\n{}", wrong.len(), files.len(), wrong.join("\n"));
    assert!(files.len() > 500, "only {} files were made", files.len());
}

/// Whatever VTK reads from a layout, we read the same numbers; arrays that nobody needs may be left aside, with the reason.
#[test]
fn layouts_are_read_as_vtk_reads_them() {
    let dir = tempfile::tempdir().unwrap();
    python("layouts", dir.path());
    let entries = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().path());
    let files: Vec<PathBuf> = entries.filter(|p| p.is_file()).collect();
    let wrong: Vec<String> = files.iter().filter_map(|file| unlike_vtk(file)).collect();
    assert!(wrong.is_empty(), "{} of {} files:\n{}", wrong.len(), files.len(), wrong[..wrong.len().min(20)].join("\n"));
    assert!(files.len() > 4000, "only {} files were made", files.len());
}

fn unlike_vtk(file: &Path) -> Option<String> {
    let text = || String::from_utf8_lossy(&std::fs::read(file).unwrap()).into_owned();
    let (got, wanted) = match io::read(file) {
        Ok(got) => (got, expected(file)),
        Err(e) => return Some(format!("{e}: {}", text())),
    };
    let numbers = |data: &Data| data.to_f64().unwrap().into_iter().map(f64::to_bits).collect::<Vec<_>>();
    let unlike = wanted.fields.iter().find(|w| match got.usable(&w.name) {
        Ok(Some(field)) => numbers(&field.data) != numbers(&w.data),
        Ok(None) => true,
        Err(_) => w.name == "T",
    });
    let points = (got.points != wanted.points).then_some("its points");
    let what = points.or(unlike.map(|w| w.name.as_str()))?;
    Some(format!("{}: {what} in {}", file.display(), text()))
}

fn cloud(n: usize) -> Snapshot {
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 5e-324, f64::MAX];
    let value = |i: usize| odd.get(i % 13).copied().unwrap_or((i as f64).sin());
    let field = |name: &str, components, data| Field { name: name.into(), components, data };
    Snapshot {
        points: (0..n).map(|i| [i as f64, (i as f64).cos(), 1.0 / (i + 1) as f64]).collect(),
        fields: vec![
            field("T", 1, Data::F64((0..n).map(value).collect())),
            field("v m s", 3, Data::F32((0..3 * n).map(|i| value(i) as f32).collect())),
            field("stress", 9, Data::F64((0..9 * n).map(value).collect())),
            field("id", 1, Data::I64((0..n).map(|i| (1 << 60) - i as i64).collect())),
            field("count", 2, Data::I32((0..2 * n).map(|i| i as i32 - 1000).collect())),
            field("kind", 1, Data::U8((0..n).map(|i| i as u8).collect())),
        ],
        time: Some(0.1 + 0.2),
        notes: vec![("diffusph".into(), "kernel=M6 <κ>".into())],
        ..Snapshot::default()
    }
}

fn lay_beside(path: &Path, snapshot: &Snapshot) {
    let folder = PathBuf::from(format!("{}.arrays", path.display()));
    std::fs::create_dir(&folder).unwrap();
    let points =
        Field { name: "points".into(), components: 3, data: Data::F64(snapshot.points.as_flattened().to_vec()) };
    for (number, field) in [&points].into_iter().chain(&snapshot.fields).enumerate() {
        let label = format!("{number},{},{},{}", field.data.type_name(), field.components, field.name);
        std::fs::write(folder.join(label), bytes(&field.data)).unwrap();
    }
}

#[test]
fn others_read_what_we_write() {
    let dir = tempfile::tempdir().unwrap();
    let mut count = 0;
    // 32768 doubles are one block of our compressor, without a rest.
    for n in [0, 1, 1000, 32768] {
        let snapshot = cloud(n);
        for (encoding, zlib) in [Encoding::Raw, Encoding::Base64].into_iter().flat_map(|e| [(e, false), (e, true)]) {
            let path = dir.path().join(format!("{n}_{encoding:?}_{zlib}.vtu"));
            io::write_vtu(&path, &snapshot.view(), Options { encoding, zlib }).unwrap();
            lay_beside(&path, &snapshot);
            count += 1;
        }
        let path = dir.path().join(format!("{n}.vtk"));
        io::write_legacy(&path, &snapshot.view()).unwrap();
        lay_beside(&path, &snapshot);
        count += 1;
    }
    let mut series = Series::open_or_create(dir.path().join("series.pvd")).unwrap();
    series.append(0.0, "1_Raw_false.vtu").unwrap();
    series.append(0.1 + 0.2, dir.path().join("1000_Raw_true.vtu")).unwrap();
    assert_eq!(python("read", dir.path()).trim(), count.to_string());
}

#[test]
fn one_wrong_bit_is_seen_on_both_sides() {
    let right = cloud(10);
    let mut wrong = cloud(10);
    wrong.points[9][2] = wrong.points[9][2].next_up();
    assert!(difference(&right, &right).is_none() && difference(&wrong, &right).is_some());
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.vtu");
    io::write_vtu(&path, &right.view(), Options::default()).unwrap();
    lay_beside(&path, &wrong);
    let python = std::panic::catch_unwind(|| python("read", dir.path()));
    let reason = *python.unwrap_err().downcast::<String>().unwrap();
    assert!(reason.contains("other bits"), "{reason}");
}

#[test]
fn lzma_is_refused_with_a_remedy_where_something_is_compressed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.vtu");
    let file = |points: &str| {
        format!(
            "<VTKFile type=\"UnstructuredGrid\" compressor=\"vtkLZMADataCompressor\"><UnstructuredGrid><Piece NumberOfPoints=\"1\">\
             <Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" {points}</DataArray></Points></Piece></UnstructuredGrid></VTKFile>"
        )
    };
    // Nothing in digits is compressed, whatever the head says.
    std::fs::write(&path, file("format=\"ascii\">1 2 3")).unwrap();
    assert_eq!(io::read(&path).unwrap().points, [[1.0, 2.0, 3.0]]);
    std::fs::write(&path, file("format=\"binary\">AQAAAAAAAAAAAAAA")).unwrap();
    let error = io::read(&path).unwrap_err().to_string();
    assert!(
        error.contains("a.vtu") && error.contains("LZMA") && error.contains("re-save the file with zlib"),
        "{error}"
    );
}

#[test]
fn a_snapshot_that_vtk_saves_again_goes_on_as_ours() {
    let folder = tempfile::tempdir().unwrap();
    let at =
        |p: i32, axis: i32| f64::from((p / 10i32.pow(axis as u32)) % 10) + 0.5 + 0.2 * f64::from(7 * p + axis).sin();
    let x: Vec<f64> = (0..200).map(|i| at(i / 2, i % 2) / 10.0).collect();
    let mut s = Solver::new("heat dim=2 kernel=M4 threads=1 h_fac=1.5").unwrap();
    s.set_box(&[0.0; 2], &[1.0; 2], &[true; 2]).unwrap();
    s.set_particles(Strided::new("x", &x, 100, 2, 2).unwrap()).unwrap();
    for (name, value) in [("m", 0.01), ("rho", 1.0), ("c_v", 3.0), ("T_ambient", 280.0), ("time", 0.25)] {
        s.set_number(name, value).unwrap();
    }
    s.set("T", Strided::packed(&x[..100])).unwrap();
    s.set_law("kappa", "power kappa0=2 T0=1 n=1.5").unwrap();
    s.step(1e-3).unwrap();
    s.write_vtk(folder.path().join("ours.vtu")).unwrap();
    python("resave", folder.path());
    let state = |s: &mut Solver| {
        s.step(1e-3).unwrap();
        let numbers = ["time", "energy", "mean_neighbours", "limit"].map(|name| s.get_number(name).unwrap().to_bits());
        let arrays = ["T", "kappa", "u", "h", "T_ambient"].map(|name| s.get_all(name).unwrap());
        (numbers, arrays)
    };
    let mut right = Solver::new(s.words()).unwrap();
    right.read_vtk(folder.path().join("ours.vtu")).unwrap();
    let right = state(&mut right);
    for (name, exact) in [("again.vtu", true), ("legacy_true.vtk", true), ("legacy_false.vtk", false)] {
        let mut again = Solver::new(s.words()).unwrap();
        again.read_vtk(folder.path().join(name)).unwrap();
        let now = state(&mut again);
        // VTK writes digits that do not hold a double in ASCII.
        let near =
            now.1.iter().flatten().zip(right.1.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-9 * b.abs().max(1.0));
        assert!(near && (now == right || !exact), "{name}");
    }
}
