//! "Complete" means complete: whole missions in which nothing was seen, or in which the map could not grow, say so.

mod common;

use std::path::{Path, PathBuf};

use common::{Elk, summary_of};
use elk_log::LogReader;
use elk_spatial::Scan;
use serde_json::Value;

/// A run: its exit code, what it said, its folder and its summary.
struct Run {
    code: Option<i32>,
    said: String,
    /// The last line of its standard output.
    last: String,
    folder: PathBuf,
    summary: Value,
}

/// A world of the tests.
fn world(name: &str) -> String {
    format!("{}/tests/cases/obj/{name}.obj", env!("CARGO_MANIFEST_DIR"))
}

/// A mission in a world; `sensor` and `more` are what else is to be said of its sensor, and what other apps there are.
fn mission(name: &str, sensor: &str, more: &str) -> String {
    format!(
        "<Scenario name=\"Case\"><Sensor type=\"Simulator\"><World>{}</World>{sensor}</Sensor>\
         <Map type=\"OctoMap\"/><Explorer type=\"Potential\"/><Controller type=\"MOOSSim\"/>{more}</Scenario>",
        world(name)
    )
}

const START: &str = "<Start>1.0; 1.5; 1.0</Start>";
const UP: &str = "<StartPitch>90 deg</StartPitch>";

/// Runs a mission to its end, as processes or in one, as `arguments` say.
fn run(elk: &Elk, mission: &str, arguments: &[&str]) -> Run {
    let file = elk.folder().join("case.xml");
    std::fs::write(&file, mission).unwrap();
    let file = file.display().to_string();
    let all = [&["launch", &file, "--headless", "--community", elk.community()], arguments].concat();
    let out = elk.command(&all).output().unwrap();
    let [told, apart] = [out.stdout, out.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    let last = told.lines().last().unwrap_or_default().to_owned();
    let said = told + &apart;
    let folder = elk.run();
    Run { code: out.status.code(), said, last, summary: summary_of(&folder), folder }
}

/// What is set in a run within one process.
fn alone<'a>(sets: &[&'a str]) -> Vec<&'a str> {
    std::iter::once("--in-process").chain(sets.iter().flat_map(|set| ["--set", set])).collect()
}

impl Run {
    fn reason(&self) -> &str {
        self.summary["reason"].as_str().unwrap()
    }

    fn count(&self, key: &str) -> u64 {
        self.summary[key].as_u64().unwrap()
    }

    /// It failed, and every place that says how it ended says why: `words` are part of it.
    fn assert_failed(&self, words: &[&str]) {
        assert_eq!((self.code, &self.summary["complete"]), (Some(1), &Value::Bool(false)), "{}", self.said);
        for word in words {
            assert!(self.reason().contains(word), "{word}: {}", self.reason());
        }
        assert_eq!(self.last, format!("NOT complete: {}", self.reason()), "{}", self.said);
    }

    fn assert_complete(&self) {
        assert_eq!((self.code, &self.summary["complete"]), (Some(0), &Value::Bool(true)), "{}", self.said);
    }
}

/// The base of the cases, and case 1, in which its wall with the doorway is one concave polygon: the same rooms, explored in
/// the same way. How many of their 23,100 free voxels are free for the map is a matter of rays that graze.
#[test]
fn two_rooms_are_explored_to_the_last_voxel() {
    let counts = ["rooms-quads", "rooms-ngon"].map(|world| {
        let run = run(&Elk::new(world), &mission(world, START, ""), &alone(&[]));
        run.assert_complete();
        ["scans", "free_voxels", "occupied_voxels"].map(|key| run.count(key))
    });
    let [[scans, free, occupied], of_the_polygon] = counts;
    assert_eq!([scans, free, occupied], of_the_polygon);
    assert!((20..40).contains(&scans) && free.abs_diff(23_100) < 10 && occupied.abs_diff(5_940) < 30, "{counts:?}");
}

/// Regression: "complete", with 0 voxels known.
#[test]
fn a_filter_that_lets_nothing_through_is_named() {
    let filter = "<Filter type=\"Distance\"><Threshold>0.3 m</Threshold></Filter>";
    let mission = mission("rooms-quads", START, "").replace("<Map", &format!("{filter}<Map"));
    for arguments in [&[][..], &["--in-process"]] {
        let run = run(&Elk::new("nothing-through"), &mission, arguments);
        run.assert_failed(&["of 10000 points that the sensor measured none came through", "Distance, Threshold 0.3"]);
        assert_eq!((run.count("known_voxels"), &run.summary["accuracy"]), (0, &Value::Null));
        assert!(!run.said.contains("picture"), "there is nothing to be drawn: {}", run.said);
    }
}

