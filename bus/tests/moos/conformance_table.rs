//! MOOS' protocol, rule by rule (see `conformance.rs`): what the server does with each message (1.9), and the variables that it
//! writes itself (1.11). Where elk is otherwise than a MOOSDB on purpose, as docs/moos.md lists, it is said so.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use elk_bus::moos::gateway::GatewayOptions;
use elk_bus::moos::hello::Manner::Asynchronous;
use elk_bus::moos::message::{Data, Kind, Message, NO_ID, NO_NUMBER, REQUEST_ID};
use elk_bus::{App, AppError, Client, Comms, Mail, run_app_on};

use crate::server::{Heard, Served, hear, settle};
use crate::wire::{Wire, number, register, request, text, unregister, wildcard};

/// Longer than any test.
const LONG: f64 = 1e6;

fn open<const N: usize>(served: &Served, names: [&str; N]) -> [Wire; N] {
    names.map(|name| Wire::open(served, name, Asynchronous))
}

/// Variables with their numbers, as they came.
fn numbers(heard: &[Heard]) -> Vec<(&str, f64)> {
    heard.iter().map(|one| (one.key.as_str(), one.number)).collect()
}

/// A client that hears who comes and goes and what is refused. MOOS' server says of the latter on its console alone.
struct Watcher(Wire);

impl Watcher {
    fn start(served: &Served) -> Self {
        let mut wire = Wire::open(served, "watcher", Asynchronous);
        wire.say(&[register("DB_EVENT", 0.0)]);
        wire.settled();
        Self(wire)
    }

    /// What was said since this was asked last; its client has settled.
    fn events(&mut self) -> Vec<String> {
        self.0.settled().0.iter().map(|one| one.text().to_owned()).collect()
    }
}

#[test]
fn section_1_9_notify() {
    let served = Served::start("section-9-notify");
    let mut watcher = Watcher::start(&served);
    let [mut a, mut b] = open(&served, ["a", "b"]);
    b.say(&["X", "T"].map(|key| register(key, 0.0)));
    b.settled();
    watcher.events();
    // The first write fixes the type; texts and bytes are two.
    let bytes = Message { data: Data::BINARY, ..text("T", "bytes") };
    a.say(&[number("X", 1.0), text("X", "one"), text("T", "text"), bytes, number("T", 2.0), number("X", 3.0)]);
    // What names no variable, and what carries nothing.
    a.say(&[number("", 4.0), Message { data: Data::NOT_SET, ..number("Z", 5.0) }]);
    let (_, names) = a.settled();
    assert!(names.iter().all(|name| !name.is_empty() && name != "Z"), "{names:?}");
    assert_eq!(numbers(&b.settled().0), [("X", 1.0), ("T", NO_NUMBER), ("X", 3.0)]);
    // Otherwise: the publisher is told, once of each variable.
    let said = watcher.events();
    let reasons = [
        "refused=a variable=X reason=X carries numbers since its first write",
        "refused=a variable=T reason=T carries texts since its first write",
        "refused=a variable= reason=it names no variable",
        "refused=a variable=Z reason=it carries neither a number, nor a text, nor bytes",
    ];
    assert_eq!(said.len(), reasons.len(), "{said:?}");
    for reason in reasons {
        assert!(said.iter().any(|one| one.starts_with(reason)), "{reason}: {said:?}");
    }

    // A community that is empty is the server's, another one is kept: so bridged mail is known.
    a.say(&[number("X", 6.0), Message { community: b"sea", ..number("X", 7.0) }]);
    a.settled();
    let communities: Vec<String> = b.settled().0.into_iter().map(|one| one.community).collect();
    assert_eq!(communities, [served.community.as_str(), "sea"]);
    // Otherwise: the source is the client, and the name that it claims stands in the aux unless something does.
    let spoofed = Message { source: b"pNav", ..number("X", 8.0) };
    a.say(&[spoofed, Message { source_aux: b"log", ..spoofed }]);
    a.settled();
    let heard = b.settled().0;
    let sources: Vec<_> = heard.iter().map(|one| (one.source.as_str(), one.aux.as_str())).collect();
    assert_eq!(sources, [("a", "pNav"), ("a", "log")]);
    // As a MOOSDB has it where that is allowed.
    let served = Served::with("section-9-any", |options| GatewayOptions { any_source: true, ..options });
    let [mut a, mut b] = open(&served, ["a", "b"]);
    b.say(&[register("X", 0.0)]);
    b.settled();
    a.say(&[spoofed]);
    a.settled();
    let heard = b.settled().0;
    assert_eq!((heard[0].source.as_str(), heard[0].aux.as_str()), ("pNav", ""));
}

