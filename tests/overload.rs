//! Readers that do not keep up: what is said to them, who waits for them, and what is lost.

mod common;

use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use common::events::Patience;
use common::lab::{Lab, table};
use common::terminal::Terminal;
use common::{Elk, kill};
use elk_bus::broker::table::CommunityTable;
use elk_bus::{Client, Community, Mail, Origin, Type, Value};
use elk_log::{LogReader, LogWriter, Metadata, Record};
use rustix::process::Signal;

/// Messages of a log; of 10 kB each they are more than twice what a mailbox holds.
const MESSAGES: u64 = 1000;

/// A log of messages that are numbered in their first bytes, a millisecond apart.
fn write_log(elk: &Elk, count: u64, value: impl Fn(u64) -> Value) {
    let mut log = LogWriter::create(&elk.folder().join("log.mcap"), &Metadata::default()).unwrap();
    for number in 0..count {
        let record = Record {
            key: "LARGE".into(),
            source: "pCam".into(),
            source_aux: String::new(),
            community: "lab".into(),
            time: number as f64 * 1e-3,
            sequence: number,
            received: number as f64 * 1e-3,
            order: number,
            epoch: 1,
            value: value(number),
        };
        log.append(&record.as_ref()).unwrap();
    }
    log.finish().unwrap();
}

fn text(number: u64) -> Value {
    Value::Text(format!("{number:05}{}", "x".repeat(10_000)))
}

/// A value that is written once into shared memory, and read there.
fn bulk(number: u64) -> Value {
    let bytes = format!("{number:05}{}", "x".repeat(100_000)).into_bytes();
    Value::Binary { type_: Type::undescribed("Blob", 9), bytes }
}

/// The numbers that a reader heard, and how many messages it missed.
type Heard = (Vec<u64>, u64);

/// A reader that takes a millisecond for a message until it is told to hurry, registered as most are. It stays until it is
/// asked what it heard.
struct SlowReader {
    /// Closed when it is to hurry.
    leisure: Sender<()>,
    heard: Receiver<Heard>,
    thread: JoinHandle<()>,
}

impl SlowReader {
    /// One that reads until it has heard or missed `count` messages.
    fn new(elk: &Elk, count: u64) -> Self {
        let community = Community::new(elk.community()).unwrap();
        let (leisure, hurry) = channel();
        let (ready, registered) = channel();
        let (tell, heard) = sync_channel(0);
        let thread = std::thread::spawn(move || {
            let mut client = Client::connect(&community, "slow").unwrap();
            client.comms.register("LARGE").unwrap();
            table(&mut client);
            ready.send(()).unwrap();
            tell.send(read_slowly(&mut client, count, &hurry)).unwrap();
        });
        registered.recv().unwrap();
        Self { leisure, heard, thread }
    }

    fn end(self) -> Heard {
        drop(self.leisure);
        let heard = self.heard.recv().unwrap();
        self.thread.join().unwrap();
        heard
    }
}

fn read_slowly(client: &mut Client, count: u64, hurry: &Receiver<()>) -> Heard {
    let (mut numbers, patience) = (Vec::new(), Patience::new());
    while (numbers.len() as u64) + client.inbox.dropped() < count {
        let read = |mail: &Mail<'_>| {
            let _ = hurry.recv_timeout(Duration::from_millis(1));
            numbers.push(number(&mail.value().to_value()));
        };
        client.receive(patience.left("all that is played, heard or missed"), read).unwrap();
    }
    (numbers, client.inbox.dropped())
}

fn number(value: &Value) -> u64 {
    match value {
        Value::Text(text) => text[..5].parse().unwrap(),
        Value::Binary { bytes, .. } => std::str::from_utf8(&bytes[..5]).unwrap().parse().unwrap(),
        Value::Double(_) => panic!("nobody said a number"),
    }
}

fn replay(elk: &Elk, more: &[&str]) -> Command {
    elk.command(&[&["replay", "log.mcap", "--community", elk.community(), "--rate", "max"], more].concat())
}

/// Plays the log to its end; what was said last.
fn play(elk: &Elk, more: &[&str]) -> String {
    let output = replay(elk, more).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{said}");
    said.lines().last().unwrap().into()
}

