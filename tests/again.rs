//! A run is had again: from its folder alone, from anywhere, bit for bit.

mod common;

use std::path::{Path, PathBuf};

use common::{Elk, said};
use elk_log::Index;
use serde_json::Value as Json;

/// Launches from `place`, with the logs in `logs` there; the run's folder.
fn launched(elk: &Elk, place: &Path, logs: &str, arguments: &[&str]) -> PathBuf {
    let mut command = elk.command(&["launch"]);
    command.args(arguments).args(["--headless", "--log-dir", logs, "--community", elk.community()]).current_dir(place);
    let out = command.output().unwrap();
    assert!(out.status.success(), "{arguments:?}: {}", said(&out));
    elk.run_in(place.join(logs))
}

const MISSION: &str = "<Scenario name=\"Twice\" type=\"manual\"><Sensor type=\"Simulator\"><World>worlds/car.obj</World>\
    <Start>0; 0; 0.8</Start></Sensor><Filter type=\"Distance\" Threshold=\"9\"/><Map type=\"OctoMap\"><Res>0.3 m</Res></Map>\
    <Explorer type=\"Potential\"><Mid>0; 0; 0</Mid><Dim>5.7; 4.3; 4.5</Dim><Solver>jacobi</Solver></Explorer>\
    <Controller type=\"MOOSSim\"/></Scenario>";

#[test]
fn a_run_is_had_again_from_its_folder_from_anywhere_bit_for_bit() {
    let elk = Elk::new("again");
    let (home, away) = (elk.folder().join("home"), elk.folder().join("away"));
    std::fs::create_dir_all(home.join("worlds")).unwrap();
    std::fs::create_dir(&away).unwrap();
    let world = home.join("worlds/car.obj");
    std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("mission-files/worlds/car.obj"), &world).unwrap();
    std::fs::write(home.join("twice.xml"), MISSION).unwrap();
    let sets = ["--auto", "--set", "Sensor.Seed=7", "--set", "Sensor.NoiseSigma=0.01", "--set"];
    let first = launched(&elk, &home, "a", &[&["twice.xml"][..], &sets, &["Explorer.type=ClosestFrontier"]].concat());

    let run: Json = serde_json::from_str(&std::fs::read_to_string(first.join("run.json")).unwrap()).unwrap();
    assert_eq!((&run["seed"], &run["files"][0]["param"]), (&Json::from(7), &Json::from("World")));
    assert!(run["revision"].as_str().is_some_and(|revision| !revision.is_empty()), "{run:#}");
    assert_eq!(run["files"][0]["checksum"].as_str().unwrap().len(), 16);
    let effective = std::fs::read_to_string(first.join(run["effective_mission"].as_str().unwrap())).unwrap();
    for part in ["type=\"ClosestFrontier\"", "<Seed>7</Seed>", "<NoiseSigma>0.01</NoiseSigma>", "type=\"auto\""] {
        assert!(effective.contains(part), "{part} in {effective}");
    }
    let log = Index::read(&first.join("log.mcap"), &mut |_, _| {}).unwrap();
    assert_eq!(log.metadata.effective_mission, effective);
    assert_eq!(serde_json::from_str::<Json>(&log.metadata.run).unwrap(), run);

    let second = launched(&elk, &away, "b", &[&first.display().to_string()]);
    let third = launched(&elk, Path::new("/"), &away.join("c").display().to_string(), &[&second.display().to_string()]);
    for again in [&second, &third] {
        assert_eq!(std::fs::read(first.join("map.bt")).unwrap(), std::fs::read(again.join("map.bt")).unwrap());
        assert!(again.file_name().unwrap().to_str().unwrap().starts_with("twice-2"), "{}", again.display());
        for kept in ["twice.xml", "twice.effective.xml"] {
            assert_eq!(std::fs::read(first.join(kept)).unwrap(), std::fs::read(again.join(kept)).unwrap(), "{kept}");
        }
        let diff = ["log", "diff", &first.display().to_string(), &again.display().to_string(), "--keys=SCAN*"];
        let keys = ["--keys=POSE_COMMAND", "--keys=MAP_UPDATE", "--keys=PLAN", "--keys=MOTION_REPORT"];
        let out = elk.command(&[&diff[..], &keys].concat()).output().unwrap();
        assert!(out.status.success(), "{}", said(&out));
    }

    // Another world makes another run.
    std::fs::write(&world, std::fs::read_to_string(&world).unwrap() + "# new paint\n").unwrap();
    let out = elk.command(&["check", &first.display().to_string()]).output().unwrap();
    let words = said(&out);
    assert!(!out.status.success() && words.contains("car.obj is not what it was when this run was made"), "{words}");
    let anew = format!("Sensor.World={}", world.display());
    let out = elk.command(&["check", &first.display().to_string(), "--set", &anew]).output().unwrap();
    assert!(out.status.success(), "{}", said(&out));
    let out = elk.command(&["launch", &away.display().to_string()]).output().unwrap();
    assert!(said(&out).contains("run.json is no run's folder"), "{}", said(&out));
}
