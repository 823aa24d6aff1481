//! JSON as bytes.

use serde_json::{Map, Value};

use crate::Description;
use crate::description::{Content, Field, Kind};
use crate::json::{float, joined};

/// The bytes of a value of this kind, if that is what the JSON says.
pub fn bytes_of(kind: &Kind, json: &Value) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    write(kind, json, "", &mut bytes).ok().map(|()| bytes)
}

/// Why JSON is no value of a type.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("this is no {type_name}: {reason}")]
pub struct WriteError {
    /// The type's name.
    pub type_name: String,
    /// The field at fault, and what is wrong with it.
    pub reason: String,
}

impl Description {
    /// The bytes of a value that is said as JSON, as [`Description::to_json`] says it. A field with a default may be left out.
    /// What else a type asks of its values (`longest`, `check`) no description says: only who has the type knows.
    ///
    /// # Errors
    /// The JSON is no value of the type: a field that is missing, unknown, of another kind, or out of its range.
    pub fn to_bytes(&self, json: &Value) -> Result<Vec<u8>, WriteError> {
        let mut bytes = Vec::new();
        match write(self.kind(), json, "", &mut bytes) {
            Ok(()) => Ok(bytes),
            Err(reason) => Err(WriteError { type_name: self.name().to_owned(), reason }),
        }
    }

    /// A value of the type, for people who want to say one: defaults, zeros or what is in their range, empty lists, first
    /// variants.
    pub fn example(&self) -> Value {
        example(self.kind())
    }
}

impl Field {
    /// Puts the field's value behind `bytes`, as [`Description::to_bytes`] does; without one its default. `way` leads to it in what
    /// an error says.
    ///
    /// # Errors
    /// The JSON is no value of the field, or none is there and there is no default.
    pub fn put(&self, json: Option<&Value>, way: &str, bytes: &mut Vec<u8>) -> Result<(), String> {
        match json.or(self.default.as_ref()) {
            Some(json) => write_field(self, json, way, bytes),
            None => Err(format!("{way} is missing")),
        }
    }
}

type Written = Result<(), String>;

