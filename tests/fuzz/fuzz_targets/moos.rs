//! Anything that a client of MOOS' may say, in pieces: its stream never does more than end, what a session makes of it is
//! whole frames, and what the broker then has for it is whole packets.
#![no_main]

use elk_bus::broker::{Broker, BrokerConfig};
use elk_bus::moos::hello::{Hello, Manner};
use elk_bus::moos::outgoing::Outgoing;
use elk_bus::moos::packet::{Decoder, Event};
use elk_bus::moos::session::{Context, Session};
use elk_bus::moos::text::{Forms, Texts};
use elk_bus::wire::{FrameKind, Header, Named, TYPED, ValueKind};
use elk_bus::{Introduction, Payload, TypeRef, wire};
use libfuzzer_sys::fuzz_target;

/// The longest message that is taken (bytes).
const LONGEST: usize = 1 << 15;

/// What one of elk's apps reads in `POSE`, whose values are texts here.
#[elk_bus::payload]
struct Pose {
    pose: [f64; 3],
    words: Option<String>,
    counts: Vec<u8>,
}

/// An app of elk's that reads it.
fn read_poses(broker: &mut Broker) {
    let id = broker.connect(1.0, &Introduction::new("reader")).unwrap();
    let mut batch = Vec::new();
    wire::put_definition(&mut batch, Named::Type, 0, Pose::NAME, Pose::LAYOUT, &TypeRef::of::<Pose>().text());
    let typed = Header { flags: TYPED, value_kind: ValueKind::Binary, ..Header::new(FrameKind::Register) };
    wire::put(&mut batch, &typed, b"POSE", b"*");
    broker.receive(1.0, id, &batch).unwrap();
}

fuzz_target!(|data: &[u8]| {
    let Some(([piece, manner, any_source], said)) = data.split_first_chunk() else { return };
    let manner = if manner % 2 == 0 { Manner::Asynchronous } else { Manner::Synchronous };
    let mut broker = Broker::new(BrokerConfig::new("fuzz"), 1.0);
    let who = Introduction { inside: true, ..Introduction::new("stranger") };
    let id = broker.connect(1.0, &who).unwrap();
    let mut forms = Forms::default();
    read_poses(&mut broker);
    let mut session = Session::new("stranger", manner, 1, any_source % 2 == 0, &Texts::of("*"));
    let mut decoder = Decoder::of_client(LONGEST);
    decoder.extend(&elk_bus::moos::packet::greeting());
    for piece in said.chunks(usize::from(*piece).max(1)) {
        match any_source & 2 {
            0 => decoder.extend(piece),
            _ => assert_eq!(decoder.read_from(piece, 1 << 16).unwrap(), piece.len()),
        }
        assert!(decoder.capacity() <= 4 * LONGEST + 1024, "what is announced is not held");
        let mut batch = Vec::new();
        loop {
            match decoder.next_event() {
                Ok(Some(Event::Message { message, first })) => {
                    let _ = Hello::read(&message);
                    let mut context = Context { id, broker: &mut broker, forms: &mut forms };
                    if let Some(long) = session.take(&message, first, &mut context, &mut batch) {
                        broker.receive(1.0, id, &std::mem::take(&mut batch)).expect("whole frames");
                        broker.receive_message(1.0, id, &long).expect("a whole frame");
                    }
                }
                Ok(Some(Event::End)) => session.end_packet(),
                Ok(Some(Event::TooLong { bytes, key })) => session.note_too_long(bytes, LONGEST, key),
                Ok(Some(Event::Greeting)) => {}
                Ok(None) => break,
                Err(_) => return,
            }
        }
        broker.receive(1.0, id, &batch).expect("a session says whole frames, and no number that it has not named");
        hear(&mut broker, id, &mut session, &mut forms);
    }
});

/// What the client is told.
fn hear(broker: &mut Broker, id: wire::ClientId, session: &mut Session, forms: &mut Forms) {
    if !session.may_be_told() {
        return;
    }
    let (mut mail, mut out) = (Vec::new(), Outgoing::default());
    broker.take_mail(id, usize::MAX, &mut mail, |_, _| {});
    if !session.put_packet(1.0, &mail, broker, forms, &mut (), &mut out) {
        assert!(out.is_empty());
        return;
    }
    let mut decoder = Decoder::of_server(usize::MAX);
    decoder.extend(&out.to_bytes(&mail).expect("it is made of this mail"));
    let mut messages = 0;
    while let Some(event) = decoder.next_event().expect("what a client is told is a packet") {
        messages += usize::from(matches!(event, Event::Message { .. }));
    }
    assert!(messages > 0, "no packet is empty");
    session.take_refusals();
    session.take_requests();
}
