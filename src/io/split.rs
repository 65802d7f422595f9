//! A raw appended section is not XML, so an XML file is cut there: the head goes to the XML parser, the arrays are read
//! from the file where they lie.

use super::{broken, system, xml};
use crate::error::Result;
use roxmltree::Document;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// A file cut where its appended section begins.
pub struct Split {
    /// The XML up to there, with the open elements closed.
    head: String,
    /// Bytes of the whole file.
    pub length: u64,
    pub appended: Appended,
}

pub enum Appended {
    None,
    /// Bare bytes from this place in the file on.
    Raw(u64),
    Base64(Vec<u8>),
}

const MARK: &[u8] = b"<AppendedData";

impl Split {
    pub fn of(file: &mut File) -> Result<Split> {
        let length = file.seek(SeekFrom::End(0)).map_err(system)?;
        file.rewind().map_err(system)?;
        let mut head = Vec::new();
        let Some(mark) = read_until(file, &mut head, 0, MARK)? else {
            return Ok(Split { head: xml::text(head)?, length, appended: Appended::None });
        };
        let missing = || broken("its appended section has no beginning");
        let close = read_until(file, &mut head, mark, b">")?.ok_or_else(missing)?;
        let start = read_until(file, &mut head, close, b"_")?.ok_or_else(missing)? + 1;
        let after = head.split_off(start);
        head.truncate(close + 1);
        let tag = String::from_utf8_lossy(&head[mark..]).into_owned();
        let mut head = xml::text(head)?;
        let raw = match xml::attribute(&tag, "encoding") {
            Some("raw") => true,
            Some("base64") | None => false,
            Some(other) => return Err(broken(format!("appended encoding '{other}' is neither raw nor base64"))),
        };
        head.push_str("</AppendedData></VTKFile>");
        let appended = if raw { Appended::Raw(start as u64) } else { Appended::Base64(text_after(file, after)?) };
        Ok(Split { head, length, appended })
    }

    pub fn document(&self) -> Result<Document<'_>> {
        xml::document(&self.head)
    }
}

/// Reads on until `pattern` is found in `bytes`, not before `from`; its place, or `None` at the end of the file.
fn read_until(file: &mut File, bytes: &mut Vec<u8>, from: usize, pattern: &[u8]) -> Result<Option<usize>> {
    let mut from = from;
    loop {
        if let Some(place) = find(&bytes[from..], pattern) {
            return Ok(Some(from + place));
        }
        if bytes[from..].contains(&0) {
            return Err(broken("it is no XML: there is a byte 0 where text should be"));
        }
        from = from.max((bytes.len() + 1).saturating_sub(pattern.len()));
        let step = 1 << 16;
        bytes
            .try_reserve(step)
            .map_err(|_| crate::memory::no_memory::<u8>("the text of the file", bytes.len() + step))?;
        if file.by_ref().take(step as u64).read_to_end(bytes).map_err(system)? == 0 {
            return Ok(None);
        }
    }
}

fn find(bytes: &[u8], pattern: &[u8]) -> Option<usize> {
    let mut from = 0;
    while let Some(place) = bytes[from..].iter().position(|b| b == &pattern[0]) {
        from += place;
        if bytes[from..].starts_with(pattern) {
            return Some(from);
        }
        from += 1;
    }
    None
}

/// The rest of a base64 section: up to the element's end tag.
fn text_after(file: &mut File, mut text: Vec<u8>) -> Result<Vec<u8>> {
    let end = match read_until(file, &mut text, 0, b"<")? {
        Some(end) => end,
        None => text.len(),
    };
    text.truncate(end);
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_text_is_not_read_to_its_end() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.vtu");
        File::create(&path).unwrap().set_len(1 << 40).unwrap(); // a hole
        let error = Split::of(&mut File::open(&path).unwrap()).err().unwrap().to_string();
        assert!(error.contains("no XML"), "{error}");
    }

    #[test]
    fn marks_are_found_wherever_the_reading_stops() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.vtu");
        for before in [0, 5, (1 << 16) - 20, (1 << 16) - 7, 1 << 16, (1 << 16) + 3, 200_000] {
            let head = format!("<VTKFile><a>{}</a>", "<".repeat(before).replace('<', "&lt;"));
            std::fs::write(&path, format!("{head}<AppendedData encoding = 'raw' >\n _\u{1}\u{2}<")).unwrap();
            let split = Split::of(&mut File::open(&path).unwrap()).unwrap();
            assert!(split.head.starts_with(&head) && split.document().is_ok());
            assert!(matches!(split.appended, Appended::Raw(place) if place == split.length - 3));
        }
    }
}
