//! A packet on its way to a client. Long values in it stay in the mail that they are of, and are written from there: only
//! what stands around them is put together.

use std::io::{self, ErrorKind, IoSlice, Write};
use std::ops::Range;

use crate::message::Message;
use crate::packet::{HEADER, header};

/// A value stays where it is from this length on (bytes): below it a copy costs less than a piece of its own.
pub(crate) const LONG: usize = 16 << 10;

/// A value that stays where it is.
#[derive(Debug)]
struct Lent {
    /// Which of the packet's own bytes it stands before.
    before: usize,
    /// Where it lies in the mail.
    value: Range<usize>,
}

/// Packets that wait to be written, one mostly, and how far that is.
#[derive(Debug, Default)]
pub struct Outgoing {
    bytes: Vec<u8>,
    lent: Vec<Lent>,
    lent_bytes: usize,
    written: usize,
}

impl Outgoing {
    /// Where whole packets are appended.
    pub fn bytes(&mut self) -> &mut Vec<u8> {
        &mut self.bytes
    }

    /// Bytes that have not been written.
    pub fn waiting(&self) -> usize {
        self.bytes.len() + self.lent_bytes - self.written
    }

    /// Whether there is nothing, written or not.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Bytes that it holds room for itself.
    pub fn capacity(&self) -> usize {
        self.bytes.capacity()
    }

    /// Writes what a stream takes; how many bytes it took. `mail` is what the packet was made of. Once all is written there
    /// is nothing left.
    ///
    /// # Errors
    /// Those of the stream; and that this mail is not what the packet was made of.
    pub fn write_to(&mut self, mut stream: impl Write, mail: &[u8]) -> io::Result<usize> {
        let mut pieces = self.pieces(mail).ok_or(ErrorKind::InvalidInput)?;
        let mut pieces = pieces.as_mut_slice();
        IoSlice::advance_slices(&mut pieces, self.written);
        let bytes = stream.write_vectored(pieces)?;
        self.written += bytes;
        if self.waiting() == 0 {
            self.bytes.clear();
            self.lent.clear();
            (self.lent_bytes, self.written) = (0, 0);
        }
        Ok(bytes)
    }

    /// All of it as it is to be read. `None`: this mail is not what it was made of.
    pub fn to_bytes(&self, mail: &[u8]) -> Option<Vec<u8>> {
        let pieces = self.pieces(mail)?;
        Some(pieces.iter().flat_map(|piece| piece.iter().copied()).collect())
    }

    fn pieces<'a>(&'a self, mail: &'a [u8]) -> Option<Vec<IoSlice<'a>>> {
        let mut pieces = Vec::with_capacity(2 * self.lent.len() + 1);
        let mut at = 0;
        for Lent { before, value } in &self.lent {
            pieces.push(IoSlice::new(&self.bytes[at..*before]));
            pieces.push(IoSlice::new(mail.get(value.clone())?));
            at = *before;
        }
        pieces.push(IoSlice::new(&self.bytes[at..]));
        Some(pieces)
    }
}

/// A packet that is being put behind what waits.
pub struct PacketWriter<'a> {
    out: &'a mut Outgoing,
    mail: &'a [u8],
    start: usize,
    lent_before: usize,
    messages: i32,
}

impl<'a> PacketWriter<'a> {
    /// Begins one that is made of `mail`: long values of messages that lie in there stay there.
    pub fn new(out: &'a mut Outgoing, mail: &'a [u8]) -> Self {
        let (start, lent_before) = (out.bytes.len(), out.lent_bytes);
        out.bytes.extend_from_slice(&[0; HEADER]);
        Self { out, mail, start, lent_before, messages: 0 }
    }

