//! Logs that were made to do harm: what claims to be large costs as much as it is, whichever way it is read.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use common::record;
use elk_bus::{Type, Value};
use elk_log::alog::AlogReader;
use elk_log::check::check;
use elk_log::copy::{copy, recover};
use elk_log::diff::{DiffOptions, diff};
use elk_log::{Compression, Index, LogOptions, LogReader, LogWriter, Metadata, Record, Selection};

/// The system's memory, and the most of it that was in use.
struct Counted;

static NOW: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

// Safety: everything is passed on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = NOW.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST.fetch_max(now, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(place, layout) }
    }
}

#[global_allocator]
static MEMORY: Counted = Counted;

const MB: u64 = 1 << 20;

/// Tests of memory come one by one.
static ALONE: Mutex<()> = Mutex::new(());

/// The most memory (MiB) that `work` took beyond what there was.
fn memory_of<T>(work: impl FnOnce() -> T) -> (u64, T) {
    let before = NOW.load(Ordering::Relaxed);
    MOST.store(before, Ordering::Relaxed);
    let done = work();
    ((MOST.load(Ordering::Relaxed) - before) as u64 / MB, done)
}

/// A chunk that holds `inside`, of `length` bytes.
fn chunk(compression: &str, inside: impl Read, length: u64) -> Vec<u8> {
    let inside = inside.take(length);
    let mut packed = Vec::new();
    match compression {
        "zstd" => zstd::stream::copy_encode(inside, &mut packed, 3).unwrap(),
        "lz4" => {
            let mut encoder = lz4::EncoderBuilder::new().build(&mut packed).unwrap();
            std::io::copy(&mut { inside }, &mut encoder).unwrap();
            encoder.finish().1.unwrap();
        }
        _ => drop({ inside }.read_to_end(&mut packed).unwrap()),
    }
    let mut body = vec![0; 16];
    body.extend(length.to_le_bytes());
    body.extend(0_u32.to_le_bytes()); // no checksum: nothing is wrong with it
    body.extend((compression.len() as u32).to_le_bytes());
    body.extend(compression.as_bytes());
    body.extend((packed.len() as u64).to_le_bytes());
    body.extend(packed);
    self::head(6, body.len() as u64).into_iter().chain(body).collect()
}

fn head(opcode: u8, length: u64) -> Vec<u8> {
    [&[opcode][..], &length.to_le_bytes()].concat()
}

/// `once`, again and again.
struct Again(Vec<u8>, usize);

impl Again {
    fn of(once: impl Into<Vec<u8>>) -> Self {
        Self(once.into(), 0)
    }
}

impl Read for Again {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        for byte in to.iter_mut() {
            *byte = self.0[self.1];
            self.1 = (self.1 + 1) % self.0.len();
        }
        Ok(to.len())
    }
}

/// A log of three messages, a chunk that is none of elk's, and no end.
fn trap(folder: &Path, chunk: &[u8]) -> PathBuf {
    let path = folder.join("trap.mcap");
    let _ = std::fs::remove_file(&path);
    let mut log = LogWriter::create(&path, &Metadata::default()).unwrap();
    (0..3).for_each(|number| log.append(&record(number, "KEY", 1.0.into()).as_ref()).unwrap());
    log.flush().unwrap();
    drop(log);
    File::options().append(true).open(&path).unwrap().write_all(chunk).unwrap();
    path
}

/// Reads a log in every way there is; the three messages before the trap are there. Answers the memory that took (MiB).
fn read_all(path: &Path) -> u64 {
    let folder = tempfile::tempdir().unwrap();
    let quiet = &mut |_: u64, _: u64| {};
    let (memory, messages) = memory_of(|| {
        let index = Index::read(path, quiet).unwrap();
        let checked = check(path, quiet).unwrap();
        assert!(!checked.damage.is_empty() && checked.damage.len() < 1100, "{:?}", checked.damage);
        let to = folder.path().join("copy.mcap");
        let copied = copy(path, &to, &Selection::default(), LogOptions::default(), quiet).unwrap();
        let mut log = LogReader::open(path).unwrap();
        log.seek(&index, 1.0).unwrap();
        assert_eq!(log.next_ref().unwrap().unwrap().order, 1);
        [index.messages(), checked.messages, copied.records]
    });
    assert!(messages.iter().all(|count| *count == 3), "{messages:?}");
    memory
}

