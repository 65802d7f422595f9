//! What a host gives is kept as it gave it: nothing turns into a default without a word, one quantity does not change another,
//! a call that fails leaves no trace, and the order of the host's particles leaves none either.

use crate::particles::*;
use diffusph::{Solver, Strided};

fn place(s: &mut Solver, x: &[f64]) -> diffusph::error::Result<()> {
    let dim = s.dim();
    s.set_particles(Strided::new("x", x, x.len() / dim, dim, dim)?)
}

#[test]
fn what_was_given_per_particle_is_asked_for_again_when_their_number_changes() {
    let x = lattice(10, 2, 0.2);
    let mut s = unit_box("kernel=M4 threads=1", &x, 2, true);
    for name in ["T", "c_v", "source", "rho"] {
        set(&mut s, name, &field(&x, 2, |p| 2.0 + p[0]));
    }
    set(&mut s, "fixed", &field(&x, 2, |p| f64::from(u8::from(p[0] < 0.2))));
    s.set_number("h_conv", 0.5).unwrap();
    s.step(1e-3).unwrap();
    let fewer = &x[..180];
    place(&mut s, fewer).unwrap();
    let asked = |s: &mut Solver| {
        let error = s.step(1e-3).unwrap_err();
        assert_eq!(error.name(), "OUT_OF_ORDER");
        let text = error.to_string();
        text.split(" for the ").next().unwrap().trim_start_matches("step needs ").to_string()
    };
    assert_eq!(asked(&mut s), "T (or u), rho, c_v, fixed, source");
    // What can be told without them is told, the rest is refused, by every door.
    assert!(s.get_all("m").is_ok() && s.get_all("h_conv").is_ok() && s.get_all("x").is_ok());
    for name in ["T", "c_v", "rho", "u", "h", "rate", "flux", "source", "K_d2"] {
        assert_eq!(s.get_all(name).unwrap_err().name(), "OUT_OF_ORDER", "{name}");
    }
    for name in ["energy", "T_min", "limit", "growth_rate"] {
        assert_eq!(s.get_number(name).unwrap_err().name(), "OUT_OF_ORDER", "{name}");
    }
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(s.write_vtk(dir.path().join("a.vtu")).unwrap_err().name(), "OUT_OF_ORDER");
    assert_eq!(s.plan().unwrap_err().name(), "OUT_OF_ORDER");
    // Given again, per particle or as one number, one after the other.
    set(&mut s, "T", &vec![3.0; 90]);
    assert_eq!(asked(&mut s), "rho, c_v, fixed, source");
    [("rho", 1.0), ("c_v", 1.5), ("fixed", 0.0)].iter().for_each(|(name, v)| s.set_number(name, *v).unwrap());
    assert_eq!(asked(&mut s), "source");
    set(&mut s, "source", &vec![1.0; 90]);
    s.step(1e-3).unwrap();
    // Numbers stay; the same number of particles keeps all; none are no reason to ask.
    assert!(s.get_all("h_conv").unwrap().iter().all(|h| *h == 0.5));
    place(&mut s, &moved(fewer)).unwrap();
    s.step(1e-3).unwrap();
    place(&mut s, &[]).unwrap();
    s.step(1e-3).unwrap();
    place(&mut s, fewer).unwrap();
    assert_eq!(asked(&mut s), "T (or u), source");
}

fn moved(x: &[f64]) -> Vec<f64> {
    x.iter().map(|x| x + 2e-3 * (40.0 * x).sin()).collect()
}

#[test]
fn tensors_are_asked_for_again_too() {
    let x = lattice(8, 2, 0.2);
    let mut s = unit_box("operator=two-first threads=1", &x, 2, true);
    s.set_number("T", 1.0).unwrap();
    s.set_number("kappa_par", 1.0).unwrap();
    let b: Vec<f64> = x.iter().map(|x| 1.0 + x).collect();
    s.set("b", Strided::new("b", &b, 64, 2, 2).unwrap()).unwrap();
    place(&mut s, &x[2..]).unwrap();
    assert!(s.step(1e-3).unwrap_err().to_string().contains("b_x, b_y for the 63"));
    // Another conductivity makes them needless.
    s.set_number("kappa", 1.0).unwrap();
    s.step(1e-3).unwrap();
}

