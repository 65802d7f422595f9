//! VTK files.

use super::codes::DIFFUSPH_LOG_WARNING;
use super::guard::{Handle, with};
use super::pointers::file;
use std::ffi::c_char;

/// Writes the particles and their quantities, with the time: a .vtu, or a legacy .vtk if the name ends so. The file
/// appears whole or not at all. A .vtu holds all that decides how the solver goes on, except functions of the host; a legacy
/// file is for other tools and has no place for it.
///
/// Errors: BAD_VALUE for another ending, IO, OUT_OF_ORDER before T, m and kappa are set.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_write_vtk(s: *mut Handle, path: *const c_char) -> i32 {
    unsafe { with(s, |inside| inside.solver.write_vtk(file("path", path)?)) }
}

/// Writes the next snapshot of a series and lists it: for "run.pvd", the files run_0000.vtu, run_0001.vtu and so on
/// beside it. Snapshots listed at this time or later are replaced, so that a restarted run goes on where it stands; no file
/// that an earlier entry needs (by a link, or as a piece of it) is touched, and no earlier entry is dropped, whether its file
/// can be seen or not. Whenever the process is killed, the list on disk names files of its times: a snapshot that takes the
/// place of another stands beside it first, as run_0002.new.vtu, and has its usual name once the list has no other of it.
///
/// \param pvd_path the list, for ParaView; it ends in .pvd
///
/// Errors: as diffusph_write_vtk; BAD_FILE when the list is none.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_write_series(s: *mut Handle, pvd_path: *const c_char) -> i32 {
    unsafe { with(s, |inside| inside.solver.write_series(file("pvd_path", pvd_path)?).map(drop)) }
}

/// Takes particles from a VTK file (.vtu, .vtp, .pvtu, .pvtp, legacy .vtk). A snapshot of diffusph_write_vtk takes the place
/// of all that was set before (particles, quantities, numbers, laws, box and time), and the solver goes on from it to the bit
/// as the one that wrote it, if its words are the same; functions that were lent must be lent before. Of the file of another
/// program, positions are taken, every array with the name of a quantity that can be set, and the time if there is one.
/// In one and two dimensions particles may lie along any axes of the file, and are written along the same. The log is told
/// what the file has that is not taken, and what a legacy file of diffusph_write_vtk has no place for.
///
/// Errors: IO, BAD_FILE, BAD_VALUE naming the first bad element, or where the particles fill more dimensions than the solver
/// has; OUT_OF_ORDER naming a function that the snapshot needs; nothing is changed then.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_read_vtk(s: *mut Handle, path: *const c_char) -> i32 {
    unsafe {
        with(s, |inside| {
            let left_aside = inside.solver.read_vtk(file("path", path)?)?;
            left_aside.iter().for_each(|text| inside.tell(DIFFUSPH_LOG_WARNING, text));
            Ok(())
        })
    }
}
