//! `elk new`: a crate of one's own that builds, runs and is tested.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};

use crate::terminal::say;

/// What is to be made.
#[derive(Debug, Args)]
pub struct NewArgs {
    /// `app`: any app on the bus; `explorer`: a strategy of one's own; `sensor`: a depth source of one's own
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
    Sensor,
}

impl Kind {
    /// What the template calls the type that is to be named after the crate.
    fn placeholder(self) -> &'static str {
        match self {
            Self::App => "Hello",
            Self::Explorer => "Level",
            Self::Sensor => "Hall",
        }
    }

    /// The template of `src/main.rs`.
    fn code(self) -> String {
        match self {
            Self::App => APP.to_owned(),
            // The examples are programs themselves: their own names stand where other templates have NAME.
            Self::Explorer => filled(EXPLORER, &[("level", "NAME")]) + EXPLORER_TESTS,
            Self::Sensor => filled(SENSOR, &[("hall", "NAME")]) + SENSOR_TESTS,
        }
    }
}

/// Where this program was built; it may be gone by now.
const CHECKOUT: &str = env!("CARGO_MANIFEST_DIR");

const CARGO_TOML: &str = include_str!("new/Cargo.toml.txt");
const APP: &str = include_str!("new/app.rs.txt");
const APP_MISSION: &str = include_str!("new/app.xml.txt");
/// The example of the explorer's documentation is what a strategy begins with.
const EXPLORER: &str = elk_explorer::EXAMPLE;
const EXPLORER_TESTS: &str = include_str!("new/explorer_tests.rs.txt");
const EXPLORER_MISSION: &str = include_str!("new/explorer.xml.txt");
/// The example of the sensor's documentation is what a depth source begins with.
const SENSOR: &str = elk_sensor::EXAMPLE;
const SENSOR_TESTS: &str = include_str!("new/sensor_tests.rs.txt");
const SENSOR_MISSION: &str = include_str!("new/sensor.xml.txt");

