//! What a run found and what it took: accuracy against run time. One struct, as text for people, as JSON for programs.

use crate::plan::{self, readable};
use crate::sum::l2;
use serde::Serialize;
use std::fmt;

#[derive(Debug, Clone, Serialize)]
pub struct Report {
    pub title: String,
    /// What was taken from where, where it may not be expected.
    pub remarks: Vec<String>,
    pub words: String,
    pub particles: usize,
    pub dim: usize,
    /// Mean number of neighbours.
    pub neighbours: f64,
    pub threads: usize,
    /// Memory for particles and weights.
    pub bytes: f64,
    /// Time reached, s.
    pub time: f64,
    /// Against the exact solution, where the scene names one.
    pub accuracy: Option<Accuracy>,
    pub energy: Energy,
    pub temperature_before: Temperature,
    pub temperature: Temperature,
    pub work: Work,
    pub seconds: Seconds,
    /// Per particle and application of the operator, bounds on it included.
    pub ns_per_particle: Option<f64>,
    pub ns_per_pair: Option<f64>,
    pub left_out: Vec<LeftOut>,
    pub series: Option<String>,
    pub snapshots: usize,
}

/// Over the particles whose T is free; the same whatever T is counted from.
#[derive(Debug, Clone, Serialize)]
pub struct Accuracy {
    pub solution: String,
    /// sqrt(Σ (T − exact)² / Σ (exact − mean)²)
    pub l2: f64,
    /// max |T − exact| / (max exact − min exact)
    pub max: f64,
    pub particles: usize,
}

impl Accuracy {
    /// From pairs of T and exact. An exact solution that is the same everywhere is its own measure.
    pub fn new(solution: String, free: &[(f64, f64)]) -> Accuracy {
        let fold = |start: f64, of: fn(f64, f64) -> f64| free.iter().map(|(_, exact)| *exact).fold(start, of);
        let (low, high) = (fold(f64::INFINITY, f64::min), fold(f64::NEG_INFINITY, f64::max));
        let range = if high > low { high - low } else { high.abs() };
        let largest = free.iter().map(|(t, exact)| (t - exact).abs()).fold(0.0, f64::max);
        let max = if range > 0.0 { largest / range } else { largest };
        Accuracy { solution, l2: l2(free), max, particles: free.len() }
    }
}

#[derive(Debug, Clone, Serialize)]
pub struct Energy {
    pub before: f64,
    pub after: f64,
    /// The change over Σ |m c_v T|.
    pub relative: f64,
    /// Nothing lets energy in or out: the change is an error.
    pub isolated: bool,
    /// What came in, negative where it went out.
    #[serde(flatten)]
    pub heat: Heat,
}

/// By what heat came in, J.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Heat {
    #[serde(rename = "heat_source")]
    pub source: f64,
    #[serde(rename = "heat_surface")]
    pub surface: f64,
    #[serde(rename = "heat_fixed")]
    pub fixed: f64,
}

impl Heat {
    /// What came in at all, in words.
    fn ways(&self) -> String {
        let ways = [("sources", self.source), ("surfaces", self.surface), ("fixed T", self.fixed)];
        let told = ways.iter().filter(|(_, heat)| *heat != 0.0);
        told.map(|(way, heat)| format!("{} {} by {way}", if *heat > 0.0 { "+" } else { "-" }, Short(heat.abs())))
            .collect::<Vec<_>>()
            .join(" ")
    }
}

impl Energy {
    /// `size` is Σ |m c_v T|.
    pub fn new(before: f64, after: f64, size: f64, isolated: bool, heat: Heat) -> Energy {
        let relative = if size > 0.0 { (after - before) / size } else { 0.0 };
        Energy { before, after, relative, isolated, heat }
    }
}

#[derive(Debug, Clone, Copy, Serialize)]
pub struct Temperature {
    pub min: f64,
    pub max: f64,
}

#[derive(Debug, Clone, Default, Serialize)]
pub struct Work {
    pub steps: u64,
    pub substeps: u64,
    /// Stages of the last sub-step.
    pub stages: u64,
    /// Applications of the operator, those for its bound included.
    pub applications: u64,
    /// Largest stable explicit step at first, s.
    pub limit: f64,
    /// In steps.
    #[serde(skip)]
    pub seconds: f64,
    #[serde(skip)]
    pub heat: Heat,
}

impl Work {
    pub fn add(&mut self, step: &plan::Report) {
        if self.steps == 0 {
            self.limit = step.limit;
        }
        self.steps += 1;
        self.substeps += step.substeps;
        self.stages = step.stages;
        self.applications += step.applications;
        self.seconds += step.seconds;
        self.heat.source += step.heat_source;
        self.heat.surface += step.heat_surface;
        self.heat.fixed += step.heat_fixed;
    }
}

#[derive(Debug, Clone, Serialize)]
pub struct Seconds {
    pub setup: f64,
    pub solve: f64,
    pub files: f64,
    /// By pass of the plan, in the order in which they first ran.
    pub passes: Vec<(String, f64)>,
}

impl Seconds {
    /// Nanoseconds in the passes that apply the operator, over applications and `items`.
    pub fn per_application(&self, work: &Work, items: f64) -> Option<f64> {
        let applies = |name: &str| ["stages", "bound", "solve"].contains(&name);
        let seconds: f64 = self.passes.iter().filter(|(name, _)| applies(name)).map(|(_, s)| s).sum();
        let applied = work.applications as f64 * items;
        (applied > 0.0).then(|| 1e9 * seconds / applied)
    }
}

