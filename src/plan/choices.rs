//! The words that a solver is created with, read once.

use super::applies;
use super::auto::{self, Auto};
use super::preconditioner::{self, Preconditioner};
use super::rules::{RULES, Rule};
use crate::error::{Error, Result};
use crate::integrator::{self, Method, Options};
use crate::kernel::Kernel;
use crate::model::MODELS;
use crate::operator::table::{self, NORMALISATIONS};
use crate::operator::{Mean, Normalise, Operator};
use crate::words::{Words, choice};

/// Every word with its meaning and default, as `list words` prints it. `{kernels}`, `{operators}` and `{integrators}` stand
/// for the names in those tables.
pub static WORDS: &[(&str, &str)] = &[
    ("dim", "dimensions: 1, 2 or 3 (default 3)"),
    ("kernel", "{kernels} (default M6)"),
    ("h_fac", "smoothing length over particle spacing (default: the kernel's own, of {h_fac})"),
    ("operator", "{operators}; a tensor kappa is taken by {tensors} (default brookshaw)"),
    ("order", "of consistent: exact for polynomials of degree 2, 4 or 6 (default 4)"),
    ("theta", "of two-first and limited: penalty on jumps that the gradients do not explain, 0 for none (default 1)"),
    (
        "gradient",
        "of two-first and limited: corrected, exact for linear fields; plain, as in the paper, with 1/(Omega rho) (default corrected)",
    ),
    (
        "allow",
        "what is refused otherwise, by commas: unstable, modes that may grow (T that grows in a step still is); energy, consistent weights that make over 1 %; volumes, far from distances (K_d2) or with neighbours out of reach; flat, particles of fewer dimensions",
    ),
    (
        "normalise",
        "tensor: scale pairs so that each particle conducts alike in all directions that it has; pair: by the mean of 1/K_a and 1/K_b, K_d2 being right in the mean over directions; none (default: the operator's own; of projected, what it starts from)",
    ),
    (
        "mean",
        "of kappa between two particles: harmonic, which jumps of kappa need, arithmetic, which fronts of kappa(T) into the cold need, for the others are 0 where one kappa is, or geometric (default harmonic; kappa(T): arithmetic)",
    ),
    ("integrator", "{integrators} (default auto)"),
    ("stages", "pins the number of stages of rkl1 and rkl2 (default: as many as dt needs)"),
    (
        "change",
        "most that T may change in a sub-step of rkl1 and rkl2 with tolerance=off, relative to its spread; inf for no such limit (default 0.05)",
    ),
    (
        "max_stages",
        "most stages of rkl1 and rkl2 before a step is cut into sub-steps (default 31; 999 where tolerance= sees what rings)",
    ),
    (
        "bounds",
        "keep: T stays between its own extremes and those of the surroundings; free: only stability counts (default keep where the operator is positive; with the others a step that leaves them by more than 10 % is refused)",
    ),
    ("max_applications", "most applications of the operator in one step (default 10000000)"),
    (
        "tolerance",
        "most rms error of a sub-step over the spread of T, or how far T has come; off: dt, stability or change= decide (default off; auto, rkl1, rkl2 1e-3). They add up: over a decay to 0.1 to 3 times this, by euler, rkl1, backward-euler to 300 times",
    ),
    (
        "looks",
        "how often a host's source and kappa functions are looked at in a step besides stages, so that no pulse is missed; 0: never (default 8)",
    ),
    (
        "solver_tolerance",
        "residual of implicit integrators' equations, relative to the change that a stage makes (default 1e-10)",
    ),
    ("max_iterations", "most iterations of conjugate gradients in a stage of an implicit integrator (default 2000)"),
    (
        "preconditioner",
        "of implicit integrators' equations: multigrid, jacobi (the diagonal) or auto: multigrid where it repays (default auto)",
    ),
    ("threads", "worker threads; 0: as many as the process may use (default 0)"),
    ("memory", "most bytes for weights, like 2e9 (default: what the machine has available)"),
    ("without", "rules of the plan to switch off, separated by commas"),
];

/// Default of `change`. Measured on 20 %-jittered 64² and 128² particles, one step of 180 to 1600 explicit limits, error
/// in time relative to the spread of T at the beginning: a smooth mode 3e-2 without a limit, 5e-4 at 0.1, 2e-4 at 0.05;
/// a hot disc 0.3, 2e-3 and 5e-4, for 1.2 to 2 times the applications and still a fifth of ssprk3's.
const CHANGE: f64 = 0.05;

/// Default of `max_stages` where errors are estimated. Hot discs and modes on 24² particles, one step of 1e4 limits: 950 and
/// 870 applications instead of 1750 and 1700 with at most 31 stages, errors below the tolerance of 1e-3.
const CONTROLLED_STAGES: u32 = 999;

