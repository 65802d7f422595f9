//! The four sentences that Biriukov & Price end with, each held against numbers of the studies.

use super::catalogue::Request;
use super::convergence::Run;
use super::kernels::Moments;
use super::mode::{CUBIC, FCC, GLASS_2D, GLASS_3D, HEXAGONAL, JITTER_2D, JITTER_3D, SQUARE, Sample};
use super::page::Page;
use super::positivity::{Growth, limit};
use super::recommend::refused;
use super::run::Study;
use super::scene::{Exact, Numbers, Value};
use super::sod::{correlations, tubes};
use super::table::{Table, column, short};
use crate::error::Result;
use crate::operator::table::OPERATORS;
use std::path::Path;

/// Checks a sentence: says the answer, adds its numbers.
type Part = fn(&mut Page, &mut Table, &Request, &[Sample]) -> Result<()>;

const COLUMNS: [&str; 5] = ["claim", "particles", "first", "second", "ratio"];

/// # Errors
/// As the studies.
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("claims", "Four sentences of Biriukov & Price, held against numbers");
    let mut table = Table::new("numbers", &COLUMNS.map(|name| column(name, "")));
    let samples = samples(&request)?;
    let parts: [Part; 4] = [itself, anisotropic, implicit, cost];
    for (done, part) in parts.into_iter().enumerate() {
        if !request.goes_on(done, parts.len()) {
            page.complete = false;
            break;
        }
        part(&mut page, &mut table, &request, &samples)?;
    }
    page.tables.push(table);
    Ok(page)
}

fn samples(request: &Request) -> Result<Vec<Sample>> {
    let (plane, space) = request.pick((16, 6), (64, 16), (128, 32));
    let plane = [SQUARE, HEXAGONAL, JITTER_2D, GLASS_2D].map(|cloud| (cloud, plane));
    let space = [CUBIC, FCC, JITTER_3D, GLASS_3D].map(|cloud| (cloud, space));
    plane.into_iter().chain(space).map(|(cloud, n)| Sample::new(cloud, n)).collect()
}

/// As the slides had them: nothing is normalised.
fn plain(operator: &str) -> (String, String) {
    (format!("operator={operator} normalise=none"), operator.into())
}

/// 1: the kernel itself gives up to twice more accurate results than Brookshaw's form.
fn itself(page: &mut Page, table: &mut Table, _: &Request, samples: &[Sample]) -> Result<()> {
    let mut ratios = Vec::new();
    for sample in samples {
        let cloud = &sample.cloud;
        for kernel in ["M4", "M6"] {
            let error = |operator| Run::of(sample, kernel, &plain(operator)).map(|r| r.error);
            let (brookshaw, own) = (error("brookshaw")?, error("kernel")?);
            ratios.push((brookshaw / own, cloud.name, kernel));
            let claim = format!("1 l2, {kernel}: brookshaw, kernel");
            table.push([claim.into(), cloud.name.into(), brookshaw.into(), own.into(), (brookshaw / own).into()]);
        }
    }
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let (Some(worst), Some(best)) = (ratios.first(), ratios.last()) {
        let wins = ratios.iter().filter(|r| r.0 > 1.0).count();
        page.find(format!(
            "1. The kernel itself is up to twice as accurate as Brookshaw's form: {}. It wins in {wins} of {} cases, by {:.2} at most ({}, {}), and is {:.2} times worse at worst ({}, {}).",
            if wins == ratios.len() { "true" } else if wins == 0 { "false" } else { "true only on some particles and kernels" },
            ratios.len(), best.0, best.1, best.2, 1.0 / worst.0, worst.1, worst.2
        ));
    }
    Ok(())
}

