//! Damaged logs: cut anywhere, flipped bits, lengths of a universe, clocks that run backwards. Clear words, no panic, no
//! hang, and no memory for what is not there.
//!
//! The fuzz targets in `tests/fuzz/` drive the same functions for as long as one likes.

mod common;

use std::path::Path;

use elk_bus::{Type, Value};
use elk_log::fuzzing::{read_alog, read_log};
use elk_log::{Compression, Index, LogOptions, LogReader, LogWriter, Metadata, Record};

fn record(number: u64) -> Record {
    let value = match number % 3 {
        0 => Value::Double(number as f64),
        1 => Value::Text("some words".into()),
        _ => Value::Binary { type_: Type::undescribed("Unknown", 1), bytes: vec![number as u8; 50] },
    };
    common::record(number, &format!("KEY_{}", number % 3), value)
}

/// Six chunks of five records.
fn log_bytes(folder: &Path, compression: Compression) -> Vec<u8> {
    let path = folder.join("whole.mcap");
    let _ = std::fs::remove_file(&path);
    let options = LogOptions { compression, ..LogOptions::default() };
    let mut log = LogWriter::create_with(&path, &Metadata::default(), options).unwrap();
    for number in 0..30 {
        log.append(&record(number).as_ref()).unwrap();
        if number % 5 == 4 {
            log.flush().unwrap();
        }
    }
    log.finish().unwrap();
    std::fs::read(&path).unwrap()
}

/// Numbers that look random and are the same every time.
fn random(seed: &mut u64) -> usize {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 33) as usize
}

/// Where the last two chunks begin.
fn last_two_chunks(bytes: &[u8]) -> usize {
    let (mut at, mut chunks) = (8, Vec::new());
    while at + 9 <= bytes.len() {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        match bytes[at] {
            6 => chunks.push(at),
            15 => break,
            _ => {}
        }
        at += 9 + length;
    }
    assert_eq!(chunks.len(), 6);
    chunks[4]
}

#[test]
fn a_log_cut_at_any_byte_gives_every_message_before_it() {
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut.mcap");
    for compression in [Compression::None, Compression::Lz4] {
        let bytes = log_bytes(folder.path(), compression);
        let mut seed = 1;
        let anywhere: Vec<usize> = (0..1000).map(|_| random(&mut seed) % bytes.len()).collect();
        let mut most = 0;
        for length in anywhere.into_iter().chain(last_two_chunks(&bytes)..bytes.len()) {
            std::fs::write(&cut, &bytes[..length]).unwrap();
            let Ok(mut log) = LogReader::open(&cut) else {
                assert!(length < 8, "cut at {length}");
                continue;
            };
            let records: Vec<Record> = log.by_ref().map(Result::unwrap).collect();
            let expected: Vec<Record> = (0..records.len() as u64).map(record).collect();
            assert!(records == expected && !log.whole(), "cut at {length}");
            // Twenty bytes of index say nothing: what lies before them is all there.
            most = most.max(records.len());
        }
        assert_eq!(most, 30);
    }
}

#[test]
fn in_an_uncompressed_chunk_the_last_whole_message_before_a_cut_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut.mcap");
    let bytes = log_bytes(folder.path(), Compression::None);
    let words = br#""order":28,"#;
    // Message 28 is a text of the last chunk; cut right behind it, it is there.
    let words = bytes.windows(words.len() - 1).position(|window| window == &words[..words.len() - 1]).unwrap();
    std::fs::write(&cut, &bytes[..words + 11]).unwrap();
    assert_eq!(LogReader::open(&cut).unwrap().count(), 29);
}

#[test]
fn flipped_bits_are_found_and_cost_no_more_than_their_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flipped.mcap");
    for compression in [Compression::None, Compression::Zstd] {
        let bytes = log_bytes(folder.path(), compression);
        let mut seed = 2;
        for _ in 0..600 {
            let (at, bit) = (random(&mut seed) % bytes.len(), random(&mut seed) % 8);
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            std::fs::write(&path, &damaged).unwrap();
            read_log(&path);
            if let Ok(log) = LogReader::open(&path) {
                // Whatever is given was recorded: a wrong message is worse than a lost one.
                log.flatten().for_each(|read| assert_eq!(read, record(read.order), "bit {bit} of byte {at}"));
            }
        }
    }
}

#[test]
fn lengths_that_no_file_has_set_no_memory_aside() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.mcap");
    let bytes = log_bytes(folder.path(), Compression::None);
    let mut seed = 3;
    for huge in [u64::MAX, 1 << 62, 1 << 40, 1 << 31, 0xffff_ffff] {
        for _ in 0..60 {
            let mut damaged = bytes.clone();
            let at = random(&mut seed) % (bytes.len() - 8);
            damaged[at..at + 8].copy_from_slice(&huge.to_le_bytes());
            std::fs::write(&path, &damaged).unwrap();
            read_log(&path);
        }
    }
}

