//! Frames: what lies in a batch between client and broker, in both directions.
//!
//! A batch is a run of frames, each a multiple of eight bytes. A message's names (key, source, type, community) are
//! numbers that an earlier definition frame of the same lane introduced, so that the broker routes without hashing or
//! comparing text, and forwards a message by copying it and rewriting four numbers. All numbers are little-endian.
//!
//! ```text
//!  0 u32 length of the frame       16 u32 type          32 f64 time
//!  4 u8  kind   5 u8 value kind    20 u32 community     40 u32 length of aux
//!  6 u16 flags                     24 u64 sequence      44 u32 length of value
//!  8 u32 key   12 u32 source                            48 aux, value, padding
//! ```

use crate::clock_setting::ClockSetting;

/// Length of a frame's fixed part (bytes).
pub const HEADER: usize = 48;
/// The longest frame that a reader accepts (bytes).
pub const MAX_FRAME: usize = 1 << 30;

/// The longest message that travels in a batch between processes (bytes, the frame whole): with a value of 1 MiB. A larger
/// value lies in its publisher's shared memory.
pub const MAX_MESSAGE: usize = HEADER + MAX_NAME + (1 << 20) + 8;
/// The longest name of a variable, source, type or community, the longest pattern, and the longest word about a source
/// (bytes).
pub const MAX_NAME: usize = 256;

/// What a frame is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum FrameKind {
    /// A message.
    Notify = 1,
    /// Up: register. `aux` is the key's pattern, the value the source's; `time` the minimum interval (s); with [`TYPED`],
    /// the kind of value that is expected, and `type_` the type of a binary one.
    Register = 2,
    /// Up: take back registrations with these two patterns.
    Unregister = 3,
    /// Names a number: `flags` says of what (see [`Named`]), `key` is the number, `aux` the name; the value of a type's is its
    /// description, as [`elk_describe::Description::to_text`] has it, or empty; down, that of a source's is the build of the
    /// program that writes under that name, or empty.
    Define = 4,
    /// Down: a message was refused, `sequence` says which; or, with sequence 0, a registration or a name. `aux` is the
    /// variable, the value says why.
    Refused = 5,
    /// Down: `sequence` messages have been dropped for this client so far, because it did not read.
    Dropped = 6,
    /// Up: the client has opened the bulk service of the client whose number is `source`.
    Attached = 7,
    /// Up: the client has said all that has to be said before its mail may flow.
    Ready = 8,
    /// Up: drives the community's clock; down: what it is set to (see [`put_clock`]).
    Clock = 9,
}

/// What a definition names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u16)]
pub enum Named {
    /// A variable.
    Key = 0,
    /// A source of messages.
    Source = 1,
    /// A payload type; `sequence` carries its layout hash.
    Type = 2,
    /// A community.
    Community = 3,
}

/// What kind of value a message carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum ValueKind {
    /// Eight bytes of f64; eight more of a second one, if its publisher is a client of MOOS' and gave one. Only such clients
    /// are shown it.
    Double = 0,
    /// UTF-8 text.
    Text = 1,
    /// Bytes of the type that the frame names.
    Binary = 2,
}

/// Flag of a message: the value is a [`BulkRef`] to where it lies in the publisher's shared memory.
pub const BULK: u16 = 1;
/// Flag of a message whose bulk value was copied because the client is not attached to the publisher's bulk service
/// yet; `aux` is the publishing client's number.
pub const ATTACH: u16 = 2;
/// Flag of a message that was given to a late registrant: the variable's latest value, not a new one.
pub const LATEST: u16 = 4;
/// Flag of a registration: publishers wait rather than mail be dropped.
pub const LOSSLESS: u16 = 8;
/// Flag of a message or a registration that a broker before this one was sent already.
pub const RESENT: u16 = 16;

/// Flag of a registration that says what its client expects.
pub const TYPED: u16 = 32;

