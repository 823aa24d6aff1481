//! One message, as it lies in a packet.
//!
//! ```text
//! i32 length of the message, this field included (at least 54)     i32 id
//! u8 kind   u8 data
//! text source   text source aux   text community   text key        each an i32 length, then its bytes
//! f64 time   f64 number   f64 second number
//! text value
//! ```
//!
//! All numbers are little-endian, nothing is padded.

/// Length of a message without any text (bytes): none is shorter.
pub const SHORTEST: usize = 54;
/// The id of what asks the server something, and of its answers.
pub const REQUEST_ID: i32 = -2;
/// The id of a message that its publisher has not numbered, and of a latest value.
pub const NO_ID: i32 = -1;
/// What stands in a number's place that nobody gave.
pub const NO_NUMBER: f64 = -1.0;

/// What a message is for: a letter of MOOS', whether or not anybody knows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kind(pub u8);

impl Kind {
    /// Publishes, and delivers.
    pub const NOTIFY: Self = Self(b'N');
    /// Subscribes: the key is the variable, the number the least interval (s).
    pub const REGISTER: Self = Self(b'R');
    /// Takes that back.
    pub const UNREGISTER: Self = Self(b'U');
    /// Subscribes to patterns: the value is `AppPattern=..,VarPattern=..,Interval=..`.
    pub const WILDCARD_REGISTER: Self = Self(b'*');
    /// Takes that back.
    pub const WILDCARD_UNREGISTER: Self = Self(b'/');
    /// A client's first word: the value is its name.
    pub const DATA: Self = Self(b'i');
    /// The client is let in.
    pub const WELCOME: Self = Self(b'W');
    /// The client is not let in; the value says why.
    pub const POISON: Self = Self(b'K');
    /// An asynchronous client's sign of life; the server's has its clock in it.
    pub const TIMING: Self = Self(b'T');
    /// A synchronous client's empty request; the server's begins every reply to one.
    pub const NULL: Self = Self(b'.');
    /// Asks the server something: the key says what.
    pub const SERVER_REQUEST: Self = Self(b'Q');
}

/// What kind of value a message carries: a letter of MOOS'.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Data(pub u8);

impl Data {
    /// A number.
    pub const DOUBLE: Self = Self(b'D');
    /// A text.
    pub const STRING: Self = Self(b'S');
    /// Bytes.
    pub const BINARY: Self = Self(b'B');
    /// Nothing yet: a variable that nobody has written.
    pub const NOT_SET: Self = Self(b'~');
}

/// A message where it lies. Texts are bytes: MOOS says nothing of their encoding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Message<'a> {
    /// The publisher's count of its messages, from 0; or [`NO_ID`], or [`REQUEST_ID`].
    pub id: i32,
    /// What it is for.
    pub kind: Kind,
    /// What kind of value it carries.
    pub data: Data,
    /// Who published it, as that one says.
    pub source: &'a [u8],
    /// Free text of the publisher about the source.
    pub source_aux: &'a [u8],
    /// The community that it was first published in; empty: the server's own.
    pub community: &'a [u8],
    /// The variable.
    pub key: &'a [u8],
    /// The publisher's time (s, times the time warp).
    pub time: f64,
    /// The number, or [`NO_NUMBER`].
    pub number: f64,
    /// A second number, or [`NO_NUMBER`].
    pub second: f64,
    /// The text or the bytes.
    pub value: &'a [u8],
}

/// Bytes that are no message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MessageError {
    /// Shorter than any message.
    #[error("a message of {0} bytes; none is shorter than {SHORTEST}")]
    TooShort(i64),
    /// A text reaches beyond its message, or is of negative length.
    #[error("a text of {0} bytes reaches beyond its message")]
    Text(i32),
    /// Bytes are left over behind the last field.
    #[error("a message is {0} bytes longer than what is in it")]
    LeftOver(usize),
}