#[test]
fn section_1_9_register() {
    let served = Served::start("section-9-register");
    let [mut a, mut b] = open(&served, ["a", "b"]);
    let sent = Message { id: 7, source: b"a", source_aux: b"left", community: b"sea", second: 2.5, ..number("X", 1.5) };
    a.say(&[number("X", 0.0), sent]);
    a.settled();
    // The latest value comes at once, without its id. Otherwise: with its second number, which a MOOSDB has lost.
    b.say(&[register("X", 0.0), register("Y", 0.0)]);
    assert_eq!(b.settled().0, [Heard { id: NO_ID, ..Heard::of(&sent) }], "of what nobody has written there is none");
    // Otherwise: who registers again has it already.
    b.say(&[register("X", 0.0)]);
    assert_eq!(b.settled().0, []);
    // Otherwise: the subscriber is who says it, not whom it names.
    a.say(&[Message { source: b"b", ..register("Z", 0.0) }]);
    a.settled();
    a.say(&[number("Z", 1.0), number("Y", 2.0)]);
    assert_eq!(numbers(&a.settled().0), [("Z", 1.0)]);
    assert_eq!(numbers(&b.settled().0), [("Y", 2.0)]);
    b.say(&[unregister("Y")]);
    b.settled();
    a.say(&[number("Y", 3.0), number("X", 4.0)]);
    a.settled();
    assert_eq!(numbers(&b.settled().0), [("X", 4.0)]);
    // Otherwise: it is a pattern, where a MOOSDB waits for a variable of this very name.
    b.say(&[register("Z*", 0.0)]);
    b.settled();
    a.say(&[number("ZEBRA", 5.0)]);
    a.settled();
    assert_eq!(b.numbers("ZEBRA"), [5.0]);
}

#[test]
fn section_1_9_period() {
    let served = Served::start("section-9-period");
    let [mut a, mut b, mut c] = open(&served, ["a", "b", "c"]);
    b.say(&[register("X", LONG), register("NEGATIVE", -1.0), register("ALL_OF_IT", 0.0), register("BURST", 0.5)]);
    b.settled();
    let mut count = |key: &str, from: u32, to: u32| {
        let burst: Vec<_> = (from..=to).map(|n| number(key, f64::from(n))).collect();
        a.say(&burst);
        a.settled();
    };
    count("X", 0, 4);
    assert_eq!(b.numbers("X"), [0.0], "a message in a period");
    count("NEGATIVE", 0, 4);
    assert_eq!(b.numbers("NEGATIVE"), [0.0, 1.0, 2.0, 3.0, 4.0], "a negative period is none");
    count("ALL_OF_IT", 0, 4);
    assert_eq!(b.numbers("ALL_OF_IT"), [0.0, 1.0, 2.0, 3.0, 4.0]);
    // Whoever registers again has another period from then on. Otherwise: what has waited for the old one is not lost.
    b.say(&[register("X", 0.0)]);
    assert_eq!(b.numbers("X"), [4.0]);
    count("X", 5, 7);
    assert_eq!(b.numbers("X"), [5.0, 6.0, 7.0]);
    b.say(&[register("X", LONG)]);
    assert_eq!(b.settled().0, []);
    count("X", 8, 9);
    assert_eq!(b.numbers("X"), [8.0]);
    // The latest value begins a period.
    c.say(&[register("X", LONG)]);
    assert_eq!(c.numbers("X"), [9.0]);
    count("X", 10, 12);
    assert_eq!(c.settled().0, []);
    // Otherwise: the last of a burst comes as soon as its period is over; a MOOSDB drops it.
    count("BURST", 0, 19);
    let mut heard = b.packet("the first of a burst");
    while heard.last().unwrap().number != 19.0 {
        heard.extend(b.packet("the last of a burst"));
    }
    assert_eq!(numbers(&heard), [("BURST", 0.0), ("BURST", 19.0)]);
}