#[test]
fn energies_that_were_given_stay_whatever_the_order() {
    let x = lattice(8, 2, 0.2);
    let (u, c_v) = (field(&x, 2, |p| 3.0 + p[0]), field(&x, 2, |p| 1.5 + p[1]));
    let make = |order: [&str; 2]| {
        let mut s = unit_box("kernel=M4 threads=1", &x, 2, true);
        for name in order {
            set(&mut s, name, if name == "u" { &u } else { &c_v });
        }
        s
    };
    let (mut a, mut b) = (make(["u", "c_v"]), make(["c_v", "u"]));
    assert_eq!(bits(&a.get_all("T").unwrap()), bits(&b.get_all("T").unwrap()));
    assert_eq!((bits(&a.get_all("u").unwrap()), bits(&b.get_all("u").unwrap())), (bits(&u), bits(&u)));
    assert_eq!(a.get_all("T").unwrap()[5], u[5] / c_v[5]);
    for s in [&mut a, &mut b] {
        s.step(1e-3).unwrap();
    }
    assert_eq!(bits(&a.get_all("T").unwrap()), bits(&b.get_all("T").unwrap()));
    // After a step, too: the energy is what stays.
    let before = a.get_number("energy").unwrap();
    a.set_number("c_v", 7.0).unwrap();
    assert!((a.get_number("energy").unwrap() / before - 1.0).abs() < 1e-14);
    // T that was given stays T.
    set(&mut a, "T", &u);
    a.set_number("c_v", 2.0).unwrap();
    assert_eq!(bits(&a.get_all("T").unwrap()), bits(&u));
    // As one number, and beyond all numbers.
    a.set_number("u", 8.0).unwrap();
    assert!(a.get_all("T").unwrap().iter().all(|t| *t == 4.0));
    a.set_number("u", 1e300).unwrap();
    assert_eq!(a.set_number("c_v", 1e-300).unwrap_err().name(), "BAD_VALUE");
    assert!(a.get_all("c_v").unwrap().iter().all(|c| *c == 2.0));
    // Moved and given in one call.
    let mut s = make(["u", "c_v"]);
    let (there, double) = (moved(&x), c_v.iter().map(|c| 2.0 * c).collect::<Vec<_>>());
    s.set_particles_with(Strided::new("x", &there, 64, 2, 2).unwrap(), &[("c_v", Strided::packed(&double))]).unwrap();
    assert_eq!(bits(&s.get_all("u").unwrap()), bits(&u));
    assert_eq!(s.get_all("T").unwrap()[5], u[5] / double[5]);
}

#[test]
fn a_source_that_is_set_takes_the_place_of_the_function() {
    let x = lattice(8, 2, 0.2);
    let mut s = unit_box("kernel=M4 threads=1", &x, 2, true);
    s.set_number("T", 1.0).unwrap();
    s.set_source_callback(Some(Box::new(|_, _, _, out| {
        out.fill(100.0);
        0
    })));
    assert!((s.get_all("rate").unwrap()[0] - 100.0).abs() < 1e-9);
    s.set_number("source", 2.0).unwrap();
    assert!((s.get_all("rate").unwrap()[0] - 2.0).abs() < 1e-9);
}

/// A solver that finds h and rho itself, before its first step.
fn free(x: &[f64], words: &str) -> Solver {
    let mut s = Solver::new(&format!("heat dim=2 threads=1 {words}")).unwrap();
    s.set_box(&[0.0; 2], &[1.0; 2], &[true; 2]).unwrap();
    place(&mut s, x).unwrap();
    [("m", 2.0 / x.len() as f64), ("kappa", 1.0)].iter().for_each(|(name, v)| s.set_number(name, *v).unwrap());
    set(&mut s, "T", &field(x, 2, |p| 1.0 + (std::f64::consts::TAU * p[0]).sin()));
    s
}

#[test]
fn a_call_that_fails_or_only_looks_leaves_no_trace_in_later_results() {
    let x = lattice(20, 2, 0.3);
    let elsewhere: Vec<f64> = x.iter().map(|x| x + 4e-3 * (40.0 * x).cos()).collect();
    let nothing: fn(&mut Solver) = |_| ();
    type Call = fn(&mut Solver);
    let between: [(&str, Call); 10] = [
        ("nothing", nothing),
        ("a step that is no step", |s| drop(s.step(-1.0).unwrap_err())),
        ("a step that is cancelled", |s| {
            s.set_progress_callback(Some(Box::new(|_, _| 1)));
            s.step(1e-4).unwrap_err();
            s.set_progress_callback(None);
        }),
        ("a step that becomes infinite", |s| {
            s.set_source_callback(Some(Box::new(|_, _, _, out| {
                out.fill(f64::NAN);
                0
            })));
            s.step(1e-4).unwrap_err();
            s.get_all("rate").unwrap_err();
            s.set_source_callback(None);
        }),
        ("a plan", |s| drop(s.plan().unwrap())),
        ("queries", |s| {
            for name in ["h", "rho", "K_d2", "grad_T", "flux", "omega"] {
                s.get_all(name).unwrap();
            }
        }),
        ("bounds", |s| assert!(s.limit().unwrap() > 0.0)),
        ("the spectrum", |s| assert!(s.get_number("growth_rate").unwrap().is_finite())),
        ("a snapshot", |s| {
            let dir = tempfile::tempdir().unwrap();
            s.write_vtk(dir.path().join("a.vtu")).unwrap();
        }),
        ("values that are refused", |s| {
            let n = s.len();
            s.set("kappa", Strided::packed(&vec![-1.0; n])).unwrap_err();
            s.set_number("m", 0.0).unwrap_err();
            s.set_box(&[0.0; 2], &[0.0; 2], &[true; 2]).unwrap_err();
            s.read_vtk("no/such.vtu").unwrap_err();
        }),
    ];
    for words in ["kernel=M4", "kernel=M4 integrator=rkl2 tolerance=off", "kernel=C2 integrator=sdirk2"] {
        let mut results = Vec::new();
        for (_, call) in between {
            let mut s = free(&x, words);
            s.step(1e-4).unwrap();
            place(&mut s, &elsewhere).unwrap();
            call(&mut s);
            place(&mut s, &moved(&x)).unwrap();
            call(&mut s);
            s.step(3e-3).unwrap();
            s.step(1e-5).unwrap();
            results.push(bits(&s.get_all("T").unwrap()));
        }
        for ((what, _), found) in between.iter().zip(&results) {
            assert!(*found == results[0], "{words}: {what}");
        }
    }
    // What was done at the place before does matter, to rounding: a control.
    let h = |steps: bool| {
        let mut s = free(&x, "kernel=M4");
        if steps {
            s.step(1e-4).unwrap();
        }
        place(&mut s, &elsewhere).unwrap();
        s.get_all("h").unwrap()
    };
    assert!(bits(&h(true)) != bits(&h(false)) && l2(&h(true), &h(false)) < 1e-13);
}

