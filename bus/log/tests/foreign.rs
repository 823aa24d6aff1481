//! Logs, channels, attachments and metadata of other tools: shown, counted, and kept byte by byte.

mod common;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use elk_bus::Value;
use elk_log::check::check;
use elk_log::copy::{Copied, copy, recover};
use elk_log::csv::put_csv;
use elk_log::index::{Extra, ExtraKind};
use elk_log::{Index, LogOptions, LogReader, LogWriter, Metadata, Selection};
use mcap::records::MessageHeader;
use mcap::{Attachment, WriteOptions};

fn case(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name)
}

/// A message as the crate `mcap` reads it: topic, schema, encoding, times and number, bytes.
type Plain = (String, Option<String>, String, [u64; 3], Vec<u8>);

fn as_others_read(path: &Path) -> Vec<Plain> {
    let bytes = std::fs::read(path).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(|message| {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().map(|schema| format!("{} {:?}", schema.name, schema.data));
        let times = [message.log_time, message.publish_time, u64::from(message.sequence)];
        let (topic, encoding) = (message.channel.topic.clone(), message.channel.message_encoding.clone());
        (topic, schema, encoding, times, message.data.into_owned())
    });
    messages.collect()
}

type Copying = fn(&Path, &Path) -> Copied;

const COPIES: [Copying; 2] = [
    |from, to| copy(from, to, &Selection::default(), LogOptions::default(), &mut |_, _| {}).unwrap(),
    |from, to| recover(from, to, LogOptions::default(), &mut |_, _| {}).unwrap(),
];

#[test]
fn files_of_other_tools_are_counted_shown_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["no-msg-idx.mcap", "plain.mcap", "nosummary.mcap"] {
        let path = case(name);
        let index = Index::read(&path, &mut |_, _| {}).unwrap();
        let topics: Vec<_> = index.topics().into_iter().map(|t| (t.name, t.type_name, t.count)).collect();
        let expected = [("raw_bytes", "bytes", 2), ("sample_topic", "Num", 10)];
        assert_eq!(topics, expected.map(|(topic, of, count)| (topic.to_owned(), of.to_owned(), count)), "{name}");
        let checked = check(&path, &mut |_, _| {}).unwrap();
        assert_eq!((checked.messages, checked.damage), (12, Vec::new()), "{name}");
        let read: Vec<_> = LogReader::open(&path).unwrap().map(Result::unwrap).collect();
        let numbers = read.iter().filter(|read| read.key == "sample_topic").map(|read| read.value.clone());
        assert!(numbers.eq((0..10).map(|number| Value::Double(number.into()))), "{name}");
        for (number, copies) in COPIES.iter().enumerate() {
            let to = folder.path().join(format!("{number}-{name}"));
            let copied = copies(&path, &to);
            assert_eq!((copied.records, copied.damage.len(), copied.left_out.len()), (12, 0, 0), "{name}");
            assert_eq!(as_others_read(&to), as_others_read(&path), "{name}");
        }
    }
}

#[test]
fn what_another_tool_added_to_a_log_of_elk_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = case("mixed.mcap");
    for (number, copies) in COPIES.iter().enumerate() {
        let to = folder.path().join(format!("{number}.mcap"));
        assert_eq!(copies(&path, &to).records, 153);
        let of_camera = |path: &Path| {
            as_others_read(path).into_iter().filter(|message| message.0 == "/camera/compressed").collect::<Vec<_>>()
        };
        assert!(of_camera(&to).len() == 20 && of_camera(&to) == of_camera(&path));
        let bytes = std::fs::read(&to).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let names: Vec<&str> = summary.metadata_indexes.iter().map(|index| index.name.as_str()).collect();
        assert_eq!(names, ["elk", "operator"]);
        let attachment = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
        assert_eq!((attachment.name.as_str(), &attachment.data[..]), ("calib.yaml", &b"fx: 500\nfy: 500\n"[..]));
    }
}

#[test]
fn a_flipped_bit_costs_no_message() {
    let folder = tempfile::tempdir().unwrap();
    let (path, to) = (case("bitflip.mcap"), folder.path().join("mended.mcap"));
    assert_eq!(
        LogReader::open(&path).unwrap().flatten().count(),
        36,
        "what is certain, its channels known from the end"
    );
    let copied = recover(&path, &to, LogOptions::default(), &mut |_, _| {}).unwrap();
    assert_eq!((copied.records, copied.doubtful, copied.unreadable), (133, 0, 0));
    assert!(copied.damage[0].contains("a bit of byte 12320 was flipped"), "{:?}", copied.damage);
    let pulses: Vec<Value> =
        LogReader::open(&to).unwrap().map(Result::unwrap).filter(|r| r.key == "PULSE").map(|r| r.value).collect();
    assert!(pulses.len() == 120, "{}", pulses.len());
}

