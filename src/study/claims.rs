//! The four sentences that Biriukov & Price end with, each held against numbers of the studies.

use super::catalogue::Request;
use super::convergence::Run;
use super::kernels::Moments;
use super::mode::{CUBIC, Cloud, FCC, GLASS, HEXAGONAL, JITTER_2D, JITTER_3D, SQUARE};
use super::page::Page;
use super::positivity::{Growth, limit};
use super::sod::{Shock, correlation};
use super::table::{Table, column, short};
use crate::error::Result;

const COLUMNS: [&str; 5] = ["claim", "particles", "first", "second", "ratio"];

/// # Errors
/// As the studies.
pub fn run(mut request: Request) -> Result<Page> {
    let mut page = Page::new("claims", "Four sentences of Biriukov & Price, held against numbers");
    let mut table = Table::new("numbers", &COLUMNS.map(|name| column(name, "")));
    let parts: [fn(&mut Page, &mut Table, &Request) -> Result<()>; 4] = [itself, anisotropic, implicit, cost];
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
    let waves = request.pick(12, 32, 96);
    for across in [0.0, 0.34] {
        let Growth { rates: [er, pair, two], .. } = Growth::of("hexagonal", across, waves)?;
        let ratio = if across == 0.0 { "infinite" } else { "2.94" };
        let row = |name: &str| format!("2 growth h^2/kappa, anisotropy {ratio}: Espanol-Revenga, {name}");
        table.push([row("pair form").into(), HEXAGONAL.name.into(), er.into(), pair.into(), f64::NAN.into()]);
        table.push([row("two first").into(), HEXAGONAL.name.into(), er.into(), two.into(), f64::NAN.into()]);
    }
    page.find(format!(
        "2. Two first derivatives is the only stable way for anisotropic diffusion: true only when kappa_par > {:.1} kappa_perp, and only of operators that are consistent there. Below, Espanol-Revenga's weights are all positive; the pair form 2 r.kappa.r never grows but stands for a rounder tensor.",
        limit(2)
    ));
    Ok(())
}

/// 3: the second derivative matters even where it is not explicit.
fn implicit(page: &mut Page, table: &mut Table, request: &Request) -> Result<()> {
    let n = request.pick(20, 80, 200);
    let mut ranks = Vec::new();
    for kernel in ["M4", "M6", "C2", "C4"] {
        let h_facs = (0..=12).map(|i| 0.8 + 0.1 * f64::from(i));
        let curve: Vec<Shock> = h_facs.map(|h| Shock::of(kernel, h, 1.4, n)).collect::<Result<_>>()?;
        let rank = correlation(&curve);
        let claim = format!("3 rank correlation of the tube's l2 with |K_d2 - 1| over h_fac, {kernel}");
        table.push([claim.into(), "line".into(), rank.into(), f64::NAN.into(), f64::NAN.into()]);
        ranks.push((kernel, rank));
    }
    let yes = ranks.iter().filter(|(_, rank)| *rank > 0.5).count();
    let ranks: Vec<String> = ranks.iter().map(|(kernel, rank)| format!("{kernel} {rank:.2}")).collect();
    let answer = match yes {
        4 => "true",
        0 => "false",
        _ => "true only for some kernels",
    };
    page.find(format!(
        "3. The second derivative matters even where it is not explicit: {answer}. In the shock tube in 1-D the density \
         error rises with |K_d2 - 1| over h_fac (rank correlation above 0.5) for {yes} of 4 kernels: {}.",
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
