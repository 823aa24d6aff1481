//! The broker, among clients that say anything, come, go, die, and read or do not.
#![no_main]

mod common;

use elk_bus::Introduction;
use elk_bus::broker::{Action, Broker, BrokerConfig};
use elk_bus::wire::{self, BulkRef, ClientId, Named};
use libfuzzer_sys::arbitrary::{Arbitrary, Result, Unstructured};
use libfuzzer_sys::fuzz_target;

const NAMES: [&str; 6] =
    ["a", "b", "Map", "*", "", "a very long name that no client has, of more than sixty-four characters in all"];
const KEYS: [&str; 8] = ["A", "B", "SCAN", "DB_TABLE_REQUEST", "DB_CLIENTS", "*", "", "A_STATUS"];
/// Bytes that wait in one client's mailbox: few, so that mailboxes overflow.
const MAILBOX: usize = 1 << 12;
/// All flags that a frame can have.
const FLAGS: u16 = wire::BULK | wire::ATTACH | wire::LATEST | wire::LOSSLESS | wire::RESENT | wire::TYPED;

struct Lab {
    broker: Broker,
    now: f64,
    clients: Vec<ClientId>,
}

impl Lab {
    fn step(&mut self, from: &mut Unstructured<'_>) -> Result<()> {
        let id = if self.clients.is_empty() { 7 } else { *from.choose(&self.clients)? };
        let Self { broker, now, clients } = self;
        match from.int_in_range(0..=9)? {
            0 => {
                let who = Introduction {
                    name: from.choose(&NAMES)?,
                    build: from.choose(&["", "elk 0.1.0", "elk\u{1b}[2J"])?,
                    lease_secs: *from.choose(&[0.0, 1.0, f64::NAN, -1.0, 1e300])?,
                    succeeds: bool::arbitrary(from)?,
                    returns: bool::arbitrary(from)?,
                    inside: false,
                };
                clients.extend(broker.connect(*now, &who));
            }
            1 => {
                broker.disconnect(*now, id, u64::arbitrary(from)?, bool::arbitrary(from)?);
                clients.retain(|other| *other != id);
            }
            2 => {
                *now += from.int_in_range(0..=6000)? as f64 * 1e-3;
                broker.tick(*now);
                assert!(!broker.next_deadline().is_nan());
            }
            3 => {
                let mut batch = Vec::new();
                broker.take_mail(id, from.int_in_range(0..=2000)?, &mut batch, |frame, out| {
                    out.extend_from_slice(frame.bytes)
                });
                assert!(wire::frames(&batch).all(|frame| frame.is_ok()), "the broker frames rightly");
                broker.keep_given(id, batch);
            }
            4 => {
                broker.note_handled(*now, id, u64::arbitrary(from)?, &mut Vec::new());
                broker.note_missed(id, u64::arbitrary(from)?);
            }
            5 => {
                while let Some(action) = broker.poll() {
                    match action {
                        Action::Resolve(dead) => broker.resolve_mail(dead, |_| Some(b"a value")),
                        Action::KeepSessions => drop(broker.sessions()),
                        Action::KeepRetained => drop(broker.retained(|_| None)),
                        Action::Follow(_) | Action::Attach { .. } | Action::Retire(_) => {}
                    }
                }
                let _ = broker.reached();
                let _ = (broker.holds_back(*now, id), broker.waits_for(*now, id), broker.handled_batches(id));
                let _ = (broker.is_idle(id), broker.mail_done(id), broker.with_mail().count());
            }
            6 => drop(broker.receive(*now, id, <&[u8]>::arbitrary(from)?)),
            _ => {
                let batch = batch(from)?;
                let _ = broker.receive(*now, id, &batch);
            }
        }
        Ok(())
    }
}

/// A batch of a client that knows the format.
fn batch(from: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let mut batch = Vec::new();
    let layout = u64::from(u8::arbitrary(from)?);
    for (number, key) in (0..).zip(KEYS) {
        wire::put_definition(&mut batch, Named::Key, number, key, 0, "");
        wire::put_definition(&mut batch, Named::Type, number, "Theirs", layout, "");
    }
    wire::put_definition(&mut batch, Named::Source, from.int_in_range(0..=3)?, from.choose(&NAMES)?, 0, "");
    for _ in 0..from.int_in_range(1..=6)? {
        let flags = u16::from(u8::arbitrary(from)?) & FLAGS;
        // One key more than there is.
        let header = common::header(from, flags, KEYS.len() as u32)?;
        let reference = BulkRef {
            client: from.int_in_range(0..=5)?,
            generation: u32::arbitrary(from)?,
            sample: u64::arbitrary(from)?,
            len: u64::arbitrary(from)?,
        };
        let value: &[u8] = match from.int_in_range(0..=3)? {
            0 => &reference.to_bytes(),
            1 => &1.5_f64.to_le_bytes(),
            2 => from.choose(&KEYS)?.as_bytes(),
            _ => <&[u8]>::arbitrary(from)?,
        };
        let aux = if bool::arbitrary(from)? { from.choose(&KEYS)?.as_bytes() } else { <&[u8]>::arbitrary(from)? };
        wire::put(&mut batch, &header, aux, value);
    }
    Ok(batch)
}

fuzz_target!(|bytes: &[u8]| {
    let config = BrokerConfig { mailbox_bytes: MAILBOX, ..BrokerConfig::new("fuzz") };
    let mut lab = Lab { broker: Broker::new(config, 0.0), now: 0.0, clients: Vec::new() };
    let mut from = Unstructured::new(bytes);
    while !from.is_empty() && lab.step(&mut from).is_ok() {}
});
