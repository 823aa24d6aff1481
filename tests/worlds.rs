//! Worlds as people have them: what `elk world` and `elk check` say of them, and that what is right starts.

mod common;

use std::path::Path;
use std::process::Command;

use common::{Elk, summary_of};
use serde_json::Value;

/// The program at the repository's root: exit code, what it said.
fn elk(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_elk"))
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    (output.status.code(), String::from_utf8([output.stdout, output.stderr].concat()).unwrap())
}

fn case(name: &str) -> String {
    format!("{}/tests/cases/obj/{name}.obj", env!("CARGO_MANIFEST_DIR"))
}

/// A mission in the world of a case.
fn mission(world: &str, start: &str, more: &str) -> String {
    let world = case(world);
    format!(
        "<Scenario name=\"Case\"><Sensor type=\"Simulator\"><World>{world}</World><Start>{start}</Start></Sensor>\
         <Map type=\"OctoMap\"/><Explorer type=\"Potential\"/><Controller type=\"MOOSSim\"/>{more}<Logger type=\"none\"/></Scenario>"
    )
}

/// What `elk check` says of a mission, its exit code first.
fn checked(mission: &str) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("case.xml");
    std::fs::write(&file, mission).unwrap();
    elk(&["check", file.to_str().unwrap()])
}

const START: &str = "1.0; 1.5; 1.0";

