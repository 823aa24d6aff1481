//! MOOS' text logs, and numbers for spreadsheets: types, digits, poses.

mod common;

use std::path::{Path, PathBuf};

use common::record;
use elk_bus::{Payload, TypeRef, Value, codec};
use elk_geometry::Pose;
use elk_log::alog::{AlogReader, AlogWriter};
use elk_log::csv::put_csv;
use elk_log::{LogReader, LogWriter, Metadata, Record};
use elk_spatial::messages::{CameraPose, Progress};
use nalgebra::{Point3, Vector3};

fn case(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name)
}

fn values(path: &Path) -> Vec<(String, Value)> {
    AlogReader::open(path).unwrap().map(Result::unwrap).map(|record| (record.key, record.value)).collect()
}

fn export(path: &Path, records: &[Record]) -> String {
    let _ = std::fs::remove_file(path);
    let mut alog = AlogWriter::create(path, 0.0).unwrap();
    records.iter().for_each(|record| alog.append(&record.as_ref()).unwrap());
    alog.finish().unwrap();
    std::fs::read_to_string(path).unwrap()
}

fn typed<T: Payload>(value: &T::View<'_>) -> Value {
    let mut bytes = Vec::new();
    codec::encode_onto(value, &mut bytes).unwrap();
    Value::Binary { type_: TypeRef::of::<T>().to_type(), bytes }
}

#[test]
fn a_variable_that_is_a_text_once_is_one_throughout() {
    let text = |text: &str| Value::Text(text.into());
    let read = values(&case("numtext.alog"));
    let read: Vec<_> = read.iter().map(|(key, value)| (key.as_str(), value.clone())).collect();
    let station = ["7", "home", "8"].map(|said| ("STATION", text(said)));
    assert_eq!(read[..3], station);
    assert_eq!(read[3..], [("VNAME", text("007")), ("HASH", Value::Double(1e5))]);
}

/// Regression: a line whose time was damaged was glued to the text before it, and what fitted nowhere was left out, both
/// without a word.
#[test]
fn a_damaged_line_is_said_and_a_text_of_several_lines_is_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.alog");
    let lines = [
        "%% LOGSTART 100.5",
        "-0.250 DB_TIME MOOSDB 7",
        "it goes on with nothing",
        "0.1 NOTE pHelm one",
        "two X pHelm",
        "0x8.2 DB_TIME MOOSDB 8",
        "three",
        "0.3 NOTE pHelm four",
        "3.5",
        "",
        "0.4 NO",
    ];
    std::fs::write(&path, lines.join("\n")).unwrap();
    let mut log = AlogReader::open(&path).unwrap();
    let read: Vec<Record> = log.by_ref().map(Result::unwrap).collect();
    let said: Vec<_> = read.into_iter().map(|record| (record.time, record.value)).collect();
    let text = |text: &str| Value::Text(text.into());
    assert_eq!(said, [(100.25, Value::Double(7.0)), (100.6, text("one\ntwo X pHelm")), (100.8, text("four\n3.5"))]);
    let damage = log.damage();
    let numbers: Vec<_> =
        damage.iter().map(|what| what.split("line ").nth(1).and_then(|what| what.split(' ').next()).unwrap()).collect();
    assert_eq!(numbers, ["3", "6", "7", "11"], "{damage:?}");
    assert!(
        damage[1].contains("does not begin with a time") && damage[3].contains("ends before its value"),
        "{damage:?}"
    );
}

