//! The files of a log: segments, compression, the index, and what other people's tools read in them.

#[path = "../../../tests/common/skip.rs"]
mod skip;

use std::path::{Path, PathBuf};
use std::process::Command;

use elk_bus::{Payload, Type, TypeRef, Value, codec};
use elk_geometry::{OccupancyGrid, Pose, State, Voxel};
use elk_log::check::check;
use elk_log::{Compression, Index, LogError, LogOptions, LogReader, LogWriter, Metadata, Record, segments};
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::{CameraPose, Decision, MotionPolicy, Path as Way, Plan, Progress};
use elk_spatial::{Points, Scan};
use nalgebra::{Point3, Vector3};

/// Message `number`, recorded a tenth of a second after the one before.
fn record(key: &str, number: u64, value: Value) -> Record {
    Record {
        key: key.into(),
        source: "app".into(),
        source_aux: String::new(),
        community: "elk".into(),
        time: number as f64 * 0.1,
        sequence: number,
        received: number as f64 * 0.1,
        order: number,
        epoch: 3,
        value,
    }
}

fn binary<T: Payload>(value: &T::View<'_>) -> Value {
    let mut bytes = Vec::new();
    codec::encode_onto(value, &mut bytes).unwrap();
    Value::Binary { type_: TypeRef::of::<T>().to_type(), bytes }
}

fn numbers(count: u64) -> Vec<Record> {
    (0..count).map(|i| record(["DEPTH", "SPEED"][i as usize % 2], i, Value::Double(i as f64 / 7.0))).collect()
}

/// Writes `records`, flushing after every tenth.
fn write(path: &Path, records: &[Record], options: LogOptions) -> PathBuf {
    let mut log = LogWriter::create_with(path, &Metadata::default(), options).unwrap();
    for chunk in records.chunks(10) {
        chunk.iter().for_each(|record| log.append(&record.as_ref()).unwrap());
        log.flush().unwrap();
    }
    let segment = log.segment().to_owned();
    log.finish().unwrap();
    segment
}

fn read(path: &Path) -> Vec<Record> {
    LogReader::open(path).unwrap().map(Result::unwrap).collect()
}

fn index(path: &Path) -> Index {
    Index::read(path, &mut |_, _| {}).unwrap()
}

/// Regression: once a type was described, its messages did not fit the channel of those before, and were lost.
#[test]
fn a_type_that_is_described_later_is_read_before_and_after() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let report = elk_spatial::samples::named("SensorReport").unwrap();
    let command = elk_spatial::samples::named("PoseCommand").unwrap();
    let mut written = Vec::new();
    for (number, sample) in (1..).zip([report, command, report, command]) {
        let nameless = Type::undescribed(sample.name(), sample.type_.layout());
        let type_ = if number < 3 { nameless } else { sample.type_.to_type() };
        written.push(record("KEY", number, Value::Binary { type_, bytes: sample.bytes() }));
    }
    let mut log = LogWriter::create(&path, &Metadata::default()).unwrap();
    written.iter().for_each(|record| log.append(&record.as_ref()).unwrap());
    log.finish().unwrap();
    let read: Vec<Record> = LogReader::open(&path).unwrap().map(Result::unwrap).collect();
    assert_eq!(read, written);
    let described = |record: &Record| record.value.as_ref().to_json(9).is_ok();
    assert_eq!(read.iter().map(described).collect::<Vec<_>>(), [false, false, true, true]);
}

/// What a lidar says in one sweep, or a microphone in a while.
#[elk_bus::payload]
struct Samples {
    gain: f64,
    levels: Vec<f32>,
}

#[test]
fn a_list_of_numbers_is_there_to_be_plotted_unless_it_is_long() {
    let folder = tempfile::tempdir().unwrap();
    let samples = |count: usize| binary::<Samples>(&Samples { gain: 0.5, levels: vec![1.5; count] });
    let counts = [3, 200_000, 7];
    let said: Vec<_> = (0..).zip(counts).map(|(i, count)| record("SAMPLES", i, samples(count))).collect();
    let path = folder.path().join("log.mcap");
    write(&path, &said, LogOptions::default());
    let described = |record: Record| {
        let Value::Binary { type_, bytes } = record.value else { panic!("a number") };
        assert!(type_.as_ref().is::<Samples>());
        (record.key, bytes)
    };
    let plain = |all: Vec<Record>| all.into_iter().map(described).collect::<Vec<_>>();
    assert_eq!(plain(read(&path)), plain(said));
    let file = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&file).unwrap().unwrap();
    let mut schemas: Vec<&str> =
        summary.channels.values().filter_map(|channel| Some(channel.schema.as_ref()?.name.as_str())).collect();
    schemas.sort_unstable();
    assert_eq!(schemas, ["Samples", "elk.Binary"]);
}