fn write(kind: &Kind, json: &Value, field: &str, bytes: &mut Vec<u8>) -> Written {
    let wrong = |wanted: &str| Err(format!("{} is {}; it has to be {wanted}", named(field), shown(json)));
    match (kind, json) {
        (Kind::Unit, Value::Null) => Ok(()),
        (Kind::Unit, _) => wrong("null"),
        (Kind::Bool, Value::Bool(flag)) => put(bytes, &[u8::from(*flag)]),
        (Kind::Bool, _) => wrong("true or false"),
        (Kind::Unsigned(width), _) => match json.as_u64().filter(|number| number >> (8 * u32::from(*width) - 1) <= 1) {
            Some(number) => put(bytes, &number.to_le_bytes()[..usize::from(*width)]),
            None => wrong(&format!("a number from 0 to {}", u64::MAX >> (64 - 8 * u32::from(*width)))),
        },
        (Kind::Signed(width), _) => {
            let most = i64::MAX >> (64 - 8 * u32::from(*width));
            match json.as_i64().filter(|number| (-most - 1..=most).contains(number)) {
                Some(number) => put(bytes, &number.to_le_bytes()[..usize::from(*width)]),
                None => wrong(&format!("a number from {} to {most}", -most - 1)),
            }
        }
        (Kind::Float(4), _) => match float(json).map(|number| (number as f32, number)) {
            Some((single, number)) if single.is_finite() == number.is_finite() => put(bytes, &single.to_le_bytes()),
            Some(_) => wrong(&format!("a number from {:e} to {:e}", f32::MIN, f32::MAX)),
            None => wrong("a number"),
        },
        (Kind::Float(_), _) => match float(json) {
            Some(number) => put(bytes, &number.to_le_bytes()),
            None => wrong("a number"),
        },
        (Kind::Rotation, Value::Array(all)) if all.len() == 4 => {
            write_all(std::iter::repeat(&Kind::Float(8)), all, field, bytes)
        }
        (Kind::Rotation, _) => wrong("a list of 4: x, y, z and w of a quaternion"),
        (Kind::Text, Value::String(text)) => {
            length(bytes, text.len());
            put(bytes, text.as_bytes())
        }
        (Kind::Text, _) => wrong("a text"),
        (Kind::Option(_), Value::Null) => put(bytes, &[0]),
        (Kind::Option(inner), _) => {
            bytes.push(1);
            match json.as_array().map(Vec::as_slice) {
                Some([one]) if inner.may_be_null() => write(inner, one, field, bytes),
                _ if inner.may_be_null() => wrong("null, or a list of one"),
                _ => write(inner, json, field, bytes),
            }
        }
        (Kind::List(inner), Value::Array(all)) => {
            length(bytes, all.len());
            write_all(std::iter::repeat(&**inner), all, field, bytes)
        }
        (Kind::Packed(inner), Value::Array(all)) => {
            let mut packed = Vec::new();
            write_all(std::iter::repeat(&**inner), all, field, &mut packed)?;
            length(bytes, packed.len());
            put(bytes, &packed)
        }
        (Kind::List(_) | Kind::Packed(_), _) => wrong("a list"),
        (Kind::Symbols { bits, letters, least }, Value::String(text)) => {
            symbols(*bits, (letters, *least as usize), text, field, bytes)
        }
        (Kind::Symbols { letters, .. }, _) => wrong(&format!("a text of the letters {letters}")),
        (Kind::Array { of, count }, Value::Array(all)) if all.len() as u64 == *count => {
            write_all(std::iter::repeat(&**of), all, field, bytes)
        }
        (Kind::Array { count, .. }, _) => wrong(&format!("a list of {count}")),
        (Kind::Tuple(kinds), Value::Array(all)) if all.len() == kinds.len() => {
            write_all(kinds.iter(), all, field, bytes)
        }
        (Kind::Tuple(kinds), _) => wrong(&format!("a list of {}", kinds.len())),
        (Kind::Unnamed(one), _) => write_field(one, json, field, bytes),
        (Kind::Struct(one), Value::Object(object)) => write_fields(&one.fields, object, field, bytes),
        (Kind::Struct(one), _) => wrong(&format!("an object with {}", names(&one.fields))),
        (Kind::Enum(one), _) => {
            let variants = || one.variants.iter().map(|one| one.name.as_str()).collect::<Vec<_>>().join(", ");
            let said = match json {
                Value::String(name) => Some((name, &Value::Null)),
                Value::Object(object) if object.len() == 1 => object.iter().next(),
                _ => None,
            };
            let Some((name, content)) = said else {
                return wrong(&format!("one of {}", variants()));
            };
            let Some(number) = one.variants.iter().position(|variant| variant.name == *name) else {
                return wrong(&format!("one of {}", variants()));
            };
            put(bytes, &(number as u32).to_le_bytes())?;
            let field = joined(field, name);
            match (&one.variants[number].content, content) {
                (Content::Unit, Value::Null) => Ok(()),
                (Content::Unit, _) => Err(format!("{} holds nothing", named(&field))),
                (Content::One(inner), content) => write(inner, content, &field, bytes),
                (Content::Tuple(kinds), Value::Array(all)) if all.len() == kinds.len() => {
                    write_all(kinds.iter(), all, &field, bytes)
                }
                (Content::Tuple(kinds), _) => Err(format!("{} holds a list of {}", named(&field), kinds.len())),
                (Content::Fields(fields), Value::Object(object)) => write_fields(fields, object, &field, bytes),
                (Content::Fields(fields), _) => Err(format!("{} holds {}", named(&field), names(fields))),
            }
        }
    }
}

fn put(bytes: &mut Vec<u8>, more: &[u8]) -> Written {
    bytes.extend_from_slice(more);
    Ok(())
}

fn length(bytes: &mut Vec<u8>, length: usize) {
    bytes.extend_from_slice(&(length as u64).to_le_bytes());
}

