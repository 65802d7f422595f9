//! Each rule of the plan, on and off: the plan names it, the answer stays the same, and there is less work with it.

use crate::particles::*;
use diffusph::kernel::Kernel;
use diffusph::model::fields;
use diffusph::model::heat::{Conductivity, Release};
use diffusph::operator::Normalise;
use diffusph::operator::table::{Fit, OPERATORS, Operator, PAIRS};
use diffusph::plan::given::Offer;
use diffusph::plan::input::Input;
use diffusph::plan::rules::{self, RULES, Rule, Same};
use diffusph::plan::state::State;
use diffusph::plan::{Choices, Plan};
use diffusph::{Solver, Strided};
use std::sync::atomic::{AtomicU64, Ordering};

struct Scene {
    /// The rule that this scene is for.
    rule: &'static Rule,
    words: &'static str,
    set: fn(&mut Solver, &[f64]),
    /// Steps in units of 1e-5; none: rates of particles that move in between.
    steps: &'static [f64],
    work: Work,
}

/// What a rule saves.
enum Work {
    /// Runs of a pass: so many with the rule, so many without.
    Runs(&'static str, u64, u64),
    /// Applications of the operator: so many fewer at least.
    Applications(u64),
    /// It is seen from inside, in [`inside`].
    Inside,
}

use Work::{Applications, Inside, Runs};

fn nothing(_: &mut Solver, _: &[f64]) {}

fn kappa_by_place(s: &mut Solver, x: &[f64]) {
    set(s, "kappa", &field(x, 2, |p| 1.0 + p[0]));
}

fn hot_corner(s: &mut Solver, x: &[f64]) {
    set(s, "T", &field(x, 2, |p| if p[0] + p[1] < 0.2 { 2.0 } else { 1.0 }));
}

/// Smoothing lengths found with densities, in a cloud that is denser on the left; conduction along x.
fn found_lengths(s: &mut Solver, x: &[f64]) {
    let n = x.len() / 2;
    let squeezed: Vec<f64> = x.chunks(2).flat_map(|p| [p[0] * p[0], p[1]]).collect();
    let mut fresh = Solver::new(s.words()).unwrap();
    fresh.set_particles(Strided::new("x", &squeezed, n, 2, 2).unwrap()).unwrap();
    fresh.set_box(&[0.0; 2], &[1.0; 2], &[false, true]).unwrap();
    fresh.set_number("m", 1.0 / n as f64).unwrap();
    fresh.set_number("kappa", 1.0).unwrap();
    set(&mut fresh, "T", &s.get_all("T").unwrap());
    *s = fresh;
}

/// Conducts along one direction.
fn along(s: &mut Solver, _: &[f64]) {
    for (name, value) in [("kappa_par", 1.0), ("kappa_perp", 0.01), ("b_x", 0.8), ("b_y", 0.6)] {
        s.set_number(name, value).unwrap();
    }
}

const RATES: &[f64] = &[];

const fn scene(rule: &'static Rule, words: &'static str, steps: &'static [f64], work: Work) -> Scene {
    Scene { rule, words, set: nothing, steps, work }
}

const SCENES: &[Scene] = &[
    Scene { set: kappa_by_place, ..scene(&rules::AT_REST, "kernel=M4", &[3.0, 3.0, 7.0], Runs("weights", 1, 3)) },
    Scene {
        set: found_lengths,
        ..scene(&rules::AT_REST, "kernel=M4 integrator=rkl2", &[3.0, 90.0, 3.0], Runs("density", 1, 3))
    },
    scene(&rules::SAME_H, "kernel=M6", &[5.0], Inside),
    scene(&rules::UNIFORM_KAPPA, "kernel=M4 mean=geometric", &[5.0, 1.0], Inside),
    Scene { set: kappa_by_place, ..scene(&rules::ISOTROPIC, "kernel=M4 operator=espanol-revenga", &[5.0], Inside) },
    Scene { set: kappa_by_place, ..scene(&rules::FROZEN, "kernel=M4", &[5.0], Inside) },
    scene(&rules::NO_WALL, "kernel=M4", &[5.0], Inside),
    scene(&rules::NO_SOURCE, "kernel=M4", &[5.0], Inside),
    Scene { set: hot_corner, ..scene(&rules::QUIET_ROWS, "kernel=M4 integrator=ssprk3", &[2.0, 3.0], Inside) },
    scene(&rules::ONE_STAGE, "kernel=M4 integrator=rkl1 tolerance=off", &[0.01], Applications(2)),
    // The search for a lower bound takes 16 applications at least.
    scene(&rules::PROVEN_BOUND, "kernel=M4 integrator=euler", &[0.1, 0.1], Applications(16)),
    scene(&rules::PROVEN_BOUND, "kernel=M4 integrator=rkl2", &[0.1, 0.1], Applications(16)),
    Scene {
        set: hot_corner,
        ..scene(&rules::KEEP_MATRIX, "integrator=sdirk2 kernel=M4", &[90.0, 90.0, 200.0], Inside)
    },
    scene(&rules::RATE_ONLY, "kernel=M4", RATES, Runs("circles", 0, 2)),
    scene(&rules::RATE_ONLY, "kernel=M4 normalise=none", RATES, Runs("circles", 0, 2)),
    // Modes grow here, which is for a step to refuse.
    scene(&rules::RATE_ONLY, "operator=direct", RATES, Runs("circles", 0, 2)),
    Scene { set: kappa_by_place, ..scene(&rules::USED_ONCE, "kernel=C2 normalise=none", RATES, Runs("weights", 1, 2)) },
    scene(&rules::DECAYS, "kernel=M4", &[5.0], Runs("spectrum", 0, 1)),
    Scene { set: along, ..scene(&rules::DECAYS, "operator=two-first", &[5.0], Runs("spectrum", 0, 1)) },
    // Growth was allowed: it is looked for in vain.
    scene(&rules::DECAYS, "operator=direct allow=unstable", &[0.1], Runs("spectrum", 0, 1)),
    Scene {
        set: along,
        ..scene(&rules::DECAYS, "operator=espanol-revenga allow=unstable", &[0.1], Runs("spectrum", 0, 1))
    },
    scene(&rules::POSITIVE, "kernel=M4", &[5.0, 5.0], Runs("norm", 0, 4)),
];

/// What a scene came to.
struct Done {
    solver: Solver,
    values: Vec<f64>,
}

fn run(scene: &Scene, without: &str) -> Done {
    let x = lattice(70, 2, 0.3);
    let integrator = if scene.words.contains("integrator") { "" } else { " integrator=rkl2" };
    let mut s = unit_box(&format!("{}{integrator}{without}", scene.words), &x, 2, true);
    set(&mut s, "T", &field(&x, 2, |p| (7.0 * p[0]).sin() * (9.0 * p[1]).cos() + 2.0));
    (scene.set)(&mut s, &x);
    for factor in scene.steps {
        s.step(factor * 1e-5).unwrap_or_else(|e| panic!("{}{without}: {e}", scene.words));
    }
    let mut values = s.get_all("T").unwrap();
    if scene.steps.is_empty() {
        s.get_all("rate").unwrap();
        let moved: Vec<f64> = x.iter().map(|x| x + 1e-3).collect();
        s.set_particles(Strided::new("x", &moved, moved.len() / 2, 2, 2).unwrap()).unwrap();
        values = s.get_all("rate").unwrap();
    }
    Done { solver: s, values }
}

#[test]
fn every_rule_has_a_scene_and_changes_nothing_but_the_work() {
    for rule in RULES {
        assert!(SCENES.iter().any(|s| s.rule == *rule), "no scene for {}", rule.name);
    }
    for scene in SCENES {
        let name = format!("{} of {}", scene.rule.name, scene.words);
        let (mut with, mut without) = (run(scene, ""), run(scene, &format!(" without={}", scene.rule.name)));
        let (plan, other) = (with.solver.plan().unwrap(), without.solver.plan().unwrap());
        assert!(plan.leaves_out(scene.rule), "{name} does not hold in its scene:\n{plan}");
        assert!(!other.leaves_out(scene.rule) && other.disabled.contains(&scene.rule), "{other}");
        let (a, b) = (&with.values, &without.values);
        match scene.rule.same {
            Same::Bits => assert!(bits(a) == bits(b), "{name}: {:e}", l2(a, b)),
            // Sums of some twenty terms in another grouping.
            Same::Rounding => assert!(l2(a, b) < 1e-14, "{name}: {:e}", l2(a, b)),
            // Two methods of first order, a hundredth of the explicit limit: they differ by its square.
            Same::Order => assert!(l2(a, b) < 1e-4, "{name}: {:e}", l2(a, b)),
        }
        match scene.work {
            Runs(pass, few, many) => {
                assert_eq!([with.solver.runs(pass), without.solver.runs(pass)], [few, many], "{name}: {pass}");
            }
            Applications(fewer) => {
                let [few, many] = [&with, &without].map(|done| done.solver.spent().1);
                assert!(few + fewer <= many, "{name}: {few} and {many} applications");
            }
            Inside => {
                let [few, many] = ["", scene.rule.name].map(|without| inside(scene.rule, without));
                assert!(few < many, "{name}: {few} and {many}");
            }
        }
    }
}

/// What has run is what the plan lists, and what the plan has made has run.
#[test]
fn the_plan_is_the_program() {
    for scene in SCENES {
        for without in ["".into(), format!(" without={}", scene.rule.name)] {
            let mut s = run(scene, &without).solver;
            let (plan, case) = (s.plan().unwrap(), format!("{}{without}", scene.words));
            let listed = |name: &str| plan.passes.iter().any(|line| line.pass.name.0 == name);
            for (name, _) in s.spent().0 {
                assert!(listed(name), "{case}: {name} has run\n{plan}");
            }
            let stored = !plan.leaves_out(&rules::USED_ONCE);
            for pass in plan.passes.iter().map(|line| line.pass).filter(|pass| pass.make.is_some() && stored) {
                assert!(s.runs(pass.name.0) > 0, "{case}: {} has not run\n{plan}", pass.name.0);
            }
        }
    }
}

/// Evaluations of [`COUNTED`]'s weights and angular factors.
static ROWS: AtomicU64 = AtomicU64::new(0);
static ANGLES: AtomicU64 = AtomicU64::new(0);

static COUNTED: Operator = Operator {
    name: "counted",
    about: "Brookshaw's weights, counted",
    positive: true,
    dissipative: true,
    conserves: true,
    takes_tensors: true,
    normalise: Normalise::Pair,
    fit: Fit::Angle(|along, nu| {
        ANGLES.fetch_add(1, Ordering::Relaxed);
        0.5 * ((nu + 2.0) * along - nu)
    }),
    weight: |kernel: &Kernel, q: &[f64], w: &mut [f64], spare: &mut [f64]| {
        ROWS.fetch_add(q.len() as u64, Ordering::Relaxed);
        (OPERATORS[0].weight)(kernel, q, w, spare);
    },
    ..PAIRS
};

/// Particles as the scenes have them, prepared, of one kappa for all or one for each.
fn state(words: &str, counted: bool, each: bool) -> (State, Plan) {
    let x = lattice(70, 2, 0.3);
    let n = x.len() / 2;
    let mut choices = Choices::parse(&format!("heat dim=2 kernel=M4 threads=1 {words}")).unwrap();
    if counted {
        choices.operator = &COUNTED;
    }
    let mut state = State::new(choices).unwrap();
    let domain = diffusph::space::Domain::new(&[0.0; 2], &[1.0; 2], &[true; 2]).unwrap();
    let x = Strided::new("x", &x, n, 2, 2).unwrap();
    state.accept(&Offer { domain, x, given: &[], energy: None, anew: false }).unwrap();
    for (slot, value) in [(fields::M, 1.0 / n as f64), (fields::RHO, 1.0), (fields::KAPPA, 1.0), (fields::T, 1.0)] {
        state.put(slot, Input::Number(value)).unwrap();
    }
    if each {
        state.put(fields::KAPPA, Input::Each((0..n).map(|i| 1.0 + i as f64).collect())).unwrap();
    }
    let plan = state.prepare("a test").unwrap();
    (state, plan)
}

/// A measure of the work that a rule leaves out, where no pass stands for it.
fn inside(rule: &Rule, without: &str) -> u64 {
    let words = if without.is_empty() { String::new() } else { format!("without={without}") };
    let each = *rule == rules::FROZEN;
    let is = |rule_is: &Rule| *rule == *rule_is;
    if is(&rules::SAME_H) || is(&rules::ISOTROPIC) {
        let counter = if is(&rules::SAME_H) { &ROWS } else { &ANGLES };
        counter.store(0, Ordering::Relaxed);
        state(&words, true, false);
        return counter.load(Ordering::Relaxed);
    }
    if is(&rules::KEEP_MATRIX) {
        // Levels that a step finds.
        let (mut state, _) = state(&format!("integrator=sdirk2 {words}"), false, false);
        state.put(fields::T, Input::Each((0..state.len()).map(|i| i as f64).collect())).unwrap();
        state.step(1e-2).unwrap();
        let plan = state.prepare("a test").unwrap();
        let lacks = state.with_motion(&plan, |m| Ok(m.heat.multigrid.as_ref().is_none_or(|m| m.is_empty())));
        return u64::from(lacks.unwrap());
    }
    let (mut state, plan) = state(&words, false, each);
    if is(&rules::QUIET_ROWS) {
        // Weights that are not numbers are seen where a row is visited.
        let weights = state.weights.as_mut().unwrap();
        weights.matrix.scale(&state.pool, |_, _| f64::NAN);
        let n = state.len();
        let mut rate = vec![0.0; n];
        state.with_motion(&plan, |m| m.heat.rate(0.0, &vec![1.0; n], &mut rate)).unwrap();
        return rate.iter().filter(|r| r.is_nan()).count() as u64;
    }
    let busy = state.with_motion(&plan, |m| {
        Ok(match &m.heat {
            h if is(&rules::UNIFORM_KAPPA) => !matches!(h.conductivity, Conductivity::Number(_)),
            h if is(&rules::FROZEN) => !matches!(h.conductivity, Conductivity::Folded),
            h if is(&rules::NO_WALL) => h.surface.is_some(),
            h if is(&rules::NO_SOURCE) => !matches!(h.release, Release::None),
            _ => panic!("{} is not seen from inside", rule.name),
        })
    });
    u64::from(busy.unwrap())
}

#[test]
fn a_bound_that_may_be_far_too_high_is_never_called_good_enough() {
    // Gershgorin's bound of some of these operators is many times the largest rate: the sub-steps must be those that
    // a refined bound asks for.
    for (operator, more) in [("two-first", ""), ("two-first", "bounds=free"), ("consistent", ""), ("projected", "")] {
        for integrator in ["rkl2", "rkl1", "ssprk3"] {
            // `limit` refines the bound; a solver that was never asked must come to the same.
            let run = |without: &str, dt: Option<f64>| {
                let x = lattice(20, 2, 0.2);
                let uncut = if integrator == "ssprk3" { "" } else { "tolerance=off change=inf" };
                let words = format!("operator={operator} integrator={integrator} {uncut} {more} {without}");
                let mut s = unit_box(&words, &x, 2, true);
                if operator == "two-first" {
                    along(&mut s, &x);
                }
                set(&mut s, "T", &field(&x, 2, |p| (6.3 * p[0]).sin()));
                let dt = dt.unwrap_or_else(|| 10.0 * s.limit().unwrap());
                let report = s.step(dt).unwrap();
                (report.substeps, report.stages, bits(&s.get_all("T").unwrap()))
            };
            for dt in [None, Some(1e-6), Some(1e-5), Some(1e-4), Some(1e-3)] {
                let (with, without) = (run("", dt), run("without=proven_bound", dt));
                assert_eq!((with.0, with.1), (without.0, without.1), "{operator} {integrator} {dt:?}");
                assert!(with.2 == without.2, "{operator} {integrator} {dt:?}: other bits");
            }
        }
    }
}

#[test]
fn what_is_chosen_for_a_step_does_not_depend_on_the_steps_before() {
    // A refined bound is twice lower: where it decided, a second step could take another method than the first.
    let x = lattice(24, 2, 0.2);
    let run = |without: &str| {
        let mut s = unit_box(&format!("integrator=auto {without}"), &x, 2, true);
        set(&mut s, "T", &field(&x, 2, |p| if (p[0] - 0.5).hypot(p[1] - 0.5) < 0.2 { 1.0 } else { 0.0 }));
        for dt in [1e-3, 1e-2, 1e-1, 1e-3, 1.0] {
            s.step(dt).unwrap();
        }
        bits(&s.get_all("T").unwrap())
    };
    assert!(run("") == run("without=at_rest"));
}

#[test]
fn a_mode_that_grows_is_refused_before_it_has_grown() {
    let x = lattice(24, 2, 0.3);
    let step = |more: &str| {
        let mut s = unit_box(&format!("operator=direct {more}"), &x, 2, true);
        set(&mut s, "T", &field(&x, 2, |p| (6.3 * p[0]).sin()));
        s.step(1e-6).map(drop)
    };
    let e = step("").unwrap_err();
    assert!(e.name() == "BAD_VALUE" && e.to_string().contains("allow=unstable"), "{e}");
    step("allow=unstable").unwrap();
    step("allow=unstable without=decays").unwrap();
}

#[test]
fn the_plan_prints_what_runs_and_what_does_not() {
    let scene = scene(&rules::SAME_H, "kernel=M4", &[5.0], Inside);
    let scene = Scene { set: kappa_by_place, ..scene };
    let text = run(&scene, " without=same_h").solver.plan().unwrap().to_string();
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