#[test]
fn zeros_that_claim_to_be_a_gigabyte_cost_nothing() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    for (compression, length) in [("zstd", 1024 * MB), ("zstd", 60 * MB), ("lz4", 256 * MB)] {
        let chunk = chunk(compression, std::io::repeat(0), length);
        let memory = read_all(&trap(folder.path(), &chunk));
        assert!(memory < 16, "{memory} MiB for {length} bytes of {compression} in {}", chunk.len());
    }
    // Uncompressed zeros that lie nowhere: a hole in the file.
    let path = trap(folder.path(), &chunk("", std::io::empty(), 0)[..9 + 40]);
    let mut file = File::options().write(true).open(&path).unwrap();
    let start = file.metadata().unwrap().len() - 49;
    file.set_len(start + 49 + 1000 * MB).unwrap();
    for (at, size) in [(1, 40 + 1000 * MB), (9 + 16, 1000 * MB), (9 + 32, 1000 * MB)] {
        file.seek(SeekFrom::Start(start + at)).unwrap();
        file.write_all(&size.to_le_bytes()).unwrap();
    }
    let memory = read_all(&path);
    assert!(memory < 16, "{memory} MiB for a hole");
}

#[test]
fn what_is_recovered_of_a_trap_costs_no_more_than_one_chunk() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let recovered = |path: &Path| {
        let to = folder.path().join("mended.mcap");
        let _ = std::fs::remove_file(&to);
        memory_of(|| recover(path, &to, LogOptions::default(), &mut |_, _| {}).unwrap().records)
    };
    for (compression, length) in [("zstd", 1024 * MB), ("lz4", 256 * MB)] {
        let path = trap(folder.path(), &chunk(compression, std::io::repeat(0), length));
        let (memory, records) = recovered(&path);
        assert!(memory < 256 && records == 3, "{memory} MiB, {records} messages of {compression}");
    }
    // Marks of compressed data, one beside the other.
    let marks = [0x28, 0xb5, 0x2f, 0xfd].repeat(50_000);
    let (memory, records) = recovered(&trap(folder.path(), &marks));
    assert!(memory < 256 && records == 3, "{memory} MiB, {records} messages");
}

#[test]
fn one_message_that_claims_to_be_a_gigabyte_is_not_believed() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let message = [head(5, 1024 * MB - 9), vec![0; 100]].concat();
    let chunk = chunk("zstd", message.chain(std::io::repeat(0)), 1024 * MB);
    let path = trap(folder.path(), &chunk);
    let memory = read_all(&path);
    assert!(memory < 16, "{memory} MiB for a chunk of {} bytes", chunk.len());
    let damage = check(&path, &mut |_, _| {}).unwrap().damage.join(", ");
    assert!(
        damage.contains("claims 1073741824 bytes in") && damage.contains("packed tighter than 256 to 1"),
        "{damage}"
    );
}

#[test]
fn what_is_wrong_a_million_times_is_kept_a_thousand_times() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let nobody = [head(5, 22), 0xffff_u16.to_le_bytes().to_vec(), vec![0; 20]].concat();
    let of_others: Vec<u8> = (0..20_000_u16)
        .flat_map(|id| [head(5, 22), (id + 1000).to_le_bytes().to_vec(), vec![0; 20]].concat())
        .collect();
    let empty = head(5, 0);
    // A value that does not decode, of the first channel, which the writer numbers 0 or 1.
    let unreadable: Vec<u8> =
        (0..2_u16).flat_map(|id| [head(5, 22), id.to_le_bytes().to_vec(), vec![0; 20]].concat()).collect();
    // So many places each: channels that nobody announced are said once, and the file is cut.
    let times = |once: &[u8]| 40 * MB / once.len() as u64;
    let places = [2, 20_001, 2, times(&unreadable) + 2];
    for (once, places) in [nobody, of_others, empty, unreadable].into_iter().zip(places) {
        let length = times(&once) * once.len() as u64;
        let path = trap(folder.path(), &chunk("zstd", Again::of(once), length));
        let (memory, damage) = memory_of(|| check(&path, &mut |_, _| {}).unwrap().damage);
        let more = (places > 1000).then(|| format!("and {} more", places - 1000));
        assert_eq!(damage.get(1000), more.as_ref(), "{} of {places} places", damage.len());
        assert!(memory < 100 && damage.len() as u64 == places.min(1001), "{memory} MiB, {} places", damage.len());
    }
}

/// 300 names of a megabyte each, which pack into little.
#[test]
fn names_of_channels_are_kept_up_to_a_bound() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let channel = |id: u16| {
        let topic = vec![b'x'; MB as usize];
        let body = [&id.to_le_bytes()[..], &[0; 2], &(topic.len() as u32).to_le_bytes(), &topic, &[0; 8]].concat();
        [head(4, body.len() as u64), body].concat()
    };
    let chunks = (0..6_u16).flat_map(|part| {
        let channels: Vec<u8> = (0..50).flat_map(|number| channel(100 + 50 * part + number)).collect();
        let length = channels.len() as u64;
        chunk("zstd", &channels[..], length)
    });
    let path = trap(folder.path(), &chunks.collect::<Vec<u8>>());
    let memory = read_all(&path);
    assert!(memory < 256, "{memory} MiB");
}