/// The log at `from` as another program writes it, chunk by chunk of a kilobyte, its end as `options` say.
fn written_by_another(from: &Path, to: &Path, options: WriteOptions) {
    let bytes = std::fs::read(from).unwrap();
    let options = options.chunk_size(Some(1024)).compression(None);
    let mut writer = options.create(BufWriter::new(File::create(to).unwrap())).unwrap();
    mcap::MessageStream::new(&bytes).unwrap().for_each(|message| writer.write(&message.unwrap()).unwrap());
    writer.finish().unwrap();
}

type Leaving = fn(WriteOptions) -> WriteOptions;

/// What the end of a file may leave out.
const LEFT_OUT: [(&str, Leaving); 7] = [
    ("nothing", |options| options),
    ("statistics", |options| options.emit_statistics(false)),
    ("channels", |options| options.repeat_channels(false)),
    ("schemas", |options| options.repeat_schemas(false)),
    ("indexes", |options| options.emit_chunk_indexes(false).emit_message_indexes(false)),
    ("all but indexes", |options| options.emit_statistics(false).repeat_channels(false).repeat_schemas(false)),
    ("all but statistics", |options| options.repeat_channels(false).repeat_schemas(false).emit_chunk_indexes(false)),
];

/// Regression: a file whose end does not repeat its channels had "0 messages", and was called whole.
#[test]
fn what_the_end_of_a_file_leaves_out_its_data_say() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("own.mcap");
    let mut log = LogWriter::create(&own, &Metadata::default()).unwrap();
    for number in 0..60 {
        let (key, value) =
            if number % 3 == 0 { ("TEXT", Value::Text("x".repeat(100))) } else { ("NUMBER", Value::Double(0.5)) };
        log.append(&common::record(number, key, value).as_ref()).unwrap();
    }
    log.note_dropped(7, 60.0).unwrap();
    log.finish().unwrap();
    let path = folder.path().join("other.mcap");
    for (what, options) in LEFT_OUT {
        written_by_another(&own, &path, options(WriteOptions::new()));
        let index = Index::read(&path, &mut |_, _| {}).unwrap();
        let topics: Vec<_> = index.topics().into_iter().map(|t| (t.name, t.type_name, t.count)).collect();
        let expected = [("NUMBER", "number", 40), ("TEXT", "text", 20)];
        assert_eq!(topics, expected.map(|(key, of, count)| (key.to_owned(), of.to_owned(), count)), "without {what}");
        assert_eq!((index.messages(), index.dropped(), index.whole()), (60, 7, true), "without {what}");
        let checked = check(&path, &mut |_, _| {}).unwrap();
        assert_eq!((checked.messages, checked.damage), (60, Vec::new()), "without {what}");
        // A part of it, of which the first chunk has nothing but the channels.
        let part = Selection { from_secs: Some(30.0), to_secs: Some(39.5), ..Selection::default() };
        let to = folder.path().join("part.mcap");
        let copied = copy(&path, &to, &part, LogOptions::default(), &mut |_, _| {}).unwrap();
        assert_eq!((copied.records, copied.damage), (10, Vec::new()), "without {what}");
        let mut log = LogReader::open(&path).unwrap();
        log.seek(&index, 45.0).unwrap();
        let orders: Vec<u64> = log.map(|record| record.unwrap().order).collect();
        assert_eq!(orders, (45..60).collect::<Vec<u64>>(), "without {what}");
        // Ten bytes of the last message are lost.
        let mut bytes = std::fs::read(&path).unwrap();
        let at = bytes.windows(11).rposition(|window| window == b"\"order\":59}").unwrap();
        bytes[at..at + 10].fill(0);
        let (damaged, mended) = (folder.path().join("damaged.mcap"), folder.path().join("mended.mcap"));
        std::fs::write(&damaged, bytes).unwrap();
        let copied = recover(&damaged, &mended, LogOptions::default(), &mut |_, _| {}).unwrap();
        assert_eq!((copied.records, copied.unreadable), (59, 1), "without {what}: {:?}", copied.damage);
        [to, mended].iter().for_each(|file| std::fs::remove_file(file).unwrap());
    }
}