#[test]
fn a_slow_reader_hears_everything_if_it_is_waited_for() {
    for (test, count, value) in [("texts", MESSAGES, text as fn(u64) -> Value), ("bulk", 300, bulk)] {
        let elk = Elk::new(&format!("lossless-{test}"));
        write_log(&elk, count, value);
        let lab = Lab::deaf(&elk);
        let reader = SlowReader::new(&elk, count);
        let said = play(&elk, &["--lossless"]);
        assert!(said.starts_with(&format!("{count} messages, ")) && said.contains("; 0 dropped"), "{said}");
        let (numbers, missed) = reader.end();
        assert_eq!((numbers, missed), ((0..count).collect(), 0), "{test}");
        lab.end();
    }
}

/// Regression: large values that were overwritten before their reader came to them were nobody's loss.
#[test]
fn what_a_slow_reader_misses_if_it_is_not_waited_for_is_counted() {
    for (test, count, value) in [("texts", MESSAGES, text as fn(u64) -> Value), ("bulk", 300, bulk)] {
        let elk = Elk::new(&format!("lossy-{test}"));
        write_log(&elk, count, value);
        let lab = Lab::deaf(&elk);
        let reader = SlowReader::new(&elk, count);
        let said = play(&elk, &[]);
        let (numbers, missed) = reader.end();
        assert!(missed > 0, "a mailbox of 4 MiB holds less than half of it, and eight values are kept");
        assert_eq!(numbers.len() as u64 + missed, count, "{test}");
        let words = format!("; {missed} dropped by clients that did not keep up");
        // On a very busy machine it may not have come to all that it has missed.
        assert!(said.contains(&words) || said.ends_with(" still to read"), "{test}: {said}, not {missed}");
        lab.end();
    }
}

#[test]
fn who_hangs_is_named_at_the_end_if_nobody_waits_for_it() {
    let elk = Elk::new("hung-lossy");
    write_log(&elk, 100, text);
    let mut lab = Lab::deaf(&elk);
    let stopped = Stopped::new(&elk, &mut lab);
    let said = play(&elk, &[]);
    assert!(
        said.ends_with(&format!(
            "; 0 dropped by clients that did not keep up; echo-{} has 100 still to read",
            stopped.0.id()
        )),
        "{said}"
    );
    lab.end();
}

/// A process that reads, and is stopped.
struct Stopped(Child);

impl Stopped {
    fn new(elk: &Elk, lab: &mut Lab) -> Self {
        let mut echo = elk.command(&["echo", "LARGE", "--community", elk.community()]);
        let echo = echo.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        lab.wait_for_reader(&format!("echo-{}", echo.id()));
        kill(echo.id() as i32, Signal::STOP);
        Self(echo)
    }

    fn goes_on(&self) {
        kill(self.0.id() as i32, Signal::CONT);
    }
}

