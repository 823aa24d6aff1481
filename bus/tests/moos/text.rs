//! Typed values that clients of MOOS' hear and say as texts.

use elk_bus::moos::gateway::GatewayOptions;
use elk_bus::moos::message::{Data, Kind, Message, NO_ID, REQUEST_ID};
use elk_bus::moos::text::Texts;
use elk_bus::{Client, Key, any, text};

use crate::common::events::Patience;
use crate::server::{MOMENT, Served, hear, settle};

/// As in the thesis (4.3.2.2): x (m), y (m) and heading (rad).
#[elk_bus::payload]
#[derive(Debug, Clone, PartialEq)]
pub struct PoseEstimate {
    /// x, y and heading.
    pub pose: [f64; 3],
}

/// A list that may be long.
#[elk_bus::payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Ranges {
    /// Distances.
    #[describe(unit = "m")]
    pub ranges: Vec<f64>,
}

const POSE_ESTIMATE: Key<PoseEstimate> = Key::new("POSE_ESTIMATE");
const POSE_BYTES: Key<PoseEstimate> = Key::new("POSE_BYTES");
const RANGES: Key<Ranges> = Key::new("RANGES");

const IN_THE_THESIS: &str = "Name=POSE_ESTIMATE,Pose=[3x1]{0.4,1.9,2.2}";
const POSE: PoseEstimate = PoseEstimate { pose: [0.4, 1.9, 2.2] };

fn served(name: &str) -> Served {
    let texts = Texts::of("POSE_ESTIMATE, RANGES NOBODY_S");
    Served::with(name, |options| GatewayOptions { texts, ..options })
}

/// What an app of elk's hears of a variable, in words, until there is as much: poses by their numbers, texts as they are.
fn elk_hears(client: &mut Client, key: &str, enough: usize) -> Vec<(String, f64)> {
    let (patience, mut heard) = (Patience::new(), Vec::new());
    while heard.len() < enough {
        patience.left(format_args!("{key}, after {heard:?}"));
        let mut note = |mail: &elk_bus::Mail<'_>| {
            if mail.key() == key {
                let pose = || format!("{:?}", mail.decode(&POSE_ESTIMATE).unwrap().pose);
                heard.push((mail.as_text().map_or_else(pose, str::to_owned), mail.time()));
            }
        };
        client.receive(MOMENT, &mut note).unwrap();
    }
    heard
}

#[test]
fn a_pose_is_a_text_for_moos_and_a_value_for_elk() {
    let served = served("text-both-ways");
    let (mut elk, mut moos) = (served.elk("pNav"), served.moos("pHelm"));
    moos.register("POSE_ESTIMATE", 0.0);
    moos.register("POSE_BYTES", 0.0);
    settle(&mut moos);
    elk.comms.publish(&POSE_ESTIMATE, &POSE).unwrap();
    elk.comms.publish(&POSE_BYTES, &POSE).unwrap();
    elk.comms.flush().unwrap();
    let heard = hear(&mut moos, "both poses", |heard| heard.len() == 2);
    assert_eq!((heard[0].data, heard[0].text(), heard[0].source.as_str()), (Data::STRING, IN_THE_THESIS, "pNav"));
    assert_eq!(heard[1].data, Data::BINARY, "the mission does not name this one");

    // Whoever comes late is given the latest value as text, and so is who asks for all of them.
    let mut late = served.moos("late");
    late.register("POSE_ESTIMATE", 0.0);
    let heard = hear(&mut late, "the latest pose", |heard| !heard.is_empty());
    assert_eq!((heard[0].text(), heard[0].id), (IN_THE_THESIS, NO_ID));
    late.ask("ALL");
    let all = hear(&mut late, "all variables", |heard| heard.iter().any(|one| one.key == "POSE_BYTES"));
    let found = |key: &str| all.iter().find(|one| one.key == key && one.id == REQUEST_ID).unwrap();
    assert_eq!((found("POSE_ESTIMATE").data, found("POSE_ESTIMATE").text()), (Data::STRING, IN_THE_THESIS));
    assert_eq!(found("POSE_BYTES").data, Data::BINARY);

    // And back: as it is printed in the thesis, with the time.
    elk.comms.register(any("POSE_ESTIMATE").from("pHelm")).unwrap();
    elk.comms.flush().unwrap();
    moos.notify_text("POSE_ESTIMATE", "Name=POSE_ESTIMATE, Time=1308749109, Pose=[3x1]{0.5,1.9,2.2}");
    moos.flush().unwrap();
    let back = elk_hears(&mut elk, "POSE_ESTIMATE", 1);
    assert_eq!(back, [("[0.5, 1.9, 2.2]".to_owned(), 1_308_749_109.0)]);
    let heard = hear(&mut late, "what another client of MOOS' says", |heard| !heard.is_empty());
    assert_eq!(heard[0].text(), "Name=POSE_ESTIMATE,Pose=[3x1]{0.5,1.9,2.2}");
}