#[test]
fn every_compression_gives_back_the_same_whole_or_cut() {
    let folder = tempfile::tempdir().unwrap();
    let records = numbers(200);
    let mut sizes = Vec::new();
    for compression in [Compression::None, Compression::Lz4, Compression::Zstd] {
        let path = folder.path().join(format!("{compression:?}.mcap"));
        write(&path, &records, LogOptions { compression, ..LogOptions::default() });
        assert_eq!(read(&path), records);
        let bytes = std::fs::read(&path).unwrap();
        sizes.push(bytes.len());
        let cut = folder.path().join("cut.mcap");
        for length in (0..bytes.len()).step_by(97).filter(|length| *length >= 8) {
            std::fs::write(&cut, &bytes[..length]).unwrap();
            let mut log = LogReader::open(&cut).unwrap();
            let back: Vec<Record> = log.by_ref().map(Result::unwrap).collect();
            assert!(records.starts_with(&back) && !log.whole(), "{compression:?} cut at {length}");
        }
    }
    assert!(sizes[2] < sizes[1] && sizes[1] < sizes[0], "{sizes:?}");
}

#[test]
fn a_log_goes_on_in_the_next_file_by_size_by_time_and_when_its_writer_starts_again() {
    let records = numbers(300);
    for options in [
        LogOptions { rotate_bytes: Some(4000), ..LogOptions::default() },
        LogOptions { rotate_secs: Some(4.95), ..LogOptions::default() },
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        write(&path, &records, options);
        let files = segments(folder.path()).unwrap();
        assert!(files.len() >= 5, "{files:?}");
        assert_eq!(read(folder.path()), records);
        let first = std::fs::read(&path).unwrap();
        let again = write(&path, &numbers(3), LogOptions::default());
        assert_eq!(again, folder.path().join(format!("log.{}.mcap", files.len())), "nothing is overwritten");
        assert_eq!(std::fs::read(&path).unwrap(), first);
        assert_eq!(read(folder.path()).len(), 303);
    }
}

/// Regression: a log of which a file was gone was called whole.
#[test]
fn a_file_that_is_missing_between_others_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let gone = |name: &str| std::fs::remove_file(file(name)).unwrap();
    let damage = || {
        let checked = check(folder.path(), &mut |_, _| {}).unwrap().damage;
        let mut log = LogReader::open(folder.path()).unwrap();
        log.by_ref().for_each(drop);
        assert_eq!((log.damage(), log.whole()), (checked.clone(), checked.is_empty()));
        let index = index(folder.path());
        assert_eq!((index.damage(), index.whole()), (checked.clone(), checked.is_empty()));
        checked
    };
    write(&file("log.mcap"), &numbers(300), LogOptions { rotate_secs: Some(4.95), ..LogOptions::default() });
    assert_eq!(segments(folder.path()).unwrap().len(), 6);
    assert!(damage().is_empty());
    gone("log.2.mcap");
    assert_eq!(damage(), [format!("the file {} of the log is missing", file("log.2.mcap").display())]);
    gone("log.mcap");
    gone("log.3.mcap");
    let (two, three) = (file("log.2.mcap"), file("log.3.mcap"));
    let (first, others) = (file("log.mcap"), format!("{} to {}", two.display(), three.display()));
    let expected = [
        format!("the file {} of the log is missing", first.display()),
        format!("2 files of the log are missing, {others}"),
    ];
    assert_eq!(damage(), expected);
    assert!(index(&file("log.4.mcap")).whole(), "whoever names one file means that one");
    ["log.1.mcap", "log.4.mcap", "log.5.mcap"].iter().for_each(|name| gone(name));
    // One whose name has a point in it.
    write(&file("a.b.mcap"), &numbers(200), LogOptions { rotate_secs: Some(4.95), ..LogOptions::default() });
    gone("a.b.1.mcap");
    assert_eq!(damage(), [format!("the file {} of the log is missing", file("a.b.1.mcap").display())]);
    ["a.b.mcap", "a.b.2.mcap", "a.b.3.mcap"].iter().for_each(|name| gone(name));
    // A log of its own, whose name has a number in it.
    write(&file("drive.2024.mcap"), &numbers(3), LogOptions::default());
    assert!(damage().is_empty());
}

