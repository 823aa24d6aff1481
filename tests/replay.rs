//! Replays through the real program: onto the bus, and into live apps.

mod common;

use std::path::Path;
use std::process::{Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use common::lab::{Lab, hear, wait_for_time};
use common::{Elk, kill};
use elk_bus::{App, AppError, Client, Comms, Community, Mail, Type, Value, run_app_on};
use elk_log::{LogReader, LogWriter, Metadata, Record};
use rustix::process::Signal;

fn record(number: u64, key: &str, source: &str, value: Value) -> Record {
    Record {
        key: key.into(),
        source: source.into(),
        source_aux: String::new(),
        community: "lab".into(),
        time: number as f64 * 0.01,
        sequence: number,
        received: number as f64 * 0.01,
        order: number,
        epoch: 1,
        value,
    }
}

/// Forty messages in 0.4 s: numbers of two sources, a text, a large typed value, and one of the broker's own.
fn messages() -> Vec<Record> {
    let typed = |number: u64| Value::Binary { type_: Type::undescribed("Blob", 9), bytes: vec![number as u8; 40_000] };
    (0..40)
        .map(|number| match number % 5 {
            0 => record(number, "DEPTH", "pNav", Value::Double(number as f64)),
            1 => record(number, "NOTE", "pTalk", Value::Text(format!("n {number}"))),
            2 => record(number, "BLOB", "pCam", typed(number)),
            3 => record(number, "DB_TIME", "MOOSDB_lab", Value::Double(1.0)),
            _ => record(number, "SPEED", "pNav", Value::Double(-(number as f64))),
        })
        .collect()
}

fn write_log(path: &Path) {
    let mut log = LogWriter::create(path, &Metadata::default()).unwrap();
    messages().iter().for_each(|record| log.append(&record.as_ref()).unwrap());
    log.finish().unwrap();
}

/// What is to be heard of a replay.
fn expected(chosen: impl Fn(&Record) -> bool) -> Vec<(String, String, Value)> {
    let played = messages().into_iter().filter(|record| !record.key.starts_with("DB_") && chosen(record));
    played.map(|record| (record.key, record.source, record.value)).collect()
}

fn replay(elk: &Elk, arguments: &[&str]) -> String {
    let all = [&["replay", "log.mcap", "--community", elk.community()], arguments].concat();
    said(elk.command(&all).output().unwrap())
}

fn said(output: Output) -> String {
    let said = common::said(&output);
    assert!(output.status.success(), "{said}");
    said
}

#[test]
fn a_log_is_heard_again_with_sources_values_and_order_as_they_were() {
    let elk = Elk::new("replay-bus");
    write_log(&elk.folder().join("log.mcap"));
    let mut lab = Lab::new(&elk);
    for arguments in [&["--rate", "max"][..], &["--rate", "4"], &["--rate", "max", "--lossless"]] {
        let all = [&["replay", "log.mcap", "--community", elk.community()], arguments].concat();
        let player = elk.command(&all).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // Meanwhile: who publishes large values waits for readers that asked for all of them.
        let heard = lab.hear(32);
        let told = said(player.wait_with_output().unwrap());
        assert!(told.contains("32 messages"), "{told}");
        assert!(told.contains("; 0 dropped"), "{told}");
        assert!(heard == expected(|_| true), "{arguments:?}: something else was heard");
    }
    lab.end();
}

#[test]
fn a_part_is_played_under_other_names() {
    let elk = Elk::new("replay-part");
    write_log(&elk.folder().join("log.mcap"));
    let mut lab = Lab::new(&elk);
    replay(&elk, &["--rate", "max", "--keys", "DEPTH", "--keys", "N*", "--exclude", "NOTE", "--remap", "DEPTH=OLD"]);
    let depths = expected(|record| record.key == "DEPTH").into_iter();
    let renamed: Vec<_> = depths.map(|(_, source, value)| ("OLD".to_owned(), source, value)).collect();
    assert_eq!(lab.hear(renamed.len()), renamed);
    replay(&elk, &["--rate", "max", "--source", "pNav", "--from", "0.1", "--to", "0.2"]);
    let part = expected(|record| record.source == "pNav" && (0.1..=0.2).contains(&record.received));
    assert_eq!(lab.hear(part.len()), part);
    lab.end();
}

#[test]
fn a_loop_plays_until_it_is_ended() {
    let elk = Elk::new("replay-loop");
    write_log(&elk.folder().join("log.mcap"));
    let mut lab = Lab::new(&elk);
    let arguments = ["replay", "log.mcap", "--community", elk.community(), "--loop", "--keys", "NOTE", "--rate", "8"];
    let mut player = elk.command(&arguments).spawn().unwrap();
    let heard = lab.hear(20);
    let once = expected(|record| record.key == "NOTE");
    assert!(heard.iter().zip(once.iter().cycle()).all(|(heard, said)| heard == said), "{heard:?}");
    kill(player.id() as i32, Signal::TERM);
    assert!(player.wait().unwrap().success());
    lab.end();
}

/// An app that notes the community's time at each of its ticks.
struct Ticker(Arc<Mutex<Vec<f64>>>);

impl App for Ticker {
    fn on_start_up(&mut self, _: &mut Comms) -> Result<(), AppError> {
        Ok(())
    }

    fn on_new_mail(&mut self, _: &mut Comms, _: &Mail<'_>) -> Result<(), AppError> {
        Ok(())
    }

    fn iterate(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.0.lock().unwrap().push(comms.time());
        Ok(())
    }

    fn tick_period(&self) -> Option<Duration> {
        Some(Duration::from_millis(50))
    }
}

/// Recorded times are far from those of a community that nobody drives.
fn is_recorded(time: f64) -> bool {
    (0.0..1e6).contains(&time)
}

#[test]
fn with_clock_the_communitys_time_is_that_of_the_recording() {
    let elk = Elk::new("replay-clock");
    write_log(&elk.folder().join("log.mcap"));
    let mut lab = Lab::new(&elk);
    let ticks = Arc::new(Mutex::new(Vec::new()));
    let (mut ticker, stop) = (Ticker(ticks.clone()), Arc::new(AtomicBool::new(false)));
    let (community, stopped) = (Community::new(elk.community()).unwrap(), stop.clone());
    let live = std::thread::spawn(move || {
        run_app_on(&mut ticker, &mut Client::connect(&community, "ticker").unwrap(), &stopped).unwrap();
    });
    for rate in ["0.5", "4", "max"] {
        let arguments = ["replay", "log.mcap", "--community", elk.community(), "--clock", "--rate", rate];
        let player = elk.command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut times = Vec::new();
        hear(&mut lab.listener, "what is played", |mail| {
            times.extend(mail.source().starts_with('p').then_some(mail.time()));
            (times.len() >= 32).then_some(())
        });
        let recorded = messages().into_iter().filter(|record| !record.key.starts_with("DB_")).map(|record| record.time);
        assert!(times.iter().copied().eq(recorded), "{rate}: {times:?}");
        said(player.wait_with_output().unwrap());
        wait_for_time(&mut lab.listener, |time| !is_recorded(time));
    }
    stop.store(true, Ordering::Relaxed);
    live.join().unwrap();
    let ticks = ticks.lock().unwrap().clone();
    // 0.4 s were recorded: eight ticks each time, however long it took; one more where the clock was set. It goes on until the player has left.
    let followed = ticks.iter().filter(|time| (0.0..0.41).contains(*time)).count();
    assert!((1..=3 * 10).contains(&followed), "{followed} of {ticks:?}");
    lab.end();
}

#[test]
fn one_replay_at_a_time_drives_the_clock_and_scopes_say_which() {
    let elk = Elk::new("replay-clocks");
    write_log(&elk.folder().join("log.mcap"));
    let mut lab = Lab::new(&elk);
    let arguments = ["replay", "log.mcap", "--community", elk.community(), "--clock"];
    for end in [Signal::TERM, Signal::KILL] {
        let first = elk.command(&[&arguments[..], &["--loop"]].concat()).stderr(Stdio::null()).spawn();
        let mut first = first.unwrap();
        let driver = format!("replay-{}", first.id());
        lab.hear(1);
        wait_for_time(&mut lab.listener, is_recorded);
        let second = elk.command(&arguments).output().unwrap();
        let told = String::from_utf8_lossy(&second.stderr).into_owned();
        assert_eq!(second.status.code(), Some(1), "{told}");
        assert!(told.contains(&format!("{driver} drives the community's time already")), "{told}");
        let listed = said(elk.command(&["list", "--community", elk.community()]).output().unwrap());
        let line = format!("time is driven by {driver}: 1970-01-01 00:00:00 UTC, running at 1x");
        assert!(listed.contains(&line), "{listed}");
        kill(first.id() as i32, end);
        assert_eq!(first.wait().unwrap().success(), end == Signal::TERM);
        wait_for_time(&mut lab.listener, |time| !is_recorded(time));
        assert!(!said(elk.command(&["list", "--community", elk.community()]).output().unwrap()).contains("driven"));
    }
    lab.end();
}

/// A part of a log is what lies between its bounds, wherever it lies in the file.
#[test]
fn a_part_of_a_log_out_of_order_is_played_whole() {
    let elk = Elk::new("replay-unsorted");
    let mut lab = Lab::new(&elk);
    let case = concat!(env!("CARGO_MANIFEST_DIR"), "/bus/log/tests/cases/unsorted.alog");
    let mut log = LogWriter::create(&elk.folder().join("log.mcap"), &Metadata::default()).unwrap();
    for record in elk_log::alog::AlogReader::open(Path::new(case)).unwrap() {
        log.append(&record.unwrap().as_ref()).unwrap();
        log.flush().unwrap();
    }
    log.finish().unwrap();
    for log in [case, "log.mcap"] {
        for (part, values) in [(&["--to", "0.15"][..], [1.0, 2.0]), (&["--from", "0.15", "--to", "0.35"], [3.0, 4.0])] {
            let arguments = [&["replay", log, "--community", elk.community(), "--rate", "max"], part].concat();
            let player = elk.command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
            let heard: Vec<Value> = lab.hear(2).into_iter().map(|(.., value)| value).collect();
            assert_eq!(heard, values.map(Value::Double), "{log} {part:?}");
            assert!(said(player.wait_with_output().unwrap()).contains("2 messages"), "{log} {part:?}");
        }
    }
    lab.end();
}

/// What another tool has recorded is played where elk knows what it says, and named where it does not.
#[test]
fn logs_of_other_tools_are_played_as_far_as_they_are_understood() {
    let elk = Elk::new("replay-foreign");
    let mut lab = Lab::new(&elk);
    let case = concat!(env!("CARGO_MANIFEST_DIR"), "/bus/log/tests/cases/plain.mcap");
    let arguments = ["replay", case, "--community", elk.community(), "--rate", "max"];
    let player = elk.command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let heard: Vec<(String, Value)> = lab.hear(10).into_iter().map(|(key, _, value)| (key, value)).collect();
    let expected: Vec<_> = (0..10).map(|n| ("sample_topic".to_owned(), Value::Double(f64::from(n)))).collect();
    assert_eq!(heard, expected);
    let told = said(player.wait_with_output().unwrap());
    assert!(told.contains("10 messages") && told.contains("2 messages of bytes were not played"), "{told}");
    lab.end();
}

#[test]
fn an_alog_is_played_like_any_other_log() {
    let elk = Elk::new("replay-alog");
    let alog = "%%%%%%%%%%%%%%%%%%%%%%%%\n\
                %% LOG FILE:       ./run.alog\n\
                %% FILE OPENED ON  Thu Jan  1 00:00:00 1970\n\
                %% LOGSTART               1795394934.24\n\
                %% DATATYPE MARKING ON\n\
                %%%%%%%%%%%%%%%%%%%%%%%%\n\
                0.101           DB_EVENT             MOOSDB_demo     S:connected=pLogger \n\
                0.200           NAV_X                pNav            D:7.50000      \n\
                0.150           A_VARIABLE_WITH_A_NAME_LONGER_THAN_ITS_COLUMN pHelm:behaviour@other S:one, two \n\
                and a second line\n\
                \n\
                0.300           DEPTH                pNav            S:12 \n";
    std::fs::write(elk.folder().join("run.alog"), alog).unwrap();
    let mut lab = Lab::new(&elk);
    let arguments = ["replay", "run.alog", "--community", elk.community(), "--rate", "max"];
    said(elk.command(&arguments).output().unwrap());
    let text = |text: &str| Value::Text(text.into());
    let long = "A_VARIABLE_WITH_A_NAME_LONGER_THAN_ITS_COLUMN".to_owned();
    assert_eq!(
        lab.hear(3),
        [
            ("NAV_X".to_owned(), "pNav".to_owned(), Value::Double(7.5)),
            (long, "pHelm".to_owned(), text("one, two\nand a second line")),
            ("DEPTH".to_owned(), "pNav".to_owned(), text("12")),
        ]
    );
    lab.end();
}

#[test]
fn what_cannot_be_played_is_said_in_one_line() {
    let elk = Elk::new("replay-bad");
    write_log(&elk.folder().join("log.mcap"));
    let fails = |arguments: &[&str], words: &str| {
        let output = elk.command(arguments).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && said.contains(words), "{arguments:?}: {said}");
    };
    fails(&["replay", "log.mcap", "--community", elk.community()], "start one with `elk db`");
    fails(&["replay", "log.mcap", "--rate", "0"], "0.1 to 1000, or max");
    fails(&["replay", "nowhere.mcap"], "nowhere.mcap");
    fails(&["replay", "log.mcap", "--into", "mission.xml"], "--only");
    std::fs::write(elk.folder().join("mission.xml"), "<Scenario/>").unwrap();
    let car = mission("car");
    fails(&["replay", "log.mcap", "--into", &car, "--only", "Map,Wizard"], "no app \"Wizard\"");
}