/// `elk new`
pub fn new(arguments: &NewArgs) -> Result<ExitCode> {
    let NewArgs { kind, name, path } = arguments;
    check_name(*kind, name)?;
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
    let (crate_name, library, mission) = match kind {
        Kind::App => ("elk-bus", "bus", APP_MISSION),
        Kind::Explorer => ("elk-explorer", "apps/explorer", EXPLORER_MISSION),
        Kind::Sensor => ("elk-sensor", "apps/sensor", SENSOR_MISSION),
    };
    let of = |name: &str, library| format!("{name} = {}", dependency(checkout, library));
    // `#[payload]`, of which a strategy's memory is, or a message of a sensor's own, names `elk-bus`.
    let bus = (kind != Kind::App).then(|| of("elk-bus", "bus"));
    let dependency = bus.into_iter().chain([of(crate_name, library)]).collect::<Vec<_>>().join("\n");
    let words = [("NAME", name), (kind.placeholder(), &camel(name)), ("DEPENDENCY", &dependency)];
    [
        ("Cargo.toml", filled(CARGO_TOML, &words)),
        ("src/main.rs", filled(&kind.code(), &words)),
        ("mission.xml", filled(mission, &words)),
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
    ["bus", "apps/explorer", "apps/sensor"].iter().all(|one| folder.join(one).join("Cargo.toml").is_file())
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

/// A template with its words exchanged, each for what stands beside it: whole words only, and what was put in is not looked
/// at again.
fn filled(template: &str, words: &[(&str, &str)]) -> String {
    let parts = template.split_inclusive(|c: char| !is_of_word(c));
    let exchanged = parts.map(|part| {
        let (word, behind) = part.split_at(part.trim_end_matches(|c| !is_of_word(c)).len());
        let anew = words.iter().find(|(from, _)| *from == word).map_or(word, |(_, to)| to);
        format!("{anew}{behind}")
    });
    exchanged.collect()
}

fn is_of_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Words of Rust that begin types, and those of its prelude.
const PRELUDE: &str = "Self Copy Send Sized Sync Unpin Drop Fn FnMut FnOnce AsyncFn AsyncFnMut AsyncFnOnce Box ToOwned Clone \
    PartialEq PartialOrd Eq Ord AsRef AsMut Into From Default Iterator Extend IntoIterator DoubleEndedIterator \
    ExactSizeIterator Option Some None Result Ok Err String ToString Vec TryFrom TryInto FromIterator Future IntoFuture Debug \
    Hash";

/// Names that Rust or Cargo keep for themselves, or that elk has.
const TAKEN: &str = "abstract as async await become box break const continue crate do dyn else enum extern false final fn for \
    gen if impl in let loop macro match mod move mut override priv pub ref return self static struct super trait true try type \
    typeof unsafe unsized use virtual where while yield test core std alloc proc_macro build deps examples incremental elk";

/// Whether the code of a template has this word, so that a type of this name would be mistaken for what it means there.
fn says(template: &str, word: &str) -> bool {
    let code = template.lines().filter(|line| !line.trim_start().starts_with("//"));
    // What stands between quotes is no code.
    let mut code = code.flat_map(|line| line.split('"').step_by(2));
    code.any(|part| part.split(|c| !is_of_word(c)).any(|one| one == word))
}

fn check_name(kind: Kind, name: &str) -> Result<()> {
    let is_edge = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit();
    let is_good = |c: char| is_edge(c) || "-_".contains(c);
    let begins_well = name.starts_with(|c: char| c.is_ascii_lowercase());
    if !begins_well || !name.ends_with(is_edge) || !name.chars().all(is_good) || name.len() > 64 {
        bail!(
            "{name:?} is no name for a crate; right are up to 64 of a-z, 0-9, - and _, a letter first and none of - and _ \
             last: my-explorer"
        );
    }
    let (as_crate, as_type) = (name.replace('-', "_"), camel(name));
    let is_one_of = |words: &str, word: &str| words.split_whitespace().any(|one| one == word);
    let is_in_template = as_type != kind.placeholder() && says(&kind.code(), &as_type);
    let is_taken = is_one_of(TAKEN, &as_crate) || is_one_of(PRELUDE, &as_type) || as_crate.starts_with("elk_");
    if is_taken || is_in_template {
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
        let is_right =
            |name: &str| [Kind::App, Kind::Explorer, Kind::Sensor].map(|kind| check_name(kind, name).is_ok());
        for right in
            ["mine", "my-app", "a1", "hello", "hello-me", "level", "level-headed", "name", "an", "metres", "car"]
        {
            assert_eq!(is_right(right), [true; 3], "{right}");
        }
        let of_shape = ["", "Mine", "1a", "a b", "../a", "-a", "a-", "self-", "ä", "a.b", "a/b", "a\nb", "a\"b"];
        let of_rust =
            ["fn", "self", "test", "core", "std", "alloc", "proc-macro", "gen", "try", "crate", "option", "vec"];
        let of_more_rust = ["result", "send", "to-string", "clone", "fn-once", "debug", "default", "box"];
        let of_cargo = ["build", "deps", "examples", "incremental"];
        let of_elk = ["elk", "elk-bus", "elk_bus", "elk-explorer"];
        for wrong in [&of_shape[..], &of_rust, &of_more_rust, &of_cargo, &of_elk].concat() {
            assert_eq!(is_right(wrong), [false; 3], "{wrong}");
        }
        for of_app in
            ["app", "app-error", "comms", "failure", "key", "mail", "run-options", "greeted", "atomic-bool", "client"]
        {
            assert!(check_name(Kind::App, of_app).is_err(), "{of_app}");
        }
        for of_explorer in ["journal", "kind", "param-spec", "route", "strategy", "view", "room"] {
            assert!(check_name(Kind::Explorer, of_explorer).is_err(), "{of_explorer}");
        }
        for of_sensor in ["camera", "capture", "depth-source", "pose", "seen"] {
            assert!(check_name(Kind::Sensor, of_sensor).is_err(), "{of_sensor}");
        }
    }

    #[test]
    fn every_word_of_the_code_that_could_be_a_type_is_no_name() {
        for kind in [Kind::App, Kind::Explorer, Kind::Sensor] {
            let code = kind.code();
            let is_type = |word: &&str| word.starts_with(|c: char| c.is_ascii_uppercase()) && says(&code, word);
            let types: std::collections::BTreeSet<&str> = code.split(|c| !is_of_word(c)).filter(is_type).collect();
            assert!(types.len() > 8, "{types:?}");
            for word in types.iter().filter(|word| **word != kind.placeholder()) {
                // AppError is made of app-error.
                let name: String = word
                    .chars()
                    .map(
                        |c| if c.is_ascii_uppercase() { format!("-{}", c.to_ascii_lowercase()) } else { c.to_string() },
                    )
                    .collect();
                assert!(check_name(kind, name.trim_start_matches('-')).is_err(), "{name}");
            }
        }
    }

    #[test]
    fn a_name_is_put_in_once_and_only_where_it_belongs() {
        let words = [("NAME", "level"), ("Hello", "HelloMe"), ("level", "NAME")];
        let filled = filled("Hello: NAME, RENAME NAME_2 level/Hello(Hellos) höllo\n", &words);
        assert_eq!(filled, "HelloMe: level, RENAME NAME_2 NAME/HelloMe(Hellos) höllo\n");
        let [(_, manifest), (_, main), (_, mission), _] = files(Kind::App, "hello-level-name", Path::new(CHECKOUT));
        assert!(
            manifest.contains("name = \"hello-level-name\"\n") && manifest.contains("elk-bus = { path ="),
            "{manifest}"
        );
        assert!(main.contains("struct HelloLevelName {") && !main.contains("NameName"), "{main}");
        assert!(mission.contains("exec=\"./target/release/hello-level-name\""), "{mission}");
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
