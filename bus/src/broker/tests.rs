//! The broker by itself: every time is a number that the test chose.

mod bounds;

use proptest::prelude::*;

use super::table::{CommunityTable, LatestValue, RouteEntry, VariableKind};
use super::*;
use crate::clock::Dial;
use crate::codec;
use crate::wire::{LATEST, LOSSLESS, frames, put, put_definition};

/// A client of the test: speaks frames, remembers what it was told.
struct Speaker {
    id: ClientId,
    keys: Vec<String>,
    sequence: u64,
    names: BTreeMap<(u16, u32), String>,
    /// What it was told that the clock is set to, each time.
    clock: Vec<Option<Dial>>,
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
            put_definition(&mut batch, Named::Key, self.keys.len() as u32, key, 0);
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

    fn drive(&self, broker: &mut Broker, now: f64, dial: Option<Dial>) {
        let mut batch = Vec::new();
        wire::put_clock(&mut batch, dial);
        broker.receive(now, self.id, &batch).unwrap();
    }

    /// What it was told of the clock since the last call.
    fn told(&mut self, broker: &mut Broker, now: f64) -> Vec<Option<Dial>> {
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
                FrameKind::Clock => self.clock.push(wire::dial(&frame).unwrap()),
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

#[test]
fn a_message_reaches_who_registered_and_only_them() {
    let b = &mut broker();
    let (mut a, mut c, mut d) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"), Speaker::new(b, 0.0, "d"));
    c.register(b, 0.0, "X", "*", 0.0);
    a.text(b, 0.0, "X", "1");
    let (heard, ..) = c.hear(b, 0.0);
    assert_eq!(heard, [Heard { key: "X".into(), source: "a".into(), value: b"1".into(), latest: false }]);
    assert!(d.hear(b, 0.0).0.is_empty());
}

#[test]
fn a_late_registrant_is_given_the_latest_value_once() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    a.text(b, 0.0, "X", "old");
    a.text(b, 0.0, "X", "new");
    c.register(b, 0.0, "X", "*", 0.0);
    c.register(b, 0.0, "*", "a", 0.0);
    let (heard, ..) = c.hear(b, 0.0);
    assert_eq!(heard, [Heard { key: "X".into(), source: "a".into(), value: b"new".into(), latest: true }]);
}

#[test]
fn a_wildcard_matches_every_pair_of_variable_and_source_whenever_it_first_appears() {
    let b = &mut broker();
    let (mut a, mut c, mut d) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"), Speaker::new(b, 0.0, "d"));
    c.register(b, 0.0, "NAV_*", "d", 0.0);
    a.text(b, 0.0, "NAV_X", "from a");
    d.text(b, 0.0, "NAV_X", "from d");
    d.text(b, 0.0, "OTHER", "from d");
    assert_eq!(c.texts(b, 0.0), ["from d"], "MOOS tests a variable against its first writer only");
}

#[test]
fn a_throttled_registration_delivers_the_last_value_of_a_burst() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 0.5);
    for i in 0..12 {
        let now = 1.0 + 0.1 * f64::from(i);
        b.tick(now);
        a.text(b, now, "X", &i.to_string());
    }
    assert!((b.next_deadline() - 2.0).abs() < 0.6, "{}", b.next_deadline());
    b.tick(1.6 + 1.0);
    assert_eq!(c.texts(b, 2.6), ["0", "4", "9", "11"], "every 0.5 s, and the last one");
    b.tick(9.0);
    assert!(c.texts(b, 9.0).is_empty());
}

#[test]
fn a_write_of_the_wrong_type_is_answered_to_the_writer() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 0.0);
    a.say(b, 0.0, "X", ValueKind::Double, &1.0_f64.to_le_bytes());
    a.text(b, 0.0, "X", "two");
    assert_eq!(a.hear(b, 0.0).2, ["X carries numbers since its first write; texts was refused"]);
    assert_eq!(c.hear(b, 0.0).0.len(), 1);
}

#[test]
fn a_name_is_unique_and_free_when_its_holder_is_gone() {
    let b = &mut broker();
    let a = Speaker::new(b, 0.0, "a");
    assert_eq!(b.connect(0.0, &Introduction::new("a")), Err(Refusal::NameTaken("a".into())));
    for bad in ["", "a,b", "a*", "a\n"] {
        assert_eq!(b.connect(0.0, &Introduction::new(bad)), Err(Refusal::BadName(bad.into())));
    }
    b.disconnect(0.0, a.id, 0, true);
    assert!(b.connect(0.0, &Introduction::new("a")).is_ok());
}