#[test]
fn every_double_comes_back_from_a_text_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.alog");
    let of_case = values(&case("precise.alog"));
    assert!(of_case.iter().all(|(_, value)| matches!(value, Value::Double(_))), "{of_case:?}");
    let others = [1.0 / 3.0, f64::MIN_POSITIVE, 5e-324, -0.0, 1e15, 1e16, f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    let others = others.iter().map(|number| ("OTHER".to_owned(), Value::Double(*number)));
    let records: Vec<Record> =
        (0..).zip(of_case.into_iter().chain(others)).map(|(n, (key, value))| record(n, &key, value)).collect();
    export(&path, &records);
    let bits = |value: &Value| if let Value::Double(number) = value { number.to_bits() } else { 1 };
    let back: Vec<u64> = values(&path).iter().map(|(_, value)| bits(value)).collect();
    assert_eq!(back, records.iter().map(|record| bits(&record.value)).collect::<Vec<_>>());
}

/// Case 23: what came in one moment stays in its order, and names that differ late are two.
#[test]
fn one_moment_has_an_order_and_long_names_differ_to_their_end() {
    let folder = tempfile::tempdir().unwrap();
    let long = |last: char| format!("{}{last}", "N".repeat(100));
    let names = [long('1'), long('2'), "B_VAR".to_owned()];
    let records: Vec<Record> = (0..300)
        .map(|n| Record { time: 0.1, received: 0.1, ..record(n, &names[n as usize % 3], Value::Double(n as f64)) })
        .collect();
    let expected = || records.iter().map(|record| (record.key.clone(), record.value.clone()));
    let (alog, mcap) = (folder.path().join("run.alog"), folder.path().join("run.mcap"));
    export(&alog, &records);
    assert!(values(&alog).into_iter().eq(expected()));
    let mut log = LogWriter::create(&mcap, &Metadata::default()).unwrap();
    records.iter().for_each(|record| log.append(&record.as_ref()).unwrap());
    log.finish().unwrap();
    let back = LogReader::open(&mcap).unwrap().map(Result::unwrap).map(|record| (record.key, record.value));
    assert!(back.eq(expected()));
}