/// Found by the fuzz target: a text of 2.8 GB in a record of a few bytes.
#[test]
fn a_text_that_is_longer_than_its_record_is_said_and_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("text.mcap");
    for (opcode, before) in [(1_u8, 0), (3, 2), (4, 4), (9, 16), (12, 0), (8, 32)] {
        let mut bytes = b"\x89MCAP0\r\n".to_vec();
        let body = [vec![0; before], vec![0xff; 4], vec![b'x'; 20]].concat();
        bytes.push(opcode);
        bytes.extend_from_slice(&(body.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&body);
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(read_log(&path), 0);
        let mut log = LogReader::open(&path).unwrap();
        assert!(log.next_ref().is_none() && !log.damage().is_empty(), "opcode {opcode}");
    }
    let peak = std::fs::read_to_string("/proc/self/status").unwrap();
    let peak = peak.lines().find_map(|line| line.strip_prefix("VmPeak:")).unwrap().trim().trim_end_matches(" kB");
    assert!(peak.parse::<u64>().unwrap() < 3_000_000, "{peak} kB");
}

/// Found by the fuzz target: an attachment without room for its checksum, at which the crate `mcap` panics.
#[test]
fn records_that_end_too_early_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("early.mcap");
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let attachment = [vec![0; 16], text("m.xml"), text("application/xml"), vec![0; 8], vec![0; 4]].concat();
    let schema = [vec![1, 0], text("S"), text("jsonschema"), text("{}")].concat();
    let channel = [vec![0, 0, 1, 0], text("KEY"), text("json"), text("")].concat();
    let metadata = [text("other"), text("")].concat();
    for (opcode, body) in [(9_u8, attachment), (3, schema), (4, channel), (12, metadata)] {
        for length in 0..=body.len() {
            let record = [&[opcode][..], &(length as u64).to_le_bytes(), &body[..length]].concat();
            std::fs::write(&path, [&b"\x89MCAP0\r\n"[..], &record].concat()).unwrap();
            assert_eq!(read_log(&path), 0);
            let mut log = LogReader::open(&path).unwrap();
            // The file has no end either.
            let expected = 1 + usize::from(length < body.len());
            assert!(log.next_ref().is_none() && log.damage().len() == expected, "{opcode}: {:?}", log.damage());
        }
    }
}

#[test]
fn any_bytes_behind_the_magic_are_an_error_or_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let (log, alog) = (folder.path().join("any.mcap"), folder.path().join("any.alog"));
    let mut seed = 4;
    for _ in 0..300 {
        let mut bytes: Vec<u8> = (0..random(&mut seed) % 300).map(|_| random(&mut seed) as u8).collect();
        std::fs::write(&alog, &bytes).unwrap();
        read_alog(&alog);
        bytes.splice(0..0, *b"\x89MCAP0\r\n");
        // Records of known kinds with random bodies come further than random opcodes.
        bytes.splice(8..8, [(random(&mut seed) % 16) as u8, 20, 0, 0, 0, 0, 0, 0, 0]);
        std::fs::write(&log, &bytes).unwrap();
        read_log(&log);
    }
}

#[test]
fn a_clock_that_runs_backwards_is_no_trouble() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("back.mcap");
    let mut log = LogWriter::create(&path, &Metadata::default()).unwrap();
    let times = [100.0, 101.0, 5.0, 6.0, f64::NAN, -3.0, 200.0];
    for (number, time) in (0..).zip(times) {
        log.append(&Record { time, received: time, ..record(number) }.as_ref()).unwrap();
        log.flush().unwrap();
    }
    log.finish().unwrap();
    let orders: Vec<u64> = LogReader::open(&path).unwrap().map(|r| r.unwrap().order).collect();
    assert_eq!(orders, [0, 1, 2, 3, 4, 5, 6], "in the order in which they came");
    let index = Index::read(&path, &mut |_, _| {}).unwrap();
    assert_eq!(index.span(), Some((0.0, 200.0)));
    let mut log = LogReader::open(&path).unwrap();
    log.seek(&index, 150.0).unwrap();
    assert_eq!(log.next_ref().unwrap().unwrap().order, 6);
    assert!(read_log(&path) == 7);
}

#[test]
fn a_number_that_is_none_is_said_to_be_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let said = Metadata { seed: 7, ..Metadata::default() };
    LogWriter::create_with(&path, &said, LogOptions::default()).unwrap().finish().unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let seed = b"seed\x01\0\0\x007";
    let at = bytes.windows(seed.len()).position(|window| window == seed).unwrap();
    bytes[at + seed.len() - 1] = b'x';
    std::fs::write(&path, bytes).unwrap();
    let mut log = LogReader::open(&path).unwrap();
    assert_eq!(log.metadata().seed, 0);
    assert_eq!(log.by_ref().count(), 0);
    let damage = log.damage().join("\n");
    assert!(damage.contains("its seed is said to be \"x\", which is no such number; it is read as 0"), "{damage}");
}
