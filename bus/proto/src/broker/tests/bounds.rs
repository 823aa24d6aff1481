//! What clients cannot make a broker do: hold without bound, mix up types, speak in its name.

use std::collections::BTreeSet;

use super::super::state::message::Message;
use super::*;
use crate::wire::{BULK, BulkRef, TYPED};

impl Speaker {
    /// Registers for `key` as a reader of values of type `name`.
    fn expect(&self, broker: &mut Broker, key: &str, name: &str) {
        let mut batch = Vec::new();
        put_definition(&mut batch, Named::Type, 0, name, 7, "");
        let header = Header { flags: TYPED, value_kind: ValueKind::Binary, ..Header::new(FrameKind::Register) };
        put(&mut batch, &header, key.as_bytes(), b"*");
        broker.receive(0.0, self.id, &batch).unwrap();
    }

    /// Publishes a value of type `name`.
    fn typed(&mut self, broker: &mut Broker, key: &str, name: &str) {
        let mut batch = Vec::new();
        put_definition(&mut batch, Named::Type, 0, name, 7, "");
        broker.receive(0.0, self.id, &batch).unwrap();
        self.say(broker, 0.0, key, ValueKind::Binary, b"value");
    }

    /// Publishes a reference to its bulk sample of this number.
    fn bulk(&mut self, broker: &mut Broker, key: &str, sample: u64) {
        self.refer(broker, key, BulkRef { client: self.id, generation: 0, sample, len: 20_000 });
    }

    fn refer(&mut self, broker: &mut Broker, key: &str, reference: BulkRef) {
        let number = self.keys.iter().position(|k| k == key).unwrap_or_else(|| {
            self.text(broker, 0.0, key, "first");
            self.keys.len() - 1
        });
        self.sequence += 1;
        let (key, sequence) = (number as u32, self.sequence);
        let header =
            Header { value_kind: ValueKind::Text, flags: BULK, key, sequence, ..Header::new(FrameKind::Notify) };
        let mut batch = Vec::new();
        put(&mut batch, &header, &[], &reference.to_bytes());
        broker.receive(0.0, self.id, &batch).unwrap();
    }
}

/// Regression: 2,000 names of 64 kB filled 1.5 GB.
#[test]
fn names_are_bounded_in_length_number_and_sum() {
    let long = "x".repeat(300);
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    a.text(b, 0.0, &long, "1");
    a.text(b, 0.0, &long, "2");
    a.text(b, 0.0, "X", "3");
    let (_, _, refused) = a.hear(b, 0.0);
    assert_eq!(refused, ["a name of 300 bytes; at most 256 are allowed"], "said once");
    assert!(b.names.keys.known(&long).is_none() && b.names.keys.known("X").is_some());

    let b = &mut bounded(|limits| limits.variables = 12);
    let mut a = Speaker::new(b, 0.0, "a");
    let mut c = Speaker::new(b, 0.0, "c");
    c.register(b, 0.0, "K*", "*", 0.0);
    (0..20).for_each(|i| a.text(b, 0.0, &format!("K{i}"), "1"));
    let (_, _, refused) = a.hear(b, 0.0);
    assert_eq!(b.names.keys.len(), 12);
    assert!(!refused.is_empty() && refused.iter().all(|reason| reason.contains("12 variables already")), "{refused:?}");
    assert_eq!(c.texts(b, 0.0).len(), 20 - refused.len(), "the others arrive");

    let b = &mut bounded(|limits| limits.all_name_bytes = 1000);
    let mut a = Speaker::new(b, 0.0, "a");
    (0..20).for_each(|i| a.text(b, 0.0, &format!("{i:0>100}"), "1"));
    assert!(a.hear(b, 0.0).2.iter().all(|reason| reason.contains("fill 1000 bytes already")));
    assert!(b.names.keys.bytes() <= 1000);
}

#[test]
fn a_client_that_only_listens_takes_no_name_and_there_are_only_so_many_clients() {
    let b = &mut bounded(|limits| (limits.clients, limits.other_names) = (3, 3));
    for i in 0..100 {
        let scope = Speaker::new(b, 0.0, &format!("scope-{i}"));
        scope.register(b, 0.0, "*", "*", 0.0);
        b.disconnect(0.0, scope.id, 0, true);
    }
    let all = ["a", "b", "c"].map(|name| Speaker::new(b, 0.0, name));
    let refused = b.connect(0.0, &Introduction::new("d")).unwrap_err();
    assert_eq!(refused.to_string(), "the community has 3 clients already, and no more are allowed");
    b.disconnect(0.0, all[0].id, 0, true);
    assert!(b.connect(0.0, &Introduction::new("d")).is_ok());
}

