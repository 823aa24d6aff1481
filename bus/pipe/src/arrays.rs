//! Lists of numbers as base64, for programs that want them at once and not number by number: `{"dtype": "<f8", "shape": [2, 3],
//! "base64": "…"}`, which is numpy's `frombuffer(b64decode(base64), dtype).reshape(shape)`. The first number of the shape is how
//! many the list has, the others what each of them always is; numbers are little-endian, row by row.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use elk_bus::describe::{Content, Field, Kind};
use serde_json::{Map, Value, json};

use crate::words::{number, number_of};

/// The keys of such an object.
const DTYPE: &str = "dtype";
const SHAPE: &str = "shape";
const BASE64: &str = "base64";

/// A number's type, in numpy's words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Dtype {
    Unsigned(usize),
    Signed(usize),
    Float(usize),
}

impl Dtype {
    /// All that there are.
    const ALL: [Self; 10] = [
        Self::Unsigned(1),
        Self::Unsigned(2),
        Self::Unsigned(4),
        Self::Unsigned(8),
        Self::Signed(1),
        Self::Signed(2),
        Self::Signed(4),
        Self::Signed(8),
        Self::Float(4),
        Self::Float(8),
    ];

    fn of(kind: &Kind) -> Option<Self> {
        let one = match kind {
            Kind::Unsigned(bytes) => Self::Unsigned((*bytes).into()),
            Kind::Signed(bytes) => Self::Signed((*bytes).into()),
            Kind::Float(bytes) => Self::Float((*bytes).into()),
            _ => return None,
        };
        Self::ALL.contains(&one).then_some(one)
    }

    fn size(self) -> usize {
        let (Self::Unsigned(size) | Self::Signed(size) | Self::Float(size)) = self;
        size
    }

    /// `<f8`; of one byte there is no order.
    fn name(self) -> String {
        let order = if self.size() == 1 { '|' } else { '<' };
        let letter = match self {
            Self::Unsigned(_) => 'u',
            Self::Signed(_) => 'i',
            Self::Float(_) => 'f',
        };
        format!("{order}{letter}{}", self.size())
    }

    /// Appends a number; `None`: it is none of these.
    fn put(self, said: &Value, bytes: &mut Vec<u8>) -> Option<()> {
        match self {
            Self::Float(4) => bytes.extend((number_of(said)? as f32).to_le_bytes()),
            Self::Float(_) => bytes.extend(number_of(said)?.to_le_bytes()),
            Self::Unsigned(size) => bytes.extend(said.as_u64()?.to_le_bytes().get(..size)?),
            Self::Signed(size) => bytes.extend(said.as_i64()?.to_le_bytes().get(..size)?),
        }
        Some(())
    }

    /// The number that these bytes are.
    fn get(self, bytes: &[u8]) -> Value {
        let mut all = [0; 8];
        all.iter_mut().zip(bytes).for_each(|(one, byte)| *one = *byte);
        let unused = 64 - 8 * self.size() as u32;
        match self {
            Self::Float(4) => number(f32::from_bits(u64::from_le_bytes(all) as u32).into()),
            Self::Float(_) => number(f64::from_le_bytes(all)),
            Self::Unsigned(_) => u64::from_le_bytes(all).into(),
            // The sign is the uppermost bit that there is.
            Self::Signed(_) => (i64::from_le_bytes(all) << unused >> unused).into(),
        }
    }
}

/// What a list's values always are, if they are nothing but numbers: of which type, and in which shape.
fn numbers(kind: &Kind) -> Option<(Dtype, Vec<usize>)> {
    match kind {
        Kind::Unnamed(one) => numbers(&one.kind),
        Kind::Rotation => Some((Dtype::Float(8), vec![4])),
        Kind::Array { of, count } => {
            let (dtype, mut shape) = numbers(of)?;
            shape.insert(0, usize::try_from(*count).ok().filter(|count| *count > 0)?);
            Some((dtype, shape))
        }
        kind => Some((Dtype::of(kind)?, Vec::new())),
    }
}

/// A value of this kind, its lists of numbers in base64.
pub fn packed(kind: &Kind, value: Value) -> Value {
    match (kind, value) {
        (Kind::List(inner) | Kind::Packed(inner), Value::Array(all)) => match pack(inner, &all) {
            Some(packed) => packed,
            None => all.into_iter().map(|one| packed(inner, one)).collect(),
        },
        (kind, value) => within(kind, value, &|kind, value, _| Ok(packed(kind, value)), "").unwrap_or_default(),
    }
}

fn pack(inner: &Kind, all: &[Value]) -> Option<Value> {
    let (dtype, each) = numbers(inner)?;
    let mut bytes = Vec::new();
    all.iter().try_for_each(|one| put(dtype, one, &mut bytes))?;
    let shape: Vec<usize> = std::iter::once(all.len()).chain(each).collect();
    Some(json!({DTYPE: dtype.name(), SHAPE: shape, BASE64: STANDARD.encode(bytes)}))
}

