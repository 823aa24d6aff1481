//! What clients of MOOS' and of elk's hear of each other.

use std::time::Duration;

use elk_bus::moos::gateway::GatewayOptions;
use elk_bus::moos::message::{Data, Kind, Message, NO_ID, REQUEST_ID};
use elk_bus::{Client, Key, Value, any, number, text};

use crate::common::events::Patience;
use crate::server::{Heard, MOMENT, Served, exchange, hear, settle};

/// A payload of any size.
#[elk_bus::payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Blob {
    /// Its bytes.
    pub bytes: Vec<u8>,
}

const BLOB: Key<Blob> = Key::new("BLOB");

/// What an app of elk's hears until `enough`.
fn elk_hears(client: &mut Client, what: &str, enough: usize) -> Vec<(String, String, Value)> {
    let (patience, mut heard) = (Patience::new(), Vec::new());
    while heard.len() < enough {
        patience.left(what);
        let mut note = |mail: &elk_bus::Mail<'_>| {
            heard.push((mail.key().to_owned(), mail.source().to_owned(), mail.value().to_value()));
        };
        client.receive(MOMENT, &mut note).unwrap();
    }
    heard
}

#[test]
fn numbers_texts_and_bytes_go_both_ways() {
    let served = Served::start("both-ways");
    let (mut elk, mut moos) = (served.elk("elk"), served.moos("moos"));
    elk.comms.register(any("M_*")).unwrap();
    elk.comms.flush().unwrap();
    moos.register("E_NUMBER", 0.0);
    moos.register("E_TEXT", 0.0);
    moos.register("BLOB", 0.0);
    settle(&mut moos);
    elk.receive(Duration::ZERO, |_| {}).unwrap();

    moos.notify_number("M_NUMBER", 2.5);
    moos.notify_text("M_TEXT", "elks can dance");
    moos.notify_bytes("M_BYTES", &[0, 255, 7]);
    moos.flush().unwrap();
    let heard = elk_hears(&mut elk, "what the client of MOOS' says", 3);
    assert_eq!(heard[0], ("M_NUMBER".into(), "moos".into(), Value::Double(2.5)));
    assert_eq!(heard[1], ("M_TEXT".into(), "moos".into(), "elks can dance".into()));
    let Value::Binary { type_, bytes } = &heard[2].2 else { panic!("{heard:?}") };
    assert_eq!((type_.as_ref().name(), &bytes[..]), ("MOOS binary", &[0, 255, 7][..]));

    elk.comms.notify("E_NUMBER", -7.25).unwrap();
    elk.comms.notify("E_TEXT", "wörter").unwrap();
    // Larger than what travels in a batch: it lies in shared memory, where a client of MOOS' cannot look.
    let blob = Blob { bytes: (0..1_000_000_u32).map(|i| i as u8).collect() };
    elk.comms.publish(&BLOB, &blob).unwrap();
    elk.comms.publish(&BLOB, &Blob { bytes: vec![1, 2] }).unwrap();
    elk.comms.flush().unwrap();
    let heard = hear(&mut moos, "what the app of elk's says", |heard| heard.len() == 4);
    assert_eq!((heard[0].data, heard[0].number, heard[0].source.as_str()), (Data::DOUBLE, -7.25, "elk"));
    assert_eq!((heard[1].data, heard[1].text()), (Data::STRING, "wörter"));
    let community = served.community.as_str();
    assert!(heard.iter().all(|one| one.community == community && one.kind == Kind::NOTIFY), "{heard:?}");
    assert_eq!(heard.iter().map(|one| one.id).collect::<Vec<_>>(), [0, 1, 2, 3], "numbered as MOOS' clients number");
    assert_eq!((heard[2].data, heard[3].data), (Data::BINARY, Data::BINARY));
    let decoded = |heard: &Heard| elk_bus::codec::decode::<Blob>(&heard.value).unwrap();
    assert_eq!(decoded(&heard[2]), blob);
    assert_eq!(decoded(&heard[3]).bytes, [1, 2]);

    // And back, as the type that the variable carries.
    elk.comms.register(&BLOB).unwrap();
    elk.comms.flush().unwrap();
    moos.notify_bytes("BLOB", &heard[3].value);
    moos.flush().unwrap();
    let patience = Patience::new();
    let mut came = None;
    while came.is_none() {
        patience.left("the value that came back");
        let mut note = |mail: &elk_bus::Mail<'_>| {
            if mail.source() == "moos" {
                came = Some(mail.decode(&BLOB).unwrap());
            }
        };
        elk.receive(MOMENT, &mut note).unwrap();
    }
    assert_eq!(came.unwrap().bytes, [1, 2]);
}

