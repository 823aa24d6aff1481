//! Logs through the real program: what is in them, are they whole, what can be made of them.

mod common;

use std::path::Path;
use std::process::Output;

use common::lab::{Lab, hear, wait_for_clients};
use common::skip::skip;
use common::{Elk, kill};
use elk_bus::{Client, Type, TypeRef, Value};
use elk_log::{LogReader, LogWriter, Metadata, Record};
use elk_spatial::messages::Progress;
use rustix::process::Signal;
use serde_json::Value as Json;

fn record(number: u64, key: &str, value: Value) -> Record {
    Record {
        key: key.into(),
        source: "pNav".into(),
        source_aux: String::new(),
        community: "lab".into(),
        time: 1_000.0 + number as f64 * 0.5,
        sequence: number,
        received: 1_000.0 + number as f64 * 0.5,
        order: number,
        epoch: 1,
        value,
    }
}

fn typed(progress: &Progress) -> Value {
    let mut bytes = Vec::new();
    elk_bus::codec::encode_onto(progress, &mut bytes).unwrap();
    Value::Binary { type_: TypeRef::of::<Progress>().to_type(), bytes }
}

fn progress(scans: u64) -> Progress {
    Progress { scan: scans, revision: scans, scans, path_length_m: 2.5, free: 8, finished: false }
}

/// Three kinds of value, half a second apart, flushed one by one.
fn write_log(path: &Path, count: u64) {
    let metadata = Metadata {
        mission_name: "lab.xml".into(),
        mission: "<Scenario/>".into(),
        version: "0.1.0".into(),
        seed: 7,
        started: 999.0,
        ..Metadata::default()
    };
    let mut log = LogWriter::create(path, &metadata).unwrap();
    for number in 0..count {
        let (key, value) = match number % 3 {
            0 => ("DEPTH", Value::Double(number as f64)),
            1 => ("NOTE", Value::Text(format!("line {number}\nand another"))),
            _ => ("PROGRESS", typed(&progress(number))),
        };
        log.append(&record(number, key, value).as_ref()).unwrap();
        log.flush().unwrap();
    }
    log.finish().unwrap();
}

/// `elk log …`, its exit code and what it said, standard error last.
fn elk_log(elk: &Elk, arguments: &[&str]) -> (Option<i32>, String) {
    let output: Output = elk.command(&[&["log"], arguments].concat()).output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    (output.status.code(), said)
}

fn succeed(elk: &Elk, arguments: &[&str]) -> String {
    let (code, said) = elk_log(elk, arguments);
    assert_eq!(code, Some(0), "{arguments:?}: {said}");
    said
}

fn records(path: &Path) -> Vec<Record> {
    LogReader::open(path).unwrap().map(Result::unwrap).collect()
}

#[test]
fn info_says_what_is_in_a_log_whole_or_not() {
    let elk = Elk::new("log-info");
    let log = elk.folder().join("log.mcap");
    write_log(&log, 9);
    let info: Json = serde_json::from_str(&succeed(&elk, &["info", ".", "--json"])).unwrap();
    assert_eq!((&info["messages"], &info["whole"], &info["seed"]), (&9.into(), &true.into(), &7.into()));
    assert_eq!((&info["start"], &info["end"]), (&1000.0.into(), &1004.0.into()));
    assert_eq!(info["mission"], "lab.xml");
    let topic = &info["topics"][2];
    assert_eq!((&topic["name"], &topic["type"], &topic["count"]), (&"PROGRESS".into(), &"Progress".into(), &3.into()));
    assert!(succeed(&elk, &["info", "log.mcap"]).contains("9 messages in 4.000 s"));

    let bytes = std::fs::read(&log).unwrap();
    std::fs::write(&log, &bytes[..bytes.len() / 2]).unwrap();
    let info: Json = serde_json::from_str(&succeed(&elk, &["info", ".", "--json"])).unwrap();
    assert_eq!(info["whole"], false);
    assert!(info["messages"].as_u64().is_some_and(|count| (1..9).contains(&count)), "{info}");
}

