//! `diffusph look`: a drawing of a quantity, for those who have no ParaView at hand.

use crate::error::{Error, Result};
use crate::io::{self, Series, Snapshot, atomic};
use crate::model::fields::FIELDS;
use crate::solver::frame;
use plotters::element::{Rectangle, Text};
use plotters::prelude::{
    ChartBuilder, Circle, Color, ColorMap, IntoDrawingArea, RGBColor, SVGBackend, ViridisRGB, WHITE,
};
use std::path::{Path, PathBuf};

/// Of the drawing, and of the part beside it that holds the colour bar.
const SIZE: (u32, u32) = (760, 640);
const BAR: u32 = 120;
/// Around the axes.
const MARGIN: u32 = 12;
const BELOW: u32 = 44;
const LEFT: u32 = 64;
const TITLE: u32 = 34;

/// Most marks: a browser takes a second for as many.
const MOST: usize = 50_000;

/// Colours of the bar.
const SHADES: i32 = 128;

/// What is to be drawn.
pub struct Look<'a> {
    pub file: &'a Path,
    pub field: &'a str,
    /// Where along its third axis a cloud is cut; its middle where it is not said.
    pub at: Option<f64>,
    pub out: Option<&'a Path>,
}

/// Marks in a plane.
struct Drawing {
    title: String,
    axes: [&'static str; 2],
    points: Vec<([f64; 2], f64)>,
    /// What is drawn at all: also of what a cut leaves out.
    low: f64,
    high: f64,
}

/// Draws a file; answers what it wrote, in a line.
///
/// # Errors
/// `Io`; `BadFile`; `UnknownWord` for a quantity that the file has not; `BadValue` for what cannot be drawn.
pub fn draw(look: &Look) -> Result<String> {
    let file = newest(look.file)?;
    let snapshot = io::read(&file)?;
    let drawing = Drawing::of(&snapshot, &file, look)?;
    let out = look.out.map_or_else(|| file.with_extension("svg"), PathBuf::from);
    if out.extension().is_none_or(|e| !e.eq_ignore_ascii_case("svg")) {
        return Err(Error::bad("--out", format!("'{}'", out.display()), "its name must end in .svg"));
    }
    let mut svg = String::new();
    drawing.draw(&mut svg).map_err(|e| Error::bad("look", look.field, &e.to_string()))?;
    atomic::prepare(&out, |sink| std::io::Write::write_all(sink, svg.as_bytes()))?.publish()?;
    let Drawing { title, points, low, high, .. } = drawing;
    Ok(format!("{}: {title}, {} particles, {low} to {high}\n", out.display(), points.len()))
}

/// The last snapshot of a list; other files as they are.
fn newest(path: &Path) -> Result<PathBuf> {
    if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("pvd")) {
        return Ok(path.into());
    }
    let series = Series::read(path)?;
    let last = series.entries().last().map(|entry| series.file_of(entry));
    last.ok_or_else(|| Error::BadFile { path: path.display().to_string(), reason: "it lists nothing".into() })
}

