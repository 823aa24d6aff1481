//! Who is let in, under which name, and when a name is free again.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::Duration;

use elk_bus::moos::client::{ClientError, MoosClient};
use elk_bus::moos::hello::Manner;
use elk_bus::moos::packet::greeting;
use elk_bus::{Client, RunOptions};

use crate::common::events::Patience;
use crate::server::{MOMENT, Served, hear, wait_for_end};

#[test]
fn a_client_is_welcomed_with_community_host_and_true_skew() {
    let served = Served::start("welcome");
    for client in [served.moos("a"), served.synchronous("b")] {
        let welcomed = client.welcomed();
        assert_eq!(welcomed.community, served.community.as_str());
        assert!(welcomed.hostname.starts_with("hostname=") && welcomed.hostname.len() > 9, "{welcomed:?}");
        // MOOS' own server says its 0.1 s of sleep here, and a busy machine may take its time. The server's is that of its round,
        // which may have begun before the client spoke.
        assert!((-1.0..60.0).contains(&welcomed.skew), "{welcomed:?}");
    }
    // Nothing but the welcome comes unasked.
    let mut old = served.synchronous("old");
    assert!(matches!(old.read(Duration::from_millis(100), &mut |_| {}), Ok(None)));
}

#[test]
fn a_name_that_is_taken_poisons_the_newcomer_and_not_its_holder() {
    let served = Served::start("taken");
    let mut a = served.moos("a");
    let poison = |name: &str| match MoosClient::connect(served.address, name, Manner::Asynchronous) {
        Err(ClientError::Poisoned(reason)) => reason,
        other => panic!("{other:?}"),
    };
    assert_eq!(poison("a"), "A client of this name (\"a\") already exists");
    let elk = served.elk("elk");
    assert_eq!(poison("elk"), "A client of this name (\"elk\") already exists", "there is one set of names");
    assert!(poison("a,b").contains("is no name"));
    assert!(poison("").contains("is no name"));
    assert!(Client::connect(&served.community, "a").is_err());
    a.register("X", 0.0);
    a.notify_number("X", 1.0);
    hear(&mut a, "the holder goes on", |heard| !heard.is_empty());
    drop(elk);
}

#[test]
fn a_hundred_clients_come_at_once_and_one_more_than_there_is_room_for_is_told() {
    let served =
        Served::with("hundred", |options| elk_bus::moos::gateway::GatewayOptions { connections: 100, ..options });
    let clients: Vec<_> = std::thread::scope(|scope| {
        let connect = |i: usize| served.moos(&format!("client-{i}"));
        let threads: Vec<_> = (0..100).map(|i| scope.spawn(move || connect(i))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    let refused = MoosClient::connect(served.address, "another", Manner::Asynchronous);
    let Err(ClientError::Poisoned(reason)) = refused else { panic!("{refused:?}") };
    assert!(reason.contains("100 clients already"), "{reason}");
    drop(clients);
    // An app of elk's had its place all the time.
    served.elk("app");
}

/// A MOOSDB refuses most of these: it hears of an end later than of who comes next.
#[test]
fn whoever_comes_back_at_once_finds_its_name_free() {
    let served = Served::start("reconnect");
    for round in 0..200 {
        let mut client = MoosClient::connect(served.address, "swapped", Manner::Asynchronous)
            .unwrap_or_else(|error| panic!("round {round}: {error}"));
        client.notify_number("ROUND", f64::from(round));
        client.flush().unwrap();
        if round % 2 == 0 {
            client.socket().shutdown(Shutdown::Both).unwrap();
        }
    }
    let mut reader = served.moos("reader");
    reader.register("ROUND", 0.0);
    let last = |heard: &[crate::server::Heard]| heard.iter().any(|one| one.number == 199.0);
    hear(&mut reader, "the last words of all were taken", last);
}

#[test]
fn a_holder_that_gives_no_sign_of_life_makes_room_for_who_wants_its_name() {
    let served = Served::start("half-open");
    let mut hung = served.moos("nav");
    let patience = Patience::new();
    let next = loop {
        patience.left("the name is free");
        match MoosClient::connect(served.address, "nav", Manner::Asynchronous) {
            Ok(client) => break client,
            // It asks again in a moment, or when the holder's connection ends: of a silence nobody is told.
            Err(ClientError::Poisoned(_)) => _ = hung.read(MOMENT, &mut |_| {}),
            Err(error) => panic!("{error}"),
        }
    };
    wait_for_end(&mut hung, "the one that hangs is let go of");
    drop(next);
}

#[test]
fn whoever_says_nothing_or_something_else_holds_nobody_up_and_is_let_go_of() {
    let served = Served::start("silent");
    let connect = || TcpStream::connect(served.address).unwrap();
    let silent: Vec<TcpStream> = (0..70).map(|_| connect()).collect();
    // One that says its greeting a byte at a time, and never all of it.
    let mut slow = connect();
    let mut client = served.moos("a");
    client.register("X", 0.0);
    client.notify_number("X", 1.0);
    hear(&mut client, "others are served", |heard| !heard.is_empty());
    let mut wrong = connect();
    wrong.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\n").unwrap();
    let ends = |stream: &mut TcpStream, timeout: Duration| {
        stream.set_read_timeout(Some(timeout)).unwrap();
        match stream.read(&mut [0; 64]) {
            Ok(0) => true,
            Ok(_) => panic!("nothing is said to it"),
            Err(error) => !matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut),
        }
    };
    let patience = Patience::new();
    let mut dribbled = greeting().into_iter().take(31);
    while !ends(&mut slow, Duration::from_millis(200)) {
        patience.left("a slow one is let go of");
        if let Some(byte) = dribbled.next() {
            let _ = slow.write_all(&[byte]);
        }
        client.flush().unwrap();
    }
    for mut stream in silent.into_iter().chain([wrong]) {
        while !ends(&mut stream, MOMENT) {
            patience.left("a silent one is let go of");
            client.flush().unwrap();
        }
    }
    served.moos("b");
}

#[test]
fn a_client_of_moos_makes_room_for_its_successor_of_elks() {
    let served = Served::start("successor");
    let mut old = served.moos("nav");
    let options = RunOptions { succeeds: true, ..RunOptions::new("nav", served.community.clone()) };
    let mut new = Client::join(&options).unwrap();
    new.comms.notify("X", 2.0).unwrap();
    new.comms.flush().unwrap();
    // Its first receive says that it is ready.
    new.receive(Duration::from_millis(1), |_| {}).unwrap();
    wait_for_end(&mut old, "the old one is let go of");
    let mut reader = served.moos("reader");
    reader.register("X", 0.0);
    let heard = hear(&mut reader, "what the new one says", |heard| !heard.is_empty());
    assert_eq!((heard[0].source.as_str(), heard[0].number), ("nav", 2.0));
}
