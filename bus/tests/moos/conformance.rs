//! MOOS' protocol, rule by rule, over a socket and in raw packets: a test a section of its specification. The requests, the
//! variables and the server's own ones (1.9 to 1.11) are in `conformance_table.rs`. Which rules there are, and where else one is
//! shown:
//!
//! | section | rules |
//! |---|---|
//! | 1.1, 1.2 | TCP, little-endian, no padding: all of these, and `elk-moos`' own tests against bytes of a MOOSDB's |
//! | 1.3 packet | the length counts the header; N messages; the "compressed" byte is ignored, and 0 from the server; any pieces; N = 0 is taken and never sent; lengths that cannot be (also `hostile.rs`) |
//! | 1.4 message | every field passes as it was sent, any byte in a value; an empty community is the server's; unused numbers are −1 |
//! | 1.5 types | what is never useful, and what nobody knows, is passed over; each of the others is in a section below |
//! | 1.6 handshake | 32 bytes in either case, or the end without a word; both keys; WELCOME field by field; POISON for a name that is taken and for what is no name; its holder is untouched (also `handshake.rs`) |
//! | 1.7 asynchronous | TIMING is answered first, once, with time and key as they were, the server's clock, and 0; not first it is not answered; timing, mail, answers; mail is pushed; one hears oneself |
//! | 1.8 synchronous | a packet for each packet, which begins with NULL, its time −1; mail and answers behind it; nothing unasked |
//! | 1.9 requests | NOTIFY, REGISTER, period, UNREGISTER, wildcards, the end of a connection, SERVER_REQUEST, one order |
//! | 1.9 liveness | a silence of 5 s: `hostile.rs`, `handshake.rs` |
//! | 1.10 time warp | `warp.rs` |
//! | 1.11 DB_* | each one's source, type and content |
//! | 1.11 `<APP>_STATUS` | what elk's apps say of themselves is what MOOS' say |

use elk_bus::Clock;
use elk_bus::moos::hello::Manner::{Asynchronous, Synchronous};
use elk_bus::moos::message::{Data, Kind, Message, NO_ID, NO_NUMBER, REQUEST_ID};
use elk_bus::moos::packet::greeting;

use crate::server::{Heard, Served};
use crate::wire::{Wire, number, packet, register, request, text, timing};

fn kinds(heard: &[Heard]) -> Vec<Kind> {
    heard.iter().map(|one| one.kind).collect()
}

/// Whether a number is the server's clock, but for what a test may take.
fn is_now(number: f64) -> bool {
    (number - Clock::new(1.0).now()).abs() < 60.0
}

