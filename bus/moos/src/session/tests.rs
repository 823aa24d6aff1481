//! Sessions before a broker, without sockets and without a clock.

use elk_proto::broker::{Broker, BrokerConfig, Carried, Introduction};
use elk_proto::wire::{self, ClientId, Header};

use super::*;
use crate::message::{NO_ID, NO_NUMBER};
use crate::outgoing::Outgoing;
use crate::packet::{Decoder, Event};
use crate::text::Texts;

/// A broker, and clients of MOOS' before it.
struct Town {
    broker: Broker,
    forms: Forms,
    now: f64,
}

struct Citizen {
    id: ClientId,
    session: Session,
}

/// A message as its reader has it.
#[derive(Debug, Clone, PartialEq)]
struct Heard {
    id: i32,
    kind: Kind,
    data: Data,
    source: String,
    aux: String,
    community: String,
    key: String,
    numbers: [f64; 3],
    value: Vec<u8>,
}

impl Town {
    fn new() -> Self {
        Self { broker: Broker::new(BrokerConfig::new("town"), 100.0), forms: Forms::default(), now: 100.0 }
    }

    fn enter(&mut self, name: &str, manner: Manner, any_source: bool) -> Citizen {
        let who = Introduction { inside: true, ..Introduction::new(name) };
        let id = self.broker.connect(self.now, &who).unwrap();
        Citizen { id, session: Session::new(name, manner, 5, any_source, &Texts::default()) }
    }

    fn say(&mut self, who: &mut Citizen, messages: &[Message<'_>]) {
        let mut batch = Vec::new();
        for (index, message) in messages.iter().enumerate() {
            let mut context = Context { id: who.id, broker: &mut self.broker, forms: &mut self.forms };
            if let Some(long) = who.session.take(message, index == 0, &mut context, &mut batch) {
                self.broker.receive(self.now, who.id, &std::mem::take(&mut batch)).unwrap();
                self.broker.receive_message(self.now, who.id, &long).unwrap();
            }
        }
        who.session.end_packet();
        self.broker.receive(self.now, who.id, &batch).unwrap();
    }

    fn packet(&mut self, who: &mut Citizen) -> Option<Vec<u8>> {
        let (mut batch, mut out) = (Vec::new(), Outgoing::default());
        self.broker.take_mail(who.id, usize::MAX, &mut batch, |_, _| {});
        let any = who.session.put_packet(self.now, &batch, &self.broker, &mut self.forms, &mut (), &mut out);
        any.then(|| out.to_bytes(&batch).unwrap())
    }

    fn hear(&mut self, who: &mut Citizen) -> Vec<Heard> {
        let Some(packet) = self.packet(who) else { return Vec::new() };
        let mut decoder = Decoder::of_server(1 << 20);
        decoder.extend(&packet);
        let mut heard = Vec::new();
        while let Some(event) = decoder.next_event().unwrap() {
            if let Event::Message { message, .. } = event {
                heard.push(Heard::of(&message));
            }
        }
        heard
    }
}

impl Heard {
    fn of(message: &Message<'_>) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        Self {
            id: message.id,
            kind: message.kind,
            data: message.data,
            source: text(message.source),
            aux: text(message.source_aux),
            community: text(message.community),
            key: text(message.key),
            numbers: [message.time, message.number, message.second],
            value: message.value.to_vec(),
        }
    }
}

fn number(key: &str, number: f64, id: i32) -> Message<'_> {
    Message { id, key: key.as_bytes(), number, time: 99.5, ..Message::new(Kind::NOTIFY, Data::DOUBLE) }
}

fn register(key: &str, interval: f64) -> Message<'_> {
    Message { key: key.as_bytes(), number: interval, ..Message::new(Kind::REGISTER, Data::DOUBLE) }
}

fn keys(heard: &[Heard]) -> Vec<(&str, f64)> {
    heard.iter().map(|one| (one.key.as_str(), one.numbers[1])).collect()
}