/// Default of `looks`.
const LOOKS: u32 = 8;

/// Default of `theta`. 20 % jitter, kappa_perp = 0, M4, M6 and C4 alike to a tenth, three seeds, b at 0 and 30 degrees: error of
/// a decaying mode on 32² particles 1.2 at 0, 0.28 at 0.1, 0.17 at 0.3, 0.10 at 1, 0.07 at 3, leakage across b 1e-5, 4e-5,
/// 9e-5, 3e-4, 7e-4; on 16³ error 0.72, 0.45, 0.35, 0.24, 0.18, leakage 4e-5, 3e-4, 9e-4, 3e-3, 9e-3.
const THETA: f64 = 1.0;

/// What a host insists on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Allow {
    /// Modes that may grow.
    pub unstable: bool,
    /// Energy that is made or lost.
    pub energy: bool,
    /// Volumes that do not fit the distances between particles.
    pub volumes: bool,
    /// Particles that leave an axis empty.
    pub flat: bool,
}

impl Allow {
    fn parse(list: Option<&str>) -> Result<Allow> {
        let mut allow = Allow::default();
        for name in list.into_iter().flat_map(|list| list.split(',')) {
            let all = [("unstable", 0), ("energy", 1), ("volumes", 2), ("flat", 3)];
            let Allow { unstable, energy, volumes, flat } = &mut allow;
            *[unstable, energy, volumes, flat][choice("allow", name, &all)?] = true;
        }
        Ok(allow)
    }
}

/// What becomes of the bounds of T.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Promise {
    /// Exactly kept, for operators that are positive.
    Kept,
    /// A step that leaves them by far is refused.
    Watched,
    Free,
}

pub struct Choices {
    pub line: String,
    pub kernel: Kernel,
    pub h_fac: f64,
    pub operator: &'static Operator,
    pub normalise: Normalise,
    /// Of consistent weights.
    pub order: u32,
    pub theta: f64,
    /// Gradients exact for linear fields, rather than those of the paper.
    pub corrected: bool,
    pub allow: Allow,
    /// As the host said.
    mean: Option<Mean>,
    pub method: &'static Method,
    /// The method is chosen anew for each step.
    pub auto: Option<Auto>,
    pub options: Options,
    pub bounds: Promise,
    /// Most relative change of T in a sub-step of a stabilised method.
    pub change: f64,
    /// Most error of a sub-step, relative to the spread of T; none: sub-steps are not controlled.
    pub tolerance: Option<f64>,
    pub preconditioner: Preconditioner,
    /// How often in a step the host's functions are looked at besides stages.
    pub looks: u32,
    pub threads: usize,
    pub memory: Option<u64>,
    without: Vec<&'static Rule>,
}

impl Choices {
    /// Reads `heat dim=3 kernel=M6 …`.
    ///
    /// # Errors
    /// `UnknownWord` or `BadValue` naming the word; `BadValue` too for one that can have no effect beside the others.
    pub fn parse(line: &str) -> Result<Choices> {
        let choices = Choices::parse_any(line)?;
        applies::check(&choices)?;
        Ok(choices)
    }

