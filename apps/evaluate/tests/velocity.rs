//! Robots that take their time, and robots that stay at their height, evaluated as any other: what they come to is complete, and
//! they touch nothing.

mod common;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use common::{read, registry};
use elk_evaluate::store::{Row, Store};
use elk_evaluate::{End, Evaluation, Missions, Suite};

/// The rows of a suite, without what they took of the processor.
fn rows(text: &str) -> Vec<Row> {
    let suite = Suite::parse(text, Path::new("../../mission-files/suites/velocity.xml")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let evaluation =
        Evaluation::new(suite.clone(), Missions { registry: registry(&[]), load: Box::new(read) }, "test").unwrap();
    let finished = evaluation.run(folder.path(), (2, &Arc::new(AtomicBool::new(false))), |_| {}).unwrap();
    assert_eq!(finished.done, finished.all);
    let asked = std::fs::read_to_string(folder.path().join("suite.txt")).unwrap();
    let (_, mut kept) = Store::open(folder.path(), &suite, &asked).unwrap();
    kept.values_mut().for_each(|row| row.outcome.times = Default::default());
    kept.into_values().collect()
}

/// A suite of a coarse kitchen in which all this is said otherwise, one world each, and of these strategies.
fn suite(worlds: &[&str], strategies: &[&str]) -> String {
    let coarse = r#"Map.Res="0.25" Explorer.Res="0.25" Sensor.Width="48" Sensor.Height="48" Explorer.Patience="20""#;
    let worlds = worlds.iter().enumerate();
    let worlds = worlds.map(|(n, more)| format!(r#"<World name="{n}" file="kitchen" {coarse} {more}/>"#));
    let explorers = strategies.iter().map(|name| format!(r#"<Explorer type="{name}"/>"#));
    let all: String = worlds.chain(explorers).collect();
    format!(r#"<Suite name="velocity" seed="3" starts="1"><Limits scans="1000"/>{all}</Suite>"#)
}

/// All complete, and nothing touched.
fn explored(rows: &[Row]) {
    let failed: Vec<&Row> =
        rows.iter().filter(|row| row.outcome.end != End::Complete || row.outcome.contacts > 0).collect();
    assert!(failed.is_empty(), "{failed:#?}");
}

#[test]
fn robots_that_take_their_time_explore_without_a_contact_and_say_how_long_it_takes() {
    let wheels = r#"Controller.type="Velocity" Controller.LateralSpeed="0""#;
    let text = suite(&[r#"Controller.type="Velocity""#, wheels], &["ClosestFrontier", "Tour"]);
    let driven = rows(&text);
    assert_eq!(driven.len(), 4);
    explored(&driven);
    assert!(driven[0].start.is_some());
    for Row { case, start, outcome } in &driven {
        assert_eq!(*start, driven[0].start, "{case:?}");
        assert!(outcome.travel_secs.is_some_and(|secs| secs > outcome.way_m / 0.5), "{case:?} {outcome:?}");
    }
    assert_eq!(driven, rows(&text), "the same again");
}

/// On the ground plane (thesis 6.5.4), with each of the strategies.
#[test]
fn robots_that_stay_at_their_height_explore_its_slice_of_the_map() {
    let ground =
        r#"Explorer.Planar="true" Controller.type="Velocity" Controller.LateralSpeed="0" Controller.VerticalSpeed="0""#;
    let strategies = [
        "ClosestFrontier",
        "Potential",
        "Tour",
        "Random",
        "InformationGain",
        "WeightedInformationGain",
        "RecedingHorizon",
    ];
    let level = rows(&suite(&[ground], &strategies));
    assert_eq!(level.len(), strategies.len());
    explored(&level);
    for Row { case, outcome, .. } in &level {
        assert!(outcome.reason.contains("explored was the slice of the map at z = "), "{case:?} {outcome:?}");
        assert!(outcome.way_m > 3.0 && (0.3..1.0).contains(&outcome.coverage), "{case:?} {outcome:?}");
    }
}
