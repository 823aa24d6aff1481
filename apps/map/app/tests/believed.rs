//! What a map is told and does not believe: said to be wrong, and the next right word taken.

mod common;

use std::path::Path;
use std::time::Duration;

use elk_bus::{Mail, Rejection};
use elk_map::{MapConfig, OccupancyMap};
use elk_spatial::checks::MAX_REVISIONS_AHEAD;
use elk_spatial::keys::{MAP, MAP_CONFIDENCE, MAP_MEMORY, MAP_UPDATE};
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::MapMemory;
use nalgebra::Point3;

use common::Stage;

/// A map that has said what it begins with.
fn stage(folder: &Path) -> Stage {
    let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
    map.insert(Point3::new(0.05, 0.05, 0.05), [Point3::new(0.25, 0.05, 0.05)]);
    let mut stage = Stage::new(folder, &map, &[], "MAP_*");
    updates(&mut stage);
    stage
}

/// Lets the map do what it can; the updates that it says.
fn updates(stage: &mut Stage) -> Vec<MapUpdate> {
    while stage.give() > 0 {}
    let mut heard = Vec::new();
    let note = |mail: &Mail<'_>| heard.extend(mail.is(&MAP_UPDATE).then(|| mail.decode(&MAP_UPDATE).unwrap()));
    stage.others.receive(Duration::ZERO, note).unwrap();
    heard
}

/// Why the map passes over what has come for it.
fn rejection(stage: &mut Stage) -> String {
    let failure = stage.try_give().unwrap_err();
    assert!(failure.is::<Rejection>(), "{failure}");
    failure.to_string()
}

/// A map that has lost what it knew and asks others for it, and what it had said.
fn asking(folder: &Path) -> (Stage, MapUpdate) {
    let mut stage = stage(folder);
    stage.scan(1, 0.3);
    let said = updates(&mut stage);
    stage.exchange();
    assert_eq!(updates(&mut stage), [], "it has nothing to say");
    (stage, MapUpdate { since: 0, ..said[0].clone() })
}

#[test]
fn a_confidence_that_is_no_probability_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut stage = stage(folder.path());
    for wrong in [0.3, 1.0, -1.0, 1e300, f64::NAN, f64::INFINITY] {
        stage.others.comms.notify(MAP_CONFIDENCE, wrong).unwrap();
        let said = rejection(&mut stage);
        assert!(said.contains("right is 0, or a probability of 0.5 to less than 1"), "{said}");
    }
    stage.others.comms.notify(MAP_CONFIDENCE, 0.9).unwrap();
    stage.scan(1, 0.3);
    assert_eq!(updates(&mut stage).len(), 1);
}

#[test]
fn a_copy_from_far_ahead_is_not_taken_for_the_map_that_was() {
    let folder = tempfile::tempdir().unwrap();
    let (mut stage, copy) = asking(folder.path());
    let far = MapUpdate { revision: copy.revision + MAX_REVISIONS_AHEAD + 1, ..copy.clone() };
    stage.others.comms.publish(&MAP, &far).unwrap();
    let said = rejection(&mut stage);
    assert!(said.contains("is more than 1000 above 2"), "{said}");
    stage.others.comms.publish(&MAP, &copy).unwrap();
    stage.scan(2, 0.3);
    let said = updates(&mut stage);
    assert_eq!(said.iter().map(|update| update.revision).collect::<Vec<_>>(), [copy.revision + 1]);
}

#[test]
fn only_so_many_scans_wait_for_a_map_that_is_not_there_yet() {
    let folder = tempfile::tempdir().unwrap();
    let (mut stage, copy) = asking(folder.path());
    // The latest one comes to every map that starts, and waits as well.
    (2..257).for_each(|id| stage.scan(id, 0.3));
    while stage.give() > 0 {}
    stage.scan(257, 0.3);
    let said = rejection(&mut stage);
    assert!(said.contains("too many scans wait for it already"), "{said}");
    stage.others.comms.publish(&MAP, &copy).unwrap();
    assert_eq!(updates(&mut stage).len(), 255, "those that waited and are not in it");
}

/// Whoever makes up a memory of a map that has never been is contradicted by all who know of the map.
#[test]
fn a_memory_of_which_nobody_else_has_heard_is_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let mut stage = stage(folder.path());
    stage.scan(1, 0.3);
    let said = updates(&mut stage);
    stage.stop();
    let mut left: Option<MapMemory> = None;
    let note = |mail: &Mail<'_>| left = mail.decode(&MAP_MEMORY).ok().or(left.take());
    stage.others.receive(Duration::ZERO, note).unwrap();
    let lie = MapMemory { revision: 1 << 40, ..left.unwrap() };
    stage.others.comms.publish(&MAP_MEMORY, &lie).unwrap();
    stage.others.comms.flush().unwrap();
    stage.exchange();
    assert_eq!(updates(&mut stage), []);
    stage.others.comms.publish(&MAP, &MapUpdate { since: 0, ..said[0].clone() }).unwrap();
    stage.scan(2, 0.3);
    assert_eq!(updates(&mut stage).iter().map(|update| update.revision).collect::<Vec<_>>(), [3]);
}