/// Regression: a tree was built of whatever a log says of its run, for sixteen times its length.
#[test]
fn what_a_log_says_of_its_run_is_shown_as_a_text_if_it_is_long() {
    let elk = Elk::new("log-long-run");
    for (zeros, is_text) in [(10, false), (1 << 20, true)] {
        let path = elk.folder().join("log.mcap");
        let _ = std::fs::remove_file(&path);
        let run = format!("[{}0]", "0,".repeat(zeros));
        LogWriter::create(&path, &Metadata { run, ..Metadata::default() }).unwrap().finish().unwrap();
        let info: Json = serde_json::from_str(&succeed(&elk, &["info", ".", "--json"])).unwrap();
        assert_eq!((info["run"].is_string(), info["run"].is_array()), (is_text, !is_text));
    }
}

#[test]
fn check_finds_every_flipped_byte() {
    let elk = Elk::new("log-check");
    let log = elk.folder().join("log.mcap");
    write_log(&log, 9);
    assert!(succeed(&elk, &["check", "log.mcap"]).contains("9 messages, whole"));
    let bytes = std::fs::read(&log).unwrap();
    // Everywhere, the library says so; here that the program does, and what its exit code is.
    for at in [40, bytes.len() / 3, bytes.len() / 2, bytes.len() - 60] {
        let mut damaged = bytes.clone();
        damaged[at] ^= 4;
        std::fs::write(&log, &damaged).unwrap();
        let (code, said) = elk_log(&elk, &["check", "log.mcap"]);
        assert_eq!(code, Some(1), "byte {at}: {said}");
    }
}

#[test]
fn recover_mends_a_log_that_was_cut_and_leaves_the_old_one_alone() {
    let elk = Elk::new("log-recover");
    let log = elk.folder().join("log.mcap");
    write_log(&log, 9);
    let bytes = std::fs::read(&log).unwrap();
    let half = &bytes[..bytes.len() * 2 / 3];
    std::fs::write(&log, half).unwrap();
    let before = records(&log);
    let said = succeed(&elk, &["recover", "log.mcap", "-o", "mended.mcap", "--compression", "zstd"]);
    assert!(said.contains(&format!("{} messages in mended.mcap", before.len())), "{said}");
    assert_eq!(records(&elk.folder().join("mended.mcap")), before);
    assert!(succeed(&elk, &["check", "mended.mcap"]).contains("whole"));
    assert_eq!(std::fs::read(&log).unwrap(), half);
    let (code, said) = elk_log(&elk, &["recover", "log.mcap", "-o", "mended.mcap"]);
    assert!(code == Some(1) && said.contains("mended.mcap"), "nothing is overwritten: {said}");
}