#[test]
fn all_of_it_comes_in_order_however_fast() {
    const COUNT: i32 = 50_000;
    let served = Served::start("order");
    let mut reader = served.elk("reader");
    reader.comms.register(number("N").lossless()).unwrap();
    reader.comms.flush().unwrap();
    let (mut a, mut b) = (served.moos("a"), served.moos("b"));
    b.register("N", 0.0);
    settle(&mut b);
    std::thread::scope(|scope| {
        scope.spawn(move || {
            for i in 0..COUNT {
                a.notify_number("N", f64::from(i));
                if i % 100 == 0 {
                    a.flush().unwrap();
                }
            }
            a.flush().unwrap();
            settle(&mut a);
        });
        scope.spawn(|| {
            let heard = hear(&mut b, "the client of MOOS'", |heard| heard.len() == COUNT as usize);
            assert!(heard.iter().zip(0..).all(|(one, i)| one.number == f64::from(i) && one.id == i));
        });
        let heard = elk_hears(&mut reader, "the app of elk's", COUNT as usize);
        assert!(heard.iter().zip(0..).all(|((.., value), i)| *value == Value::Double(f64::from(i))));
    });
}

#[test]
fn a_synchronous_client_hears_what_came_since_it_asked_last() {
    let served = Served::start("synchronous");
    let (mut old, mut a) = (served.synchronous("old"), served.moos("a"));
    old.register("X", 0.0);
    let heard = exchange(&mut old);
    assert!(
        heard.len() == 1 && heard[0].kind == Kind::NULL && (heard[0].number - old.time()).abs() < 60.0,
        "{heard:?}"
    );
    for i in 0..3 {
        a.notify_number("X", f64::from(i));
    }
    settle(&mut a);
    old.notify_text("FROM_OLD", "hello");
    let heard = exchange(&mut old);
    assert_eq!(heard[0].kind, Kind::NULL);
    assert_eq!(heard[1..].iter().map(|one| one.number).collect::<Vec<_>>(), [0.0, 1.0, 2.0]);
    a.register("FROM_OLD", 0.0);
    let heard = hear(&mut a, "the latest value", |heard| !heard.is_empty());
    assert_eq!((heard[0].text(), heard[0].source.as_str(), heard[0].id), ("hello", "old", NO_ID));
    // It is given nothing that it has not asked for.
    a.notify_number("X", 9.0);
    settle(&mut a);
    assert!(matches!(old.read(Duration::from_millis(100), &mut |_| {}), Ok(None)));
}

