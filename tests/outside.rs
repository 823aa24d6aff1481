//! What somebody made who knows no better, or means harm, given to the real program: files that are none, logs that are
//! traps, parameters that contradict each other.

mod common;

use std::path::{Path, PathBuf};

use common::car::car;
use common::{Elk, processes_of};

/// Runs the program with at most so much memory (MB) and for at most a minute; its exit code, and all that it said.
fn within(elk: &Elk, megabytes: u64, arguments: &[&str]) -> (Option<i32>, String) {
    let limited = format!("ulimit -v {}; exec timeout 60 \"$0\" \"$@\"", megabytes * 1000);
    let out = std::process::Command::new("bash")
        .args(["-c", &limited, env!("CARGO_BIN_EXE_elk")])
        .args(arguments)
        .current_dir(elk.folder())
        .output()
        .unwrap();
    let said = [out.stdout, out.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
    assert_ne!(out.status.code(), Some(124), "{arguments:?} went on for ever: {said}");
    (out.status.code(), said)
}

/// A gigabyte of zeros in 33 kB of Zstandard: blocks of 128 KiB, each one byte that is repeated (RFC 8878, 3.1.1.2).
fn packed_zeros() -> Vec<u8> {
    let block = |last: u32| [&(last | 1 << 1 | 128 << 10 << 3).to_le_bytes()[..3], &[0]].concat();
    let head = [0x28, 0xb5, 0x2f, 0xfd, 0, 10 << 3].to_vec();
    [head, block(0).repeat(8191), block(1)].concat()
}

/// A log of a chunk that is a trap.
fn trap(folder: &Path) -> PathBuf {
    let packed = packed_zeros();
    let sizes = [0, 0, 1 << 30].map(u64::to_le_bytes).concat();
    let names =
        [&0_u32.to_le_bytes()[..], &4_u32.to_le_bytes(), b"zstd", &(packed.len() as u64).to_le_bytes()].concat();
    let chunk = [sizes, names, packed].concat();
    let record = [&[6], &(chunk.len() as u64).to_le_bytes()[..], &chunk].concat();
    let path = folder.join("trap.mcap");
    std::fs::write(&path, [&b"\x89MCAP0\r\n"[..], &record].concat()).unwrap();
    assert!(path.metadata().unwrap().len() < 34_000);
    path
}

#[test]
fn a_log_that_claims_to_be_a_gigabyte_costs_no_command_anything() {
    let elk = Elk::new("trap");
    let path = trap(elk.folder());
    let log = path.to_str().unwrap();
    let commands: [&[&str]; 8] = [
        &["log", "info", log],
        &["log", "check", log],
        &["log", "cat", log],
        &["log", "recover", log, "-o", "mended.mcap"],
        &["log", "cut", log, "-o", "cut.mcap"],
        &["log", "diff", log, log],
        &["log", "export", log, "--to", "csv", "-o", "trap.csv"],
        &["replay", log, "--community", elk.community()],
    ];
    for arguments in commands {
        let (code, said) = within(&elk, 300, arguments);
        assert!(matches!(code, Some(0 | 1)), "{arguments:?}: {code:?}, {said}");
        let meant = said.contains("claims 1073741824 bytes in 327") || said.contains("start one with `elk db`");
        assert!(meant, "{arguments:?}: {said}");
    }
}

#[test]
fn what_is_no_file_is_said_by_every_command_and_none_waits_for_it() {
    let elk = Elk::new("nofile");
    for name in ["fifo.xml", "fifo.obj", "fifo.mcap", "fifo.alog"] {
        assert!(std::process::Command::new("mkfifo").arg(elk.folder().join(name)).status().unwrap().success());
    }
    std::fs::write(elk.folder().join("car.xml"), car("auto")).unwrap();
    let commands: [&[&str]; 14] = [
        &["check", "fifo.xml"],
        &["launch", "fifo.xml"],
        &["check", "/dev/zero"],
        &["check", "."],
        &["check", "car.xml", "--set", "Sensor.World=fifo.obj"],
        &["launch", "car.xml", "--set", "Sensor.World=.", "--community", elk.community()],
        &["sensor", "--type", "Simulator", "World=fifo.obj"],
        &["log", "info", "fifo.mcap"],
        &["log", "cat", "/dev/zero"],
        &["log", "diff", "fifo.mcap", "fifo.mcap"],
        &["log", "recover", "fifo.mcap", "-o", "mended.mcap"],
        &["replay", "fifo.mcap"],
        &["replay", "fifo.alog"],
        &["logger", "--type", "Mcap", "File=fifo.mcap", "--community", elk.community()],
    ];
    for arguments in commands {
        let (code, said) = within(&elk, 8000, arguments);
        let meant = ["a FIFO", "a device", "a folder", "there is no file", "no broker serves"];
        assert_eq!(code, Some(1), "{arguments:?}: {said}");
        assert!(meant.iter().any(|words| said.contains(words)), "{arguments:?}: {said}");
    }
    assert_eq!(processes_of(&elk), [0; 0]);
}

#[test]
fn variables_that_cannot_be_are_found_before_anything_starts() {
    let elk = Elk::new("variables");
    std::fs::write(elk.folder().join("car.xml"), car("auto")).unwrap();
    for (set, words) in [
        ("Sensor.Output=DB_CLIENTS", "DB_CLIENTS is a variable that the broker writes itself"),
        ("Sensor.Output=PLAN", "PLAN carries Plan values in every mission"),
        ("Map.Input=SCAN_9", "nobody in the mission publishes SCAN_9; published are SCAN"),
    ] {
        for command in ["check", "launch"] {
            let out = elk.command(&[command, "car.xml", "--set", set]).output().unwrap();
            let said = String::from_utf8(out.stderr).unwrap();
            assert!(!out.status.success() && said.contains(words), "{command} {set}: {said}");
        }
    }
    assert!(!elk.folder().join("logs").exists(), "nothing was begun");
}

#[test]
fn a_controller_that_is_told_to_wait_can_be_told_to_go_on() {
    let elk = Elk::new("manual");
    let mut launcher = elk.launch_with(&car("auto"), &["--set", "Controller.Manual=true"]);
    launcher.wait_for("Enter takes a step");
    assert_eq!(elk.obeyed(&["step"]), "one step\n");
    assert_eq!(elk.obeyed(&["resume"]), "resumed\n");
    let (code, said) = launcher.end();
    assert_eq!((code, &elk.summary()["complete"]), (Some(0), &true.into()), "{said}");
}

#[test]
fn a_manual_mission_that_is_to_run_through_does_wherever_it_says_that_it_is_one() {
    let elk = Elk::new("auto");
    let (code, said) = elk.launch_with(&car("auto"), &["--auto", "--set", "Controller.Manual=true"]).end();
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn a_map_that_could_not_be_written_is_said_before_the_world_is_explored() {
    let elk = Elk::new("nomap");
    for file in ["/proc/self/map.bt", ".", "/dev/full"] {
        let set = format!("Map.File={file}");
        let (code, said) = elk.launch_with(&car("auto"), &["--set", &set]).end();
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains(&format!("Map cannot write File={file}: ")) && !said.contains("alive:"), "{said}");
    }
    assert_eq!(processes_of(&elk), [0; 0]);
}

#[test]
fn a_map_that_cannot_be_written_at_the_end_fails_its_mission() {
    let elk = Elk::new("lostmap");
    let file = elk.folder().join("maps/map.bt");
    let set = format!("Map.File={}", file.display());
    let mut launcher = elk.launch_with(&car("auto"), &["--set", "Controller.Manual=true", "--set", &set]);
    launcher.wait_for("Enter takes a step");
    // Meanwhile somebody puts something else there.
    std::fs::create_dir_all(&file).unwrap();
    elk.obeyed(&["resume"]);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(1), "{said}");
    let summary = elk.summary();
    let reason = summary["reason"].as_str().unwrap();
    let words = format!("cannot write the map to {}", file.display());
    assert!(reason.contains("Map could not end in good order") && reason.contains(&words), "{reason}");
    // With the summary, and as the last word.
    assert_eq!((said.matches(&words).count(), &summary["complete"]), (2, &false.into()), "{said}");
    elk.wait_until_deserted();
}