fn put(dtype: Dtype, value: &Value, bytes: &mut Vec<u8>) -> Option<()> {
    match value {
        Value::Array(all) => all.iter().try_for_each(|one| put(dtype, one, bytes)),
        one => dtype.put(one, bytes),
    }
}

/// Whether something in a value is in base64, or looks like it.
pub fn is_packed(value: &Value) -> bool {
    match value {
        Value::Array(all) => all.iter().any(is_packed),
        Value::Object(all) => all.contains_key(BASE64) || all.values().any(is_packed),
        _ => false,
    }
}

/// A value of this kind, number by number.
///
/// # Errors
/// What is in base64 is no list of numbers: where, and what would be right.
pub fn unpacked(kind: &Kind, value: Value) -> Result<Value, String> {
    unpacked_at(kind, value, "")
}

fn unpacked_at(kind: &Kind, value: Value, way: &str) -> Result<Value, String> {
    match (kind, value) {
        (Kind::List(inner) | Kind::Packed(inner), Value::Object(said)) if said.contains_key(BASE64) => {
            let way = if way.is_empty() { "the value" } else { way };
            let (_, each) =
                numbers(inner).ok_or_else(|| format!("{way} is a list of other things than numbers; right is JSON"))?;
            unpack(&each, &said).map_err(|reason| format!("{way}: {reason}"))
        }
        (Kind::List(inner) | Kind::Packed(inner), Value::Array(all)) => {
            all.into_iter().map(|one| unpacked_at(inner, one, way)).collect()
        }
        (kind, value) => within(kind, value, &unpacked_at, way),
    }
}

/// The numbers of a list, each of the shape `each`.
fn unpack(each: &[usize], said: &Map<String, Value>) -> Result<Value, String> {
    let dtypes = Dtype::ALL.map(Dtype::name);
    let dtype = said.get(DTYPE).and_then(Value::as_str).unwrap_or_default();
    let dtype = Dtype::ALL.into_iter().find(|one| one.name() == dtype);
    let dtype = dtype.ok_or_else(|| format!("its {DTYPE} has to be one of {}, all little-endian", dtypes.join(" ")))?;
    let shape: Option<Vec<usize>> = said.get(SHAPE).and_then(|shape| serde_json::from_value(shape.clone()).ok());
    let shape = shape.filter(|shape| shape.split_first().is_some_and(|(_, rest)| rest == each)).ok_or_else(|| {
        let each: String = each.iter().map(|count| format!(", {count}")).collect();
        format!("its {SHAPE} has to be [N{each}]")
    })?;
    let text = said.get(BASE64).and_then(Value::as_str).unwrap_or_default();
    let bytes = STANDARD.decode(text).map_err(|error| format!("its {BASE64} is none: {error}"))?;
    let wanted = shape.iter().try_fold(dtype.size(), |size, count| size.checked_mul(*count));
    if wanted != Some(bytes.len()) {
        let right = wanted.map_or_else(|| "more than there can be".to_owned(), |size| size.to_string());
        return Err(format!(
            "its {BASE64} has {} bytes; of {} in {shape:?} there have to be {right}",
            bytes.len(),
            dtype.name()
        ));
    }
    if let Some(odd) = said.keys().find(|key| ![DTYPE, SHAPE, BASE64].contains(&key.as_str())) {
        return Err(format!("{odd} says nothing beside {BASE64}"));
    }
    let mut all: Vec<Value> = bytes.chunks_exact(dtype.size()).map(|bytes| dtype.get(bytes)).collect();
    for count in each.iter().rev() {
        all = all.chunks(*count).map(|row| row.to_vec().into()).collect();
    }
    Ok(all.into())
}

/// What is done with a value of a kind that stands there.
type Change<'a> = &'a dyn Fn(&Kind, Value, &str) -> Result<Value, String>;

