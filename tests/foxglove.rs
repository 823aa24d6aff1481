//! A mission that runs, for Foxglove's clients: the real program, and what clients order really happens.

mod common;
#[path = "../apps/view/tests/viewer/mod.rs"]
mod viewer;

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::Stdio;

use common::Elk;
use common::car::car;
use common::lab::hear;
use common::running::Running;
use elk_bus::Community;
use elk_launcher::run_folder;
use elk_spatial::keys::{MOTION, PROGRESS};
use foxglove::Decode;
use foxglove::messages::PointCloud;
use foxglove::protocol::v1::server::ServerMessage;
use serde_json::{Value, json};
use viewer::Viewer;

/// `elk view --foxglove`, and where it is.
fn view(elk: &Elk) -> (Running, SocketAddr) {
    let arguments = ["view", "--foxglove", "127.0.0.1:0", "--community", elk.community()];
    let mut child = elk.command(&arguments).stdout(Stdio::piped()).spawn().unwrap();
    let mut said = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut said).unwrap();
    let address = said.trim().strip_prefix("ws://").unwrap_or_else(|| panic!("{said}")).parse().unwrap();
    (Running(child), address)
}

#[test]
fn a_mission_is_watched_and_steered_from_foxgloves_clients() {
    let elk = Elk::new("foxglove");
    let mut launcher = elk.launch(&car("manual"));
    launcher.wait_for("Enter takes a step");
    let (view, address) = view(&elk);
    let mut viewer = Viewer::open(address, "", &[]).unwrap();
    viewer.until("services", |said| matches!(said, ServerMessage::AdvertiseServices(_)).then_some(()));
    // A robot that waits takes a step when it is told to.
    assert!(viewer.call("step", &json!({})).is_ok());
    let progress = viewer.subscribe("PROGRESS");
    let scans = |viewer: &mut Viewer| viewer.next_json(progress)["value"]["scans"].as_u64().unwrap();
    let first = scans(&mut viewer);
    // It runs on, and holds where it is told to.
    assert!(viewer.call("resume", &json!({})).is_ok());
    while scans(&mut viewer) < first + 2 {}
    assert!(viewer.call("pause", &json!({})).is_ok());
    let mut listener = elk.join("listener");
    listener.comms.register(elk_bus::any(MOTION)).unwrap();
    listener.comms.flush().unwrap();
    hear(&mut listener, "the pause", |mail| mail.as_text().filter(|text| *text == "pause").map(drop));
    // An app is swapped, and who has it told so.
    let said = viewer.call("swap", &json!({"app": "Explorer", "type": "ClosestFrontier"})).unwrap();
    assert!(said.contains("Explorer is swapped, in "), "{said}");
    assert_eq!(elk.row("Explorer")["type"], "ClosestFrontier");
    let held = scans_so_far(&elk, "first-look");
    assert!(viewer.call("swap", &json!({"app": "Explorrer"})).unwrap_err().contains("Explorer"), "it is named");
    assert!(viewer.call("swap", &json!({"app": "Filter", "params": {"Threshold": "far"}})).is_err());
    // So is one whose parameter is set; the mission's parameters are those that it runs with.
    let before = viewer.parameters(&["Filter.Threshold"]);
    assert_ne!(before, json!({"Filter.Threshold": 4.5}));
    let set = json!({"name": "Filter.Threshold", "value": 4.5});
    viewer.say(&json!({"op": "setParameters", "id": "set", "parameters": [set]}));
    assert_eq!(viewer.answered_parameters("set"), json!({"Filter.Threshold": 4.5}));
    assert_eq!(elk.row("Filter")["swaps"], 1);
    assert!(viewer.parameters(&[]).as_object().unwrap().len() > 20);
    // Views find the run's folder, where the apps' text logs are, of a mission that was not detached, too.
    let community = Community::new(elk.community()).unwrap();
    assert_eq!(run_folder(&community), Some(elk.run()));
    // What is published is written, as `elk poke` writes it.
    listener.comms.register(elk_bus::any("NOTE")).unwrap();
    listener.comms.flush().unwrap();
    viewer.publish("NOTE", r#"{"value": "a word"}"#);
    let note =
        hear(&mut listener, "the note", |mail| mail.as_text().filter(|_| mail.key() == "NOTE").map(str::to_owned));
    assert_eq!(note, "a word");
    viewer.publish("PROGRESS", r#"{"value": "a word"}"#);
    viewer.until_status("PROGRESS: ");
    // All the while it has not moved.
    assert_eq!(scans_so_far(&elk, "second-look"), held);
    // Who looks at the map has it, parts and all.
    assert!(viewer.call("resume", &json!({})).is_ok());
    let update = viewer.subscribe("MAP_UPDATE");
    PointCloud::decode(viewer.next(update).as_slice()).unwrap();
    let part = viewer.subscribe("MAP_PART");
    let cloud = PointCloud::decode(viewer.next(part).as_slice()).unwrap();
    assert_eq!((cloud.frame_id.as_str(), cloud.point_stride), ("world", 12));
    layout_fits(&mut viewer);
    view.stop();
    let (code, said) = launcher.end();
    assert_eq!(code, Some(0), "{said}");
}

/// The scans that a mission has taken.
fn scans_so_far(elk: &Elk, name: &str) -> u64 {
    let mut client = elk.join(name);
    client.comms.register(&PROGRESS).unwrap();
    client.comms.flush().unwrap();
    hear(&mut client, "the progress", |mail| Some(mail.decode(&PROGRESS).ok()?.scans))
}

/// The layout for Lichtblick in the docs: its topics, fields and services are those of a mission, and its panels are placed.
fn layout_fits(viewer: &mut Viewer) {
    let layout: Value = serde_json::from_str(include_str!("../docs/lichtblick.json")).unwrap();
    let panels = layout["configById"].as_object().unwrap();
    let (mut topics, mut paths, mut services) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
    for (name, panel) in panels {
        match name.split_once('!').unwrap().0 {
            "3D" => topics.extend(panel["topics"].as_object().unwrap().keys().cloned()),
            "Plot" => {
                paths.extend(panel["paths"].as_array().unwrap().iter().map(|path| path["value"].as_str().unwrap()));
            }
            "RawMessages" => drop(paths.insert(panel["topicPath"].as_str().unwrap())),
            "CallService" => {
                serde_json::from_str::<Value>(panel["requestPayload"].as_str().unwrap()).unwrap();
                services.insert(panel["serviceName"].as_str().unwrap());
            }
            "Parameters" | "TopicGraph" => {}
            other => panic!("a panel {other}"),
        }
    }
    assert!(topics.len() > 4 && paths.len() > 3 && services.len() > 3);
    topics.iter().for_each(|topic| viewer.wait_for_channel(topic));
    for topic in topics {
        assert_eq!(viewer.channels[&topic].1, "protobuf", "{topic} is drawn");
    }
    for path in paths {
        let (topic, fields) = path.split_once('.').unwrap_or((path, ""));
        viewer.wait_for_channel(topic);
        if fields.is_empty() {
            continue;
        }
        let schema: Value = serde_json::from_str(&viewer.channels[topic].3).unwrap();
        let field = fields.split('.').fold(&schema, |schema, field| &schema["properties"][field]);
        assert!(field["type"].is_string(), "{path}: {schema}");
    }
    for service in services {
        assert!(viewer.services.contains_key(service), "{service}");
    }
    let mut placed = BTreeSet::new();
    place(&layout["layout"], &mut placed);
    assert_eq!(placed, panels.keys().map(String::as_str).collect());
}

/// The panels of a part of a layout.
fn place<'a>(part: &'a Value, placed: &mut BTreeSet<&'a str>) {
    match part.as_str() {
        Some(panel) => assert!(placed.insert(panel), "{panel} is there twice"),
        None => {
            assert!(["row", "column"].contains(&part["direction"].as_str().unwrap()));
            ["first", "second"].iter().for_each(|half| place(&part[*half], placed));
        }
    }
}

#[test]
fn what_cannot_be_is_said_in_one_line() {
    let elk = Elk::new("foxglove-not");
    let refused = |arguments: &[&str]| {
        let out = elk.command(arguments).output().unwrap();
        assert!(!out.status.success());
        String::from_utf8(out.stderr).unwrap()
    };
    let said = refused(&["view", "a.mcap", "--foxglove"]);
    assert_eq!(said, "elk: --foxglove is for a community that runs; Lichtblick and Foxglove open a.mcap as it is\n");
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let said = refused(&["view", "--foxglove", &address]);
    assert!(said.starts_with(&format!("elk: cannot listen at {address}: Address already in use")), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(refused(&["view", "--foxglove", "somewhere"]).contains("for example 127.0.0.1:8765"));
    assert!(refused(&["view", "--origin", "https://a.example"]).contains("--foxglove"));
}