#[test]
fn section_1_9_wildcards() {
    let served = Served::start("section-9-wildcards");
    let mut watcher = Watcher::start(&served);
    let [mut nav, mut gps, mut b, mut c] = open(&served, ["pNav", "iGPS", "b", "c"]);
    nav.say(&[number("NAV_X", 1.0), number("DEPTH", 2.0)]);
    nav.settled();
    gps.say(&[number("NAV_G", 3.0)]);
    gps.settled();
    // All that is there already and matches comes with its latest value: name, and who wrote it last, as a whole and in its case.
    let said = "AppPattern=p*,VarPattern=NAV_?,Interval=0";
    b.say(&[wildcard(said)]);
    assert_eq!(numbers(&b.settled().0), [("NAV_X", 1.0)]);
    nav.say(&[number("NAV_Y", 4.0), number("NAV_LONG", 5.0), number("nav_z", 6.0), number("XNAV_Z", 7.0)]);
    nav.settled();
    assert_eq!(numbers(&b.settled().0), [("NAV_Y", 4.0)]);
    // Otherwise: every writer counts, and not the first alone.
    gps.say(&[number("NAV_X", 8.0)]);
    gps.settled();
    nav.say(&[number("NAV_G", 9.0)]);
    nav.settled();
    assert_eq!(numbers(&b.settled().0), [("NAV_G", 9.0)]);
    // Otherwise: what a wildcard has brought is not taken back by the name.
    b.say(&[unregister("NAV_X")]);
    b.settled();
    nav.say(&[number("NAV_X", 10.0)]);
    nav.settled();
    assert_eq!(numbers(&b.settled().0), [("NAV_X", 10.0)]);
    // It goes as it was said. Otherwise: for what is new as well.
    b.say(&[Message { kind: Kind::WILDCARD_UNREGISTER, ..wildcard(said) }]);
    b.settled();
    nav.say(&[number("NAV_X", 11.0), number("NAV_N", 12.0)]);
    nav.settled();
    assert_eq!(b.settled().0, []);
    // Its interval is a period. A pattern that is not said is of all.
    let interval = format!("VarPattern=SPEED*,Interval={LONG}");
    c.say(&[wildcard(&interval), wildcard("AppPattern=iGPS")]);
    c.settled();
    nav.say(&[number("SPEED", 13.0), number("SPEED", 14.0)]);
    nav.settled();
    gps.say(&[number("G", 15.0)]);
    gps.settled();
    assert_eq!(numbers(&c.settled().0), [("SPEED", 13.0), ("G", 15.0)]);
    // Otherwise: one that says neither is refused.
    watcher.events();
    let neither = ["", "NAV_*", "Interval=0", "VarPattern=,AppPattern="];
    b.say(&neither.map(wildcard));
    b.settled();
    nav.say(&[number("NAV_X", 16.0)]);
    nav.settled();
    assert_eq!(b.settled().0, []);
    let expected =
        neither.map(|said| format!("refused=b variable={said} reason=it says neither AppPattern nor VarPattern"));
    let events = watcher.events();
    assert_eq!(events.len(), neither.len(), "{events:?}");
    assert!(events.iter().zip(&expected).all(|(said, begin)| said.starts_with(begin)), "{events:?}");
}

#[test]
fn section_1_9_what_ends_with_a_connection() {
    let served = Served::start("section-9-end");
    let mut watcher = Watcher::start(&served);
    let [mut a, mut b] = open(&served, ["a", "b"]);
    b.say(&[register("X", 0.0), wildcard("VarPattern=NAV_*"), number("LEFT", 7.0)]);
    b.settled();
    a.say(&[number("X", 1.0), number("NAV_X", 1.0)]);
    a.settled();
    watcher.events();
    drop(b);
    let [mut b] = open(&served, ["b"]);
    a.say(&[number("X", 2.0), number("NAV_X", 2.0), number("NAV_NEW", 2.0)]);
    a.settled();
    assert_eq!(b.settled().0, [], "neither mail that was held for the one before, nor what it was registered for");
    b.say(&[register("LEFT", 0.0)]);
    assert_eq!(numbers(&b.settled().0), [("LEFT", 7.0)], "what was written stays");
    assert_eq!(watcher.events(), ["disconnected=b", "connected=b"]);
}