/// 2: two first derivatives is the only stable way for anisotropic diffusion.
fn anisotropic(page: &mut Page, table: &mut Table, request: &Request, _: &[Sample]) -> Result<()> {
    let Growth { rates: [grows, ..], .. } = Growth::of("square", 0.0, request.pick(12, 32, 96))?;
    let claim = "2 growth rate h^2/kappa of Espanol-Revenga, kappa_xx alone: no tensor, tensor";
    table.push([claim.into(), SQUARE.name.into(), 0.0.into(), grows.into(), f64::NAN.into()]);
    let n = request.pick(16, 48, 96);
    let (mut stable, mut unstable) = (Vec::new(), Vec::new());
    for operator in OPERATORS.iter().filter(|o| o.takes_tensors()) {
        let [along, across] = [[1.0, 0.0], [0.0, 1.0]].map(|waves| tensor_error(operator.name, n, waves));
        let (along, across) = (along?, across?);
        let claim = format!("2 l2 of a wave along and of one across, kappa_xx alone: {}", operator.name);
        table.push([claim.into(), JITTER_2D.name.into(), along.into(), across.into(), f64::NAN.into()]);
        let said = format!("{} ({} and {})", operator.name, short(along), short(across));
        if along.is_finite() && across.is_finite() { stable.push(said) } else { unstable.push(operator.name) }
    }
    page.find(format!(
        "2. Two first derivatives is the only stable way for anisotropic diffusion: {}. With kappa_xx alone on jittered \
         particles these ran (error of a wave along and of one across): {}; these grew or were refused: {}. \
         Espanol-Revenga's weights are all positive up to kappa_par = {:.0} kappa_perp.",
        if stable.len() > 1 { "false" } else { "true" },
        stable.join(", "),
        unstable.join(", "),
        limit(2)
    ));
    Ok(())
}

/// Of a wave on jittered particles that conduct along x alone; no number where it grows.
fn tensor_error(operator: &str, n: usize, waves: [f64; 2]) -> Result<f64> {
    let mut scene = JITTER_2D.scene(n, &format!("operator={operator} integrator=ssprk2 bounds=free"))?;
    scene.set.remove("kappa");
    let tensor = [("kappa_par", 1.0), ("kappa_perp", 0.0), ("b_x", 1.0), ("b_y", 0.0)];
    scene.set.extend(tensor.map(|(name, v)| (name.to_string(), Value::Number(v))));
    // Across, hardly anything conducts: the wave stays as it is. An exact solution wants kappa > 0.
    let exact = [("waves", Numbers::List(waves.into())), ("kappa", Numbers::One(waves[0].max(1e-12)))];
    let parameters = exact.map(|(name, v)| (name.to_string(), v)).into();
    scene.exact = Some(Exact { name: "sine".into(), parameters });
    scene.time.end *= 2.0;
    match Study::new(scene, Path::new("")).and_then(|s| s.run(Path::new(""), Box::new(|_| true))) {
        Ok(report) => Ok(report.accuracy.map_or(f64::NAN, |a| a.l2)),
        Err(e) if refused(&e) => Ok(f64::NAN),
        Err(e) => Err(e),
    }
}

/// 3: the second derivative matters even where it is not explicit.
fn implicit(page: &mut Page, table: &mut Table, request: &Request, _: &[Sample]) -> Result<()> {
    const KERNELS: [&str; 4] = ["M4", "M6", "C2", "C4"];
    let (line, space) = request.pick((16, 2), (60, 5), (200, 24));
    let mut said = Vec::new();
    let mut all = Vec::new();
    for (dim, n, step) in [(1, line, 0.1), (3, space, request.pick(0.3, 0.1, 0.05))] {
        let h_facs = (0..).map(|i| 0.8 + step * f64::from(i)).take_while(|h| *h < if dim == 1 { 2.01 } else { 1.41 });
        let cases: Vec<_> = KERNELS.into_iter().flat_map(|k| h_facs.clone().map(move |h| (k, h, 1.4))).collect();
        let found = tubes(dim, n, &cases, |_| true)?;
        let mut ranks = Vec::new();
        for curve in found.chunk_by(|a, b| a.kernel == b.kernel) {
            let [plain, rank] = correlations(curve);
            let kernel = curve[0].kernel;
            let claim = format!("3 rank correlation of the tube's l2 with |K_d2 - 1|, {kernel}: plain, without trend");
            let cloud = if dim == 1 { "line" } else { FCC.name };
            table.push([claim.into(), cloud.into(), plain.into(), rank.into(), f64::NAN.into()]);
            // Where the gas fell apart at most h_fac there is none.
            ranks.extend(rank.is_finite().then_some((kernel, rank)));
        }
        let yes = ranks.iter().filter(|(_, rank)| *rank > 0.5).count();
        let ranks: Vec<String> = ranks.iter().map(|(kernel, rank)| format!("{kernel} {rank:.2}")).collect();
        said.push(format!("in {dim}-D for {yes} of {} kernels ({})", ranks.len(), ranks.join(", ")));
        all.push((yes, ranks.len()));
    }
    let answer = match [all.iter().all(|(yes, of)| yes == of), all.iter().all(|(yes, _)| *yes == 0)] {
        [true, _] => "true",
        [_, true] => "false",
        _ => "true only for some kernels",
    };
    page.find(format!(
        "3. The second derivative matters even where it is not explicit: {answer}. In the shock tube the density error \
         rises with |K_d2 - 1| over h_fac, once the smoothing by more neighbours is taken away (rank correlation above \
         0.5), {}.",
        said.join(", ")
    ));
    Ok(())
}

