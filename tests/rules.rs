//! Each rule of the plan, on and off: the plan names it, and the answer stays the same.

mod particles;

use diffusph::plan::rules::{self, RULES, Same};
use diffusph::{Solver, Strided};
use particles::*;

struct Scene {
    /// The rule that this scene is for.
    rule: &'static str,
    words: &'static str,
    set: fn(&mut Solver, &[f64]),
    /// Steps in units of the explicit limit.
    steps: &'static [f64],
}

fn nothing(_: &mut Solver, _: &[f64]) {}

fn kappa_by_place(s: &mut Solver, x: &[f64]) {
    set(s, "kappa", &field(x, 2, |p| 1.0 + p[0]));
}

fn hot_corner(s: &mut Solver, x: &[f64]) {
    set(s, "T", &field(x, 2, |p| if p[0] + p[1] < 0.2 { 2.0 } else { 1.0 }));
}

/// In place of steps: rates of particles that move in between.
const RATES: &[f64] = &[];

const SCENES: &[Scene] = &[
    Scene { rule: "at_rest", words: "kernel=M4", set: kappa_by_place, steps: &[3.0, 3.0, 7.0] },
    Scene { rule: "same_h", words: "kernel=M6", set: nothing, steps: &[5.0] },
    Scene { rule: "uniform_kappa", words: "kernel=M4 mean=geometric", set: nothing, steps: &[5.0, 1.0] },
    Scene { rule: "isotropic", words: "kernel=M4 operator=espanol-revenga", set: kappa_by_place, steps: &[5.0] },
    Scene { rule: "frozen", words: "kernel=M4", set: kappa_by_place, steps: &[5.0] },
    Scene { rule: "no_wall", words: "kernel=M4", set: nothing, steps: &[5.0] },
    Scene { rule: "no_source", words: "kernel=M4", set: nothing, steps: &[5.0] },
    Scene { rule: "quiet_rows", words: "kernel=M4 integrator=ssprk3", set: hot_corner, steps: &[2.0, 3.0] },
    Scene { rule: "one_stage", words: "kernel=M4 integrator=rkl1", set: nothing, steps: &[0.01] },
    Scene { rule: "proven_bound", words: "kernel=M4 integrator=euler", set: nothing, steps: &[0.1, 0.1] },
    Scene { rule: "keep_matrix", words: "integrator=sdirk2 kernel=M4", set: hot_corner, steps: &[90.0, 90.0, 200.0] },
    Scene { rule: "rate_only", words: "kernel=M4", set: nothing, steps: RATES },
    Scene { rule: "used_once", words: "kernel=C2 normalise=none", set: kappa_by_place, steps: RATES },
    Scene { rule: "decays", words: "kernel=M4", set: nothing, steps: &[5.0] },
    Scene { rule: "positive", words: "kernel=M4", set: nothing, steps: &[5.0] },
];

fn run(scene: &Scene, without: &str) -> (diffusph::plan::Plan, Vec<f64>) {
    let x = lattice(70, 2, 0.3);
    let mut s = unit_box(&format!("{}{without}", scene.words), &x, 2, true);
    set(&mut s, "T", &field(&x, 2, |p| (7.0 * p[0]).sin() * (9.0 * p[1]).cos() + 2.0));
    (scene.set)(&mut s, &x);
    let limit = 1e-5;
    for factor in scene.steps {
        s.step(factor * limit).unwrap();
    }
    if scene.steps.is_empty() {
        s.get_all("rate").unwrap();
        let moved: Vec<f64> = x.iter().map(|x| x + 1e-3).collect();
        s.set_particles(Strided::new("x", &moved, moved.len() / 2, 2, 2).unwrap()).unwrap();
        let rate = s.get_all("rate").unwrap();
        return (s.plan().unwrap(), rate);
    }
    (s.plan().unwrap(), s.get_all("T").unwrap())
}

#[test]
fn every_rule_has_a_scene_and_changes_nothing_but_the_work() {
    for rule in RULES {
        let scene = SCENES.iter().find(|s| s.rule == rule.name).unwrap_or_else(|| panic!("no scene for {}", rule.name));
        let (plan, with) = run(scene, "");
        assert!(plan.leaves_out(rule), "{} does not hold in its scene:\n{plan}", rule.name);
        let (plan, without) = run(scene, &format!(" without={}", rule.name));
        assert!(!plan.leaves_out(rule) && plan.disabled.iter().any(|r| r.name == rule.name), "{plan}");
        match rule.same {
            Same::Bits => assert_eq!(bits(&with), bits(&without), "{}", rule.name),
            // Sums of some twenty terms in another grouping.
            Same::Rounding => assert!(l2(&with, &without) < 1e-14, "{}: {:e}", rule.name, l2(&with, &without)),
            // Two methods of first order, a hundredth of the explicit limit: they differ by its square.
            Same::Order => assert!(l2(&with, &without) < 1e-4, "{}: {:e}", rule.name, l2(&with, &without)),
        }
    }
}

#[test]
fn the_plan_prints_what_runs_and_what_does_not() {
    let text = run(&SCENES[3], " without=same_h").0.to_string();
    for part in
        ["4900 particles in 2-D", "weights", "fold", "left out", "no_wall", "without= says no", "same_h", "M pairs"]
    {
        assert!(text.contains(part) || (part == "M pairs" && text.contains("k pairs")), "{part} in\n{text}");
    }
}

#[test]
fn moving_particles_and_changing_kappa_are_noticed() {
    let x = lattice(20, 2, 0.3);
    let mut s = unit_box("kernel=M4", &x, 2, true);
    kappa_by_place(&mut s, &x);
    set(&mut s, "T", &field(&x, 2, |p| p[0]));
    s.step(1e-5).unwrap();
    let plan = s.plan().unwrap();
    assert!(plan.leaves_out(&rules::AT_REST) && plan.leaves_out(&rules::FROZEN));
    let moved: Vec<f64> = x.iter().map(|x| x + 1e-3).collect();
    s.set_particles(Strided::new("x", &moved, 400, 2, 2).unwrap()).unwrap();
    set(&mut s, "kappa", &field(&x, 2, |p| 2.0 + p[1]));
    let plan = s.plan().unwrap();
    assert!(!plan.leaves_out(&rules::AT_REST) && !plan.leaves_out(&rules::FROZEN));
    let before = s.get_all("T").unwrap();
    s.step(1e-5).unwrap();

    // A fresh solver with the same particles gives the same rate: nothing stale was used.
    let mut fresh = unit_box("kernel=M4", &moved, 2, true);
    set(&mut fresh, "kappa", &field(&x, 2, |p| 2.0 + p[1]));
    set(&mut fresh, "T", &before);
    fresh.step(1e-5).unwrap();
    assert!(l2(&fresh.get_all("T").unwrap(), &s.get_all("T").unwrap()) < 1e-14);
}