/// A sequence holds the publisher's count of its messages in this many low bits, and above them its life: what tells a
/// publisher from the one that had its name before.
const COUNT_BITS: u32 = 40;

/// The sequence before the first message of a publisher that came to life at `millis` (of whatever clock: two lives of
/// the same name only have to differ).
pub fn first_sequence(millis: u64) -> u64 {
    millis << COUNT_BITS
}

/// The publisher's count in a sequence.
#[inline]
pub fn count(sequence: u64) -> u64 {
    sequence & ((1 << COUNT_BITS) - 1)
}

/// Whether two sequences are of the same life of a publisher.
#[inline]
pub fn same_life(one: u64, other: u64) -> bool {
    one >> COUNT_BITS == other >> COUNT_BITS
}

/// The number of a connected client; never given twice.
pub type ClientId = u32;

/// Where a bulk value lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BulkRef {
    /// The publishing client's number.
    pub client: ClientId,
    /// How many attachments the publisher knew of when it sent.
    pub generation: u32,
    /// The number of the sample in the publisher's bulk service.
    pub sample: u64,
    /// Its length (bytes): who only counts need not look at it.
    pub len: u64,
}

impl BulkRef {
    /// Its 24 bytes.
    pub fn to_bytes(self) -> [u8; 24] {
        let mut bytes = [0; 24];
        bytes[..4].copy_from_slice(&self.client.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.generation.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.sample.to_le_bytes());
        bytes[16..].copy_from_slice(&self.len.to_le_bytes());
        bytes
    }

    /// From its 24 bytes.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        (bytes.len() == 24).then(|| Self {
            client: u32_at(bytes, 0),
            generation: u32_at(bytes, 4),
            sample: u64_at(bytes, 8),
            len: u64_at(bytes, 16),
        })
    }
}

/// The fixed part of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Header {
    /// What the frame is for.
    pub kind: FrameKind,
    /// What kind of value it carries.
    pub value_kind: ValueKind,
    /// See [`BULK`] and its neighbours.
    pub flags: u16,
    /// Number of the variable.
    pub key: u32,
    /// Number of the source; from a client, 0 is the client itself.
    pub source: u32,
    /// Number of the value's type, for binary values.
    pub type_: u32,
    /// Number of the community; from a client, 0 is the broker's own.
    pub community: u32,
    /// The publisher's life and its count of its messages, from 1 (see [`count`]).
    pub sequence: u64,
    /// The publisher's time (s).
    pub time: f64,
}

impl Header {
    /// A frame with nothing but a kind.
    pub fn new(kind: FrameKind) -> Self {
        Self {
            kind,
            value_kind: ValueKind::Text,
            flags: 0,
            key: 0,
            source: 0,
            type_: 0,
            community: 0,
            sequence: 0,
            time: 0.0,
        }
    }
}

/// A frame where it lies.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// The fixed part.
    pub header: Header,
    /// Free text of the publisher about the source (MOOS' source aux).
    pub aux: &'a [u8],
    /// The value.
    pub value: &'a [u8],
    /// The whole frame, padding included; empty: it is in no batch (see [`Frame::apart`]).
    pub bytes: &'a [u8],
}

impl<'a> Frame<'a> {
    /// A frame whose parts lie somewhere, and not behind each other in a batch.
    pub fn apart(header: Header, aux: &'a [u8], value: &'a [u8]) -> Self {
        Self { header, aux, value, bytes: &[] }
    }

    /// Bytes that it takes in a batch.
    #[inline]
    pub fn encoded_len(&self) -> usize {
        frame_len(self.aux.len(), self.value.len())
    }
}

/// Bytes that are no frames.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the batch is damaged at byte {at}: {what}")]
pub struct WireError {
    /// Offset in the batch (bytes).
    pub at: usize,
    /// What is wrong there.
    pub what: &'static str,
}

