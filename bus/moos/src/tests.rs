//! The protocol against the bytes that a MOOSDB was seen to send, and against itself.

use std::io::{self, Read};

use proptest::prelude::*;

use crate::hello::{Hello, Manner, Welcome, put_poison};
use crate::message::{Data, Kind, Message, MessageError, SHORTEST};
use crate::outgoing::{Outgoing, PacketWriter};
use crate::packet::{Decoder, Event, HEADER, LONGEST_HEAD, StreamError, greeting, put_packet};

const LONGEST: usize = 1 << 16;

/// What a stream comes to, in words, and whether it broke off.
fn heard(decoder: &mut Decoder) -> (Vec<String>, Option<StreamError>) {
    let mut heard = Vec::new();
    loop {
        match decoder.next_event() {
            Ok(Some(event)) => heard.push(format!("{event:?}")),
            Ok(None) => return (heard, None),
            Err(error) => return (heard, Some(error)),
        }
    }
}

fn of_server(bytes: &[u8]) -> (Vec<String>, Option<StreamError>) {
    let mut decoder = Decoder::of_server(LONGEST);
    decoder.extend(bytes);
    heard(&mut decoder)
}

fn hex(text: &str) -> Vec<u8> {
    let digits: Vec<u8> = text.bytes().filter(u8::is_ascii_hexdigit).collect();
    digits.chunks(2).map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
}

/// As a MOOSDB was seen to send it: 88 bytes.
#[test]
fn a_welcome_is_what_a_moosdb_sends() {
    let mut sent = Vec::new();
    Welcome { community: "#1", hostname: "vm", time: 1795394934.5 }.put(1795394934.25, &mut sent);
    let mut expected = hex("58000000 01000000 00 4f000000 ffffffff 57 44 00000000 0b000000");
    expected.extend_from_slice(b"hostname=vm");
    expected.extend(hex("02000000"));
    expected.extend_from_slice(b"#1");
    expected.extend(hex("00000000"));
    expected.extend_from_slice(&1795394934.5_f64.to_le_bytes());
    expected.extend_from_slice(&0.25_f64.to_le_bytes());
    expected.extend(hex("000000000000f0bf 0c000000"));
    expected.extend_from_slice(b"asynchronous");
    assert_eq!(sent, expected);
    assert_eq!(sent.len(), 88);
}

#[test]
fn a_client_greets_with_thirty_two_bytes_in_either_case_and_says_its_name() {
    let mut said = greeting().to_vec();
    assert_eq!(&said[..24], b"ELKS CAN'T DANCE 2/8/10\0");
    let hello = Hello { name: "pNav".into(), manner: Manner::Asynchronous, time: 7.5 };
    hello.put(&mut said);
    for said in [said.clone(), said.to_ascii_lowercase()[..32].iter().chain(&said[32..]).copied().collect()] {
        let mut decoder = Decoder::of_client(LONGEST);
        decoder.extend(&said);
        assert_eq!(decoder.next_event(), Ok(Some(Event::Greeting)));
        let Ok(Some(Event::Message { message, first: true })) = decoder.next_event() else { panic!("no hello") };
        assert_eq!(message.key, b"asynchronous");
        assert_eq!(Hello::read(&message), Ok(hello.clone()));
    }
    let mut decoder = Decoder::of_client(LONGEST);
    decoder.extend(b"GET / HTTP/1.1\r\nHost: localhost\r\n");
    assert_eq!(decoder.next_event(), Err(StreamError::Greeting));
    let synchronous = Message { value: b"old", ..Message::new(Kind::DATA, Data::STRING) };
    assert_eq!(Hello::read(&synchronous).unwrap().manner, Manner::Synchronous);
    assert!(Hello::read(&Message { kind: Kind::NOTIFY, ..synchronous }).is_err());
    assert!(Hello::read(&Message { value: b"\xff", ..synchronous }).is_err());
}

#[test]
fn a_refusal_is_a_poison_with_its_reason() {
    let mut sent = Vec::new();
    put_poison("no", &mut sent);
    let message = Message::read(&sent[HEADER..]).unwrap();
    assert_eq!((message.kind, message.data, message.value), (Kind::POISON, Data::STRING, &b"no"[..]));
}

#[test]
fn an_empty_message_is_the_shortest_and_a_packet_without_any_is_not_sent() {
    let empty = Message::new(Kind::NULL, Data::NOT_SET);
    let mut bytes = Vec::new();
    empty.put(&mut bytes);
    assert_eq!((bytes.len(), empty.encoded_len()), (SHORTEST, SHORTEST));
    let mut out = Outgoing::default();
    out.bytes().extend([1, 2, 3]);
    assert!(!PacketWriter::new(&mut out, b"").finish());
    assert_eq!(out.to_bytes(b"").unwrap(), [1, 2, 3]);
    assert_eq!(of_server(&hex("09000000 00000000 00")).0, ["End"], "and whoever sends one is understood all the same");
}