    /// The same, whether all words have an effect or not.
    pub(super) fn parse_any(line: &str) -> Result<Choices> {
        let mut words = Words::parse("words", line)?;
        let models: Vec<(&str, ())> = MODELS.iter().map(|m| (m.name, ())).collect();
        choice("model", words.bare().unwrap_or("nothing"), &models)?;
        let dim = words.count("dim", 1..=3)?.unwrap_or(3) as usize;
        let kernel = Kernel::new(words.take("kernel").unwrap_or("M6"), dim)?;
        let positive = |v: f64| v > 0.0 && v.is_finite();
        let h_fac = words.number("h_fac", "h_fac must be positive", positive)?.unwrap_or(kernel.h_fac());
        let operator = table::find(words.take("operator").unwrap_or("brookshaw"))?;
        let normalise = match words.take("normalise") {
            None => operator.normalise,
            Some(word) => choice("normalise", word, NORMALISATIONS)?,
        };
        let mean = words.take("mean").map(Mean::find).transpose()?;
        if mean == Some(Mean::Geometric) && !operator.is_one_matrix() {
            let rule =
                format!("operator={} knows harmonic and arithmetic means: two gradients have no other", operator.name);
            return Err(Error::bad("mean", "geometric", &rule));
        }
        let order = match words.take("order") {
            None => 4,
            Some(word) => choice("order", word, &[("2", 2), ("4", 4), ("6", 6)])?,
        };
        let (method, auto) = method(words.take("integrator").unwrap_or("auto"))?;
        if method.is_implicit() && !operator.dissipative {
            let able = table::OPERATORS.iter().filter(|o| o.dissipative).map(|o| o.name).collect::<Vec<_>>().join(", ");
            let rule = format!("integrator={} needs a linear operator that cannot grow: {able}", method.name);
            return Err(Error::bad("operator", operator.name, &rule));
        }
        let theta = words.number("theta", "theta must be finite and not negative", |v| v >= 0.0 && v.is_finite())?;
        let corrected = match words.take("gradient") {
            None => true,
            Some(word) => choice("gradient", word, &[("corrected", true), ("plain", false)])?,
        };
        let allow = Allow::parse(words.take("allow"))?;
        let (mut options, bounds) = options(&mut words, operator, allow.unstable)?;
        let change = words.number("change", "change must be positive", |v| v > 0.0)?.unwrap_or(CHANGE);
        // Those that take sub-steps of any length look at their errors unless told otherwise.
        let by_error = auto.is_some() || (method.is_stabilised() && options.stages.is_none());
        let tolerance = tolerance(&mut words, by_error.then_some(auto::TOLERANCE))?;
        let most = if tolerance.is_some() { CONTROLLED_STAGES } else { options.max_stages };
        options.max_stages = words.count("max_stages", 3..=10_000)?.map_or(most, |most| most as u32);
        let preconditioner =
            choice("preconditioner", words.take("preconditioner").unwrap_or("auto"), &preconditioner::KNOWN)?;
        if preconditioner == Preconditioner::Multigrid && !operator.is_one_matrix() {
            let able = table::OPERATORS.iter().filter(|o| o.dissipative && o.is_one_matrix());
            let able = able.map(|o| o.name).collect::<Vec<_>>().join(", ");
            let rule = format!("preconditioner=multigrid needs an operator that is one matrix: {able}");
            return Err(Error::bad("operator", operator.name, &rule));
        }
        let looks = words.count("looks", 0..=1000)?.map_or(LOOKS, |looks| looks as u32);
        let threads = words.count("threads", 0..=4096)?.unwrap_or(0) as usize;
        let memory = words.number("memory", "memory must be a positive number of bytes", positive)?.map(|m| m as u64);
        let without = without(words.take("without"))?;
        words.done()?;
        Ok(Choices {
            line: line.split_whitespace().collect::<Vec<_>>().join(" "),
            kernel,
            h_fac,
            operator,
            normalise,
            order,
            theta: theta.unwrap_or(THETA),
            corrected,
            allow,
            mean,
            method,
            auto,
            options,
            bounds,
            change,
            tolerance,
            preconditioner,
            looks,
            threads,
            memory,
            without,
        })
    }

    /// The mean of kappa between two particles: as the host said, or what suits the operator and kappa.
    pub fn mean(&self, kappa_of_t: bool) -> Mean {
        // Only arithmetic lets a front of kappa(T) run into what does not conduct yet. Weights that are exact for polynomials
        // keep their order with any smooth mean, for the Laplacian of mean(k_a, k_b) (T_b − T_a) is ∇·(k ∇T) at a. With
        // them harmonic errs 1.5 times as much as arithmetic where kappa is smooth (1 + sin/2), and 4 and 6 times less at
        // jumps by 3 and 10; at 100 arithmetic has growing modes.
        self.mean.unwrap_or(if kappa_of_t { Mean::Arithmetic } else { Mean::Harmonic })
    }

    /// Whether a rule is switched off.
    pub fn without(&self, rule: &Rule) -> bool {
        self.without.contains(&rule)
    }
}

fn options(words: &mut Words, operator: &Operator, unstable: bool) -> Result<(Options, Promise)> {
    let mut options = Options { max_applications: 10_000_000, ..Options::default() };
    options.stages = words.count("stages", 1..=10_000)?.map(|s| s as u32);
    // Beyond what it is positive for, only who insists gets weights of Espanol & Revenga.
    let able = operator.positive || (operator.has_angle() && !unstable);
    let bounds = match words.take("bounds") {
        None if able => Promise::Kept,
        None => Promise::Watched,
        Some(word) => choice("bounds", word, &[("keep", Promise::Kept), ("free", Promise::Free)])?,
    };
    if bounds == Promise::Kept && !able {
        let positive = table::OPERATORS.iter().filter(|o| o.positive).map(|o| o.name).collect::<Vec<_>>().join(", ");
        let rule = format!("bounds=keep needs an operator that is positive: {positive}");
        return Err(Error::bad("operator", operator.name, &rule));
    }
    options.keep_bounds = bounds == Promise::Kept;
    if let Some(most) = words.count("max_applications", 1..=u64::MAX)? {
        options.max_applications = most;
    }
    let tolerance = words.number("solver_tolerance", "it must be between 0 and 1", |v| v > 0.0 && v < 1.0)?;
    options.limits.tolerance = tolerance.unwrap_or(options.limits.tolerance);
    options.limits.iterations = words.count("max_iterations", 1..=1_000_000)?.unwrap_or(options.limits.iterations);
    Ok((options, bounds))
}

