//! What is occupied with little confidence is looked at again once no frontier is left, and each such voxel is sure in the end or
//! accounted for (thesis 7.2, 1).

mod common;

use std::path::Path;

use common::Elk;
use common::small::small;
use elk_geometry::{Bounds, Voxel, VoxelSet};
use elk_log::LogReader;
use elk_spatial::keys::{MAP_UNSURE, POSE_COMMAND};
use elk_spatial::messages::PoseCommand;
use nalgebra::{Point3, Vector3};
use serde_json::Value;

/// σ = 1 px on the matched position.
const NOISE: [&str; 4] = ["--set", "Sensor.NoiseSigma=1", "--set", "Sensor.NoisePixel=stereo"];

/// Runs the small mission to its end, into this folder; its summary.
fn run(elk: &Elk, folder: &str, arguments: &[&str]) -> Value {
    let file = elk.folder().join("small.xml");
    std::fs::write(&file, small("auto", "")).unwrap();
    let file = file.display().to_string();
    let fixed = ["launch", &file, "--headless", "--in-process", "--community", elk.community(), "--log-dir", folder];
    let out = elk.command(&[&fixed[..], arguments].concat()).output().unwrap();
    assert!(out.status.success(), "{arguments:?}:\n{}", String::from_utf8_lossy(&out.stdout));
    common::summary_of(&elk.run_in(folder))
}

/// What is unsure in the end, as the map said last, in the volume that the mission explores.
fn unsure(run: &Path) -> u64 {
    let mut log = LogReader::open(&run.join("log.mcap")).unwrap();
    let last = log.by_ref().map(Result::unwrap).filter(|record| record.key == MAP_UNSURE.name()).last();
    let last = last.expect("the map says what is unsure").value.as_ref().decode(&MAP_UNSURE).unwrap();
    let mut voxels = VoxelSet::new();
    last.bricks.iter().for_each(|brick| voxels.unite(brick.position(), brick.unpack().occupied()));
    let volume = Bounds::from_mid_dim(Point3::new(0.0, 0.0, 0.5), Vector3::repeat(3.0));
    voxels.iter().filter(|voxel: &Voxel| volume.contains(voxel.center(last.resolution))).count() as u64
}

fn commands(run: &Path) -> Vec<PoseCommand> {
    let mut log = LogReader::open(&run.join("log.mcap")).unwrap();
    let records = log.by_ref().map(Result::unwrap).filter(|record| record.key == POSE_COMMAND.name());
    records.map(|record| record.value.as_ref().decode(&POSE_COMMAND).unwrap()).collect()
}

#[test]
fn each_unsure_voxel_is_sure_in_the_end_or_accounted_for() {
    let elk = Elk::new("inspection");
    for (folder, noise) in [("exact", &[][..]), ("noisy", &NOISE)] {
        let summary = run(&elk, folder, &[&["--set", "Explorer.Confidence=0.9"], noise].concat());
        let count =
            |name: &str| summary["counters"][name].as_u64().unwrap_or_else(|| panic!("{folder}, {name}: {summary:#}"));
        assert_eq!(summary["complete"], true, "{folder}: {summary:#}");
        let said = summary["reason"].as_str().unwrap();
        assert!(said.contains("; inspected is what was occupied with less than 0.9 (Confidence)"), "{folder}: {said}");
        let given_up = count("unsure, inspected in vain") + count("unsure, invisible");
        assert_eq!(count("unsure, open"), 0, "{folder}: {summary:#}");
        assert_eq!(given_up + count("unsure since inspection"), unsure(&elk.run_in(folder)), "{folder}: {summary:#}");
        let before = count("unsure before inspection");
        assert!(before > 0 && count("places of inspection") > 0 && 2 * given_up < before, "{folder}: {summary:#}");
    }
}

/// The phase comes after all else: until it begins the robot goes the way that it goes without it, scan for scan, and that way ends there.
#[test]
fn until_the_frontier_is_resolved_nothing_is_other_than_without_inspection() {
    let elk = Elk::new("inspection-off");
    let [without, with] = [("off", "0"), ("on", "0.9")].map(|(folder, confidence)| {
        let summary = run(&elk, folder, &["--set", &format!("Explorer.Confidence={confidence}")]);
        (summary, commands(&elk.run_in(folder)))
    });
    assert!(
        with.1.len() > without.1.len() && with.1.starts_with(&without.1),
        "{} of {}",
        without.1.len(),
        with.1.len()
    );
    assert_eq!(without.0["counters"].as_object().map(|counters| counters.len()), Some(0), "{:#}", without.0);
    assert!(!without.0["reason"].as_str().unwrap().contains("Confidence"), "{:#}", without.0);
}
