//! A value as text.

use elk_describe::{Content, Field, Kind};
use serde_json::Value;

use super::keys::{NAME, VALUE, has_field, joined, key, width};
use super::pose::{self, Poses};

/// The text of a value of `variable`, which is said as JSON.
pub fn text(kind: &Kind, variable: &str, json: &Value, poses: Poses) -> String {
    let mut writer = Writer { text: String::new(), poses };
    if !has_field(kind, NAME) {
        writer.put(NAME, &plain_or_quoted(variable));
    }
    match kind.plain() {
        Kind::Struct(one) => writer.fields(&one.fields, json, ""),
        _ => writer.value(kind, json, VALUE),
    }
    writer.text
}

struct Writer {
    text: String,
    poses: Poses,
}

impl Writer {
    fn put(&mut self, way: &str, value: &str) {
        let comma = if self.text.is_empty() { "" } else { "," };
        self.text += &format!("{comma}{way}={value}");
    }

    fn fields(&mut self, fields: &[Field], json: &Value, way: &str) {
        for field in fields {
            self.value(&field.kind, &json[&field.name], &joined(way, &key(&field.name)));
        }
    }

    fn value(&mut self, kind: &Kind, json: &Value, way: &str) {
        match (kind, json) {
            (Kind::Unnamed(one), _) => self.value(&one.kind, json, way),
            (Kind::Option(inner), _) if !is_nothing_itself(inner) => match json {
                Value::Null => {}
                json => self.value(inner, json, way),
            },
            (Kind::Struct(one), _) => match pose::in_plane(one, json).filter(|_| self.poses == Poses::InPlane) {
                Some(numbers) => self.row(&numbers.map(|number| Value::from(number).to_string()), way),
                None => self.fields(&one.fields, json, way),
            },
            (Kind::Enum(one), _) => {
                let said = match json {
                    Value::Object(object) => object.iter().next().map(|(name, content)| (name.as_str(), content)),
                    json => json.as_str().map(|name| (name, &Value::Null)),
                };
                let variant = said.and_then(|(name, _)| one.variants.iter().find(|variant| variant.name == name));
                let (Some((name, content)), Some(variant)) = (said, variant) else { return };
                self.put(way, name);
                let way = joined(way, name);
                match &variant.content {
                    Content::Unit => {}
                    Content::One(inner) => self.value(inner, content, &way),
                    Content::Tuple(_) => self.put(&way, &content.to_string()),
                    Content::Fields(fields) => self.fields(fields, content, &way),
                }
            }
            (Kind::List(inner) | Kind::Packed(inner), Value::Array(all)) if width(inner).is_some() => {
                self.matrix(all.len(), width(inner).unwrap_or(1), inner, all, way);
            }
            (Kind::Text | Kind::Symbols { .. }, Value::String(text)) => self.put(way, &plain_or_quoted(text)),
            (Kind::Unsigned(_) | Kind::Signed(_) | Kind::Float(_), _) => self.put(way, &number(json)),
            (Kind::Array { of, count }, _) if width(kind).is_some() => {
                let columns = width(of).unwrap_or(1);
                self.matrix(*count as usize, columns, kind, std::slice::from_ref(json), way);
            }
            (kind, _) => match width(kind) {
                Some(width) => self.matrix(width, 1, kind, std::slice::from_ref(json), way),
                None => self.put(way, &json.to_string()),
            },
        }
    }

    /// Numbers that stand below each other.
    fn row(&mut self, numbers: &[String], way: &str) {
        self.put(way, &format!("[{}x1]{{{}}}", numbers.len(), numbers.join(",")));
    }

    /// Values, each of so many numbers.
    fn matrix(&mut self, rows: usize, columns: usize, kind: &Kind, all: &[Value], way: &str) {
        let mut numbers = Vec::new();
        all.iter().for_each(|json| collect(kind, json, &mut numbers));
        self.put(way, &format!("[{rows}x{columns}]{{{}}}", numbers.join(",")));
    }
}

/// Whether a value can be nothing, so that an option of it has to be told from one without a value.
pub fn is_nothing_itself(kind: &Kind) -> bool {
    matches!(kind.plain(), Kind::Unit | Kind::Option(_))
}

/// The numbers of a value that is nothing else, in the order of its bytes.
fn collect(kind: &Kind, json: &Value, numbers: &mut Vec<String>) {
    match (kind, json) {
        (Kind::Unnamed(one), _) => collect(&one.kind, json, numbers),
        (Kind::Struct(one), _) => one.fields.iter().for_each(|field| collect(&field.kind, &json[&field.name], numbers)),
        (Kind::Array { of, .. }, Value::Array(all)) => all.iter().for_each(|one| collect(of, one, numbers)),
        (Kind::Tuple(kinds), Value::Array(all)) => {
            kinds.iter().zip(all).for_each(|(kind, one)| collect(kind, one, numbers));
        }
        (Kind::Rotation, Value::Array(all)) => numbers.extend(all.iter().map(number)),
        _ => numbers.push(number(json)),
    }
}

/// A number, also one that JSON says as a text.
fn number(json: &Value) -> String {
    json.as_str().map_or_else(|| json.to_string(), str::to_owned)
}

/// A text as it is, or in quotes where a reader would take it for something else.
fn plain_or_quoted(text: &str) -> String {
    let ends_something = |letter: char| ",\"{}[]".contains(letter) || letter.is_control();
    match text.is_empty() || text.trim() != text || text.contains(ends_something) {
        true => Value::from(text).to_string(),
        false => text.to_owned(),
    }
}