/// Bytes that a frame with these lengths takes.
#[inline]
pub fn frame_len(aux: usize, value: usize) -> usize {
    (HEADER + aux + value).next_multiple_of(8)
}

/// Appends a frame to a batch, padded to a multiple of eight bytes.
#[inline]
pub fn put(batch: &mut Vec<u8>, header: &Header, aux: &[u8], value: &[u8]) {
    let start = batch.len();
    let len = frame_len(aux.len(), value.len());
    batch.reserve(len);
    batch.extend_from_slice(&fixed(header, aux.len(), value.len()));
    batch.extend_from_slice(aux);
    batch.extend_from_slice(value);
    batch.resize(start + len, 0);
}

/// The fixed part of a frame with aux and value of these lengths (bytes).
#[inline]
pub fn fixed(header: &Header, aux: usize, value: usize) -> [u8; HEADER] {
    let mut fixed = [0; HEADER];
    fixed[0..4].copy_from_slice(&(frame_len(aux, value) as u32).to_le_bytes());
    fixed[4] = header.kind as u8;
    fixed[5] = header.value_kind as u8;
    fixed[6..8].copy_from_slice(&header.flags.to_le_bytes());
    fixed[8..12].copy_from_slice(&header.key.to_le_bytes());
    fixed[12..16].copy_from_slice(&header.source.to_le_bytes());
    fixed[16..20].copy_from_slice(&header.type_.to_le_bytes());
    fixed[20..24].copy_from_slice(&header.community.to_le_bytes());
    fixed[24..32].copy_from_slice(&header.sequence.to_le_bytes());
    fixed[32..40].copy_from_slice(&header.time.to_le_bytes());
    fixed[40..44].copy_from_slice(&(aux as u32).to_le_bytes());
    fixed[44..48].copy_from_slice(&(value as u32).to_le_bytes());
    fixed
}

/// Appends a frame that names number `number`; `layout` is a type's, `more` what else is said of it (see [`FrameKind::Define`]).
pub fn put_definition(batch: &mut Vec<u8>, what: Named, number: u32, name: &str, layout: u64, more: &str) {
    let header = Header { flags: what as u16, key: number, sequence: layout, ..Header::new(FrameKind::Define) };
    put(batch, &header, name.as_bytes(), more.as_bytes());
}

/// Appends a frame that sets the community's clock; without a setting, that leaves it to itself.
pub fn put_clock(batch: &mut Vec<u8>, setting: Option<ClockSetting>) {
    let header = Header { time: setting.map_or(0.0, |setting| setting.time), ..Header::new(FrameKind::Clock) };
    let value =
        setting.map(|setting| [setting.at.to_le_bytes(), setting.rate.to_le_bytes()].concat()).unwrap_or_default();
    put(batch, &header, &[], &value);
}

/// What a frame sets the community's clock to.
pub fn clock_setting(frame: &Frame<'_>) -> Result<Option<ClockSetting>, &'static str> {
    if frame.value.is_empty() {
        return Ok(None);
    }
    if frame.value.len() != 16 {
        return Err("the clock's setting is of the wrong length");
    }
    let number = |at| f64::from_bits(u64_at(frame.value, at));
    let setting = ClockSetting { at: number(0), time: frame.header.time, rate: number(8) };
    let sound = setting.at.is_finite() && setting.time.is_finite() && setting.rate.is_finite() && setting.rate >= 0.0;
    if sound { Ok(Some(setting)) } else { Err("the clock is set to no time, or is to run backwards") }
}

/// The frames of a batch; ends after the first that is damaged.
#[inline]
pub fn frames(batch: &[u8]) -> Frames<'_> {
    Frames { rest: batch, at: 0 }
}

/// See [`frames`].
#[derive(Debug, Clone)]
pub struct Frames<'a> {
    rest: &'a [u8],
    /// Where in the batch `rest` begins.
    at: usize,
}

impl<'a> Iterator for Frames<'a> {
    type Item = Result<Frame<'a>, WireError>;

