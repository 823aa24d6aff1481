//! The table of app types that comes with elk, and the missions that come with it.

use std::path::Path;
use std::process::Command;

fn elk(arguments: &[&str]) -> (bool, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_elk"))
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8(said).unwrap())
}

#[test]
fn every_mission_that_comes_with_elk_is_right_with_all_explorers() {
    let (_, types) = elk(&["types", "Explorer"]);
    let explorers = types.lines().filter_map(|line| line.strip_prefix("<Explorer type=\"")?.split('"').next());
    let explorers: Vec<&str> = explorers.collect();
    assert_eq!(explorers.len(), 7, "{types}");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("mission-files");
    let files = std::fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path());
    let missions: Vec<_> = files.filter(|file| file.extension().is_some_and(|end| end == "xml")).collect();
    assert!(!missions.is_empty());
    for mission in missions {
        if !std::fs::read_to_string(&mission).unwrap().contains("<Explorer") {
            continue;
        }
        for explorer in &explorers {
            let set = format!("Explorer.type={explorer}");
            let (right, said) = elk(&["check", mission.to_str().unwrap(), "--set", &set]);
            assert!(right, "{said}");
            assert!(said.contains(&format!("Explorer {explorer} Explorer")), "{said}");
        }
    }
}

/// Recordings do not come with elk, and nothing else may be wrong with the missions that play them.
#[test]
fn every_mission_without_an_explorer_plays_a_recording_and_lacks_nothing_else() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("mission-files");
    let files = std::fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path());
    let missions = files.filter(|file| file.extension().is_some_and(|end| end == "xml"));
    let text = |file: &Path| std::fs::read_to_string(file).unwrap();
    let recorded: Vec<_> = missions.filter(|file| !text(file).contains("<Explorer")).collect();
    assert!(recorded.len() >= 2, "{recorded:?}");
    for mission in recorded {
        let mut elk = Command::new(env!("CARGO_BIN_EXE_elk"));
        let output = elk.arg("check").arg(&mission).env("ELK_DATA", "/nowhere").output().unwrap();
        let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        assert!(!output.status.success());
        assert!(
            said.starts_with("elk: Sensor: there is no ") && said.contains("ELK_DATA or Sensor.Recording"),
            "{said}"
        );
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}

#[test]
fn a_mission_file_without_an_end_is_refused() {
    let (right, said) = elk(&["check", "/dev/zero"]);
    assert!(!right && said.contains("/dev/zero: it is a device; right is an ordinary file"), "{said}");
}

#[test]
fn every_default_of_the_table_is_right() {
    let (right, said) = elk(&["types"]);
    assert!(right, "{said}");
    let types = said.lines().filter_map(|line| line.strip_prefix('<')?.split_once("\">"));
    let mut checked = 0;
    for (head, _) in types {
        let (element, name) = head.split_once(" type=\"").unwrap();
        // Nobody serves this community, so a type whose defaults are right gets as far as that.
        let (_, said) = elk(&[&element.to_lowercase(), "--type", name, "--community", "nobody-is-here"]);
        let asked = said.contains("needs the parameter") || said.contains("no broker serves");
        assert!(asked, "{element} {name}: {said}");
        checked += 1;
    }
    assert!(checked >= 8, "{checked} types in:\n{said}");
}

#[test]
fn an_element_that_is_unknown_is_answered_with_the_one_that_was_meant() {
    let (right, said) = elk(&["types", "Filtr"]);
    assert!(!right);
    assert_eq!(said, "elk: Filtr is no element of a mission; did you mean Filter?\n");
}

#[test]
fn one_app_by_itself_checks_its_parameters() {
    let (right, said) = elk(&["filter", "--type", "Distance", "Treshold=1"]);
    assert!(!right);
    assert_eq!(said, "elk: Treshold=1: Filter Distance has no parameter Treshold; did you mean Threshold?\n");
}

/// Regression: a radius of very many voxels took all memory when the explorer started.
#[test]
fn a_radius_that_nobody_can_look_after_is_found_before_anything_starts() {
    let mission = "mission-files/apartment.xml";
    let (right, said) = elk(&["check", mission, "--set", "Explorer.Radius=3.3"]);
    assert!(!right && said.contains("Radius 3.3 m are more than 32 voxels of 0.1 m (Res)"), "{said}");
    let (right, said) = elk(&["check", mission, "--set", "Map.Res=0.003"]);
    assert!(!right && said.contains("Radius 0.1 m are more than 32 voxels of 0.003 m (Res)"), "{said}");
    let (right, said) = elk(&["check", mission, "--set", "Explorer.Radius=3.2"]);
    assert!(right, "{said}");
}

#[test]
fn the_bounds_of_the_map_are_shown_and_common_to_map_and_explorer() {
    let (_, map) = elk(&["types", "Map"]);
    assert!(
        map.contains("MaxRange") && map.contains("30") && map.contains("MaxBricks") && map.contains("32768"),
        "{map}"
    );
    let (_, explorer) = elk(&["types", "Explorer"]);
    assert!(explorer.contains("MaxBricks") && explorer.contains("MaxVoxels"), "{explorer}");
    let set = ["--set", "Map.MaxBricks=100", "--set", "Explorer.MaxBricks=200"];
    let (right, said) = elk(&[&["check", "mission-files/apartment.xml"], &set[..]].concat());
    assert!(!right && said.contains("MaxBricks"), "{said}");
}