#[test]
fn latest_values_messages_and_registrations_are_bounded() {
    let b = &mut bounded(|limits| (limits.latest_bytes, limits.message_bytes) = (100_000, 60_000));
    let mut a = Speaker::new(b, 0.0, "a");
    a.text(b, 0.0, "LONG", &"x".repeat(70_000));
    (0..10).for_each(|i| a.text(b, 0.0, &format!("K{i}"), &"x".repeat(30_000)));
    let (_, _, refused) = a.hear(b, 0.0);
    assert!(refused[0].contains("at most 60000 travel in a batch"), "{refused:?}");
    assert!(refused[1..].iter().all(|reason| reason.contains("fill 100000 bytes already")), "{refused:?}");
    assert!(refused.len() > 6 && b.variables.latest_bytes <= 100_000);
    // What is there may get smaller, and as large again.
    a.text(b, 0.0, "K0", "short");
    a.text(b, 0.0, "K0", &"x".repeat(30_000));
    assert!(a.hear(b, 0.0).2.is_empty());
    assert_eq!(b.variables.latest_bytes, b.variables.iter().map(|v| v.latest.len()).sum::<usize>());

    let b = &mut bounded(|limits| limits.registration_bytes = 1000);
    let mut c = Speaker::new(b, 0.0, "c");
    (0..100).for_each(|i| c.register(b, 0.0, &format!("K{i}"), "*", 0.0));
    let (_, _, refused) = c.hear(b, 0.0);
    assert!(refused.len() > 80 && refused[0].contains("registrations of the community fill 1000 bytes"), "{refused:?}");

    let b = &mut broker();
    let mut c = Speaker::new(b, 0.0, "c");
    c.register(b, 0.0, &"x".repeat(257), "*", 0.0);
    c.register(b, 0.0, "*", &"x".repeat(300), 0.0);
    c.register(b, 0.0, &"x".repeat(256), "*", 0.0);
    let refused = [257, 300].map(|bytes| format!("a pattern of {bytes} bytes; at most 256 are allowed"));
    assert_eq!(c.hear(b, 0.0).2, refused);
}

/// Regression: of a hundred thousand patterns each cost a little of every new variable, and everybody waited for seconds.
#[test]
fn registrations_by_pattern_are_bounded() {
    let b = &mut bounded(|limits| limits.patterns = 100);
    let mut c = Speaker::new(b, 0.0, "c");
    (0..50).for_each(|i| c.register(b, 0.0, &format!("K{i}*"), "*", 0.0));
    (0..50).for_each(|i| c.register(b, 0.0, "K", &format!("app{i}"), 0.0));
    assert_eq!(c.hear(b, 0.0).2, [""; 0]);
    let mut d = Speaker::new(b, 0.0, "d");
    d.register(b, 0.0, "?", "*", 0.0);
    d.register(b, 0.0, "K", "app1", 0.0);
    let (_, _, refused) = d.hear(b, 0.0);
    assert_eq!(refused, ["the community has 100 registrations by pattern already"; 2]);
    // One variable by its name is none of them, and what is there may be changed.
    d.register(b, 0.0, "K", "*", 0.0);
    c.register(b, 0.0, "K1*", "*", 0.5);
    assert_eq!((c.hear(b, 0.0).2, d.hear(b, 0.0).2), (vec![], vec![]));
    c.registration(b, 0.0, FrameKind::Unregister, "K1*", "*", 0.0, 0);
    d.register(b, 0.0, "?", "*", 0.0);
    assert_eq!(d.hear(b, 0.0).2, [""; 0]);
    b.disconnect(0.0, c.id, 0, true);
    (0..99).for_each(|i| d.register(b, 0.0, &format!("L{i}*"), "*", 0.0));
    assert_eq!(d.hear(b, 0.0).2, [""; 0]);
}

/// A client that sends nothing but what is refused, and reads nothing, gets no more than so many answers.
#[test]
fn refusals_are_bounded() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    a.text(b, 0.0, "X", "a text");
    (0..10_000).for_each(|_| a.say(b, 0.0, "X", ValueKind::Double, &[0; 8]));
    assert!(b.sessions.clients[&a.id].mailbox.notice_bytes() < 70_000);
    assert!(a.hear(b, 0.0).2.len() > 100);
}

