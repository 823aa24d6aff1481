//! How a message lies in the log.
//!
//! | value   | message encoding | schema                              | bytes of a message                                              |
//! |---------|------------------|-------------------------------------|-----------------------------------------------------------------|
//! | double  | `json`           | `elk.Double`, `jsonschema`          | `{"value":1.5,"time":…,"received":…,"sequence":…,"order":…}`   |
//! | text    | `json`           | `elk.Text`, `jsonschema`            | `{"value":"…","time":…,"received":…,"sequence":…,"order":…}`   |
//! | spatial | `protobuf`       | `foxglove.…`, `protobuf`            | what viewers show; envelope and value in an unnamed field       |
//! | fields  | `json`           | the type's name, `jsonschema`       | `{"elk":"2a00…","time":…,…,"value":{"revision":42,…}}`          |
//! | other   | `protobuf`       | `elk.Binary`, `protobuf`            | the value in the bus' own encoding; envelope in an unnamed field |
//!
//! MCAP's own times are whole nanoseconds and its sequence has 32 bits: too coarse to give back what was sent, so each
//! message carries its time, its time of recording, its publisher's number and its position in the broker's order once
//! more. The envelope of a binary value, little endian: time (f64), received (f64), sequence (u64), order (u64), length
//! of the source's auxiliary name (u32), that name (UTF-8). Which values are spatial, and how these are stored, the
//! module `spatial` says. The values of other types that describe themselves have their fields there to be plotted, unless
//! they are bulky (see [`LONGEST_SHOWN`]), and `elk` holds the value's bytes in hexadecimal digits. A variable whose values
//! are of both kinds has a channel for each. Epoch, source, community, and a binary value's
//! type, layout and description stand in the channel's metadata. Before viewers were tried, other values had an encoding of their own,
//! `elk`: envelope, then value. Such logs are read.

use std::borrow::Cow;

use elk_bus::{Description, Type, TypeRef, ValueRef};

use crate::foxglove::{self, MessageType};
use crate::record::RecordRef;
use crate::schema;
use crate::spatial::{self, Shape};

/// The version of what this page says; a log of a later one is not read.
pub(crate) const FORMAT: u32 = 1;

/// Message encoding of numbers and texts.
pub(crate) const JSON: &str = "json";
/// Message encoding of binary values in older logs.
pub(crate) const ELK: &str = "elk";
/// Message encoding, and schema encoding, of binary values that are not [`JSON`].
pub(crate) const PROTOBUF: &str = "protobuf";
/// Schema encoding of numbers and texts.
pub(crate) const JSON_SCHEMA: &str = "jsonschema";
/// Schema name of numbers.
pub(crate) const DOUBLE: &str = "elk.Double";
/// Schema name of texts.
pub(crate) const TEXT: &str = "elk.Text";
/// Schema name, and topic, of the logger's own losses.
pub(crate) const DROPPED: &str = "elk.Dropped";

/// Length of an envelope without the auxiliary name.
const ENVELOPE_BYTES: usize = 36;

/// A message as it was sent, where it lies or in [`Scratch`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Decoded<'a> {
    pub value: ValueRef<'a>,
    pub envelope: Envelope<'a>,
}

/// What a message carries beside its value and what its channel says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Envelope<'a> {
    pub time: f64,
    pub received: f64,
    pub sequence: u64,
    pub order: u64,
    pub source_aux: &'a str,
}

/// Room for what does not lie in one piece in the log; kept from message to message.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    value: Vec<u8>,
    pub text: String,
    source_aux: String,
}

/// The message that tells of losses.
pub(crate) fn dropped(total: u64, received: f64) -> String {
    format!(r#"{{"dropped":{total},"received":{received}}}"#)
}

/// The number of messages that a message of [`dropped`] tells of.
pub(crate) fn decode_dropped(bytes: &[u8]) -> Result<u64, String> {
    let mut json = Json(bytes);
    json.expect(b"{\"dropped\":")?;
    json.integer()
}

/// What a channel for a value is announced with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Announcement {
    /// What its messages are, for people.
    pub schema_name: String,
    /// How the schema is written.
    pub schema_encoding: &'static str,
    /// What viewers have to know to read its messages.
    pub schema: Vec<u8>,
    /// How its messages are written.
    pub message_encoding: &'static str,
}