#[test]
fn lengths_that_cannot_be_are_errors_and_hold_no_memory() {
    let packet = |len: i32, messages: i32| {
        let mut decoder = Decoder::of_server(LONGEST);
        decoder.extend(&[&len.to_le_bytes()[..], &messages.to_le_bytes(), &[0]].concat());
        (heard(&mut decoder).1, decoder.capacity())
    };
    for (len, messages) in [(3, 0), (8, 1), (-1, 1), (62, 1), (63, -1), (63, 2), (10, 0), (i32::MIN, i32::MIN)] {
        assert_eq!(packet(len, messages).0, Some(StreamError::Packet { len, messages }), "{len} {messages}");
    }
    let (error, capacity) = packet(i32::MAX, 1);
    assert!(error.is_none() && capacity < 1024, "two gigabytes are announced, and nothing is held for them");
    let message = |len: i32| {
        let mut decoder = Decoder::of_server(LONGEST);
        decoder.extend(&[&200_i32.to_le_bytes()[..], &2_i32.to_le_bytes(), &[0], &len.to_le_bytes()].concat());
        heard(&mut decoder).1
    };
    for len in [0, 53, -1, 138, 191, i32::MAX] {
        assert_eq!(message(len), Some(StreamError::Length { len, left: 191, messages: 2 }), "{len}");
    }
    assert_eq!(message(137), None);
}

/// A stream that gives so many bytes at a time, and counts how often it was asked.
struct Slow<'a> {
    rest: &'a [u8],
    piece: usize,
    asked: usize,
}

impl Read for Slow<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.asked += 1;
        let len = buffer.len().min(self.piece).min(self.rest.len());
        let (now, rest) = self.rest.split_at(len);
        buffer[..len].copy_from_slice(now);
        self.rest = rest;
        Ok(len)
    }
}

#[test]
fn a_long_message_is_read_at_once_where_the_one_before_it_lay() {
    const MOST: usize = 1 << 14;
    let value = vec![7; 20 * MOST];
    let mut bytes = Vec::new();
    put_packet(&mut bytes, &Message { value: &value, ..Message::new(Kind::NOTIFY, Data::BINARY) });
    let mut decoder = Decoder::of_server(value.len() + SHORTEST);
    for asked in [11, 2] {
        let mut stream = Slow { rest: &bytes, piece: usize::MAX, asked: 0 };
        let mut found = Vec::new();
        while found.is_empty() {
            assert!(decoder.read_from(&mut stream, MOST).unwrap() > 0);
            found = heard(&mut decoder).0;
        }
        assert_eq!((found.len(), stream.asked <= asked, decoder.unread()), (2, true, 0), "{}", stream.asked);
    }
    assert_eq!(decoder.read_from(io::empty(), MOST).unwrap(), 0);
    decoder.shrink();
    assert_eq!(decoder.capacity(), 0);
}

#[test]
fn room_is_made_by_what_has_come_and_not_by_what_is_announced() {
    const LEN: i32 = 1 << 30;
    let announced = [(LEN + 9).to_le_bytes(), 1_i32.to_le_bytes()].concat();
    let mut bytes = [&announced[..], &[0], &LEN.to_le_bytes()].concat();
    bytes.resize(30_000, 0);
    let mut decoder = Decoder::of_server(LEN as usize);
    let mut stream = Slow { rest: &bytes, piece: 1000, asked: 0 };
    while decoder.read_from(&mut stream, 1 << 16).unwrap() > 0 {
        assert_eq!(heard(&mut decoder), (Vec::new(), None));
        assert!(decoder.capacity() <= 4 * decoder.unread() + 8192, "{} {}", decoder.capacity(), decoder.unread());
    }
    assert_eq!(decoder.lacking(), LEN as usize - (30_000 - HEADER));
}

#[test]
fn a_text_that_reaches_beyond_its_message_is_an_error() {
    let mut bytes = Vec::new();
    Message { key: b"X", ..Message::new(Kind::NOTIFY, Data::DOUBLE) }.put(&mut bytes);
    for len in [2_i32, -1, i32::MAX, i32::MIN] {
        let mut bad = bytes.clone();
        bad[10..14].copy_from_slice(&len.to_le_bytes());
        assert!(Message::read(&bad).is_err(), "{len}");
    }
    bytes.push(0);
    assert_eq!(Message::read(&bytes), Err(MessageError::LeftOver(1)));
}

#[test]
fn a_message_that_is_too_long_is_passed_over_and_the_next_is_heard() {
    let value = vec![7; LONGEST];
    let mut out = Outgoing::default();
    let mut packet = PacketWriter::new(&mut out, b"");
    let message = Message::new(Kind::NOTIFY, Data::BINARY);
    packet.put(&Message { value: &value, ..message });
    packet.put(&Message { value: b"small", ..message });
    packet.finish();
    let bytes = out.to_bytes(b"").unwrap();
    let mut decoder = Decoder::of_server(LONGEST);
    let mut all = Vec::new();
    for piece in bytes.chunks(1000) {
        decoder.extend(piece);
        assert!(decoder.capacity() < 8192, "{}", decoder.capacity());
        all.extend(heard(&mut decoder).0);
    }
    assert_eq!(all.len(), 3, "{all:?}");
    assert_eq!(all[0], format!("TooLong {{ bytes: {}, key: Some([]) }}", LONGEST + SHORTEST));
    assert!(all[1].contains("first: false"), "{all:?}");
}