#[test]
fn section_1_9_server_requests() {
    let served = Served::start("section-9-requests");
    let mut watcher = Watcher::start(&served);
    let community = served.community.as_str();
    let [mut a, mut b] = open(&served, ["a", "b"]);
    a.say(&[register("AWAITED", 0.0), register("X", 0.0), register("P*", 0.0)]);
    a.say(&[Message { source_aux: b"left", second: 2.5, ..number("X", 1.5) }, text("TEXT", "words")]);
    assert_eq!(numbers(&a.settled().0), [("X", 1.5)]);
    // Of what is no request of the server's, or none that it knows, there is no word.
    b.say(&[Message { id: 3, ..request("ALL") }, Message { id: NO_ID, ..request("VAR_SUMMARY") }]);
    b.say(&["", "DB_CLIENTS", "PROCESS_SUMMARY", "ALL_OF_IT", "all"].map(request));
    assert_eq!(b.settled().0, []);

    let ask = |wire: &mut Wire, what: &str| {
        wire.say(&[request(what)]);
        let heard = wire.packet("an answer");
        assert!(heard.iter().all(|one| one.id == REQUEST_ID && one.kind == Kind::NOTIFY), "{heard:?}");
        heard
    };
    // The key has it in it; all names, also of what is awaited and no pattern's, in the alphabet's order.
    let heard = ask(&mut b, "A_VAR_SUMMARY_PLEASE");
    assert_eq!((heard.len(), heard[0].data, heard[0].key.as_str()), (1, Data::STRING, "VAR_SUMMARY"));
    let names: Vec<_> = heard[0].text().split(',').collect();
    assert!(
        names.is_sorted() && ["AWAITED", "DB_TIME", "TEXT", "X"].iter().all(|name| names.contains(name)),
        "{names:?}"
    );
    assert!(!names.contains(&"P*"), "{names:?}");

    let heard = ask(&mut b, "ALL");
    let mut found: Vec<&str> = heard.iter().map(|one| one.key.as_str()).collect();
    found.sort_unstable();
    assert_eq!(found, names, "each once");
    let of = |key: &str| heard.iter().find(|one| one.key == key).unwrap();
    let (x, written) = (of("X"), of("X").time);
    assert!((0.0..120.0).contains(&written) && x.second >= 0.0, "since the start, and how often a second: {x:?}");
    let expected = Message { id: REQUEST_ID, source: b"a", source_aux: b"left", time: written, ..number("X", 1.5) };
    assert_eq!(*x, Heard { community: community.into(), second: x.second, ..Heard::of(&expected) });
    assert_eq!((of("TEXT").data, of("TEXT").text(), of("TEXT").number), (Data::STRING, "words", NO_NUMBER));
    let nothing = Message { id: REQUEST_ID, key: b"AWAITED", second: 0.0, ..Message::new(Kind::NOTIFY, Data::NOT_SET) };
    assert_eq!(*of("AWAITED"), Heard::of(&nothing), "nobody has written it");
    assert_eq!(of("DB_TIME").source, format!("MOOSDB_{community}"));

    let heard = ask(&mut b, "PROC_SUMMARY");
    assert!(heard.iter().all(|one| one.key == "PROC_SUMMARY" && one.data == Data::STRING));
    let mut texts: Vec<&str> = heard.iter().map(Heard::text).collect();
    texts.sort_unstable();
    let of_a = "a:SUBSCRIBED=,X,AWAITED,PUBLISHED=,X,TEXT";
    assert_eq!(texts, [of_a, "b:SUBSCRIBED=,PUBLISHED=", "watcher:SUBSCRIBED=,DB_EVENT,PUBLISHED="]);
    assert_eq!(a.settled().0, [], "the answers are the asker's alone");

    // Otherwise: it is refused, and nothing is cleared.
    watcher.events();
    b.say(&[request("DB_CLEAR")]);
    assert_eq!(b.settled().0, []);
    let said = watcher.events();
    assert!(said.len() == 1 && said[0].starts_with("refused=b variable=DB_CLEAR reason="), "{said:?}");
    b.say(&[register("X", 0.0)]);
    assert_eq!(numbers(&b.settled().0), [("X", 1.5)]);
    // Otherwise: a variable that is awaited is one as long as somebody waits for it.
    a.say(&[unregister("AWAITED")]);
    assert!(!a.settled().1.iter().any(|name| name == "AWAITED"));
}

