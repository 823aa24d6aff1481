//! A type's definition, as people read one.

use elk_bus::Description;
use elk_bus::describe::{Content, Field, Kind};
use elk_outside::text::printable;

/// Its fields, a line each, those of types in it below and further in: name, kind, unit, and what it means.
pub fn lines(description: &Description) -> Vec<String> {
    let mut lines = Vec::new();
    put_inner(description.kind(), 0, &mut lines);
    lines
}

fn put_inner(kind: &Kind, depth: usize, lines: &mut Vec<String>) {
    match kind {
        Kind::Option(inner) | Kind::List(inner) | Kind::Packed(inner) | Kind::Array { of: inner, .. } => {
            put_inner(inner, depth, lines);
        }
        Kind::Tuple(all) => all.iter().for_each(|kind| put_inner(kind, depth, lines)),
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
                    Content::Tuple(kinds) => kinds.iter().for_each(|kind| put_inner(kind, depth + 1, lines)),
                    Content::Fields(fields) => fields.iter().for_each(|field| put_field(field, depth + 1, lines)),
                }
            }
        }
        _ => {}
    }
}

fn put_field(field: &Field, depth: usize, lines: &mut Vec<String>) {
    let unit = if field.unit.is_empty() { String::new() } else { format!(", {}", field.unit) };
    let default = field.default.as_ref().map(|default| format!(", {default} if left out")).unwrap_or_default();
    put(depth, &format!("{}: {}{unit}{default}", field.name, field.kind), &field.docs, lines);
    put_inner(&field.kind, depth + 1, lines);
}

fn put(depth: usize, what: &str, docs: &str, lines: &mut Vec<String>) {
    let line = format!("{:1$}{what:<28} {docs}", "", 2 * depth);
    lines.push(printable(line.trim_end()).into_owned());
}