#[test]
fn the_index_says_what_is_there_and_reading_through_says_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let mut records = numbers(100);
    records.insert(50, record("NOTE", 50, Value::Text("half way".into())));
    write(&path, &records, LogOptions::default());
    let whole = index(&path);
    assert!(whole.whole());
    assert_eq!((whole.messages(), whole.span()), (101, Some((0.0, 9.9))));
    let topics: Vec<_> = whole.topics().into_iter().map(|t| (t.name, t.type_name, t.count)).collect();
    let expected = [("DEPTH", "number", 50), ("NOTE", "text", 1), ("SPEED", "number", 50)];
    assert_eq!(topics, expected.map(|(name, kind, count)| (name.to_owned(), kind.to_owned(), count)));
    // Without its end.
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 40]).unwrap();
    let mut told = Vec::new();
    let cut = Index::read(&path, &mut |done, all| told.push((done, all))).unwrap();
    assert!(!cut.whole() && cut.damage().len() == 1);
    assert_eq!((cut.messages(), cut.span(), cut.topics()), (101, whole.span(), whole.topics()));
    assert!(told.windows(2).all(|two| two[0].0 < two[1].0) && told.last().unwrap().0 <= bytes.len() as u64);
}

#[test]
fn a_reader_seeks_both_ways_with_an_index_and_without_over_segments() {
    let records = numbers(300);
    for (cut, options) in [
        (0, LogOptions::default()),
        (60, LogOptions::default()),
        (0, LogOptions { rotate_secs: Some(4.95), ..LogOptions::default() }),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        write(&path, &records, options);
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - cut]).unwrap();
        let index = index(folder.path());
        let mut log = LogReader::open(folder.path()).unwrap();
        for target in [12.34, 0.0, 29.9, 7.0, -5.0, 1e9] {
            log.seek(&index, target).unwrap();
            let next = log.next_ref().map(|next| next.unwrap().sequence);
            assert_eq!(next, records.iter().find(|r| r.received >= target).map(|r| r.sequence), "to {target}");
        }
    }
}

#[test]
fn what_the_logger_missed_is_counted_in_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let mut log = LogWriter::create(&path, &Metadata::default()).unwrap();
    for (record, newly) in numbers(20).iter().zip([0, 3, 0, 4].into_iter().cycle()) {
        log.append(&record.as_ref()).unwrap();
        if newly > 0 {
            log.note_dropped(newly, record.received).unwrap();
            log.flush().unwrap();
        }
    }
    log.finish().unwrap();
    assert_eq!(index(&path).dropped(), 35);
    let mut log = LogReader::open(&path).unwrap();
    assert_eq!((log.by_ref().count(), log.dropped()), (20, 35));
}

/// As a value of an unknown type was stored before viewers were tried: in an encoding that they complain of.
#[test]
fn values_in_the_encoding_of_older_logs_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    let mut log = mcap::WriteOptions::new().profile("elk").create(file).unwrap();
    let said = |pairs: &[(&str, &str)]| pairs.iter().map(|(name, word)| (name.to_string(), word.to_string())).collect();
    log.write_metadata(&mcap::records::Metadata { name: "elk".into(), metadata: said(&[("format", "1")]) }).unwrap();
    let schema = log.add_schema("Blob", "elk", b"0000000000000009").unwrap();
    let words =
        [("source", "app"), ("community", "elk"), ("epoch", "3"), ("type", "Blob"), ("layout", "0000000000000009")];
    let channel_id = log.add_channel(schema, "OTHER", "elk", &said(&words)).unwrap();
    let (time, received, sequence, order, aux_len) = (0.5_f64, 0.75_f64, 7_u64, 6_u64, 0_u32);
    let envelope = [time.to_le_bytes(), received.to_le_bytes(), sequence.to_le_bytes(), order.to_le_bytes()].concat();
    let message = [&envelope[..], &aux_len.to_le_bytes(), b"whatever"].concat();
    let header = mcap::records::MessageHeader { channel_id, sequence: 7, log_time: 0, publish_time: 0 };
    log.write_to_known_channel(&header, &message).unwrap();
    log.finish().unwrap();
    let value = Value::Binary { type_: Type::undescribed("Blob", 9), bytes: b"whatever".into() };
    assert_eq!(read(&path), [Record { time, received, order, ..record("OTHER", sequence, value) }]);
}

