//! `elk new`: a crate of one's own that builds, runs and is tested.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};

use crate::commands::say;

/// What is to be made.
#[derive(Debug, Args)]
pub struct NewArgs {
    /// `app`: any app on the bus; `explorer`: a strategy of one's own
    kind: Kind,
    /// Its name: the crate's, and the program's
    name: String,
    /// Its folder; the name, in the working directory, if not said
    #[arg(long, value_name = "DIR")]
    path: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    App,
    Explorer,
}

/// Where this program was built; it may be gone by now.
const CHECKOUT: &str = env!("CARGO_MANIFEST_DIR");

const CARGO_TOML: &str = include_str!("new/Cargo.toml.txt");
const APP: &str = include_str!("new/app.rs.txt");
const APP_MISSION: &str = include_str!("new/app.xml.txt");
/// The example of the explorer's documentation is what a strategy begins with.
const EXPLORER: &str = include_str!("../explorer/examples/level.rs");
const EXPLORER_TESTS: &str = include_str!("new/explorer_tests.rs.txt");
const EXPLORER_MISSION: &str = include_str!("new/explorer.xml.txt");

/// `elk new`
pub fn new(arguments: &NewArgs) -> Result<ExitCode> {
    let NewArgs { kind, name, path } = arguments;
    check_name(name)?;
    let folder = path.clone().unwrap_or_else(|| name.into());
    let folder = folder.as_path();
    if folder.read_dir().is_ok_and(|mut entries| entries.next().is_some()) {
        bail!("{} is there already, and not empty; right is a new folder: --path DIR", folder.display());
    }
    let checkout = Path::new(CHECKOUT);
    for (file, text) in files(*kind, name, checkout) {
        put(&folder.join(file), &text)?;
    }
    // The same versions as elk itself was built with.
    let locked = checkout.join("Cargo.lock");
    if is_checkout(checkout) && locked.is_file() {
        std::fs::copy(&locked, folder.join("Cargo.lock"))
            .with_context(|| format!("cannot copy {}", locked.display()))?;
    }
    say(&format!(
        "{name} is in {0}. From there:\n  cargo test\n  cargo build --release\n  elk launch mission.xml\n",
        folder.display()
    ))?;
    Ok(ExitCode::SUCCESS)
}

fn put(file: &Path, text: &str) -> Result<()> {
    elk_outside::file::write(file, text.as_bytes()).with_context(|| format!("cannot write {}", file.display()))
}

/// The files of a new crate, and what is in them.
fn files(kind: Kind, name: &str, checkout: &Path) -> [(&'static str, String); 4] {
    let (library, main, mission) = match kind {
        Kind::App => ("bus", APP.to_owned(), APP_MISSION),
        Kind::Explorer => ("apps/explorer", format!("{EXPLORER}{EXPLORER_TESTS}"), EXPLORER_MISSION),
    };
    let (crate_name, dependency) = match kind {
        Kind::App => ("elk-bus", dependency(checkout, library)),
        Kind::Explorer => ("elk-explorer", dependency(checkout, library)),
    };
    let manifest = CARGO_TOML.replace("NAME", name).replace("DEPENDENCY", &format!("{crate_name} = {dependency}"));
    let type_name = camel(name);
    let main = main
        .replace("Level", &type_name)
        .replace("Hello", &type_name)
        .replace("release/level", &format!("release/{name}"));
    [
        ("Cargo.toml", manifest),
        ("src/main.rs", main.replace("NAME", name)),
        ("mission.xml", mission.replace("NAME", name)),
        (".gitignore", "/target\n/logs\n".to_owned()),
    ]
}

/// A crate of elk's by its path, where elk was built from a checkout that is still there; else by its version.
fn dependency(checkout: &Path, library: &str) -> String {
    match is_checkout(checkout) {
        true => format!("{{ path = {:?} }}", checkout.join(library).display().to_string()),
        false => format!("{:?}", env!("CARGO_PKG_VERSION")),
    }
}

fn is_checkout(folder: &Path) -> bool {
    ["bus", "apps/explorer"].iter().all(|one| folder.join(one).join("Cargo.toml").is_file())
}

/// `my-explorer` is `MyExplorer` as a type.
fn camel(name: &str) -> String {
    let words = name.split(['-', '_']).filter(|word| !word.is_empty());
    words
        .map(|word| {
            let (first, rest) = word.split_at(1);
            first.to_ascii_uppercase() + rest
        })
        .collect()
}

/// Names that Rust or Cargo keep for themselves, or that the crate's own code already uses.
const TAKEN: [&str; 57] = [
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate", "do", "dyn", "else",
    "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in", "let", "loop", "macro", "match", "mod",
    "move", "mut", "override", "priv", "pub", "ref", "return", "self", "static", "struct", "super", "trait", "true",
    "try", "type", "typeof", "unsafe", "unsized", "use", "virtual", "where", "while", "yield", "test", "core", "std",
    "alloc", "build", "deps",
];

/// Names of types that the templates use, as they would be made of a crate's name.
const TYPES: [&str; 14] = [
    "App", "Comms", "Mail", "Key", "Failure", "Strategy", "View", "Route", "Journal", "Kind", "Room", "Greeted",
    "Option", "String",
];

fn check_name(name: &str) -> Result<()> {
    let begins_well = name.starts_with(|c: char| c.is_ascii_lowercase());
    let good = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "-_".contains(c);
    if !begins_well || !name.chars().all(good) || name.len() > 64 {
        bail!("{name:?} is no name for a crate; right are up to 64 of a-z, 0-9, - and _, a letter first: my-explorer");
    }
    if TAKEN.contains(&name) || TYPES.contains(&camel(name).as_str()) || name.starts_with("elk-") {
        bail!("{name} is taken by Rust, Cargo or elk itself; another name is right, for example my-{name}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_makes_a_crate_and_a_type() {
        assert_eq!(camel("my-own_explorer2"), "MyOwnExplorer2");
        for right in ["mine", "my-app", "a1"] {
            check_name(right).unwrap();
        }
        for wrong in ["", "Mine", "1a", "a b", "../a", "fn", "test", "view", "elk-bus", "-a", "ä"] {
            assert!(check_name(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn who_has_no_checkout_any_more_depends_on_a_version() {
        let gone = dependency(Path::new("/nowhere"), "bus");
        assert_eq!(gone, format!("{:?}", env!("CARGO_PKG_VERSION")));
        assert!(dependency(Path::new(CHECKOUT), "bus").starts_with("{ path = \"/"));
    }

    #[test]
    fn a_strategy_takes_at_most_thirty_lines() {
        assert!(EXPLORER.lines().count() <= 30, "{}", EXPLORER.lines().count());
        let [_, (_, main), ..] = files(Kind::Explorer, "near-first", Path::new(CHECKOUT));
        assert!(main.contains("struct NearFirst {") && main.contains("exec=./target/release/near-first"), "{main}");
        assert!(!main.contains("Level") && !main.contains("NAME"), "{main}");
    }
}