#[test]
fn an_index_that_is_a_hole_is_damaged_and_not_read_into_memory() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let path = trap(folder.path(), &[]);
    let mut file = File::options().append(true).open(&path).unwrap();
    file.write_all(&[head(15, 4), vec![0; 4]].concat()).unwrap();
    let start = file.metadata().unwrap().len();
    file.set_len(start + 200 * MB).unwrap();
    file.write_all(&[head(2, 20), start.to_le_bytes().to_vec(), vec![0; 12], mcap::MAGIC.to_vec()].concat()).unwrap();
    let memory = read_all(&path);
    assert!(memory < 16, "{memory} MiB");
}

/// A new log at `path`, packed with Zstandard.
fn packed_log(path: &Path) -> LogWriter {
    let options = LogOptions { compression: Compression::Zstd, ..LogOptions::default() };
    LogWriter::create_with(path, &Metadata::default(), options).unwrap()
}

fn zeros(number: u64, bytes: u64) -> Record {
    record(number, "KEY", Value::Binary { type_: Type::undescribed("Zeros", 1), bytes: vec![0; bytes as usize] })
}

#[test]
fn what_a_writer_writes_is_believed_however_tightly_it_packs() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let mut log = packed_log(&folder.path().join("log.mcap"));
    let records = [
        record(0, "KEY", 1.0.into()),
        zeros(1, 30 * MB),
        zeros(2, 70 * MB),
        record(3, "KEY", 2.0.into()),
        zeros(4, 80 * MB),
    ];
    for record in &records {
        log.append(&record.as_ref()).unwrap();
        log.flush().unwrap();
    }
    log.finish().unwrap();
    let mut log = LogReader::open(folder.path()).unwrap();
    assert!(log.by_ref().map(Result::unwrap).eq(records) && log.whole(), "{:?}", log.damage());
}

/// Regression: the guard was for elk's own messages alone.
#[test]
fn a_message_of_another_tool_is_believed_as_well_however_tightly_it_packs() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let (path, copied) = (folder.path().join("other.mcap"), folder.path().join("copied"));
    std::fs::create_dir(&copied).unwrap();
    let mut other = mcap::WriteOptions::new().compression(None).create(File::create(&path).unwrap()).unwrap();
    let channel_id = other.add_channel(0, "images", "raw", &Default::default()).unwrap();
    let lengths = [10, 70 * MB, 10];
    for (sequence, length) in (0..).zip(lengths) {
        let header = mcap::records::MessageHeader { channel_id, sequence, log_time: 1, publish_time: 1 };
        other.write_to_known_channel(&header, &vec![0; length as usize]).unwrap();
    }
    other.finish().unwrap();
    let options = LogOptions { compression: Compression::Zstd, ..LogOptions::default() };
    let made = copy(&path, &copied.join("log.mcap"), &Selection::default(), options, &mut |_, _| {}).unwrap();
    assert_eq!(made.records, 3);
    let mut log = LogReader::open(&copied).unwrap();
    let length = |record: Record| match record.value {
        Value::Binary { bytes, .. } => bytes.len() as u64,
        other => panic!("{other:?}"),
    };
    let read: Vec<u64> = log.by_ref().map(|record| length(record.unwrap())).collect();
    assert!(read == lengths && log.whole(), "{read:?}, {:?}", log.damage());
}

#[test]
fn what_packs_too_tightly_is_refused_where_there_is_no_room_for_another_segment() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let next = folder.path().join("log.1.mcap");
    std::fs::create_dir(&next).unwrap();
    let mut log = packed_log(&folder.path().join("log.mcap"));
    let records =
        [record(0, "KEY", 1.0.into()), record(1, "KEY", 2.0.into()), zeros(2, 70 * MB), record(3, "KEY", 3.0.into())];
    log.append(&records[0].as_ref()).unwrap();
    for _ in 0..2 {
        let refused = log.append(&zeros(9, 70 * MB).as_ref()).unwrap_err().to_string();
        assert!(refused.contains("log.1.mcap"), "{refused}");
    }
    log.append(&records[1].as_ref()).unwrap();
    std::fs::remove_dir(&next).unwrap();
    records[2..].iter().for_each(|record| log.append(&record.as_ref()).unwrap());
    log.finish().unwrap();
    let mut log = LogReader::open(folder.path()).unwrap();
    assert!(log.by_ref().map(Result::unwrap).eq(records) && log.whole(), "{:?}", log.damage());
}

