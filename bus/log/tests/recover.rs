//! What `recover` gives back of damaged logs, against a count of its own of what is whole in them.
//!
//! The short run is part of the tests. The long one, whose figures stand in docs/log.md:
//! `ELK_FLIPS=1000 ELK_HOLES=200 cargo test --release -p elk-log --test recover -- --nocapture`

mod common;

use std::collections::BTreeSet;
use std::io::Read;
use std::ops::Range;
use std::path::Path;

use elk_bus::{Type, Value};
use elk_log::copy::recover;
use elk_log::{Compression, LogOptions, LogReader, LogWriter, Metadata, Record};

const ALL: [Compression; 3] = [Compression::None, Compression::Lz4, Compression::Zstd];
const HOLE: usize = 4096;
const MESSAGES: u64 = 1200;

/// Numbers that look random and are the same every time.
struct Random(u64);

impl Random {
    fn below(&mut self, most: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % most
    }
}

/// Numbers, texts, and values of some kilobytes that pack as well as scans do.
fn record(number: u64) -> Record {
    let value = match number % 5 {
        0 | 3 => Value::Double(number as f64 / 7.0),
        1 => Value::Text(format!("line {number} of many, and some more words for each of them")),
        _ => {
            let mut random = Random(number);
            let bytes = (0..400 + 7 * (number as usize % 4000) % 4000)
                .map(|at| if at % 4 == 3 { 0x41 } else { random.below(64) as u8 });
            Value::Binary { type_: Type::undescribed("Points", 1), bytes: bytes.collect() }
        }
    };
    common::record(number, &format!("KEY_{}", number % 5), value)
}

/// A log of chunks of very different sizes.
fn log_bytes(folder: &Path, compression: Compression) -> Vec<u8> {
    let path = folder.join("whole.mcap");
    let _ = std::fs::remove_file(&path);
    let options = LogOptions { compression, ..LogOptions::default() };
    let mut log = LogWriter::create_with(&path, &Metadata::default(), options).unwrap();
    for number in 0..MESSAGES {
        log.append(&record(number).as_ref()).unwrap();
        if number % 97 == 0 || number % 211 == 0 {
            log.flush().unwrap();
        }
    }
    log.finish().unwrap();
    std::fs::read(&path).unwrap()
}

/// A chunk of the log as it was written: what is packed in it, and where.
struct Chunk {
    packed: Range<usize>,
    compression: String,
    unpacked: Vec<u8>,
    /// Number of each message, and its bytes in `unpacked` with its head.
    messages: Vec<(u64, Range<usize>)>,
}

fn word(bytes: &[u8], at: usize) -> usize {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize
}

/// Kind, and place of the body, of all records up to the end of the data.
fn records_of(bytes: &[u8], from: usize) -> Vec<(u8, Range<usize>)> {
    let (mut at, mut found) = (from, Vec::new());
    while at + 9 <= bytes.len() && bytes[at] != 15 {
        let body = at + 9..at + 9 + word(bytes, at + 1);
        found.push((bytes[at], body.clone()));
        at = body.end;
    }
    found
}

/// As much as unpacks.
fn unpack(compression: &str, packed: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let _ = match compression {
        "lz4" => lz4::Decoder::new(packed).unwrap().read_to_end(&mut bytes),
        "zstd" => zstd::Decoder::new(packed).unwrap().read_to_end(&mut bytes),
        _ => { packed }.read_to_end(&mut bytes),
    };
    bytes
}

/// This test's own reading of the format.
fn chunks_of(bytes: &[u8]) -> Vec<Chunk> {
    let mut number = 0;
    let chunks = records_of(bytes, 8).into_iter().filter(|(opcode, _)| *opcode == 6).map(|(_, body)| {
        let name = u32::from_le_bytes(bytes[body.start + 28..body.start + 32].try_into().unwrap()) as usize;
        let compression = String::from_utf8(bytes[body.start + 32..body.start + 32 + name].to_vec()).unwrap();
        let packed = body.start + 40 + name..body.end;
        let unpacked = unpack(&compression, &bytes[packed.clone()]);
        let mut messages = Vec::new();
        for (_, body) in records_of(&unpacked, 0).into_iter().filter(|(opcode, _)| *opcode == 5) {
            messages.push((number, body.start - 9..body.end));
            number += 1;
        }
        Chunk { packed, compression, unpacked, messages }
    });
    chunks.collect()
}

