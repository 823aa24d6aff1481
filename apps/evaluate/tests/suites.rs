//! The suites that come with elk: what they say is right, mission by mission.

mod common;

use std::path::{Path, PathBuf};

use common::{read, registry};
use elk_evaluate::{Evaluation, Missions, Suite};

fn suites() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mission-files/suites");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut suites: Vec<PathBuf> = files.filter(|file| file.extension().is_some_and(|end| end == "xml")).collect();
    suites.sort();
    suites
}

#[test]
fn every_suite_that_comes_with_elk_is_right() {
    let suites = suites();
    assert!(suites.len() >= 9, "{suites:?}");
    for file in suites {
        let suite = Suite::load(&file).unwrap_or_else(|error| panic!("{error}"));
        let stem = file.file_stem().unwrap().to_string_lossy();
        assert!(suite.name == stem && !suite.about.is_empty(), "{stem}");
        let missions = Missions { registry: registry(&[]), load: Box::new(read) };
        Evaluation::new(suite, missions, "test")
            .map(drop)
            .unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    }
}

/// What is published stands beside the row that it is of, or by itself.
#[test]
fn what_is_published_is_of_strategies_by_their_names() {
    let mut references = 0;
    for file in suites() {
        let suite = Suite::load(&file).unwrap();
        for reference in suite.worlds.iter().flat_map(|world| &world.references) {
            let named = suite.strategies.iter().any(|strategy| strategy.name == reference.strategy);
            assert!(named && !reference.source.is_empty(), "{}: {reference:?}", file.display());
            references += 1;
        }
    }
    assert!(references > 60, "{references}");
}
