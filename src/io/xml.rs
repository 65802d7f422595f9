//! XML as text and as a tree: in the encodings that VTK's parser knows, and with no more of anything than its files have.

use super::broken;
use crate::error::Result;
use crate::memory;
use roxmltree::{Document, ParsingOptions};

/// The text of a file's first bytes, by the encoding that its declaration names.
pub fn text(bytes: Vec<u8>) -> Result<String> {
    let declared = declared_encoding(&bytes).unwrap_or_default().to_ascii_lowercase();
    match declared.as_str() {
        "" | "utf-8" | "us-ascii" | "ascii" => String::from_utf8(bytes).map_err(|_| {
            broken("it is no VTK file: its text is not UTF-8, and it declares no other encoding; save it as UTF-8")
        }),
        "iso-8859-1" | "latin1" => latin1(&bytes),
        other => Err(broken(format!("its encoding '{other:.20}' is not supported; save it as UTF-8"))),
    }
}

/// The value of `encoding` in the declaration that a file begins with.
fn declared_encoding(bytes: &[u8]) -> Option<&str> {
    let start = bytes.get(..bytes.len().min(200))?.strip_prefix(b"<?xml")?;
    let end = start.windows(2).position(|two| two == b"?>")?;
    attribute(std::str::from_utf8(&start[..end]).ok()?, "encoding")
}

/// The characters of Latin-1 are the first of Unicode.
fn latin1(bytes: &[u8]) -> Result<String> {
    let long = bytes.iter().filter(|b| !b.is_ascii()).count();
    let mut text = String::new();
    let length = bytes.len() + long;
    text.try_reserve_exact(length).map_err(|_| memory::no_memory::<u8>("the text of the file", length))?;
    text.extend(bytes.iter().map(|b| char::from(*b)));
    Ok(text)
}

/// The value of an attribute in a start tag.
pub fn attribute<'a>(tag: &'a str, name: &str) -> Option<&'a str> {
    let value = tag.split_once(name)?.1.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    value[1..].split(quote).next()
}

/// The tree of a text.
pub fn document(text: &str) -> Result<Document<'_>> {
    bound(text.as_bytes())?;
    let options = ParsingOptions { allow_dtd: true, nodes_limit: NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|e| broken(format!("its XML is wrong: {e}")))
}

/// The most attributes of an element, and the most that declare name spaces in a whole file: the parser compares each
/// with each. VTK's own files have a dozen and none.
const ATTRIBUTES: usize = 500;
const NAME_SPACES: usize = 50;

/// The most elements and texts, each of which takes the parser more memory than the file.
const NODES: u32 = 1 << 21;

/// Refuses what the parser would take long for.
fn bound(text: &[u8]) -> Result<()> {
    let mut rest = text;
    let mut spaces = 0;
    while let Some(start) = rest.iter().position(|b| *b == b'<') {
        rest = &rest[start..];
        let end = [(&b"<!--"[..], &b"-->"[..]), (b"<![CDATA[", b"]]>"), (b"<?", b"?>")];
        if let Some((_, end)) = end.iter().find(|(start, _)| rest.starts_with(start)) {
            rest = rest.windows(end.len()).position(|w| w == *end).map_or(&[], |at| &rest[at..]);
            continue;
        }
        let tag = tag_of(rest);
        if rest.starts_with(b"<!") && tag.contains(&b'[') {
            return Err(broken("its DOCTYPE defines more than a name; save it without"));
        }
        if attributes(tag) > ATTRIBUTES {
            return Err(broken(format!("an element has more than {ATTRIBUTES} attributes, which no VTK file has")));
        }
        spaces += tag.windows(5).filter(|w| *w == b"xmlns").count();
        if spaces > NAME_SPACES {
            return Err(broken(format!("it declares more than {NAME_SPACES} name spaces, which no VTK file does")));
        }
        rest = &rest[tag.len()..];
    }
    Ok(())
}

/// A tag from its `<` to before its `>`, which is not one in quotes.
fn tag_of(text: &[u8]) -> &[u8] {
    let mut quote = None;
    let end = text.iter().position(|&b| match quote {
        Some(open) => {
            quote = quote.filter(|_| b != open);
            false
        }
        None => {
            quote = Some(b).filter(|b| matches!(b, b'"' | b'\''));
            b == b'>'
        }
    });
    &text[..end.unwrap_or(text.len())]
}

fn attributes(tag: &[u8]) -> usize {
    tag.iter().filter(|b| **b == b'=').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_read_as_xml_has_them() {
        assert_eq!(attribute("<AppendedData encoding=\"raw\">", "encoding"), Some("raw"));
        assert_eq!(attribute("<AppendedData  encoding\n= 'base64' >", "encoding"), Some("base64"));
        assert_eq!(attribute("<AppendedData>", "encoding"), None);
        assert_eq!(attribute("<AppendedData encoding=raw>", "encoding"), None);
    }

    #[test]
    fn an_encoding_is_what_the_file_declares() {
        for name in ["ISO-8859-1", "iso-8859-1"] {
            let file = format!("<?xml version=\"1.0\" encoding='{name}'?><a b='T_").into_bytes();
            let text = text([&file[..], b"\xfc'/>"].concat()).unwrap();
            assert_eq!(document(&text).unwrap().root_element().attribute("b"), Some("T_ü"));
        }
        let error = |bytes: &[u8]| text(bytes.to_vec()).unwrap_err().to_string();
        assert!(error(b"<a b='\xfc'/>").contains("not UTF-8"));
        assert!(error(b"<?xml version=\"1.0\" encoding=\"koi8-r\"?><a/>").contains("'koi8-r' is not supported"));
    }

    #[test]
    fn more_than_any_file_has_is_refused_at_once() {
        let many = |n, name: &str| (0..n).map(|i| format!(" {name}{i}='='")).collect::<String>();
        for (text, expected) in [
            (format!("<a{}/>", many(300_000, "b")), "500 attributes"),
            (format!("<a><!-- > --><b x='>'{}/></a>", many(300_000, "b")), "500 attributes"),
            ("<a>".to_string() + &format!("<b{}/>", many(40, "xmlns:b")).repeat(2000), "50 name spaces"),
            ("<!DOCTYPE a [<!ENTITY b 'c'>]><a/>".into(), "DOCTYPE"),
            ("<a>".to_string() + &"<b/>".repeat(3_000_000) + "</a>", "nodes limit"),
        ] {
            let start = std::time::Instant::now();
            let error = document(&text).unwrap_err().to_string();
            assert!(error.contains(expected) && start.elapsed().as_secs_f64() < 2.0, "{error}");
        }
        for good in [format!("<a{}/>", many(200, "b")), "<!DOCTYPE a SYSTEM 'a.dtd'><a/>".into()] {
            assert!(document(&good).is_ok());
        }
    }
}
