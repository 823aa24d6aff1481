//! Clients that lie, flood or do not read: it is theirs to suffer from.

use std::io::Write;
use std::time::Duration;

use elk_bus::moos::message::{Data, Kind, Message};
use elk_bus::moos::packet::put_packet;

use crate::common::events::Patience;
use crate::server::{Heard, Served, hear, settle, wait_for_end};

#[test]
fn lengths_that_cannot_be_end_their_client_alone() {
    let served = Served::start("lengths");
    let mut other = served.moos("other");
    let mut message = Vec::new();
    put_packet(&mut message, &Message { key: b"X", ..Message::new(Kind::NOTIFY, Data::DOUBLE) });
    let with = |at: usize, len: i32| {
        let mut bytes = message.clone();
        bytes[at..at + 4].copy_from_slice(&len.to_le_bytes());
        bytes
    };
    // Of the packet, its number of messages, the message, and a text in it.
    let lies =
        [with(0, 3), with(0, -1), with(4, 1 << 30), with(4, -1), with(9, 5), with(9, i32::MAX), with(19, i32::MAX)];
    for (index, lie) in lies.iter().enumerate() {
        let mut liar = served.moos(&format!("liar-{index}"));
        liar.socket().write_all(lie).unwrap();
        wait_for_end(&mut liar, "a liar is let go of");
        other.flush().unwrap();
    }
    // Two gigabytes are announced, and never come: nothing is held for them, and in the end the client is silent.
    let mut bomber = served.moos("bomber");
    bomber.socket().write_all(&with(0, i32::MAX)[..9]).unwrap();
    let patience = Patience::new();
    while bomber.read(Duration::from_millis(200), &mut |_| {}).is_ok() {
        patience.left("a client that says no more is let go of");
        other.flush().unwrap();
    }
    settle(&mut other);
}

#[test]
fn a_client_that_never_reads_loses_its_own_mail_and_in_the_end_its_place() {
    let served = Served::start("deaf");
    let mut watcher = served.moos("watcher");
    watcher.register("DB_EVENT", 0.0);
    let mut reader = served.moos("reader");
    reader.register("IMAGE", 0.0);
    settle(&mut reader);
    // It gives its signs of life, and reads nothing.
    let mut deaf = served.moos("deaf");
    deaf.register("IMAGE", 0.0);
    deaf.flush().unwrap();
    let mut camera = served.moos("camera");
    let image = vec![7; 500_000];
    let gone = |heard: &[Heard]| heard.iter().any(|one| one.value == b"disconnected=deaf");
    let (patience, mut events, mut sent, mut seen) = (Patience::new(), Vec::new(), 0, 0);
    while !gone(&events) {
        patience.left("the deaf one is let go of");
        camera.notify_bytes("IMAGE", &image);
        camera.flush().unwrap();
        sent += 1;
        while seen < sent {
            patience.left("the reader gets every image");
            let mut note = |message: &Message<'_>| {
                assert_eq!(message.value.len(), image.len());
                assert_eq!(message.id, seen, "none is missing");
                seen += 1;
            };
            reader.receive(Duration::from_millis(20), &mut note).unwrap();
        }
        watcher.receive(Duration::from_millis(10), |message| events.push(Heard::of(message))).unwrap();
        camera.receive(Duration::from_millis(1), |_| {}).unwrap();
        let _ = deaf.flush();
    }
    assert!(sent > 20, "it was more than any socket holds: {sent}");
    assert!(hear(&mut reader, "nothing more", |_| true).is_empty());
}

#[test]
fn a_storm_of_connections_that_come_and_go_leaves_nothing_behind() {
    let served = Served::start("storm");
    let mut other = served.moos("other");
    for round in 0..20 {
        std::thread::scope(|scope| {
            for thread in 0..8 {
                let served = &served;
                scope.spawn(move || {
                    let mut client = served.moos(&format!("storm-{thread}"));
                    client.register("*", 0.0);
                    client.notify_number(&format!("ROUND_{thread}"), f64::from(round));
                    client.flush().unwrap();
                });
            }
        });
        other.flush().unwrap();
    }
    other.ask("PROC_SUMMARY");
    let patience = Patience::new();
    loop {
        patience.left("all of them are gone");
        let heard = hear(&mut other, "who is there", |heard| !heard.is_empty());
        if heard.len() == 1 {
            assert!(heard[0].text().starts_with("other:"), "{heard:?}");
            break;
        }
        other.ask("PROC_SUMMARY");
    }
}
