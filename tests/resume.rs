//! A mission that begins with a saved map goes on where another one stopped.

mod common;

use std::path::{Path, PathBuf};

use common::{Elk, summary_of};
use elk_geometry::Voxel;
use elk_map::octomap::ot::write_ot;
use elk_map::octree::Node;
use elk_map::{MapConfig, OccupancyMap, Saved};
use serde_json::Value;

/// Two rooms with a doorway, 32 scans from nothing.
fn mission() -> String {
    format!(
        "<Scenario name=\"Rooms\"><Sensor type=\"Simulator\"><World>{}/tests/cases/obj/rooms-quads.obj</World>\
         <Start>1.0; 1.5; 1.0</Start></Sensor><Map type=\"OctoMap\"/><Explorer type=\"Potential\"/>\
         <Controller type=\"MOOSSim\"/></Scenario>",
        env!("CARGO_MANIFEST_DIR")
    )
}

/// A run: its exit code, what it said, its folder and its summary.
struct Run {
    code: Option<i32>,
    said: String,
    folder: PathBuf,
    summary: Value,
}

impl Run {
    /// Runs the mission in a folder of its own, `Map.From` and its like set.
    fn of(elk: &Elk, name: &str, sets: &[&str]) -> Self {
        Self::with(
            elk,
            name,
            &[&["--in-process"][..], &sets.iter().flat_map(|set| ["--set", set]).collect::<Vec<_>>()].concat(),
        )
    }