#[test]
fn what_an_app_published_outlives_it() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    a.text(b, 0.0, "X", "1");
    b.disconnect(0.0, a.id, 0, true);
    let mut c = Speaker::new(b, 0.0, "c");
    c.register(b, 0.0, "X", "*", 0.0);
    assert_eq!(c.texts(b, 0.0), ["1"]);
}

#[test]
fn a_full_mailbox_drops_the_oldest_and_counts() {
    let b = &mut Broker::new(BrokerConfig { mailbox_bytes: 10 * 56, ..BrokerConfig::new("test") }, 0.0);
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 0.0);
    for i in 0..100 {
        a.text(b, 0.0, "X", &i.to_string());
    }
    let (heard, dropped, _) = c.hear(b, 0.0);
    assert_eq!((heard.len(), dropped), (10, 90));
    assert_eq!((&heard[0].value[..], &heard[9].value[..]), (&b"90"[..], &b"99"[..]));
    for i in 0..11 {
        a.text(b, 0.0, "X", &i.to_string());
    }
    assert_eq!(c.hear(b, 0.0).1, 91, "the count goes on");
}

#[test]
fn a_lossless_registrant_holds_its_publishers_back_as_long_as_patience_lasts() {
    let config = BrokerConfig { mailbox_bytes: 10 * 56, lossless_patience_secs: 5.0, ..BrokerConfig::new("test") };
    let b = &mut Broker::new(config, 0.0);
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.registration(b, 0.0, FrameKind::Register, "X", "*", 0.0, LOSSLESS);
    let mut sent = 0;
    while !b.holds_back(0.0, a.id) {
        a.text(b, 0.0, "X", &sent.to_string());
        sent += 1;
    }
    assert_eq!(sent, 10);
    assert_eq!(c.texts(b, 1.0).len(), 10);
    assert!(!b.holds_back(1.0, a.id));
    for i in 0..10 {
        a.text(b, 2.0, "X", &i.to_string());
    }
    assert!(b.holds_back(2.0, a.id) && !b.holds_back(8.0, a.id), "a reader that stopped is waited for 5 s");
    a.text(b, 8.0, "X", "late");
    let (heard, dropped, _) = c.hear(b, 8.0);
    assert_eq!((heard.len(), dropped), (10, 1));
}

