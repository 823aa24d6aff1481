//! Missions where there is no room left: on the disk, in shared memory. The folders are made small in a mount namespace of
//! their own; where the system allows none, the tests say so and skip.

mod common;

use std::fs::File;
use std::process::{Command, Stdio};

use common::Elk;

/// A small world is explored by three coarse apps: enough for scans, updates, plans and a log.
const MISSION: &str = "<Scenario name=\"Small\"><Sensor type=\"Simulator\"/><Map type=\"OctoMap\"><Res>0.25 m</Res></Map>\
    <Explorer type=\"ClosestFrontier\"><Mid>0; 0; 0.5</Mid><Dim>3; 3; 3</Dim></Explorer>\
    <Controller type=\"MOOSSim\"/></Scenario>";

/// Launches the mission where `folder` is a file system of `size`; its exit code, and what it said. `None`: not allowed here.
fn launch_with_little_room(elk: &Elk, test: &str, folder: &str, size: &str) -> Option<(Option<i32>, String)> {
    let mission = elk.folder().join("mission.xml");
    std::fs::write(&mission, MISSION).unwrap();
    std::fs::create_dir(elk.folder().join("logs")).unwrap();
    let inside = |script: &str| {
        let mut command = Command::new("unshare");
        let script = format!("mount -t tmpfs -o size={size} tmpfs {folder} && {script}");
        command.args(["--map-root-user", "--mount", "sh", "-c", &script]);
        command.current_dir(elk.folder()).stdin(Stdio::null());
        command
    };
    if !inside("true").output().is_ok_and(|tried| tried.status.success()) {
        println!("{test}: skipped, `unshare --map-root-user --mount` cannot mount a tmpfs here");
        return None;
    }
    let (program, community) = (env!("CARGO_BIN_EXE_elk"), elk.community());
    let launched = inside(&format!("exec {program} launch mission.xml --headless --community {community}"));
    let output = { launched }.output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    Some((output.status.code(), String::from_utf8(said).unwrap()))
}

#[test]
fn a_full_disk_is_reported_and_stops_no_mission() {
    let elk = Elk::new("full-disk");
    let test = "a_full_disk_is_reported_and_stops_no_mission";
    let Some((code, said)) = launch_with_little_room(&elk, test, "logs", "64k") else { return };
    assert!(said.contains("cannot write to the log"), "{said}");
    // The whole world was explored, but its map could not be kept.
    let explored =
        "Small: NOT complete: every frontier that can be reached and seen is resolved, but Map could not end";
    assert!(said.contains(explored), "{said}");
    // Whoever reads `summary.json` is not to take the run for one that left it.
    assert!(said.contains("summary.json: No space left on device"), "{said}");
    assert_eq!(code, Some(1), "{said}");
}

#[test]
fn full_shared_memory_is_named_with_what_to_do() {
    let elk = Elk::new("full-shm");
    let test = "full_shared_memory_is_named_with_what_to_do";
    let Some((code, said)) = launch_with_little_room(&elk, test, "/dev/shm", "64k") else { return };
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("there is no room for one more client (/dev/shm has only 0 MB left"), "{said}");
    assert!(said.contains("mount -o remount,size="), "{said}");
}

#[test]
fn words_that_cannot_be_written_change_no_exit_code() {
    let full = File::options().write(true).open("/dev/full").unwrap();
    let ended = Elk::new("dev-full").command(&["check", "no-such-mission.xml"]).stderr(full).status().unwrap();
    assert_eq!(ended.code(), Some(1));
}
