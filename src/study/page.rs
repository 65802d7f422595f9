//! What a study found: sentences, tables and plots. One text for a terminal, one page for a browser, files for programs.

use super::plot::Plot;
use super::table::{Table, escaped};
use crate::error::Result;
use serde::Serialize;
use std::fmt::Write;

#[derive(Debug, Clone, Serialize)]
pub struct Page {
    pub name: &'static str,
    pub title: String,
    /// In words, with numbers.
    pub findings: Vec<String>,
    pub tables: Vec<Table>,
    #[serde(skip)]
    pub plots: Vec<Plot>,
    /// False where someone stopped it: the rows are those it had.
    pub complete: bool,
}

const STYLE: &str = "body{font:15px/1.45 sans-serif;max-width:60em;margin:2em auto;padding:0 1em}\
table{border-collapse:collapse;font-size:13px}td,th{padding:.15em .6em;border-bottom:1px solid #ddd;text-align:left}.n{text-align:right}\
svg{max-width:100%;height:auto}";

impl Page {
    pub fn new(name: &'static str, title: impl Into<String>) -> Page {
        let (findings, tables, plots) = (Vec::new(), Vec::new(), Vec::new());
        Page { name, title: title.into(), findings, tables, plots, complete: true }
    }

    pub fn find(&mut self, sentence: impl Into<String>) {
        self.findings.push(sentence.into());
    }

    fn notes(&self) -> impl Iterator<Item = &str> {
        let stopped = (!self.complete).then_some("stopped before its end: these are the rows it had");
        stopped.into_iter().chain(self.findings.iter().map(String::as_str))
    }

    pub fn text(&self) -> String {
        let mut text = format!("{}\n", self.title);
        for table in &self.tables {
            let _ = match table.long {
                true => writeln!(text, "\n{}: {} rows, with --out in a file", table.title(), table.rows.len()),
                false => write!(text, "\n{}\n{}", table.title(), table.text()),
            };
        }
        text.push('\n');
        self.notes().for_each(|note| text.push_str(&format!("- {note}\n")));
        text
    }

    /// One page that opens without a network.
    ///
    /// # Errors
    /// As [`Plot::svg`].
    pub fn html(&self) -> Result<String> {
        let notes: String = self.notes().map(|note| format!("<li>{}</li>\n", escaped(note))).collect();
        let plots: String = self.plots.iter().map(Plot::svg).collect::<Result<Vec<_>>>()?.join("\n");
        let tables: String = self.tables.iter().map(section).collect();
        let title = escaped(&self.title);
        let version = env!("CARGO_PKG_VERSION");
        Ok(format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\
             <style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n<ul>\n{notes}</ul>\n{plots}\n{tables}\
             <p>diffusph {version}, study {}</p>\n</body></html>\n",
            self.name
        ))
    }

    /// Every file with its content: the page, a CSV for each table, an SVG for each plot.
    ///
    /// # Errors
    /// As [`Page::html`].
    pub fn files(&self) -> Result<Vec<(String, String)>> {
        let tables = self.tables.iter().map(|t| (format!("{}-{}.csv", self.name, t.name), t.csv()));
        let mut files: Vec<(String, String)> = tables.collect();
        for (i, plot) in self.plots.iter().enumerate() {
            files.push((format!("{}-{}.svg", self.name, i + 1), plot.file()?));
        }
        files.push((format!("{}.html", self.name), self.html()?));
        Ok(files)
    }
}

fn section(table: &Table) -> String {
    let (name, rows) = (escaped(&table.title()), table.html());
    match table.long {
        true => format!("<details><summary>{name}: {} rows</summary>\n{rows}</details>\n", table.rows.len()),
        false => format!("<h2>{name}</h2>\n{rows}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::plot::{Axis, Style};
    use super::super::table::column;
    use super::*;

    #[test]
    fn a_page_holds_everything_and_fetches_nothing() {
        let mut page = Page::new("kernels", "K & co");
        page.find("M6 < M4");
        let mut table = Table::long("moments", &[column("K", "")]);
        table.push([1.0.into()]);
        page.tables.push(table);
        let mut plot = Plot::new("K", Axis::linear("h"), Axis::linear("K"));
        plot.add("M6", Style::Line, vec![(1.0, 1.0), (2.0, 1.1)]);
        page.plots.push(plot);
        page.complete = false;
        let html = page.html().unwrap();
        assert!(html.contains("K &amp; co") && html.contains("M6 &lt; M4") && html.contains("<svg"), "{html}");
        assert!(html.contains("stopped before") && !html.contains("http"), "{html}");
        let names: Vec<String> = page.files().unwrap().into_iter().map(|f| f.0).collect();
        assert_eq!(names, ["kernels-moments.csv", "kernels-1.svg", "kernels.html"]);
        assert!(page.text().contains("moments: 1 rows"));
    }
}