/// Regression: what a slow reader had been given long ago counted for nothing, and its mail was dropped.
#[test]
fn a_lossless_registrant_that_reads_slowly_is_waited_for_and_one_that_stops_is_not() {
    let config = BrokerConfig { mailbox_bytes: 10 * 56, lossless_patience_secs: 5.0, ..BrokerConfig::new("test") };
    let b = &mut Broker::new(config, 0.0);
    let (mut a, c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.registration(b, 0.0, FrameKind::Register, "X", "*", 0.0, LOSSLESS);
    let fill = |b: &mut Broker, a: &mut Speaker| (0..10).for_each(|i| a.text(b, 0.0, "X", &i.to_string()));
    fill(b, &mut a);
    let mut batch = Vec::new();
    b.take_mail(c.id, usize::MAX, &mut batch, |_, _| {});
    b.keep_given(c.id, batch);
    fill(b, &mut a);
    for (handled, now) in [(1, 4.0), (2, 8.0), (3, 12.0)] {
        b.note_handled(now, c.id, handled, &mut Vec::new());
        assert!(b.holds_back(now + 4.5, a.id) && b.waits_for(now + 4.5, c.id), "it reads at {now} s");
    }
    b.note_handled(16.0, c.id, 3, &mut Vec::new());
    assert!(!b.holds_back(17.5, a.id) && !b.waits_for(17.5, c.id), "it stopped at 12 s");
    assert_eq!(b.mail_done(c.id), Some(0), "what it was given is not handled for that");
}

#[test]
fn one_client_drives_the_clock_and_everybody_is_told() {
    let b = &mut broker();
    let (driver, mut a, mut c) = (Speaker::new(b, 0.0, "driver"), Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    let dials = [1.0, 2.0, 0.0].map(|rate| Some(Dial { at: 10.0, time: 500.0, rate }));
    dials.iter().for_each(|dial| driver.drive(b, 10.0, *dial));
    assert_eq!(a.told(b, 10.0), [dials[2]], "only the last setting counts");
    driver.drive(b, 11.0, dials[1]);
    c.drive(b, 12.0, dials[0]);
    assert_eq!(c.hear(b, 12.0).2, ["driver drives the community's time already: end that first"]);
    assert_eq!(c.clock, [dials[1]], "whoever may not drive is told what time it is");
    assert_eq!(b.dial(), dials[1]);
    c.drive(b, 12.0, None);
    assert_eq!(b.dial(), dials[1], "and cannot end it");
    let mut late = Speaker::new(b, 12.0, "late");
    late.register(b, 12.0, "DB_TIME", "*", 0.0);
    b.tick(12.0);
    let (heard, ..) = late.hear(b, 12.0);
    assert_eq!(heard.last().map(|h| &h.value[..]), Some(&504.0_f64.to_le_bytes()[..]));
    driver.drive(b, 13.0, None);
    assert_eq!((a.told(b, 13.0), b.dial()), (vec![None], None));
    c.drive(b, 14.0, dials[0]);
    assert_eq!((a.told(b, 14.0), b.dial()), (vec![dials[0]], dials[0]), "then another may");
    b.disconnect(15.0, c.id, 0, false);
    assert_eq!((a.told(b, 15.0), b.dial()), (vec![None], None), "time does not stay with the dead");
}

#[test]
fn a_clock_that_jumps_makes_nobody_wait_and_nobody_forgotten() {
    let b = &mut broker();
    let (driver, mut a, mut c) = (Speaker::new(b, 0.0, "driver"), Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    let leased = Introduction { lease_secs: 10.0, ..Introduction::new("leased") };
    let leased = b.connect(0.0, &leased).unwrap();
    b.disconnect(0.0, leased, 0, false);
    c.register(b, 0.0, "X", "*", 0.5);
    a.text(b, 1.0, "X", "1");
    a.text(b, 1.1, "X", "2");
    for time in [1e9, -1e9] {
        driver.drive(b, 1.2, Some(Dial { at: 1.2, time, rate: 0.0 }));
        b.tick(1.2);
        assert!(b.is_expected("leased"));
        assert!(!b.holds_back(1.2, a.id));
    }
    assert_eq!(c.texts(b, 1.2), ["1"]);
    b.tick(1.5);
    assert_eq!(c.texts(b, 1.5), ["2"]);
    b.tick(10.0);
    assert!(!b.is_expected("leased"));
}

#[test]
fn after_a_brokers_death_the_clock_is_as_it_was_until_it_is_clear_that_nobody_drives() {
    let dial = Some(Dial { at: 1.0, time: 500.0, rate: 1.0 });
    for comes_back in [true, false] {
        let b = &mut Broker::recover(BrokerConfig::new("test"), 0.0, [], 10.0);
        let (mut a, driver) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "driver"));
        b.tick(9.0);
        assert_eq!(a.told(b, 9.0), []);
        if comes_back {
            driver.drive(b, 9.0, dial);
            assert_eq!(a.told(b, 9.0), [dial]);
        }
        assert!(b.next_deadline() <= 10.0);
        b.tick(10.0);
        assert_eq!(a.told(b, 10.0), if comes_back { vec![] } else { vec![None] });
    }
}

#[test]
fn unregistered_means_silence() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X*", "*", 0.0);
    a.text(b, 0.0, "X1", "1");
    c.registration(b, 0.0, FrameKind::Unregister, "X*", "*", 0.0, 0);
    a.text(b, 0.0, "X1", "2");
    a.text(b, 0.0, "X2", "3");
    assert_eq!(c.texts(b, 0.0), ["1"], "MOOS' wildcard unregister keeps the filter; ours does not");
}

#[test]
fn the_db_variables_are_there() {
    let b = &mut broker();
    let mut c = Speaker::new(b, 0.0, "c");
    c.register(b, 0.0, "DB_*", "*", 0.0);
    b.tick(0.0);
    let keys: BTreeSet<String> = c.hear(b, 0.0).0.into_iter().map(|h| h.key).collect();
    for key in ["DB_CLIENTS", "DB_EVENT", "DB_TIME", "DB_UPTIME", "DB_QOS", "DB_RWSUMMARY", "DB_VARSUMMARY", "DB_DROPS"]
    {
        assert!(keys.contains(key), "{key} is missing from {keys:?}");
    }
}