#[test]
fn of_a_message_that_is_too_long_the_variable_is_known_if_it_stands_in_its_beginning() {
    let (value, far) = (vec![7; 2 * LONGEST_HEAD], vec![b'x'; LONGEST_HEAD]);
    let of = |source_aux, key| Message { key, source_aux, value: &value, ..Message::new(Kind::NOTIFY, Data::BINARY) };
    for (message, known) in [
        (of(b"", b"IMAGE"), Some(&b"IMAGE"[..])),
        (of(&far[..LONGEST_HEAD - 40], b"IMAGE"), Some(b"IMAGE")),
        (of(&far, b"IMAGE"), None),
        (of(b"", &far), None),
    ] {
        let mut bytes = Vec::new();
        put_packet(&mut bytes, &message);
        for piece in [1, 7, 1000, bytes.len()] {
            let mut decoder = Decoder::of_server(LONGEST_HEAD);
            let mut found = Vec::new();
            for piece in bytes.chunks(piece) {
                decoder.extend(piece);
                while let Some(event) = decoder.next_event().unwrap() {
                    if let Event::TooLong { bytes, key } = event {
                        found.push((bytes, key.map(<[u8]>::to_vec)));
                    }
                }
            }
            assert_eq!(found, [(message.encoded_len(), known.map(<[u8]>::to_vec))]);
        }
    }
}

/// A message that owns what is in it.
#[derive(Debug, Clone)]
struct Owned {
    id: i32,
    letters: (u8, u8),
    texts: [Vec<u8>; 5],
    numbers: [f64; 3],
}

impl Owned {
    fn message(&self) -> Message<'_> {
        let [source, source_aux, community, key, value] = self.texts.each_ref().map(Vec::as_slice);
        let [time, number, second] = self.numbers;
        let (kind, data) = (Kind(self.letters.0), Data(self.letters.1));
        Message { id: self.id, kind, data, source, source_aux, community, key, time, number, second, value }
    }
}

fn any_message() -> impl Strategy<Value = Owned> {
    let text = || proptest::collection::vec(any::<u8>(), 0..40);
    let number = || prop_oneof![Just(-1.0), -1e12..1e12];
    let parts =
        (any::<i32>(), any::<(u8, u8)>(), [text(), text(), text(), text(), text()], [number(), number(), number()]);
    parts.prop_map(|(id, letters, texts, numbers)| Owned { id, letters, texts, numbers })
}

proptest! {
    #[test]
    fn packets_come_out_as_they_went_in_whatever_pieces_they_come_in(
        packets in proptest::collection::vec(proptest::collection::vec(any_message(), 1..6), 1..6),
        pieces in proptest::collection::vec(1_usize..70, 1..20),
    ) {
        let mut out = Outgoing::default();
        let mut expected = Vec::new();
        for messages in &packets {
            let mut packet = PacketWriter::new(&mut out, b"");
            for (index, message) in messages.iter().enumerate() {
                packet.put(&message.message());
                expected.push(format!("{:?}", Event::Message { message: message.message(), first: index == 0 }));
            }
            prop_assert!(packet.finish());
            expected.push("End".to_owned());
        }
        let bytes = out.to_bytes(b"").unwrap();
        let [mut found, mut read] = [Vec::new(), Vec::new()];
        let [mut decoder, mut reader] = [(); 2].map(|()| Decoder::of_server(LONGEST));
        let mut rest = &bytes[..];
        for len in pieces.iter().cycle() {
            if rest.is_empty() {
                break;
            }
            let (piece, behind) = rest.split_at((*len).min(rest.len()));
            decoder.extend(piece);
            prop_assert_eq!(reader.read_from(piece, LONGEST).unwrap(), piece.len());
            rest = behind;
            for (decoder, found) in [(&mut decoder, &mut found), (&mut reader, &mut read)] {
                let (heard, error) = heard(decoder);
                prop_assert_eq!(error, None);
                found.extend(heard);
            }
        }
        prop_assert_eq!(&found, &expected);
        prop_assert_eq!(read, expected);
    }

    #[test]
    fn bytes_that_are_changed_never_do_more_than_end_the_stream(
        messages in proptest::collection::vec(any_message(), 1..5),
        changes in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 0..6),
    ) {
        let mut bytes = Vec::new();
        messages.iter().for_each(|message| put_packet(&mut bytes, &message.message()));
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let mut decoder = Decoder::of_server(LONGEST);
        decoder.extend(&bytes);
        let (heard, _) = heard(&mut decoder);
        prop_assert!(heard.len() <= 2 * messages.len() + bytes.len() / HEADER);
    }
}
