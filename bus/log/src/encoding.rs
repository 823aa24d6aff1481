//! How a message lies in the log.
//!
//! | value  | message encoding | schema                                | bytes of a message                                 |
//! |--------|------------------|---------------------------------------|----------------------------------------------------|
//! | double | `json`           | `elk.Double`, `jsonschema`            | `{"value":1.5,"time":…,"received":…,"sequence":…}` |
//! | text   | `json`           | `elk.Text`, `jsonschema`              | `{"value":"…","time":…,"received":…,"sequence":…}` |
//! | binary | `elk`            | the type's name, `elk`, layout hash   | envelope, then the value in the bus' own encoding  |
//!
//! MCAP's own times are whole nanoseconds and its sequence has 32 bits: too coarse to give back what was sent, so each
//! message carries its time, its time of recording and its number once more. The envelope of a binary value, little
//! endian: time (f64), received (f64), sequence (u64), length of the source's auxiliary name (u32), that name (UTF-8).

use std::borrow::Cow;

use elk_bus::{Value, ValueRef};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::record::RecordRef;

/// Message encoding of numbers and texts.
pub(crate) const JSON: &str = "json";
/// Message encoding, and schema encoding, of binary values.
pub(crate) const ELK: &str = "elk";
/// Schema encoding of numbers and texts.
pub(crate) const JSON_SCHEMA: &str = "jsonschema";
/// Schema name of numbers.
pub(crate) const DOUBLE: &str = "elk.Double";
/// Schema name of texts.
pub(crate) const TEXT: &str = "elk.Text";

/// What a message carries beside its value and what its channel says.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Envelope {
    pub time: f64,
    pub received: f64,
    pub sequence: u64,
    pub source_aux: String,
}

/// The JSON schema of messages whose value is of the JSON type `value`.
pub(crate) fn json_schema(value: &str, note: &str) -> String {
    format!(
        r#"{{"type":"object","properties":{{"value":{{"type":"{value}","description":"{note}"}},"time":{{"type":"number","description":"published, s"}},"received":{{"type":"number","description":"recorded, s"}},"sequence":{{"type":"integer"}},"aux":{{"type":"string","description":"auxiliary source"}}}},"required":["value","time","received","sequence"]}}"#
    )
}

/// A number that comes back bit for bit: JSON has none that are not finite, so these travel as 16 hexadecimal digits.
struct Exact(f64);

impl Serialize for Exact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0.is_finite() {
            true => serializer.serialize_f64(self.0),
            false => serializer.collect_str(&format_args!("{:016x}", self.0.to_bits())),
        }
    }
}

impl<'de> Deserialize<'de> for Exact {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Either<'a> {
            Finite(f64),
            Bits(#[serde(borrow)] Cow<'a, str>),
        }
        match Either::deserialize(deserializer)? {
            Either::Finite(number) => Ok(Exact(number)),
            Either::Bits(digits) => {
                u64::from_str_radix(&digits, 16).map(|bits| Exact(f64::from_bits(bits))).map_err(D::Error::custom)
            }
        }
    }
}

#[derive(Serialize, Deserialize)]
struct Body<'a, V> {
    value: V,
    time: Exact,
    received: Exact,
    sequence: u64,
    #[serde(borrow, default, skip_serializing_if = "str::is_empty")]
    aux: Cow<'a, str>,
}

impl<V> Body<'_, V> {
    fn split(self) -> (V, Envelope) {
        let envelope = Envelope {
            time: self.time.0,
            received: self.received.0,
            sequence: self.sequence,
            source_aux: self.aux.into_owned(),
        };
        (self.value, envelope)
    }
}

/// Appends the message's bytes to `buffer`.
pub(crate) fn encode(record: &RecordRef<'_>, buffer: &mut Vec<u8>) -> Result<(), String> {
    match record.value {
        ValueRef::Double(number) => encode_json(Exact(number), record, buffer),
        ValueRef::Text(text) => encode_json(text, record, buffer),
        ValueRef::Binary { bytes, .. } => encode_binary(bytes, record, buffer),
    }
}

fn encode_json(value: impl Serialize, record: &RecordRef<'_>, buffer: &mut Vec<u8>) -> Result<(), String> {
    let body = Body {
        value,
        time: Exact(record.time),
        received: Exact(record.received),
        sequence: record.sequence,
        aux: Cow::Borrowed(record.source_aux),
    };
    serde_json::to_writer(buffer, &body).map_err(|error| error.to_string())
}

fn encode_binary(bytes: &[u8], record: &RecordRef<'_>, buffer: &mut Vec<u8>) -> Result<(), String> {
    let aux = record.source_aux.as_bytes();
    let aux_len = u32::try_from(aux.len()).map_err(|_| format!("an auxiliary source of {} bytes", aux.len()))?;
    buffer.extend_from_slice(&record.time.to_le_bytes());
    buffer.extend_from_slice(&record.received.to_le_bytes());
    buffer.extend_from_slice(&record.sequence.to_le_bytes());
    buffer.extend_from_slice(&aux_len.to_le_bytes());
    buffer.extend_from_slice(aux);
    buffer.extend_from_slice(bytes);
    Ok(())
}

/// Reads a message of a channel with the schema [`DOUBLE`].
pub(crate) fn decode_double(bytes: &[u8]) -> Result<(Value, Envelope), String> {
    let body: Body<'_, Exact> = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
    let (value, envelope) = body.split();
    Ok((Value::Double(value.0), envelope))
}

/// Reads a message of a channel with the schema [`TEXT`].
pub(crate) fn decode_text(bytes: &[u8]) -> Result<(Value, Envelope), String> {
    let body: Body<'_, String> = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
    let (value, envelope) = body.split();
    Ok((Value::Text(value), envelope))
}

/// Reads a message of a channel with the encoding [`ELK`].
pub(crate) fn decode_binary(bytes: &[u8], type_name: &str, layout: u64) -> Result<(Value, Envelope), String> {
    let short = || format!("{} bytes are too few for the envelope", bytes.len());
    let (fixed, rest) = bytes.split_first_chunk::<28>().ok_or_else(short)?;
    let word = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| fixed[at + i]));
    let aux_len = u32::from_le_bytes(std::array::from_fn(|i| fixed[24 + i])) as usize;
    let (aux, value) = rest.split_at_checked(aux_len).ok_or_else(short)?;
    let envelope = Envelope {
        time: f64::from_bits(word(0)),
        received: f64::from_bits(word(8)),
        sequence: word(16),
        source_aux: String::from_utf8(aux.to_vec()).map_err(|error| error.to_string())?,
    };
    Ok((Value::Binary { type_name: type_name.into(), layout, bytes: value.to_vec() }, envelope))
}

/// Seconds as MCAP counts them: whole nanoseconds, none before the epoch.
pub(crate) fn nanoseconds(secs: f64) -> u64 {
    (secs * 1e9).round() as u64
}