impl Announcement {
    /// The announcement of a channel for `value` and its like.
    pub fn of(value: &ValueRef<'_>) -> Self {
        match *value {
            ValueRef::Double(_) => Self::json(DOUBLE, schema::double()),
            ValueRef::Text(_) => Self::json(TEXT, schema::text()),
            ValueRef::Binary { type_, bytes } => match Form::of(type_, bytes) {
                Form::Drawn(shape) => Self::protobuf(shape.message_type()),
                Form::Fields(description) => Self::json(type_.name(), schema::described(&description)),
                Form::Bytes => Self::protobuf(&foxglove::BINARY),
            },
        }
    }

    /// The name of the schema of that channel; values with the same one and of the same type have the same channel.
    pub fn schema_name(value: &ValueRef<'_>) -> Cow<'static, str> {
        match *value {
            ValueRef::Double(_) => DOUBLE.into(),
            ValueRef::Text(_) => TEXT.into(),
            ValueRef::Binary { type_, bytes } => match Form::of(type_, bytes) {
                Form::Drawn(shape) => shape.message_type().full_name().into(),
                Form::Fields(_) => type_.name().to_owned().into(),
                Form::Bytes => foxglove::BINARY.full_name().into(),
            },
        }
    }

    fn json(name: &str, schema: String) -> Self {
        let (schema_name, schema) = (name.into(), schema.into_bytes());
        Self { schema_name, schema_encoding: JSON_SCHEMA, schema, message_encoding: JSON }
    }

    fn protobuf(message_type: &MessageType) -> Self {
        let (schema_name, schema) = (message_type.full_name(), message_type.descriptor_set());
        Self { schema_name, schema_encoding: PROTOBUF, schema, message_encoding: PROTOBUF }
    }
}

/// How the messages of a channel are stored.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind {
    Double,
    Text,
    /// As a protobuf message that carries it.
    Protobuf(Type),
    /// As JSON with its fields.
    Described(Type),
    /// As [`ELK`].
    Binary(Type),
}

impl Kind {
    /// How a channel's messages are stored, by what the channel and its schema say; none: it is not of elk.
    pub fn announced(message_encoding: &str, schema: &str, type_: Option<Type>) -> Option<Self> {
        match (message_encoding, schema) {
            (JSON, DOUBLE) => Some(Kind::Double),
            (JSON, TEXT) => Some(Kind::Text),
            (PROTOBUF, _) => type_.map(Kind::Protobuf),
            (JSON, _) => type_.map(Kind::Described),
            (ELK, _) => type_.map(Kind::Binary),
            _ => None,
        }
    }

    /// The type of its values, if they are of one.
    pub fn type_(&self) -> Option<&Type> {
        match self {
            Kind::Double | Kind::Text => None,
            Kind::Protobuf(type_) | Kind::Described(type_) | Kind::Binary(type_) => Some(type_),
        }
    }

    /// The value and the envelope of a message of the channel.
    pub fn decode<'a>(&'a self, bytes: &'a [u8], scratch: &'a mut Scratch) -> Result<Decoded<'a>, String> {
        match self {
            Kind::Double => decode_double(bytes, scratch),
            Kind::Text => decode_text(bytes, scratch),
            Kind::Protobuf(type_) => decode_protobuf(bytes, type_.as_ref(), scratch),
            Kind::Described(type_) => decode_described(bytes, type_.as_ref(), scratch),
            Kind::Binary(type_) => decode_binary(bytes, type_.as_ref()),
        }
    }
}

/// Appends the message's bytes to `buffer`.
pub(crate) fn encode(record: &RecordRef<'_>, buffer: &mut Vec<u8>) -> Result<(), String> {
    match record.value {
        ValueRef::Double(number) => encode_json(buffer, record, |buffer| put_number(buffer, number)),
        ValueRef::Text(text) => encode_json(buffer, record, |buffer| put_text(buffer, text)),
        ValueRef::Binary { type_, bytes } => {
            let form = Form::of(type_, bytes);
            if let Form::Fields(description) = &form {
                return encode_described(buffer, record, description, bytes);
            }
            let mut envelope = [0; ENVELOPE_BYTES + 64];
            let mut long = Vec::new();
            let envelope = put_envelope(record, &mut envelope, &mut long)?;
            match form {
                Form::Drawn(shape) => spatial::put((shape, type_), nanoseconds(record.time), envelope, bytes, buffer),
                Form::Fields(_) | Form::Bytes => spatial::put_other(envelope, bytes, buffer),
            }
            Ok(())
        }
    }
}