#[test]
fn a_log_of_a_later_format_is_refused_in_clear_words() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    write(&path, &numbers(3), LogOptions::default());
    let mut bytes = std::fs::read(&path).unwrap();
    let at = bytes.windows(6).position(|window| window == b"format").unwrap() + 6 + 4;
    assert_eq!(bytes[at], b'1');
    bytes[at] = b'7';
    std::fs::write(&path, &bytes).unwrap();
    let error = LogReader::open(&path).err().unwrap();
    assert!(matches!(&error, LogError::Newer { found, .. } if found == "7"), "{error}");
    bytes[5] = b'9';
    std::fs::write(&path, &bytes).unwrap();
    let error = LogReader::open(&path).err().unwrap().to_string();
    assert!(error.contains("version '9', which is newer"), "{error}");
}

#[test]
fn a_damaged_chunk_is_passed_over_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let records = numbers(30);
    write(&path, &records, LogOptions::default());
    let mut bytes = std::fs::read(&path).unwrap();
    let words = br#""sequence":15,"#;
    let at = bytes.windows(words.len()).position(|window| window == words).unwrap();
    bytes[at] ^= 1;
    std::fs::write(&path, &bytes).unwrap();
    let mut log = LogReader::open(&path).unwrap();
    let back: Vec<Record> = log.by_ref().map(Result::unwrap).collect();
    assert_eq!(back, [&records[..10], &records[20..]].concat(), "the second of three chunks is lost");
    assert!(!log.whole());
    assert!(log.damage()[0].contains("does not agree with its checksum"), "{:?}", log.damage());
}

/// Values as a mission has them, one of each that viewers show.
fn spatial() -> Vec<Record> {
    let pose = Pose::looking(Point3::new(1.0, 2.0, 0.5), Vector3::x());
    let points: Points<'static> = [Point3::new(0.5, -0.25, 3.0), Point3::new(0.0, 0.0, 1.5)].into_iter().collect();
    let mut map = OccupancyGrid::new(0.1);
    map.set(Voxel::new(1, 2, 3), State::Occupied);
    map.set(Voxel::new(1, 2, 4), State::Free);
    let motion = MotionPolicy {
        name: "elk".into(),
        scan_spacing_m: 0.4,
        early_stop: true,
        look_at_target: true,
        clearance_m: 0.1,
        level: false,
    };
    let way = Way {
        points: vec![Point3::new(1.0, 2.0, 0.5), Point3::new(2.0, 2.0, 0.5)],
        target: Voxel::new(20, 20, 5),
        unknown: vec![],
        looks: vec![pose],
        again: false,
    };
    let plan = Plan { request: 1, revision: 1, decision: Decision::Go(way), motion, cpu_secs: 0.5 };
    vec![
        record("SIM_SENSOR", 0, binary::<CameraPose>(&CameraPose { command: 1, pose })),
        record("SCAN", 1, binary::<Scan<'static>>(&Scan::new(1, 1, pose, points))),
        record("MAP", 2, binary::<MapUpdate>(&MapUpdate::new(map.whole(), 1))),
        record("PLAN", 3, binary::<Plan>(&plan)),
        record(
            "PROGRESS",
            4,
            binary::<Progress>(&Progress {
                scan: 1,
                revision: 1,
                scans: 1,
                path_length_m: 2.5,
                free: 8,
                finished: false,
            }),
        ),
        record("DEPTH", 5, Value::Double(f64::NEG_INFINITY)),
        record("OTHER", 6, Value::Binary { type_: Type::undescribed("Blob", 9), bytes: b"whatever".into() }),
        record("NOTHING", 7, Value::Binary { type_: Type::undescribed("Blob", 9), bytes: Vec::new() }),
    ]
}

#[test]
fn spatial_values_come_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    write(&path, &spatial(), LogOptions::default());
    assert_eq!(read(&path), spatial());
}

