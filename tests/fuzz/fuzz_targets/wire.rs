//! Any batch that a client may be given by a broker that is not right in the head: frames, names, mail, values.
#![no_main]

mod common;

use std::sync::LazyLock;
use std::time::Duration;

use elk_bus::link::{Batch, Downlink, Fill, Held, Link, LinkError, Rejoin, Uplink};
use elk_bus::wire::{self, BulkRef, Named};
use elk_bus::{Client, CommsError, Community, Description, ValueRef};
use elk_spatial::samples::{self, SAMPLES};
use libfuzzer_sys::arbitrary::{Arbitrary, Result, Unstructured};
use libfuzzer_sys::fuzz_target;

/// A transport whose broker says what the fuzzer says.
struct Made(Vec<Vec<u8>>);

impl Downlink for Made {
    fn receive(&mut self, _: Duration) -> std::result::Result<Option<Batch>, LinkError> {
        Ok(self.0.pop().map(|bytes| Batch(Box::new(bytes))))
    }
    fn open(&self) -> bool {
        true
    }
    fn note_handled(&mut self, _: u64) {}
    fn note_missed(&mut self, _: u64) {}
    fn retiring(&self) -> bool {
        false
    }
    fn bulk(&mut self, _: BulkRef) -> Option<&Held> {
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
    fn has_room(&self) -> bool {
        true
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

/// What all that elk's apps say is, as a broker defines it.
static DEFINITIONS: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut batch = Vec::new();
    for (number, sample) in (0..).zip(SAMPLES) {
        let description = sample.type_.description().map(|described| described.to_text()).unwrap_or_default();
        let (name, layout) = (sample.name(), sample.type_.layout());
        wire::put_definition(&mut batch, Named::Type, number, name, layout, &description);
    }
    batch
});

/// Batches, the last one first: some of any bytes, most of frames that are nearly right.
fn batches(from: &mut Unstructured<'_>) -> Result<Vec<Vec<u8>>> {
    let mut batches = Vec::new();
    while !from.is_empty() && batches.len() < 16 {
        let mut batch = Vec::new();
        for _ in 0..from.int_in_range(0..=8)? {
            match from.int_in_range(0..=7)? {
                0 => batch.extend_from_slice(<&[u8]>::arbitrary(from)?),
                1 => {
                    let what = [Named::Key, Named::Source, Named::Type, Named::Community][from.int_in_range(0..=3)?];
                    let number = from.int_in_range(0..=70)?;
                    let (name, description) = (<&str>::arbitrary(from)?, <&str>::arbitrary(from)?);
                    let layout = Description::from_text(description).map_or(u64::arbitrary(from)?, |one| one.layout());
                    wire::put_definition(&mut batch, what, number, name, layout, description);
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
    batches.push(DEFINITIONS.clone());
    Ok(batches)
}

fn put_frame(from: &mut Unstructured<'_>, batch: &mut Vec<u8>) -> Result<()> {
    let flags = u16::arbitrary(from)?;
    let header = common::header(from, flags, 20)?;
    wire::put(batch, &header, <&[u8]>::arbitrary(from)?, <&[u8]>::arbitrary(from)?);
    Ok(())
}

fuzz_target!(|bytes: &[u8]| {
    wire::frames(bytes).for_each(|frame| drop(frame.map(|frame| (frame.header, frame.aux.len(), frame.value.len()))));
    let Ok(batches) = batches(&mut Unstructured::new(bytes)) else { return };
    let count = batches.len();
    let down = Box::new(Made(batches));
    let link = Link {
        up: Box::new(Nowhere),
        down,
        back: Box::new(Nowhere),
        build: String::new(),
        warp: 1.0,
        clock_setting: None,
        epoch: 1,
    };
    let Ok(community) = Community::new("fuzz") else { return };
    let mut client = Client::over(link, "fuzz", &community);
    for _ in 0..count {
        let Client { comms, inbox } = &mut client;
        let heard: std::result::Result<usize, CommsError> = inbox.receive(comms, Duration::ZERO, |_, mail| {
            let _ = (mail.key(), mail.source(), mail.time(), mail.sequence(), mail.is_latest());
            // As one that shows it, and as an app that decodes it, which holds it against the checks of its type.
            let _ = mail.value().to_json(100);
            if let ValueRef::Binary { type_, bytes } = mail.value() {
                let _ = samples::named(type_.name()).map(|sample| sample.check(bytes));
            }
            Ok(())
        });
        let _ = heard;
        let _ = client.inbox.take_refusals();
    }
});
