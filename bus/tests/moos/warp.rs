//! A community whose clock is faster than the wall's: all times are so many times as long, as MOOS has it; what a client may take
//! of the wall's time is not.

use std::time::Duration;

use elk_bus::moos::client::MoosClient;
use elk_bus::moos::hello::Manner;
use elk_bus::moos::message::{Data, Kind, Message};
use elk_bus::{Client, Clock, RunOptions, Value, any};

use crate::common::events::{Patience, WATCHDOG};
use crate::server::{Heard, MOMENT, Served, hear};

/// As fast as MOOS goes. The time of a clock that is not warped lies centuries before this one's.
const WARP: f64 = 400.0;

/// Whether two times are the same but for what a test may take.
fn is_near(one: f64, other: f64) -> bool {
    (one - other).abs() < WARP * WATCHDOG.as_secs_f64()
}

#[test]
fn every_time_is_the_community_s() {
    let served = Served::warped("warp", WARP, |options| options);
    let clock = Clock::new(WARP);
    let mut moos = MoosClient::connect_at(served.address, "pHelm", Manner::Asynchronous, clock).unwrap();
    assert!(is_near(moos.welcomed().skew, 0.0), "server and client go alike: {:?}", moos.welcomed());
    let unwarped = MoosClient::connect(served.address, "pSlow", Manner::Asynchronous).unwrap();
    assert!(is_near(unwarped.welcomed().skew, clock.now() - unwarped.time()), "{:?}", unwarped.welcomed());

    let mut elk = served.elk("elk");
    assert!(is_near(elk.comms.time(), clock.now()) && elk.comms.clock().warp() == WARP);
    moos.register("DB_TIME", 0.0);
    moos.register("DB_UPTIME", 0.0);
    moos.register("DEPTH", 0.0);
    let heard = hear(&mut moos, "the server's own", |heard| {
        ["DB_TIME", "DB_UPTIME"].iter().all(|key| heard.iter().any(|one| one.key == *key))
    });
    let last = |key: &str| heard.iter().rev().find(|one| one.key == key).unwrap();
    assert!(is_near(last("DB_TIME").number, clock.now()) && is_near(last("DB_TIME").time, clock.now()));
    let uptime = last("DB_UPTIME");
    let first = heard.iter().find(|one| one.key == "DB_UPTIME").unwrap();
    assert!((0.0..WARP * WATCHDOG.as_secs_f64()).contains(&uptime.number));
    assert!((uptime.number - first.number - (uptime.time - first.time)).abs() < 1.0, "it is as fast as the time");

    elk.comms.notify("DEPTH", 3.0).unwrap();
    elk.comms.flush().unwrap();
    let heard = hear(&mut moos, "DEPTH", |heard| heard.iter().any(|one| one.key == "DEPTH"));
    assert!(is_near(heard.iter().find(|one| one.key == "DEPTH").unwrap().time, clock.now()));

    elk.comms.register(any("SPEED")).unwrap();
    elk.comms.flush().unwrap();
    let said = clock.now();
    moos.notify_number("SPEED", 1.5);
    moos.flush().unwrap();
    let (patience, mut time) = (Patience::new(), None);
    while time.is_none() {
        patience.left("SPEED");
        elk.receive(MOMENT, |mail| time = Some(mail.time())).unwrap();
    }
    assert!(is_near(time.unwrap(), said) && time.unwrap() >= said, "the client's time is passed on as it is");
}

#[test]
fn signs_of_life_show_the_warped_clock_and_come_by_the_wall_s() {
    let served = Served::warped("warp-beat", WARP, |options| options);
    let clock = Clock::new(WARP);
    let mut moos = MoosClient::connect_at(served.address, "pHelm", Manner::Asynchronous, clock).unwrap();
    // A silence of 5 s of the wall's lets a client go. So many of the community's have passed before the first sign of life.
    let (patience, mut beats) = (Patience::new(), Vec::new());
    while beats.len() < 2 {
        patience.left("the server answers signs of life");
        moos.flush().unwrap();
        let mut note = |message: &elk_bus::moos::message::Message<'_>| {
            beats.extend((message.kind == Kind::TIMING).then(|| Heard::of(message)));
        };
        moos.read(MOMENT, &mut note).unwrap();
    }
    for beat in beats {
        assert!(is_near(beat.number, clock.now()) && is_near(beat.time, beat.number), "{beat:?}");
    }
}

