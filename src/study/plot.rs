//! Plots as SVG, which a page holds in itself.

use crate::error::{Error, Result};
use plotters::element::{Circle, PathElement, Polygon};
use plotters::prelude::{ChartBuilder, Color, IntoDrawingArea, RGBColor, SVGBackend, SeriesLabelPosition, WHITE};

const SIZE: (u32, u32) = (760, 480);

/// Colours that people tell apart whatever their eyes (Okabe & Ito 2008).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Style {
    /// Marks joined by lines.
    Line,
    /// Marks.
    Points,
    /// A grey area within its outline.
    Area,
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

    fn text(&self, v: f64) -> String {
        if self.log { format!("{:.0e}", 10f64.powf(v)) } else { format!("{}", (v * 1e4).round() / 1e4) }
    }
}

#[derive(Debug, Clone)]
pub struct Plot {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
}

impl Plot {
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Plot {
        Plot { title: title.into(), x, y, series: Vec::new() }
    }

    pub fn add(&mut self, name: impl Into<String>, style: Style, points: Vec<(f64, f64)>) {
        self.series.push(Series { name: name.into(), points, style });
    }

    /// The drawing, without anything that a browser would fetch.
    ///
    /// # Errors
    /// `BadValue` where it cannot be drawn.
    pub fn svg(&self) -> Result<String> {
        let mut svg = String::new();
        self.draw(&mut svg).map_err(|e| Error::bad("plot", &self.title, &e.to_string()))?;
        // Inside a page the name space is known; as an address it looks like a reference to the network.
        Ok(svg.replace(" xmlns=\"http://www.w3.org/2000/svg\"", ""))
    }

    fn draw(&self, svg: &mut String) -> std::result::Result<(), Box<dyn std::error::Error + '_>> {
        let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let placed: Vec<Vec<(f64, f64)>> = self.series.iter().map(|s| self.placed(s)).collect();
        let x = range(placed.iter().flatten().map(|p| p.0));
        let y = range(placed.iter().flatten().map(|p| p.1));
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, ("sans-serif", 17))
            .margin(10)
            .x_label_area_size(42)
            .y_label_area_size(66)
            .build_cartesian_2d(x[0]..x[1], y[0]..y[1])?;
        let (x_text, y_text) = (|v: &f64| self.x.text(*v), |v: &f64| self.y.text(*v));
        chart
            .configure_mesh()
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .x_label_formatter(&x_text)
            .y_label_formatter(&y_text)
            .light_line_style(WHITE)
            .draw()?;
        for (i, (series, points)) in self.series.iter().zip(placed).enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let line = points.clone();
            let drawn = match series.style {
                Style::Area => chart.draw_series([Polygon::new(points, RGBColor(190, 190, 190).mix(0.6).filled())])?,
                Style::Line => {
                    chart.draw_series([PathElement::new(line, colour.stroke_width(2))])?;
                    chart.draw_series(points.into_iter().map(|p| Circle::new(p, 3, colour.filled())))?
                }
                Style::Points => chart.draw_series(points.into_iter().map(|p| Circle::new(p, 3, colour.filled())))?,
            };
            let shown = if series.style == Style::Area { RGBColor(190, 190, 190) } else { colour };
            drawn.label(&series.name).legend(move |(x, y)| Circle::new((x + 9, y), 4, shown.filled()));
        }
        let legend = WHITE.mix(0.8);
        chart.configure_series_labels().position(SeriesLabelPosition::UpperRight).background_style(legend).draw()?;
        area.present()?;
        Ok(())
    }

    fn placed(&self, series: &Series) -> Vec<(f64, f64)> {
        series.points.iter().filter_map(|(x, y)| Some((self.x.place(*x)?, self.y.place(*y)?))).collect()
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
        plot.add("front", Style::Area, vec![(16.0, 1e-2), (32.0, 2.5e-3), (32.0, 1e-2)]);
        let svg = plot.svg().unwrap();
        assert!(svg.contains("brookshaw") && !svg.contains("http") && !svg.contains("NaN"));
        assert_eq!(svg.matches("<circle").count(), 2 + 2, "two marks and two in the legend");
    }
}