impl Drawing {
    fn of(snapshot: &Snapshot, file: &Path, look: &Look) -> Result<Drawing> {
        let values = values(snapshot, look.field, file)?;
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let (low, high) = finite().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
        if low > high {
            return Err(Error::bad("look", look.field, "it has no finite value to draw"));
        }
        let mut axes = frame::varying(&snapshot.points);
        (0..2).for_each(|axis| {
            if axes.len() < 2 && !axes.contains(&axis) {
                axes.push(axis)
            }
        });
        axes.sort_unstable();
        let name = |axis: usize| ["x", "y", "z"][axis];
        let mut kept: Vec<usize> = (0..values.len()).filter(|&i| values[i].is_finite()).collect();
        let mut cut = String::new();
        if let [_, _, third] = axes[..] {
            let (at, within) = cut_of(snapshot, third, look.at);
            kept.retain(|&i| (snapshot.points[i][third] - at).abs() <= within);
            cut = format!(", {} = {} ± {}", name(third), short(at), short(within));
        } else if look.at.is_some() {
            return Err(Error::bad("--at", "given", "it says where three dimensions are cut, and there are fewer"));
        }
        if kept.is_empty() {
            return Err(Error::bad("--at", look.at.unwrap_or(0.0), "no particle is there"));
        }
        let every = kept.len().div_ceil(MOST);
        let some = if every > 1 { format!(", one of {every}") } else { String::new() };
        let place = |i: usize| [axes[0], axes[1]].map(|axis| snapshot.points[i][axis]);
        let unit = FIELDS.iter().find(|f| f.name == look.field).map_or(String::new(), |f| format!(" [{}]", f.unit));
        let time = snapshot.time.map_or(String::new(), |t| format!(", t = {}", short(t)));
        let file = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Drawing {
            title: format!("{}{unit}{time}{cut}{some}, {file}", look.field),
            axes: [name(axes[0]), name(axes[1])],
            points: kept.into_iter().step_by(every).map(|i| (place(i), values[i])).collect(),
            low,
            high,
        })
    }

    /// The drawing's range along an axis, square, and how far marks are apart.
    fn square(&self) -> ([[f64; 2]; 2], f64) {
        let range = |axis: usize| {
            let all = self.points.iter().map(|(p, _)| p[axis]);
            all.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
        };
        let [(x0, x1), (y0, y1)] = [range(0), range(1)];
        let widest = (x1 - x0).max(y1 - y0);
        let area = (x1 - x0).max(widest * 1e-3) * (y1 - y0).max(widest * 1e-3);
        let apart = (area / self.points.len() as f64).sqrt();
        let half = 0.5 * widest + apart.max(f64::MIN_POSITIVE);
        let half = if half > 0.0 && widest > 0.0 { half } else { 1.0 };
        (
            [[0.5 * (x0 + x1) - half, 0.5 * (x0 + x1) + half], [0.5 * (y0 + y1) - half, 0.5 * (y0 + y1) + half]],
            apart / half,
        )
    }

    fn colour(&self, v: f64) -> RGBColor {
        let share = if self.high > self.low { (v - self.low) / (self.high - self.low) } else { 0.5 };
        ViridisRGB.get_color(share.clamp(0.0, 1.0) as f32)
    }

    fn draw<'a>(&'a self, svg: &'a mut String) -> std::result::Result<(), Box<dyn std::error::Error + 'a>> {
        let all = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        all.fill(&WHITE)?;
        let (area, bar) = all.split_horizontally(SIZE.0 - BAR);
        let ([x, y], apart) = self.square();
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, ("sans-serif", 15))
            .margin(MARGIN)
            .x_label_area_size(BELOW)
            .y_label_area_size(LEFT)
            .build_cartesian_2d(x[0]..x[1], y[0]..y[1])?;
        chart.configure_mesh().disable_mesh().x_desc(self.axes[0]).y_desc(self.axes[1]).draw()?;
        let pixels = f64::from(SIZE.0 - BAR - LEFT - 2 * MARGIN);
        // Discs that touch.
        let size = (0.28 * apart * pixels).clamp(1.0, 8.0) as i32;
        chart
            .draw_series(self.points.iter().map(|(p, v)| Circle::new((p[0], p[1]), size, self.colour(*v).filled())))?;
        let (top, bottom) = ((TITLE + MARGIN) as i32, (SIZE.1 - BELOW - MARGIN) as i32);
        for shade in 0..SHADES {
            let at = |k: i32| bottom + (top - bottom) * k / SHADES;
            let v = self.low + (self.high - self.low) * (f64::from(shade) + 0.5) / f64::from(SHADES);
            bar.draw(&Rectangle::new([(4, at(shade + 1)), (24, at(shade))], self.colour(v).filled()))?;
        }
        for quarter in 0..=4 {
            let v = self.low + (self.high - self.low) * f64::from(quarter) / 4.0;
            let height = bottom + (top - bottom) * quarter / 4;
            bar.draw(&Text::new(short(v), (30, height - 6), ("sans-serif", 13)))?;
        }
        all.present()?;
        Ok(())
    }
}

/// A quantity as one number per particle: of vectors their length.
fn values(snapshot: &Snapshot, name: &str, file: &Path) -> Result<Vec<f64>> {
    let names = || snapshot.fields.iter().map(|f| f.name.as_str());
    let field = snapshot
        .usable(name)
        .map_err(|e| io::in_file(file, e))?
        .ok_or_else(|| Error::unknown("array of the file", name, names()))?;
    let values = field.data.to_f64()?;
    Ok(match field.components {
        1 => values,
        n => values.chunks(n).map(|v| v.iter().map(|v| v * v).sum::<f64>().sqrt()).collect(),
    })
}

/// Where a cloud is cut, and half of how thick the cut is: a spacing and a little, so that no cut falls between two layers.
fn cut_of(snapshot: &Snapshot, axis: usize, at: Option<f64>) -> (f64, f64) {
    let range = |axis: usize| {
        let all = snapshot.points.iter().map(|p| p[axis]);
        all.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
    };
    let volume: f64 = (0..3).map(range).map(|(low, high)| high - low).product();
    let (low, high) = range(axis);
    (at.unwrap_or(0.5 * (low + high)), 0.6 * (volume / snapshot.points.len() as f64).cbrt())
}

/// To four digits.
fn short(v: f64) -> String {
    let rounded: f64 = format!("{v:.3e}").parse().unwrap_or(v);
    if rounded == 0.0 || (1e-3..1e6).contains(&rounded.abs()) { format!("{rounded}") } else { format!("{rounded:e}") }
}