#[test]
fn section_1_3_packets() {
    /// A header of N = 0.
    const EMPTY: [u8; 9] = [9, 0, 0, 0, 0, 0, 0, 0, 0];
    let served = Served::start("section-3");
    let mut a = Wire::open(&served, "a", Asynchronous);
    a.say(&[register("X", 0.0)]);
    for flag in [0, 1, 255] {
        let mut bytes = packet(&[number("X", f64::from(flag))]);
        bytes[8] = flag;
        a.write(&bytes);
    }
    a.write(&EMPTY);
    packet(&[number("X", 3.0), number("X", 4.0)]).chunks(7).for_each(|piece| a.write(piece));
    a.write(&[packet(&[number("X", 5.0)]), packet(&[number("X", 6.0)])].concat());
    assert_eq!(a.numbers("X"), [0.0, 1.0, 255.0, 3.0, 4.0, 5.0, 6.0]);
    // A synchronous client waits for a packet after each of its own, this one as well; what answers it has a message.
    let mut old = Wire::open(&served, "old", Synchronous);
    old.write(&EMPTY);
    assert_eq!(kinds(&old.packet("an answer to nothing")), [Kind::NULL]);
    // A length that is less than its own header ends its client, and nobody else.
    let mut liar = Wire::open(&served, "liar", Asynchronous);
    liar.write(&[3, 0, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(liar.next("the liar's end"), None);
    assert_eq!(a.settled().0, []);
}

#[test]
fn section_1_4_messages() {
    let served = Served::start("section-4");
    let (mut a, mut b) = (Wire::open(&served, "a", Asynchronous), Wire::open(&served, "b", Asynchronous));
    b.say(&["D", "S", "B"].map(|key| register(key, 0.0)));
    b.settled();
    let d = Message { id: 41, source: b"a", source_aux: b"left", second: 2.5, ..number("D", 1.5) };
    let s = Message { id: 42, source: b"a", time: -7.25, ..text("S", "W\u{f6}rter,\0\n=\"") };
    let bytes: Vec<u8> = (0..=255).collect();
    let bin = Message { id: i32::MAX, data: Data::BINARY, value: &bytes, ..text("B", "") };
    a.say(&[d, s, bin]);
    a.settled();
    let community = served.community.as_str();
    let as_sent =
        [d, s, bin].map(|message| Heard { source: "a".into(), community: community.into(), ..Heard::of(&message) });
    assert_eq!((as_sent[1].number, as_sent[1].second), (NO_NUMBER, NO_NUMBER));
    assert_eq!(b.settled().0, as_sent);
}

#[test]
fn section_1_5_types() {
    let served = Served::start("section-5");
    let mut a = Wire::open(&served, "a", Asynchronous);
    // COMMAND, ANONYMOUS, NOT_SET and TERMINATE; what is the server's, or of the handshake; and what is nobody's.
    let letters = *b"CA~^WKi.Zr\0\xff";
    let keys = letters.map(|letter| format!("IGNORED_{letter}"));
    for (letter, key) in letters.into_iter().zip(&keys) {
        // Alone, as the first of a packet and as a later one.
        let ignored = Message { kind: Kind(letter), ..number(key, 1.0) };
        a.say(&[ignored]);
        a.say(&[ignored, number("X", 1.0), ignored]);
    }
    let (heard, names) = a.settled();
    assert_eq!(heard, [], "none is answered");
    assert!(names.iter().any(|name| name == "X") && names.iter().all(|name| !name.contains("IGNORED")), "{names:?}");
}

/// A client's first message.
fn hello<'a>(name: &'a str, key: &'a str) -> Message<'a> {
    let hello = Message::new(Kind::DATA, Data::STRING);
    Message { key: key.as_bytes(), value: name.as_bytes(), time: 1000.0, ..hello }
}

#[test]
fn section_1_6_handshake() {
    let served = Served::start("section-6");
    let community = served.community.as_str();
    let lower = greeting().to_ascii_lowercase();
    assert_ne!(lower[..], greeting()[..]);
    let mut welcomed = Vec::new();
    for (name, greeting, key) in
        [("a", &greeting()[..], "asynchronous"), ("b", &lower[..], "asynchronous"), ("old", &lower[..], "")]
    {
        let mut wire = Wire::silent(&served);
        wire.write(greeting);
        wire.write(&packet(&[hello(name, key)]));
        let welcome = wire.packet("a welcome").remove(0);
        let (aux, time) = (welcome.aux.as_str(), welcome.time);
        assert!(aux.starts_with("hostname=") && aux.len() > "hostname=".len() && is_now(time), "{welcome:?}");
        // A MOOSDB says its sleep of 0.1 s in the difference; here it is what it is.
        let expected = Message { source_aux: aux.as_bytes(), community: community.as_bytes(), time, ..hello("", "") };
        let number = time - 1000.0;
        let expected = Message { kind: Kind::WELCOME, data: Data::DOUBLE, number, value: b"asynchronous", ..expected };
        assert_eq!(welcome, Heard::of(&expected), "to a synchronous client, too");
        welcomed.push(wire);
    }

    let poisoned = |first: Message<'_>, reason: &str| {
        let mut wire = Wire::silent(&served);
        wire.write(&[&greeting()[..], &packet(&[first])].concat());
        let poison = Message { value: reason.as_bytes(), ..Message::new(Kind::POISON, Data::STRING) };
        assert_eq!(wire.packet("a refusal"), [Heard::of(&poison)]);
        assert_eq!(wire.next("the end"), None);
    };
    poisoned(hello("a", "asynchronous"), "A client of this name (\"a\") already exists");
    poisoned(hello("old", ""), "A client of this name (\"old\") already exists");
    poisoned(Message { kind: Kind::NOTIFY, ..hello("c", "asynchronous") }, "Failed to read receive client's name");
    // Whoever greets otherwise hears nothing.
    let mut other = Wire::silent(&served);
    other.write(b"ELKS CAN DANCE  2/8/10\0\0\0\0\0\0\0\0\0\0");
    assert_eq!(other.next("the end"), None);
    // Who has the name goes on.
    welcomed.iter_mut().for_each(|wire| drop(wire.settled()));
}

#[test]
fn section_1_7_asynchronous_clients() {
    let served = Served::start("section-7");
    let (mut a, mut b) = (Wire::open(&served, "a", Asynchronous), Wire::open(&served, "b", Asynchronous));
    b.say(&[number("X", 1.0)]);
    b.settled();
    a.say(&[timing(42.5), register("X", 0.0), request("VAR_SUMMARY")]);
    let mut heard = a.packet("an answer");
    while heard.last().unwrap().id != REQUEST_ID {
        heard.extend(a.packet("the rest of an answer"));
    }
    let ids: Vec<_> = heard.iter().map(|one| (one.kind, one.key.as_str(), one.id)).collect();
    let timing_mail_answer =
        [(Kind::TIMING, "_async_timing", NO_ID), (Kind::NOTIFY, "X", NO_ID), (Kind::NOTIFY, "VAR_SUMMARY", REQUEST_ID)];
    assert_eq!(ids, timing_mail_answer);
    let clock = heard[0].number;
    assert!(is_now(clock), "{clock}");
    assert_eq!(heard[0], Heard::of(&Message { number: clock, second: 0.0, ..timing(42.5) }), "and there is no pause");
    // Behind another message it is none; nor is it mail for anybody.
    a.say(&[number("Y", 1.0), timing(43.5)]);
    assert_eq!(a.settled().0, []);
    a.say(&[timing(44.5), timing(45.5)]);
    let (heard, names) = a.settled();
    assert_eq!((kinds(&heard), heard[0].time), (vec![Kind::TIMING], 44.5), "of a packet the first is answered");
    assert!(names.iter().all(|name| name != "_async_timing"));
    // Mail comes unasked; one's own as well.
    b.say(&[number("X", 2.0)]);
    let heard = a.packet("mail");
    assert_eq!((heard.len(), heard[0].source.as_str(), heard[0].number), (1, "b", 2.0));
    a.say(&[number("X", 3.0)]);
    let heard = a.packet("its own");
    assert_eq!((heard.len(), heard[0].source.as_str(), heard[0].number), (1, "a", 3.0));
    assert_eq!(b.settled().0, [], "who has not registered hears nothing");
}

#[test]
fn section_1_8_synchronous_clients() {
    let served = Served::start("section-8");
    let (mut a, mut old) = (Wire::open(&served, "a", Asynchronous), Wire::open(&served, "old", Synchronous));
    let null = Message::new(Kind::NULL, Data::NOT_SET);
    old.say(&[null]);
    let reply = old.packet("a reply");
    assert!(is_now(reply[0].number), "{reply:?}");
    let clock = Message { number: reply[0].number, time: -1.0, ..Message::new(Kind::NULL, Data::DOUBLE) };
    assert_eq!(reply, [Heard::of(&clock)]);
    // Its mail and what it has asked come in the one packet that answers it.
    a.say(&[number("X", 1.0)]);
    a.settled();
    old.say(&[register("X", 0.0), request("VAR_SUMMARY"), request("PROC_SUMMARY")]);
    let reply = old.packet("a reply");
    let keys: Vec<_> = reply.iter().map(|one| (one.kind, one.key.as_str(), one.id)).collect();
    assert_eq!(keys[..2], [(Kind::NULL, "", NO_ID), (Kind::NOTIFY, "X", NO_ID)]);
    let answers = ["VAR_SUMMARY", "PROC_SUMMARY", "PROC_SUMMARY"].map(|key| (Kind::NOTIFY, key, REQUEST_ID));
    assert_eq!(keys[2..], answers, "one of each client");
    // What is said meanwhile waits until it asks. Each of its packets has its answer; a TIMING has none of its own.
    a.say(&[number("X", 2.0), number("X", 3.0)]);
    a.settled();
    old.write(&[packet(&[null]), packet(&[timing(1.0)]), packet(&[null, null])].concat());
    let replies = [(); 3].map(|()| old.packet("a reply"));
    assert!(replies.iter().all(|reply| reply[0].kind == Kind::NULL), "{replies:?}");
    let mail: Vec<f64> = replies.iter().flat_map(|reply| &reply[1..]).map(|one| one.number).collect();
    assert_eq!(mail, [2.0, 3.0]);
    a.say(&[number("X", 4.0)]);
    a.settled();
    old.say(&[number("Y", 1.0)]);
    let reply = old.packet("a reply");
    assert_eq!(
        (kinds(&reply), reply[1].number),
        (vec![Kind::NULL, Kind::NOTIFY], 4.0),
        "no packet came before this one"
    );
}