/// The messages whose bytes are all there: in an uncompressed chunk those that the damage does not touch, else those in
/// what unpacks as it was written.
fn whole_in(chunks: &[Chunk], damaged: &[u8], damage: &Range<usize>) -> BTreeSet<u64> {
    let mut whole = BTreeSet::new();
    for chunk in chunks {
        let (start, end) = (chunk.packed.start, chunk.packed.end);
        let is_hit = damage.start < end && damage.end > start;
        let same = match chunk.compression.as_str() {
            _ if !is_hit => usize::MAX,
            "" => usize::MAX,
            name => {
                let unpacked = unpack(name, &damaged[start..end]);
                unpacked.iter().zip(&chunk.unpacked).take_while(|(one, other)| one == other).count()
            }
        };
        let touched = |place: &Range<usize>| {
            chunk.compression.is_empty() && damage.start < start + place.end && damage.end > start + place.start
        };
        let kept = chunk.messages.iter().filter(|(_, place)| place.end <= same && !touched(place));
        whole.extend(kept.map(|(number, _)| number));
    }
    whole
}

/// Messages that are whole; of these, those that were recovered; and those that were recovered otherwise than recorded.
#[derive(Debug, Default)]
struct Count {
    whole: usize,
    recovered: usize,
    wrong: usize,
}

impl Count {
    fn add(&mut self, folder: &Path, damaged: &[u8], whole: &BTreeSet<u64>) {
        let (path, to) = (folder.join("damaged.mcap"), folder.join("mended.mcap"));
        let _ = std::fs::remove_file(&to);
        std::fs::write(&path, damaged).unwrap();
        recover(&path, &to, LogOptions::default(), &mut |_, _| {}).unwrap();
        let mut mended = LogReader::open(&to).unwrap();
        let read: Vec<Record> = mended.by_ref().map(|record| record.expect("what is recovered decodes")).collect();
        assert!(mended.whole());
        let right = read.iter().filter(|read| **read == record(read.order));
        let numbers: BTreeSet<u64> = right.clone().map(|read| read.order).collect();
        self.whole += whole.len();
        self.recovered += numbers.intersection(whole).count();
        self.wrong += read.len() - right.count();
    }
}

fn recovers(flips: usize, holes: usize) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // All figures are printed before any of them fails.
    let mut too_few = Vec::new();
    for compression in ALL {
        let finished = log_bytes(folder, compression);
        let chunks = chunks_of(&finished);
        assert_eq!(chunks.iter().map(|chunk| chunk.messages.len()).sum::<usize>(), MESSAGES as usize);
        let data = records_of(&finished, 8).last().unwrap().1.end;
        for (ending, bytes) in [("finished", &finished[..]), ("killed", &finished[..data])] {
            let mut random = Random(7);
            let (mut flipped, mut holed) = (Count::default(), Count::default());
            for _ in 0..flips {
                let at = random.below(bytes.len());
                let mut damaged = bytes.to_vec();
                damaged[at] ^= 1 << random.below(8);
                flipped.add(folder, &damaged, &whole_in(&chunks, &damaged, &(at..at + 1)));
            }
            for number in 0..holes {
                let at = random.below(bytes.len() - HOLE);
                let mut damaged = bytes.to_vec();
                match number % 2 {
                    0 => damaged[at..at + HOLE].fill(0),
                    _ => damaged[at..at + HOLE].iter_mut().for_each(|byte| *byte = random.below(256) as u8),
                }
                holed.add(folder, &damaged, &whole_in(&chunks, &damaged, &(at..at + HOLE)));
            }
            println!("{compression:?}, {ending}: {flips} flips {flipped:?}, {holes} holes {holed:?}");
            for (damage, count) in [("flips", &flipped), ("holes", &holed)] {
                if count.recovered * 100 < count.whole * 99 {
                    too_few.push(format!("{compression:?}, {ending}, {damage}: {count:?}"));
                }
            }
            // Where there is a checksum over what was flipped, the one bit is found and put back.
            if ending == "finished" || compression == Compression::None {
                assert_eq!(flipped.wrong, 0, "{compression:?}, {ending}: {flipped:?}");
            }
        }
    }
    assert!(too_few.is_empty(), "{too_few:#?}");
}

/// So many of each kind of damage as the environment says, else the few that every run has.
fn many(variable: &str, few: usize) -> usize {
    std::env::var(variable).ok().map_or(few, |many| many.parse().expect("a whole number"))
}