/// A value in which whatever lies in it is changed.
fn within(kind: &Kind, value: Value, change: Change<'_>, way: &str) -> Result<Value, String> {
    let joined = |name: &str| if way.is_empty() { name.to_owned() } else { format!("{way}.{name}") };
    let fields = |fields: &[Field], mut object: Map<String, Value>| {
        for Field { name, kind, .. } in fields {
            if let Some(value) = object.get_mut(name) {
                *value = change(kind, value.take(), &joined(name))?;
            }
        }
        Ok(Value::Object(object))
    };
    match (kind, value) {
        (Kind::Unnamed(one), value) => change(&one.kind, value, way),
        (Kind::Option(inner), value) if !value.is_null() => change(inner, value, way),
        (Kind::Array { of, .. }, Value::Array(all)) => all.into_iter().map(|one| change(of, one, way)).collect(),
        (Kind::Tuple(kinds), Value::Array(all)) if kinds.len() == all.len() => {
            kinds.iter().zip(all).map(|(kind, one)| change(kind, one, way)).collect()
        }
        (Kind::Struct(one), Value::Object(object)) => fields(&one.fields, object),
        (Kind::Enum(one), Value::Object(mut object)) => {
            for variant in &one.variants {
                let Some(value) = object.get_mut(&variant.name) else { continue };
                let way = joined(&variant.name);
                *value = match (&variant.content, value.take()) {
                    (Content::One(inner), value) => change(inner, value, &way)?,
                    (Content::Tuple(kinds), Value::Array(all)) if kinds.len() == all.len() => {
                        kinds.iter().zip(all).map(|(kind, one)| change(kind, one, &way)).collect::<Result<_, _>>()?
                    }
                    (Content::Fields(inner), Value::Object(object)) => fields(inner, object)?,
                    (_, value) => value,
                };
            }
            Ok(object.into())
        }
        (_, value) => Ok(value),
    }
}

#[cfg(test)]
mod tests {
    use elk_bus::{Description, Payload};

    use super::*;

    /// Two kinds of things.
    #[elk_bus::payload]
    #[derive(Debug, Clone, PartialEq)]
    pub enum Found {
        /// Nothing.
        Nothing,
        /// Places.
        Places {
            /// Where (m).
            at: Vec<[f32; 3]>,
        },
    }

    /// A scan.
    #[elk_bus::payload]
    #[derive(Debug, Clone, PartialEq)]
    pub struct Scan {
        /// Ranges (m).
        pub ranges: Vec<f64>,
        /// Brightness.
        pub grey: Vec<u8>,
        /// Steps.
        pub steps: Vec<[[i16; 2]; 2]>,
        /// Words.
        pub words: Vec<String>,
        /// What of it is few.
        pub origin: [f64; 3],
        /// What else.
        pub found: Vec<Found>,
    }

    fn kind() -> Kind {
        Description::of(&Scan::SHAPE).kind().clone()
    }

    fn example() -> Value {
        json!({
            "ranges": [1.5, "NaN", "-inf", 0.1], "grey": [0, 255], "steps": [[[1, -2], [300, -32768]]], "words": ["a"],
            "origin": [1.0, 2.0, 3.0], "found": ["Nothing", {"Places": {"at": [[0.5, 1.5, -2.5], [0.0, 0.0, 1.0]]}}],
        })
    }

    #[test]
    fn lists_of_numbers_are_packed_and_nothing_else() {
        let said = packed(&kind(), example());
        assert_eq!(said["grey"], json!({"dtype": "|u1", "shape": [2], "base64": "AP8="}));
        assert_eq!(said["ranges"]["dtype"], "<f8");
        assert_eq!(said["ranges"]["shape"], json!([4]));
        assert_eq!(said["steps"]["dtype"], "<i2");
        assert_eq!(said["steps"], json!({"dtype": "<i2", "shape": [1, 2, 2], "base64": "AQD+/ywBAIA="}));
        assert_eq!((&said["words"], &said["origin"]), (&json!(["a"]), &json!([1.0, 2.0, 3.0])));
        assert_eq!(said["found"][0], "Nothing");
        assert_eq!(said["found"][1]["Places"]["at"]["shape"], json!([2, 3]));
        assert!(is_packed(&said) && !is_packed(&example()));
        assert_eq!(unpacked(&kind(), said).unwrap(), example(), "and back");
    }

    #[test]
    fn what_is_no_such_list_is_told_what_would_be_right() {
        let wrong = |part: &str, value: Value| {
            let mut said = example();
            said[part] = value;
            unpacked(&kind(), said).unwrap_err()
        };
        let list = |dtype: &str, shape: Value, base64: &str| json!({"dtype": dtype, "shape": shape, "base64": base64});
        for (part, value, reason) in [
            ("ranges", list(">f8", json!([0]), ""), "ranges: its dtype has to be one of |u1 <u2"),
            ("ranges", list("<f8", json!([1, 1]), ""), "ranges: its shape has to be [N]"),
            ("steps", list("<i2", json!([4]), ""), "steps: its shape has to be [N, 2, 2]"),
            ("grey", list("|u1", json!([3]), "AP8="), "grey: its base64 has 2 bytes; of |u1 in [3] there have to be 3"),
            ("grey", list("|u1", json!([3]), "!"), "grey: its base64 is none"),
            ("grey", list("|u1", json!([usize::MAX]), "AP8="), "grey: its base64 has 2 bytes"),
            ("words", list("|u1", json!([0]), ""), "words is a list of other things than numbers"),
        ] {
            let error = wrong(part, value);
            assert!(error.starts_with(reason), "{error}");
        }
    }
}