/// A method, and whether it is the first of several.
fn method(word: &str) -> Result<(&'static Method, Option<Auto>)> {
    if word != "auto" {
        let known = || integrator::METHODS.iter().map(|m| m.name).chain(["auto"]);
        return match integrator::find(word) {
            Ok(method) => Ok((method, None)),
            Err(_) => Err(Error::unknown("integrator", word, known())),
        };
    }
    let auto = Auto::default();
    Ok((auto.first()?, Some(auto)))
}

/// The least error of a sub-step, relative to the spread of T, that is more than its rounding.
const FINEST: f64 = 1e-13;

fn tolerance(words: &mut Words, default: Option<f64>) -> Result<Option<f64>> {
    match words.take("tolerance") {
        None => Ok(default),
        Some("off") => Ok(None),
        Some(word) => match word.parse::<f64>() {
            Ok(v) if (FINEST..1.0).contains(&v) => Ok(Some(v)),
            _ => Err(Error::bad(
                "tolerance",
                word,
                "it must be from 1e-13, below which rounding hides errors, to 1, or off",
            )),
        },
    }
}

fn without(list: Option<&str>) -> Result<Vec<&'static Rule>> {
    let find = |name: &str| RULES.iter().copied().find(|r| r.name == name);
    let unknown = |name: &str| Error::unknown("rule", name, RULES.iter().map(|r| r.name));
    list.into_iter().flat_map(|l| l.split(',')).map(|name| find(name).ok_or_else(|| unknown(name))).collect()
}

#[cfg(test)]
mod tests {
    use super::super::rules;
    use super::*;

    #[test]
    fn words_choose_and_wrong_words_are_answered() {
        let c = Choices::parse(
            "heat  dim=2 kernel=c4 operator=kernel normalise=none integrator=euler without=same_h,frozen",
        );
        let c = c.unwrap();
        assert_eq!((c.kernel.name(), c.kernel.dim(), c.operator.name, c.normalise), ("C4", 2, "kernel", Normalise::No));
        assert!(c.without(&rules::SAME_H) && !c.without(&rules::AT_REST));
        for (line, expected) in [
            ("", "unknown model"),
            ("heet", "did you mean 'heat'"),
            ("heat dim=4", "from 1 to 3"),
            ("heat kernel=M9", "M4"),
            ("heat kernl=M4", "did you mean 'kernel'"),
            ("heat without=same", "same_h"),
            ("heat h_fac=-1", "h_fac must be positive"),
            ("heat dim=2 wall", "'wall'"),
            ("heat operator=direct integrator=sdirk2", "needs a linear operator that cannot grow: brookshaw"),
            ("heat operator=two-first theta=-1", "theta must be"),
            ("heat operator=limited mean=geometric", "harmonic and arithmetic"),
            ("heat solver_tolerance=0", "between 0 and 1"),
            ("heat tolerance=1", "from 1e-13"),
            ("heat tolerance=1e-20", "rounding hides"),
        ] {
            let text = Choices::parse(line).err().map(|e| e.to_string()).unwrap_or_default();
            assert!(text.contains(expected), "{line}: {text}");
        }
    }

    #[test]
    fn every_documented_word_is_read() {
        // Words that do not go together stand on different lines.
        let lines = [
            "dim=2 kernel=M4 h_fac=1.2 operator=consistent order=6 allow=unstable,energy,volumes,flat mean=geometric \
             integrator=rkl1 stages=5 bounds=free max_applications=7 threads=1 memory=1e9 without=same_h",
            "operator=two-first theta=0.5 gradient=plain normalise=pair integrator=sdirk2 solver_tolerance=1e-6 \
             max_iterations=500 preconditioner=jacobi tolerance=1e-5",
            "integrator=rkl2 tolerance=off change=0.1 max_stages=9 looks=16",
        ];
        let key = |word: &'static str| word.split('=').next().unwrap_or_default();
        let read: Vec<&str> = lines.iter().flat_map(|line| line.split_whitespace()).map(key).collect();
        for (word, _) in WORDS {
            assert!(read.contains(word), "{word}");
        }
        for line in lines {
            let made = Choices::parse(&format!("heat {line}"));
            assert!(made.is_ok(), "{line}: {}", made.err().unwrap());
        }
    }
}
