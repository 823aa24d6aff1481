//! What goes into a log comes out of it: whole, cut anywhere, and through an independent reader.

#[path = "../../../tests/common/skip.rs"]
mod skip;

use std::path::{Path, PathBuf};
use std::process::Command;

use elk_bus::{Type, Value};
use elk_log::{LogError, LogReader, LogWriter, Metadata, Record};
use proptest::prelude::*;

fn metadata() -> Metadata {
    Metadata {
        mission_name: "hall.xml".into(),
        mission: "<Mission name=\"hall – größer\"/>\n".into(),
        version: "0.1.0".into(),
        seed: u64::MAX,
        started: 1_795_473_001.123_456_7,
        world: "worlds/hall.obj".into(),
        world_checksum: "00000000deadbeef".into(),
        effective_mission: "<Mission name=\"hall – größer\" seed=\"7\"/>\n".into(),
        run: "{\"version\": \"0.1.0\"}\n".into(),
    }
}

/// Writes `records`, flushing after every `per_flush` of them.
fn write(path: &Path, records: &[Record], per_flush: usize) {
    let mut log = LogWriter::create(path, &metadata()).unwrap();
    for chunk in records.chunks(per_flush) {
        chunk.iter().for_each(|record| log.append(&record.as_ref()).unwrap());
        log.flush().unwrap();
    }
    log.finish().unwrap();
}

/// The records with every number as its bits: NaN is NaN, and −0 is not 0.
fn bits(record: &Record) -> (Record, [u64; 4]) {
    let number = match record.value {
        Value::Double(number) => number,
        _ => 0.0,
    };
    let mut plain = Record { time: 0.0, received: 0.0, ..record.clone() };
    if let Value::Double(number) = &mut plain.value {
        *number = 0.0;
    }
    (plain, [record.time, record.received, number, 0.0].map(f64::to_bits))
}

fn any_double() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(f64::from_bits)
}

fn any_value() -> impl Strategy<Value = Value> {
    prop_oneof![
        any_double().prop_map(Value::Double),
        any::<String>().prop_map(Value::Text),
        ("[A-C]", 0..3u64, prop::collection::vec(any::<u8>(), 0..60))
            .prop_map(|(name, layout, bytes)| Value::Binary { type_: Type::undescribed(&name, layout), bytes }),
    ]
}