fn write_all<'a>(kinds: impl Iterator<Item = &'a Kind>, all: &[Value], field: &str, bytes: &mut Vec<u8>) -> Written {
    let mut each = kinds.zip(all).enumerate();
    each.try_for_each(|(i, (kind, json))| write(kind, json, &format!("{field}[{i}]"), bytes))
}

fn write_fields(fields: &[Field], object: &Map<String, Value>, field: &str, bytes: &mut Vec<u8>) -> Written {
    if let Some(unknown) = object.keys().find(|name| !fields.iter().any(|field| field.name == **name)) {
        return Err(format!("{} has no field {unknown}; it has {}", named(field), names(fields)));
    }
    fields.iter().try_for_each(|one| one.put(object.get(&one.name), &joined(field, &one.name), bytes))
}

/// The value of a field, in the field's range.
fn write_field(one: &Field, json: &Value, field: &str, bytes: &mut Vec<u8>) -> Written {
    if !one.may_be(json) {
        let wanted = format!("{} {}", one.range, one.unit);
        return Err(format!("{} is {}; it has to be {}", named(field), shown(json), wanted.trim_end()));
    }
    write(&one.kind, json, field, bytes)
}

fn symbols(bits: u8, (letters, least): (&str, usize), text: &str, field: &str, bytes: &mut Vec<u8>) -> Written {
    let each = 8 / usize::from(bits);
    let number = |letter: char| {
        let found = letters.chars().position(|one| one == letter);
        found.ok_or_else(|| format!("{} has the letter {letter:?}; right are {letters}", named(field)))
    };
    let mut numbers = text.chars().map(number).collect::<Result<Vec<_>, _>>()?;
    numbers.resize(numbers.len().max(least), 0);
    length(bytes, numbers.len().div_ceil(each));
    for group in numbers.chunks(each) {
        bytes.push(group.iter().rev().fold(0, |byte, number| byte << bits | *number as u8));
    }
    Ok(())
}

fn named(field: &str) -> &str {
    if field.is_empty() { "the value" } else { field }
}

fn names(fields: &[Field]) -> String {
    fields.iter().map(|field| field.name.as_str()).collect::<Vec<_>>().join(", ")
}

/// The beginning of a value, for an error that says what was there.
pub fn shown(json: &Value) -> String {
    const LONGEST: usize = 60;
    let text = json.to_string();
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

fn example_of(field: &Field) -> Value {
    match &field.default {
        Some(default) => default.clone(),
        None => field.or_within_range(example(&field.kind)),
    }
}

pub fn example(kind: &Kind) -> Value {
    let fields = |fields: &[Field]| -> Value {
        fields.iter().map(|field| (field.name.clone(), example_of(field))).collect::<Map<_, _>>().into()
    };
    match kind {
        Kind::Unit | Kind::Option(_) => Value::Null,
        Kind::Bool => false.into(),
        Kind::Unsigned(_) | Kind::Signed(_) => 0.into(),
        Kind::Float(_) => 0.0.into(),
        Kind::Rotation => Value::from([0.0, 0.0, 0.0, 1.0].to_vec()),
        Kind::Text | Kind::Symbols { .. } => "".into(),
        Kind::List(_) | Kind::Packed(_) => Value::Array(Vec::new()),
        Kind::Array { of, count } => (0..*count).map(|_| example(of)).collect(),
        Kind::Tuple(kinds) => kinds.iter().map(example).collect(),
        Kind::Unnamed(one) => example_of(one),
        Kind::Struct(one) => fields(&one.fields),
        Kind::Enum(one) => {
            let Some(first) = one.variants.first() else { return Value::Null };
            let content = match &first.content {
                Content::Unit => return first.name.as_str().into(),
                Content::One(inner) => example(inner),
                Content::Tuple(kinds) => kinds.iter().map(example).collect(),
                Content::Fields(inner) => fields(inner),
            };
            Map::from_iter([(first.name.clone(), content)]).into()
        }
    }
}