/// As what the values of a type are stored.
enum Form<'a> {
    /// As what viewers draw.
    Drawn(Shape),
    /// With their fields: those of types that are not bulky, and short.
    Fields(Cow<'a, Description>),
    /// As they are.
    Bytes,
}

impl<'a> Form<'a> {
    fn of(type_: TypeRef<'a>, value: &[u8]) -> Self {
        if let Some(shape) = Shape::of(type_) {
            return Self::Drawn(shape);
        }
        let shown = if value.len() <= LONGEST_SHOWN { type_.description() } else { None };
        shown.filter(|description| !description.is_bulky()).map_or(Self::Bytes, Self::Fields)
    }
}

/// Whether a value that is not drawn is stored with its fields.
pub(crate) fn has_fields(type_: TypeRef<'_>, value: &[u8]) -> bool {
    matches!(Form::of(type_, value), Form::Fields(_))
}

/// Values are stored with their fields up to this length (bytes). A longer one is an image or its like: nobody looks at its
/// numbers one by one, and as JSON it would take many times the room.
const LONGEST_SHOWN: usize = 256 << 10;

fn encode_described(
    buffer: &mut Vec<u8>,
    record: &RecordRef<'_>,
    description: &Description,
    bytes: &[u8],
) -> Result<(), String> {
    const DIGITS: &[u8; 16] = b"0123456789abcdef";
    buffer.extend_from_slice(b"{\"elk\":\"");
    let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 15]).map(|digit| DIGITS[usize::from(digit)]);
    buffer.extend(digits);
    buffer.push(b'"');
    put_envelope_fields(buffer, record)?;
    buffer.extend_from_slice(b",\"value\":");
    // What is not what its type says has nothing to show, and is stored all the same.
    let mut fields = description.to_finite_json(bytes, usize::MAX).unwrap_or_else(|_| serde_json::json!({}));
    schema::leave_out_nulls(&mut fields);
    serde_json::to_writer(&mut *buffer, &fields).map_err(|error| error.to_string())?;
    buffer.push(b'}');
    Ok(())
}

fn encode_json(
    buffer: &mut Vec<u8>,
    record: &RecordRef<'_>,
    put_value: impl FnOnce(&mut Vec<u8>) -> Result<(), String>,
) -> Result<(), String> {
    buffer.extend_from_slice(b"{\"value\":");
    put_value(buffer)?;
    put_envelope_fields(buffer, record)?;
    buffer.push(b'}');
    Ok(())
}

fn put_envelope_fields(buffer: &mut Vec<u8>, record: &RecordRef<'_>) -> Result<(), String> {
    buffer.extend_from_slice(b",\"time\":");
    put_number(buffer, record.time)?;
    buffer.extend_from_slice(b",\"received\":");
    put_number(buffer, record.received)?;
    buffer.extend_from_slice(b",\"sequence\":");
    put_integer(buffer, record.sequence);
    buffer.extend_from_slice(b",\"order\":");
    put_integer(buffer, record.order);
    if !record.source_aux.is_empty() {
        buffer.extend_from_slice(b",\"aux\":");
        put_text(buffer, record.source_aux)?;
    }
    Ok(())
}

/// A number that comes back bit for bit: JSON has none that are not finite, so these travel as 16 hexadecimal digits.
fn put_number(buffer: &mut Vec<u8>, number: f64) -> Result<(), String> {
    match number.is_finite() {
        true => serde_json::to_writer(buffer, &number).map_err(|error| error.to_string()),
        false => {
            buffer.extend_from_slice(format!("\"{:016x}\"", number.to_bits()).as_bytes());
            Ok(())
        }
    }
}

fn put_text(buffer: &mut Vec<u8>, text: &str) -> Result<(), String> {
    serde_json::to_writer(buffer, text).map_err(|error| error.to_string())
}

fn put_integer(buffer: &mut Vec<u8>, mut number: u64) {
    let mut digits = [0; 20];
    let mut at = digits.len();
    loop {
        at -= 1;
        digits[at] = b'0' + (number % 10) as u8;
        number /= 10;
        if number == 0 {
            return buffer.extend_from_slice(&digits[at..]);
        }
    }
}