/// Regression: "all of it is in" the run's folder, said the launcher, and the log was not.
#[test]
fn a_log_that_is_not_in_the_run_s_folder_is_said_to_be_elsewhere() {
    let elk = Elk::new("log-elsewhere");
    let log = elk.folder().join("mine.mcap");
    let logger = format!("<Logger type=\"Mcap\"><File>{}</File></Logger>", log.display());
    let run = run(&elk, &mission("rooms-quads", START, &logger), &alone(&[]));
    run.assert_complete();
    let place = format!("all of it is in {}, but {} (Logger.File)", run.folder.display(), log.display());
    assert!(run.said.contains(&place) && log.is_file(), "{}", run.said);
    assert!(run.said.contains("no picture: it is drawn of a log in the run's folder"), "{}", run.said);
}

/// Regression: "complete", and the volume was never seen.
#[test]
fn a_volume_of_which_nothing_is_seen_is_not_explored() {
    let elsewhere = ["Explorer.Mid=100; 0; 0", "Explorer.Dim=4; 4; 4"];
    let run = run(&Elk::new("volume-apart"), &mission("rooms-quads", START, ""), &alone(&elsewhere));
    run.assert_failed(&["Mid 100; 0; 0, Dim 4; 4; 4 m", "Explorer.Mid"]);
}

#[test]
fn a_start_from_which_nothing_is_seen_is_not_the_end_of_the_world() {
    let high = format!("<Start>1.0; 1.5; 1.9</Start>{UP}");
    let blind = run(&Elk::new("into-the-sky"), &mission("noceiling", &high, ""), &alone(&[]));
    blind.assert_failed(&["the sensor saw nothing", "all 10000 rays", "Sensor.Start"]);
    let short = run(&Elk::new("short-sight"), &mission("rooms-quads", START, ""), &alone(&["Sensor.Range=0.2"]));
    short.assert_failed(&["the sensor saw nothing", "Range"]);
}

/// Regression: the mission stood still for 300 s, or for ever.
#[test]
fn a_robot_outside_the_map_is_told_where_the_map_ends() {
    for (world, start) in [("far-4000", "4001; 4001.5; 1"), ("far-500k", "500001; 500001.5; 1")] {
        let elk = Elk::new(world);
        // Before anything starts.
        let said = elk.launch_and_fail(&mission(world, &format!("<Start>{start}</Start>"), ""));
        assert!(said.contains("65,536 voxels") && said.contains("the robot would be beyond it"), "{said}");
        assert!(!elk.folder().join("logs").exists(), "{said}");
    }
}

/// Regression: thousands of scans of a frontier behind which there is no map.
#[test]
fn where_the_map_ends_there_is_nothing_to_look_for() {
    let start = "<Start>3275.3; 3275.5; 1.0</Start>";
    let run = run(&Elk::new("map-edge"), &mission("far-edge", start, ""), &alone(&[]));
    run.assert_failed(&["where the map ends", "3276.8 m", "coarser Res"]);
    let left = &run.summary["frontiers_left"];
    assert!(left["map_edge"].as_u64().unwrap() > 100, "{left}");
    let others = ["unreachable", "invisible", "unresolved", "open"].map(|cause| left[cause].as_u64().unwrap());
    assert!(others.iter().sum::<u64>() < 20, "{left}");
    assert!(run.count("scans") < 100, "{}", run.said);
}

/// The same kind: a map that has no room for the world.
#[test]
fn where_the_map_is_full_there_is_nothing_to_look_for() {
    let run = run(&Elk::new("map-full"), &mission("rooms-quads", START, ""), &alone(&["Map.MaxBricks=64"]));
    run.assert_failed(&["where the map is full", "Map.MaxBricks"]);
    let left = &run.summary["frontiers_left"];
    assert!(left["no_room"].as_u64().unwrap() > 100, "{left}");
    assert!(run.count("scans") < 400, "{}", run.said);
}

#[test]
fn what_lies_behind_gaps_too_narrow_is_counted_as_such() {
    let run = run(&Elk::new("fence"), &mission("fence", START, ""), &alone(&[]));
    run.assert_complete();
    let left = &run.summary["frontiers_left"];
    assert!(left["unreachable"].as_u64().unwrap() + left["invisible"].as_u64().unwrap() > 0, "{left}");
}