#[test]
fn section_1_9_one_order_for_all() {
    const COUNT: usize = 200;
    let served = Served::start("section-9-order");
    let mut readers = open(&served, ["r", "s"]);
    for reader in &mut readers {
        reader.say(&[register("X", 0.0), register("Y", 0.0)]);
        reader.settled();
    }
    std::thread::scope(|scope| {
        for (name, key) in [("a", "X"), ("b", "Y")] {
            let mut wire = Wire::open(&served, name, Asynchronous);
            scope.spawn(move || {
                (0..COUNT).for_each(|n| wire.say(&[number(key, n as f64)]));
                wire.settled();
            });
        }
    });
    let heard = readers.map(|mut reader| {
        let heard = reader.settled().0;
        heard.iter().map(|one| (one.key.clone(), one.number)).collect::<Vec<_>>()
    });
    assert_eq!(heard[0].len(), 2 * COUNT);
    assert!(heard[0] == heard[1], "both hear both writers in the same order");
    for key in ["X", "Y"] {
        let of_one: Vec<f64> = heard[0].iter().filter(|(one, _)| one == key).map(|(_, number)| *number).collect();
        assert!(of_one.iter().zip(0..).all(|(number, n)| *number == f64::from(n)), "{key} in its writer's order");
    }
}

#[test]
fn section_1_11_the_server_s_own_variables() {
    let served = Served::start("section-11");
    let community = served.community.as_str();
    let mut a = served.moos("a");
    a.register("X", 0.0);
    a.register("AWAITED", 0.0);
    a.notify_number("X", 1.5);
    a.notify_text("WORDS", "a text that is longer than twenty-five letters");
    a.flush().unwrap();
    let mut b = served.moos("b");
    let own = ["DB_TIME", "DB_UPTIME", "DB_CLIENTS", "DB_EVENT", "DB_QOS", "DB_RWSUMMARY", "DB_VARSUMMARY"];
    own.iter().for_each(|key| b.register(key, 0.0));
    // Each is refreshed, with what was said meanwhile. Otherwise: by itself, every 2 s, and not with the packets of clients.
    let is_whole = |heard: &[Heard]| {
        let count = |key: &str| heard.iter().filter(|one| one.key == key).count();
        let says = |key: &str, what: &str| heard.iter().any(|one| one.key == key && one.text().contains(what));
        count("DB_UPTIME") >= 3 && says("DB_RWSUMMARY", "WORDS") && says("DB_VARSUMMARY", "WORDS")
    };
    let heard = hear(&mut b, "all of them, and what is new in them", |heard| {
        // It gives its signs of life.
        a.receive(std::time::Duration::from_millis(1), |_| {}).unwrap();
        is_whole(heard)
    });
    for one in &heard {
        assert_eq!((one.source.as_str(), one.community.as_str()), (&*format!("MOOSDB_{community}"), community));
        let is_number = ["DB_TIME", "DB_UPTIME"].contains(&one.key.as_str());
        assert_eq!(one.data, if is_number { Data::DOUBLE } else { Data::STRING }, "{one:?}");
    }
    let of = |key: &'static str| heard.iter().filter(move |one| one.key == key);
    let last = |key: &'static str| of(key).next_back().unwrap_or_else(|| panic!("no {key}")).text();
    // Seconds of MOOS' time, and since the start.
    assert!(of("DB_TIME").all(|one| one.number == one.time), "{heard:?}");
    let started: Vec<f64> = of("DB_UPTIME").map(|one| one.time - one.number).collect();
    assert!(started.iter().all(|one| (one - started[0]).abs() < 1e-3), "{started:?}");
    assert!(of("DB_UPTIME").is_sorted_by(|one, next| 0.0 <= one.number && one.number < next.number));
    // Otherwise: who came first stands first; a MOOSDB has the newest connection there.
    assert_eq!(last("DB_CLIENTS"), "a,b,");

    // Milliseconds. Otherwise: of all messages, and not of the signs of life alone.
    let quality: Vec<_> = last("DB_QOS").strip_suffix(',').unwrap().split(',').collect();
    assert_eq!(quality.len(), 2);
    for (one, name) in quality.iter().zip(["a", "b"]) {
        let (who, numbers) = one.split_once('=').unwrap();
        let numbers: Vec<f64> = numbers.split(':').map(|one| one.parse().unwrap()).collect();
        let [recent, max, min, mean] = numbers[..] else { panic!("{one}") };
        assert_eq!(who, name);
        assert!(0.0 <= min && min <= recent && recent <= max && min <= mean && mean <= max, "{one}");
    }
    let reads_and_writes: BTreeMap<&str, &str> =
        last("DB_RWSUMMARY").split(',').map(|one| one.split_once('=').unwrap()).collect();
    assert_eq!(reads_and_writes["a"], "X:AWAITED&X:WORDS");
    let (read, written) = reads_and_writes["b"].split_once('&').unwrap();
    let mut read: Vec<&str> = read.split(':').collect();
    read.sort_unstable();
    let mut all = own;
    all.sort_unstable();
    assert_eq!((&read[..], written), (&all[..], ""));

    // Name, time, last writer, rate, type and value, of which 25 letters, in columns.
    let table = last("DB_VARSUMMARY");
    let row = |key: &str| {
        let line = table.lines().find(|line| line.split(' ').next() == Some(key)).unwrap();
        let (name, rest) = line.split_at(21);
        let (time, rest) = rest.split_at(21);
        let (writer, rest) = rest.split_at(21);
        let (rate, rest) = rest.split_once("Hz ").unwrap();
        let numbers = [time, rate].map(|one| one.trim().parse::<f64>().unwrap());
        assert!(numbers.iter().all(|one| (0.0..120.0).contains(one)), "{line}");
        (name.trim_end(), writer.trim_end(), rest)
    };
    assert_eq!(row("X"), ("X", "a", "D 1.5"));
    assert_eq!(row("WORDS"), ("WORDS", "a", "S a text that is longer tha"));

    let said = |what: &'static str| move |heard: &[Heard]| heard.iter().any(|one| one.value == what.as_bytes());
    let c = served.moos("c");
    hear(&mut b, "who comes", said("connected=c"));
    drop(c);
    hear(&mut b, "who goes", said("disconnected=c"));
}