    /// Adds a message.
    pub fn put(&mut self, message: &Message<'_>) {
        let long = Some(message.value).filter(|value| value.len() >= LONG);
        match long.and_then(|value| place_in(self.mail, value)) {
            Some(value) => {
                // A value is the last of its message.
                message.put_without_value(&mut self.out.bytes);
                self.out.lent_bytes += value.len();
                self.out.lent.push(Lent { before: self.out.bytes.len(), value });
            }
            None => message.put(&mut self.out.bytes),
        }
        self.messages += 1;
    }

    /// Bytes so far.
    pub fn written(&self) -> usize {
        self.out.bytes.len() - self.start + self.out.lent_bytes - self.lent_before
    }

    /// Ends it; whether there is one: a packet without messages is never sent, MOOS' clients look at the first one unasked.
    pub fn finish(self) -> bool {
        let len = self.written();
        let Self { out, start, messages, .. } = self;
        if messages == 0 {
            out.bytes.truncate(start);
            return false;
        }
        out.bytes[start..start + HEADER].copy_from_slice(&header(len, messages));
        true
    }
}

/// Where `part` lies in `whole`, if it does.
fn place_in(whole: &[u8], part: &[u8]) -> Option<Range<usize>> {
    let at = (part.as_ptr() as usize).checked_sub(whole.as_ptr() as usize)?;
    let end = at.checked_add(part.len()).filter(|end| *end <= whole.len())?;
    Some(at..end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{Data, Kind};
    use crate::packet::put_packet;

    fn message(value: &[u8]) -> Message<'_> {
        Message { key: b"SCAN", value, ..Message::new(Kind::NOTIFY, Data::BINARY) }
    }

    /// Takes a few bytes at a time.
    struct Narrow(Vec<u8>);

    impl Write for Narrow {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let taken = bytes.len().min(7_001);
            self.0.extend_from_slice(&bytes[..taken]);
            Ok(taken)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_packet_reads_the_same_wherever_its_values_lie_and_in_whatever_pieces_it_is_written() {
        let mail: Vec<u8> = (0..5 * LONG).map(|i| (i % 251) as u8).collect();
        let elsewhere = vec![7; LONG + 3];
        let values = [&mail[8..20], &mail[20..20 + 3 * LONG], &elsewhere[..], &mail[mail.len() - LONG..], b""];
        let [mut lending, mut copying] = [Outgoing::default(), Outgoing::default()];
        for (out, mail) in [(&mut lending, &mail[..]), (&mut copying, b"")] {
            let mut packet = PacketWriter::new(out, mail);
            values.iter().for_each(|value| packet.put(&message(value)));
            assert_eq!(
                packet.written(),
                HEADER + values.map(|value| message(value).encoded_len()).iter().sum::<usize>()
            );
            assert!(packet.finish());
            assert!(!PacketWriter::new(out, mail).finish(), "none is begun for nothing");
        }
        assert_eq!(lending.lent.len(), 2, "only what is long and lies in the mail stays there");
        let whole = copying.to_bytes(b"").unwrap();
        assert_eq!(lending.to_bytes(&mail).unwrap(), whole);
        assert!(lending.to_bytes(&mail[..mail.len() - 1]).is_none() && lending.capacity() < 2 * LONG + 1024);

        let mut taken = Narrow(Vec::new());
        while lending.waiting() > 0 {
            assert_eq!(lending.waiting(), whole.len() - taken.0.len());
            assert!(lending.write_to(&mut taken, b"").is_err(), "that is no mail of this packet");
            lending.write_to(&mut taken, &mail).unwrap();
        }
        assert_eq!(taken.0, whole);
        assert!(lending.is_empty());
    }

    #[test]
    fn one_message_is_a_packet_as_a_writer_puts_it() {
        let (mut whole, mut out) = (Vec::new(), Outgoing::default());
        put_packet(&mut whole, &message(b"abc"));
        let mut packet = PacketWriter::new(&mut out, b"");
        packet.put(&message(b"abc"));
        assert!(packet.finish());
        assert_eq!(out.to_bytes(b""), Some(whole));
    }
}
