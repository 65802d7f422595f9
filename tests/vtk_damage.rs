//! Damaged and forged files: an error at worst, never a panic, never memory on the file's word.

use diffusph::io::{self, Data, Encoding, Field, Options, Snapshot};
use std::ffi::c_void;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// The largest request for memory: this program has C's functions for it in place of the system's.
static LARGEST: AtomicUsize = AtomicUsize::new(0);

unsafe extern "C" {
    fn __libc_malloc(size: usize) -> *mut c_void;
    fn __libc_calloc(n: usize, size: usize) -> *mut c_void;
    fn __libc_realloc(place: *mut c_void, size: usize) -> *mut c_void;
}

// SAFETY of these three: every call is handed on unchanged.
#[unsafe(no_mangle)]
unsafe extern "C" fn malloc(size: usize) -> *mut c_void {
    LARGEST.fetch_max(size, Relaxed);
    unsafe { __libc_malloc(size) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn calloc(n: usize, size: usize) -> *mut c_void {
    LARGEST.fetch_max(n.saturating_mul(size), Relaxed);
    unsafe { __libc_calloc(n, size) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn realloc(place: *mut c_void, size: usize) -> *mut c_void {
    LARGEST.fetch_max(size, Relaxed);
    unsafe { __libc_realloc(place, size) }
}

/// The files here have some 2000 bytes. 2000 bytes of zlib can honestly hold 2 MB.
const ALLOWED: usize = 4 << 20;

fn cloud() -> Snapshot {
    let field = |name: &str, components, data| Field { name: name.into(), components, data };
    Snapshot {
        points: vec![[0.5, -1.0, f64::MAX], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]],
        fields: vec![
            field("T", 1, Data::F64(vec![f64::NAN, -0.0, 5e-324])),
            field("v", 3, Data::F32((0..9).map(|i| i as f32).collect())),
            field("kind", 1, Data::U8(vec![1, 2, 3])),
        ],
        time: Some(0.5),
        notes: vec![("diffusph".into(), "heat".into())],
        ..Snapshot::default()
    }
}

/// The bytes of every kind of file that we write, by name.
fn files(dir: &Path) -> Vec<(&'static str, Vec<u8>)> {
    let write = |name: &'static str, encoding, zlib| {
        let path = dir.join(name);
        io::write_vtu(&path, &cloud().view(), Options { encoding, zlib }).unwrap();
        (name, std::fs::read(path).unwrap())
    };
    let legacy = dir.join("legacy.vtk");
    io::write_legacy(&legacy, &cloud().view()).unwrap();
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let kept = |name: &'static str| (name, std::fs::read(data.join(name)).unwrap());
    vec![
        write("raw.vtu", Encoding::Raw, false),
        write("raw_zlib.vtu", Encoding::Raw, true),
        write("base64.vtu", Encoding::Base64, false),
        write("base64_zlib.vtu", Encoding::Base64, true),
        kept("ascii.vtu"),
        kept("ascii.vts"),
        ("legacy.vtk", std::fs::read(legacy).unwrap()),
        ("legacy_ascii.vtk", legacy_ascii().into_bytes()),
    ]
}

/// What programs write by hand.
fn legacy_ascii() -> String {
    let points: String = cloud().points.iter().map(|[x, y, z]| format!(" {x:?} {y:?} {z:?}\n")).collect();
    format!(
        "# vtk DataFile Version 3.0\nby hand\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 double\n{points}CELLS 3 6\n1 0 1 1 1 2\n\
         CELL_TYPES 3\n1 1 1\nPOINT_DATA 3\nSCALARS T double 1\n LOOKUP_TABLE default\nnan -0.0 5e-324\nVECTORS v float\n\
         0 1 2 3 4 5 6 7 8\nFIELD more 2\nkind 1 3 unsigned_char\n1 2 3\nnote 1 2 string\nheat%20\n\n"
    )
}

/// Reads `bytes` from a file; what is wrong must be said with the file's name, in little memory.
fn attempt(path: &Path, bytes: &[u8]) -> Option<Snapshot> {
    std::fs::write(path, bytes).unwrap();
    LARGEST.store(0, Relaxed);
    let result = io::read(path);
    let largest = LARGEST.load(Relaxed);
    assert!(largest < ALLOWED, "{largest} bytes at once for {result:?}: {}", String::from_utf8_lossy(bytes));
    match result {
        Ok(snapshot) => Some(snapshot),
        Err(e) => {
            assert!(e.name() == "BAD_FILE" && e.to_string().contains(path.to_str().unwrap()), "{e}");
            None
        }
    }
}

/// Marsaglia's xorshift64: the same damage in every run.
fn random(state: &mut u64, below: usize) -> usize {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state % below as u64) as usize
}

// One test, so that no other thread's memory is counted.
#[test]
fn damage_is_an_error_at_worst() {
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in files(dir.path()) {
        let path = dir.path().join(name);
        assert_eq!(attempt(&path, &bytes).unwrap().points, cloud().points, "{name}");
        every_truncation(&path, &bytes);
        wrong_bits(&path, &bytes);
    }
    forged_counts(dir.path());
    deep_nesting(dir.path());
    lists_of_themselves(dir.path());
    the_same_bytes_again(dir.path());
}

fn every_truncation(path: &Path, bytes: &[u8]) {
    for end in 0..bytes.len() {
        let got = attempt(path, &bytes[..end]);
        // Nothing may be missing but closing tags and white space.
        let closed =
            b"\n</AppendedData>\n</VTKFile>\n".ends_with(&bytes[end..]) || bytes[end..].trim_ascii().is_empty();
        // The legacy format does not announce its sections: cut between two, a file is whole.
        let legacy =
            path.extension().is_some_and(|e| e == "vtk") && got.as_ref().is_some_and(|g| g.points == cloud().points);
        assert!(got.is_none() || closed || legacy, "{path:?} cut to {end} of {}", bytes.len());
    }
}

fn wrong_bits(path: &Path, bytes: &[u8]) {
    let mut state = 88172645463325252;
    for _ in 0..4000 {
        let mut spoilt = bytes.to_vec();
        for _ in 0..1 + random(&mut state, 3) {
            let place = random(&mut state, spoilt.len());
            match random(&mut state, 3) {
                0 => spoilt[place] = b"0123456789<>&=\"\xff"[random(&mut state, 16)],
                _ => spoilt[place] ^= 1 << random(&mut state, 8),
            }
        }
        attempt(path, &spoilt);
    }
}

fn forged_counts(dir: &Path) {
    for (name, bytes) in files(dir) {
        let path = dir.join(name);
        for huge in ["4", "1000000000000", "18446744073709551615", "9223372036854775807", "-1", "99999999999999999999"]
        {
            for place in
                ["NumberOfPoints=\"3\"", "NumberOfComponents=\"3\"", "offset=\"0\"", "POINTS 3", "T 1 3", "CELLS 3 6"]
            {
                let Some(at) = bytes.windows(place.len()).position(|w| w == place.as_bytes()) else { continue };
                let forged = place.replace(['3', '0'], huge);
                let forged = [&bytes[..at], forged.as_bytes(), &bytes[at + place.len()..]].concat();
                // Cells are left aside, and so is an array that is not what its head says.
                let got = attempt(&path, &forged);
                let aside = got.is_none_or(|got| got.left_aside.len() == 1 && got.points == cloud().points);
                assert!(aside || place.starts_with("CELLS"), "{name}: {place} as {huge}");
            }
        }
    }
}

fn deep_nesting(dir: &Path) {
    let deep = "<a>".repeat(5000);
    for file in [deep.clone(), format!("<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid>{deep}")] {
        assert!(attempt(&dir.join("deep.vtu"), file.as_bytes()).is_none());
    }
}

fn lists_of_themselves(dir: &Path) {
    let list = "<VTKFile type=\"PPolyData\"><PPolyData><Piece Source=\"self.vtu\"/></PPolyData></VTKFile>";
    assert!(attempt(&dir.join("self.vtu"), list.as_bytes()).is_none());
}

fn the_same_bytes_again(dir: &Path) {
    let path = dir.join("again.vtu");
    let cloud = Snapshot { points: vec![[1.0, 2.0, 3.0]; 1000], ..Snapshot::default() };
    io::write_vtu(&path, &cloud.view(), Options::default()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let start = b"<PointData>\n";
    let at = bytes.windows(start.len()).position(|w| w == start).unwrap() + start.len();
    let array = b"<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/>";
    let read_again = |times| attempt(&path, &[&bytes[..at], &array.repeat(times), &bytes[at..]].concat());
    // The cells, which nobody reads, leave room for less than one more.
    assert!(read_again(0).is_some() && read_again(2).is_none());
}
