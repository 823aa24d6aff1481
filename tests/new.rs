//! A crate of one's own, as `elk new` makes it: it builds, is tested, and takes part in a mission. The target folder is this
//! workspace's, so that only what differs is built.

mod common;

use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::Elk;
use common::lab::hear;
use common::small::small;

/// Where the crates are built.
fn target() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_elk")).parent().and_then(Path::parent).unwrap()
}

/// Cargo, in a crate of the test's folder.
fn cargo(elk: &Elk, name: &str, arguments: &[&str]) {
    let mut command = Command::new(env!("CARGO"));
    command.args(arguments).arg("--offline").current_dir(elk.folder().join(name)).env("CARGO_TARGET_DIR", target());
    let out = command.output().unwrap();
    let said = String::from_utf8_lossy(&out.stderr).into_owned() + &String::from_utf8_lossy(&out.stdout);
    assert!(out.status.success(), "cargo {arguments:?} in {name}:\n{said}");
}

/// Makes a crate in the test's folder. Its name is one that the templates have words of.
fn made(elk: &Elk, kind: &str, name: &str) {
    let out = elk.command(&["new", kind, name]).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}

fn program(name: &str) -> PathBuf {
    target().join("debug").join(name)
}

/// The Rust of README.md.
fn readme_app() -> String {
    let readme = include_str!("../README.md");
    let (_, rest) = readme.split_once("## An app of your own").unwrap();
    rest.split_once("```rust\n").and_then(|(_, code)| code.split_once("\n```")).unwrap().0.to_owned()
}

#[test]
fn a_new_app_is_tested_and_heard_in_a_mission_and_so_is_the_readme_s() {
    let elk = Elk::new("hello-me");
    made(&elk, "app", "hello-me");
    std::fs::create_dir(elk.folder().join("hello-me/src/bin")).unwrap();
    std::fs::write(elk.folder().join("hello-me/src/bin/readme-app.rs"), readme_app()).unwrap();
    // The mission is right but for the program, which is not built yet.
    let check = elk.command(&["check", "mission.xml"]).current_dir(elk.folder().join("hello-me")).output().unwrap();
    let missing = "elk: Mine: ./target/release/hello-me cannot be run: No such file or directory (os error 2)\n";
    assert_eq!(String::from_utf8_lossy(&check.stderr), missing);
    cargo(&elk, "hello-me", &["test"]);
    cargo(&elk, "hello-me", &["build"]);

    let app = |name: &str, program_name: &str, more: &str| {
        format!("<App name=\"{name}\" exec=\"{}\" restart=\"on-failure\">{more}</App>", program(program_name).display())
    };
    let both = app("Mine", "readme-app", "") + &app("Other", "hello-me", "<Greeting>good evening</Greeting>");
    let mut launcher = elk.launch(&small("manual", &both));
    launcher.wait_for("Enter takes a step");
    let mut guest = elk.join("guest");
    guest.comms.register("GREET*").unwrap();
    guest.comms.notify("WHO", "Ada").unwrap();
    guest.comms.flush().unwrap();
    let mut heard = std::collections::BTreeSet::new();
    hear(&mut guest, "both greetings", |mail| {
        heard.insert((mail.source().to_owned(), mail.key().to_owned(), mail.as_text().map(str::to_owned)));
        (heard.len() == 2).then_some(())
    });
    let greeting = |from: &str, key: &str, words: Option<&str>| (from.into(), key.into(), words.map(str::to_owned));
    let expected = [greeting("Mine", "GREETING", Some("hello, Ada")), greeting("Other", "GREETED", None)];
    assert_eq!(heard, expected.into());
    drop(guest);
    assert_eq!(elk.row("Mine")["restarts"], 0);
    common::kill(launcher.id(), rustix::process::Signal::TERM);
    launcher.end();

    // Who says something that the app does not have is told so, in words.
    let odd = app("Other", "hello-me", "<Greting>hi</Greting>").replace(" restart=\"on-failure\"", "");
    let said = elk.launch_and_fail(&small("auto", &odd));
    assert!(said.contains("Greting=hi says nothing to this app; it has Greeting"), "{said}");
}

/// A strategy that remembers something needs no more than what such a crate has.
const REMEMBERS: &str = r#"
use elk_explorer::{DecodeError, Journal, LeaveError, Route, Strategy, StrategyMemory, View, payload};

/// What it leaves.
#[payload]
#[derive(Default)]
struct Made {
    /// Plans made.
    #[describe(count)]
    plans: u64,
}

struct Remembers(Made);

impl Strategy for Remembers {
    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        self.0.plans += 1;
        view.cheapest(journal, |_, way_m| way_m)
    }

    fn memory(&self) -> Result<Option<StrategyMemory>, LeaveError> {
        StrategyMemory::of::<Made>(&self.0).map(Some)
    }

    fn recall(&mut self, left: &StrategyMemory) -> Result<(), DecodeError> {
        self.0 = left.take::<Made>()?;
        Ok(())
    }
}