    // Wherever a frame is handed on through memory field by field and read back in larger pieces, the processor waits; inlined, it
    // stays in registers (docs/figures.md says what that cost).
    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        match first_frame(self.rest) {
            Ok(frame) => {
                self.at += frame.bytes.len();
                self.rest = &self.rest[frame.bytes.len()..];
                Some(Ok(frame))
            }
            Err(what) => {
                self.rest = &[];
                Some(Err(WireError { at: self.at, what }))
            }
        }
    }
}

/// Length of the frame that a well-formed batch begins with.
#[inline]
pub fn first_len(batch: &[u8]) -> usize {
    u32_at(batch, 0) as usize
}

/// The frame at the start of `bytes`.
#[inline(always)]
pub fn first_frame(bytes: &[u8]) -> Result<Frame<'_>, &'static str> {
    if bytes.len() < HEADER {
        return Err("the frame's header is cut short");
    }
    let len = u32_at(bytes, 0) as usize;
    let (aux_len, value_len) = (u32_at(bytes, 40) as usize, u32_at(bytes, 44) as usize);
    if len > bytes.len() || len > MAX_FRAME {
        return Err("the frame reaches beyond the batch");
    }
    if aux_len > len || value_len > len || frame_len(aux_len, value_len) != len {
        return Err("the frame's lengths contradict each other");
    }
    let header = Header {
        kind: frame_kind(bytes[4]).ok_or("the frame is of no known kind")?,
        value_kind: value_kind(bytes[5]).ok_or("the value is of no known kind")?,
        flags: u16::from_le_bytes([bytes[6], bytes[7]]),
        key: u32_at(bytes, 8),
        source: u32_at(bytes, 12),
        type_: u32_at(bytes, 16),
        community: u32_at(bytes, 20),
        sequence: u64_at(bytes, 24),
        time: f64::from_bits(u64_at(bytes, 32)),
    };
    let (aux_end, value_end) = (HEADER + aux_len, HEADER + aux_len + value_len);
    Ok(Frame { header, aux: &bytes[HEADER..aux_end], value: &bytes[aux_end..value_end], bytes: &bytes[..len] })
}

/// The number that a value of kind [`ValueKind::Double`] is; `None`: it is none.
#[inline]
pub fn double(value: &[u8]) -> Option<f64> {
    let (first, rest) = value.split_first_chunk()?;
    matches!(rest.len(), 0 | 8).then(|| f64::from_le_bytes(*first))
}

/// The second number of such a value, if it has one.
#[inline]
pub fn second_double(value: &[u8]) -> Option<f64> {
    (value.len() == 16).then(|| f64::from_bits(u64_at(value, 8)))
}

/// Whether a well-formed frame's value lies in shared memory.
#[inline]
pub fn is_bulk(frame: &[u8]) -> bool {
    frame.get(6).is_some_and(|flags| u16::from(*flags) & BULK != 0)
}

/// Bytes of a well-formed frame's value, wherever it lies.
#[inline]
pub fn value_bytes(frame: &[u8]) -> u64 {
    let (start, len) = (HEADER + u32_at(frame, 40) as usize, u32_at(frame, 44) as usize);
    match is_bulk(frame) {
        true => frame.get(start..start + len).and_then(BulkRef::from_bytes).map_or(0, |reference| reference.len),
        false => len as u64,
    }
}

/// The client whose bulk service the receiver of `frame` is told to attach to.
#[inline]
pub fn publisher_to_attach(frame: &Frame<'_>) -> Option<u32> {
    (frame.header.flags & ATTACH != 0 && frame.aux.len() == 4).then(|| u32_at(frame.aux, 0))
}

/// The bytes of a whole message in which it says by number what it refers to, and whether its type counts: messages in
/// which they are the same refer to the same.
#[inline]
pub fn references(frame: &[u8]) -> (bool, &[u8]) {
    (frame[5] == ValueKind::Binary as u8, &frame[8..24])
}

