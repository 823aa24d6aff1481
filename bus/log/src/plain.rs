//! JSON that is a number or a text, told from all other without a tree being built of it.

use std::fmt::{Formatter, Result as Written};

use serde::Deserialize;
use serde::de::{Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// What JSON says, if it says one thing.
#[derive(Debug, PartialEq)]
pub(crate) enum PlainJson {
    /// A number; what is true or false is 1 or 0.
    Number(f64),
    /// A text.
    Text(String),
    /// Several things, or nothing.
    Other,
}

impl<'de> Deserialize<'de> for PlainJson {
    fn deserialize<D: Deserializer<'de>>(json: D) -> Result<Self, D::Error> {
        json.deserialize_any(Whole)
    }
}

/// Takes a number or a text, or an object with only one of them in it.
struct Whole;

/// Takes a number or a text.
struct Field(PlainJson);

impl<'de> Deserialize<'de> for Field {
    fn deserialize<D: Deserializer<'de>>(json: D) -> Result<Self, D::Error> {
        json.deserialize_any(OfField).map(Self)
    }
}

struct OfField;

/// What is the same in both: a number, a text, a list.
macro_rules! plain {
    () => {
        type Value = PlainJson;

        fn expecting(&self, out: &mut Formatter<'_>) -> Written {
            out.write_str("JSON")
        }

        fn visit_bool<E: Error>(self, flag: bool) -> Result<PlainJson, E> {
            Ok(PlainJson::Number(f64::from(u8::from(flag))))
        }

        fn visit_i64<E: Error>(self, number: i64) -> Result<PlainJson, E> {
            Ok(PlainJson::Number(number as f64))
        }

        fn visit_u64<E: Error>(self, number: u64) -> Result<PlainJson, E> {
            Ok(PlainJson::Number(number as f64))
        }

        fn visit_f64<E: Error>(self, number: f64) -> Result<PlainJson, E> {
            Ok(PlainJson::Number(number))
        }

        fn visit_str<E: Error>(self, text: &str) -> Result<PlainJson, E> {
            Ok(PlainJson::Text(text.into()))
        }

        fn visit_unit<E: Error>(self) -> Result<PlainJson, E> {
            Ok(PlainJson::Other)
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<PlainJson, A::Error> {
            while list.next_element::<IgnoredAny>()?.is_some() {}
            Ok(PlainJson::Other)
        }
    };
}

impl<'de> Visitor<'de> for Whole {
    plain!();

    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<PlainJson, A::Error> {
        let Some((_, Field(only))) = fields.next_entry::<IgnoredAny, Field>()? else {
            return Ok(PlainJson::Other);
        };
        let mut more = false;
        while fields.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {
            more = true;
        }
        Ok(if more { PlainJson::Other } else { only })
    }
}

impl<'de> Visitor<'de> for OfField {
    plain!();

    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<PlainJson, A::Error> {
        while fields.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
        Ok(PlainJson::Other)
    }
}
