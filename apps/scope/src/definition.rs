//! A type's definition, as people read one.

use elk_bus::Description;
use elk_bus::describe::{Content, Field, Kind};
use elk_outside::text::printable;

/// What it means, then its fields, a line each, those of types in it below and further in: name, kind, unit, and what it means.
pub fn lines(description: &Description) -> Vec<String> {
    let mut lines = Vec::new();
    // Of a value without a name that stands at its line.
    if !matches!(description.kind(), Kind::Unnamed(_)) && !description.docs().is_empty() {
        lines.push(printable(&without_links(description.docs())).into_owned());
    }
    put_inner(description.kind(), 0, &mut lines);
    lines
}

fn put_inner(kind: &Kind, depth: usize, lines: &mut Vec<String>) {
    match kind {
        Kind::Option(inner) | Kind::List(inner) | Kind::Packed(inner) | Kind::Array { of: inner, .. } => {
            put_inner(inner, depth, lines);
        }
        Kind::Tuple(all) => put_all(all, depth, lines),
        Kind::Unnamed(one) => put_unnamed("", one, depth, lines),
        Kind::Struct(one) => one.fields.iter().for_each(|field| put_field(field, depth, lines)),
        Kind::Enum(one) => {
            for variant in &one.variants {
                let content = match &variant.content {
                    Content::Unit => String::new(),
                    Content::One(kind) => format!("({kind})"),
                    Content::Tuple(kinds) => Kind::Tuple(kinds.clone()).to_string(),
                    Content::Fields(_) => " { … }".to_owned(),
                };
                put(depth, &format!("{}{content}", variant.name), &variant.docs, lines);
                match &variant.content {
                    Content::Unit => {}
                    Content::One(kind) => put_inner(kind, depth + 1, lines),
                    Content::Tuple(kinds) => put_all(kinds, depth + 1, lines),
                    Content::Fields(fields) => fields.iter().for_each(|field| put_field(field, depth + 1, lines)),
                }
            }
        }
        _ => {}
    }
}

/// Values without names: by their place, where something is said of them.
fn put_all(all: &[Kind], depth: usize, lines: &mut Vec<String>) {
    for (i, kind) in all.iter().enumerate() {
        match kind {
            Kind::Unnamed(one) => put_unnamed(&format!("[{i}]: "), one, depth, lines),
            kind => put_inner(kind, depth, lines),
        }
    }
}

fn put_unnamed(place: &str, one: &Field, depth: usize, lines: &mut Vec<String>) {
    put(depth, &format!("{place}{}", said(one)), &without_unit(one), lines);
    put_inner(&one.kind, depth + 1, lines);
}

/// A field's kind, and what is said of it.
fn said(field: &Field) -> String {
    let unit = if field.unit.is_empty() { String::new() } else { format!(", {}", field.unit) };
    let default = field.default.as_ref().map(|default| format!(", {default} if left out")).unwrap_or_default();
    let range = if field.range.is_all() { String::new() } else { format!(", {}", field.range) };
    format!("{}{unit}{range}{default}", field.kind)
}

fn put_field(field: &Field, depth: usize, lines: &mut Vec<String>) {
    put(depth, &format!("{}: {}", field.name, said(field)), &without_unit(field), lines);
    put_inner(&field.kind, depth + 1, lines);
}

fn put(depth: usize, what: &str, docs: &str, lines: &mut Vec<String>) {
    let line = format!("{:1$}{what:<28} {2}", "", 2 * depth, without_links(docs));
    lines.push(printable(line.trim_end()).into_owned());
}

/// What a field means, without its unit at the end: that stands beside its kind.
fn without_unit(field: &Field) -> String {
    let (docs, stop) = field.docs.strip_suffix('.').map_or((field.docs.as_str(), ""), |docs| (docs, "."));
    let unit = if field.unit.is_empty() { String::new() } else { format!(" ({})", field.unit) };
    format!("{}{stop}", docs.strip_suffix(&unit).unwrap_or(docs))
}

/// Docs as people read them where there is nothing to follow: of a link to code its name, of one with a text that.
fn without_links(docs: &str) -> String {
    let (mut plain, mut rest) = (String::new(), docs);
    while let Some((before, link)) = rest.split_once('[') {
        let Some((text, behind)) = link.split_once(']') else { break };
        let code = text.strip_prefix('`').and_then(|text| text.strip_suffix('`'));
        let target = behind.strip_prefix('(').and_then(|behind| behind.split_once(')'));
        plain += before;
        rest = match (code, target) {
            (_, Some((_, behind))) => {
                plain += code.unwrap_or(text);
                behind
            }
            (Some(code), None) => {
                plain += code.trim_start_matches("crate::").trim_start_matches("Self::");
                behind
            }
            (None, None) => {
                plain.push('[');
                link
            }
        };
    }
    plain + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_bus::describe::Describe;

    /// What happened.
    #[derive(Describe)]
    #[describe(crate = elk_bus::describe)]
    #[allow(dead_code)]
    enum Event {
        /// Straight on.
        Moved(
            /// How far (m).
            #[describe(unit = "m", range = 0.0..=9.5)]
            f64,
        ),
        Turned(#[describe(unit = "rad")] f64, bool),
    }

    #[test]
    fn what_is_said_of_values_without_names_is_shown() {
        let lines: Vec<String> = lines(&Description::of(&Event::SHAPE))
            .iter()
            .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "))
            .collect();
        assert_eq!(
            lines,
            [
                "What happened.",
                "Moved(f64 m) Straight on.",
                "f64, m, 0 to 9.5 How far.",
                "Turned(f64 rad, bool)",
                "[0]: f64, rad"
            ]
        );
    }

    #[test]
    fn links_of_docs_are_their_names() {
        let docs =
            "Its [`crate::messages::PoseCommand::id`], of [a page](https://a.b/c), [`Scan`](crate::Scan), [0, 1] and [";
        assert_eq!(without_links(docs), "Its messages::PoseCommand::id, of a page, Scan, [0, 1] and [");
    }
}
