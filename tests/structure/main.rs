//! The structure that ARCHITECTURE.md promises: no circle inside a crate, and no arrow upwards between crates.
//!
//! It is read from the code itself: what each module names of others, in a `use` or by a path, followed through re-exports
//! to the module that defines it. Tests are left out. A module stands above what lies in its folder, so what lies there
//! cannot name it; modules of one folder, each taken with all that lies in it, name each other one way.

mod graph;
mod modules;

use std::path::PathBuf;
use std::process::Command;

use graph::Graph;
use modules::Crate;
use serde_json::Value;

/// A crate of the workspace, as cargo describes it.
struct Package {
    name: String,
    /// The folder of its manifest, relative to the workspace's root.
    folder: PathBuf,
    /// The root files of its libraries and programs.
    roots: Vec<PathBuf>,
    /// The crates of the workspace that it depends on, those of its tests and benchmarks left out.
    dependencies: Vec<String>,
}

#[test]
fn no_crate_has_an_import_circle() {
    let mut circles = Vec::new();
    for package in packages() {
        for root in &package.roots {
            let modules = Crate::read(root).unwrap_or_else(|error| panic!("{}: {error}", root.display()));
            let found = modules.rooms().flat_map(|room| modules.arrows_in(room).circles());
            circles.extend(found.map(|circle| format!("{}: {circle}", package.name)));
        }
    }
    assert!(circles.is_empty(), "{} import circles:\n{}", circles.len(), circles.join("\n"));
}

#[test]
fn no_arrow_between_crates_points_upwards() {
    let packages = packages();
    let package = |name: &str| packages.iter().find(|package| package.name == name).unwrap();
    let is_app = |name: &str| package(name).folder.starts_with("apps");
    let speaks_on_the_bus = |name: &str| package(name).dependencies.iter().any(|other| other == "elk-bus");
    let upwards = |from: &Package, to: &str| match from.name == "elk" {
        true => false,
        false => is_app(to) && (!is_app(&from.name) || speaks_on_the_bus(to)),
    };
    let arrows: Vec<String> = packages
        .iter()
        .flat_map(|from| {
            from.dependencies.iter().filter(|to| upwards(from, to)).map(|to| format!("{} -> {to}", from.name))
        })
        .collect();
    assert!(arrows.is_empty(), "no app depends on another app, and nothing below on an app: {arrows:?}");
}

#[test]
fn a_circle_is_found() {
    let mut graph = Graph::default();
    for (from, to) in [("a", "b"), ("b", "c"), ("c", "b"), ("c", "d")] {
        graph.arrow(from, to, "an import");
    }
    let circles = graph.circles();
    assert_eq!(circles.len(), 1, "{circles:?}");
    assert!(circles[0].starts_with("b, c"), "{circles:?}");
}

fn packages() -> Vec<Package> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--offline", "--no-deps", "--format-version", "1"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().iter().map(package).collect()
}

fn package(described: &Value) -> Package {
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let list = |key: &str| described[key].as_array().unwrap().iter();
    let is_compiled_in = |target: &&Value| {
        let kinds = target["kind"].as_array().unwrap();
        kinds.iter().any(|kind| ["lib", "bin", "proc-macro"].contains(&kind.as_str().unwrap()))
    };
    let manifest = PathBuf::from(text(&described["manifest_path"]));
    let folder = manifest.parent().unwrap().strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap().to_owned();
    Package {
        name: text(&described["name"]),
        folder,
        roots: list("targets").filter(is_compiled_in).map(|target| text(&target["src_path"]).into()).collect(),
        dependencies: list("dependencies")
            .filter(|dependency| dependency["kind"].is_null() && dependency["path"].is_string())
            .map(|dependency| text(&dependency["name"]))
            .collect(),
    }
}