/// Asks for the table as `of` and reads the answer.
fn table_for(b: &mut Broker, now: f64, of: &mut Speaker) -> CommunityTable {
    of.text(b, now, table::REQUEST, "");
    let heard = of.hear(b, now).0.into_iter().find(|heard| heard.key == table::TABLE.name()).unwrap();
    codec::decode_owned(&heard.value, "CommunityTable").unwrap()
}

#[test]
fn the_table_says_who_is_there_and_what_was_said_to_whom() {
    let b = &mut Broker::new(BrokerConfig::new("test"), 1.0);
    let (mut a, mut c) = (Speaker::new(b, 1.0, "a"), Speaker::new(b, 1.0, "c"));
    c.register(b, 1.0, "X*", "*", 0.5);
    a.say(b, 2.0, "X1", ValueKind::Double, &7.0_f64.to_le_bytes());
    a.text(b, 3.0, "Y", &"y".repeat(3000));
    a.text(b, 3.5, "Y", "last");
    b.tick(4.0);
    let table = table_for(b, 4.0, &mut c);
    assert_eq!((table.community.as_str(), table.started, table.time), ("test", 1.0, 4.0));
    let names: Vec<&str> = table.clients.iter().map(|client| client.name.as_str()).collect();
    assert_eq!(names, ["a", "c"]);
    assert_eq!(
        (table.clients[0].writes.as_slice(), table.clients[0].messages),
        (&["X1".to_owned(), "Y".to_owned()][..], 3)
    );
    let registration = &table.clients[1].registrations[0];
    assert_eq!((registration.key_pattern.as_str(), registration.min_interval_secs), ("X*", 0.5));
    let find = |name: &str| table.variables.iter().find(|v| v.name == name).unwrap();
    let (x, y) = (find("X1"), find("Y"));
    assert_eq!((&x.kind, &x.latest, x.messages, x.bytes), (&VariableKind::Number, &LatestValue::Number(7.0), 1, 8));
    assert_eq!(x.routes, [RouteEntry { source: "a".into(), readers: vec!["c".into()] }]);
    assert_eq!((y.messages, y.bytes, y.latest_bytes, y.written, y.rate_hz), (2, 3004, 4, 3.5, 1.0));
    assert_eq!((y.writer.as_str(), &y.latest), ("a", &LatestValue::Text("last".into())));
    assert!(y.routes[0].readers.is_empty());
    assert!(table.variables.iter().all(|v| !v.name.starts_with("DB_TABLE")), "a question is no variable");
}

#[test]
fn the_table_goes_to_who_asked_alone_and_comes_after_what_was_refused_before() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "*", "*", 0.0);
    c.hear(b, 0.0);
    a.text(b, 0.0, "X", "text");
    a.say(b, 0.0, "X", ValueKind::Double, &1.0_f64.to_le_bytes());
    a.text(b, 0.0, table::REQUEST, "");
    let (heard, _, refused) = a.hear(b, 0.0);
    assert_eq!((heard.len(), refused.len()), (1, 1));
    assert_eq!(c.texts(b, 0.0), ["text"], "a registrant of everything hears neither question nor answer");
}

#[test]
fn a_value_in_shared_memory_counts_with_its_length_and_stays_out_of_the_table() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    let mut batch = Vec::new();
    put_definition(&mut batch, Named::Key, 0, "SCAN", 0);
    put_definition(&mut batch, Named::Type, 0, "Scan", 5);
    let reference = wire::BulkRef { client: a.id, generation: 1, sample: 1, len: 123_456 };
    let header = Header { flags: BULK, value_kind: ValueKind::Binary, sequence: 1, ..Header::new(FrameKind::Notify) };
    put(&mut batch, &header, &[], &reference.to_bytes());
    b.receive(0.0, a.id, &batch).unwrap();
    a.keys.push("SCAN".into());
    let table = table_for(b, 0.0, &mut a);
    let scan = table.variables.iter().find(|v| v.name == "SCAN").unwrap();
    assert_eq!(scan.kind, VariableKind::Typed { name: "Scan".into(), layout: 5 });
    assert_eq!((&scan.latest, scan.bytes, scan.latest_bytes), (&LatestValue::Long, 123_456, 123_456));
}