/// The envelope, in `short` if it fits, else in `long`.
fn put_envelope<'a>(
    record: &RecordRef<'_>,
    short: &'a mut [u8; ENVELOPE_BYTES + 64],
    long: &'a mut Vec<u8>,
) -> Result<&'a [u8], String> {
    let aux = record.source_aux.as_bytes();
    let aux_len = u32::try_from(aux.len()).map_err(|_| format!("an auxiliary source of {} bytes", aux.len()))?;
    let words = [record.time.to_bits(), record.received.to_bits(), record.sequence, record.order];
    for (slot, word) in short.chunks_exact_mut(8).zip(words) {
        slot.copy_from_slice(&word.to_le_bytes());
    }
    short[32..ENVELOPE_BYTES].copy_from_slice(&aux_len.to_le_bytes());
    match short[ENVELOPE_BYTES..].get_mut(..aux.len()) {
        Some(slot) => {
            slot.copy_from_slice(aux);
            Ok(&short[..ENVELOPE_BYTES + aux.len()])
        }
        None => {
            long.extend_from_slice(&short[..ENVELOPE_BYTES]);
            long.extend_from_slice(aux);
            Ok(long)
        }
    }
}

/// Reads a message of a channel with the schema [`DOUBLE`].
fn decode_double<'a>(bytes: &'a [u8], scratch: &'a mut Scratch) -> Result<Decoded<'a>, String> {
    let mut json = Json(bytes);
    json.expect(b"{\"value\":")?;
    let value = ValueRef::Double(json.number()?);
    let envelope = json.envelope(&mut scratch.source_aux)?;
    json.expect(b"}")?;
    Ok(Decoded { value, envelope })
}

/// Reads a message of a channel with the schema [`TEXT`].
fn decode_text<'a>(bytes: &'a [u8], scratch: &'a mut Scratch) -> Result<Decoded<'a>, String> {
    let mut json = Json(bytes);
    json.expect(b"{\"value\":")?;
    let value = ValueRef::Text(json.text(&mut scratch.text)?);
    let envelope = json.envelope(&mut scratch.source_aux)?;
    json.expect(b"}")?;
    Ok(Decoded { value, envelope })
}

/// Reads a message of a channel with the encoding [`ELK`].
fn decode_binary<'a>(bytes: &'a [u8], type_: TypeRef<'a>) -> Result<Decoded<'a>, String> {
    let (envelope, bytes) = split_envelope(bytes)?;
    Ok(Decoded { value: ValueRef::Binary { type_, bytes }, envelope })
}

/// Reads a message of a channel with the encoding [`PROTOBUF`].
fn decode_protobuf<'a>(bytes: &'a [u8], type_: TypeRef<'a>, scratch: &'a mut Scratch) -> Result<Decoded<'a>, String> {
    let (head, tail) = spatial::original(bytes).ok_or("it does not carry the value that was sent")?;
    let (envelope, head) = split_envelope(head)?;
    let bytes = match (head, tail) {
        (whole, []) | ([], whole) => whole,
        _ => {
            scratch.value.clear();
            scratch.value.extend_from_slice(head);
            scratch.value.extend_from_slice(tail);
            &scratch.value
        }
    };
    Ok(Decoded { value: ValueRef::Binary { type_, bytes }, envelope })
}

/// Reads a message of a channel with values that are stored with their fields.
fn decode_described<'a>(bytes: &'a [u8], type_: TypeRef<'a>, scratch: &'a mut Scratch) -> Result<Decoded<'a>, String> {
    let mut json = Json(bytes);
    json.expect(b"{\"elk\":")?;
    json.bytes(&mut scratch.value)?;
    let envelope = json.envelope(&mut scratch.source_aux)?;
    json.expect(b",\"value\":")?;
    Ok(Decoded { value: ValueRef::Binary { type_, bytes: &scratch.value }, envelope })
}

fn split_envelope(bytes: &[u8]) -> Result<(Envelope<'_>, &[u8]), String> {
    let short = || format!("{} bytes are too few for the envelope", bytes.len());
    let (fixed, rest) = bytes.split_first_chunk::<ENVELOPE_BYTES>().ok_or_else(short)?;
    let word = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| fixed[at + i]));
    let aux_len = u32::from_le_bytes(std::array::from_fn(|i| fixed[32 + i])) as usize;
    let (aux, value) = rest.split_at_checked(aux_len).ok_or_else(short)?;
    let envelope = Envelope {
        time: f64::from_bits(word(0)),
        received: f64::from_bits(word(8)),
        sequence: word(16),
        order: word(24),
        source_aux: std::str::from_utf8(aux).map_err(|error| error.to_string())?,
    };
    Ok((envelope, value))
}

