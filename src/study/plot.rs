//! Plots as SVG, which a page holds in itself.

use crate::error::{Error, Result};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::element::{Circle, Cross, EmptyElement, PathElement, Polygon, Rectangle, Text, TriangleMarker};
use plotters::prelude::{
    Cartesian2d, ChartBuilder, ChartContext, Color, DrawingArea, IntoDrawingArea, RGBColor, Ranged, SVGBackend, WHITE,
};
use std::ops::Range;

/// Of the drawing, and of the part of it that holds the names of series.
const SIZE: (u32, u32) = (860, 480);
const LEGEND: u32 = 180;
/// Around the axes: title, names and numbers.
const MARGIN: u32 = 10;
const TITLE: u32 = 30;
const BELOW: u32 = 44;
const LEFT: u32 = 72;

/// Colours that people tell apart whatever their eyes (Okabe & Ito 2008).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];
const BLACK: RGBColor = RGBColor(0, 0, 0);
const GREY: RGBColor = RGBColor(200, 200, 200);

/// What a series is marked with: with the colours, more than any plot has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Shape {
    Disc,
    Triangle,
    Cross,
    Square,
}

const SHAPES: [Shape; 4] = [Shape::Disc, Shape::Triangle, Shape::Cross, Shape::Square];

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Scale, Scale>>;

type Failure<'a> = Box<dyn std::error::Error + 'a>;

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Style {
    /// Marks joined by lines.
    Line,
    /// Marks.
    Points,
    /// A grey area.
    Area,
    /// A black line over all else.
    Front,
}

#[derive(Debug, Clone)]
pub struct Series {
    pub name: String,
    pub points: Vec<(f64, f64)>,
    pub style: Style,
}

#[derive(Debug, Clone)]
pub struct Axis {
    pub label: String,
    pub log: bool,
}

impl Axis {
    pub fn linear(label: &str) -> Axis {
        Axis { label: label.into(), log: false }
    }

    pub fn log(label: &str) -> Axis {
        Axis { label: label.into(), log: true }
    }

    /// Where a value is drawn; nothing where it cannot be.
    fn place(&self, v: f64) -> Option<f64> {
        let v = if self.log { v.log10() } else { v };
        v.is_finite().then_some(v)
    }

    /// What stands at a place.
    fn text(&self, at: f64) -> String {
        match (self.log, 10f64.powf(at)) {
            (false, _) => format!("{}", (at * 1e4).round() / 1e4),
            (true, v) if (0.00999..1e4).contains(&v) => format!("{}", (v * 1e3).round() / 1e3),
            (true, v) => format!("{v:.0e}"),
        }
    }

    /// Round numbers within a range: steps of 1, 2 or 5, or on a logarithmic axis decades and, where these are few, what
    /// lies between.
    fn ticks(&self, [low, high]: [f64; 2]) -> Vec<f64> {
        let inside = |v: &f64| *v >= low && *v <= high;
        if self.log {
            let leading: &[f64] = match high - low {
                few if few <= 1.0 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0],
                some if some <= 2.0 => &[1.0, 2.0, 5.0],
                _ => &[1.0],
            };
            let decades = low.floor() as i32..=high.ceil() as i32;
            return decades
                .flat_map(|d| leading.iter().map(move |m| m.log10() + f64::from(d)))
                .filter(inside)
                .collect();
        }
        let rough = (high - low) / 8.0;
        let decade = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|s| *s >= rough).unwrap_or(rough);
        let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
        (first..=last).map(|i| i as f64 * step).collect()
    }
}

/// A range with its ticks, as plotters wants it.
struct Scale {
    range: [f64; 2],
    ticks: Vec<f64>,
}

impl Ranged for Scale {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, v: &f64, (from, to): (i32, i32)) -> i32 {
        let share = (v - self.range[0]) / (self.range[1] - self.range[0]);
        from + (f64::from(to - from) * share).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range[0]..self.range[1]
    }
}

#[derive(Debug, Clone)]
pub struct Plot {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
    /// Both axes have the same scale.
    pub map: bool,
}

impl Plot {
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Plot {
        Plot { title: title.into(), x, y, series: Vec::new(), map: false }
    }

    pub fn add(&mut self, name: impl Into<String>, style: Style, points: Vec<(f64, f64)>) {
        self.series.push(Series { name: name.into(), points, style });
    }

    /// The drawing, without anything that a browser would fetch.
    ///
    /// # Errors
    /// `BadValue` where it cannot be drawn.
    pub fn svg(&self) -> Result<String> {
        // Inside a page the name space is known; as an address it looks like a reference to the network.
        Ok(self.file()?.replace(" xmlns=\"http://www.w3.org/2000/svg\"", ""))
    }