#[test]
fn a_client_that_speaks_nonsense_is_an_error_not_a_panic() {
    let b = &mut broker();
    let a = Speaker::new(b, 0.0, "a");
    let mut batch = Vec::new();
    put(&mut batch, &Header::new(FrameKind::Notify), &[], &[]);
    assert!(b.receive(0.0, a.id, &batch).is_err(), "key 0 was never defined");
    let mut batch = Vec::new();
    put_definition(&mut batch, Named::Key, 7, "X", 0);
    assert!(b.receive(0.0, a.id, &batch).is_err(), "definitions come in order");
}

fn leased<'a>(name: &'a str, secs: f64) -> Introduction<'a> {
    Introduction { lease_secs: secs, ..Introduction::new(name) }
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

#[test]
fn a_place_is_kept_as_long_as_its_lease() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    let dead = join_ready(b, 0.0, &leased("c", 5.0));
    b.disconnect(1.0, dead.id, 0, false);
    a.text(b, 2.0, "X", "kept");
    b.tick(5.9);
    assert!(b.next_deadline() <= 6.0);
    let mut next = join_ready(b, 5.9, &leased("c", 5.0));
    let heard = next.hear(b, 5.9).0;
    assert_eq!(heard, [Heard { key: "X".into(), source: "a".into(), value: b"kept".into(), latest: false }]);
    b.disconnect(7.0, next.id, 1, false);
    a.text(b, 8.0, "X", "late");
    b.tick(12.0);
    let mut last = join_ready(b, 12.1, &leased("c", 5.0));
    assert!(last.hear(b, 12.1).0[0].latest, "the lease was over: the latest value is all there is");
}

#[test]
fn who_takes_a_place_is_told_what_was_dropped_of_its_mail() {
    let config = BrokerConfig { mailbox_bytes: 10 * 56, ..BrokerConfig::new("test") };
    let b = &mut Broker::new(config, 0.0);
    let mut a = Speaker::new(b, 0.0, "a");
    let mut dead = join_ready(b, 0.0, &leased("c", 5.0));
    let say = |b: &mut Broker, a: &mut Speaker| (0..15).for_each(|i| a.text(b, 0.0, "X", &i.to_string()));
    say(b, &mut a);
    assert_eq!(dead.hear(b, 0.0).1, 5);
    b.disconnect(1.0, dead.id, 10, false);
    say(b, &mut a);
    let (heard, dropped, _) = join_ready(b, 2.0, &leased("c", 5.0)).hear(b, 2.0);
    assert_eq!((heard.len(), dropped), (10, 5), "its predecessor knew of the first five");
}

/// Regression: a map that was killed together with the broker began before its readers had said again what they had of it.
#[test]
fn who_comes_for_a_dead_ones_place_waits_until_the_living_have_said_again_what_they_know() {
    let place = |name: &str| Place { name: name.into(), lease_secs: 0.0, registrations: Vec::new() };
    let returns = |name| Introduction { returns: true, ..Introduction::new(name) };
    for (comes_back, seated_at) in [(true, 1.0), (false, 2.0)] {
        let places = [(place("reader"), true), (place("map"), false)];
        let b = &mut Broker::recover(BrokerConfig::new("test"), 0.0, places, 10.0);
        let mut map = join_ready(b, 0.5, &Introduction::new("map"));
        map.register(b, 0.5, "PLAN", "*", 0.0);
        if comes_back {
            let mut reader = Speaker::with(b.connect(0.6, &returns("reader")).unwrap());
            ready(b, 0.6, reader.id);
            b.tick(0.7);
            assert!(b.is_joining(map.id), "it is back, and has said nothing yet");
            reader.text(b, 0.8, "PLAN", "of revision 44");
            ready(b, 0.9, reader.id);
        }
        assert!(b.next_deadline() <= 2.0);
        b.tick(seated_at - 0.1);
        assert_eq!(b.is_joining(map.id), !comes_back);
        b.tick(seated_at);
        assert!(!b.is_joining(map.id));
        assert_eq!(map.texts(b, seated_at), if comes_back { vec!["of revision 44"] } else { vec![] });
    }
}