/// An app of elk's that has said a number, and waits for others.
struct Nav;

impl App for Nav {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        comms.register("GPS_*")?;
        Ok(comms.notify("NAV_X", 1.0)?)
    }

    fn on_new_mail(&mut self, _comms: &mut Comms, _mail: &Mail<'_>) -> Result<(), AppError> {
        Ok(())
    }
}

/// MOOS' apps say it themselves, by their library; elk's do as well, in the same words.
#[test]
fn section_1_11_what_an_app_says_of_itself() {
    let served = Served::start("section-11-status");
    let mut b = served.moos("b");
    b.register("NAV_STATUS", 0.0);
    settle(&mut b);
    let stop = Arc::new(AtomicBool::new(false));
    let (community, stopped) = (served.community.clone(), stop.clone());
    let app = std::thread::spawn(move || {
        let mut client = Client::connect(&community, "nav").unwrap();
        run_app_on(&mut Nav, &mut client, &stopped).unwrap();
    });
    let heard = hear(&mut b, "its status, again and again", |heard| heard.len() >= 2);
    stop.store(true, Ordering::Relaxed);
    app.join().unwrap();
    for one in heard {
        assert_eq!((one.key.as_str(), one.source.as_str(), one.data), ("NAV_STATUS", "nav", Data::STRING));
        let (numbers, lists) = one.text().split_once(",MOOSName=nav,").unwrap();
        let numbers: BTreeMap<&str, &str> = numbers.split(',').map(|part| part.split_once('=').unwrap()).collect();
        assert_eq!(numbers["AppErrorFlag"], "false");
        let [uptime, load, memory, most] =
            ["Uptime", "cpuload", "memory_kb", "memory_max_kb"].map(|name| numbers[name].parse::<f64>().unwrap());
        assert!(uptime >= 0.0 && load >= 0.0 && 0.0 < memory && memory <= most, "{numbers:?}");
        let expected = ["Publishing=\"NAV_X,\",", "Publishing=\"NAV_X,NAV_STATUS,\","];
        let (publishing, subscribing) = lists.split_at(lists.find("Subscribing").unwrap());
        assert!(expected.contains(&publishing), "{lists}");
        assert_eq!(subscribing, "Subscribing=\"GPS_*,\"");
    }
}
