//! Channels of other tools: what they say is kept byte by byte, and understood where it can be.
//!
//! A number or a text is one in JSON, or in one of ROS' standard messages (`std_msgs`), which hold nothing else. What is
//! other JSON, `{"speed": 3}` too, is given as the text that it is, and everything else as bytes of a type that carries the
//! schema's name.
//!
//! JSON may be a trap: of any length, and as deep as it is long. It is read without a tree being built of it, so that
//! memory is at most the one text that it holds.

use std::collections::BTreeMap;
use std::sync::Arc;

use elk_bus::{TypeRef, ValueRef};

use crate::encoding::JSON;
use crate::plain::{PlainJson, plain, without_nan};

/// What the messages of a channel are made of, as a file says it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Schema {
    pub name: String,
    pub encoding: String,
    pub data: Vec<u8>,
}

/// How another tool's channel announces itself.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Foreign {
    /// Nothing: it has none.
    pub schema: Option<Arc<Schema>>,
    pub message_encoding: String,
    pub metadata: BTreeMap<String, String>,
    reading: Reading,
}

/// How its messages are understood.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Reading {
    Json,
    /// A number or a text of ROS, packed as CDR.
    Cdr(Plain),
    /// One as ROS 1 packs it: little endian, with nothing before it.
    Ros1(Plain),
    Bytes,
}

/// What one of ROS' standard messages holds.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Plain {
    Text,
    Float { bytes: usize },
    Integer { bytes: usize, signed: bool },
}

impl Plain {
    /// What the message of this name holds, if it is one number or text.
    fn named(schema: &str) -> Option<Self> {
        let name = schema.strip_prefix("std_msgs/msg/").or_else(|| schema.strip_prefix("std_msgs/"))?;
        let integer =
            |signed, bits: &str| bits.parse::<usize>().ok().map(|bits| Self::Integer { bytes: bits / 8, signed });
        match name {
            "String" => Some(Self::Text),
            "Float32" => Some(Self::Float { bytes: 4 }),
            "Float64" => Some(Self::Float { bytes: 8 }),
            "Bool" | "Byte" => Some(Self::Integer { bytes: 1, signed: false }),
            "Int8" | "Int16" | "Int32" | "Int64" => integer(true, &name[3..]),
            "UInt8" | "UInt16" | "UInt32" | "UInt64" => integer(false, &name[4..]),
            _ => None,
        }
    }

    /// What stands in `bytes`.
    fn read(self, bytes: &[u8], order: Order) -> Option<ValueRef<'_>> {
        let number = |count: usize| Some(order.number(bytes.get(..count)?));
        Some(match self {
            Self::Text => {
                let length = number(4)? as usize;
                let text = bytes.get(4..)?.get(..length)?;
                ValueRef::Text(std::str::from_utf8(text.strip_suffix(&[0]).unwrap_or(text)).ok()?)
            }
            Self::Float { bytes: 4 } => ValueRef::Double(f64::from(f32::from_bits(number(4)? as u32))),
            Self::Float { bytes } => ValueRef::Double(f64::from_bits(number(bytes)?)),
            Self::Integer { bytes, signed: false } => ValueRef::Double(number(bytes)? as f64),
            Self::Integer { bytes, signed: true } => {
                let unused = 64 - 8 * bytes as u32;
                ValueRef::Double(((number(bytes)? << unused).cast_signed() >> unused) as f64)
            }
        })
    }
}

/// Which byte of a number comes first.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Order {
    Big,
    Little,
}

impl Order {
    /// The order in which a message of CDR is packed, and what lies behind the four bytes that say so (OMG DDS-XTypes
    /// 1.3, table 60); nothing: it is packed otherwise, as a list of parameters or with a length before it.
    fn of_cdr(message: &[u8]) -> Option<(Self, &[u8])> {
        let (&[0, packing, ..], packed) = message.split_first_chunk::<4>()? else {
            return None;
        };
        let order = if packing & 1 == 1 { Self::Little } else { Self::Big };
        matches!(packing, 0 | 1 | 6 | 7).then_some((order, packed)) // CDR, and CDR 2 of what has a fixed end
    }

    fn number(self, bytes: &[u8]) -> u64 {
        let add = |all: u64, byte: &u8| all << 8 | u64::from(*byte);
        match self {
            Self::Big => bytes.iter().fold(0, add),
            Self::Little => bytes.iter().rev().fold(0, add),
        }
    }
}

impl Foreign {
    /// What a channel announces.
    pub fn announced(
        schema: Option<Arc<Schema>>,
        message_encoding: String,
        metadata: BTreeMap<String, String>,
    ) -> Self {
        let name = schema.as_ref().map_or("", |schema| schema.name.as_str());
        let reading = match (message_encoding.as_str(), Plain::named(name)) {
            (JSON, _) => Reading::Json,
            ("cdr", Some(plain)) => Reading::Cdr(plain),
            ("ros1", Some(plain)) => Reading::Ros1(plain),
            _ => Reading::Bytes,
        };
        Self { schema, message_encoding, metadata, reading }
    }

    /// Whether its messages are numbers and texts for elk as well.
    pub fn is_understood(&self) -> bool {
        self.reading != Reading::Bytes
    }

    /// What its messages are, for people.
    pub fn type_name(&self) -> &str {
        match &self.schema {
            Some(schema) => &schema.name,
            None if self.message_encoding.is_empty() => "bytes",
            None => &self.message_encoding,
        }
    }

    /// Bytes of all that is kept of it.
    pub fn names_bytes(&self) -> usize {
        let metadata = self.metadata.iter().map(|(name, said)| name.len() + said.len());
        self.message_encoding.len() + metadata.sum::<usize>()
    }

