//! What a host sets.

use super::guard::{Handle, with};
use super::pointers::{slice, strided, text};
use crate::model::fields;
use std::ffi::c_char;

/// The box. Without it, space is open.
///
/// \param lo       lower bounds, one per dimension, m
/// \param hi       upper bounds, one per dimension, m
/// \param periodic one per dimension, not 0 where the box repeats itself; NULL for none
///
/// Errors: BAD_VALUE for bounds that are not finite or a periodic axis without length.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_set_box(s: *mut Handle, lo: *const f64, hi: *const f64, periodic: *const i32) -> i32 {
    unsafe {
        with(s, |inside| {
            let dim = inside.solver.dim();
            let (lo, hi) = (slice("lo", lo, dim)?, slice("hi", hi, dim)?);
            let mut repeats = [false; 3];
            if !periodic.is_null() {
                let given = slice("periodic", periodic, dim)?;
                repeats.iter_mut().zip(given).for_each(|(to, &from)| *to = from != 0);
            }
            inside.solver.set_box(lo, hi, &repeats[..dim])
        })
    }
}

/// Positions, and with them, where given, masses, densities and smoothing lengths. The same number of particles as
/// before moves them, and they keep everything else; where the number changes, what was given per particle must be given
/// again, or as one number: until then, calls that need it answer OUT_OF_ORDER and name it. Nothing is copied twice: a host's own layout is described by `stride`, so x[n][3] has 3, and
/// xyzh(4,n) of Fortran has 4.
///
/// \param n      particles
/// \param x      positions, m; particle i at x[i * stride], dim doubles
/// \param stride doubles from one particle to the next
/// \param m      masses, kg, packed; NULL keeps what was set
/// \param rho    densities, kg/m^3, packed; NULL keeps what was set, or sums over neighbours
/// \param h      smoothing lengths, m, packed; NULL keeps what was set, or computes h_fac (m/rho)^(1/dim)
///
/// Errors: BAD_VALUE naming the first bad element, NO_MEMORY.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_set_particles(
    s: *mut Handle,
    n: i64,
    x: *const f64,
    stride: i64,
    m: *const f64,
    rho: *const f64,
    h: *const f64,
) -> i32 {
    unsafe {
        with(s, |inside| {
            let x = strided("x", x, n, stride, inside.solver.dim())?;
            let mut given = Vec::new();
            for (name, data) in [("m", m), ("rho", rho), ("h", h)] {
                if !data.is_null() {
                    given.push((name, strided(name, data, n, 1, 1)?));
                }
            }
            inside.solver.set_particles_with(x, &given)
        })
    }
}

/// A quantity of each particle, in the host's order; the catalogue "fields" lists them with their units. "x" moves
/// the particles; "u" sets T, which from then on follows where c_v is set; "b" sets b_x, b_y and b_z at once (dim doubles
/// per particle) and "kappa_ij" a symmetric tensor (xx; xx, yy, xy; xx, yy, zz, xy, yz, xz).
///
/// \param name   which
/// \param data   values; particle i at data[i * stride]
/// \param n      particles, as many as were set
/// \param stride doubles from one particle to the next; 1 if packed
///
/// Errors: UNKNOWN_WORD, OUT_OF_ORDER before diffusph_set_particles, WRONG_COUNT, BAD_VALUE naming the first bad element.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_set(
    s: *mut Handle,
    name: *const c_char,
    data: *const f64,
    n: i64,
    stride: i64,
) -> i32 {
    unsafe {
        with(s, |inside| {
            let name = text("name", name)?;
            let (dim, vector) = (inside.solver.dim(), fields::field(name).is_ok_and(|f| f.vector));
            let components = match fields::group(name, dim) {
                Some(slots) => slots.len(),
                None if vector => dim,
                None => 1,
            };
            inside.solver.set(name, strided(name, data, n, stride, components)?)
        })
    }
}

/// One value of a quantity for all particles, or a number of the solver such as "time"; the catalogues "fields" and
/// "numbers" list them.
///
/// Errors: UNKNOWN_WORD, BAD_VALUE.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_set_number(s: *mut Handle, name: *const c_char, value: f64) -> i32 {
    unsafe { with(s, |inside| inside.solver.set_number(text("name", name)?, value)) }
}

/// A quantity as a function of T, in words: "kappa" as "power kappa0=1 T0=300 n=2.5" or "table T=300,400 kappa=1,2";
/// the catalogue "laws" lists them. Setting the quantity takes the law away.
///
/// Errors: UNKNOWN_WORD, BAD_VALUE.
///
/// # Safety
/// The header's conventions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn diffusph_set_law(s: *mut Handle, name: *const c_char, words: *const c_char) -> i32 {
    unsafe { with(s, |inside| inside.solver.set_law(text("name", name)?, text("words", words)?)) }
}
