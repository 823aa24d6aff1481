//! A message on its way through the broker.

use crate::wire::{self, BulkRef, Frame, Header};

/// A message in the broker's numbers: its own header, and the rest as it came.
pub struct Message<'a> {
    pub header: Header,
    fixed: [u8; wire::HEADER],
    rest: &'a [u8],
}

impl<'a> Message<'a> {
    /// The message of a `frame`, with another header. Of what stands in the frame's own nothing is taken: that may lie in
    /// its client's memory, and be another by now.
    #[inline]
    pub fn new(header: Header, frame: &Frame<'a>) -> Self {
        debug_assert!(frame.bytes.len() >= wire::HEADER, "a frame begins with its header");
        let fixed = wire::fixed(&header, frame.aux.len(), frame.value.len());
        Self { fixed, header, rest: frame.bytes.get(wire::HEADER..).unwrap_or_default() }
    }

    /// A message that was kept.
    pub fn stored(frame: &'a [u8]) -> Option<Self> {
        let frame = wire::first_frame(frame).ok()?;
        Some(Self::new(frame.header, &frame))
    }

    /// Bytes of the whole frame.
    #[inline]
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
pub fn bulk_of(frame: &[u8]) -> Option<BulkRef> {
    let frame = wire::is_bulk(frame).then(|| wire::first_frame(frame).ok())??;
    BulkRef::from_bytes(frame.value)
}