impl<'a> Message<'a> {
    /// A message with nothing but a kind.
    pub fn new(kind: Kind, data: Data) -> Self {
        Self {
            id: NO_ID,
            kind,
            data,
            source: b"",
            source_aux: b"",
            community: b"",
            key: b"",
            time: NO_NUMBER,
            number: NO_NUMBER,
            second: NO_NUMBER,
            value: b"",
        }
    }

    /// Bytes that it takes in a packet.
    pub fn encoded_len(&self) -> usize {
        let texts = [self.source, self.source_aux, self.community, self.key, self.value];
        SHORTEST + texts.iter().map(|text| text.len()).sum::<usize>()
    }

    /// Appends it. Whoever encodes sees to it that it is shorter than 2 GiB.
    pub fn put(&self, out: &mut Vec<u8>) {
        let len = self.encoded_len();
        out.reserve(len);
        self.put_head(len, out);
        out.extend_from_slice(self.value);
    }

    /// Appends all but the bytes of its value, which come last.
    pub(crate) fn put_without_value(&self, out: &mut Vec<u8>) {
        self.put_head(self.encoded_len(), out);
    }

    fn put_head(&self, len: usize, out: &mut Vec<u8>) {
        put_i32(out, len as i32);
        put_i32(out, self.id);
        out.extend_from_slice(&[self.kind.0, self.data.0]);
        for text in [self.source, self.source_aux, self.community, self.key] {
            put_text(out, text);
        }
        for number in [self.time, self.number, self.second] {
            out.extend_from_slice(&number.to_le_bytes());
        }
        put_i32(out, self.value.len() as i32);
    }

    /// The message that `bytes` are, no more and no less.
    ///
    /// # Errors
    /// They are none.
    pub fn read(bytes: &'a [u8]) -> Result<Self, MessageError> {
        if bytes.len() < SHORTEST {
            return Err(MessageError::TooShort(bytes.len() as i64));
        }
        let mut rest = Rest(bytes);
        rest.i32()?; // the length, which whoever cut the bytes out has gone by
        let id = rest.i32()?;
        let [kind, data] = rest.array()?;
        let (source, source_aux, community, key) = (rest.text()?, rest.text()?, rest.text()?, rest.text()?);
        let (time, number, second) = (rest.f64()?, rest.f64()?, rest.f64()?);
        let value = rest.text()?;
        if !rest.0.is_empty() {
            return Err(MessageError::LeftOver(rest.0.len()));
        }
        let (kind, data) = (Kind(kind), Data(data));
        Ok(Self { id, kind, data, source, source_aux, community, key, time, number, second, value })
    }
}

impl<'a> Message<'a> {
    /// The variable of a message that begins so; `None`: it does not reach as far.
    pub(crate) fn key_in(beginning: &'a [u8]) -> Option<&'a [u8]> {
        // Behind its length, id, kind and data stand the source, what is said of it, and the community.
        let mut rest = Rest(beginning.get(10..)?);
        (0..3).try_for_each(|_| rest.text().map(drop)).ok()?;
        rest.text().ok()
    }
}

fn put_i32(out: &mut Vec<u8>, number: i32) {
    out.extend_from_slice(&number.to_le_bytes());
}

fn put_text(out: &mut Vec<u8>, text: &[u8]) {
    put_i32(out, text.len() as i32);
    out.extend_from_slice(text);
}

/// What of a message has not been read yet.
struct Rest<'a>(&'a [u8]);

impl<'a> Rest<'a> {
    fn array<const N: usize>(&mut self) -> Result<[u8; N], MessageError> {
        let (first, rest) = self.0.split_first_chunk().ok_or(MessageError::Text(N as i32))?;
        self.0 = rest;
        Ok(*first)
    }

    fn i32(&mut self) -> Result<i32, MessageError> {
        self.array().map(i32::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, MessageError> {
        self.array().map(f64::from_le_bytes)
    }

    fn text(&mut self) -> Result<&'a [u8], MessageError> {
        let len = self.i32()?;
        let at = usize::try_from(len).ok().filter(|len| *len <= self.0.len()).ok_or(MessageError::Text(len))?;
        let (text, rest) = self.0.split_at(at);
        self.0 = rest;
        Ok(text)
    }
}