/// Some particles in one place, each with data of its own, in the host's order or another.
struct Crowd {
    x: Vec<f64>,
    data: Vec<(&'static str, Vec<f64>)>,
}

fn crowd(alike: bool) -> Crowd {
    let mut x = lattice(12, 2, 0.3);
    for (i, j) in [(0, 40), (7, 90), (7, 91), (7, 8), (100, 143)] {
        (x[2 * j], x[2 * j + 1]) = (x[2 * i], x[2 * i + 1]);
    }
    let own = |i: usize| if alike { 0.0 } else { ((7 * i) % 5) as f64 };
    let by = |f: &dyn Fn(usize) -> f64| (0..144).map(f).collect::<Vec<f64>>();
    let t = field(&x, 2, |p| 2.0 + (std::f64::consts::TAU * p[0]).sin() * p[1]);
    let data = vec![
        ("m", by(&|i| (1.0 + 0.1 * own(i)) / 144.0)),
        ("T", by(&|i| t[i] + 0.2 * own(i))),
        ("kappa", by(&|i| 1.0 + 0.3 * ((3 * i) % 7) as f64 * own(i))),
        ("c_v", by(&|i| 1.0 + 0.2 * ((5 * i) % 3) as f64 * own(i))),
    ];
    Crowd { x, data }
}

/// T after some steps, in the order of the crowd, with its particles handed over in another.
fn permuted(crowd: &Crowd, order: &[usize], words: &str, moves: bool) -> Vec<u64> {
    let take = |values: &[f64], each: usize| -> Vec<f64> {
        order.iter().flat_map(|&i| values[i * each..(i + 1) * each].iter().copied()).collect()
    };
    let mut s = Solver::new(&format!("heat dim=2 threads=1 {words}")).unwrap();
    s.set_box(&[0.0; 2], &[1.0; 2], &[true; 2]).unwrap();
    place(&mut s, &take(&crowd.x, 2)).unwrap();
    s.set_number("rho", 1.0).unwrap();
    crowd.data.iter().for_each(|(name, values)| set(&mut s, name, &take(values, 1)));
    for k in 0..4 {
        if moves {
            let there: Vec<f64> = crowd.x.iter().map(|x| x + 1e-3 * f64::from(k) * (9.0 * x).sin()).collect();
            place(&mut s, &take(&there, 2)).unwrap();
        }
        s.step(1e-3).unwrap();
    }
    let (t, mut back) = (s.get_all("T").unwrap(), vec![0.0; order.len()]);
    order.iter().zip(t).for_each(|(&i, t)| back[i] = t);
    bits(&back)
}

#[test]
fn the_order_of_the_host_s_particles_leaves_no_trace_even_where_they_are_in_one_place() {
    let usual: Vec<usize> = (0..144).collect();
    let mut random = Random(5);
    let mut shuffled = usual.clone();
    (0..144).for_each(|i| shuffled.swap(i, ((random.next() + 1.0) * 72.0) as usize % 144));
    let orders = [usual.iter().rev().copied().collect::<Vec<_>>(), shuffled];
    for words in ["kernel=M4", "kernel=C2 integrator=sdirk2", "kernel=M4 integrator=ssprk3 mean=geometric"] {
        for (alike, moves) in [(false, false), (false, true), (true, false), (true, true)] {
            let crowd = crowd(alike);
            let first = permuted(&crowd, &usual, words, moves);
            for order in &orders {
                assert!(first == permuted(&crowd, order, words, moves), "{words} alike: {alike} moves: {moves}");
            }
        }
    }
}