#[test]
fn poses_are_what_moos_calls_so_and_small_values_are_json() {
    let folder = tempfile::tempdir().unwrap();
    let looking = |direction| Pose::looking(Point3::new(1.0, 2.5, 0.75), direction);
    let camera = |number, direction| {
        record(number, "SIM_SENSOR", typed::<CameraPose>(&CameraPose { command: number, pose: looking(direction) }))
    };
    let progress = Progress { scan: 1, revision: 2, scans: 3, path_length_m: 0.1, free: 4, finished: true };
    let records = [
        camera(0, Vector3::x()),
        camera(1, -Vector3::z()),
        camera(2, -Vector3::y()),
        record(3, "PROGRESS", typed::<Progress>(&progress)),
    ];
    let alog = export(&folder.path().join("run.alog"), &records);
    let said = |key: &str| {
        let words = alog.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
        words.filter(|words| words.get(1) == Some(&key)).map(|words| words[3].to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(said("NAV_X"), ["1.00000"; 3]);
    assert_eq!((said("NAV_Y"), said("NAV_Z")), (vec!["2.50000".to_owned(); 3], vec!["0.75000".to_owned(); 3]));
    let headings: Vec<f64> = said("NAV_HEADING").iter().map(|heading| heading.parse().unwrap()).collect();
    assert_eq!(headings.len(), 2, "straight down there is none");
    assert!((headings[0] - 90.0).abs() < 1e-9 && (headings[1] - 180.0).abs() < 1e-9, "{headings:?}");
    assert!(said("PROGRESS")[0].contains("\"path_length_m\":0.1") && !folder.path().join("run.blog").exists());
}

/// What anybody says of a drive.
#[elk_bus::payload]
struct Drive {
    mode: Mode,
    /// Not a pose, whatever it is called.
    rotation: [f64; 4],
    translation: [f64; 3],
    last: Option<Option<u8>>,
}

#[elk_bus::payload]
enum Mode {
    Off,
    Cruise { speed: f64 },
}

#[test]
fn the_variant_of_an_enum_has_a_number_and_only_a_pose_is_one() {
    let csv = |mode| {
        let drive = Drive { mode, rotation: [1.0; 4], translation: [2.0; 3], last: Some(Some(7)) };
        let mut out = Vec::new();
        put_csv(&mut out, 0.5, &record(0, "DRIVE", typed::<Drive>(&drive)).as_ref()).unwrap();
        String::from_utf8(out).unwrap().replace("0.500000,DRIVE.", "").replace(",app,", " ")
    };
    let rest = "rotation[0] 1\nrotation[1] 1\nrotation[2] 1\nrotation[3] 1\n\
                translation[0] 2\ntranslation[1] 2\ntranslation[2] 2\nlast 7\n";
    assert_eq!(csv(Mode::Off), format!("mode 0\n{rest}"));
    assert_eq!(csv(Mode::Cruise { speed: 1.5 }), format!("mode 1\nmode.Cruise.speed 1.5\n{rest}"));
}

#[test]
fn numbers_of_poses_lists_and_flags_have_names_of_their_own() {
    let csv = |record: &Record| {
        let mut out = Vec::new();
        put_csv(&mut out, 0.5, &record.as_ref()).unwrap();
        String::from_utf8(out).unwrap()
    };
    let pose = Pose::looking(Point3::new(1.0, 2.5, 0.75), Vector3::x());
    let lines = csv(&record(0, "SIM_SENSOR", typed::<CameraPose>(&CameraPose { command: 7, pose })));
    for line in [
        "SIM_SENSOR.command,app,7",
        "SIM_SENSOR.pose.x,app,1",
        "SIM_SENSOR.pose.y,app,2.5",
        "SIM_SENSOR.pose.z,app,0.75",
    ] {
        assert!(lines.contains(&format!("0.500000,{line}\n")), "{lines}");
    }
    assert!(lines.contains("SIM_SENSOR.pose.qw,app,"), "{lines}");
    let progress = Progress { scan: 1, revision: 2, scans: 3, path_length_m: 0.1, free: u64::MAX, finished: true };
    let lines = csv(&record(0, "PROGRESS", typed::<Progress>(&progress)));
    assert!(
        lines.contains("PROGRESS.finished,app,1\n") && lines.contains(&format!("free,app,{}\n", u64::MAX)),
        "{lines}"
    );
    let json = Value::Text(r#"{"at":[1.5,-2],"label":"x","long":[1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17]}"#.into());
    assert_eq!(csv(&record(0, "POINT", json)), "0.500000,POINT.at[0],app,1.5\n0.500000,POINT.at[1],app,-2\n");
    assert_eq!(csv(&record(0, "HUGE", Value::Double(1e300))), "0.500000,HUGE,app,1e300\n");
    // As Python writes what is no number.
    let json = Value::Text(r#"{"x": 1.5, "y": NaN, "z": [-Infinity, 2]}"#.into());
    assert_eq!(csv(&record(0, "P", json)), "0.500000,P.x,app,1.5\n0.500000,P.z[1],app,2\n");
}

/// Regression: a text of any length was parsed, for sixteen times its memory, and one long name stood before each
/// number.
#[test]
fn a_long_text_and_long_names_make_no_large_table() {
    let bytes = |text: String| {
        let mut out = Vec::new();
        put_csv(&mut out, 0.5, &record(0, "TRAP", Value::Text(text)).as_ref()).unwrap();
        out.len()
    };
    let numbers = |count: usize| (0..count).map(|n| format!("\"{n}\":1")).collect::<Vec<_>>().join(",");
    let named = |name: usize, count: usize| format!("{{\"{}\":{{{}}}}}", "x".repeat(name), numbers(count));
    assert!(bytes(named(200, 1000)) > 200_000, "names that a person can read have their lines");
    assert_eq!(bytes(named(100_000, 1000)), 0);
    assert_eq!(bytes(format!("[[{}0],1]", "0,".repeat(1 << 20))), 0, "longer than what is looked into");
    assert_eq!(bytes("[".repeat(1 << 19) + &"]".repeat(1 << 19)), 0, "deeper");
}