fn any_record() -> impl Strategy<Value = Record> {
    let names = ("[A-D]", "[a-c]", any::<String>(), "(here|there)?");
    (names, any_double(), any::<u64>(), any_double(), any_value()).prop_map(
        |(names, time, sequence, received, value)| {
            let (key, source, source_aux, community) = names;
            let (order, epoch) = (sequence / 2, sequence % 3);
            Record { key, source, source_aux, community, time, sequence, received, order, epoch, value }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn every_record_comes_back_bit_for_bit(records in prop::collection::vec(any_record(), 0..40), per_flush in 1..10usize) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        write(&path, &records, per_flush);
        let mut log = LogReader::open(&path).unwrap();
        prop_assert_eq!(log.metadata(), &metadata());
        let back: Vec<_> = log.by_ref().map(|record| bits(&record.unwrap())).collect();
        prop_assert_eq!(back, records.iter().map(bits).collect::<Vec<_>>());
        prop_assert!(log.whole());
    }

    /// Damage is found by the chunk's checksum or by the format: an error, an end, or records, never a panic.
    #[test]
    fn a_flipped_bit_is_no_panic(at in 0..4000usize, bit in 0..8u32) {
        let folder = tempfile::tempdir().unwrap();
        let path = small_log(folder.path());
        let mut bytes = std::fs::read(&path).unwrap();
        let at = at % bytes.len();
        bytes[at] ^= 1 << bit;
        std::fs::write(&path, bytes).unwrap();
        if let Ok(log) = LogReader::open(&path) {
            log.for_each(drop);
        }
    }
}

fn small_records() -> Vec<Record> {
    (0..9u64)
        .map(|i| Record {
            key: ["DEPTH", "NOTE", "SCAN"][i as usize % 3].into(),
            source: "sensor".into(),
            source_aux: String::new(),
            community: "elk".into(),
            time: i as f64 * 0.1,
            sequence: i + (1 << 40),
            received: i as f64 * 0.1 + 0.001,
            order: i,
            epoch: 1,
            value: match i % 3 {
                0 => Value::Double(i as f64 / 7.0),
                1 => Value::Text(format!("number \"{i}\"\n")),
                _ => Value::Binary { type_: Type::undescribed("Scan", 7), bytes: vec![i as u8; 20] },
            },
        })
        .collect()
}

fn small_log(folder: &Path) -> PathBuf {
    let path = folder.join("small.mcap");
    write(&path, &small_records(), 2);
    path
}

#[test]
fn a_log_cut_anywhere_gives_a_prefix_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = small_log(folder.path());
    let whole = std::fs::read(&path).unwrap();
    let cut = folder.path().join("cut.mcap");
    let mut read_before = 0;
    for length in 0..whole.len() {
        std::fs::write(&cut, &whole[..length]).unwrap();
        let mut log = match LogReader::open(&cut) {
            Ok(log) => log,
            Err(LogError::NoLog { .. }) if length < 8 => continue,
            Err(error) => panic!("cut at {length}: {error}"),
        };
        let records: Vec<Record> = log.by_ref().map(Result::unwrap).collect();
        assert!(small_records().starts_with(&records), "cut at {length}");
        assert!(!log.whole() && !log.damage().is_empty(), "cut at {length}");
        assert!(records.len() >= read_before, "a longer log has no fewer records: cut at {length}");
        read_before = records.len();
    }
    assert_eq!(read_before, small_records().len());
}

#[test]
fn what_was_flushed_is_readable_while_the_log_grows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let mut log = LogWriter::create(&path, &metadata()).unwrap();
    let records = small_records();
    for (i, record) in records.iter().enumerate() {
        log.append(&record.as_ref()).unwrap();
        log.flush().unwrap();
        let read: Vec<Record> = LogReader::open(&path).unwrap().map(Result::unwrap).collect();
        assert_eq!(read, records[..=i]);
    }
}

#[test]
fn a_folder_that_is_not_there_and_a_file_that_is_no_log_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let nowhere = folder.path().join("nowhere/log.mcap");
    let error = LogWriter::create(&nowhere, &metadata()).err().unwrap();
    assert!(error.to_string().contains("nowhere/log.mcap"), "{error}");
    let text = folder.path().join("mission.xml");
    std::fs::write(&text, "<Mission></Mission>").unwrap();
    assert!(matches!(LogReader::open(&text), Err(LogError::NoLog { .. })));
}

#[test]
fn an_independent_reader_sees_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = small_log(folder.path());
    if !Command::new("python3").args(["-c", "import mcap"]).output().is_ok_and(|o| o.status.success()) {
        let why = "python3 with the package `mcap` is not installed";
        skip::skip("an_independent_reader_sees_the_same", "mcap", why);
        return;
    }
    let script = r#"
import json, sys
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
records = list(StreamReader(open(sys.argv[1], "rb"), validate_crcs=True).records)
print(sum(type(r).__name__ == "Message" for r in records))
reader = make_reader(open(sys.argv[1], "rb"), validate_crcs=True)
print(reader.get_summary().statistics.message_count)
print([json.loads(m.data)["value"] for _, _, m in reader.iter_messages(topics=["NOTE"])] == ['number "%d"\n' % i for i in (1, 4, 7)])
print(next(reader.iter_attachments()).name)
"#;
    let output = Command::new("python3").args(["-c", script]).arg(&path).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(said, "9\n9\nTrue\nhall.xml\n", "{}", String::from_utf8_lossy(&output.stderr));
}
