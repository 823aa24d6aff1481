//! The apartment as two cameras see it whose images are matched: explored, the same every time, and had again from its scans.

mod common;

use std::path::Path;

use common::{Elk, said};
use elk_map::{MapConfig, OccupancyMap, Saved};
use elk_sensor::Pose;
use elk_spatial::keys::{POSE_ESTIMATE, SCAN};
use elk_spatial::pixels::PixelTally;
use elk_world::surface::{SurfaceScore, surface_score};
use elk_world::{Placement, World};

const MISSION: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/mission-files/stereo-apartment.xml");

/// What of the apartment's surfaces is in the map of a run, to one voxel.
fn score(run: &Path) -> SurfaceScore {
    let bytes = std::fs::read(run.join("map.bt")).unwrap();
    let saved = Saved::read(&bytes).unwrap();
    let map = OccupancyMap::from_saved(MapConfig { resolution: 0.1, ..MapConfig::default() }, &saved).unwrap();
    surface_score(&World::load("apartment", &Placement::default()).unwrap(), map.grid(), 0.1)
}

/// The whole mission takes 291 scans, a minute as tests are built: its first 80 have to do here, with which a run fails as such.
#[test]
fn an_apartment_is_explored_by_two_cameras_whose_images_are_matched() {
    let elk = Elk::new("stereo-apartment");
    let all = ["launch", MISSION, "--headless", "--in-process", "--community", elk.community()];
    let out = elk.command(&[&all[..], &["--set", "Explorer.MaxScans=80"]].concat()).output().unwrap();
    let summary = elk.summary();
    assert_eq!(summary["contacts"], 0, "{}\n{summary:#}", said(&out));
    let score = score(&elk.run());
    assert!(score.recall > 0.5 && score.precision > 0.9, "{score:?}");
}

/// The same seed, the same map, byte for byte, in one process as in seven, and once more from the scans alone.
#[test]
fn what_is_matched_is_the_same_every_time_and_when_it_is_replayed() {
    let elk = Elk::new("stereo-again");
    // Capped at 12 scans, a run fails as such; what it has seen until then counts here.
    let short = ["launch", MISSION, "--headless", "--community", elk.community(), "--set", "Explorer.MaxScans=12"];
    let map = |folder: &str| std::fs::read(elk.run_in(folder).join("map.bt")).unwrap();
    for more in [&["--log-dir", "a"][..], &["--log-dir", "b", "--in-process"]] {
        elk.command(&[&short[..], more].concat()).output().unwrap();
    }
    assert!(map("a") == map("b"), "two runs of one seed have different maps");
    elk.command(&[&short[..], &["--log-dir", "c", "--in-process", "--set", "Sensor.Seed=2"]].concat())
        .output()
        .unwrap();
    assert!(map("a") != map("c"), "another seed is other noise");

    let old = elk.run_in("a").display().to_string();
    let mut log = elk_log::LogReader::open(Path::new(&old)).unwrap();
    let scans: Vec<_> = log.by_ref().map(Result::unwrap).filter(|record| record.key == SCAN.name()).collect();
    let first = scans[0].value.as_ref().decode(&SCAN).unwrap();
    let pixels = u64::from(first.camera.columns) * u64::from(first.camera.rows);
    assert!(
        (1..pixels).contains(&(first.points.len() as u64 + first.no_return.len() as u64)),
        "something is not matched"
    );
    // It says of each pixel what became of it, and hands that on; the summary counts them.
    let tally = PixelTally::of(&first.pixel_runs);
    assert_eq!((tally.total(), tally.matched), (pixels, (first.points.len() + first.no_return.len()) as u64));
    assert!(tally.textureless > 0 && tally.out_of_range > 0 && tally.inconsistent > 0, "{tally:?}");
    let mut log = elk_log::LogReader::open(Path::new(&old)).unwrap();
    let filtered = log.by_ref().map(Result::unwrap).find(|record| record.key == "SCAN_1").unwrap();
    assert_eq!(filtered.value.as_ref().decode(&SCAN).unwrap().pixel_runs, first.pixel_runs);
    let counted = &common::summary_of(Path::new(&old))["pixels"];
    let all: u64 = counted.as_object().unwrap().values().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(all, scans.len() as u64 * pixels, "{counted}");
    let replay = ["replay", &old, "--rate", "max", "--keys", "SCAN*", "--only", "Map,Explorer", "--into", &old];
    let out = elk.command(&[&replay[..], &["--log-dir", "d"]].concat()).output().unwrap();
    assert!(out.status.success(), "{}", said(&out));
    assert!(map("a") == map("d"), "the map of the same scans is another one");
}

/// Where the robot took each scan of a run, as it says and truly.
fn poses(run: &Path) -> Vec<(Pose, Pose)> {
    let mut log = elk_log::LogReader::open(run).unwrap();
    let estimates = log.by_ref().map(Result::unwrap).filter(|record| record.key == POSE_ESTIMATE.name());
    let estimates = estimates.map(|record| record.value.as_ref().decode(&POSE_ESTIMATE).unwrap());
    estimates.map(|estimate| (estimate.pose.unwrap(), estimate.recorded.unwrap())).collect()
}

/// Nobody tells the robot where it is. The whole mission takes some minutes as tests are built; its first 30 scans have to do here.
#[test]
fn an_apartment_is_explored_by_two_cameras_that_say_where_they_are_as_well() {
    let elk = Elk::new("stereo-localised");
    let all = ["launch", MISSION, "--headless", "--in-process", "--community", elk.community()];
    let all = [&all[..], &["--set", "Explorer.MaxScans=30", "--set", "Sensor.PoseEstimator=VisualOdometry"]].concat();
    let out = elk.command(&[&all[..], &["--log-dir", "a"]].concat()).output().unwrap();
    let run = elk.run_in("a");
    let summary = common::summary_of(&run);
    assert_eq!((&summary["contacts"], &summary["scans"]), (&0.into(), &30.into()), "{}\n{summary:#}", said(&out));
    let poses = poses(&run);
    assert_eq!(poses.len(), 30);
    let off = poses.iter().map(|(said, truly)| (said.position() - truly.position()).norm()).fold(0.0, f64::max);
    assert!(off > 1e-6 && off < 0.05, "{off} m");
    let score = score(&run);
    assert!(score.recall > 0.3 && score.precision > 0.9, "{score:?}");
    elk.command(&[&all[..], &["--log-dir", "b"]].concat()).output().unwrap();
    let map = |folder: &str| std::fs::read(elk.run_in(folder).join("map.bt")).unwrap();
    assert!(map("a") == map("b"), "two runs of one seed have different maps");
    let old = run.display().to_string();
    let replay = ["replay", &old, "--rate", "max", "--keys", "SCAN*", "--only", "Map,Explorer", "--into", &old];
    let out = elk.command(&[&replay[..], &["--log-dir", "c"]].concat()).output().unwrap();
    assert!(out.status.success(), "{}", said(&out));
    assert!(map("a") == map("c"), "the map of the same scans is another one");
}