#[test]
fn an_independent_reader_decodes_what_viewers_are_to_show() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    write(&path, &spatial(), LogOptions { compression: Compression::Zstd, ..LogOptions::default() });
    let there = Command::new("python3").args(["-c", "import mcap, mcap_protobuf"]).output();
    if !there.is_ok_and(|output| output.status.success()) {
        let why = "python3 with the packages `mcap` and `mcap-protobuf-support` is not installed";
        skip::skip("an_independent_reader_decodes_what_viewers_are_to_show", "mcap", why);
        return;
    }
    let script = r#"
import json, struct, sys
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
reader = make_reader(open(sys.argv[1], "rb"), validate_crcs=True, decoder_factories=[DecoderFactory()])
topics = ["SIM_SENSOR", "SCAN", "MAP", "PLAN", "OTHER"]
m = {c.topic: (s.name, d) for s, c, _, d in reader.iter_decoded_messages(topics=topics)}
def xyz(v): return (round(v.x, 6), round(v.y, 6), round(v.z, 6))
def points(cloud):
    assert cloud.point_stride == 12 and [(f.name, f.offset, f.type) for f in cloud.fields] == [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)]
    return [tuple(round(c, 6) for c in p) for p in struct.iter_unpack("<3f", cloud.data)]
print(m["SIM_SENSOR"][0], xyz(m["SIM_SENSOR"][1].pose.position), m["SIM_SENSOR"][1].frame_id)
print(m["SCAN"][0], points(m["SCAN"][1]), xyz(m["SCAN"][1].pose.position), m["SCAN"][1].timestamp.nanos)
print(m["MAP"][0], points(m["MAP"][1]), m["MAP"][1].pose.orientation.w)
progress = next(reader.iter_messages(topics=["PROGRESS"]))
print(progress[0].encoding, json.loads(progress[2].data)["value"]["path_length_m"])
print(m["PLAN"][0], [xyz(p.position) for p in m["PLAN"][1].poses])
print(m["OTHER"][0], m["OTHER"][1].data)
"#;
    let output = Command::new("python3").args(["-c", script]).arg(&path).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    let expected = "foxglove.PoseInFrame (1.0, 2.0, 0.5) world\n\
                    foxglove.PointCloud [(0.5, -0.25, 3.0), (0.0, 0.0, 1.5)] (1.0, 2.0, 0.5) 100000000\n\
                    foxglove.PointCloud [(0.15, 0.25, 0.35)] 1.0\n\
                    jsonschema 2.5\n\
                    foxglove.PosesInFrame [(1.0, 2.0, 0.5), (2.0, 2.0, 0.5), (1.0, 2.0, 0.5)]\n\
                    elk.Binary b'whatever'\n";
    assert_eq!(said, expected, "{}", String::from_utf8_lossy(&output.stderr));
}

/// Rerun's own loader, which is strict here: a warning ends it.
#[test]
fn rerun_draws_what_it_is_to_show() {
    let rerun = |arguments: &[&str], folder: &Path| {
        Command::new("rerun").args(arguments).current_dir(folder).env("RERUN_PANIC_ON_WARN", "1").output()
    };
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("log.mcap"), &spatial(), LogOptions::default());
    if !rerun(&["mcap", "--help"], folder.path()).is_ok_and(|output| output.status.success()) {
        let why = "rerun (the Python package `rerun-sdk`) is not installed";
        skip::skip("rerun_draws_what_it_is_to_show", "rerun", why);
        return;
    }
    let mut said = Vec::new();
    for arguments in [
        &["mcap", "check", "log.mcap"][..],
        &["mcap", "convert", "log.mcap", "--application-id", "elk", "-o", "log.rrd"],
        &["rrd", "print", "log.rrd"],
    ] {
        let output = rerun(arguments, folder.path()).unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        said = output.stdout;
    }
    let said = String::from_utf8(said).unwrap();
    let drawn = |topic: &str, what: &str| {
        said.lines().any(|line| line.contains(&format!(" {topic} - ")) && line.contains(what))
    };
    for cloud in ["/SCAN", "/MAP"] {
        assert!(drawn(cloud, "Points3D:positions") && drawn(cloud, "InstancePoses3D:translations"), "{cloud}: {said}");
    }
    for poses in ["/SIM_SENSOR", "/PLAN"] {
        assert!(drawn(poses, "InstancePoses3D:translations"), "{poses}: {said}");
    }
    assert!(drawn("/PROGRESS", "McapMessage:data"), "texts and numbers are there as they are: {said}");
}