#[test]
fn a_name_has_one_holder_and_one_successor_and_only_a_successor_may_come_for_it() {
    let b = &mut broker();
    let holder = join_ready(b, 0.0, &leased("c", 5.0));
    assert_eq!(b.connect(0.0, &leased("c", 0.0)), Err(Refusal::NameTaken("c".into())));
    let successor = Introduction { succeeds: true, ..Introduction::new("c") };
    let next = b.connect(0.0, &successor).unwrap();
    assert_eq!(b.connect(0.0, &successor), Err(Refusal::SuccessorTaken("c".into())));
    assert!(b.take_retiring().is_empty() && !b.holds_back(0.0, next));
    ready(b, 0.0, next);
    assert_eq!(b.take_retiring(), [holder.id]);
    assert!(b.holds_back(0.0, next), "what it says from now on waits until it has its place");
    b.disconnect(0.0, holder.id, 0, true);
    assert!(!b.holds_back(0.0, next));
    assert_eq!(b.client_named("c"), Some(next));
}

#[test]
fn a_recovered_broker_waits_for_those_who_live_and_gives_the_places_of_the_dead_away() {
    let b = &mut broker();
    join_ready(b, 0.0, &leased("lives", 0.0));
    join_ready(b, 0.0, &leased("dead", 5.0));
    let places: Vec<Place> = b.take_places().unwrap();
    assert_eq!(places.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["dead", "lives"]);
    assert!(b.take_places().is_none());
    let places = places.into_iter().map(|place| (place.clone(), place.name == "lives"));
    let b = &mut Broker::recover(BrokerConfig::new("test"), 100.0, places, 10.0);
    let mut a = Speaker::new(b, 100.0, "a");
    a.text(b, 100.0, "X", "before they are back");
    assert_eq!(b.connect(100.0, &Introduction::new("lives")), Err(Refusal::NameTaken("lives".into())));
    let back = Introduction { returns: true, ..Introduction::new("lives") };
    for who in [back, Introduction::new("dead")] {
        let mut one = join_ready(b, 101.0, &who);
        assert_eq!(one.texts(b, 101.0), ["before they are back"], "{}", who.name);
        ready(b, 101.0, one.id); // it has nothing to say again
    }
}

#[test]
fn a_batch_is_handled_when_everybody_it_reached_has_handled_it() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    let (mut c, mut d) = (join_ready(b, 0.0, &leased("c", 0.0)), join_ready(b, 0.0, &leased("d", 5.0)));
    a.text(b, 0.0, "X", "1");
    assert_eq!(b.handled_batches(a.id), 0);
    let handle = |b: &mut Broker, who: &mut Speaker, count: u64| {
        let mut batch = Vec::new();
        b.take_mail(who.id, usize::MAX, &mut batch, |_, _| {});
        b.keep_given(who.id, batch);
        b.note_handled(0.0, who.id, count, &mut Vec::new());
    };
    handle(b, &mut c, 1);
    assert_eq!(b.handled_batches(a.id), 0, "d has not");
    handle(b, &mut d, 0);
    b.disconnect(0.0, d.id, 0, false);
    assert_eq!(b.handled_batches(a.id), 0, "its place is kept, and its mail");
    let mut next = join_ready(b, 0.0, &leased("d", 5.0));
    assert_eq!(b.handled_batches(a.id), 0);
    handle(b, &mut next, 1);
    assert_eq!(b.handled_batches(a.id), 1);
}

/// What happens to a name whose holders come and go.
#[derive(Debug, Clone, Copy)]
enum Turn {
    /// So many messages for it are published.
    Say(u8),
    /// The holder is given what waits.
    Give,
    /// The holder handles so many messages of what it was given.
    Handle(u8),
    /// The holder dies; another takes its place.
    Die,
    /// A successor comes while the holder lives.
    Swap,
}

fn turn() -> impl Strategy<Value = Turn> {
    prop_oneof![
        (1..5_u8).prop_map(Turn::Say),
        Just(Turn::Give),
        (1..6_u8).prop_map(Turn::Handle),
        Just(Turn::Die),
        Just(Turn::Swap),
    ]
}

/// The holders of a name, one after the other, and what they have handled together.
struct Holders {
    speaker: Speaker,
    given: std::collections::VecDeque<String>,
    handled: u64,
    heard: Vec<String>,
}