/// Regression: a late reader of 100,000 variables lost a quarter of them.
#[test]
fn a_late_reader_is_given_all_latest_values_however_many() {
    for flags in [0, LOSSLESS] {
        let b = &mut Broker::new(BrokerConfig { mailbox_bytes: 10_000, ..BrokerConfig::new("test") }, 0.0);
        let mut a = Speaker::new(b, 0.0, "a");
        (0..5000).for_each(|i| a.text(b, 0.0, &format!("K{i}"), "old"));
        let mut c = Speaker::new(b, 0.0, "c");
        c.registration(b, 0.0, FrameKind::Register, "K*", "*", 0.0, flags);
        assert!(b.sessions.clients[&c.id].mailbox.waiting() <= 10_000);
        a.text(b, 0.0, "K4000", "new");
        let mut heard = Vec::new();
        while !b.sessions.clients[&c.id].mailbox.is_empty() {
            let mut batch = Vec::new();
            b.take_mail(c.id, 2000, &mut batch, |_, _| {});
            assert!(batch.len() < 3000, "a batch is no larger for it");
            heard.extend(frames(&batch).map(Result::unwrap).filter(|f| f.header.kind == FrameKind::Notify).map(|f| {
                assert_ne!(f.header.flags & LATEST == 0, f.value == b"old");
                (f.header.key, f.value.to_vec())
            }));
            b.keep_given(c.id, batch);
            b.note_handled(0.0, c.id, heard.len() as u64, &mut Vec::new());
        }
        let keys: BTreeSet<u32> = heard.iter().map(|(key, _)| *key).collect();
        assert_eq!(keys.len(), 5000);
        assert_eq!(heard.iter().filter(|(_, value)| value == b"new").count(), 1);
        // Who asked for everything is given the old value, too.
        assert_eq!(heard.len(), 5000 + usize::from(flags == LOSSLESS));
        assert_eq!(c.hear(b, 0.0).1, 0, "nothing was dropped");
    }
}

/// Bulk values that come for one who is dead are copied: until its successor comes they may be gone where they lay.
#[test]
fn mail_of_the_dead_holds_the_values_themselves() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    let c = b.connect(0.0, &Introduction { lease_secs: 5.0, ..Introduction::new("c") }).unwrap();
    Speaker::with(c).register(b, 0.0, "X", "*", 0.0);
    a.bulk(b, "X", 1);
    let values = ["", "1", "2", "3", "4"];
    let value = |reference: BulkRef| Some(values[reference.sample as usize].as_bytes());
    resolve(b, value);
    assert!(wire::is_bulk(&b.sessions.clients[&c].mailbox.clone_mail()[56..]), "who lives reads it in place");
    b.disconnect(1.0, c, 0, false);
    resolve(b, value);
    (2..5).for_each(|sample| {
        a.bulk(b, "X", sample);
        resolve(b, value);
    });
    let mut next = Speaker::with(b.connect(2.0, &Introduction::new("c")).unwrap());
    next.register(b, 2.0, "X", "*", 0.0);
    let mut ready = Vec::new();
    put(&mut ready, &Header::new(FrameKind::Ready), &[], &[]);
    b.receive(2.0, next.id, &ready).unwrap();
    assert_eq!(next.texts(b, 2.0), ["first", "1", "2", "3", "4"]);
}

#[test]
fn the_latest_value_of_one_who_is_gone_is_forgotten_when_there_is_no_room_for_it() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    a.bulk(b, "X", 3);
    assert!(b.is_latest_bulk(a.id, 3));
    assert_eq!(b.forget_latest_bulk(a.id, 3), ["X"]);
    let mut c = Speaker::new(b, 0.0, "c");
    c.register(b, 0.0, "X", "*", 0.0);
    assert!(c.hear(b, 0.0).0.is_empty());
    assert_eq!(b.variables.latest_bytes, b.variables.iter().map(|v| v.latest.len()).sum::<usize>());
}

#[test]
fn nobody_speaks_in_the_brokers_name() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    let mut c = Speaker::new(b, 0.0, "c");
    c.register(b, 0.0, "DB_CLIENTS", "a", 0.0);
    a.text(b, 0.0, "DB_CLIENTS", "nobody,");
    a.text(b, 0.0, "DB_NEW", "x");
    let refused = "DB_* are written by the broker alone";
    assert_eq!(a.hear(b, 0.0).2, [refused, refused]);
    assert!(c.hear(b, 0.0).0.is_empty());
}

/// Regression: a text that was first under a name took it from those who read a type there, and ended them.
#[test]
fn a_reader_with_a_type_keeps_others_from_writing_something_else_first() {
    let b = &mut broker();
    let (mut good, mut bad) = (Speaker::new(b, 0.0, "good"), Speaker::new(b, 0.0, "bad"));
    let mut reader = Speaker::new(b, 0.0, "reader");
    reader.expect(b, "PLAN", "Plan");
    bad.text(b, 0.0, "PLAN", "go");
    assert_eq!(bad.hear(b, 0.0).2, ["reader reads PLAN as Plan (layout 0000000000000007); texts was refused"]);
    good.typed(b, "PLAN", "Plan");
    assert_eq!(reader.hear(b, 0.0).0.len(), 1);
}

