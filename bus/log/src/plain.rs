//! JSON that is a number or a text, told from all other without a tree being built of it.
//!
//! An object whose one field is called `value` or `data` is its field: so write the bus and ROS what is a number or a text.
//! A field of any other name says something by its name, so that object is none.

use std::fmt::{Formatter, Result as Written};

use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// What the only field of an object is called whose name says nothing.
const WRAPPERS: [&str; 2] = ["value", "data"];
/// What other languages write for numbers that JSON does not have, in any case.
const NOT_FINITE: [&str; 3] = ["nan", "inf", "infinity"];

/// What JSON says, if it says one thing.
#[derive(Debug, PartialEq)]
pub(crate) enum PlainJson {
    /// A number; what is true or false is 1 or 0.
    Number(f64),
    /// A text.
    Text(String),
    /// Several things, or nothing, or one that has a name.
    Other,
}

/// Reads JSON for the one thing that it says.
///
/// # Errors
/// It is no JSON.
pub(crate) fn plain(json: &str) -> serde_json::Result<PlainJson> {
    let mut json = serde_json::Deserializer::from_str(json);
    let plain = Plain { unwraps: true }.deserialize(&mut json)?;
    json.end().map(|()| plain)
}

/// What would be JSON if JSON had NaN and infinities, which Python and others write into it: with `null` for these.
/// Nothing: it holds none.
pub(crate) fn without_nan(json: &str) -> Option<String> {
    // Nothing is copied before the first one: most messages have none.
    let (mut out, mut copied, mut at) = (String::new(), 0, 0);
    while let Some(skipped) = json[at..].find(|c: char| c == '"' || c.is_ascii_alphabetic()) {
        let from = at + skipped;
        at = from + token_length(&json[from..]);
        if NOT_FINITE.iter().any(|word| word.eq_ignore_ascii_case(&json[from..at])) {
            out.push_str(json[copied..from].trim_end_matches(['+', '-']));
            out.push_str("null");
            copied = at;
        }
    }
    (copied > 0).then(|| out + &json[copied..])
}

/// Length of the text in quotes, or of the word, that `json` begins with (bytes).
fn token_length(json: &str) -> usize {
    let Some(text) = json.strip_prefix('"') else {
        return json.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(json.len());
    };
    let mut escaped = false;
    let end = text.bytes().position(|byte| {
        let ends = byte == b'"' && !escaped;
        escaped = byte == b'\\' && !escaped;
        ends
    });
    end.map_or(json.len(), |end| end + 2)
}

/// Takes a number or a text; also an object of one field, if it `unwraps`.
struct Plain {
    unwraps: bool,
}

impl<'de> DeserializeSeed<'de> for Plain {
    type Value = PlainJson;

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<PlainJson, D::Error> {
        json.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Plain {
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

    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<PlainJson, A::Error> {
        let name = if self.unwraps { fields.next_key::<String>()? } else { None };
        let mut only = match name {
            Some(name) if WRAPPERS.contains(&name.as_str()) => fields.next_value_seed(Self { unwraps: false })?,
            Some(_) => fields.next_value::<IgnoredAny>().map(|_| PlainJson::Other)?,
            None => PlainJson::Other,
        };
        while fields.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {
            only = PlainJson::Other;
        }
        Ok(only)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_field_whose_name_says_nothing_is_unwrapped() {
        let number = |json| plain(json).unwrap();
        assert_eq!(number(r#"{"value": 3}"#), PlainJson::Number(3.0));
        assert_eq!(number(r#"{"data": "x"}"#), PlainJson::Text("x".into()));
        for other in [
            r#"{"speed": 3}"#,
            r#"{"value": 3, "unit": "m"}"#,
            r#"{"value": {"value": 3}}"#,
            "{}",
            "null",
            "[1]",
            r#"{"a": {"value": 1}}"#,
        ] {
            assert_eq!(number(other), PlainJson::Other, "{other}");
        }
        assert!(plain("{").is_err() && plain("1 2").is_err() && plain("{\"a\":NaN}").is_err());
    }

    #[test]
    fn numbers_that_json_does_not_have_are_nothing() {
        for (said, meant) in [
            (r#"{"x": NaN, "y": [-Infinity, 1e5, inf]}"#, r#"{"x": null, "y": [null, 1e5, null]}"#),
            (r#"{"NaN": "a \"NaN, -nan", "é": -nan}"#, r#"{"NaN": "a \"NaN, -nan", "é": null}"#),
            (r#"["\\", NaN]"#, r#"["\\", null]"#),
        ] {
            assert_eq!(without_nan(said).as_deref(), Some(meant));
        }
        for said in [r#"{"x": "NaN"}"#, "[true, null, 1e3]", "\"NaN", "NaNa", ""] {
            assert_eq!(without_nan(said), None, "{said}");
        }
    }
}