impl Holders {
    fn give(&mut self, b: &mut Broker) {
        let mut batch = Vec::new();
        b.take_mail(self.speaker.id, usize::MAX, &mut batch, |_, _| {});
        let messages = frames(&batch).map(Result::unwrap).filter(|f| f.header.kind == FrameKind::Notify);
        self.given.extend(messages.map(|f| match f.header.flags & LATEST {
            0 => String::from_utf8(f.value.into()).unwrap(),
            _ => "latest".into(),
        }));
        b.keep_given(self.speaker.id, batch);
    }

    fn handle(&mut self, b: &mut Broker, count: usize) {
        for message in self.given.drain(..count.min(self.given.len())) {
            self.handled += 1;
            self.heard.extend(Some(message).filter(|m| m != "latest"));
        }
        b.note_handled(0.0, self.speaker.id, self.handled, &mut Vec::new());
    }

    fn replace(&mut self, b: &mut Broker, swap: bool) {
        let dead = self.speaker.id;
        let who = Introduction { succeeds: swap, ..leased("c", 5.0) };
        if swap {
            self.speaker = join_ready(b, 0.0, &who);
            assert_eq!(b.take_retiring(), [dead]);
        }
        b.disconnect(0.0, dead, self.handled, swap);
        if !swap {
            self.speaker = join_ready(b, 0.0, &who);
        }
        (self.given, self.handled) = (Default::default(), 0);
    }
}

proptest! {
    /// However the holders of a name die or are exchanged, together they hear everything once and in order.
    #[test]
    fn holders_of_a_name_hear_everything_once(turns in prop::collection::vec(turn(), 1..60)) {
        let b = &mut broker();
        let mut a = Speaker::new(b, 0.0, "a");
        let speaker = join_ready(b, 0.0, &leased("c", 5.0));
        let mut holders = Holders { speaker, given: Default::default(), handled: 0, heard: Vec::new() };
        let mut said = 0;
        for turn in turns {
            match turn {
                Turn::Say(count) => for _ in 0..count {
                    said += 1;
                    a.text(b, 0.0, ["X", "Y"][said % 2], &said.to_string());
                },
                Turn::Give => holders.give(b),
                Turn::Handle(count) => holders.handle(b, count.into()),
                Turn::Die => holders.replace(b, false),
                Turn::Swap => holders.replace(b, true),
            }
        }
        holders.give(b);
        holders.handle(b, usize::MAX);
        prop_assert_eq!(holders.heard, (1..=said).map(|n| n.to_string()).collect::<Vec<_>>());
    }
}

proptest! {
    #[test]
    fn any_bytes_from_a_client_leave_the_broker_standing(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let b = &mut broker();
        let a = Speaker::new(b, 0.0, "a");
        let _ = b.receive(0.0, a.id, &bytes);
        b.tick(10.0);
    }

    /// Whatever is published when, at whatever pace the throttle has: what is heard keeps the order of what was said,
    /// two messages are never closer than the interval, and the last one said is the last one heard.
    #[test]
    fn throttled_mail_is_ordered_spaced_and_complete_at_its_end(
        gaps in prop::collection::vec(0.0..0.4f64, 1..40),
        interval in 0.05..0.5f64,
    ) {
        let b = &mut broker();
        let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
        c.register(b, 0.0, "X", "*", interval);
        let mut heard: Vec<(f64, usize)> = Vec::new();
        let mut listen = |b: &mut Broker, now: f64| {
            b.tick(now);
            heard.extend(c.texts(b, now).iter().map(|t| (now, t.parse::<usize>().unwrap())));
        };
        let mut now = 1.0;
        for (i, gap) in gaps.iter().enumerate() {
            let arrival = now + gap;
            while b.next_deadline() <= arrival {
                let due = b.next_deadline();
                listen(b, due);
            }
            now = arrival;
            a.text(b, now, "X", &i.to_string());
            listen(b, now);
        }
        listen(b, now + interval);
        prop_assert!(heard.windows(2).all(|w| w[0].1 < w[1].1 && w[1].0 - w[0].0 > interval - 1e-9), "{:?}", heard);
        prop_assert_eq!(heard.last().unwrap().1, gaps.len() - 1);
    }
}