    fn with(elk: &Elk, name: &str, arguments: &[&str]) -> Self {
        let file = elk.folder().join("rooms.xml");
        std::fs::write(&file, mission()).unwrap();
        let launch = ["launch", "rooms.xml", "--headless", "--community", elk.community(), "--log-dir", name];
        let out = elk.command(&[&launch[..], arguments].concat()).output().unwrap();
        let said = [out.stdout, out.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        let folder = elk.run_in(name);
        Self { code: out.status.code(), said, summary: summary_of(&folder), folder }
    }

    fn count(&self, key: &str) -> u64 {
        self.summary[key].as_u64().unwrap()
    }

    fn assert_complete(&self) {
        assert_eq!((self.code, self.count("contacts")), (Some(0), 0), "{}", self.said);
    }
}

/// A run that stops in mid-exploration, and its map in the file of this name.
fn half(elk: &Elk, file: &str) -> Run {
    let run = Run::of(elk, &format!("half-{file}"), &["Explorer.MaxScans=12", &format!("Map.File={file}")]);
    assert_eq!(run.code, Some(1), "{}", run.said);
    assert!(run.summary["reason"].as_str().unwrap().contains("MaxScans"), "{}", run.said);
    run
}

fn saved(file: &Path) -> OccupancyMap {
    let bytes = std::fs::read(file).unwrap();
    OccupancyMap::from_saved(MapConfig::default(), &Saved::read(&bytes).unwrap()).unwrap()
}

#[test]
fn exploration_goes_on_where_another_run_stopped() {
    let elk = Elk::new("resume");
    let whole = Run::of(&elk, "whole", &[]);
    whole.assert_complete();
    for file in ["half.elkmap", "half.ot", "half.bt"] {
        let first = half(&elk, file);
        let from = format!("Map.From={file}");
        let runs = ["once", "again"].map(|time| Run::of(&elk, &format!("{time}-{file}"), &[&from]));
        for run in &runs {
            run.assert_complete();
            assert!(run.count("scans") < whole.count("scans"), "{file}: {} scans", run.count("scans"));
            // What was known before, and the rest.
            assert!(run.count("free_voxels") > first.count("free_voxels"), "{file}: {}", run.said);
            let near = run.count("free_voxels").abs_diff(whole.count("free_voxels"));
            assert!(near < whole.count("free_voxels") / 100, "{file}: {}", run.said);
        }
        let maps = runs.map(|run| std::fs::read(run.folder.join("map.bt")).unwrap());
        assert!(maps[0] == maps[1], "{file}: another way was gone");
    }
}

#[test]
fn of_a_finished_map_nothing_is_left_to_explore() {
    let elk = Elk::new("finished");
    Run::of(&elk, "whole", &["Map.File=whole.elkmap"]).assert_complete();
    let again = Run::of(&elk, "again", &["Map.From=whole.elkmap", "Map.File=whole.elkmap"]);
    again.assert_complete();
    assert_eq!(again.count("scans"), 1, "{}", again.said);
    assert_eq!(saved(&elk.folder().join("whole.elkmap")).grid().free() as u64, again.count("free_voxels"));
}

/// In seven processes, and then from its log.
#[test]
fn a_run_that_began_with_a_map_is_had_again_and_replayed_bit_for_bit() {
    let elk = Elk::new("resumed-again");
    half(&elk, "half.elkmap");
    let run = Run::with(&elk, "old", &["--set", "Map.From=half.elkmap"]);
    run.assert_complete();
    let old = run.folder.display().to_string();
    let json: Value = serde_json::from_str(&std::fs::read_to_string(run.folder.join("run.json")).unwrap()).unwrap();
    let files = json["files"].as_array().unwrap();
    let map = files.iter().find(|file| file["param"] == "From").unwrap();
    assert!(map["app"] == "Map" && map["file"].as_str().unwrap().ends_with("/half.elkmap"), "{json:#}");

    let told = |arguments: &[&str]| {
        let out = elk.command(arguments).output().unwrap();
        let said = [out.stdout, out.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        (out.status.success(), said)
    };
    let again = ["launch", &old, "--headless", "--community", elk.community(), "--log-dir", "again"];
    let replay =
        ["replay", &old, "--rate", "max", "--keys", "SCAN*", "--into", &old, "--only", "Map", "--log-dir", "new"];
    for (arguments, folder) in [(&again[..], "again"), (&replay[..], "new")] {
        let (right, said) = told(arguments);
        assert!(right, "{said}");
        let new = elk.run_in(folder);
        let keys = ["--keys", "MAP_UPDATE", "--keys", "MAP_KNOWN"];
        let (same, said) = told(&[&["log", "diff", &old, &new.display().to_string()], &keys[..]].concat());
        assert!(same, "{folder}: {said}");
        let maps = [&run.folder, &new].map(|folder| std::fs::read(folder.join("map.bt")).unwrap());
        assert!(maps[0] == maps[1], "{folder}");
    }

    // Another map makes another run.
    half(&elk, "other.elkmap");
    let longer = Run::of(&elk, "longer", &["Explorer.MaxScans=14", "Map.File=half.elkmap"]);
    assert_eq!(longer.code, Some(1));
    let (right, said) = told(&["check", &old]);
    assert!(!right && said.contains("half.elkmap is not what it was when this run was made"), "{said}");
}

#[test]
fn a_map_that_does_not_fit_is_refused_before_anything_starts() {
    let elk = Elk::new("misfit");
    half(&elk, "half.elkmap");
    let good = std::fs::read(elk.folder().join("half.elkmap")).unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(elk.folder().join(name), bytes).unwrap();
    write("cut.elkmap", &good[..good.len() - 9]);
    write("newer.elkmap", &[&good[..8], &2u32.to_le_bytes(), &good[12..]].concat());
    write("world.obj", b"v 0 0 0\n");
    let cases: [(&[&str], &str); 6] = [
        (&["Map.From=nowhere.elkmap"], "there is no file"),
        (&["Map.From=world.obj"], "it is no map: it begins neither as an .elkmap"),
        (&["Map.From=cut.elkmap"], "its checksum is"),
        (&["Map.From=newer.elkmap"], "of version 2, and version 1 is what can be read"),
        (&["Map.From=half.elkmap", "Map.Res=0.2", "Explorer.Res=0.2"], "right is Res 0.1 m"),
        (&["Map.From=half.elkmap", "Map.MaxBricks=64"], "64 are the most"),
    ];
    for (sets, words) in cases {
        let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        for command in [&["check", "rooms.xml"][..], &["launch", "rooms.xml", "--community", elk.community()]] {
            let out = elk.command(&[command, &sets].concat()).output().unwrap();
            let said = String::from_utf8_lossy(&out.stderr).into_owned();
            assert!(out.status.code() == Some(1) && said.contains(words), "{sets:?}: {said}");
        }
    }
    assert!(!elk.folder().join("logs").exists());
}

/// A map of one block of occupied voxels, as a file.
fn block(elk: &Elk, name: &str, from: i32, to: i32) {
    let all = (from..to).flat_map(|x| (from..to).flat_map(move |y| (from..to).map(move |z| Voxel::new(x, y, z))));
    let mut bytes = Vec::new();
    write_ot(&mut bytes, &Node::from_voxels(all.map(|voxel| (voxel, 3.5f32))), 0.1).unwrap();
    std::fs::write(elk.folder().join(name), bytes).unwrap();
}

#[test]
fn a_start_in_what_the_saved_map_calls_occupied_is_said_to_be_one() {
    let elk = Elk::new("walled-in");
    // The start is at (10; 15; 10) of its voxels.
    block(&elk, "around.ot", 8, 18);
    let run = Run::of(&elk, "run", &["Map.From=around.ot"]);
    let reason = run.summary["reason"].as_str().unwrap();
    assert!(run.code == Some(1) && reason.contains("stands in what the map calls occupied"), "{reason}");
    assert!(reason.contains("Map.From") && run.count("contacts") == 0, "{reason}");
}

#[test]
fn a_start_of_which_the_saved_map_knows_nothing_is_explored_from() {
    let elk = Elk::new("elsewhere");
    block(&elk, "far.ot", -40, -30);
    let run = Run::of(&elk, "run", &["Map.From=far.ot"]);
    run.assert_complete();
    assert!(run.count("free_voxels") > 20_000 && run.count("occupied_voxels") > 1000, "{}", run.said);
}
