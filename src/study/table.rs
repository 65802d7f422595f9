//! Tables of numbers: as text for people, as CSV and JSON for programs.

use serde::Serialize;
use std::fmt::Write;

/// A column: its name, and its unit where it has one.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Column {
    pub name: &'static str,
    pub unit: &'static str,
}

pub const fn column(name: &'static str, unit: &'static str) -> Column {
    Column { name, unit }
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    Count(u64),
    Number(f64),
    Text(String),
}

impl From<f64> for Cell {
    fn from(v: f64) -> Cell {
        Cell::Number(v)
    }
}

impl From<usize> for Cell {
    fn from(v: usize) -> Cell {
        Cell::Count(v as u64)
    }
}

impl From<&str> for Cell {
    fn from(v: &str) -> Cell {
        Cell::Text(v.into())
    }
}

impl From<String> for Cell {
    fn from(v: String) -> Cell {
        Cell::Text(v)
    }
}

impl Cell {
    /// For people: three digits.
    fn short(&self) -> String {
        match self {
            Cell::Count(v) => v.to_string(),
            Cell::Number(v) if v.is_nan() => "-".into(),
            Cell::Number(v) => short(*v),
            Cell::Text(v) => v.clone(),
        }
    }

    /// For programs: every digit; empty where there is no number.
    fn exact(&self) -> String {
        match self {
            Cell::Count(v) => v.to_string(),
            Cell::Number(v) if v.is_nan() => String::new(),
            Cell::Number(v) => format!("{v:e}"),
            Cell::Text(v) if v.contains(['"', ',', '\n']) => format!("\"{}\"", v.replace('"', "\"\"")),
            Cell::Text(v) => v.clone(),
        }
    }
}

/// Three digits, with an exponent only where the number needs one.
pub fn short(v: f64) -> String {
    match v.abs() {
        0.0 => "0".into(),
        a if (0.01..10.0).contains(&a) => format!("{v:.3}"),
        a if (10.0..1e4).contains(&a) => format!("{v:.1}"),
        _ => format!("{v:.2e}"),
    }
}

#[derive(Debug, Clone, Serialize)]
pub struct Table {
    pub name: &'static str,
    /// What its rows are about, where the name does not say it.
    pub case: String,
    pub columns: Vec<Column>,
    pub rows: Vec<Vec<Cell>>,
    /// Too long to be read: left to the files.
    pub long: bool,
}

impl Table {
    pub fn new(name: &'static str, columns: &[Column]) -> Table {
        Table { name, case: String::new(), columns: columns.to_vec(), rows: Vec::new(), long: false }
    }

    /// The same for a case.
    pub fn of(self, case: &str) -> Table {
        Table { case: case.into(), ..self }
    }

    /// Name and case, for people.
    pub fn title(&self) -> String {
        if self.case.is_empty() { self.name.into() } else { format!("{}: {}", self.name, self.case) }
    }

    /// For programs only.
    pub fn long(name: &'static str, columns: &[Column]) -> Table {
        Table { long: true, ..Table::new(name, columns) }
    }

    pub fn push<const N: usize>(&mut self, row: [Cell; N]) {
        self.rows.push(row.to_vec());
    }

    fn head(&self) -> impl Iterator<Item = String> {
        self.columns.iter().map(|c| match c.unit {
            "" => c.name.to_string(),
            unit => format!("{} [{unit}]", c.name),
        })
    }

    /// Whether a column is one of texts; numbers stand to the right.
    fn is_text(&self, c: usize) -> bool {
        self.rows.first().is_some_and(|row| matches!(row[c], Cell::Text(_)))
    }

    fn lines(&self) -> Vec<Vec<String>> {
        let rows = self.rows.iter().map(|row| row.iter().map(Cell::short).collect());
        std::iter::once(self.head().collect()).chain(rows).collect()
    }

    /// Aligned columns, numbers to the right.
    pub fn text(&self) -> String {
        let lines = self.lines();
        let width = |c: usize| lines.iter().map(|l| l[c].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        lines.iter().fold(String::new(), |mut text, line| {
            let cells = line.iter().enumerate().map(|(c, cell)| match (self.is_text(c), widths[c]) {
                (true, w) => format!("{cell:<w$}"),
                (false, w) => format!("{cell:>w$}"),
            });
            let _ = writeln!(text, "  {}", cells.collect::<Vec<_>>().join("  ").trim_end());
            text
        })
    }

    /// RFC 4180, the first line the names of the columns.
    pub fn csv(&self) -> String {
        let head = self.head().map(|h| Cell::Text(h).exact()).collect::<Vec<_>>().join(",");
        let rows = self.rows.iter().map(|row| row.iter().map(Cell::exact).collect::<Vec<_>>().join(","));
        std::iter::once(head).chain(rows).fold(String::new(), |text, line| text + &line + "\r\n")
    }

    /// As an HTML table.
    pub fn html(&self) -> String {
        let row = |cells: &[String], tag: &str| {
            let class = |c: usize| if self.is_text(c) { "" } else { " class=\"n\"" };
            let cell = |(c, text): (usize, &String)| format!("<{tag}{}>{}</{tag}>", class(c), escaped(text));
            let cells: String = cells.iter().enumerate().map(cell).collect();
            format!("<tr>{cells}</tr>\n")
        };
        let lines = self.lines();
        let body: String = lines.iter().enumerate().map(|(i, l)| row(l, if i == 0 { "th" } else { "td" })).collect();
        format!("<table>\n{body}</table>\n")
    }
}

/// Text as HTML shows it.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_table_for_people_and_for_programs() {
        let mut table = Table::new("errors", &[column("kernel", ""), column("h", "m"), column("n", "")]);
        table.push(["M6, \"wide\"".into(), 0.1.into(), 64usize.into()]);
        table.push(["M4<".into(), f64::NAN.into(), 8usize.into()]);
        assert_eq!(table.text(), "  kernel      h [m]   n\n  M6, \"wide\"  0.100  64\n  M4<             -   8\n");
        assert_eq!(table.csv(), "kernel,h [m],n\r\n\"M6, \"\"wide\"\"\",1e-1,64\r\nM4<,,8\r\n");
        assert!(table.html().contains("<td>M4&lt;</td><td class=\"n\">-</td>"));
        assert_eq!((table.title(), table.of("a box").title()), ("errors".into(), "errors: a box".into()));
    }

    #[test]
    fn numbers_have_three_digits() {
        assert_eq!(
            [0.0, 1.0, -0.5, 123.456, 1.5e-5, 2e7].map(short),
            ["0", "1.000", "-0.500", "123.5", "1.50e-5", "2.00e7"]
        );
    }
}
