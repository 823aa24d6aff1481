//! The slice of the apartment that a planar laser sees: explored on wheels, the same every time, whoever is swapped, and had again from
//! its scans.

mod common;

use std::path::Path;

use common::{Elk, said, summary_of};
use elk_geometry::{State, Voxel};
use elk_map::{MapConfig, OccupancyMap, Saved};
use elk_spatial::keys::{POSE_ESTIMATE, SCAN};

const MISSION: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/mission-files/laser-apartment.xml");

fn map(run: &Path) -> Vec<u8> {
    std::fs::read(run.join("map.bt")).unwrap()
}

/// Runs the mission in one process, with its run in a folder of that name.
fn launch(elk: &Elk, folder: &str, more: &[&str]) -> (String, serde_json::Value) {
    let all = ["launch", MISSION, "--headless", "--in-process", "--community", elk.community(), "--log-dir", folder];
    let out = elk.command(&[&all[..], more].concat()).output().unwrap();
    (said(&out), summary_of(&elk.run_in(folder)))
}

#[test]
fn a_robot_with_wheels_and_a_laser_explores_its_slice_of_the_apartment() {
    let elk = Elk::new("laser");
    let (said, summary) = launch(&elk, "a", &[]);
    assert_eq!((&summary["complete"], &summary["contacts"]), (&true.into(), &0.into()), "{said}");
    assert!(summary["reason"].as_str().unwrap().contains("explored was the slice of the map at z = 0.25 m"), "{said}");
    assert!(summary["accuracy"].as_f64().unwrap() > 0.97, "{said}");
    let run = elk.run_in("a");
    let saved = map(&run);
    let saved = Saved::read(&saved).unwrap();
    let map = OccupancyMap::from_saved(MapConfig { resolution: 0.1, ..MapConfig::default() }, &saved).unwrap();
    let mut known = map.grid().bricks().voxels().filter(|(_, state)| *state != State::Unknown);
    assert!(known.all(|(voxel, _)| voxel.z == 2), "all beams are in one layer of voxels");
    // Two rooms, seen through the door; what is free there lies within the walls.
    assert!(map.grid().free() > 2500, "{}", map.grid().free());
    let beyond = [Voxel::new(-2, 40, 2), Voxel::new(62, 40, 2)].map(|voxel| map.grid().state(voxel));
    assert_eq!(beyond, [State::Unknown; 2]);

    let mut log = elk_log::LogReader::open(&run).unwrap();
    let scan = log.by_ref().map(Result::unwrap).find(|record| record.key == SCAN.name()).unwrap();
    let scan = scan.value.as_ref().decode(&SCAN).unwrap();
    assert!(scan.camera.is_fan() && scan.camera.columns == 540 && scan.camera.range_m == 10.0, "{:?}", scan.camera);
    assert_eq!(scan.points.len() + scan.no_return.len(), 540);
}

/// In one process as in six, all of which are swapped on the way, and once more from the scans alone.
#[test]
fn its_map_is_the_same_whoever_is_swapped_and_when_it_is_replayed() {
    let elk = Elk::new("laser-swapped");
    launch(&elk, "a", &[]);
    let (_, other) = launch(&elk, "b", &["--set", "Sensor.Seed=2"]);
    assert_eq!(other["complete"], true, "{other:#}");
    let maps = ["a", "b"].map(|folder| map(&elk.run_in(folder)));
    assert!(maps[0] != maps[1], "another seed is other noise");

    let text = std::fs::read_to_string(MISSION).unwrap().replace("worlds/apartment.obj", "apartment");
    let mut launcher = elk.launch_with(&text.replace("type=\"auto\"", "type=\"manual\""), &["--log-dir", "c"]);
    launcher.wait_for("Enter takes a step");
    for app in ["Sensor", "Map", "Explorer", "Controller", "Sensor"] {
        elk.obeyed(&["step"]);
        let said = elk.obeyed(&["swap", app]);
        assert!(said.contains(&format!("{app} is swapped, in ")), "{said}");
    }
    elk.obeyed(&["resume"]);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(maps[0] == map(&elk.run_in("c")), "who is swapped goes on where the other one stopped");

    let old = elk.run_in("a").display().to_string();
    let replay = ["replay", &old, "--rate", "max", "--keys", "SCAN*", "--only", "Map,Explorer", "--into", &old];
    let out = elk.command(&[&replay[..], &["--log-dir", "d"]].concat()).output().unwrap();
    assert!(out.status.success(), "{}", common::said(&out));
    assert!(maps[0] == map(&elk.run_in("d")), "the map of the same scans is another one");
}

/// Nobody tells the robot where it is: its scans are matched.
#[test]
fn the_slice_is_explored_by_a_laser_that_says_where_it_is_as_well() {
    let elk = Elk::new("laser-matched");
    let (said, summary) = launch(&elk, "a", &["--set", "Sensor.PoseEstimator=ICP"]);
    assert_eq!((&summary["complete"], &summary["contacts"]), (&true.into(), &0.into()), "{said}");
    let mut log = elk_log::LogReader::open(&elk.run_in("a")).unwrap();
    let estimates = log.by_ref().map(Result::unwrap).filter(|record| record.key == POSE_ESTIMATE.name());
    let off: Vec<f64> = estimates
        .map(|record| record.value.as_ref().decode(&POSE_ESTIMATE).unwrap())
        .map(|estimate| (estimate.pose.unwrap().position() - estimate.recorded.unwrap().position()).norm())
        .collect();
    let worst = off.iter().copied().fold(0.0, f64::max);
    println!("{} scans, off by at most {worst:.4} m", off.len());
    assert_eq!(summary["scans"], off.len());
    // Nothing recognises a place: it drifts, as any odometry does.
    assert!(worst > 1e-6 && worst < 0.1, "{worst} m");
}

#[test]
fn what_a_plane_cannot_show_is_said_before_anything_starts() {
    let elk = Elk::new("laser-checked");
    let check = |sets: &[&str]| {
        let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        let out = elk.command(&[&["check", MISSION][..], &sets].concat()).output().unwrap();
        (out.status.success(), said(&out))
    };
    let (right, words) = check(&[]);
    assert!(right && !words.contains("sees its own plane"), "{words}");
    let flying = ["Explorer.Planar=false", "Controller.VerticalSpeed=0.5"];
    let (right, words) = check(&flying);
    assert!(
        right && words.contains("the laser sees its own plane alone, and Explorer sends the robot up and down"),
        "{words}"
    );
    let (right, words) = check(&[&flying[..], &["Sensor.PoseEstimator=ICP"]].concat());
    assert!(
        !right && words.contains("which no scan shows (PoseEstimator ICP); right is Explorer.Planar true"),
        "{words}"
    );
    let (right, words) = check(&["Sensor.StartPitch=5", "Sensor.PoseEstimator=ICP"]);
    assert!(!right && words.contains("StartPitch tilts the laser"), "{words}");
    let (right, words) = check(&["Sensor.Start=2.2; 3.2; 0.3"]);
    assert!(
        right
            && words.contains("on the border of two layers of voxels of 0.1 m; right is the middle of one, as 0.250 m"),
        "{words}"
    );
}