#[test]
fn logs_that_have_too_little_in_common_are_not_kept_in_memory() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, count: u64, key: &str| {
        let path = folder.path().join(name);
        let mut log = LogWriter::create(&path, &Metadata::default()).unwrap();
        for number in 0..count {
            let value = Value::Binary { type_: Type::undescribed("T", 1), bytes: vec![7; MB as usize] };
            log.append(&record(number, key, value).as_ref()).unwrap();
        }
        log.finish().unwrap();
        path
    };
    let (short, one, other) = (write("0.mcap", 1, "ONE"), write("1.mcap", 300, "ONE"), write("2.mcap", 300, "OTHER"));
    // Once one log is over, nothing of the other waits for it.
    let (memory, found) = memory_of(|| diff(&short, &one, &DiffOptions::default()).unwrap());
    assert!((found.same, found.differences.len()) == (1, 1) && memory < 32, "{memory} MiB");
    let (memory, found) = memory_of(|| diff(&one, &other, &DiffOptions::default()).map(drop));
    let said = found.unwrap_err().to_string();
    assert!(
        memory < 560 && said.contains("more than 536 MB of messages wait for their counterparts"),
        "{memory}: {said}"
    );
}

#[test]
fn what_is_no_file_is_no_log_and_nobody_waits_for_it() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["fifo.mcap", "fifo.alog"] {
        let fifo = folder.path().join(name);
        assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
        let log = LogReader::open(&fifo).map(drop).unwrap_err().to_string();
        let alog = AlogReader::open(&fifo).map(drop).unwrap_err().to_string();
        let written = LogWriter::create(&fifo, &Metadata::default()).map(drop);
        assert!(log.ends_with("it is a FIFO; right is an ordinary file") && log == alog && written.is_err(), "{log}");
    }
    let said = LogReader::open(Path::new("/dev/zero")).map(drop).unwrap_err().to_string();
    assert_eq!(said, "cannot read the log /dev/zero: it is a device; right is an ordinary file");
    // A folder is a run; one that is called as a text log is not.
    let alog = folder.path().join("folder.alog");
    std::fs::create_dir(&alog).unwrap();
    assert!(AlogReader::open(&alog).map(drop).unwrap_err().to_string().ends_with("it is a folder; right is a file"));
}

#[test]
fn a_text_log_counts_from_a_moment_and_its_values_have_an_end() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.alog");
    for wrong in ["nan", "inf", "-1", "1e300", "253402300800", "", "soon"] {
        std::fs::write(&path, format!("%% LOGSTART {wrong}\n1.0 A app 2\n")).unwrap();
        let said = AlogReader::open(&path).map(drop).unwrap_err().to_string();
        let reason = format!("its LOGSTART is {wrong:?}; right is the run's start in seconds since 1970");
        assert!(said.ends_with(&reason), "{said}");
    }
    // What is no moment begins no message: it goes on with the text before it.
    std::fs::write(&path, "%% LOGSTART 10\n1.0 A app text\n1e300 B app 2\n-1e18 C app 3\n2.0 D app 4\n").unwrap();
    let records: Vec<Record> = AlogReader::open(&path).unwrap().map(Result::unwrap).collect();
    assert_eq!((records.len(), records[1].time), (2, 12.0));
    assert_eq!(records[0].value, "text\n1e300 B app 2\n-1e18 C app 3".into());
    // A terabyte of hole beside it is no value.
    let blog = File::create(folder.path().join("run.blog")).unwrap();
    blog.set_len(1 << 40).unwrap();
    let value = format!("<MOOS_BINARY>File=run.blog,Offset=0,Bytes={}</MOOS_BINARY>", 1_u64 << 39);
    std::fs::write(&path, format!("%% LOGSTART 10\n1.0 A app {value}\n")).unwrap();
    let (memory, records) = memory_of(|| AlogReader::open(&path).unwrap().map(Result::unwrap).collect::<Vec<_>>());
    assert_eq!((records[0].value.clone(), memory), (value.as_str().into(), 0));
    // Text that goes on for a hundred megabytes.
    let line = "words ".repeat(20_000) + "\n";
    std::fs::write(&path, format!("%% LOGSTART 10\n1.0 A app begin\n{}", line.repeat(900))).unwrap();
    let (memory, records) = memory_of(|| AlogReader::open(&path).unwrap().map(Result::unwrap).collect::<Vec<_>>());
    assert!(records.len() == 1 && memory < 64, "{memory} MiB");
}
