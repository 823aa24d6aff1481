//! Every command and every snippet of README.md, of the guide and of the help, as it is printed there; and where all pages lead.

#[path = "../common/mod.rs"]
mod common;
mod links;
mod page;
mod scene;

use page::{Command, Part, examples, parts, snippets};
use scene::Scene;

const README: &str = include_str!("../../README.md");
const GUIDE: &str = include_str!("../../docs/guide.md");

fn go_through(scene: &str, page: &str) {
    let mut scene = Scene::new(scene);
    let parts = parts(page);
    assert!(parts.iter().map(|part| part.commands.len()).sum::<usize>() > 20, "{parts:?}");
    parts.iter().for_each(|part| scene.go_through(part));
}

#[test]
fn what_a_page_links_to_or_names_is_there() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let pages = links::pages(root);
    assert!(pages.len() > 20, "{pages:?}");
    let missing: Vec<_> = pages.iter().flat_map(|page| links::missing(root, page)).collect();
    assert!(missing.is_empty(), "{missing:#?}");
}

#[test]
fn the_commands_of_the_readme() {
    go_through("documents-readme", README);
}

#[test]
fn the_commands_of_the_guide() {
    go_through("documents-guide", GUIDE);
}

/// A command of elk and all below it, as `log` and `log info`, each with its help.
fn commands(scene: &Scene, words: &[&str]) -> Vec<(String, String)> {
    let help = scene.elk(&[words, &["--help"]].concat());
    let mut all = vec![(["elk"].iter().chain(words).copied().collect::<Vec<_>>().join(" "), help.clone())];
    let below = help.split_once("\nCommands:\n").map_or("", |(_, below)| below);
    for line in below.lines().take_while(|line| line.starts_with("  ")).filter(|line| !line.starts_with("   ")) {
        let name = line.split_whitespace().next().unwrap();
        if name != "help" {
            all.extend(commands(scene, &[words, &[name]].concat()));
        }
    }
    all
}

/// Looks into a mission that runs.
const BESIDE_A_MISSION: [&str; 17] = [
    "apps",
    "stop",
    "start",
    "swap",
    "pause",
    "resume",
    "step",
    "list",
    "echo",
    "hz",
    "bw",
    "info",
    "graph",
    "poke",
    "top",
    "communities",
    "log record",
];

/// Needs a broker.
const BESIDE_A_BROKER: [&str; 8] = ["sensor", "filter", "map", "explorer", "controller", "logger", "replay", "pipe"];

/// Takes those commands out that are one of these.
fn take(all: &mut Vec<Command>, names: &[&str]) -> Vec<Command> {
    all.extract_if(.., |command| names.iter().any(|name| command.line.starts_with(&format!("elk {name}")))).collect()
}

#[test]
fn the_examples_of_the_help() {
    let mut scene = Scene::new("documents-help");
    let helps = commands(&scene, &[]);
    assert!(helps.len() > 40, "{helps:?}");
    let mut all: Vec<Command> = Vec::new();
    for (name, help) in &helps {
        let examples = examples(help);
        assert!(examples.iter().any(|example| example.line.contains(name)), "{name} has no example:\n{help}");
        for example in examples {
            if !all.contains(&example) {
                all.push(example);
            }
        }
    }
    let command = |line: &str| Command { line: line.to_owned(), shown: Vec::new() };
    // The strategy that others name is made first, and built as its own words say.
    let mut own = take(&mut all, &["new"]);
    own.push(command("(cd ../mine && cargo build --release)"));
    let beside_a_mission = take(&mut all, &BESIDE_A_MISSION);
    let mut beside_a_broker = vec![command("elk db &")];
    beside_a_broker.extend(take(&mut all, &BESIDE_A_BROKER));
    for commands in [own, all, beside_a_broker] {
        scene.go_through(&Part { commands, ..Part::default() });
    }
    let mission = "elk launch mission-files/hall.xml --pace 1".to_owned();
    scene.go_through(&Part { beside: Some(mission), commands: beside_a_mission, ..Part::default() });
}

/// The README's mission, with an executable of its name, and what the guide says of a sensor.
#[test]
fn missions_as_they_are_printed_are_right() {
    let scene = Scene::new("documents-missions");
    let write = |name: &str, text: &str| {
        std::fs::write(scene.root().join(name), text).unwrap();
        std::fs::set_permissions(scene.root().join(name), std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    };
    write("my-app", "#!/bin/sh\n");
    std::os::unix::fs::symlink(scene.root().join("mission-files/worlds"), scene.root().join("worlds")).unwrap();
    let [readme] = snippets(README, "xml")[..] else { panic!("one mission") };
    write("readme.xml", readme);
    assert!(scene.elk(&["check", "readme.xml"]).contains("Apartment is right"));

    let [sensor] = snippets(GUIDE, "xml")[..] else { panic!("one sensor") };
    // The reader's room in millimetres, with y upward.
    let room = std::fs::read_to_string(scene.root().join("room.obj")).unwrap();
    let lines = room.lines().map(|line| match line.split(' ').collect::<Vec<_>>()[..] {
        ["v", x, y, z] => format!("v {x}000 {z}000 -{y}000\n"),
        _ => format!("{line}\n"),
    });
    write("room.obj", &lines.collect::<String>());
    write("guide.xml", &common::small::small("auto", "").replace("<Sensor type=\"Simulator\"/>", sensor));
    assert!(scene.elk(&["check", "guide.xml"]).contains("Small is right"));
}