impl Drop for Stopped {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_reader_that_hangs_is_named_and_the_keys_go_on_working() {
    let elk = Elk::new("hung-keys");
    write_log(&elk, MESSAGES, text);
    let mut lab = Lab::deaf(&elk);
    let _stopped = Stopped::new(&elk, &mut lab);
    let mut terminal = Terminal::start(replay(&elk, &["--lossless"]), 100);
    terminal.wait_until("who is waited for", |shown| shown.contains(" s at max, waits for echo"));
    terminal.press("-");
    terminal.wait_until("another rate", |shown| shown.contains(" s at 1000x, waits for echo"));
    terminal.press(" ");
    terminal.wait_until("a pause", |shown| shown.contains(" s at 1000x, paused, waits for echo"));
    terminal.press("q");
    let (status, shown) = terminal.end();
    assert!(status.success() && !shown.contains(&format!("{MESSAGES} messages, ")), "{shown}");
    lab.end();
}

#[test]
fn a_reader_that_hangs_is_waited_for_until_it_reads_on_or_dies_or_the_replay_is_ended() {
    let elk = Elk::new("hung");
    write_log(&elk, MESSAGES, text);
    let mut lab = Lab::deaf(&elk);
    for what in ["goes on", "dies", "replay ends"] {
        let stopped = Stopped::new(&elk, &mut lab);
        let said = elk.folder().join("said.txt");
        let out = std::fs::File::create(&said).unwrap();
        let mut player = replay(&elk, &["--lossless"]).stdout(out.try_clone().unwrap()).stderr(out).spawn().unwrap();
        let said = || std::fs::read_to_string(&said).unwrap();
        elk.events().wait_until("who is waited for", || said().contains(" s at max, waits for echo"));
        assert_eq!(player.try_wait().unwrap(), None);
        match what {
            "goes on" => stopped.goes_on(),
            "dies" => drop(stopped),
            _ => kill(player.id() as i32, Signal::TERM),
        }
        let status = player.wait().unwrap();
        let all = said().contains(&format!("\n{MESSAGES} messages, "));
        assert!(status.success() && all == (what != "replay ends"), "{what}: {}", said());
        assert!(said().contains("; 0 dropped"), "{what}: {}", said());
    }
    lab.end();
}

/// A program that records into `kept.mcap`, stopped as soon as it is registered.
fn stopped_recorder(elk: &Elk, lab: &mut Lab, arguments: &[&str], name: &str) -> Stopped {
    let recorder = elk.command(&[arguments, &["--community", elk.community()]].concat()).spawn().unwrap();
    let name = if name.is_empty() { format!("record-{}", recorder.id()) } else { name.into() };
    lab.wait_for_reader(&name);
    kill(recorder.id() as i32, Signal::STOP);
    Stopped(recorder)
}

/// Says numbered values; nobody waits for a stopped recorder for ever.
fn say(lab: &mut Lab, count: u64, value: impl Fn(u64) -> Value) -> CommunityTable {
    for number in 0..count {
        lab.listener.comms.publish_value("LARGE", value(number).as_ref(), Origin::default()).unwrap();
    }
    table(&mut lab.listener)
}

/// Lets a recorder go on, and ends it at once: what has been said until then it records all the same. The numbers in
/// its log, and how many messages are missing as `elk log info` says.
fn recorded(elk: &Elk, mut recorder: Stopped) -> Heard {
    kill(recorder.0.id() as i32, Signal::TERM);
    recorder.goes_on();
    assert!(recorder.0.wait().unwrap().success());
    let log = LogReader::open(&elk.folder().join("kept.mcap")).unwrap().map(Result::unwrap);
    let numbers = log.filter(|record| record.key == "LARGE").map(|record| number(&record.value)).collect();
    let info = elk.command(&["log", "info", "kept.mcap", "--json"]).output().unwrap().stdout;
    let info: serde_json::Value = serde_json::from_slice(&info).unwrap();
    assert_eq!(info["whole"], true);
    (numbers, info["dropped"].as_u64().unwrap())
}

#[test]
fn a_recorder_that_hung_tells_in_its_log_what_it_has_missed() {
    for (test, count, value) in [("texts", MESSAGES, text as fn(u64) -> Value), ("bulk", 100, bulk)] {
        let elk = Elk::new(&format!("recorder-{test}"));
        let mut lab = Lab::deaf(&elk);
        let arguments = ["log", "record", "LARGE", "-o", "kept.mcap"];
        let recorder = stopped_recorder(&elk, &mut lab, &arguments, "");
        say(&mut lab, count, value);
        let (numbers, missing) = recorded(&elk, recorder);
        assert!(missing > 0 && numbers.is_sorted() && numbers.last() == Some(&(count - 1)), "{test}: {numbers:?}");
        assert_eq!(numbers.len() as u64 + missing, count, "{test}");
        lab.end();
    }
}

#[test]
fn a_logger_that_hung_tells_in_its_log_what_it_has_missed() {
    let elk = Elk::new("logger-hung");
    let mut lab = Lab::deaf(&elk);
    let arguments = ["logger", "--type", "Mcap", "File=kept.mcap"];
    let logger = stopped_recorder(&elk, &mut lab, &arguments, "Logger");
    let table = say(&mut lab, MESSAGES, text);
    let dropped = table.clients.iter().find(|client| client.name == "Logger").unwrap().dropped;
    let (numbers, missing) = recorded(&elk, logger);
    // What the broker says itself is among it, and may have made more of it since.
    assert!(dropped > 0 && missing >= dropped, "{missing} are missing, {dropped} were dropped");
    assert!(numbers.len() as u64 + missing >= MESSAGES && (numbers.len() as u64) < MESSAGES, "{}", numbers.len());
    let said = elk.command(&["log", "info", "kept.mcap"]).output().unwrap().stdout;
    let words = format!("{missing} messages are missing: the logger did not keep up");
    assert!(String::from_utf8_lossy(&said).contains(&words), "{}", String::from_utf8_lossy(&said));
    lab.end();
}

/// What is there to be read when a recorder is told to end belongs into its log.
#[test]
fn a_recorder_that_is_ended_records_what_was_said_before() {
    let elk = Elk::new("recorder-ended");
    let mut lab = Lab::deaf(&elk);
    let recorder = stopped_recorder(&elk, &mut lab, &["log", "record", "LARGE", "-o", "kept.mcap"], "");
    say(&mut lab, 300, text);
    let (numbers, missing) = recorded(&elk, recorder);
    assert_eq!((numbers, missing), ((0..300).collect(), 0));
    lab.end();
}
