//! The map as a process that begins with a saved one: what it says of it, and that what a predecessor left goes before it.

mod common;

use std::path::Path;
use std::time::Duration;

use elk_bus::Mail;
use elk_map::{Format, MapConfig, OccupancyMap, Saved};
use elk_spatial::keys::{MAP, MAP_UPDATE};
use elk_spatial::map::MapUpdate;
use nalgebra::Point3;

use common::Stage;

/// A map that knows three voxels.
fn known() -> OccupancyMap {
    let mut map = OccupancyMap::new(MapConfig::default()).unwrap();
    map.insert(Point3::new(0.05, 0.05, 0.05), [Point3::new(0.25, 0.05, 0.05)]);
    map
}

fn stage(folder: &Path) -> Stage {
    Stage::new(folder, &known(), &[], "MAP_*")
}

fn stage_of(file: &Path) -> Stage {
    Stage::of(file, &[], "MAP_*")
}

/// Lets the map do what it can; the updates that it says.
fn updates(stage: &mut Stage) -> Vec<MapUpdate> {
    while stage.give() > 0 {}
    let mut heard = Vec::new();
    let note = |mail: &Mail<'_>| heard.extend(mail.is(&MAP_UPDATE).then(|| mail.decode(&MAP_UPDATE).unwrap()));
    stage.others.receive(Duration::ZERO, note).unwrap();
    heard
}

/// The same, each by its revision, the one that it continues, and its scan.
fn steps(stage: &mut Stage) -> Vec<(u64, u64, u64)> {
    updates(stage).iter().map(|update| (update.revision, update.since, update.scan)).collect()
}

#[test]
fn a_saved_map_is_said_whole_before_the_first_scan_which_then_continues_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = stage(folder.path());
    let said = updates(&mut bench);
    let right = MapUpdate::new(restored().grid().whole(), 0);
    assert_eq!(said, [right]);
    assert_eq!((said[0].revision, said[0].since), (1, 0));
    bench.scan(1, 0.3);
    assert_eq!(steps(&mut bench), [(2, 1, 1)]);
}

/// One that is killed has said the saved map; its successor has it from the file, and need not ask.
#[test]
fn a_successor_of_a_map_that_saw_nothing_goes_on_from_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = stage(folder.path());
    assert_eq!(updates(&mut bench).len(), 1);
    bench.exchange();
    bench.scan(1, 0.3);
    assert_eq!(steps(&mut bench), [(2, 1, 1)]);
}

#[test]
fn what_a_predecessor_left_goes_before_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = stage(folder.path());
    bench.scan(1, 0.3);
    assert_eq!(updates(&mut bench).len(), 2);
    bench.stop();
    bench.exchange();
    assert_eq!(updates(&mut bench), [], "nothing is new");
    bench.scan(2, 0.3);
    assert_eq!(steps(&mut bench), [(3, 2, 2)]);
}

#[test]
fn a_successor_needs_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = stage(folder.path());
    bench.scan(1, 0.3);
    assert_eq!(updates(&mut bench).len(), 2);
    bench.stop();
    std::fs::remove_file(folder.path().join("known.elkmap")).unwrap();
    bench.exchange();
    bench.scan(2, 0.3);
    assert_eq!(steps(&mut bench), [(3, 2, 2)]);
}

/// One that is killed leaves no memory, and its readers have what it said of the file.
#[test]
fn without_memory_and_without_file_a_successor_asks_its_readers() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = stage(folder.path());
    let said = updates(&mut bench);
    std::fs::remove_file(folder.path().join("known.elkmap")).unwrap();
    bench.exchange();
    assert_eq!(updates(&mut bench), [], "it has nothing to say");
    bench.others.comms.publish(&MAP, &said[0]).unwrap();
    bench.scan(1, 0.3);
    assert_eq!(steps(&mut bench), [(2, 1, 1)]);
}

#[test]
fn the_first_map_needs_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("known.elkmap");
    let mut bench = stage(folder.path());
    std::fs::remove_file(&file).unwrap();
    let error = bench.try_give().unwrap_err().to_string();
    assert!(error.contains(&format!("From: there is no file {}", file.display())), "{error}");
    std::fs::create_dir(&file).unwrap();
    let error = stage_of(&file).try_give().unwrap_err().to_string();
    assert!(error.contains(&format!("From: {} is a folder; right is a file", file.display())), "{error}");
}

#[test]
fn a_file_that_does_not_serve_is_said_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.graph");
    let said = |bytes: &[u8], settings: &[(&str, String)]| {
        std::fs::write(&file, bytes).unwrap();
        Stage::of(&file, settings, "MAP_*").try_give().unwrap_err().to_string()
    };
    let graph = [&3u32.to_le_bytes()[..], &1u32.to_le_bytes(), &3u32.to_le_bytes(), &[0; 99]].concat();
    let graph = said(&graph, &[]);
    let right = format!(
        "it is a .graph of OctoMap's, which holds scans and no map: make a map of them, and take that \
         (elk mapfile convert {} -o MAP.elkmap --res METRES)",
        file.display()
    );
    assert!(graph.contains(&right), "{graph}");
    let mut large = OccupancyMap::new(MapConfig::default()).unwrap();
    large.insert(Point3::new(0.05, 0.05, 0.05), [Point3::new(79.95, 0.05, 0.05)]);
    let few = [("MaxBricks", "64".to_owned())];
    for format in [Format::ElkMap, Format::Ot, Format::Bt] {
        let said = said(&format.write(&large), &few);
        assert!(said.contains("it has 100 bricks of 8x8x8 voxels, and 64 are the most"), "{said}");
        assert!(said.contains("set MaxBricks to 100 or more, of the explorer as well"), "{said}");
    }
}

/// What goes on from the file.
fn restored() -> OccupancyMap {
    OccupancyMap::from_saved(MapConfig::default(), &Saved::read(&Format::ElkMap.write(&known())).unwrap()).unwrap()
}
