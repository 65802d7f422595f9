//! The four sentences that Biriukov & Price end with, each held against numbers of the studies.

use super::catalogue::Request;
use super::convergence::Run;
use super::kernels::Moments;
use super::mode::{CUBIC, Cloud, FCC, GLASS, HEXAGONAL, JITTER_2D, JITTER_3D, SQUARE, refused};
use super::page::Page;
use super::positivity::{Growth, limit};
use super::run::Study;
use super::scene::{Exact, Numbers, Value};
use super::sod::{Shock, correlations};
use super::table::{Table, column, short};
use crate::error::{Error, Result};
use crate::operator::table::OPERATORS;
use std::path::Path;

/// Checks a sentence: says the answer, adds its numbers.
type Part = fn(&mut Page, &mut Table, &Request) -> Result<()>;

const COLUMNS: [&str; 5] = ["claim", "particles", "first", "second", "ratio"];

/// # Errors
/// As the studies.
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("claims", "Four sentences of Biriukov & Price, held against numbers");
    let mut table = Table::new("numbers", &COLUMNS.map(|name| column(name, "")));
    let parts: [Part; 4] = [itself, anisotropic, implicit, cost];
    for (done, part) in parts.into_iter().enumerate() {
        if !request.goes_on(done, parts.len()) {
            page.complete = false;
            break;
        }
        part(&mut page, &mut table, &request)?;
    }
    page.tables.push(table);
    Ok(page)
}

fn sizes(request: &Request) -> Vec<(Cloud, usize)> {
    let (plane, space) = request.pick((16, 6), (64, 16), (128, 32));
    let clouds = [SQUARE, HEXAGONAL, JITTER_2D].map(|c| (c, plane)).into_iter();
    let clouds =
        clouds.chain([CUBIC, FCC, JITTER_3D].map(|c| (c, space))).chain((!request.tiny).then_some((GLASS, 24)));
    clouds.filter(|(cloud, _)| cloud.is_here()).collect()
}

/// As the slides had them: nothing is normalised.
fn plain(operator: &str) -> (String, String) {
    (format!("operator={operator} normalise=none"), operator.into())
}

/// 1: the kernel itself gives up to twice more accurate results than Brookshaw's form.
fn itself(page: &mut Page, table: &mut Table, request: &Request) -> Result<()> {
    let mut ratios = Vec::new();
    for (cloud, n) in sizes(request) {
        for kernel in ["M4", "M6"] {
            let error = |operator| Run::of(&cloud, n, kernel, &plain(operator)).map(|r| r.error);
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
fn anisotropic(page: &mut Page, table: &mut Table, request: &Request) -> Result<()> {
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
    let mut scene = JITTER_2D.scene(n, &format!("operator={operator} integrator=ssprk2"))?;
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
        // Words that contradict each other are a mistake here, not a finding.
        Err(e) if refused(&e) && !matches!(e, Error::BadValue { .. }) => Ok(f64::NAN),
        Err(e) => Err(e),
    }
}

/// 3: the second derivative matters even where it is not explicit.
fn implicit(page: &mut Page, table: &mut Table, request: &Request) -> Result<()> {
    let n = request.pick(20, 80, 200);
    let mut ranks = Vec::new();
    for kernel in ["M4", "M6", "C2", "C4"] {
        let h_facs = (0..=12).map(|i| 0.8 + 0.1 * f64::from(i));
        let curve: Vec<Shock> = h_facs.map(|h| Shock::of(kernel, h, 1.4, n)).collect::<Result<_>>()?;
        let [plain, rank] = correlations(&curve);
        let claim = format!("3 rank correlation of the tube's l2 with |K_d2 - 1|, {kernel}: plain, without trend");
        table.push([claim.into(), "line".into(), plain.into(), rank.into(), f64::NAN.into()]);
        ranks.push((kernel, rank));
    }
    let yes = ranks.iter().filter(|(_, rank)| *rank > 0.5).count();
    let ranks: Vec<String> = ranks.iter().map(|(kernel, rank)| format!("{kernel} {rank:.2}")).collect();
    let answer = match yes {
        4 => "true in 1-D",
        0 => "false in 1-D",
        _ => "true only for some kernels",
    };
    page.find(format!(
        "3. The second derivative matters even where it is not explicit: {answer}. In the shock tube in 1-D the density \
         error rises with |K_d2 - 1| over h_fac, once the smoothing by more neighbours is taken away (rank \
         correlation above 0.5), for {yes} of 4 kernels: {}. In 3-D it is not measured here.",
        ranks.join(", ")
    ));
    Ok(())
}

/// 4: M6 at h_fac 0.9 is twice better than M4 at 1.35 for the same cost.
fn cost(page: &mut Page, table: &mut Table, request: &Request) -> Result<()> {
    let mut ratios = Vec::new();
    let claim = |what: &str| format!("4 {what}: M4 at 1.35, M6 at 0.9");
    for (cloud, n) in sizes(request) {
        let error = |kernel, h_fac: f64| {
            let (words, name) = plain("brookshaw");
            Run::of(&cloud, n, kernel, &(format!("{words} h_fac={h_fac}"), name)).map(|r| r.error)
        };
        let (m4, m6) = (error("M4", 1.35)?, error("M6", 0.9)?);
        table.push([claim("l2 of heat").into(), cloud.name.into(), m4.into(), m6.into(), (m4 / m6).into()]);
        ratios.push(m4 / m6);
    }
    let [m4, m6] = [("M4", 1.35), ("M6", 0.9)].map(|(kernel, h)| Moments::of(&FCC, 4, kernel, "brookshaw", h));
    let (m4, m6) = (m4?, m6?);
    let second = (m4.second / m6.second).abs();
    table.push([claim("K_d2 - 1").into(), FCC.name.into(), m4.second.into(), m6.second.into(), second.into()]);
    let n = request.pick(40, 120, 400);
    let (t4, t6) = (Shock::of("M4", 1.35, 1.4, n)?.l2, Shock::of("M6", 0.9, 1.4, n)?.l2);
    table.push([claim("l2 of the tube").into(), "line".into(), t4.into(), t6.into(), (t4 / t6).into()]);
    let twice = ratios.iter().filter(|r| **r >= 2.0).count();
    let [low, high] = ratios.iter().fold([f64::INFINITY, 0.0f64], |[l, h], r| [l.min(*r), h.max(*r)]);
    page.find(format!(
        "4. M6 at h_fac 0.9 is twice better than M4 at 1.35 at the same cost ({:.0} and {:.0} neighbours in 3-D): {}. K_d2 on fcc is {second:.0} times nearer to 1; the heat error is {} to {} times smaller, twice or more in {twice} of {} clouds; the shock tube's {} times.",
        m6.neighbours,
        m4.neighbours,
        if twice == ratios.len() { "true" } else if high < 2.0 { "false of heat, true of K_d2" } else { "true only on some particles" },
        short(low),
        short(high),
        ratios.len(),
        short(t4 / t6)
    ));
    Ok(())
}
