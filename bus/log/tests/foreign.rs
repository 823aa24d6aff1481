//! Logs, channels, attachments and metadata of other tools: shown, counted, and kept byte by byte.

use std::path::{Path, PathBuf};

use elk_bus::Value;
use elk_log::check::check;
use elk_log::copy::{Copied, copy, recover};
use elk_log::{Index, LogOptions, LogReader, Selection};

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