#[test]
fn mail_is_unchanged_with_id_both_numbers_aux_and_time() {
    let mut town = Town::new();
    let mut a = town.enter("a", Manner::Asynchronous, false);
    let mut b = town.enter("b", Manner::Asynchronous, false);
    town.say(&mut b, &[register("X", 0.0)]);
    assert_eq!(town.packet(&mut b), None, "nothing has been written: there is no packet without messages");
    let sent = Message { second: 2.5, source: b"a", source_aux: b"left", ..number("X", 1.5, 41) };
    town.say(&mut a, &[sent]);
    let expected = Heard { source: "a".into(), community: "town".into(), ..Heard::of(&sent) };
    assert_eq!(town.hear(&mut b), [expected]);
    // One that is bridged keeps its community, and one without a number has none.
    town.say(&mut a, &[Message { community: b"sea", ..number("X", 2.0, NO_ID) }]);
    let heard = town.hear(&mut b);
    assert_eq!((heard[0].community.as_str(), heard[0].id, heard[0].numbers[2]), ("sea", NO_ID, NO_NUMBER));
}

#[test]
fn whoever_registers_late_is_given_the_latest_value_with_no_id() {
    let mut town = Town::new();
    let mut a = town.enter("a", Manner::Asynchronous, false);
    town.say(&mut a, &[number("X", 1.0, 0), number("X", 2.0, 1)]);
    let mut b = town.enter("b", Manner::Asynchronous, false);
    town.say(&mut b, &[register("X", 0.0)]);
    let heard = town.hear(&mut b);
    assert_eq!((keys(&heard), heard[0].id, heard[0].numbers[0]), (vec![("X", 2.0)], NO_ID, 99.5));
    town.say(&mut a, &[number("X", 3.0, 2)]);
    let unregister = Message { key: b"X", ..Message::new(Kind::UNREGISTER, Data::DOUBLE) };
    assert_eq!(keys(&town.hear(&mut b)), [("X", 3.0)]);
    town.say(&mut b, &[unregister]);
    town.say(&mut a, &[number("X", 4.0, 3)]);
    assert_eq!(town.hear(&mut b), []);
}

#[test]
fn a_publisher_that_subscribes_hears_itself_and_a_throttled_reader_the_last_of_a_burst() {
    let mut town = Town::new();
    let mut a = town.enter("a", Manner::Asynchronous, false);
    let mut b = town.enter("b", Manner::Asynchronous, false);
    town.say(&mut a, &[register("X", 0.0)]);
    town.say(&mut b, &[register("X", 0.5)]);
    for step in 0..12 {
        town.now = 100.0 + f64::from(step) * 0.1;
        town.broker.tick(town.now);
        town.say(&mut a, &[number("X", f64::from(step), step)]);
    }
    assert_eq!(town.hear(&mut a).len(), 12);
    town.now += 0.5;
    town.broker.tick(town.now);
    let heard: Vec<f64> = town.hear(&mut b).iter().map(|one| one.numbers[1]).collect();
    assert_eq!(heard, [0.0, 4.0, 9.0, 11.0], "at most two a second, and the last one too");
}

#[test]
fn patterns_match_variables_and_writers_now_and_later() {
    let mut town = Town::new();
    let mut a = town.enter("pNav", Manner::Asynchronous, false);
    let mut other = town.enter("iGPS", Manner::Asynchronous, false);
    town.say(&mut a, &[number("NAV_X", 1.0, 0), number("DEPTH", 2.0, 1)]);
    let mut b = town.enter("b", Manner::Asynchronous, false);
    let wildcard = Message::new(Kind::WILDCARD_REGISTER, Data::STRING);
    let said = b"AppPattern=p*,VarPattern=NAV_?,Interval=0";
    town.say(&mut b, &[Message { value: said, ..wildcard }]);
    assert_eq!(keys(&town.hear(&mut b)), [("NAV_X", 1.0)]);
    town.say(&mut other, &[number("NAV_Y", 3.0, 0)]);
    town.say(&mut a, &[number("NAV_Y", 4.0, 2), number("NAV_LONG", 5.0, 3)]);
    assert_eq!(keys(&town.hear(&mut b)), [("NAV_Y", 4.0)], "whoever writes it first");
    town.say(&mut b, &[Message { kind: Kind::WILDCARD_UNREGISTER, value: said, ..wildcard }]);
    town.say(&mut a, &[number("NAV_X", 6.0, 4), number("NAV_Z", 7.0, 5)]);
    assert_eq!(town.hear(&mut b), [], "neither what there is nor what is new");
}