#[test]
fn what_nobody_has_written_is_of_the_type_that_is_read_there() {
    let served = served("text-reader");
    let (mut elk, mut moos) = (served.elk("reader"), served.moos("writer"));
    elk.comms.register(&POSE_ESTIMATE).unwrap();
    elk.comms.flush().unwrap();
    // The registration is on its way before anything of this client's, once it hears of itself.
    elk.comms.register(text("HELLO")).unwrap();
    elk.comms.notify("HELLO", "there").unwrap();
    elk.comms.flush().unwrap();
    elk_hears(&mut elk, "HELLO", 1);
    moos.notify_text("POSE_ESTIMATE", IN_THE_THESIS);
    moos.flush().unwrap();
    assert_eq!(elk_hears(&mut elk, "POSE_ESTIMATE", 1)[0].0, "[0.4, 1.9, 2.2]");
}

#[test]
fn a_text_that_is_no_value_is_refused_in_words() {
    let served = served("text-refused");
    let mut elk = served.elk("elk");
    elk.comms.publish(&POSE_ESTIMATE, &POSE).unwrap();
    elk.comms.publish(&RANGES, &Ranges { ranges: vec![1.0; 10_000] }).unwrap();
    elk.comms.register(text("DB_EVENT")).unwrap();
    elk.comms.register(any("POSE_ESTIMATE").from("moos")).unwrap();
    elk.comms.flush().unwrap();
    let mut moos = served.moos("moos");
    moos.register("RANGES", 0.0);
    let heard = hear(&mut moos, "a long list", |heard| !heard.is_empty());
    assert_eq!(heard[0].data, Data::BINARY, "more than what becomes a text");
    moos.notify_text("POSE_ESTIMATE", "Name=POSE_ESTIMATE,Pose=[2x1]{0.4,1.9}");
    moos.notify_text("NOBODY_S", "X=1");
    moos.say(&Message { key: b"POSE_ESTIMATE", value: b"\xff", time: 1.0, ..Message::new(Kind::NOTIFY, Data::STRING) });
    moos.notify_text("POSE_ESTIMATE", IN_THE_THESIS);
    moos.flush().unwrap();
    let (patience, mut said, mut taken) = (Patience::new(), Vec::new(), None);
    while said.len() < 3 || taken.is_none() {
        patience.left(format_args!("what was refused: {said:?}"));
        let mut note = |mail: &elk_bus::Mail<'_>| {
            said.extend(mail.as_text().filter(|text| text.starts_with("refused=moos")).map(str::to_owned));
            if mail.key() == "POSE_ESTIMATE" {
                taken = Some(mail.decode(&POSE_ESTIMATE).unwrap());
            }
        };
        elk.receive(MOMENT, &mut note).unwrap();
    }
    said.sort();
    let expected = [
        "variable=NOBODY_S reason=nobody has written it or reads it by its name, so that nobody knows its type",
        "variable=POSE_ESTIMATE reason=this is no PoseEstimate: Pose is \"[2x1]{0.4,1.9}\"; it has to be [3x1]{…}",
        "variable=RANGES reason=it is told as bytes and not as text: its value has 80008 bytes; at most 65536 become a text",
    ];
    assert_eq!(said, expected.map(|words| format!("refused=moos {words}")));
    assert_eq!(taken, Some(POSE), "what came behind it was taken");
}
