//! `include/diffusph.h` as data: macros, functions, the report.

use super::root;

/// A C function: its name, its result, and its arguments, all in C's words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Function {
    pub name: String,
    pub result: String,
    pub arguments: Vec<Argument>,
}

/// An argument or a member of a struct: the words of its type without const, and its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Argument {
    pub kind: String,
    pub name: String,
}

pub fn text() -> String {
    std::fs::read_to_string(root().join("include/diffusph.h")).unwrap()
}

/// Names of all macros but the include guard.
pub fn macros() -> Vec<String> {
    let text = text();
    let names = text.lines().filter_map(|line| line.strip_prefix("#define ")?.split_whitespace().next());
    names.filter(|name| *name != "DIFFUSPH_H").map(String::from).collect()
}

/// The number that a macro is defined as, if it is a plain one.
pub fn value_of(name: &str) -> Option<i64> {
    text().lines().find_map(|line| line.strip_prefix(&format!("#define {name} "))?.trim().parse().ok())
}

pub fn functions() -> Vec<Function> {
    prototypes(&text())
}

/// Members of the report, in order.
pub fn report() -> Vec<Argument> {
    members(&text(), "diffusph_report")
}

/// All prototypes of functions of ours in a C text.
pub fn prototypes(text: &str) -> Vec<Function> {
    let mut found = Vec::new();
    for statement in without_comments(text).split(';') {
        let statement = words(statement.rsplit(['{', '}']).next().unwrap_or_default());
        let Some((head, arguments)) = statement.split_once('(') else { continue };
        let Some(at) = head.rfind("diffusph_") else { continue };
        if head.contains("typedef") || arguments.contains('(') && head.ends_with('(') {
            continue;
        }
        let arguments = arguments.trim_end().trim_end_matches(')').trim();
        let list = arguments.split(',').filter(|a| !a.trim().is_empty() && a.trim() != "void");
        let result = kind(&head[..at]);
        found.push(Function { name: head[at..].trim().into(), result, arguments: list.map(argument).collect() });
    }
    found
}

/// Members of a struct in a C text.
pub fn members(text: &str, name: &str) -> Vec<Argument> {
    let text = without_comments(text);
    let Some(at) = text.find(&format!("struct {name} {{")) else { return Vec::new() };
    let body = text[at..].split_once('{').and_then(|(_, rest)| rest.split_once('}')).unwrap_or_default().0;
    body.split(';').filter(|m| !m.trim().is_empty()).map(argument).collect()
}

fn argument(text: &str) -> Argument {
    let text = words(text);
    let at = text.rfind(|c: char| !(c.is_alphanumeric() || c == '_')).map_or(0, |at| at + 1);
    Argument { kind: kind(&text[..at]), name: text[at..].into() }
}

fn kind(text: &str) -> String {
    let spaced = text.replace('*', " * ");
    let kept = spaced.split_whitespace().filter(|w| !matches!(*w, "const" | "struct" | "extern"));
    kept.collect::<Vec<_>>().join(" ")
}

fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Without comments and preprocessor lines.
pub fn without_comments(text: &str) -> String {
    let mut kept = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("/*") {
        kept += before;
        rest = after.split_once("*/").unwrap_or_default().1;
    }
    kept += rest;
    kept.lines().filter(|line| !line.trim_start().starts_with('#')).collect::<Vec<_>>().join("\n")
}