    /// The same as a file of its own.
    ///
    /// # Errors
    /// As [`Plot::svg`].
    pub fn file(&self) -> Result<String> {
        let mut svg = String::new();
        self.draw(&mut svg).map_err(|e| Error::bad("plot", &self.title, &e.to_string()))?;
        Ok(svg)
    }

    fn draw<'a>(&'a self, svg: &'a mut String) -> std::result::Result<(), Failure<'a>> {
        let all = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        all.fill(&WHITE)?;
        let (area, names) = all.split_horizontally(SIZE.0 - LEGEND);
        let placed: Vec<Vec<(f64, f64)>> = self.series.iter().map(|s| self.placed(s)).collect();
        let [x, y] = self.ranges(&placed);
        let (x_text, y_text) = (|v: &f64| self.x.text(*v), |v: &f64| self.y.text(*v));
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, ("sans-serif", 16))
            .margin(MARGIN)
            .x_label_area_size(BELOW)
            .y_label_area_size(LEFT)
            .build_cartesian_2d(
                Scale { ticks: self.x.ticks(x), range: x },
                Scale { ticks: self.y.ticks(y), range: y },
            )?;
        chart
            .configure_mesh()
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .x_label_formatter(&x_text)
            .y_label_formatter(&y_text)
            .light_line_style(WHITE)
            .draw()?;
        for (i, (series, points)) in self.series.iter().zip(placed).enumerate() {
            let line = self.colour(i).stroke_width(2);
            match series.style {
                Style::Area => drop(chart.draw_series([Polygon::new(points, GREY.mix(0.6).filled())])?),
                Style::Front => drop(chart.draw_series([PathElement::new(points, line)])?),
                Style::Line => {
                    chart.draw_series([PathElement::new(points.clone(), line)])?;
                    self.marks(&mut chart, i, points)?;
                }
                Style::Points => self.marks(&mut chart, i, points)?,
            }
        }
        self.legend(&names)?;
        all.present()?;
        Ok(())
    }

    /// Beside the axes, where it hides nothing.
    fn legend<'a>(&self, area: &DrawingArea<SVGBackend<'a>, Shift>) -> std::result::Result<(), Failure<'a>> {
        for (i, series) in self.series.iter().enumerate().filter(|(_, s)| !s.name.is_empty()) {
            let y = (TITLE + MARGIN) as i32 + 18 * i as i32;
            match series.style {
                Style::Front => area.draw(&PathElement::new([(2, y), (16, y)], self.colour(i).stroke_width(2)))?,
                _ => self.mark(area, i, (9, y))?,
            }
            area.draw(&Text::new(series.name.clone(), (22, y - 6), ("sans-serif", 13)))?;
        }
        Ok(())
    }

    fn colour(&self, i: usize) -> RGBColor {
        match self.series[i].style {
            Style::Area => GREY,
            Style::Front => BLACK,
            _ => COLOURS[i % COLOURS.len()],
        }
    }

    /// Another shape where colours come round again.
    fn shape(&self, i: usize) -> Shape {
        if self.series[i].style == Style::Area { Shape::Square } else { SHAPES[i / COLOURS.len() % SHAPES.len()] }
    }

    fn marks<'a>(
        &self,
        chart: &mut Chart<'_, 'a>,
        i: usize,
        points: Vec<(f64, f64)>,
    ) -> std::result::Result<(), Failure<'a>> {
        let (filled, line, points) = (self.colour(i).filled(), self.colour(i).stroke_width(2), points.into_iter());
        match self.shape(i) {
            Shape::Disc => drop(chart.draw_series(points.map(|p| Circle::new(p, 3, filled)))?),
            Shape::Triangle => drop(chart.draw_series(points.map(|p| TriangleMarker::new(p, 5, filled)))?),
            Shape::Cross => drop(chart.draw_series(points.map(|p| Cross::new(p, 4, line)))?),
            Shape::Square => {
                let square = |p| EmptyElement::at(p) + Rectangle::new([(-3, -3), (3, 3)], filled);
                chart.draw_series(points.map(square))?;
            }
        }
        Ok(())
    }

    /// The same on the page itself.
    fn mark<'a>(
        &self,
        area: &DrawingArea<SVGBackend<'a>, Shift>,
        i: usize,
        (x, y): (i32, i32),
    ) -> std::result::Result<(), Failure<'a>> {
        let (filled, line) = (self.colour(i).filled(), self.colour(i).stroke_width(2));
        match self.shape(i) {
            Shape::Disc => area.draw(&Circle::new((x, y), 4, filled))?,
            Shape::Triangle => area.draw(&TriangleMarker::new((x, y), 5, filled))?,
            Shape::Cross => area.draw(&Cross::new((x, y), 4, line))?,
            Shape::Square => area.draw(&Rectangle::new([(x - 3, y - 3), (x + 3, y + 3)], filled))?,
        }
        Ok(())
    }

    fn placed(&self, series: &Series) -> Vec<(f64, f64)> {
        series.points.iter().filter_map(|(x, y)| Some((self.x.place(*x)?, self.y.place(*y)?))).collect()
    }

    fn ranges(&self, placed: &[Vec<(f64, f64)>]) -> [[f64; 2]; 2] {
        let points = || placed.iter().flatten();
        let (x, y) = (range(points().map(|p| p.0)), range(points().map(|p| p.1)));
        if !self.map {
            return [x, y];
        }
        let pixels = [SIZE.0 - LEGEND - LEFT - 2 * MARGIN, SIZE.1 - TITLE - BELOW - 2 * MARGIN].map(f64::from);
        let scale = ((x[1] - x[0]) / pixels[0]).max((y[1] - y[0]) / pixels[1]);
        let widened = |[low, high]: [f64; 2], pixels: f64| {
            let (middle, half) = (0.5 * (low + high), 0.5 * scale * pixels);
            [middle - half, middle + half]
        };
        [widened(x, pixels[0]), widened(y, pixels[1])]
    }
}