#[test]
fn the_server_answers_what_it_is_asked_and_passes_over_the_rest() {
    let served = Served::start("requests");
    let (mut a, mut b) = (served.moos("a"), served.moos("b"));
    a.register("Y", 0.0);
    a.notify_number("X", 1.5);
    a.notify_text("TEXT", "words");
    settle(&mut a);
    b.ask("NOTHING_THAT_IS_KNOWN");
    b.ask("VAR_SUMMARY");
    let heard = hear(&mut b, "an answer", |heard| !heard.is_empty());
    assert!(heard.len() == 1 && heard[0].id == REQUEST_ID && heard[0].data == Data::STRING, "{heard:?}");
    let names: Vec<&str> = heard[0].text().split(',').collect();
    assert!(names.is_sorted() && names.contains(&"X") && names.contains(&"DB_TIME"), "{names:?}");

    b.ask("PROC_SUMMARY");
    let heard = hear(&mut b, "an answer", |heard| heard.len() == 2);
    let of_a = heard.iter().find(|one| one.text().starts_with("a:")).unwrap();
    assert!(of_a.text().starts_with("a:SUBSCRIBED=") && of_a.text().contains("PUBLISHED=,X,TEXT"), "{}", of_a.text());

    b.ask("ALL");
    let heard = hear(&mut b, "an answer", |heard| !heard.is_empty());
    assert!(heard.iter().all(|one| one.id == REQUEST_ID && one.kind == Kind::NOTIFY));
    let of = |key: &str| heard.iter().find(|one| one.key == key).unwrap_or_else(|| panic!("{key}: {heard:?}"));
    assert_eq!((of("X").data, of("X").number, of("X").source.as_str()), (Data::DOUBLE, 1.5, "a"));
    assert!((0.0..120.0).contains(&of("X").time), "since the server's start: {}", of("X").time);
    assert_eq!((of("TEXT").data, of("TEXT").text()), (Data::STRING, "words"));
    assert_eq!(of("DB_CLIENTS").source, format!("MOOSDB_{}", served.community));
}

#[test]
fn the_server_s_own_variables_are_there_and_who_comes_and_goes_is_said() {
    let served = Served::start("own");
    let mut watcher = served.moos("watcher");
    let own = ["DB_TIME", "DB_UPTIME", "DB_CLIENTS", "DB_EVENT", "DB_QOS", "DB_RWSUMMARY", "DB_VARSUMMARY"];
    own.iter().for_each(|key| watcher.register(key, 0.0));
    let all = |heard: &[Heard]| own.iter().all(|key| heard.iter().any(|one| one.key == *key));
    let heard = hear(&mut watcher, "all of them", all);
    for one in &heard {
        let is_number = ["DB_TIME", "DB_UPTIME"].contains(&one.key.as_str());
        assert_eq!(one.data, if is_number { Data::DOUBLE } else { Data::STRING }, "{one:?}");
    }
    let client = served.moos("guest");
    let event = |wanted: &'static str| move |heard: &[Heard]| heard.iter().any(|one| one.value == wanted.as_bytes());
    hear(&mut watcher, "who comes", event("connected=guest"));
    drop(client);
    hear(&mut watcher, "who goes", event("disconnected=guest"));
    let names = |heard: &[Heard]| heard.iter().any(|one| one.key == "DB_CLIENTS" && one.text() == "watcher,");
    hear(&mut watcher, "who is there", names);
}

#[test]
fn what_is_not_taken_is_said() {
    let served = Served::start("refused");
    let (mut elk, mut a) = (served.elk("elk"), served.moos("a"));
    elk.comms.register(text("DB_EVENT")).unwrap();
    elk.comms.flush().unwrap();
    a.notify_number("X", 1.0);
    a.notify_text("X", "one");
    a.notify_bytes("LONGEST", &vec![0; 1 << 20]);
    a.notify_bytes("TOO_LONG", &vec![0; 3 << 20]);
    a.notify_number("DB_TIME", 0.0);
    a.notify_number("X", 2.0);
    a.flush().unwrap();
    let (patience, mut said) = (Patience::new(), Vec::new());
    while said.len() < 3 {
        patience.left(format_args!("what was refused: {said:?}"));
        let mut note = |mail: &elk_bus::Mail<'_>| {
            said.extend(mail.as_text().filter(|text| text.starts_with("refused=a")).map(str::to_owned));
        };
        elk.receive(MOMENT, &mut note).unwrap();
    }
    said.sort();
    let wanted = ["variable=DB_TIME", "variable=TOO_LONG reason=a message of", "variable=X reason=X carries numbers"];
    assert!(said.iter().zip(wanted).all(|(said, wanted)| said.contains(wanted)), "{said:?}");
    a.register("X", 0.0);
    a.register("LONGEST", 0.0);
    let heard = hear(&mut a, "what was taken", |heard| heard.len() == 2);
    let of = |key: &str| heard.iter().find(|one| one.key == key).unwrap();
    assert_eq!(of("X").number, 2.0, "and what came behind it was taken");
    assert_eq!(of("LONGEST").value.len(), 1 << 20, "a value of 1 MiB is not too long, with its names");
}