/// Regression: a damaged byte in what a log says of its format ended recover.
#[test]
fn a_format_that_nobody_knows_is_said_and_recover_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let (path, to) = (folder.path().join("run.mcap"), folder.path().join("mended.mcap"));
    let mut log = LogWriter::create(&path, &Metadata { seed: 7, ..Metadata::default() }).unwrap();
    (0..9).for_each(|number| log.append(&common::record(number, "KEY", 1.0.into()).as_ref()).unwrap());
    log.flush().unwrap();
    drop(log);
    let bytes = std::fs::read(&path).unwrap();
    let at = bytes.windows(6).position(|window| window == b"format").unwrap() + 10;
    assert_eq!(bytes[at], b'1');
    for said in [b'9', b'x', 0] {
        let mut damaged = bytes.clone();
        damaged[at] = said;
        std::fs::write(&path, damaged).unwrap();
        assert!(LogReader::open(&path).is_err(), "whoever only reads does not guess");
        let copied = recover(&path, &to, LogOptions::default(), &mut |_, _| {}).unwrap();
        assert_eq!(copied.records, 9);
        assert!(copied.damage.iter().any(|reason| reason.contains("its format is said to be")), "{:?}", copied.damage);
        assert_eq!(LogReader::open(&to).unwrap().metadata().seed, 7);
        std::fs::remove_file(&to).unwrap();
    }
}

/// Regression: an object of a single field lost the field's name, and its topic was a number here and a text there.
#[test]
fn a_single_field_keeps_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.mcap");
    let mut writer = mcap::Writer::new(BufWriter::new(File::create(&path).unwrap())).unwrap();
    let channel = writer.add_channel(0, "/pt", "json", &BTreeMap::new()).unwrap();
    let said = [r#"{"speed": 3}"#, r#"{"speed": 3, "turn": 1}"#, r#"{"value": 3}"#];
    for (sequence, json) in (0..).zip(said) {
        let header = MessageHeader { channel_id: channel, sequence, log_time: 5, publish_time: 5 };
        writer.write_to_known_channel(&header, json.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    let mut csv = Vec::new();
    let read: Vec<Value> = LogReader::open(&path)
        .unwrap()
        .map(Result::unwrap)
        .inspect(|record| put_csv(&mut csv, 0.0, &record.as_ref()).unwrap())
        .map(|record| record.value)
        .collect();
    assert_eq!(read, [Value::Text(said[0].into()), Value::Text(said[1].into()), Value::Double(3.0)]);
    let columns: Vec<&str> =
        std::str::from_utf8(&csv).unwrap().lines().map(|line| line.split(',').nth(1).unwrap()).collect();
    assert_eq!(columns, ["/pt.speed", "/pt.speed", "/pt.turn", "/pt"]);
}

/// Attachments and metadata are listed, whether the file's end says where they are or all of it has to be read.
#[test]
fn what_stands_beside_the_messages_is_listed() {
    let folder = tempfile::tempdir().unwrap();
    let extra = |kind, name: &str, media_type: &str, count, bytes| Extra {
        kind,
        name: name.into(),
        media_type: media_type.into(),
        count,
        bytes,
    };
    let options: [(&str, Leaving); 4] = [
        ("nothing", |options| options),
        ("statistics", |options| options.emit_statistics(false)),
        ("indexes of both", |options| options.emit_attachment_indexes(false).emit_metadata_indexes(false)),
        ("the index of one", |options| options.emit_metadata_indexes(false)),
    ];
    let path = folder.path().join("other.mcap");
    for (what, options) in options {
        let mut writer = options(WriteOptions::new()).create(BufWriter::new(File::create(&path).unwrap())).unwrap();
        for data in [&b"fx: 500"[..], b"fy: 500\n"] {
            let (name, media_type) = ("calib.yaml".to_owned(), "text/yaml".to_owned());
            writer.attach(&Attachment { log_time: 1, create_time: 1, name, media_type, data: data.into() }).unwrap();
        }
        let metadata = BTreeMap::from([("name".to_owned(), "Bob".to_owned())]);
        writer.write_metadata(&mcap::records::Metadata { name: "operator".into(), metadata }).unwrap();
        writer.finish().unwrap();
        let index = Index::read(&path, &mut |_, _| {}).unwrap();
        let expected = [
            extra(ExtraKind::Attachment, "calib.yaml", "text/yaml", 2, 15),
            extra(ExtraKind::Metadata, "operator", "", 1, 9 + 4 + 8 + 4 + 4 + 4 + 4 + 3),
        ];
        assert_eq!(index.extras(), (expected.to_vec(), 0), "without {what}");
        assert!(index.whole() && check(&path, &mut |_, _| {}).unwrap().damage.is_empty(), "without {what}");
    }
    // A log of elk's own has its mission's file with it, and what it says of itself.
    let own = folder.path().join("own.mcap");
    let metadata = Metadata { mission_name: "m.xml".into(), mission: "<Scenario/>".into(), ..Metadata::default() };
    LogWriter::create(&own, &metadata).unwrap().finish().unwrap();
    let (extras, _) = Index::read(&own, &mut |_, _| {}).unwrap().extras();
    assert_eq!(extras[0], extra(ExtraKind::Attachment, "m.xml", "application/xml", 1, 11));
    assert_eq!((extras[1].name.as_str(), extras.len()), ("elk", 2));
}