/// From the least to the most, with a margin; something where there is nothing.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)]);
    match high - low {
        width if width > 0.0 => [low - 0.05 * width, high + 0.05 * width],
        _ if low.is_finite() => [low - 1.0, low + 1.0],
        _ => [0.0, 1.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_draws_what_can_be_drawn_and_refers_to_nothing() {
        let mut plot = Plot::new("error", Axis::log("n"), Axis::log("l2"));
        assert!(plot.svg().is_ok_and(|svg| svg.contains("<svg")), "an empty plot is one too");
        plot.add("brookshaw", Style::Line, vec![(16.0, 1e-2), (32.0, 2.5e-3), (64.0, f64::NAN)]);
        plot.add("area", Style::Area, vec![(16.0, 1e-2), (32.0, 2.5e-3), (32.0, 1e-2)]);
        plot.add("front", Style::Front, vec![(16.0, 1e-2), (32.0, 2.5e-3)]);
        let svg = plot.svg().unwrap();
        assert!(svg.contains("brookshaw") && !svg.contains("http") && !svg.contains("NaN"));
        assert_eq!(svg.matches("<circle").count(), 2 + 1, "two marks and one in the legend; an area has a square");
    }

    #[test]
    fn every_series_has_its_own_colour_and_mark() {
        let mut plot = Plot::new("many", Axis::linear("x"), Axis::linear("y"));
        (0..24).for_each(|i| plot.add(i.to_string(), Style::Line, vec![(0.0, f64::from(i)), (1.0, 1.0)]));
        let looks: std::collections::HashSet<_> = (0..24)
            .map(|i| {
                let RGBColor(r, g, b) = plot.colour(i);
                (r, g, b, plot.shape(i))
            })
            .collect();
        assert_eq!(looks.len(), 24);
        assert!(plot.svg().is_ok());
    }

    #[test]
    fn numbers_at_axes_are_round() {
        let log = Axis::log("n");
        let texts =
            |axis: &Axis, range: [f64; 2]| axis.ticks(range).into_iter().map(|t| axis.text(t)).collect::<Vec<_>>();
        assert_eq!(texts(&log, [1.1, 2.2]), ["20", "50", "100"]);
        assert_eq!(texts(&log, [-4.2, -0.9]), ["1e-4", "1e-3", "0.01", "0.1"]);
        assert_eq!(texts(&Axis::linear("h"), [0.74, 2.06]), ["0.8", "1", "1.2", "1.4", "1.6", "1.8", "2"]);
    }

    #[test]
    fn a_map_has_the_same_scale_along_both_axes() {
        let mut plot = Plot::new("map", Axis::linear("x"), Axis::linear("y"));
        plot.map = true;
        plot.add("a", Style::Points, vec![(-3.0, -3.0), (3.0, 3.0)]);
        let [x, y] = plot.ranges(&[plot.placed(&plot.series[0])]);
        assert!(((x[1] - x[0]) / (y[1] - y[0]) - 588.0 / 386.0).abs() < 1e-12);
    }
}
