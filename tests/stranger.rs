//! A crate outside this workspace, with an app and message types, an explorer and a sensor of its own: it takes part in
//! missions, is swapped in and out, and all of elk's tools serve what it says, without elk knowing of it.

mod common;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Once;

use common::lab::hear;
use common::page::Page;
use common::{Elk, summary_of};
use elk_bus::Value as BusValue;
use serde_json::Value;

/// A program of the crate, which is built by then, into this workspace's target folder and in its versions: only the crate
/// itself is built anew.
fn program(name: &str) -> PathBuf {
    static BUILT: Once = Once::new();
    let target = Path::new(env!("CARGO_BIN_EXE_elk")).parent().and_then(Path::parent).unwrap();
    BUILT.call_once(|| {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        std::fs::copy(root.join("Cargo.lock"), root.join("tests/stranger/Cargo.lock")).unwrap();
        let mut command = Command::new(env!("CARGO"));
        command
            .args(["build", "--offline", "--manifest-path", "tests/stranger/Cargo.toml", "--target-dir"])
            .arg(target);
        let out = command.current_dir(root).output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    });
    target.join("debug").join(format!("stranger-{name}"))
}

/// The stranger's hall, explored by the stranger's strategy, with the stranger's counter beside.
fn mission(kind: &str) -> String {
    let [sensor, explorer, geiger] = ["sensor", "explorer", "geiger"].map(|name| program(name).display().to_string());
    format!(
        "<Scenario name=\"Stranger\" type=\"{kind}\"><Sensor exec=\"{sensor}\"><Balls>3</Balls></Sensor>\
         <Map type=\"OctoMap\"><Res>0.2 m</Res></Map><Explorer exec=\"{explorer}\"><Boredom>1</Boredom></Explorer>\
         <Controller type=\"MOOSSim\"/><App name=\"Geiger\" exec=\"{geiger}\"/></Scenario>"
    )
}

/// The latest value of a variable, as `elk echo` shows it to programs.
fn latest(elk: &Elk, key: &str) -> Value {
    let said = elk.obeyed(&["echo", key, "--latest", "--count", "1", "--json"]);
    let shown: Value = serde_json::from_str(&said).unwrap();
    shown["value"].clone()
}

/// What each count of a reading stands for, wherever the robot is.
fn gain(reading: &Value) -> f64 {
    let place = reading["at"]["translation"].as_array().unwrap().iter().map(|c| c.as_f64().unwrap().powi(2));
    reading["rate"].as_f64().unwrap() * (0.01 + place.sum::<f64>())
}

/// Lets the robot take steps until a variable has been said `times` times.
fn step_until(elk: &Elk, key: &str, times: usize) {
    let mut watcher = elk.join("watcher");
    watcher.comms.register(key).unwrap();
    watcher.comms.flush().unwrap();
    let mut heard = 0;
    // Whoever registers is given the latest value first; each step says where the robot is.
    watcher.comms.register("SIM_SENSOR").unwrap();
    watcher.comms.flush().unwrap();
    elk.obeyed(&["step"]);
    hear(&mut watcher, key, |mail| {
        heard += usize::from(mail.key() == key);
        if heard < times && mail.key() == "SIM_SENSOR" {
            elk.obeyed(&["step"]);
        }
        (heard >= times).then_some(())
    });
}