fn main() -> std::process::ExitCode {
    elk_explorer::main_with(&[], |_| Remembers(Made::default()))
}
"#;

#[test]
fn a_new_explorer_is_tested_explores_and_is_swapped_in() {
    let elk = Elk::new("level-hello");
    made(&elk, "explorer", "level-hello");
    std::fs::create_dir(elk.folder().join("level-hello/src/bin")).unwrap();
    std::fs::write(elk.folder().join("level-hello/src/bin/remembers.rs"), REMEMBERS).unwrap();
    cargo(&elk, "level-hello", &["test"]);
    cargo(&elk, "level-hello", &["build"]);
    // The mission names what `cargo build --release` makes.
    let folder = elk.folder().join("level-hello");
    std::fs::create_dir_all(folder.join("target/release")).unwrap();
    symlink(program("level-hello"), folder.join("target/release/level-hello")).unwrap();
    let mut command = elk.command(&["launch", "mission.xml", "--headless", "--set", "Map.Res=0.25"]);
    command.args(["--community", elk.community()]).current_dir(&folder);
    let out = command.output().unwrap();
    let said = String::from_utf8_lossy(&out.stdout) + String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success() && said.contains("level-hello: complete"), "{said}");
    assert!(said.contains("explorer level-hello"), "{said}");

    // A slip in a parameter of its own is answered like one of elk's.
    let exec = format!("Explorer.exec={}", program("level-hello").display());
    let slip = ["launch", "mission.xml", "--headless", "--set", &exec, "--set", "Explorer.Clim=2", "--community"];
    let out = elk.command(&slip).arg(elk.community()).current_dir(&folder).output().unwrap();
    let said = String::from_utf8_lossy(&out.stdout) + String::from_utf8_lossy(&out.stderr);
    assert!(said.contains("Explorer LevelHello has no parameter Clim; did you mean Climb?"), "{said}");

    let mut launcher = elk.launch(&small("manual", ""));
    launcher.wait_for("Enter takes a step");
    elk.obeyed(&["step"]);
    let said = elk.obeyed(&["swap", "Explorer", &exec["Explorer.".len()..], "Climb=1"]);
    assert!(said.contains("Explorer is swapped"), "{said}");
    elk.obeyed(&["resume"]);
    let (code, said) = launcher.end();
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn a_new_sensor_is_tested_and_what_it_sees_is_explored() {
    let elk = Elk::new("my-hall");
    made(&elk, "sensor", "my-hall");
    cargo(&elk, "my-hall", &["test"]);
    cargo(&elk, "my-hall", &["build"]);
    let folder = elk.folder().join("my-hall");
    std::fs::create_dir_all(folder.join("target/release")).unwrap();
    symlink(program("my-hall"), folder.join("target/release/my-hall")).unwrap();
    let launch = |size: &str| {
        let size = format!("Sensor.Size={size}");
        let set = ["--set", "Map.Res=0.25", "--set", &size, "--community", elk.community()];
        let command = [&["launch", "mission.xml", "--headless"], &set[..]].concat();
        let out = elk.command(&command).current_dir(&folder).output().unwrap();
        let said = String::from_utf8_lossy(&out.stdout) + String::from_utf8_lossy(&out.stderr);
        (out.status.success(), said.into_owned())
    };
    let (complete, said) = launch("4; 3; 2.5");
    assert!(complete && said.contains("my-hall: complete"), "{said}");
    assert!(!said.contains("contacts"), "it does not know the true world, and nobody claims so: {said}");
    let (complete, said) = launch("0; 0; 0");
    assert!(!complete && said.contains("Size is 0, and nothing is seen in such a room"), "{said}");
}

#[test]
fn what_is_there_is_not_written_over_and_a_bad_name_makes_nothing() {
    let elk = Elk::new("new-nothing");
    std::fs::create_dir(elk.folder().join("mine")).unwrap();
    std::fs::write(elk.folder().join("mine/thesis"), "years of work").unwrap();
    let said = |arguments: &[&str]| {
        let out = elk.command(arguments).output().unwrap();
        assert_eq!(out.status.code(), Some(1));
        String::from_utf8_lossy(&out.stderr).into_owned()
    };
    assert!(said(&["new", "app", "mine"]).contains("mine is there already, and not empty"));
    assert!(said(&["new", "app", "fn", "--path", "x"]).contains("fn is taken by Rust"));
    assert!(said(&["new", "explorer", "A b"]).contains("\"A b\" is no name for a crate"));
    assert!(!elk.folder().join("x").exists() && std::fs::read_dir(elk.folder().join("mine")).unwrap().count() == 1);
}