#[test]
fn a_text_that_was_first_yields_to_a_reader_with_a_type_and_both_ends_are_told() {
    let b = &mut broker();
    let (mut good, mut bad) = (Speaker::new(b, 0.0, "good"), Speaker::new(b, 0.0, "bad"));
    bad.text(b, 0.0, "PLAN", "go");
    let mut reader = Speaker::new(b, 0.0, "reader");
    reader.expect(b, "PLAN", "Plan");
    let said = "PLAN carries texts, by bad; reader reads it as Plan (layout 0000000000000007): what was written is \
                forgotten, and no more of it is taken";
    let (heard, _, told) = reader.hear(b, 0.0);
    assert_eq!((heard.len(), told), (0, vec![said.to_owned()]));
    assert_eq!(bad.hear(b, 0.0).2, [said]);
    good.typed(b, "PLAN", "Plan");
    assert_eq!((reader.hear(b, 0.0).0.len(), good.hear(b, 0.0).2.len()), (1, 0));
    bad.text(b, 0.0, "PLAN", "go");
    assert_eq!(bad.hear(b, 0.0).2.len(), 1);
}

#[test]
fn what_a_reader_expects_yields_to_no_other_and_a_type_to_none() {
    let b = &mut broker();
    let mut writer = Speaker::new(b, 0.0, "writer");
    writer.typed(b, "PLAN", "Plan");
    let mut reader = Speaker::new(b, 0.0, "reader");
    let mut early = Speaker::new(b, 0.0, "early");
    early.expect(b, "NEW_PLAN", "OldPlan");
    writer.typed(b, "NEW_PLAN", "Plan");
    let told = writer.hear(b, 0.0).2;
    assert!(told.len() == 1 && told[0].contains("early reads it as OldPlan (layout"), "{told:?}");
    let told = early.hear(b, 0.0).2;
    assert!(
        told[0].contains("NEW_PLAN carries Plan (layout") && told[0].contains("by writer: this reader cannot read it"),
        "{told:?}"
    );
    reader.expect(b, "PLAN", "OldPlan");
    let (told, said) = (reader.hear(b, 0.0).2, "this reader cannot read it: build both from one version");
    assert!(told[0].contains(said) && writer.hear(b, 0.0).2[0].contains(said), "{told:?}");
    writer.say(b, 0.0, "PLAN", ValueKind::Binary, b"value");
    assert!(writer.hear(b, 0.0).2.is_empty());

    // A writer and a reader who agree take a variable over that nobody reads as it is.
    let (mut honest, mut sensor) = (Speaker::new(b, 0.0, "honest"), Speaker::new(b, 0.0, "sensor"));
    let mut stranger = Speaker::new(b, 0.0, "stranger");
    stranger.typed(b, "POSE", "Stranger");
    honest.typed(b, "POSE", "Pose");
    assert!(honest.hear(b, 0.0).2[0].contains("POSE carries Stranger (layout"));
    sensor.expect(b, "POSE", "Pose");
    sensor.hear(b, 0.0);
    honest.hear(b, 0.0);
    honest.say(b, 0.0, "POSE", ValueKind::Binary, b"value");
    assert_eq!((sensor.hear(b, 0.0).0.len(), honest.hear(b, 0.0).2.len()), (1, 0));
    stranger.say(b, 0.0, "POSE", ValueKind::Binary, b"value");
    assert!(stranger.hear(b, 0.0).2.iter().any(|said| said.contains("POSE carries Pose (layout")));

    let mut person = Speaker::new(b, 0.0, "person");
    let texts = Header { flags: TYPED, value_kind: ValueKind::Text, ..Header::new(FrameKind::Register) };
    let mut batch = Vec::new();
    put(&mut batch, &texts, b"MOTION", b"*");
    b.receive(0.0, person.id, &batch).unwrap();
    writer.say(b, 0.0, "MOTION", ValueKind::Double, &[0; 8]);
    assert_eq!(writer.hear(b, 0.0).2, ["person reads MOTION as texts; numbers was refused"]);
    writer.text(b, 0.0, "MOTION", "pause");
    let reader = Speaker::new(b, 0.0, "late");
    reader.expect(b, "MOTION", "Motion");
    writer.text(b, 0.0, "MOTION", "run");
    assert_eq!(person.texts(b, 0.0), ["pause", "run"]);
}