#[test]
fn names_of_others_are_taken_where_that_is_allowed() {
    let served = Served::with("sources", |options| GatewayOptions { any_source: true, ..options });
    let mut reader = served.elk("reader");
    reader.comms.register(any("X").from("pNav")).unwrap();
    reader.comms.flush().unwrap();
    reader.receive(Duration::ZERO, |_| {}).unwrap();
    let mut player = served.moos("player");
    let message =
        Message { source: b"pNav", key: b"X", number: 1.0, time: 5.0, ..Message::new(Kind::NOTIFY, Data::DOUBLE) };
    player.say(&message);
    player.flush().unwrap();
    assert_eq!(elk_hears(&mut reader, "what is played", 1)[0].1, "pNav");
}

/// A client of shared memory and one of MOOS' speak as one source at the same time: all readers hear the same order, each
/// speaker's own is kept, and nothing is missing, of whatever kind the values are.
#[test]
fn what_both_kinds_of_client_say_as_one_source_is_one_sequence() {
    const COUNT: usize = 600;
    let served = Served::with("one-source", |options| GatewayOptions { any_source: true, ..options });
    let (mut elk, mut moos) = (served.elk("elk-reader"), served.moos("moos-reader"));
    for key in ["NUMBER", "TEXT"] {
        elk.comms.register(any(key)).unwrap();
        moos.register(key, 0.0);
    }
    elk.comms.flush().unwrap();
    settle(&mut moos);
    elk.receive(Duration::ZERO, |_| {}).unwrap();
    let (by_elk, by_moos) = std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut nav = served.elk("nav");
            for n in 0..COUNT {
                match n % 3 {
                    0 => nav.comms.notify("NUMBER", n as f64).unwrap(),
                    _ => nav.comms.notify("TEXT", n.to_string()).unwrap(),
                }
                if n % 10 == 9 {
                    nav.comms.flush().unwrap();
                }
            }
        });
        scope.spawn(|| {
            let mut player = served.moos("player");
            for n in COUNT..2 * COUNT {
                let said = n.to_string();
                let (number, text) =
                    (Message::new(Kind::NOTIFY, Data::DOUBLE), Message::new(Kind::NOTIFY, Data::STRING));
                let message = match n % 3 {
                    0 => Message { key: b"NUMBER", number: n as f64, ..number },
                    _ => Message { key: b"TEXT", value: said.as_bytes(), ..text },
                };
                player.say(&Message { source: b"nav", time: 5.0, ..message });
                if n % 7 == 6 {
                    player.flush().unwrap();
                }
            }
            settle(&mut player);
        });
        let of_moos =
            scope.spawn(|| hear(&mut moos, "all of both, as a client of MOOS'", |heard| heard.len() == 2 * COUNT));
        let of_elk = elk_hears(&mut elk, "all of both, in shared memory", 2 * COUNT);
        let of_moos = of_moos.join().unwrap();
        let by_elk = of_elk.into_iter().map(|(_, source, value)| {
            let n = match value {
                Value::Double(number) => number as usize,
                Value::Text(text) => text.parse().unwrap(),
                other => panic!("{other:?}"),
            };
            (source, n)
        });
        let by_moos = of_moos.iter().map(|one| {
            let n = if one.data == Data::DOUBLE { one.number as usize } else { one.text().parse().unwrap() };
            (one.source.clone(), n)
        });
        (by_elk.collect::<Vec<_>>(), by_moos.collect::<Vec<_>>())
    });
    assert!(by_elk == by_moos, "both readers hear one order");
    assert!(by_elk.iter().all(|(source, _)| source == "nav"));
    let (of_elk, of_moos): (Vec<usize>, Vec<usize>) = by_elk.iter().map(|(_, n)| *n).partition(|n| *n < COUNT);
    assert!(of_elk.into_iter().eq(0..COUNT) && of_moos.into_iter().eq(COUNT..2 * COUNT), "each as it was said");
}