#[test]
fn a_stranger_s_sensor_explorer_and_app_run_are_seen_poked_and_swapped() {
    let elk = Elk::new("stranger");
    let mut launcher = elk.launch(&mission("manual"));
    launcher.wait_for("Enter takes a step");
    step_until(&elk, "EXPLORER_GOALS", 2);

    // Field by field: the app's reading, the strategy's goals, the sensor's camera.
    let reading = latest(&elk, "RADIATION");
    assert_eq!(reading["tubes"][0]["kind"], "Gamma", "{reading}");
    assert_eq!(reading["tubes"][1]["kind"]["Beta"]["window"], 0.5, "{reading}");
    let goals = latest(&elk, "EXPLORER_GOALS");
    let listed = goals["goals"].as_array().unwrap();
    assert!(listed.iter().all(|goal| goal["score"].as_f64().unwrap() >= 0.0), "{goals}");
    assert!(listed.iter().any(|goal| goal["chosen"] == true), "{goals}");
    let camera = &latest(&elk, "MAP_KNOWN")["camera"];
    assert!((camera["fov_x"].as_f64().unwrap() - 75f64.to_radians()).abs() < 1e-9, "{camera}");
    let info = elk.obeyed(&["info", "RADIATION"]);
    assert!(info.contains("rate: f64, 1/s") && info.contains("Counts a second."), "{info}");

    // Poked, it counts ten times as much; what is no value of the type is refused in words.
    assert!((gain(&reading) - 1.0).abs() < 1e-9, "{reading}");
    let mut listener = elk.join("reader");
    listener.comms.register("RADIATION").unwrap();
    listener.comms.flush().unwrap();
    let said = elk.refused(&["poke", "RADIATION_SETUP", r#"{"gain": "much"}"#]);
    assert!(said.contains(r#"gain is "much"; it has to be a number"#), "{said}");
    elk.obeyed(&["poke", "RADIATION_SETUP", r#"{"gain": 10}"#]);
    let is_tenfold = || (gain(&latest(&elk, "RADIATION")) - 10.0).abs() < 1e-9;
    hear(&mut listener, "readings of ten times as much", |_| is_tenfold().then_some(()));

    // Whoever looks sees what it draws, with what it means and the keys that it takes; one that is pressed reaches it.
    let mut page = Page::open(&elk);
    let drawn = page.wait_for_drawing("Geiger", "readings");
    let kinds: Vec<&str> =
        drawn["primitives"].as_array().unwrap().iter().map(|one| one["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["points", "text"], "{drawn}");
    let goals = page.wait_for_message(|message| message["type"] == "keys" && message["rows"][0]["app"] == "Geiger");
    assert_eq!(goals["rows"][0]["meaning"], "ten times as much a count", "{goals}");
    page.say(&serde_json::json!({
        "type": "press", "id": 1, "app": "Geiger", "key": "g", "shift": false, "alt": false,
    }));
    let answer = page.wait_for_message(|message| message["type"] == "answer");
    assert_eq!(answer["ok"], true, "{answer}");
    let is_hundredfold = || (gain(&latest(&elk, "RADIATION")) - 100.0).abs() < 1e-9;
    hear(&mut listener, "readings of a hundred times as much", |_| is_hundredfold().then_some(()));
    drop(page);

    // Swapped for one of its kind, the explorer goes on with its own memory; for another it does not, and that is said.
    assert_eq!(latest(&elk, "EXPLORER_MEMORY")["strategy"], "Magpie");
    let remembered = latest(&elk, "EXPLORER_MEMORY_Magpie");
    let targets = remembered["targets"].as_array().map_or(0, Vec::len);
    assert!(remembered["plans"].as_u64() > Some(0) && targets > 0, "{remembered}");
    elk.obeyed(&["swap", "Explorer"]);
    elk.obeyed(&["swap", "Sensor", "View=80"]);
    elk.obeyed(&["swap", "Explorer", "type=ClosestFrontier"]);
    step_until(&elk, "PLAN", 2);
    assert_eq!(latest(&elk, "EXPLORER_MEMORY")["strategy"], Value::Null);
    elk.obeyed(&["swap", "Explorer", &format!("exec={}", program("explorer").display()), "Boredom=0.25"]);
    elk.obeyed(&["resume"]);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(0), "{said}");
    let text = std::fs::read_to_string(elk.run().join("Explorer.log")).unwrap();
    assert_eq!(text.matches("left aside").count(), 1, "{text}");
    assert!(text.contains("what Magpie itself remembered is left aside: it goes on as ClosestFrontier"), "{text}");
    let summary = elk.summary();
    assert_eq!(summary["contacts"], 0, "{summary:#}");
    assert!(summary["accuracy"].as_f64().unwrap() > 0.9, "{summary:#}");
    assert_eq!(summary["swapped"], serde_json::json!(["Sensor", "Explorer"]), "{summary:#}");
    assert!(summary["counters"]["revisits"].is_u64(), "{summary:#}");
}

#[test]
fn what_a_stranger_says_is_recorded_drawn_exported_and_replayed_to_the_bit() {
    let elk = Elk::new("stranger-log");
    let (code, said) = elk.launch_with(&mission("auto"), &["--log-dir", "old"]).end();
    assert_eq!(code, Some(0), "{said}");
    let old = elk.run_in("old");
    let summary = summary_of(&old);
    assert_eq!((&summary["complete"], &summary["contacts"]), (&true.into(), &0.into()), "{summary:#}");
    let old = old.display().to_string();
    let told = |arguments: &[&str]| {
        let out = elk.command(arguments).output().unwrap();
        let said = String::from_utf8_lossy(&out.stdout) + String::from_utf8_lossy(&out.stderr);
        assert!(out.status.success(), "{arguments:?}: {said}");
        said.into_owned()
    };

    // Drawn by a viewer, and as columns of a table.
    let info: Value = serde_json::from_str(&told(&["log", "info", &old, "--json"])).unwrap();
    let topics = info["topics"].as_array().unwrap();
    let schema = |name: &str| topics.iter().find(|topic| topic["name"] == name).map(|topic| topic["schema"].clone());
    assert_eq!(schema("RADIATION"), Some("foxglove.PoseInFrame".into()), "{info}");
    assert_eq!(schema("EXPLORER_GOALS"), Some("foxglove.PosesInFrame".into()), "{info}");
    assert_eq!(schema("DRAWING/Geiger/readings"), Some("foxglove.SceneUpdate".into()), "{info}");
    assert!(schema("KEYS/Geiger").is_some(), "{info}");
    let csv = told(&["log", "export", &old, "--to", "csv", "-o", "-"]);
    for column in ["RADIATION.rate,Geiger,", "RADIATION.tubes[1].rate,Geiger,", "EXPLORER_GOALS.weighed,Explorer,"] {
        assert!(csv.contains(column), "{column} is not in the table");
    }

    // What the stranger's sensor saw, through a live map and the stranger's own strategy: the same map and plans. (His counter
    // hears of more poses if it is there from the first one on.)
    let replay = ["replay", &old, "--rate", "max", "--keys", "SCAN*", "--only", "Map,Explorer", "--into", &old];
    told(&[&replay[..], &["--log-dir", "new"]].concat());
    let new = elk.run_in("new").display().to_string();
    let keys = ["MAP_UPDATE", "MAP_KNOWN", "PLAN", "EXPLORER_GOALS"];
    let keys: Vec<&str> = keys.iter().flat_map(|key| ["--keys", *key]).collect();
    let same = told(&[&["log", "diff", &old, &new], &keys[..]].concat());
    assert!(same.starts_with("the same: "), "{same}");

    // All of it once more onto a bus: a reader hears the very bytes.
    let other = Elk::new("stranger-replay");
    let mut lab = common::lab::Lab::new(&other);
    told(&["replay", &old, "--rate", "max", "--keys", "RADIATION", "--community", other.community()]);
    let expected: Vec<BusValue> = elk_log::LogReader::open(Path::new(&old))
        .unwrap()
        .map(Result::unwrap)
        .filter(|record| record.key == "RADIATION")
        .map(|record| record.value)
        .collect();
    assert!(expected.len() > 3);
    let heard = lab.hear(expected.len()).into_iter().filter(|(key, ..)| key == "RADIATION");
    assert_eq!(heard.map(|(.., value)| value).collect::<Vec<_>>(), expected);
    lab.end();
}

/// A sensor that cannot be what it is told says so in words, and its program answers for itself.
#[test]
fn a_stranger_s_parameters_are_checked_like_elk_s_own() {
    let help = Command::new(program("sensor")).arg("--help").output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    assert!(
        help.starts_with("Sensor Hall, as an app of a mission") && help.contains("Balls that lie in the hall."),
        "{help}"
    );
    let elk = Elk::new("stranger-slip");
    let said = elk.launch_and_fail(&mission("auto").replace("Balls>", "Bals>"));
    assert!(said.contains("Sensor Hall has no parameter Bals; did you mean Balls?"), "{said}");
    let said = elk.launch_and_fail(&mission("auto").replace("<Balls>3", "<Balls>9"));
    assert!(said.contains("Balls"), "{said}");
}
