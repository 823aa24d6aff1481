//! The head of a record of an MCAP file: its kind, and how long it is.

/// No schema, channel or metadata is larger, and no attachment that elk has a use for (bytes).
pub(crate) const MAX_RECORD_BYTES: u64 = 64 << 20;
/// Channel, sequence, and two times, before a message's own bytes.
pub(crate) const MESSAGE_HEAD: usize = 22;

/// What stands before every record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Head {
    pub opcode: u8,
    /// Bytes of the record behind its head.
    pub length: u64,
}

impl Head {
    /// Length of a head itself.
    pub const BYTES: usize = 9;

    /// The head that these bytes are.
    pub fn of(bytes: &[u8; Self::BYTES]) -> Self {
        Self { opcode: bytes[0], length: word(&bytes[1..]) }
    }

    /// Where a record with this head ends that begins at `start`.
    pub fn end(self, start: u64) -> u64 {
        start.saturating_add(Self::BYTES as u64).saturating_add(self.length)
    }
}

/// A little-endian number of 64 bits; there are at least eight bytes.
pub(crate) fn word(bytes: &[u8]) -> u64 {
    bytes.iter().take(8).rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}
