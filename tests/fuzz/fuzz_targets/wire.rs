//! Any batch that a client may be given by a broker that is not right in the head: frames, names, mail, values.
#![no_main]

use std::ops::Deref;
use std::time::Duration;

use elk_bus::link::{Batch, Downlink, Fill, Link, LinkError, Rejoin, Uplink};
use elk_bus::wire::{self, BulkRef, FrameKind, Header, Named, ValueKind};
use elk_bus::{Client, Clock, CommsError, Community};
use elk_spatial::catalogue::{self, CATALOGUE};
use libfuzzer_sys::arbitrary::{Arbitrary, Result, Unstructured};
use libfuzzer_sys::fuzz_target;

/// A transport whose broker says what the fuzzer says.
struct Made(Vec<Vec<u8>>);

struct Owned(Vec<u8>);

impl Deref for Owned {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.0
    }
}

impl Downlink for Made {
    fn receive(&mut self, _: Duration) -> std::result::Result<Option<Batch>, LinkError> {
        Ok(self.0.pop().map(|bytes| Batch(Box::new(Owned(bytes)))))
    }
    fn open(&self) -> bool {
        true
    }
    fn note_handled(&mut self, _: u64) {}
    fn note_missed(&mut self, _: u64) {}
    fn retiring(&self) -> bool {
        false
    }
    fn bulk(&mut self, _: BulkRef) -> Option<&[u8]> {
        None
    }
    fn attach(&mut self, _: u32) -> bool {
        true
    }
}

struct Nowhere;

impl Uplink for Nowhere {
    fn send(&mut self, _: &[u8]) -> std::result::Result<(), LinkError> {
        Ok(())
    }
    fn handled(&self) -> u64 {
        u64::MAX
    }
    fn send_bulk(&mut self, _: usize, _: &mut Fill<'_>) -> std::result::Result<Option<BulkRef>, LinkError> {
        Ok(None)
    }
    fn kept_bulk(&self, _: u64) -> Option<&[u8]> {
        None
    }
    fn say_goodbye(&mut self) {}
    fn keep_bulk(&mut self, _: &dyn Fn(u64) -> bool) {}
}

impl Rejoin for Nowhere {
    fn rejoin(&mut self) -> std::result::Result<Link, LinkError> {
        Err(LinkError::BrokerGone("fuzz".into()))
    }
}

/// Batches: some of any bytes, most of frames that are nearly right.
fn batches(from: &mut Unstructured<'_>) -> Result<Vec<Vec<u8>>> {
    let mut batches = Vec::new();
    while !from.is_empty() && batches.len() < 16 {
        let mut batch = Vec::new();
        for (number, payload) in (0..).zip(CATALOGUE) {
            wire::put_definition(&mut batch, Named::Type, number, payload.name, payload.layout);
        }
        for _ in 0..from.int_in_range(0..=8)? {
            match from.int_in_range(0..=7)? {
                0 => batch.extend_from_slice(<&[u8]>::arbitrary(from)?),
                1 => {
                    let what = [Named::Key, Named::Source, Named::Type, Named::Community][from.int_in_range(0..=3)?];
                    let number = from.int_in_range(0..=70)?;
                    wire::put_definition(&mut batch, what, number, <&str>::arbitrary(from)?, u64::arbitrary(from)?);
                }
                _ => put_frame(from, &mut batch)?,
            }
        }
        if bool::arbitrary(from)? && !batch.is_empty() {
            let at = from.choose_index(batch.len())?;
            batch[at] ^= u8::arbitrary(from)?;
        }
        batches.push(batch);
    }
    Ok(batches)
}

fn put_frame(from: &mut Unstructured<'_>, batch: &mut Vec<u8>) -> Result<()> {
    use FrameKind::{Attached, Clock, Define, Dropped, Notify, Ready, Refused, Register, Unregister};
    let kinds = [Notify, Notify, Notify, Register, Unregister, Define, Refused, Dropped, Attached, Ready, Clock];
    let header = Header {
        kind: kinds[from.choose_index(kinds.len())?],
        value_kind: [ValueKind::Double, ValueKind::Text, ValueKind::Binary][from.int_in_range(0..=2)?],
        flags: u16::arbitrary(from)?,
        key: from.int_in_range(0..=20)?,
        source: from.int_in_range(0..=20)?,
        type_: from.int_in_range(0..=20)?,
        community: from.int_in_range(0..=3)?,
        sequence: u64::arbitrary(from)?,
        time: f64::arbitrary(from)?,
    };
    wire::put(batch, &header, <&[u8]>::arbitrary(from)?, <&[u8]>::arbitrary(from)?);
    Ok(())
}

fuzz_target!(|bytes: &[u8]| {
    wire::frames(bytes).for_each(|frame| drop(frame.map(|frame| (frame.header, frame.aux.len(), frame.value.len()))));
    let Ok(batches) = batches(&mut Unstructured::new(bytes)) else { return };
    let count = batches.len();
    let down = Box::new(Made(batches));
    let link = Link { up: Box::new(Nowhere), down, back: Box::new(Nowhere), clock: Clock::new(1.0), epoch: 1 };
    let Ok(community) = Community::new("fuzz") else { return };
    let mut client = Client::over(link, "fuzz", &community);
    for _ in 0..count {
        let Client { comms, inbox } = &mut client;
        let heard: std::result::Result<usize, CommsError> = inbox.receive(comms, Duration::ZERO, |_, mail| {
            let _ = (mail.key(), mail.source(), mail.time(), mail.sequence(), mail.is_latest());
            // As an app that decodes it, and as one that shows it.
            let _ = catalogue::value_to_json(mail.value(), 100);
            Ok(())
        });
        let _ = heard;
        let _ = client.inbox.take_refusals();
    }
});