/// The rest of a message in JSON, in the only form in which it is written.
struct Json<'a>(&'a [u8]);

impl<'a> Json<'a> {
    fn expect(&mut self, words: &[u8]) -> Result<(), String> {
        let wanted = || format!("{:?} is missing", String::from_utf8_lossy(words));
        self.0 = self.0.strip_prefix(words).ok_or_else(wanted)?;
        Ok(())
    }

    /// Everything up to the next comma or brace.
    fn token(&mut self) -> Result<&'a str, String> {
        let end = self.0.iter().position(|byte| matches!(byte, b',' | b'}')).ok_or("it ends too early")?;
        let (token, rest) = self.0.split_at(end);
        self.0 = rest;
        std::str::from_utf8(token).map_err(|error| error.to_string())
    }

    fn number(&mut self) -> Result<f64, String> {
        let token = self.token()?;
        let number = match token.strip_prefix('"').and_then(|digits| digits.strip_suffix('"')) {
            None => token.parse().ok(),
            Some(digits) => u64::from_str_radix(digits, 16).ok().map(f64::from_bits),
        };
        number.ok_or_else(|| format!("{token:?} is no number"))
    }

    fn integer(&mut self) -> Result<u64, String> {
        let token = self.token()?;
        token.parse().map_err(|_| format!("{token:?} is no whole number"))
    }

    /// Bytes as a text of hexadecimal digits, into `bytes`.
    fn bytes(&mut self, bytes: &mut Vec<u8>) -> Result<(), String> {
        let wrong = |_| "a value is not given in hexadecimal digits".to_owned();
        let token = self.token()?;
        let digits = token.strip_prefix('"').and_then(|digits| digits.strip_suffix('"')).unwrap_or("?");
        bytes.clear();
        for two in digits.as_bytes().chunks(2) {
            let two = std::str::from_utf8(two).unwrap_or("?");
            bytes.push(u8::from_str_radix(two, 16).map_err(wrong)?);
        }
        Ok(())
    }

    /// A text where it lies, or in `scratch` if anything in it is escaped.
    fn text<'b>(&mut self, scratch: &'b mut String) -> Result<&'b str, String>
    where
        'a: 'b,
    {
        let inner = self.0.strip_prefix(b"\"").ok_or("a text does not begin with a quote")?;
        let mut end = 0;
        let mut escaped = false;
        loop {
            match inner.get(end) {
                Some(b'"') => break,
                Some(b'\\') => (end, escaped) = (end + 2, true),
                Some(_) => end += 1,
                None => return Err("a text does not end".into()),
            }
        }
        let quoted = &self.0[..end + 2];
        self.0 = &inner[end + 1..];
        if escaped {
            *scratch = serde_json::from_slice(quoted).map_err(|error| error.to_string())?;
            return Ok(scratch);
        }
        std::str::from_utf8(&inner[..end]).map_err(|error| error.to_string())
    }

    fn envelope<'b>(&mut self, scratch: &'b mut String) -> Result<Envelope<'b>, String>
    where
        'a: 'b,
    {
        self.expect(b",\"time\":")?;
        let time = self.number()?;
        self.expect(b",\"received\":")?;
        let received = self.number()?;
        self.expect(b",\"sequence\":")?;
        let sequence = self.integer()?;
        self.expect(b",\"order\":")?;
        let order = self.integer()?;
        let source_aux = match self.expect(b",\"aux\":") {
            Ok(()) => self.text(scratch)?,
            Err(_) => "",
        };
        Ok(Envelope { time, received, sequence, order, source_aux })
    }
}

/// Seconds as MCAP counts them: whole nanoseconds, none before the epoch.
pub fn nanoseconds(secs: f64) -> u64 {
    (secs * 1e9).round() as u64
}

/// MCAP's nanoseconds in seconds.
pub(crate) fn seconds(nanoseconds: u64) -> f64 {
    nanoseconds as f64 / 1e9
}