/// Regression: a lease was so many of the community's seconds, and a client's place gone before its process was started again.
#[test]
fn a_lease_is_the_wall_s_time() {
    // As long as any test may take; of the community's seconds so many pass at once.
    const LEASE: Duration = WATCHDOG;
    let served = Served::warped("warp-lease", WARP, |options| options);
    let options = RunOptions { lease: LEASE, ..RunOptions::new("reader", served.community.clone()) };
    let mut writer = served.elk("writer");
    let mut dead = Client::join(&options).unwrap();
    dead.comms.register(any("SPEED")).unwrap();
    dead.comms.flush().unwrap();
    writer.comms.notify("SPEED", 0.0).unwrap();
    writer.comms.flush().unwrap();
    let patience = Patience::new();
    let mut heard = 0;
    while heard == 0 {
        patience.left("it is registered");
        dead.receive(MOMENT, |_| heard += 1).unwrap();
    }
    drop(dead); // without a goodbye
    let died_at = writer.comms.time();
    while writer.comms.time() < died_at + 2.0 * LEASE.as_secs_f64() {
        patience.left("the community's time passes");
        writer.receive(MOMENT, |_| {}).unwrap();
    }
    for number in [1.0, 2.0] {
        writer.comms.notify("SPEED", number).unwrap();
    }
    writer.comms.flush().unwrap();
    let mut next = Client::join(&options).unwrap();
    next.comms.register(any("SPEED")).unwrap();
    let mut speeds = Vec::new();
    while speeds.last() != Some(&Value::Double(2.0)) {
        patience.left("its mail");
        next.receive(MOMENT, |mail| speeds.push(mail.value().to_value())).unwrap();
    }
    assert_eq!(speeds, [1.0, 2.0].map(Value::Double), "what was said meanwhile, and not the latest value alone");
}

/// Regression: the latency of a client that plays a log was that of the log.
#[test]
fn a_client_s_latency_is_that_of_its_signs_of_life_whatever_the_times_of_its_messages() {
    // Warped, so that the server sums up often.
    let served = Served::warped("warp-latency", WARP, |options| options);
    let mut moos = MoosClient::connect_at(served.address, "player", Manner::Asynchronous, Clock::new(WARP)).unwrap();
    moos.register("DB_QOS", 0.0);
    moos.say(&Message { key: b"OLD", number: 1.0, time: 77.0, ..Message::new(Kind::NOTIFY, Data::DOUBLE) });
    // recent:max:min:mean (ms)
    let measured = |one: &Heard| {
        let of_player = one.text().split(',').find_map(|entry| entry.strip_prefix("player="))?;
        let found: Vec<f64> = of_player.split(':').map(|number| number.parse().unwrap()).collect();
        (found[1] > 0.0).then_some(found)
    };
    let is_there = |heard: &[Heard]| heard.iter().any(|one| one.key == "DB_QOS" && measured(one).is_some());
    let heard = hear(&mut moos, "a latency", is_there);
    let latencies = heard.iter().filter(|one| one.key == "DB_QOS").find_map(measured).unwrap();
    assert!(latencies.iter().all(|ms| is_near(ms * 1e-3, 0.0)), "{latencies:?}");
}

#[test]
fn an_interval_is_the_community_s_time() {
    let served = Served::warped("warp-interval", WARP, |options| options);
    let clock = Clock::new(WARP);
    let mut moos = MoosClient::connect_at(served.address, "pHelm", Manner::Asynchronous, clock).unwrap();
    // A second of the wall's. As so many seconds of the wall's it would be longer than any test.
    let interval = WARP;
    assert!(Duration::from_secs_f64(interval) > WATCHDOG);
    moos.register("SPEED", interval);
    for number in 0..3 {
        moos.notify_number("SPEED", f64::from(number));
    }
    let heard = hear(&mut moos, "the last one", |heard| heard.iter().any(|one| one.number == 2.0));
    let speeds: Vec<f64> = heard.iter().filter(|one| one.key == "SPEED").map(|one| one.number).collect();
    assert_eq!(speeds, [0.0, 2.0], "what lies between is not told");
}