#[derive(Debug, Clone, Serialize)]
pub struct LeftOut {
    pub rule: &'static str,
    pub reason: &'static str,
    /// How far the result is the same without it: `same bits`, `same to rounding`, …
    pub result: String,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if !self.title.is_empty() {
            writeln!(f, "{}", self.title)?;
        }
        writeln!(f, "{}", self.words)?;
        let mut row = |name: &str, text: String| writeln!(f, "  {name:<12}{text}");
        for (i, remark) in self.remarks.iter().enumerate() {
            row(if i == 0 { "note" } else { "" }, remark.clone())?;
        }
        let (n, dim, neighbours) = (self.particles, self.dim, self.neighbours);
        row("particles", format!("{n} in {dim}-D, {neighbours:.1} neighbours, {}B", spaced(self.bytes)))?;
        let Work { steps, substeps, applications, limit, .. } = self.work;
        row("reached", format!("t = {:.6} in {steps} steps, explicit limit {}", Short(self.time), Short(limit)))?;
        if let Some(Accuracy { solution, l2, max, particles }) = &self.accuracy {
            row("error", format!("{l2:.2e} (l2), {max:.2e} (max) against '{solution}' at {particles} particles"))?;
        }
        let Energy { before, after, relative, isolated, heat } = self.energy;
        let (before, after) = (Short(before), Short(after));
        row(
            "energy",
            match isolated {
                true => format!("{before}, kept to {:.1e}", relative.abs()),
                false if heat == Heat::default() => format!("{before} became {after}; here it can enter and leave"),
                false => format!("{before} {} became {after}", heat.ways()),
            },
        )?;
        let (was, is) = (self.temperature_before, self.temperature);
        row("T", format!("{} to {}, was {} to {}", Short(is.min), Short(is.max), Short(was.min), Short(was.max)))?;
        let Seconds { setup, solve, files, passes } = &self.seconds;
        row(
            "run time",
            format!("{:.3} s: set up {setup:.3}, solve {solve:.3}, files {files:.3}", setup + solve + files),
        )?;
        if let (Some(particle), Some(pair)) = (self.ns_per_particle, self.ns_per_pair) {
            let threads = self.threads;
            row(
                "speed",
                format!("{particle:.1} ns per particle, {pair:.2} per pair and application, {threads} thread(s)"),
            )?;
        }
        row("work", format!("{substeps} sub-steps, {applications} applications of the operator"))?;
        let total: f64 = passes.iter().map(|(_, s)| s).sum();
        for (name, seconds) in passes.iter().filter(|(_, s)| *s > 0.0) {
            row("", format!("{name:<10}{seconds:>9.4} s {:>5.1} %", 100.0 * seconds / total))?;
        }
        for (i, LeftOut { rule, reason, result }) in self.left_out.iter().enumerate() {
            row(if i == 0 { "left out" } else { "" }, format!("{rule}: {reason} ({result})"))?;
        }
        match &self.series {
            Some(series) => row("wrote", format!("{series} ({} snapshots)", self.snapshots)),
            None => row("wrote", "nothing: the scene has no [output]".into()),
        }
    }
}

/// `1.2 M` with its space before the unit in any case.
fn spaced(v: f64) -> String {
    let text = readable(v);
    if text.contains(' ') { text } else { format!("{text} ") }
}

/// Six digits, with an exponent only where the number needs one.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Short(v) = *self;
        if v != 0.0 && (v.abs() < 1e-3 || v.abs() >= 1e7) && v.is_finite() {
            return write!(f, "{v:.4e}");
        }
        let text = format!("{v:.4}");
        f.write_str(if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 1.0, -2.5, 300.125, 1e-5, 1.5e8, f64::INFINITY].map(|v| Short(v).to_string());
        assert_eq!(texts, ["0", "1", "-2.5", "300.125", "1.0000e-5", "1.5000e8", "inf"]);
        assert_eq!((spaced(12.0), spaced(1.2e6)), ("12 ".into(), "1.2 M".into()));
    }

    #[test]
    fn an_error_is_measured_against_the_spread_of_the_exact_solution() {
        for origin in [0.0, 300.0] {
            let free = [(1.0, 1.0), (-1.5, -1.0), (1.0, 1.0), (-1.0, -1.0)].map(|(t, e)| (t + origin, e + origin));
            let found = Accuracy::new("sine".into(), &free);
            assert_eq!((found.l2, found.max, found.particles), (0.25, 0.25, 4), "{origin}");
        }
        let uniform = Accuracy::new("radiative_cooling".into(), &[(99.0, 100.0); 3]);
        assert!((uniform.l2 - 0.01).abs() < 1e-15 && (uniform.max - 0.01).abs() < 1e-15);
        assert_eq!(Accuracy::new("slab".into(), &[]).l2, 0.0);
    }

    #[test]
    fn energy_is_judged_against_its_size_not_its_sum() {
        let wave = Energy::new(1e-18, -2e-18, 3.0, true, Heat::default());
        assert!((wave.relative + 1e-18).abs() < 1e-30);
        let heat = Heat { source: 2.5, surface: 0.0, fixed: -1.0 };
        assert_eq!(heat.ways(), "+ 2.5 by sources - 1 by fixed T");
    }

    #[test]
    fn speed_counts_the_passes_that_apply_the_operator() {
        let passes = [("weights", 5.0), ("bound", 1.0), ("stages", 3.0)].map(|(n, s)| (n.to_string(), s)).to_vec();
        let seconds = Seconds { setup: 0.0, solve: 9.0, files: 0.0, passes };
        let work = Work { applications: 10, ..Work::default() };
        assert_eq!(seconds.per_application(&work, 4e8), Some(1.0));
        assert_eq!(seconds.per_application(&Work::default(), 4e8), None);
    }
}
