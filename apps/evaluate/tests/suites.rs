//! The suites that elk comes with: each is one, and all that it asks for is there.

mod common;

use std::path::Path;

use common::{read, registry};
use elk_evaluate::{Evaluation, Missions, Suite};

/// Worlds that do not come with elk are a failure of their runs, not of their suite.
#[test]
fn all_that_a_suite_asks_for_is_there() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mission-files/suites");
    let mut suites = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let file = entry.unwrap().path();
        let text = std::fs::read_to_string(&file).unwrap();
        let suite = Suite::parse(&text, &file).unwrap_or_else(|error| panic!("{error}"));
        assert!(!suite.about.is_empty(), "{} says what it is for", file.display());
        let missions = Missions { registry: registry(&[]), load: Box::new(read) };
        Evaluation::new(suite, missions, "test").unwrap_or_else(|error| panic!("{error}"));
        suites += 1;
    }
    assert!(suites > 0, "{} has none", folder.display());
}