#[test]
fn a_world_is_described() {
    let (code, said) = elk(&["world", "info", "tests/cases/obj/rooms-ngon.obj"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("11 faces, 30 triangles") && said.contains("closed   yes"), "{said}");
    let (code, said) =
        elk(&["world", "info", "tests/cases/obj/rooms-ngon.obj", "--json", "--scale", "2", "--up", "-x"]);
    let found: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(code, Some(0));
    assert!((found["surface_m2"].as_f64().unwrap() - 4.0 * 61.8).abs() < 1e-6, "{said}");
    assert_eq!(found["size"], serde_json::json!([4.0, 6.0, 8.0]));
    assert_eq!((&found["closed"], &found["unit"]["name"]), (&Value::from(true), &Value::from("metres")));
    let open = elk(&["world", "info", "tests/cases/obj/noceiling.obj"]).1;
    assert!(open.contains("a hole of 4.00 × 3.00 × 0.00 m around (2.00; 1.50; 2.00)"), "{open}");
    let (code, said) = elk(&["world", "info", "tests/cases/obj/empty.obj"]);
    assert!(code == Some(1) && said.contains("empty.obj has no faces"), "{said}");
    let (code, said) = elk(&["world", "info", "Cargo.toml"]);
    assert!(code == Some(1) && said.contains("Cargo.toml: this is of no format that is known"), "{said}");
}

/// Cases 2, 4 and 5: what of a world a mission would trip over.
#[test]
fn a_world_is_checked() {
    for (world, more, code, words) in [
        ("rooms-quads", &["--start", "1; 1.5; 1"][..], 0, "can be used"),
        (
            "rooms-quads",
            &["--start", "2; 0.5; 1"],
            1,
            "is inside an obstacle or outside the world; free is, for example",
        ),
        ("rooms-quads", &["--start", "-2; 0.5; 1"], 1, "the start (-2.00; 0.50; 1.00) is inside an obstacle"),
        ("far-4000", &[], 1, "a map of 0.1 m voxels from -3276.8 to 3276.8 m along each axis (65,536 voxels)"),
        ("far-4000", &["--res", "0.2"], 0, "can be used"),
        ("far-500k", &[], 1, "move the world towards the origin, or choose a larger Res"),
        ("far-edge", &["--start", "3275.3; 3275.5; 1.0"], 0, "what lies beyond is not explored"),
        ("shaft-open", &[], 0, "it is open: "),
        (
            "rooms-quads",
            &["--scale", "1000"],
            0,
            "it is 4000.0000 m long: if it is drawn in millimetres, say so by Scale, 0.001 times",
        ),
    ] {
        let file = case(world);
        let (found, said) = elk(&[&["world", "check", &file], more].concat());
        assert!(found == Some(code) && said.contains(words), "{world} {more:?}: {found:?} {said}");
    }
    let (code, said) = elk(&["world", "check", "car-interior", "--res", "0.1 cm"]);
    assert!(code == Some(2) && said.contains("the unit must be m"), "{said}");
}

/// What `elk check` calls right starts; what it does not, `elk launch` does not start either.
#[test]
fn a_mission_is_checked_with_its_world_its_start_and_its_executables() {
    assert_eq!(checked(&mission("rooms-quads", START, "")).0, Some(0));
    let wrong = [
        (mission("empty", START, ""), "empty.obj has no faces: export it with its faces"),
        (
            mission("rooms-quads", "0; 0; 0.8", ""),
            "the start (0.00; 0.00; 0.80) is inside an obstacle or outside the world",
        ),
        (mission("far-4000", "4001; 4001.5; 1", ""), "the robot would be beyond it"),
        (mission("rooms-quads", START, "<App exec=\"./none\"/>"), "none cannot be run: No such file or directory"),
        (mission("rooms-quads", START, "<App exec=\"/etc/passwd\"/>"), "/etc/passwd is not executable; `chmod +x`"),
        (mission("rooms-quads", START, "<App exec=\"no-such-program\"/>"), "there is no no-such-program in PATH"),
        (mission("rooms-quads", START, "<Filter type=\"Distance\"><Input>A</Input><Output>A</Output></Filter>"), "A"),
        (
            mission("rooms-quads", START, "").replace("<Start>", "<Width>9999</Width><Height>9999</Height><Start>"),
            "Width times",
        ),
        (
            mission("rooms-quads", START, "")
                .replace("<Start>", "<Scale>0.01</Scale><RandomStart>true</RandomStart><Start>"),
            "Scale",
        ),
    ];
    for (mission, words) in wrong {
        let (code, said) = checked(&mission);
        assert!(code == Some(1) && said.contains(words), "{words}: {said}");
        let elk = Elk::new("checked");
        let refused = elk.launch_and_fail(&mission);
        assert!(refused.contains(words), "{words}: {refused}");
        assert!(!elk.folder().join("logs").exists(), "{words}: nothing was started");
    }
    let noted = [
        (mission("far-edge", "3275.3; 3275.5; 1.0", ""), "what lies beyond is not explored"),
        (mission("noceiling", START, ""), "it is open: "),
        (
            mission("rooms-quads", START, "<Filter type=\"Distance\"><Threshold>0.3</Threshold></Filter>"),
            "nothing is seen from",
        ),
        (
            mission("rooms-quads", START, "")
                .replace("\"Potential\"/>", "\"Potential\"><Mid>100;0;0</Mid><Dim>3;3;3</Dim></Explorer>"),
            "the volume to explore (Mid, Dim of the explorer) holds nothing of it",
        ),
    ];
    for (mission, words) in noted {
        let (code, said) = checked(&mission);
        assert!(code == Some(0) && said.contains("note: ") && said.contains(words), "{words}: {said}");
    }
}

/// An open world runs, and its sensor says that it is open.
#[test]
fn a_sensor_says_at_its_start_that_its_world_is_open() {
    let elk = Elk::new("open-world");
    let few =
        mission("noceiling", START, "").replace("\"Potential\"/>", "\"Potential\"><MaxScans>3</MaxScans></Explorer>");
    let said = elk.launch_and_fail(&few);
    assert!(said.contains("note: Sensor: World ") && said.contains("it is open: "), "{said}");
    let run = elk.run();
    let log = std::fs::read_to_string(run.join("Sensor.log")).unwrap();
    assert!(
        log.contains("it is open: ") && log.contains("a hole of 4.00 × 3.00 × 0.00 m around (2.00; 1.50; 2.00)"),
        "{log}"
    );
}

/// Case 6. Regression: 82.27 % where the walls lie on the faces of voxels, and 100 % three centimetres beside them.
#[test]
fn the_same_room_is_evaluated_the_same_wherever_it_lies() {
    let elk = Elk::new("same-room");
    let text = std::fs::read_to_string(case("rooms-quads")).unwrap();
    for (name, offset) in [("0", 0.0), ("3", 0.03), ("5", 0.05)] {
        let shifted = |line: &str| match line.strip_prefix("v ") {
            Some(numbers) => {
                let numbers = numbers.split(' ').map(|n| format!("{:.3}", n.parse::<f64>().unwrap() + offset));
                format!("v {}", numbers.collect::<Vec<_>>().join(" "))
            }
            None => line.to_owned(),
        };
        let world = elk.folder().join(format!("room-{name}.obj"));
        std::fs::write(&world, text.lines().map(shifted).collect::<Vec<_>>().join("\n")).unwrap();
        let mission = mission("rooms-quads", START, "").replace(&case("rooms-quads"), world.to_str().unwrap());
        let file = elk.folder().join(format!("room-{name}.xml"));
        std::fs::write(&file, mission).unwrap();
        // A ray that grazes a surface can still miss a voxel.
        let found = accuracy(&elk, &file);
        assert!(found > 0.9995, "{offset}: {found}");
    }
}

fn accuracy(elk: &Elk, mission: &Path) -> f64 {
    let logs = elk.folder().join(mission.file_stem().unwrap());
    let arguments =
        ["launch", mission.to_str().unwrap(), "--headless", "--in-process", "--log-dir", logs.to_str().unwrap()];
    let output = elk.command(&[&arguments[..], &["--community", elk.community()]].concat()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    summary_of(&elk.run_in(logs))["accuracy"].as_f64().unwrap()
}