/// What a whole message refers to by number: key, source, type (of a binary value) and community.
#[inline]
pub fn numbers(frame: &[u8]) -> impl Iterator<Item = (Named, u32)> {
    let (is_typed, numbers) = references(frame);
    let type_ = is_typed.then_some((Named::Type, 8));
    let others = [(Named::Key, 0), (Named::Source, 4), (Named::Community, 12)];
    others.into_iter().chain(type_).map(|(what, at)| (what, u32_at(numbers, at)))
}

/// The kind that a definition's flags name.
pub fn named(flags: u16) -> Option<Named> {
    [Named::Key, Named::Source, Named::Type, Named::Community].into_iter().find(|n| *n as u16 == flags)
}

#[inline]
fn frame_kind(byte: u8) -> Option<FrameKind> {
    use FrameKind::*;
    [Notify, Register, Unregister, Define, Refused, Dropped, Attached, Ready, Clock]
        .into_iter()
        .find(|k| *k as u8 == byte)
}

#[inline]
fn value_kind(byte: u8) -> Option<ValueKind> {
    [ValueKind::Double, ValueKind::Text, ValueKind::Binary].into_iter().find(|k| *k as u8 == byte)
}

#[inline]
fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

#[inline]
fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u32_at(bytes, at)) | u64::from(u32_at(bytes, at + 4)) << 32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_frame_lies_within_its_batch_and_its_parts_within_it() {
        let mut good = Vec::new();
        put(&mut good, &Header::new(FrameKind::Notify), b"aux", b"value");
        let len = good.len() as u32;
        assert!(first_frame(&good).is_ok());
        for cut in 0..good.len() {
            assert!(first_frame(&good[..cut]).is_err(), "the first {cut} bytes of {len}");
        }
        let words = [8, HEADER as u32, len - 8, len + 8, 1 << 30, (1 << 30) + 8, u32::MAX - 7, u32::MAX];
        for (at, what) in [(0, "the frame"), (40, "aux"), (44, "the value")] {
            for word in words {
                let mut bytes = good.clone();
                bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
                assert!(first_frame(&bytes).is_err(), "{what} of {word} bytes");
            }
        }
    }

    proptest! {
        #[test]
        fn frames_come_back(parts in prop::collection::vec((prop::collection::vec(any::<u8>(), 0..30), prop::collection::vec(any::<u8>(), 0..90), any::<u64>()), 0..8)) {
            let mut batch = Vec::new();
            for (aux, value, sequence) in &parts {
                put(&mut batch, &Header { sequence: *sequence, ..Header::new(FrameKind::Notify) }, aux, value);
            }
            let back: Vec<_> = frames(&batch).map(|f| f.map(|f| (f.aux.to_vec(), f.value.to_vec(), f.header.sequence))).collect::<Result<_, _>>().unwrap();
            prop_assert_eq!(back, parts);
        }

        #[test]
        fn clocks_come_back_unless_they_run_backwards(at in -1e9..1e9_f64, time in -1e9..1e9_f64, rate in -1.0..9.0_f64) {
            let mut batch = Vec::new();
            put_clock(&mut batch, Some(ClockSetting { at, time, rate }));
            put_clock(&mut batch, None);
            let back: Vec<_> = frames(&batch).map(|frame| clock_setting(&frame.unwrap()).ok()).collect();
            prop_assert_eq!(back, [(rate >= 0.0).then_some(Some(ClockSetting { at, time, rate })), Some(None)]);
        }

        #[test]
        fn any_bytes_are_frames_or_an_error(mut bytes in prop::collection::vec(any::<u8>(), 0..300), short in any::<bool>()) {
            if short && bytes.len() >= 4 {
                bytes[1..4].fill(0);
            }
            for frame in frames(&bytes) {
                prop_assert!(frame.map_or(0, |f| f.bytes.len()) <= bytes.len());
            }
        }
    }
}
