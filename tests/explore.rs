//! Whole missions: the real program explores the six worlds, and does so the same way every time.

mod common;

use std::path::{Path, PathBuf};

use common::{Elk, free_port, processes_of};
use elk_log::LogReader;
use elk_spatial::keys::POSE_COMMAND;
use elk_spatial::messages::PoseCommand;
use serde_json::Value;

/// A mission that comes with elk.
fn mission(name: &str) -> String {
    format!("{}/mission-files/{name}.xml", env!("CARGO_MANIFEST_DIR"))
}

/// Runs a mission to its end; its folder and its summary.
fn explore(elk: &Elk, name: &str, arguments: &[&str]) -> (PathBuf, Value) {
    let file = mission(name);
    let community = elk.community();
    let mut all = vec!["launch", &file, "--headless", "--auto", "--community", community];
    all.extend(arguments);
    let out = elk.command(&all).output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
    assert!(out.status.success(), "{name} {arguments:?}:\n{said}");
    (elk.run(), elk.summary())
}

fn assert_explored(name: &str, summary: &Value) {
    assert_eq!(summary["complete"], true, "{name}: {summary:#}");
    assert_eq!(summary["contacts"], 0, "{name}: {summary:#}");
    assert_eq!(summary["frontiers_left"]["open"], 0, "{name}: {summary:#}");
    assert!(summary["accuracy"].as_f64().unwrap() > 0.99, "{name}: {summary:#}");
}

/// All pose commands of a run, as its log has them.
fn way(run: &Path) -> Vec<PoseCommand> {
    let mut log = LogReader::open(&run.join("log.mcap")).unwrap();
    let records: Vec<_> = log.by_ref().map(Result::unwrap).filter(|r| r.key == POSE_COMMAND.name()).collect();
    assert!(log.whole(), "the log is cut short");
    records.iter().map(|r| r.value.as_ref().decode(&POSE_COMMAND).unwrap()).collect()
}

#[test]
fn an_apartment_is_explored_by_processes_that_leave_nothing_behind() {
    let elk = Elk::new("apartment");
    let (run, summary) = explore(&elk, "apartment", &[]);
    assert_explored("apartment", &summary);
    for file in ["log.mcap", "map.bt", "picture.png", "summary.json", "apartment.xml"] {
        assert!(run.join(file).metadata().is_ok_and(|m| m.len() > 0), "{file} is missing");
    }
    for key in ["mission", "explorer", "policy", "seed", "reason", "scans", "path_length_m", "seconds", "step_by_app"] {
        assert!(!summary[key].is_null(), "the summary says nothing of {key}");
    }
    for voxels in ["known_voxels", "free_voxels", "occupied_voxels"] {
        assert!(summary[voxels].as_u64().is_some_and(|n| n > 1000), "{voxels}: {summary:#}");
    }
    assert_eq!(processes_of(&elk), [0; 0]);
    let left: Vec<_> = std::fs::read_dir("/dev/shm").unwrap().map(|f| f.unwrap().file_name()).collect();
    assert!(!left.iter().any(|f| f.to_string_lossy().contains(elk.community())), "left in /dev/shm: {left:?}");
}

/// The same seed, the same way, scan for scan: twice in seven processes, and once more in one.
#[test]
fn the_same_mission_goes_the_same_way_every_time_in_seven_processes_or_in_one() {
    let elk = Elk::new("same-way");
    let noisy = ["--set", "Sensor.NoiseSigma=0.2", "--set", "Sensor.Seed=7", "--set", "Explorer.MaxScans=60"];
    let commands: Vec<Vec<PoseCommand>> =
        [&["--log-dir", "a"][..], &["--log-dir", "b"], &["--log-dir", "c", "--in-process"]]
            .into_iter()
            .map(|arguments| {
                let all = [&noisy[..], arguments].concat();
                // Capped at 60 scans, the run fails; its way is what counts here.
                let file = mission("car");
                let mut command = vec!["launch", &file, "--headless", "--community", elk.community()];
                command.extend(&all);
                elk.command(&command).output().unwrap();
                way(&elk.run_in(arguments[1]))
            })
            .collect();
    assert!(commands[0].len() >= 59, "only {} pose commands", commands[0].len());
    assert!(commands[0] == commands[1], "two runs of the same mission went different ways");
    assert!(commands[0] == commands[2], "one process went another way than seven");
}

#[test]
fn the_mission_of_the_thesis_runs_as_printed_from_any_folder() {
    let elk = Elk::new("thesis");
    // The port that it lets clients of MOOS' in at may be somebody else's.
    let port = free_port().port();
    let [sensor, controller] = ["Sensor", "Controller"].map(|app| format!("{app}.MOOSPort={port}"));
    let (_, summary) = explore(&elk, "thesis-listing-2", &["--set", &sensor, "--set", &controller]);
    assert_explored("thesis-listing-2", &summary);
    assert_eq!(summary["explorer"], "Potential");
}

macro_rules! worlds {
    ($($test:ident: $mission:literal, $explorer:literal;)*) => {$(
        #[test]
        fn $test() {
            let elk = Elk::new(stringify!($test));
            let explorer = concat!("Explorer.type=", $explorer);
            let (_, summary) = explore(&elk, $mission, &["--set", explorer, "--in-process"]);
            assert_explored($mission, &summary);
            assert_eq!(summary["explorer"], $explorer);
        }
    )*};
}

worlds! {
    the_car_by_closest_frontier: "car", "ClosestFrontier";
    the_car_by_potential: "car", "Potential";
    the_hall_by_closest_frontier: "hall", "ClosestFrontier";
    the_hall_by_potential: "hall", "Potential";
    the_kitchen_by_closest_frontier: "kitchen", "ClosestFrontier";
    the_kitchen_by_potential: "kitchen", "Potential";
    the_long_hall_by_closest_frontier: "hall-long", "ClosestFrontier";
    the_long_hall_by_potential: "hall-long", "Potential";
    the_apartment_by_closest_frontier: "apartment", "ClosestFrontier";
    the_apartment_by_potential: "apartment", "Potential";
    the_garage_by_closest_frontier: "garage", "ClosestFrontier";
    the_garage_by_potential: "garage", "Potential";
}
