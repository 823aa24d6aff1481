//! A message on its way through the broker.

use crate::wire::{self, BulkRef, Header};

/// A message in the broker's numbers: its own header, and the rest as it came.
pub(super) struct Message<'a> {
    pub header: Header,
    fixed: [u8; wire::HEADER],
    rest: &'a [u8],
}

impl<'a> Message<'a> {
    /// The message of a whole `frame`, with another header.
    pub fn new(header: Header, frame: &'a [u8]) -> Self {
        let (fixed, rest) = frame.split_at(wire::HEADER);
        Self { fixed: wire::renumbered(fixed, &header), header, rest }
    }

    /// A message that was kept.
    pub fn stored(frame: &'a [u8]) -> Option<Self> {
        let header = wire::first_frame(frame).ok()?.header;
        Some(Self::new(header, frame))
    }

    /// Bytes of the whole frame.
    pub fn len(&self) -> usize {
        self.fixed.len() + self.rest.len()
    }

    /// Appends the whole frame.
    #[inline]
    pub fn append_to(&self, buffer: &mut Vec<u8>) {
        buffer.reserve(self.len());
        buffer.extend_from_slice(&self.fixed);
        buffer.extend_from_slice(self.rest);
    }

    /// The whole frame.
    pub fn to_bytes(&self) -> Vec<u8> {
        [&self.fixed, self.rest].concat()
    }
}

/// Where the value of a kept frame lies, if it lies in shared memory.
pub(super) fn bulk_of(frame: &[u8]) -> Option<BulkRef> {
    let frame = wire::is_bulk(frame).then(|| wire::first_frame(frame).ok())??;
    BulkRef::from_bytes(frame.value)
}
