//! The work item that particle codes are compared on: a periodic cube of n³ particles, each moved by up to 20 % of the
//! spacing, M4 with h_fac 1.3 (some 80 neighbours).

use diffusph::{Solver, Strided};

pub fn positions(n: usize) -> Vec<f64> {
    let mut state = 12345u64;
    let mut uniform = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let cells = (0..n * n * n).flat_map(|p| [p % n, p / n % n, p / n / n]);
    cells.map(|c| (c as f64 + 0.5 + 0.2 * uniform()) / n as f64).collect()
}

/// A solver of particles at `x` with temperatures `t`.
pub fn solver(x: &[f64], t: &[f64], words: &str) -> Solver {
    let mut solver = Solver::new(&format!("heat dim=3 kernel=M4 h_fac=1.3 {words}")).unwrap();
    solver.set_box(&[0.0; 3], &[1.0; 3], &[true; 3]).unwrap();
    solver.set_particles(Strided::new("x", x, t.len(), 3, 3).unwrap()).unwrap();
    for (name, value) in [("m", 1.0 / t.len() as f64), ("rho", 1.0), ("kappa", 1.0)] {
        solver.set_number(name, value).unwrap();
    }
    solver.set("T", Strided::packed(t)).unwrap();
    solver
}

pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