#[test]
fn nearly_all_that_is_whole_in_a_damaged_log_is_recovered() {
    recovers(many("ELK_FLIPS", 25), many("ELK_HOLES", 10));
}

/// Regression: what a run came from was read from the damaged file, without a word that it was damaged.
#[test]
fn what_a_run_came_from_is_put_back_as_well() {
    let folder = tempfile::tempdir().unwrap();
    let (path, to) = (folder.path().join("run.mcap"), folder.path().join("mended.mcap"));
    let mission = "<Scenario name=\"MARKER\"/>".into();
    let said = Metadata { mission_name: "m.xml".into(), mission, seed: 4_711_042, ..Metadata::default() };
    let mut log = LogWriter::create(&path, &said).unwrap();
    log.append(&record(0).as_ref()).unwrap();
    log.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for marker in ["MARKER", "4711042"] {
        let at = bytes.windows(marker.len()).position(|window| window == marker.as_bytes()).unwrap();
        let mut damaged = bytes.clone();
        damaged[at] ^= 1;
        let _ = std::fs::remove_file(&to);
        std::fs::write(&path, damaged).unwrap();
        recover(&path, &to, LogOptions::default(), &mut |_, _| {}).unwrap();
        let mended = LogReader::open(&to).unwrap();
        assert_eq!((mended.metadata().seed, &mended.metadata().mission), (said.seed, &said.mission), "{marker}");
    }
}

/// Regression: one flipped bit of a packed chunk can make one of what it unpacks to; so can others, by chance.
#[test]
fn a_packed_chunk_that_had_to_be_mended_is_doubtful() {
    let folder = tempfile::tempdir().unwrap();
    let (path, to) = (folder.path().join("damaged.mcap"), folder.path().join("mended.mcap"));
    let finished = log_bytes(folder.path(), Compression::Lz4);
    let killed = &finished[..records_of(&finished, 8).last().unwrap().1.end];
    let chunk = &chunks_of(&finished)[3];
    let unpacked_otherwise = |at: &usize| {
        let mut packed = finished[chunk.packed.clone()].to_vec();
        packed[*at] ^= 1;
        let bits =
            unpack("lz4", &packed).iter().zip(&chunk.unpacked).map(|(one, other)| (one ^ other).count_ones()).sum();
        Some(bits).filter(|bits: &u32| *bits > 0)
    };
    let at = (100..chunk.packed.len()).find(|at| unpacked_otherwise(at) == Some(1)).expect("a byte that is not packed");
    let mut damaged = killed.to_vec();
    damaged[chunk.packed.start + at] ^= 1;
    std::fs::write(&path, damaged).unwrap();
    let copied = recover(&path, &to, LogOptions::default(), &mut |_, _| {}).unwrap();
    assert_eq!((copied.records, copied.doubtful as usize), (MESSAGES, chunk.messages.len()), "{:?}", copied.damage);
    assert!(copied.damage.iter().any(|reason| reason.contains("but for one bit")), "{:?}", copied.damage);
    let read = LogReader::open(&to).unwrap().map(Result::unwrap);
    assert!(read.zip(0..).all(|(read, number)| read == record(number)), "the bit is put back all the same");
}

/// Regression: what was announced in a chunk that is lost had no name any more, if the logger was killed.
#[test]
fn the_names_of_channels_outlive_the_chunk_that_announced_them() {
    let folder = tempfile::tempdir().unwrap();
    let (path, to) = (folder.path().join("damaged.mcap"), folder.path().join("mended.mcap"));
    for compression in ALL {
        let finished = log_bytes(folder.path(), compression);
        let mut killed = finished[..records_of(&finished, 8).last().unwrap().1.end].to_vec();
        let chunks = chunks_of(&finished);
        // The first one has one message, the second one the first of all other channels.
        let lost = chunks[0].packed.start..chunks[1].packed.end;
        killed[lost].fill(0);
        std::fs::write(&path, killed).unwrap();
        let _ = std::fs::remove_file(&to);
        let copied = recover(&path, &to, LogOptions::default(), &mut |_, _| {}).unwrap();
        let kept = MESSAGES - (chunks[0].messages.len() + chunks[1].messages.len()) as u64;
        assert_eq!((copied.records, copied.unreadable), (kept, 0), "{compression:?}: {:?}", copied.damage);
        let read = LogReader::open(&to).unwrap().map(Result::unwrap);
        assert!(read.zip(MESSAGES - kept..).all(|(read, number)| read == record(number)), "{compression:?}");
    }
}