fn mission(name: &str) -> String {
    format!("{}/mission-files/{name}.xml", env!("CARGO_MANIFEST_DIR"))
}

/// A run in seven processes, its scans then through a live map and explorer: the same maps, the same paths, bit for bit.
#[test]
fn recorded_scans_give_live_apps_the_same_map_and_the_same_paths() {
    let elk = Elk::new("reproduce");
    let car = mission("car");
    let community = elk.community();
    let launch = ["launch", &car, "--headless", "--community", community, "--log-dir", "old"];
    // Capped, the run fails as such; what was said until then counts here.
    elk.command(&[&launch[..], &["--set", "Explorer.MaxScans=40"]].concat()).output().unwrap();
    let old = elk.run_in("old").display().to_string();
    let replay = ["replay", &old, "--rate", "max", "--keys", "SCAN*", "--only", "Map,Explorer", "--into"];
    // The mission of the run itself, which is as it was launched.
    let told = said(elk.command(&[&replay[..], &[&old, "--log-dir", "new"]].concat()).output().unwrap());
    let new = elk.run_in("new").display().to_string();
    assert!(told.contains(&format!("compare: elk log diff {old} new/car-replayed")), "{told}");
    let keys = ["--keys", "MAP_UPDATE", "--keys", "PLAN", "--keys", "MAP_KNOWN", "--keys", "EXPLORATION_REPORT"];
    let diff = |new: &str| elk.command(&[&["log", "diff", &old, new], &keys[..]].concat()).output().unwrap();
    let same = said(diff(&new));
    let compared: u64 = same.trim().split(' ').nth(2).unwrap().parse().unwrap();
    assert!(same.starts_with("the same: ") && compared > 100, "{same}");
    for map in [Path::new(&old).join("map.bt"), Path::new(&new).join("map.bt")].windows(2) {
        assert!(std::fs::read(&map[0]).unwrap() == std::fs::read(&map[1]).unwrap(), "the maps' files differ");
    }
    // The live apps' time was that of their input.
    let span = elk_log::Index::read(Path::new(&old), &mut |_, _| {}).unwrap().span().unwrap();
    let live =
        LogReader::open(Path::new(&new)).unwrap().map(Result::unwrap).filter(|record| record.key == "MAP_UPDATE");
    let times: Vec<f64> = live.map(|record| record.time).collect();
    assert!(!times.is_empty() && times.iter().all(|time| (span.0..=span.1).contains(time)), "{span:?}: {times:?}");
    // Another map is another run, and the difference is named.
    let other =
        [&replay[..], &[&car, "--set", "Explorer.MaxScans=40", "--set", "Map.Grazing=none", "--log-dir", "other"]];
    elk.command(&other.concat()).output().unwrap();
    let output = diff(&elk.run_in("other").display().to_string());
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("first: MAP_UPDATE by Map") || said.contains("first: MAP_KNOWN by Map"), "{said}");
    assert!(LogReader::open(Path::new(&new)).unwrap().count() > compared as usize);
}