/// Regression: values were copied whole before anybody looked whether there was room, and one that had none drove out all
/// other mail.
#[test]
fn a_value_that_has_no_room_in_the_mail_of_the_dead_is_not_copied() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    let c = b.connect(0.0, &Introduction { lease_secs: 5.0, ..Introduction::new("c") }).unwrap();
    Speaker::with(c).register(b, 0.0, "X", "*", 0.0);
    let mailbox = |b: &mut Broker| b.sessions.clients[&c].mailbox.clone_mail();
    b.sessions.clients.get_mut(&c).unwrap().mailbox.set_limit(2000);
    b.disconnect(1.0, c, 0, false);
    let (short, long) = (vec![1; 500], vec![2; 2000]);
    for sample in 1..4 {
        a.bulk(b, "X", sample);
        resolve(b, |reference| Some(if reference.sample == 2 { &long } else { &short }));
    }
    let mail = mailbox(b);
    let messages = wire::frames(&mail).map_while(Result::ok).filter(|frame| frame.header.kind == FrameKind::Notify);
    let kept: Vec<_> = messages.map(|frame| (wire::is_bulk(frame.bytes), frame.value.len())).collect();
    assert_eq!(kept[kept.len() - 3..], [(false, 500), (true, size_of::<BulkRef>()), (false, 500)], "{kept:?}");
}

/// A description that is none, or of another layout, would have every reader of the type see what is not there.
#[test]
fn a_type_that_is_not_what_it_is_said_to_be_is_refused() {
    let b = &mut broker();
    let text = crate::types::TypeRef::of::<super::super::table::TypeEntry>().text();
    let layout = <super::super::table::TypeEntry as crate::Payload>::LAYOUT;
    for (layout, text, said) in [
        (7, "{}", "this describes no type"),
        (7, text.as_str(), "the description of Theirs is of layout"),
        (layout, &text[1..], "this describes no type"),
    ] {
        let mut liar = Speaker::new(b, 0.0, "liar");
        let mut batch = Vec::new();
        put_definition(&mut batch, Named::Type, 0, "Theirs", layout, text);
        b.receive(0.0, liar.id, &batch).unwrap();
        let told = liar.hear(b, 0.0).2;
        assert!(told.len() == 1 && told[0].contains(said), "{told:?}");
        b.disconnect(0.0, liar.id, 0, true);
    }
    assert_eq!(b.names.types.len(), 0);
}

#[test]
fn a_build_is_kept_as_people_read_it_however_often_it_is_said() {
    let b = &mut broker();
    let build = format!("elk\u{1b}[2J {}", "é".repeat(1 << 15));
    let mut counted = Vec::new();
    for _ in 0..3 {
        let mut client =
            Speaker::with(b.connect(0.0, &Introduction { build: &build, ..Introduction::new("a") }).unwrap());
        client.text(b, 0.0, "X", "said");
        let kept = &b.sessions.clients[&client.id].build;
        assert!(kept.chars().count() == 64 && kept.starts_with("elk[2J é"), "{kept:?}");
        counted.push(b.names.bytes());
        b.disconnect(0.0, client.id, 0, true);
    }
    assert_eq!(counted, [counted[0]; 3]);
    // Where there is no room left for it, its name has none.
    let b = &mut broker();
    let mut client = Speaker::with(b.connect(0.0, &Introduction { build: &build, ..Introduction::new("a") }).unwrap());
    b.config.limits.all_name_bytes = b.names.bytes() + "aX".len();
    client.text(b, 0.0, "X", "said");
    assert_eq!((b.names.bytes(), client.hear(b, 0.0).2.len()), (b.config.limits.all_name_bytes, 0));
}

/// Regression: it was refused as a further type, and its name counted once more.
#[test]
fn a_description_that_comes_late_is_no_further_name() {
    let text = crate::types::TypeRef::of::<super::super::table::TypeEntry>().text();
    let layout = <super::super::table::TypeEntry as crate::Payload>::LAYOUT;
    for (room, is_taken) in [(text.len(), true), (text.len() - 1, false)] {
        let b = &mut bounded(|limits| limits.other_names = 1);
        for description in ["", text.as_str()] {
            let client = Speaker::new(b, 0.0, if description.is_empty() { "first" } else { "second" });
            let mut batch = Vec::new();
            put_definition(&mut batch, Named::Type, 0, "Theirs", layout, description);
            b.receive(0.0, client.id, &batch).unwrap();
            b.config.limits.all_name_bytes = b.names.bytes() + room;
        }
        assert_eq!(b.names.types.is_described(0), is_taken);
    }
}

/// Regression: a sum of what a client had lost and what it said that it had overflowed.
#[test]
fn whoever_has_missed_more_than_can_be_counted_ends_no_broker() {
    let b = &mut Broker::new(BrokerConfig { mailbox_bytes: 200, ..BrokerConfig::new("test") }, 0.0);
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 0.0);
    (0..10).for_each(|i| a.text(b, 0.0, "X", &i.to_string()));
    b.note_missed(c.id, u64::MAX);
    b.note_missed(c.id, u64::MAX);
    b.tick(3.0);
    c.text(b, 3.0, "DB_TABLE_REQUEST", "");
    assert!(!c.hear(b, 3.0).0.is_empty());
}

