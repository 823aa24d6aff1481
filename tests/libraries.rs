//! The libraries that somebody who has never heard of elk can use: nothing of a bus comes with them, and they say nothing of
//! missions.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// The libraries, and where they lie.
const LIBRARIES: [(&str, &str); 6] = [
    ("elk-geometry", "bus/geometry"),
    ("elk-map", "apps/map"),
    ("elk-field", "apps/field"),
    ("elk-stereo", "apps/stereo"),
    ("elk-registration", "apps/registration"),
    ("elk-odometry", "apps/odometry"),
];

/// The machine that elk is built for here, as Rust calls it.
fn host() -> String {
    let rustc = Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into())).arg("-vV").output().unwrap();
    let said = String::from_utf8(rustc.stdout).unwrap();
    said.lines().find_map(|line| line.strip_prefix("host: ")).unwrap().to_owned()
}

/// Everything that elk is built of, as cargo knows it. What it is built of on other machines need not be here.
fn metadata() -> Value {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["metadata", "--format-version", "1", "--offline", "--locked", "--filter-platform", &host()]);
    let output = cargo.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The names of the packages that one package is built of, tests and all, it itself among them.
fn built_of(metadata: &Value, package: &str) -> BTreeSet<String> {
    let list = |value: &Value| value.as_array().unwrap().clone();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let names: BTreeMap<String, String> =
        list(&metadata["packages"]).iter().map(|one| (text(&one["id"]), text(&one["name"]))).collect();
    let needs: BTreeMap<String, Vec<Value>> =
        list(&metadata["resolve"]["nodes"]).iter().map(|one| (text(&one["id"]), list(&one["dependencies"]))).collect();
    let mut open: Vec<String> = names.iter().filter(|(_, name)| *name == package).map(|(id, _)| id.clone()).collect();
    let mut found: BTreeSet<String> = open.iter().cloned().collect();
    while let Some(id) = open.pop() {
        let new = needs[&id].iter().map(text).filter(|id| found.insert(id.clone()));
        open.extend(new.collect::<Vec<_>>());
    }
    found.iter().map(|id| names[id].clone()).collect()
}

#[test]
fn no_bus_comes_with_a_library() {
    let metadata = metadata();
    let is_bus = |name: &&String| {
        let of_a_bus = ["elk-bus", "elk-mission", "elk-spatial", "elk-log", "elk-outside"];
        of_a_bus.contains(&name.as_str()) || name.starts_with("iceoryx2")
    };
    for (library, _) in LIBRARIES {
        let all = built_of(&metadata, library);
        assert!(all.contains(library) && all.contains("nalgebra"), "{all:?}");
        assert_eq!(all.iter().filter(is_bus).collect::<Vec<_>>(), Vec::<&String>::new(), "{library} is built of them");
    }
    let world = built_of(&metadata, "elk-world");
    assert!(!world.contains("elk-bus") && !world.contains("elk-spatial"), "a world is geometry, too");
    assert!(built_of(&metadata, "elk-map-app").iter().filter(is_bus).count() > 5, "whoever needs a bus is told apart");
}

/// The lines of code below a folder that are no comments.
fn code(folder: &Path) -> String {
    let entries = std::fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path());
    let text = |path: &Path| std::fs::read_to_string(path).unwrap();
    let lines = |text: String| {
        let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        code.map(|line| format!("{line}\n")).collect::<String>()
    };
    entries.map(|path| if path.is_dir() { code(&path) } else { lines(text(&path)) }).collect()
}

#[test]
fn a_library_says_nothing_of_missions() {
    let of_missions =
        ["mission", "Radius", "MaxBricks", "MaxRange", "MAP_UPDATE", "MAP_REQUEST", "elk_bus", "elk_spatial"];
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (library, folder) in LIBRARIES {
        let code = code(&root.join(folder).join("src"));
        assert!(code.contains("thiserror::Error"), "{library} has errors");
        // What a laser says beside its ranges is a remission.
        let code = code.replace("remission", "").replace("Remission", "");
        let said: Vec<_> = of_missions.iter().filter(|word| code.contains(**word)).collect();
        assert!(said.is_empty(), "{library} says {said:?}");
    }
    assert!(code(&root.join("apps/map/app/src")).contains("MaxBricks"), "these are their words");
}