    /// What a message says.
    pub fn value<'a>(&'a self, bytes: &'a [u8], scratch: &'a mut String) -> ValueRef<'a> {
        let read = match self.reading {
            Reading::Json => json(bytes, scratch),
            Reading::Cdr(plain) => Order::of_cdr(bytes).and_then(|(order, packed)| plain.read(packed, order)),
            Reading::Ros1(plain) => plain.read(bytes, Order::Little),
            Reading::Bytes => None,
        };
        read.unwrap_or(ValueRef::Binary { type_: TypeRef::undescribed(self.type_name(), 0), bytes })
    }
}

/// A number or a text in JSON; anything else as the text that it is, also with numbers in it that JSON does not have.
fn json<'a>(bytes: &'a [u8], scratch: &'a mut String) -> Option<ValueRef<'a>> {
    let json = std::str::from_utf8(bytes).ok()?;
    match plain(json).or_else(|error| without_nan(json).map_or(Err(error), |meant| plain(&meant))).ok()? {
        PlainJson::Number(number) => Some(ValueRef::Double(number)),
        PlainJson::Text(text) => {
            *scratch = text;
            Some(ValueRef::Text(scratch))
        }
        PlainJson::Other => Some(ValueRef::Text(json)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(encoding: &str, schema: &str, bytes: &[u8]) -> String {
        let schema = Arc::new(Schema { name: schema.into(), ..Schema::default() });
        let foreign = Foreign::announced(Some(schema), encoding.into(), BTreeMap::new());
        format!("{:?}", foreign.value(bytes, &mut String::new()))
    }

    #[test]
    fn numbers_and_texts_of_other_tools_are_numbers_and_texts() {
        for (json, value) in [
            (r#"{"value": 1.5}"#, "Double(1.5)"),
            ("7", "Double(7.0)"),
            (r#"{"data": "home"}"#, "Text(\"home\")"),
            (r#"{"value": true}"#, "Double(1.0)"),
            (r#"{"speed": 3}"#, r#"Text("{\"speed\": 3}")"#),
            (r#"{"x": NaN}"#, r#"Text("{\"x\": NaN}")"#),
            (r#"{"x": 1, "y": 2}"#, r#"Text("{\"x\": 1, \"y\": 2}")"#),
        ] {
            assert_eq!(said("json", "Any", json.as_bytes()), value);
        }
        let cdr = |bytes: &[u8]| [&[0, 1, 0, 0], bytes].concat();
        let double = 42.358_456_123_f64.to_le_bytes();
        assert_eq!(said("cdr", "std_msgs/msg/Float64", &cdr(&double)), "Double(42.358456123)");
        assert_eq!(said("cdr", "std_msgs/msg/Int16", &cdr(&(-7_i16).to_le_bytes())), "Double(-7.0)");
        assert_eq!(said("cdr", "std_msgs/msg/String", &cdr(b"\x05\0\0\0home\0")), "Text(\"home\")");
        assert_eq!(said("ros1", "std_msgs/String", b"\x04\0\0\0home"), "Text(\"home\")");
        assert!(said("cdr", "sensor_msgs/msg/Image", &cdr(&double)).contains("sensor_msgs/msg/Image"));
        assert!(said("cdr", "std_msgs/msg/Float64", b"short").starts_with("Binary"), "too short to be one");
    }

    /// Regression: what a big-endian machine recorded was read as little endian, 1.0 as 3e-319.
    #[test]
    fn numbers_of_both_orders_of_bytes_are_read_and_other_packings_are_bytes() {
        let of = |packing: u8, schema: &str, bytes: &[u8]| said("cdr", schema, &[&[0, packing, 0, 0], bytes].concat());
        for (big, little) in [(0, 1), (6, 7)] {
            let double = 42.358_456_123_f64;
            assert_eq!(of(big, "std_msgs/msg/Float64", &double.to_be_bytes()), "Double(42.358456123)");
            assert_eq!(of(little, "std_msgs/msg/Float64", &double.to_le_bytes()), "Double(42.358456123)");
            assert_eq!(of(big, "std_msgs/msg/Float32", &1.5_f32.to_be_bytes()), "Double(1.5)");
            assert_eq!(of(big, "std_msgs/msg/Int32", &(-7_i32).to_be_bytes()), "Double(-7.0)");
            assert_eq!(of(big, "std_msgs/msg/String", b"\0\0\0\x05home\0"), "Text(\"home\")");
        }
        // Lists of parameters, and what has its length before it.
        for packing in [2, 3, 8, 9, 10, 11] {
            assert!(of(packing, "std_msgs/msg/Float64", &[0; 8]).starts_with("Binary"), "{packing}");
        }
        assert!(said("cdr", "std_msgs/msg/Float64", &[1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]).starts_with("Binary"));
    }

    /// Regression: a tree was built of whatever JSON there was, for sixteen times its length; JSON that is deep was
    /// none.
    #[test]
    fn json_of_any_length_and_depth_is_the_text_that_it_is() {
        let deep = [vec![b'['; 1 << 20], vec![b']'; 1 << 20]].concat();
        let in_a_field = [&b"{\"a\":"[..], &deep, b"}"].concat();
        let long = format!("[{}0]", "0,".repeat(1 << 20)).into_bytes();
        let foreign = Foreign::announced(None, "json".into(), BTreeMap::new());
        for json in [&deep, &in_a_field, &long] {
            let mut scratch = String::new();
            assert_eq!(foreign.value(json, &mut scratch), ValueRef::Text(std::str::from_utf8(json).unwrap()));
            assert_eq!(scratch.capacity(), 0);
        }
        assert!(said("json", "Any", &deep[..1 << 20]).starts_with("Binary"), "it is not all there");
    }
}