/// Regression: who was referred to another's value let go of all that it had not read of that one's.
#[test]
fn nobody_refers_to_another_s_values() {
    let b = &mut broker();
    let (mut a, c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    c.register(b, 0.0, "X", "*", 0.0);
    a.bulk(b, "X", 1);
    let own = BulkRef { client: a.id, generation: 0, sample: 2, len: 20_000 };
    for lie in [BulkRef { client: c.id, ..own }, BulkRef { len: 1 << 31, ..own }] {
        a.refer(b, "X", lie);
    }
    a.refer(b, "X", own);
    let refused = "it refers to a value that cannot be one of its publisher's";
    assert_eq!(a.hear(b, 0.0).2, [refused, refused]);
    assert_eq!(b.sessions.clients[&c.id].mailbox.pushed(), 3, "a text, and the references to what is a's");
}

/// Regression: a variable that had a long value once kept its room.
#[test]
fn variables_that_were_long_once_take_no_room() {
    let b = &mut broker();
    let mut a = Speaker::new(b, 0.0, "a");
    for i in 0..100 {
        a.text(b, 0.0, &format!("K{i}"), &"x".repeat(4000));
        a.text(b, 0.0, &format!("K{i}"), "x");
    }
    let room: usize = b.variables.iter().map(|v| v.latest.capacity()).sum();
    assert!(room < 50_000 && b.variables.latest_bytes < 20_000, "{room}");
}

/// Regression: each reader with an interval had a copy of each variable's value, however large.
#[test]
fn what_waits_for_an_interval_is_bounded() {
    let b = &mut bounded(|limits| limits.pending_bytes = 100_000);
    let mut a = Speaker::new(b, 0.0, "a");
    let mut readers: Vec<_> = (0..10).map(|i| Speaker::new(b, 0.0, &format!("c{i}"))).collect();
    readers.iter().for_each(|c| c.register(b, 0.0, "X", "*", 100.0));
    for value in ["1", "2", "3"] {
        a.text(b, 0.0, "X", &value.repeat(20_000));
    }
    assert!(
        b.variables.pending_bytes <= 100_000 && b.variables.due.len() == 4,
        "{} bytes, {}",
        b.variables.pending_bytes,
        b.variables.due.len()
    );
    let last = |heard: Vec<String>| heard.last().map(|text| text[..1].to_owned());
    let first: Vec<_> = readers.iter_mut().map(|c| last(c.texts(b, 0.0))).collect();
    b.tick(101.0);
    let then: Vec<_> = readers.iter_mut().map(|c| last(c.texts(b, 101.0))).collect();
    for (first, then) in first.iter().zip(&then) {
        assert_eq!(then.as_ref().or(first.as_ref()).unwrap(), "3", "the newest comes, at once or in time");
    }
    assert_eq!((b.variables.pending_bytes, b.variables.due.len()), (0, 0));
    // Whoever goes, or registers anew, leaves nothing that waits.
    a.text(b, 102.0, "X", "4");
    assert!(b.variables.pending_bytes > 0);
    b.disconnect(102.0, readers[0].id, 0, true);
    readers[1..].iter().for_each(|c| c.register(b, 102.0, "X", "*", 0.0));
    assert_eq!((b.variables.pending_bytes, b.variables.due.len()), (0, 0));
}

/// Regression: a client's numbers for names were counted by nobody, not even those for names that were refused.
#[test]
fn numbers_for_names_are_bounded() {
    let b = &mut bounded(|limits| (limits.numbers_of_a_client, limits.numbers) = (100, 150));
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    for speaker in [&mut a, &mut c] {
        let mut batch = Vec::new();
        (0..1000).for_each(|number| put_definition(&mut batch, Named::Key, number, "X", 0, ""));
        b.receive(0.0, speaker.id, &batch).unwrap();
        speaker.keys = vec!["X".into(); 1000];
    }
    let given = |b: &Broker| b.sessions.clients.values().flat_map(|c| &c.numbers).map(Vec::len).sum::<usize>();
    assert!(given(b) <= 152, "{}", given(b));
    assert!(b.sessions.clients[&a.id].given_numbers() <= 101, "some are left for the others");
    assert_eq!(given(b), b.sessions.numbers);
    let told = a.hear(b, 0.0).2;
    assert_eq!(told, ["so many names are in use that no more are taken from this client"]);
    let header = Header { key: 999, ..Header::new(FrameKind::Notify) };
    let mut batch = Vec::new();
    put(&mut batch, &header, &[], b"of no known name");
    a.text(b, 0.0, "X", "of the first");
    b.receive(0.0, a.id, &batch).unwrap();
    c.register(b, 0.0, "X", "*", 0.0);
    assert_eq!(c.texts(b, 0.0), ["of the first"]);
}

/// Regression: so many readers of so many variables were counted by nobody.
#[test]
fn who_gets_what_is_bounded() {
    let b = &mut bounded(|limits| limits.deliveries = 100);
    let mut a = Speaker::new(b, 0.0, "a");
    let mut readers: Vec<_> = (0..30).map(|i| Speaker::new(b, 0.0, &format!("c{i}"))).collect();
    readers.iter().for_each(|c| c.register(b, 0.0, "K*", "*", 0.0));
    (0..20).for_each(|i| a.text(b, 0.0, &format!("K{i}"), "1"));
    let count = |b: &Broker| b.variables.iter().flat_map(|v| &v.routes).map(|r| r.deliveries.len()).sum::<usize>();
    assert_eq!((count(b), b.variables.deliveries), (90, 90));
    let refused = a.hear(b, 0.0).2;
    assert!(refused.len() == 17 && refused[0].contains("pairs of variable and source already"), "{refused:?}");
    let late = Speaker::new(b, 0.0, "late");
    (0..3).for_each(|_| late.register(b, 0.0, "K*", "*", 0.0));
    (0..8).for_each(|i| late.register(b, 0.0, "K1", &format!("a{}", "*".repeat(i)), 0.0));
    assert_eq!((count(b), b.variables.deliveries), (93, 93));
    (0..9).for_each(|i| {
        let one = Speaker::new(b, 0.0, &format!("late-{i}"));
        one.register(b, 0.0, "K1", "*", 0.0);
        readers.push(one);
    });
    assert_eq!((count(b), b.variables.deliveries), (100, 100));
    let told = readers.last_mut().unwrap().hear(b, 0.0).2;
    assert_eq!(told, ["the readers of the community get 100 variables already, all together"]);
    let again = &mut readers[0];
    again.hear(b, 0.0);
    again.register(b, 0.0, "K1", "a", 0.0);
    assert_eq!(again.hear(b, 0.0).2, [""; 0], "what it gets already is no more than before");
    b.disconnect(0.0, late.id, 0, true);
    readers.drain(30..).for_each(|c| b.disconnect(0.0, c.id, 0, true));
    readers.drain(..10).for_each(|c| b.disconnect(0.0, c.id, 0, true));
    let mut batch = Vec::new();
    put(&mut batch, &Header::new(FrameKind::Unregister), b"K*", b"*");
    readers.drain(..10).for_each(|c| b.receive(0.0, c.id, &batch).unwrap());
    assert_eq!((count(b), b.variables.deliveries), (30, 30));
}

/// Regression: what was remembered of batches that somebody had not handled grew with the readers.
#[test]
fn what_is_remembered_of_batches_is_bounded() {
    let b = &mut bounded(|limits| limits.unhandled_bytes = 80_000);
    let mut a = Speaker::new(b, 0.0, "a");
    let readers: Vec<_> = (0..80).map(|i| Speaker::new(b, 0.0, &format!("c{i}"))).collect();
    readers.iter().for_each(|c| c.register(b, 0.0, "X", "*", 0.0));
    (0..1000).for_each(|_| a.text(b, 0.0, "X", "1"));
    let client = &b.sessions.clients[&a.id];
    let remembered: usize = client.unhandled.iter().map(|(_, reached)| size_of_val(&**reached)).sum();
    assert!(remembered <= client.unhandled_bytes && client.unhandled_bytes <= 1000, "{remembered}");
    (0..10).for_each(|_| assert!(b.handled_batches(a.id) <= 1000));
}

/// Regression: every reader's mailbox had room for any one message.
#[test]
fn messages_larger_than_mailboxes_are_bounded() {
    let b = &mut bounded(|limits| (limits.mail_bytes, limits.oversize_bytes) = (100_000, 1_000_000));
    let mut a = Speaker::new(b, 0.0, "a");
    let readers: Vec<_> = (0..20).map(|i| Speaker::new(b, 0.0, &format!("c{i}"))).collect();
    readers.iter().for_each(|c| c.register(b, 0.0, "X", "*", 0.0));
    for round in 0..3 {
        a.text(b, 0.0, "X", &"x".repeat(300_000));
        let waiting: usize = b.sessions.clients.values().map(|client| client.mailbox.waiting()).sum();
        assert!(waiting + b.sessions.given_bytes < 2_000_000, "{waiting}");
        for c in &readers {
            let mut batch = Vec::new();
            b.take_mail(c.id, 1 << 16, &mut batch, |_, _| {});
            b.keep_given(c.id, batch);
        }
        assert!(b.sessions.given_bytes < 2_000_000, "{round}: {}", b.sessions.given_bytes);
    }
    a.text(b, 0.0, "X", "short");
    let lost: u64 = b.sessions.clients.values().map(|client| client.mailbox.lost()).sum();
    assert!(lost > 30, "{lost}");
    assert!(readers.iter().all(|c| b.sessions.clients[&c.id].mailbox.waiting() > 0), "what is short comes");
    readers.iter().for_each(|c| b.disconnect(0.0, c.id, 0, true));
    assert_eq!((b.sessions.given_bytes, b.variables.deliveries), (0, 0));
}

/// Regression: two clients a name could each say a mailbox full before they had their session.
#[test]
fn what_is_said_before_its_time_is_bounded() {
    let b = &mut bounded(|limits| limits.mail_bytes = 100_000);
    let _holder = Speaker::new(b, 0.0, "a");
    let mut next = Speaker::with(b.connect(0.0, &Introduction { succeeds: true, ..Introduction::new("a") }).unwrap());
    (0..20).for_each(|_| next.text(b, 0.0, "X", &"x".repeat(20_000)));
    assert!(b.sessions.held_bytes() <= 100_000);
    assert!(next.hear(b, 0.0).2[0].contains("wait for the session of another"));
}

/// Regression: a frame's lengths were taken from where its client could still write.
#[test]
fn what_is_written_over_a_frame_while_it_is_taken_changes_no_length() {
    let mut frame = Vec::new();
    put(&mut frame, &Header::new(FrameKind::Notify), b"aux", b"value");
    let checked = wire::first_frame(&frame).unwrap();
    let mut scribbled = frame.clone();
    scribbled[..48].fill(255);
    let kept = Message::new(checked.header, &Frame { bytes: &scribbled, ..checked }).to_bytes();
    let back = wire::first_frame(&kept).unwrap();
    assert_eq!((back.header, back.aux, back.value), (checked.header, checked.aux, checked.value));
}

/// Regression: a definition or a registration was copied before anybody looked how long it was.
#[test]
fn a_frame_that_is_no_message_is_bounded_before_it_is_copied() {
    let b = &mut broker();
    let long = vec![b'x'; wire::MAX_MESSAGE];
    for kind in [FrameKind::Define, FrameKind::Register] {
        let liar = Speaker::new(b, 0.0, "liar");
        let mut batch = Vec::new();
        put(&mut batch, &Header::new(kind), &long, b"*");
        let said = b.receive(0.0, liar.id, &batch).unwrap_err().to_string();
        assert!(said.contains("longer than messages may be"), "{said}");
        b.disconnect(0.0, liar.id, 0, true);
    }
}

/// Regression: a reader of a type that was refused counted as one that reads something else.
#[test]
fn who_expects_a_type_that_was_refused_expects_nothing() {
    let b = &mut broker();
    let (mut reader, mut writer) = (Speaker::new(b, 0.0, "reader"), Speaker::new(b, 0.0, "writer"));
    let mut batch = Vec::new();
    put_definition(&mut batch, Named::Type, 0, "Theirs", 7, "no description");
    let header = Header { flags: TYPED, value_kind: ValueKind::Binary, ..Header::new(FrameKind::Register) };
    put(&mut batch, &header, b"X", b"*");
    b.receive(0.0, reader.id, &batch).unwrap();
    writer.text(b, 0.0, "X", "a text");
    assert_eq!((reader.texts(b, 0.0), writer.hear(b, 0.0).2), (vec!["a text".to_owned()], vec![]));
}

/// Regression: a message of no possible time made every look at the community's table fail.
#[test]
fn a_message_of_any_time_leaves_a_table_that_can_be_read() {
    let b = &mut broker();
    let (mut a, mut c) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    for time in [f64::NEG_INFINITY, f64::NAN, -1e308, -1e308] {
        let mut batch = Vec::new();
        a.text(b, 0.0, "X", "now");
        put(&mut batch, &Header { time, ..Header::new(FrameKind::Notify) }, &[], b"then");
        b.receive(0.0, a.id, &batch).unwrap();
    }
    c.text(b, 0.0, "DB_TABLE_REQUEST", "");
    let mut batch = Vec::new();
    b.take_mail(c.id, usize::MAX, &mut batch, |_, _| {});
    let table =
        frames(&batch).map_while(Result::ok).find(|frame| frame.header.value_kind == ValueKind::Binary).unwrap();
    let table: super::super::table::CommunityTable =
        crate::codec::decode::<super::super::table::CommunityTable>(table.value).unwrap();
    elk_describe::Describe::check(&table).unwrap();
}