#[test]
fn a_sign_of_life_is_answered_first_and_once_with_the_server_s_clock() {
    let mut town = Town::new();
    let mut a = town.enter("a", Manner::Asynchronous, false);
    let timing = Message { key: b"_async_timing", time: 42.0, ..Message::new(Kind::TIMING, Data::DOUBLE) };
    town.say(&mut a, &[timing, register("X", 0.0), number("X", 1.0, 0), timing]);
    let heard = town.hear(&mut a);
    assert_eq!(heard.iter().map(|one| one.kind).collect::<Vec<_>>(), [Kind::TIMING, Kind::NOTIFY]);
    assert_eq!((heard[0].key.as_str(), heard[0].numbers), ("_async_timing", [42.0, 100.0, 0.0]));
    assert!(!a.session.is_owed());
    assert_eq!(town.packet(&mut a), None);
}

#[test]
fn a_synchronous_client_is_answered_packet_for_packet_and_never_unasked() {
    let mut town = Town::new();
    let mut a = town.enter("a", Manner::Asynchronous, false);
    let mut old = town.enter("old", Manner::Synchronous, false);
    assert!(!old.session.may_be_told());
    town.say(&mut old, &[register("X", 0.0)]);
    assert!(old.session.may_be_told() && old.session.is_owed());
    let heard = town.hear(&mut old);
    assert_eq!((heard.len(), heard[0].kind, heard[0].numbers[..2].to_vec()), (1, Kind::NULL, vec![NO_NUMBER, 100.0]));
    town.say(&mut a, &[number("X", 1.0, 0)]);
    assert!(!old.session.may_be_told(), "it has not asked");
    town.say(&mut old, &[Message::new(Kind::NULL, Data::NOT_SET)]);
    let heard = town.hear(&mut old);
    assert_eq!((heard[0].kind, keys(&heard[1..])), (Kind::NULL, vec![("X", 1.0)]));
}

#[test]
fn a_write_of_another_kind_is_refused_and_its_writer_told() {
    let mut town = Town::new();
    let mut a = town.enter("a", Manner::Asynchronous, false);
    town.say(&mut a, &[number("X", 1.0, 0)]);
    let text = Message { key: b"X", value: b"one", time: 99.0, ..Message::new(Kind::NOTIFY, Data::STRING) };
    town.say(&mut a, &[text]);
    assert_eq!(town.hear(&mut a), []);
    let refusals = a.session.take_refusals();
    assert!(refusals.len() == 1 && refusals[0].reason.contains("X carries numbers"), "{refusals:?}");
    let bad = [
        Message { value: b"\xff", key: b"T", ..text },
        Message { key: b"\xff", ..text },
        Message { time: f64::NAN, key: b"T", ..text },
        Message { data: Data::NOT_SET, key: b"T", ..text },
        Message { source_aux: b"\xff", key: b"T", ..text },
        Message { key: &[b'K'; 300], ..text },
    ];
    for message in bad {
        town.say(&mut a, &[message]);
        assert_eq!(a.session.take_refusals().len(), 1, "{message:?}");
    }
    assert!(town.broker.survey().all(|one| one.key != "T"), "nothing of it has come through");
}

#[test]
fn a_client_publishes_under_its_own_name_unless_it_may_do_otherwise() {
    let mut town = Town::new();
    let mut reader = town.enter("reader", Manner::Asynchronous, false);
    town.say(&mut reader, &[register("X", 0.0)]);
    let mut honest = town.enter("honest", Manner::Asynchronous, false);
    let mut player = town.enter("player", Manner::Asynchronous, true);
    town.say(&mut honest, &[Message { source: b"pNav", ..number("X", 1.0, 0) }]);
    town.say(&mut player, &[Message { source: b"pNav", source_aux: b"log", ..number("X", 2.0, 0) }]);
    let heard = town.hear(&mut reader);
    let said: Vec<_> = heard.iter().map(|one| (one.source.as_str(), one.aux.as_str())).collect();
    assert_eq!(said, [("honest", "pNav"), ("pNav", "log")]);
}