/// 4: M6 at h_fac 0.9 is twice better than M4 at 1.35 for the same cost.
fn cost(page: &mut Page, table: &mut Table, request: &Request, samples: &[Sample]) -> Result<()> {
    let mut ratios = Vec::new();
    let claim = |what: &str| format!("4 {what}: M4 at 1.35, M6 at 0.9");
    for sample in samples {
        let cloud = &sample.cloud;
        let error = |kernel, h_fac: f64| {
            let (words, name) = plain("brookshaw");
            Run::of(sample, kernel, &(format!("{words} h_fac={h_fac}"), name)).map(|r| r.error)
        };
        let (m4, m6) = (error("M4", 1.35)?, error("M6", 0.9)?);
        table.push([claim("l2 of heat").into(), cloud.name.into(), m4.into(), m6.into(), (m4 / m6).into()]);
        ratios.push(m4 / m6);
    }
    let fcc = Sample::new(FCC, 4)?;
    let [m4, m6] = [("M4", 1.35), ("M6", 0.9)].map(|(kernel, h)| Moments::of(&fcc, kernel, "brookshaw", h));
    let (m4, m6) = (m4?, m6?);
    let second = (m4.second / m6.second).abs();
    table.push([claim("K_d2 - 1").into(), FCC.name.into(), m4.second.into(), m6.second.into(), second.into()]);
    let mut tube = Vec::new();
    for (dim, n, cloud) in [(1, request.pick(16, 60, 400), "line"), (3, request.pick(2, 8, 24), FCC.name)] {
        let found = tubes(dim, n, &[("M4", 1.35, 1.4), ("M6", 0.9, 1.4)], |_| true)?;
        let (t4, t6) = (found[0].l2, found[1].l2);
        table.push([claim("l2 of the tube").into(), cloud.into(), t4.into(), t6.into(), (t4 / t6).into()]);
        tube.push(format!("{} times in {dim}-D", short(t4 / t6)));
    }
    let twice = ratios.iter().filter(|r| **r >= 2.0).count();
    let [low, high] = ratios.iter().fold([f64::INFINITY, 0.0f64], |[l, h], r| [l.min(*r), h.max(*r)]);
    page.find(format!(
        "4. M6 at h_fac 0.9 is twice better than M4 at 1.35 at the same cost ({:.0} and {:.0} neighbours in 3-D): {}. K_d2 on fcc is {second:.0} times nearer to 1; the heat error is {} to {} times smaller, twice or more in {twice} of {} clouds; the shock tube's {}.",
        m6.neighbours,
        m4.neighbours,
        if twice == ratios.len() { "true" } else if high < 2.0 { "false of heat, true of K_d2" } else { "true only on some particles" },
        short(low),
        short(high),
        ratios.len(),
        tube.join(", ")
    ));
    Ok(())
}