/// The scans of a run's log under a variable.
fn scans(folder: &Path, variable: &str) -> Vec<Scan<'static>> {
    let mut log = LogReader::open(&folder.join("log.mcap")).unwrap();
    let records: Vec<_> = log.by_ref().map(Result::unwrap).filter(|record| record.key == variable).collect();
    let key = elk_bus::Key::<Scan<'static>>::named(variable);
    records.iter().map(|record| record.value.as_ref().decode(&key).unwrap().into_owned()).collect()
}

/// A shaft 50 m high, with a lid and without: to a map that believes no ray beyond 5 m it is the same, if it believes that
/// there is nothing where nothing is seen.
#[test]
fn a_ray_without_a_return_frees_as_far_as_one_that_is_too_long() {
    let filter = "<Filter type=\"VoxelGrid\"/>";
    let known = |elk: &Elk, name: &str, free: &str| {
        let start = format!("<Start>2.0; 1.5; 1.0</Start>{UP}");
        let mission = mission(name, &start, "").replace("<Map", &format!("{filter}<Map"));
        let sets = alone(&["Map.MaxRange=5", free, "Explorer.MaxScans=1"]);
        run(elk, &mission, &sets)
    };
    let elks = ["lid", "believing", "doubting"].map(Elk::new);
    let lid = known(&elks[0], "shaft-lid", "Map.FreeNoReturn=0");
    let believing = known(&elks[1], "shaft-open", "Map.FreeNoReturn=5");
    let doubting = known(&elks[2], "shaft-open", "Map.FreeNoReturn=0");
    assert_eq!(believing.count("free_voxels"), lid.count("free_voxels"));
    assert!(doubting.count("free_voxels") < lid.count("free_voxels"), "{}", doubting.said);
    let (taken, passed_on) = (scans(&believing.folder, "SCAN"), scans(&believing.folder, "SCAN_1"));
    assert!(!taken[0].no_return.is_empty() && passed_on[0].points.len() < taken[0].points.len());
    assert_eq!(taken[0].points.len() + taken[0].no_return.len(), 10_000, "each ray has seen something, or nothing");
    assert_eq!((&passed_on[0].no_return, passed_on[0].measured), (&taken[0].no_return, taken[0].measured));
    assert!(scans(&lid.folder, "SCAN")[0].no_return.is_empty());
}

/// A room without a ceiling, with and without the volume limited to it.
#[test]
fn an_open_world_whose_sky_is_free_is_explored_to_an_end() {
    let coarse = ["Map.FreeNoReturn=2", "Map.Res=0.2", "Sensor.Width=40", "Sensor.Height=40", "Explorer.Radius=0.2"];
    let room = ["Explorer.Mid=2; 1.5; 1", "Explorer.Dim=4; 3; 2"];
    let mission = mission("noceiling", START, "");
    run(&Elk::new("under-the-sky"), &mission, &alone(&coarse))
        .assert_failed(&["motions were refused by the sensor (Patience)", "Explorer.Mid, Dim"]);
    let limited = run(&Elk::new("up-to-the-sky"), &mission, &alone(&[&coarse[..], &room].concat()));
    limited.assert_complete();
    assert!(limited.summary["frontiers_left"]["volume_edge"].as_u64().is_some());
}

/// Regression: each voxel below an open sky was looked at for itself, from four places, 3000 scans and no end.
#[test]
fn an_open_sky_of_which_nothing_is_believed_is_looked_at_to_an_end() {
    let coarse = ["Map.Res=0.2", "Sensor.Width=40", "Sensor.Height=40", "Explorer.Radius=0.2"];
    let run = run(&Elk::new("sky"), &mission("noceiling", START, ""), &alone(&coarse));
    run.assert_failed(&["the sensor sees nothing", "Explorer.Mid, Dim", "Map.FreeNoReturn"]);
    let left = &run.summary["frontiers_left"];
    assert!(left["no_return"].as_u64().unwrap() > 100 && left["open"] == 0, "{left}");
}

#[test]
fn a_map_that_frees_farther_than_it_believes_is_refused_by_check() {
    let elk = Elk::new("free-too-far");
    let file = elk.folder().join("case.xml");
    std::fs::write(&file, mission("rooms-quads", START, "")).unwrap();
    let file = file.display().to_string();
    let said = |range: &str| {
        let sets = ["check", &file, "--set", "Map.FreeNoReturn=6", "--set", range];
        let out = elk.command(&sets).output().unwrap();
        (out.status.success(), String::from_utf8(out.stderr).unwrap())
    };
    let (right, refusal) = said("Map.MaxRange=5");
    assert!(!right && refusal.contains("FreeNoReturn 6 m is farther than MaxRange, 5 m"), "{refusal}");
    assert!(said("Map.MaxRange=6").0 && said("Map.MaxRange=0").0);
}