#[test]
fn bytes_are_of_the_type_that_their_variable_carries() {
    let mut town = Town::new();
    let elk = town.broker.connect(town.now, &Introduction::new("elk")).unwrap();
    let mut batch = Vec::new();
    wire::put_definition(&mut batch, wire::Named::Key, 0, "POSE", 0, "");
    wire::put_definition(&mut batch, wire::Named::Type, 0, "Pose", 0x77, "");
    let header = Header { value_kind: wire::ValueKind::Binary, sequence: 1, ..Header::new(FrameKind::Notify) };
    wire::put(&mut batch, &header, b"", b"typed");
    wire::put(&mut batch, &Header::new(FrameKind::Register), b"*", b"a");
    town.broker.receive(town.now, elk, &batch).unwrap();
    let mut a = town.enter("a", Manner::Asynchronous, false);
    town.say(&mut a, &[register("POSE", 0.0)]);
    let heard = town.hear(&mut a);
    assert_eq!((heard[0].data, &heard[0].value[..], heard[0].source.as_str()), (Data::BINARY, &b"typed"[..], "elk"));
    let bytes = |key: &'static str| Message {
        key: key.as_bytes(),
        value: b"back",
        time: 99.0,
        ..Message::new(Kind::NOTIFY, Data::BINARY)
    };
    town.say(&mut a, &[bytes("POSE"), bytes("IMAGE"), bytes("POSE")]);
    assert_eq!(a.session.take_refusals(), []);
    let typed = |name, layout| Some(Carried::Typed { name, layout, description: "" });
    assert_eq!(town.broker.carried("POSE"), typed("Pose", 0x77));
    assert_eq!(town.broker.carried("IMAGE"), typed(BYTES_TYPE, 0));
    let mut mail = Vec::new();
    town.broker.take_mail(elk, usize::MAX, &mut mail, |_, _| {});
    let values = wire::frames(&mail).flatten().filter(|frame| frame.header.kind == FrameKind::Notify);
    assert_eq!(values.map(|frame| frame.value.to_vec()).collect::<Vec<_>>(), [b"back"; 3]);
}

#[test]
fn what_is_asked_twice_is_answered_once_and_nobody_clears_the_variables_of_all() {
    let mut town = Town::new();
    let mut a = town.enter("a", Manner::Asynchronous, false);
    let ask = |key: &'static str| Message {
        id: REQUEST_ID,
        key: key.as_bytes(),
        ..Message::new(Kind::SERVER_REQUEST, Data::STRING)
    };
    let unnumbered = Message { id: 3, ..ask("ALL") };
    town.say(&mut a, &[ask("ALL"), ask("ALL"), ask("VAR_SUMMARY"), ask("PROC_SUMMARY"), ask("DB_CLIENTS"), unnumbered]);
    assert!(a.session.is_owed());
    assert_eq!(a.session.take_requests(), [Request::All, Request::Variables, Request::Processes]);
    assert!(!a.session.is_owed());
    town.say(&mut a, &[ask("DB_CLEAR")]);
    assert!(a.session.take_refusals()[0].reason.contains("does not clear"), "said, and not done");
}

/// A long value stays where it lies on its way in, and on its way out: it is heard in its order, as if it were short.
#[test]
fn long_values_are_heard_in_their_order_and_as_they_were_said() {
    let mut town = Town::new();
    let [mut a, mut b] = ["a", "b"].map(|name| town.enter(name, Manner::Asynchronous, false));
    town.say(&mut b, &["X", "SCAN", "LETTER", "N"].map(|key| register(key, 0.0)));
    town.hear(&mut b);
    let (bytes, text) = ((0..100_003).map(|i| (i % 251) as u8).collect::<Vec<u8>>(), "ä".repeat(20_000));
    let says = |key, data, value| Message { key, value, source_aux: b"aux", ..Message::new(Kind::NOTIFY, data) };
    let says = [
        says(b"X", Data::STRING, b"before"),
        says(b"SCAN", Data::BINARY, &bytes),
        says(b"LETTER", Data::STRING, text.as_bytes()),
        says(b"X", Data::STRING, b"behind"),
        // What else a number carries says nothing.
        Message { number: 7.5, ..says(b"N", Data::DOUBLE, &bytes) },
        says(b"SCAN", Data::BINARY, &bytes[1..]),
    ];
    town.say(&mut a, &says);
    let heard = town.hear(&mut b);
    let found: Vec<_> =
        heard.iter().map(|one| (one.key.as_bytes(), one.data, one.aux.as_str(), &one.value[..])).collect();
    let expected = says.map(|one| (one.key, one.data, "aux", if one.data == Data::DOUBLE { b"" } else { one.value }));
    assert!(found == expected, "{:?}", found.iter().map(|one| (one.0, one.3.len())).collect::<Vec<_>>());
    assert_eq!(heard[4].numbers[1], 7.5);
    let mut late = town.enter("late", Manner::Asynchronous, false);
    town.say(&mut late, &[register("SCAN", 0.0)]);
    assert!(town.hear(&mut late)[0].value == bytes[1..]);
}
