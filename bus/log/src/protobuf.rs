//! As much of the protobuf wire format as a log needs: fields out, fields in.

/// The types of field that the wire knows.
const VARINT: u64 = 0;
const FIXED64: u64 = 1;
const BYTES: u64 = 2;
const FIXED32: u64 = 5;

/// Appends fields to a message.
pub(crate) struct Fields<'a>(pub &'a mut Vec<u8>);

impl Fields<'_> {
    fn tag(&mut self, number: u32, wire_type: u64) {
        put_varint(self.0, u64::from(number) << 3 | wire_type);
    }

    /// A whole number or an enum's value.
    pub fn varint(&mut self, number: u32, value: u64) {
        self.tag(number, VARINT);
        put_varint(self.0, value);
    }

    /// A `double`; its bits come back as they are.
    pub fn double(&mut self, number: u32, value: f64) {
        self.tag(number, FIXED64);
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    /// A `fixed32`.
    pub fn fixed32(&mut self, number: u32, value: u32) {
        self.tag(number, FIXED32);
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    /// `bytes`, or a `string`.
    pub fn bytes(&mut self, number: u32, value: &[u8]) {
        self.parts(number, &[value]);
    }

    /// `bytes` that lie in several places.
    pub fn parts(&mut self, number: u32, parts: &[&[u8]]) {
        self.tag(number, BYTES);
        put_varint(self.0, parts.iter().map(|part| part.len() as u64).sum());
        parts.iter().for_each(|part| self.0.extend_from_slice(part));
    }

    /// A message inside this one.
    pub fn message(&mut self, number: u32, fill: impl FnOnce(&mut Fields<'_>)) {
        self.tag(number, BYTES);
        let start = self.0.len();
        fill(self);
        let mut length = Vec::with_capacity(2);
        put_varint(&mut length, (self.0.len() - start) as u64);
        // Messages inside messages are a few bytes long here: moving them costs less than measuring them first.
        self.0.splice(start..start, length);
    }
}

fn put_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// The field `number` of type bytes (the last one, as protobuf has it) of each of `numbers`, where `message` has it.
/// `None`: it is no protobuf message.
pub(crate) fn find_bytes<const N: usize>(mut message: &[u8], numbers: [u32; N]) -> Option<[Option<&[u8]>; N]> {
    let mut found = [None; N];
    while !message.is_empty() {
        let tag = take_varint(&mut message)?;
        match tag & 7 {
            VARINT => drop(take_varint(&mut message)?),
            FIXED64 => drop(take(&mut message, 8)?),
            FIXED32 => drop(take(&mut message, 4)?),
            BYTES => {
                let length = usize::try_from(take_varint(&mut message)?).ok()?;
                let bytes = take(&mut message, length)?;
                if let Some(index) = numbers.iter().position(|number| u64::from(*number) == tag >> 3) {
                    found[index] = Some(bytes);
                }
            }
            _ => return None,
        }
    }
    Some(found)
}

fn take<'a>(message: &mut &'a [u8], length: usize) -> Option<&'a [u8]> {
    let (taken, rest) = message.split_at_checked(length)?;
    *message = rest;
    Some(taken)
}

fn take_varint(message: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = take(message, 1)?[0];
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_message_is_what_the_wire_format_says() {
        let mut bytes = Vec::new();
        let mut fields = Fields(&mut bytes);
        fields.varint(1, 150);
        fields.bytes(2, b"testing");
        fields.message(3, |inner| inner.varint(1, 150));
        // The three examples of the format's own documentation.
        assert_eq!(bytes, b"\x08\x96\x01\x12\x07testing\x1a\x03\x08\x96\x01");
    }

    proptest! {
        #[test]
        fn fields_are_found_among_others(before: u64, number: f64, one: Vec<u8>, other in prop::collection::vec(any::<u8>(), 0..300)) {
            let mut bytes = Vec::new();
            let mut fields = Fields(&mut bytes);
            fields.varint(1, before);
            fields.bytes(6, &one);
            fields.double(2, number);
            fields.fixed32(4, 7);
            fields.message(3, |inner| inner.bytes(1, &other));
            fields.parts(20_000, &[&one, &other]);
            let both = [one.clone(), other].concat();
            let found = find_bytes(&bytes, [6, 20_000, 9]).unwrap();
            prop_assert_eq!(found, [Some(&one[..]), Some(&both[..]), None]);
            prop_assert!(find_bytes(&bytes[..bytes.len() - 1], [9]).is_none() || both.is_empty());
        }

        #[test]
        fn any_bytes_are_an_answer(bytes: Vec<u8>) {
            let _ = find_bytes(&bytes, [1, 2]);
        }
    }
}
