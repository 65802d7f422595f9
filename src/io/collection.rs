//! The text of a `.pvd`: files and their times.

use super::{broken, xml};
use crate::error::Result;
use std::collections::HashMap;
use std::fmt::Write;

/// A file on a list.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    pub time: f64,
    /// As listed: absolute, or relative to the list's folder.
    pub file: String,
    /// What else a list says of it, like its part and its group.
    pub others: Vec<(String, String)>,
}

/// The entries of a list, in order of time.
pub fn parse(text: &str) -> Result<Vec<Entry>> {
    let document = xml::document(text)?;
    let root = document.root_element();
    if !root.has_tag_name("VTKFile") || root.attribute("type") != Some("Collection") {
        return Err(broken("it is no list of VTK files (a VTKFile of type Collection)"));
    }
    let mut entries = Vec::new();
    let mut count = HashMap::new();
    for item in root.descendants().filter(|d| d.has_tag_name("DataSet")) {
        let text = item.attribute("timestep").map(str::trim).filter(|text| !text.is_empty());
        let time = text.map(|t| t.parse().ok().filter(|t: &f64| t.is_finite()));
        // Entries without a time count the steps of their part.
        let step = count.entry((item.attribute("group"), item.attribute("part"))).or_insert(0u32);
        let time = time.unwrap_or(Some(f64::from(*step)));
        *step += 1;
        let time = time.ok_or_else(|| broken("a DataSet has a timestep that is no number"))?;
        let file = item.attribute("file").ok_or_else(|| broken("a DataSet names no file"))?;
        let others = item.attributes().filter(|a| !matches!(a.name(), "timestep" | "file"));
        let others = others.map(|a| (a.name().to_string(), a.value().to_string())).collect();
        entries.push(Entry { time, file: file.into(), others });
    }
    entries.sort_by(|a, b| a.time.total_cmp(&b.time));
    Ok(entries)
}

/// A list of entries.
pub fn format(entries: &[Entry]) -> String {
    let mut text =
        String::from("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n  <Collection>\n");
    for Entry { time, file, others } in entries {
        let escaped = super::xml_write::escaped;
        let others: String = others.iter().map(|(name, value)| format!(" {name}=\"{}\"", escaped(value))).collect();
        let _ = writeln!(text, "    <DataSet timestep=\"{time:?}\"{others} file=\"{}\"/>", escaped(file));
    }
    text + "  </Collection>\n</VTKFile>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_say_of_their_entries_is_kept() {
        let list = |inside: &str| format!("<VTKFile type=\"Collection\"><Collection>{inside}</Collection></VTKFile>");
        let entries = |inside: &str| parse(&list(inside)).unwrap();
        let two = "<DataSet timestep='0' group='a &lt; b' part='0' file='a'/><DataSet timestep='' part='1' name='n' file='b'/>";
        let read = entries(two);
        assert_eq!(parse(&format(&read)).unwrap(), read);
        let all: String = read.iter().flat_map(|e| &e.others).map(|(name, value)| format!("{name}={value} ")).collect();
        assert_eq!(all, "group=a < b part=0 part=1 name=n ");
        let times = |inside: &str| entries(inside).iter().map(|e| e.time).collect::<Vec<_>>();
        assert_eq!(times("<DataSet file='a'/><DataSet file='b'/><DataSet file='c'/>"), [0.0, 1.0, 2.0]);
        assert_eq!(times("<DataSet part='0' file='a'/><DataSet part='1' file='b'/>"), [0.0, 0.0]);
    }
}