#[test]
fn cat_shows_values_and_cut_keeps_a_part() {
    let elk = Elk::new("log-cat");
    let log = elk.folder().join("log.mcap");
    write_log(&log, 12);
    let said = succeed(&elk, &["cat", ".", "--keys", "PRO*", "--keys", "DEPTH", "--from", "1", "--to", "3"]);
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 4, "{said}");
    assert!(lines[0].starts_with("1.000000") && lines[0].contains(r#""path_length_m":2.5"#), "{said}");
    let said = succeed(&elk, &["cat", ".", "--exclude", "PROGRESS", "--source", "p*", "--json"]);
    let line: Json = serde_json::from_str(said.lines().nth(1).unwrap()).unwrap();
    assert_eq!(
        (&line["key"], &line["value"], &line["order"]),
        (&"NOTE".into(), &"line 1\nand another".into(), &1.into())
    );
    // Regression: a slip in a name, or times that there are not, gave an empty log or table, and success.
    let (cat, cut, export) = (["cat", "."], ["cut", ".", "-o", "none"], ["export", ".", "--to", "csv", "-o", "none"]);
    for (commands, nothing) in
        [(&[&cat[..], &cut, &export][..], ["--keys", "NOPE"]), (&[&cat, &cut], ["--from", "1e6"])]
    {
        for command in commands {
            let command = [command, &nothing[..]].concat();
            let (code, said) = elk_log(&elk, &command);
            assert!(code == Some(1) && said.contains("is what the options say"), "{command:?}: {said}");
            assert!(!elk.folder().join("none").exists());
        }
    }
    succeed(&elk, &["cut", ".", "--exclude", "NOTE", "--from", "1", "-o", "part.mcap"]);
    let part = records(&elk.folder().join("part.mcap"));
    let expected: Vec<Record> = records(&log).into_iter().filter(|r| r.key != "NOTE" && r.received >= 1001.0).collect();
    assert_eq!(part, expected);
}

#[test]
fn diff_names_the_first_difference_and_does_not_compare_what_is_measured_anew() {
    let elk = Elk::new("log-diff");
    let (one, other) = (elk.folder().join("one.mcap"), elk.folder().join("other.mcap"));
    write_log(&one, 9);
    write_log(&other, 9);
    assert!(succeed(&elk, &["diff", "one.mcap", "other.mcap"]).contains("the same: 9 messages"));
    std::fs::remove_file(&other).unwrap();
    let mut log = LogWriter::create(&other, &Metadata::default()).unwrap();
    for mut record in records(&one) {
        record.time += 77.0;
        if record.sequence == 5 {
            record.value = typed(&Progress { path_length_m: 2.75, ..progress(5) });
        }
        log.append(&record.as_ref()).unwrap();
    }
    log.finish().unwrap();
    let (code, said) = elk_log(&elk, &["diff", "one.mcap", "other.mcap"]);
    assert_eq!(code, Some(1));
    assert!(said.contains("PROGRESS by pNav, its message 1, at 1002.5"), "{said}");
    assert!(said.contains("path_length_m: 2.5 became 2.75"), "{said}");
    succeed(&elk, &["diff", "one.mcap", "other.mcap", "--exclude", "PROGRESS"]);
    let (code, said) = elk_log(&elk, &["diff", "one.mcap", "other.mcap", "--keys", "NOTHING"]);
    assert!(code == Some(1) && said.contains("nothing to compare"), "{said}");
}

#[test]
fn an_alog_has_moos_layout_and_comes_back() {
    let elk = Elk::new("log-export");
    let log = elk.folder().join("log.mcap");
    write_log(&log, 3);
    let other = Value::Binary { type_: Type::undescribed("Other", 1), bytes: vec![7; 50] };
    let all: Vec<Record> = records(&log).into_iter().chain([record(3, "OTHER", other.clone())]).collect();
    std::fs::remove_file(&log).unwrap();
    let mut with_other = LogWriter::create(&log, &Metadata { started: 999.0, ..Metadata::default() }).unwrap();
    all.iter().for_each(|record| with_other.append(&record.as_ref()).unwrap());
    with_other.finish().unwrap();
    succeed(&elk, &["export", ".", "--to", "alog", "-o", "run.alog"]);
    let alog = std::fs::read_to_string(elk.folder().join("run.alog")).unwrap();
    let lines: Vec<&str> = alog.lines().collect();
    assert_eq!(lines[3], "%% LOGSTART               999.00");
    assert_eq!(lines[5], "1.000           DEPTH                pNav            0.00000      ");
    assert_eq!(lines[6], "1.500           NOTE                 pNav            line 1\\nand another ");
    assert!(lines[7].contains(r#""path_length_m":2.5"#), "a small typed value is JSON: {}", lines[7]);
    assert!(lines[8].contains("<MOOS_BINARY>File=run.blog,Offset=53,Bytes="), "{}", lines[8]);
    assert_eq!(lines.len(), 9, "a line break in a text breaks no line");
    let back: Vec<Record> =
        elk_log::alog::AlogReader::open(&elk.folder().join("run.alog")).unwrap().map(Result::unwrap).collect();
    assert_eq!(back[3].value, other, "a binary value is the same as before");
    assert_eq!((back[0].value.clone(), back[0].time), (Value::Double(0.0), 1000.0));

    succeed(&elk, &["export", ".", "--to", "csv", "-o", "run.csv"]);
    let csv = std::fs::read_to_string(elk.folder().join("run.csv")).unwrap();
    assert_eq!(csv.lines().nth(1), Some("0.000000,DEPTH,pNav,0"));
    assert!(csv.contains("1.000000,PROGRESS.path_length_m,pNav,2.5\n"), "{csv}");
}

/// Two of MOOS-IvP's own logs, with the quirks of their time.
#[test]
fn logs_that_moos_ivp_wrote_are_read() {
    let data = common::data::folder();
    for name in ["alogclip_test", "alogscan_test"] {
        let path = data.join("alog").join(format!("{name}.alog"));
        if !path.is_file() {
            skip("logs_that_moos_ivp_wrote_are_read", "data", &format!("{} is not there", path.display()));
            continue;
        }
        let log = elk_log::alog::AlogReader::open(&path).unwrap();
        assert_eq!(log.start(), 1_212_385_118.5);
        let all: Vec<Record> = log.map(Result::unwrap).collect();
        let text = std::fs::read_to_string(&path).unwrap();
        let lines = text.lines().filter(|line| !line.starts_with('%') && !line.trim().is_empty());
        assert_eq!(all.len(), lines.count(), "{name}");
        assert_eq!((all[0].key.as_str(), &all[0].value), ("NAV_Y", &Value::Double(0.0)));
        assert!(all.iter().any(|r| r.value == Value::Text("YAW_PID_KP             = 0.500".into())), "{name}");
    }
}

#[test]
fn what_is_no_log_is_an_error_of_one_line() {
    let elk = Elk::new("log-bad");
    std::fs::write(elk.folder().join("empty.mcap"), "").unwrap();
    std::fs::write(elk.folder().join("text.mcap"), "not a log at all").unwrap();
    for (file, words) in [("empty.mcap", "empty"), ("text.mcap", "no log of elk"), ("none.mcap", "cannot read")] {
        for command in ["info", "check", "cat"] {
            let (code, said) = elk_log(&elk, &[command, file]);
            assert!(code == Some(1) && said.contains(words) && said.lines().count() == 1, "{command} {file}: {said}");
        }
    }
}

/// Whether this process was started to outlive its terminal (`nohup`), and those that it starts with it.
fn ignores_hangups() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

#[test]
fn record_takes_a_part_of_a_running_community_until_it_is_told_to_end() {
    let elk = Elk::new("log-record");
    let community = elk.community();
    let mut lab = Lab::deaf(&elk);
    // A terminal that is closed is an end as good as another.
    let signals = [("int.mcap", Signal::INT), ("term.mcap", Signal::TERM), ("hup.mcap", Signal::HUP)];
    for (file, signal) in signals.into_iter().filter(|(_, signal)| *signal != Signal::HUP || !ignores_hangups()) {
        let arguments = ["log", "record", "NAV_*", "SPEED", "--community", community, "-o", file];
        let mut recorder = elk.command(&arguments).spawn().unwrap();
        lab.wait_for_reader(&format!("record-{}", recorder.id()));
        for (key, value) in [("NAV_X", 1.0), ("OTHER", 2.0), ("SPEED", 3.0)] {
            say(&mut lab.listener, key, value);
        }
        let part = elk.folder().join(file);
        wait_for_records(&elk, &part, "SPEED", 1);
        kill(recorder.id() as i32, signal);
        assert!(recorder.wait().unwrap().success(), "{signal:?}");
        assert!(succeed(&elk, &["check", file]).contains("whole"), "{signal:?}");
        let all: Vec<Record> = records(&part).into_iter().filter(|record| record.source == "listener").collect();
        let said = all.iter().rev().take(2).rev().map(|record| (record.key.as_str(), record.value.clone()));
        assert!(said.eq([("NAV_X", Value::Double(1.0)), ("SPEED", Value::Double(3.0))]), "{all:?}");
        assert!(all.iter().all(|record| record.key != "OTHER"), "{all:?}");
    }
    lab.end();
}

/// One flipped bit in the second of three chunks (mcap 1390).
#[test]
fn recover_gives_back_every_message_of_a_log_with_a_flipped_bit() {
    let elk = Elk::new("log-flipped");
    let case = concat!(env!("CARGO_MANIFEST_DIR"), "/bus/log/tests/cases/bitflip.mcap");
    let (code, said) = elk_log(&elk, &["check", case]);
    assert!(code == Some(1) && said.contains("36 messages, NOT whole") && said.contains("elk log recover"), "{said}");
    let said = succeed(&elk, &["recover", case, "-o", "mended.mcap"]);
    assert!(said.contains("133 messages in mended.mcap") && said.contains("a bit of byte 12320 was flipped"), "{said}");
    assert!(succeed(&elk, &["check", "mended.mcap"]).contains("133 messages, whole"));
}

#[test]
fn prune_deletes_old_runs_only_when_it_is_told_to() {
    let elk = Elk::new("log-prune");
    let hours = |hours: u64| std::time::UNIX_EPOCH + std::time::Duration::from_secs(1_700_000_000 + 3600 * hours);
    for (number, name) in (0..).zip(["oldest", "older", "newer"]) {
        let folder = elk.folder().join("logs").join(name);
        std::fs::create_dir_all(&folder).unwrap();
        write_log(&folder.join("log.mcap"), 3);
        std::fs::File::options()
            .write(true)
            .open(folder.join("log.mcap"))
            .unwrap()
            .set_modified(hours(number))
            .unwrap();
    }
    std::fs::create_dir(elk.folder().join("logs/no-run")).unwrap();
    let there = |name: &str| elk.folder().join("logs").join(name).exists();
    let said = succeed(&elk, &["prune", "--keep", "1"]);
    assert!(said.contains("logs/oldest") && said.contains("2 runs") && said.contains("--delete"), "{said}");
    assert!(said.ends_with("kept: 1 the newest; 1 neither a run nor a comparison\n"), "{said}");
    assert!(there("oldest") && there("older"));
    assert!(
        succeed(&elk, &["prune", "logs", "--keep", "2", "--older-than", "1", "--delete"]).contains("1 runs deleted")
    );
    assert!(!there("oldest") && there("older") && there("newer") && there("no-run"));
    assert_eq!(elk_log(&elk, &["prune"]).0, Some(2), "nothing is deleted that nobody asked for");
    // A comparison is one; it is as old as the newest of its runs.
    let first = elk.folder().join("logs/compare-lab/run-001/lab");
    std::fs::create_dir_all(&first).unwrap();
    write_log(&first.join("log.mcap"), 3);
    let of_last_minute = succeed(&elk, &["prune", "--older-than", "36h"]);
    assert!(of_last_minute.contains("kept: 1 still being written, or written within the last minute; 1 neither"));
    std::fs::File::options().write(true).open(first.join("log.mcap")).unwrap().set_modified(hours(0)).unwrap();
    let said = succeed(&elk, &["prune", "--older-than", "2w", "--delete"]);
    assert!(said.contains("logs/compare-lab: ") && said.contains("3 runs deleted") && !there("compare-lab"), "{said}");
}

/// Regression: a run that had nothing to record for a minute, because it was paused, say, was deleted under its logger.
#[test]
fn prune_leaves_a_run_whose_log_is_still_written() {
    let elk = Elk::new("log-prune-paused");
    let folder = elk.folder().join("logs/paused");
    std::fs::create_dir_all(&folder).unwrap();
    let log = LogWriter::create(&folder.join("log.mcap"), &Metadata::default()).unwrap();
    let long_ago = std::time::UNIX_EPOCH + std::time::Duration::from_secs(1_700_000_000);
    std::fs::File::open(folder.join("log.mcap")).unwrap().set_modified(long_ago).unwrap();
    assert!(succeed(&elk, &["prune", "--keep", "0", "--delete"]).contains("0 runs deleted"));
    assert!(folder.exists());
    drop(log);
    assert!(succeed(&elk, &["prune", "--keep", "0", "--delete"]).contains("1 runs deleted"));
    assert!(!folder.exists());
}

fn say(speaker: &mut Client, key: &str, number: f64) {
    speaker.comms.notify(key, number).unwrap();
    speaker.comms.flush().unwrap();
}

/// Waits until so many numbers of a variable stand in a log, whole or not.
fn wait_for_records(elk: &Elk, log: &Path, key: &str, count: usize) {
    let is_wanted = |record: &Record| record.key == key;
    let written = || LogReader::open(log).map_or(0, |log| log.flatten().filter(is_wanted).count());
    elk.events().wait_until("messages in the log", || written() >= count);
}

/// What was flushed before `kill -9` is there, and a logger that is started again overwrites none of it.
#[test]
fn a_logger_that_is_killed_and_started_again_goes_on_in_the_next_file() {
    let elk = Elk::new("log-killed");
    let community = elk.community();
    let mut lab = Lab::deaf(&elk);
    let arguments = ["logger", "--type", "Mcap", "--community", community, "File=log.mcap", "Flush=0"];
    // The second life is given first what was said last in the other one.
    for (file, said, written) in [("log.mcap", 1..=6, 6), ("log.1.mcap", 7..=12, 7)] {
        let mut logger = elk.command(&arguments).spawn().unwrap();
        lab.wait_for_reader("Logger");
        said.for_each(|count| say(&mut lab.listener, "COUNT", f64::from(count)));
        wait_for_records(&elk, &elk.folder().join(file), "COUNT", written);
        kill(logger.id() as i32, Signal::KILL);
        logger.wait().unwrap();
        wait_for_clients(&elk, "the logger's end", |clients| !clients.contains(&"Logger"));
    }
    let mut run = LogReader::open(elk.folder()).unwrap();
    let counts: Vec<f64> = run
        .by_ref()
        .map(Result::unwrap)
        .filter(|record| record.key == "COUNT")
        .map(|record| if let Value::Double(number) = record.value { number } else { f64::NAN })
        .collect();
    assert!(!run.whole());
    assert!(counts.iter().copied().eq((1..=6).chain(6..=12).map(f64::from)), "{counts:?}");
    lab.end();
}

/// A logger that flushes ten times a second, its system calls for the disk itself noted in `calls.txt`.
fn traced_logger(elk: &Elk, settings: &[&str], inject: &[&str]) -> std::process::Child {
    let logger = elk.command(&["logger", "--type", "Mcap", "--community", elk.community(), "File=log.mcap"]);
    let mut strace = std::process::Command::new("strace");
    // With -D the logger itself is this process' child.
    strace.args(["-D", "-f", "-o", "calls.txt", "-e", "trace=fdatasync"]).args(inject);
    strace.arg(logger.get_program()).args(logger.get_args()).arg("Flush=0.1").args(settings);
    strace.current_dir(elk.folder()).spawn().unwrap()
}

/// How often the disk itself was asked, and said that it has all.
fn syncs(elk: &Elk) -> usize {
    let calls = std::fs::read_to_string(elk.folder().join("calls.txt")).unwrap_or_default();
    calls.lines().filter(|line| line.contains("fdatasync(") && line.ends_with("= 0")).count()
}

#[test]
fn sync_waits_for_the_disk_itself_and_says_when_that_fails() {
    let strace = std::process::Command::new("strace").args(["-o", "/dev/null", "true"]).output();
    if !strace.is_ok_and(|output| output.status.success()) {
        let why = "strace is not installed, or may not trace";
        skip("sync_waits_for_the_disk_itself_and_says_when_that_fails", "strace", why);
        return;
    }
    let elk = Elk::new("log-sync");
    let mut lab = Lab::deaf(&elk);
    let end = |mut logger: std::process::Child| {
        kill(logger.id() as i32, Signal::TERM);
        assert!(logger.wait().unwrap().success());
    };

    let logger = traced_logger(&elk, &["Sync=0"], &[]);
    lab.wait_for_reader("Logger");
    for flush in 1..=4 {
        say(&mut lab.listener, "COUNT", 1.0);
        wait_for_records(&elk, &elk.folder().join("log.mcap"), "COUNT", flush);
    }
    assert_eq!(syncs(&elk), 0, "nobody asked for it");
    end(logger);
    assert_eq!(syncs(&elk), 1, "at its end a log is on the disk");

    let logger = traced_logger(&elk, &["Sync=0.1"], &[]);
    elk.events().wait_until("the disk's word", || syncs(&elk) >= 3);
    end(logger);

    lab.listener.comms.register("LOGGER_ERROR").unwrap();
    lab.listener.comms.flush().unwrap();
    let logger = traced_logger(&elk, &["Sync=0.1"], &["-e", "inject=fdatasync:error=EIO:when=1"]);
    let mut errors: Vec<String> = Vec::new();
    hear(&mut lab.listener, "that it fails, and that it is over", |mail| {
        errors.extend(mail.as_text().map(str::to_owned));
        errors.last().is_some_and(String::is_empty).then_some(())
    });
    let words = "the disk does not say that it has the log log.2.mcap: Input/output error";
    assert!(errors.len() == 2 && errors[0].starts_with(words), "{errors:?}");
    end(logger);
    lab.end();
}
