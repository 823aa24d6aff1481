//! The broker by itself: every time is a number that the test chose.

mod bounds;
mod clock;
mod limits;
mod mail;
mod routing;
mod succession;
mod table;
mod wanted;

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;
use crate::clock_setting::ClockSetting;
use crate::wire::{BulkRef, Header, LATEST, LOSSLESS, Named, ValueKind, frames, put, put_definition};

/// A broker with other limits than usual.
fn bounded(change: impl FnOnce(&mut Limits)) -> Broker {
    let mut limits = Limits::default();
    change(&mut limits);
    Broker::new(BrokerConfig { limits, ..BrokerConfig::new("test") }, 0.0)
}

/// A client of the test: speaks frames, remembers what it was told.
struct Speaker {
    id: ClientId,
    keys: Vec<String>,
    sequence: u64,
    names: BTreeMap<(u16, u32), String>,
    /// What it was told that the clock is set to, each time.
    clock: Vec<Option<ClockSetting>>,
    handled: u64,
}

#[derive(Debug, Clone, PartialEq)]
struct Heard {
    key: String,
    source: String,
    value: Vec<u8>,
    latest: bool,
}

impl Speaker {
    fn new(broker: &mut Broker, now: f64, name: &str) -> Self {
        Self::with(broker.connect(now, &Introduction::new(name)).unwrap())
    }

    fn with(id: ClientId) -> Self {
        Self { id, keys: Vec::new(), sequence: 0, names: BTreeMap::new(), handled: 0, clock: Vec::new() }
    }

    fn register(&self, broker: &mut Broker, now: f64, key: &str, source: &str, interval: f64) {
        self.registration(broker, now, FrameKind::Register, key, source, interval, 0);
    }

    #[allow(clippy::too_many_arguments)]
    fn registration(
        &self,
        broker: &mut Broker,
        now: f64,
        kind: FrameKind,
        key: &str,
        source: &str,
        time: f64,
        flags: u16,
    ) {
        let mut batch = Vec::new();
        put(&mut batch, &Header { time, flags, ..Header::new(kind) }, key.as_bytes(), source.as_bytes());
        broker.receive(now, self.id, &batch).unwrap();
    }

    fn say(&mut self, broker: &mut Broker, now: f64, key: &str, kind: ValueKind, value: &[u8]) {
        let mut batch = Vec::new();
        let number = self.keys.iter().position(|k| k == key).unwrap_or_else(|| {
            put_definition(&mut batch, Named::Key, self.keys.len() as u32, key, 0, "");
            self.keys.push(key.into());
            self.keys.len() - 1
        });
        self.sequence += 1;
        let header = Header {
            value_kind: kind,
            key: number as u32,
            sequence: self.sequence,
            time: now,
            ..Header::new(FrameKind::Notify)
        };
        put(&mut batch, &header, &[], value);
        broker.receive(now, self.id, &batch).unwrap();
    }

    fn drive(&self, broker: &mut Broker, now: f64, setting: Option<ClockSetting>) {
        let mut batch = Vec::new();
        wire::put_clock(&mut batch, setting);
        broker.receive(now, self.id, &batch).unwrap();
    }

    /// What it was told of the clock since the last call.
    fn told(&mut self, broker: &mut Broker, now: f64) -> Vec<Option<ClockSetting>> {
        self.hear(broker, now);
        std::mem::take(&mut self.clock)
    }

    fn text(&mut self, broker: &mut Broker, now: f64, key: &str, value: &str) {
        self.say(broker, now, key, ValueKind::Text, value.as_bytes());
    }

    fn hear(&mut self, broker: &mut Broker, now: f64) -> (Vec<Heard>, u64, Vec<String>) {
        let mut batch = Vec::new();
        broker.take_mail(self.id, usize::MAX, &mut batch, |_, _| {});
        let (mut heard, mut dropped, mut refused) = (Vec::new(), 0, Vec::new());
        for frame in frames(&batch).map(Result::unwrap) {
            let h = frame.header;
            let name = |what: Named, number: u32| self.names[&(what as u16, number)].clone();
            match h.kind {
                FrameKind::Define => {
                    self.names.insert((h.flags, h.key), String::from_utf8(frame.aux.into()).unwrap());
                }
                FrameKind::Dropped => dropped = h.sequence,
                FrameKind::Clock => self.clock.push(wire::clock_setting(&frame).unwrap()),
                FrameKind::Refused => refused.push(String::from_utf8(frame.value.into()).unwrap()),
                _ => heard.push(Heard {
                    key: name(Named::Key, h.key),
                    source: name(Named::Source, h.source),
                    value: frame.value.to_vec(),
                    latest: h.flags & LATEST != 0,
                }),
            }
        }
        self.handled += heard.len() as u64;
        broker.keep_given(self.id, batch);
        broker.note_handled(now, self.id, self.handled, &mut Vec::new());
        (heard, dropped, refused)
    }

    fn texts(&mut self, broker: &mut Broker, now: f64) -> Vec<String> {
        self.hear(broker, now).0.into_iter().map(|h| String::from_utf8(h.value).unwrap()).collect()
    }
}

fn broker() -> Broker {
    Broker::new(BrokerConfig::new("test"), 0.0)
}

fn leased<'a>(name: &'a str, secs: f64) -> Introduction<'a> {
    Introduction { lease_secs: secs, ..Introduction::new(name) }
}

/// What the broker wants done.
fn actions(broker: &mut Broker) -> Vec<Action> {
    std::iter::from_fn(|| broker.poll()).collect()
}

/// Who is to retire, of what the broker wants done.
fn retiring(broker: &mut Broker) -> Vec<ClientId> {
    let retires = |action| if let Action::Retire(holder) = action { Some(holder) } else { None };
    actions(broker).into_iter().filter_map(retires).collect()
}

/// Puts values in the place of references wherever the broker wants it.
fn resolve<'a>(broker: &mut Broker, value: impl Fn(BulkRef) -> Option<&'a [u8]>) {
    for action in actions(broker) {
        if let Action::Resolve(id) = action {
            broker.resolve_mail(id, &value);
        }
    }
}

/// A client says that it is ready.
fn ready(broker: &mut Broker, now: f64, id: ClientId) {
    let mut batch = Vec::new();
    put(&mut batch, &Header::new(FrameKind::Ready), &[], &[]);
    broker.receive(now, id, &batch).unwrap();
}

/// Joins, registers for everything that `a` says, and is ready.
fn join_ready(broker: &mut Broker, now: f64, who: &Introduction<'_>) -> Speaker {
    let id = broker.connect(now, who).unwrap();
    let speaker = Speaker::with(id);
    speaker.register(broker, now, "*", "a", 0.0);
    ready(broker, now, id);
    speaker
}
