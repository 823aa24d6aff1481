//! A message on its way through the broker.

use crate::wire::{self, BulkRef, Frame, Header};

/// A message in the broker's numbers: its own header, and the rest as it came.
pub struct Message<'a> {
    pub header: Header,
    fixed: [u8; wire::HEADER],
    rest: &'a [u8],
    /// The value, where it lies apart from the rest.
    apart: &'a [u8],
    len: usize,
}

impl<'a> Message<'a> {
    /// The message of a `frame`, with another header. Of what stands in the frame's own nothing is taken: that may lie in
    /// its client's memory, and be another by now.
    #[inline]
    pub fn new(header: Header, frame: &Frame<'a>) -> Self {
        let fixed = wire::fixed(&header, frame.aux.len(), frame.value.len());
        let (rest, apart): (_, &[u8]) = match frame.bytes.get(wire::HEADER..) {
            Some(rest) => (rest, &[]),
            None => (frame.aux, frame.value),
        };
        Self { fixed, header, rest, apart, len: frame.encoded_len() }
    }

    /// A message that was kept.
    pub fn stored(frame: &'a [u8]) -> Option<Self> {
        let frame = wire::first_frame(frame).ok()?;
        Some(Self::new(frame.header, &frame))
    }

    /// Bytes of the whole frame.
    #[inline]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Appends the whole frame.
    #[inline]
    pub fn append_to(&self, buffer: &mut Vec<u8>) {
        buffer.reserve(self.len());
        buffer.extend_from_slice(&self.fixed);
        buffer.extend_from_slice(self.rest);
        if !self.apart.is_empty() {
            buffer.extend_from_slice(self.apart);
            let padding = self.len - self.fixed.len() - self.rest.len() - self.apart.len();
            buffer.extend_from_slice(&[0; 8][..padding]);
        }
    }

    /// The whole frame.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.append_to(&mut bytes);
        bytes
    }
}

/// Where the value of a kept frame lies, if it lies in shared memory.
pub fn bulk_of(frame: &[u8]) -> Option<BulkRef> {
    let frame = wire::is_bulk(frame).then(|| wire::first_frame(frame).ok())??;
    BulkRef::from_bytes(frame.value)
}
