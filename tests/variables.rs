//! The guide's tables of variables: every variable that elk publishes is there, with JSON that is a value of its type.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use elk_spatial::{keys, samples};
use serde_json::Value;

/// The rows of the guide's tables under this head.
fn rows(head: &str) -> Vec<Vec<&'static str>> {
    let guide = include_str!("../docs/guide.md");
    let (_, behind) = guide.split_once(head).unwrap_or_else(|| panic!("no {head} in the guide"));
    let lines = behind.lines().skip(2).take_while(|line| line.starts_with('|'));
    lines.map(|line| line.trim_matches('|').split(" | ").map(str::trim).collect()).collect()
}

/// Each variable, or a pattern of them, and what it carries.
fn variables() -> BTreeMap<&'static str, &'static str> {
    let rows = rows("| variable | type | says | written by |");
    let names =
        rows.iter().flat_map(|row| row[0].split(", ").map(|name| (name.trim_matches('`'), row[1].trim_matches('`'))));
    names.filter(|(name, _)| *name != "…").collect()
}

fn examples() -> BTreeMap<&'static str, Value> {
    let row = |row: &Vec<&'static str>| {
        let json = row[1].trim_matches('`');
        (row[0].trim_matches('`'), serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {json}")))
    };
    rows("| variable | JSON |").iter().map(row).collect()
}

#[test]
fn every_variable_has_an_example_that_is_a_value_of_its_type() {
    let (variables, examples) = (variables(), examples());
    assert!(variables.len() > 20, "{variables:?}");
    for (name, says) in &variables {
        let is_pattern = name.contains('…') || *name == "NAME_STATUS" || *name == "SCAN_1";
        assert!(is_pattern || examples.contains_key(name), "the guide has no JSON of {name}");
        let carried = keys::carried_by(name);
        assert!(is_pattern || carried.unwrap_or(says) == *says, "{name} carries {carried:?}, the guide says {says}");
    }
    for (name, json) in &examples {
        match (keys::carried_by(name).and_then(samples::named), variables[name]) {
            (Some(carried), _) => {
                let description = carried.type_.description().unwrap();
                let bytes = description.to_bytes(json).unwrap_or_else(|error| panic!("{name}: {error}"));
                carried
                    .check(&bytes)
                    .unwrap_or_else(|error| panic!("nobody would believe the guide's {name}: {error}"));
            }
            (None, "text") => assert!(json.is_string(), "{name}: {json}"),
            (None, "number") => assert!(json.is_f64(), "{name}: {json}"),
            (None, other) => panic!("elk knows no {other}, which the guide says {name} is"),
        }
    }
}

/// The Rust files in a folder, and in those in it.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in folder.read_dir().unwrap().flatten().map(|entry| entry.path()) {
        if entry.is_dir() {
            sources(&entry, found);
        } else if entry.extension().is_some_and(|end| end == "rs") {
            found.push(entry);
        }
    }
}

/// Names in capitals that a line makes a key or a text of.
fn named(line: &str) -> Option<&str> {
    let declared = line.trim_start().trim_start_matches("pub(crate) ").trim_start_matches("pub ");
    let (_, behind) = declared.strip_prefix("const ")?.split_once(" = ")?;
    let name = behind.strip_prefix("Key::new(\"").or(behind.strip_prefix('"'))?.split('"').next()?;
    let is_name = name.len() > 2 && name.chars().all(|c| c.is_ascii_uppercase() || c == '_') && !name.starts_with('_');
    is_name.then_some(name)
}

#[test]
fn every_variable_that_the_code_names_is_in_the_guide() {
    /// Names of other things: the environment's, and a word of MOOS' logs.
    const OTHERS: [&str; 2] = ["ELK_", "MOOS_BINARY"];
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    for folder in ["apps", "bus"] {
        sources(&root.join(folder), &mut files);
    }
    let is_of_a_crate = |file: &&PathBuf| file.components().any(|step| step.as_os_str() == "src");
    let texts: Vec<String> =
        files.iter().filter(is_of_a_crate).map(|file| std::fs::read_to_string(file).unwrap()).collect();
    // What stands behind the tests' head is theirs.
    let code = texts.iter().map(|text| text.split("#[cfg(test)]").next().unwrap_or_default());
    let mut names: Vec<&str> = code.flat_map(|code| code.lines().filter_map(named)).collect();
    keys::names().for_each(|name| names.push(name));
    assert!(names.len() > 20, "{names:?}");
    let variables = variables();
    for name in names.iter().filter(|name| !OTHERS.iter().any(|other| name.starts_with(other))) {
        assert!(variables.contains_key(name) || name.starts_with("DB_"), "the guide's table has no {name}");
    }
}
