//! The map as a process that is asked for all of it: in parts, between scans, to readers that come, miss something and die.

mod common;

use std::path::Path;
use std::time::Duration;

use elk_bus::Mail;
use elk_geometry::{OccupancyGrid, State, Voxel};
use elk_map::{MapConfig, OccupancyMap};
use elk_spatial::Replica;
use elk_spatial::keyframe::MapPart;
use elk_spatial::keys::{MAP, MAP_PART, MAP_REQUEST, MAP_UPDATE};
use elk_spatial::map::MapUpdate;

use common::Stage;

const MAX_BRICKS: usize = 65536;
/// Bricks of the map that it begins with: more than three parts.
const BRICKS: i32 = 7000;

/// A large map, and how many scans it was given.
struct Bench {
    stage: Stage,
    scans: u64,
}

/// What the map says, in order.
#[derive(Debug)]
enum Said {
    Update(MapUpdate),
    Part(MapPart),
    Whole(MapUpdate),
    Recall(f64),
}

impl Bench {
    fn new(folder: &Path) -> Self {
        let config = MapConfig { max_bricks: MAX_BRICKS, ..MapConfig::default() };
        let mut grid = OccupancyGrid::new(config.resolution);
        for brick in 0..BRICKS {
            grid.set(Voxel::new(8 * (brick % 90), 8 * (brick / 90), 80), State::Free);
        }
        grid.skip_to(1);
        let map = OccupancyMap::from_states(config, &grid.whole()).unwrap();
        Self { stage: Stage::new(folder, &map, &[("MaxBricks", MAX_BRICKS.to_string())], "MAP*"), scans: 0 }
    }

    /// Lets the map do what it can with the mail that is there now; what it says.
    fn turn(&mut self) -> Vec<Said> {
        self.stage.give();
        let mut said = Vec::new();
        let note = |mail: &Mail<'_>| {
            if mail.source() != "Map" {
                return;
            }
            said.extend(match mail.key() {
                "MAP_UPDATE" => Some(Said::Update(mail.decode(&MAP_UPDATE).unwrap())),
                "MAP_PART" => Some(Said::Part(mail.decode(&MAP_PART).unwrap())),
                "MAP" => Some(Said::Whole(mail.decode(&MAP).unwrap())),
                "MAP_RECALL" => Some(Said::Recall(mail.as_double().unwrap())),
                _ => None,
            });
        };
        self.stage.others.receive(Duration::ZERO, note).unwrap();
        said
    }

    /// As [`Bench::turn`], until the map has nothing more to say; `readers` hear it, and answer and ask as apps do.
    fn rest(&mut self, readers: &mut [&mut Replica]) -> Vec<Said> {
        let mut all = Vec::new();
        let mut silent = 0;
        while silent < 3 {
            let said = self.turn();
            silent = if said.is_empty() { silent + 1 } else { 0 };
            for said in &said {
                readers.iter_mut().for_each(|reader| self.tell(reader, said));
            }
            all.extend(said);
        }
        all
    }

    fn tell(&mut self, reader: &mut Replica, said: &Said) {
        match said {
            Said::Update(update) | Said::Whole(update) => drop(reader.take(update).unwrap()),
            Said::Part(part) => drop(reader.take_part(part).unwrap()),
            Said::Recall(revision) => reader.answer(&mut self.stage.others.comms, *revision).unwrap(),
        }
        if reader.take_question() {
            self.ask();
        }
    }

    fn ask(&mut self) {
        self.stage.others.comms.notify(MAP_REQUEST, 1.0).unwrap();
    }

    fn scan(&mut self) {
        self.scans += 1;
        self.stage.scan(self.scans, 0.3 + 0.1 * self.scans as f32);
    }
}

fn reader() -> Replica {
    Replica::new(Some(0.1), MAX_BRICKS)
}

fn parts(said: &[Said]) -> Vec<(u64, u64, usize)> {
    let of = |said: &Said| match said {
        Said::Part(part) => Some((part.revision, part.first, part.bricks.len())),
        _ => None,
    };
    said.iter().filter_map(of).collect()
}

/// What the map leaves when it stops is what the readers have.
fn is_copied(bench: &mut Bench, readers: &[&Replica]) {
    bench.stage.stop();
    let said = bench.turn();
    let Some(Said::Whole(mut whole)) = said.into_iter().rev().find(|said| matches!(said, Said::Whole(_))) else {
        panic!("a map that stops leaves all of it")
    };
    whole.bricks.sort_by_key(|brick| brick.brick);
    for reader in readers {
        let mut copy = reader.copy_of(0.0).unwrap();
        copy.bricks.sort_by_key(|brick| brick.brick);
        assert!(copy == whole, "revisions {} and {}", copy.revision, whole.revision);
    }
}

#[test]
fn between_two_scans_there_is_one_part_however_many_ask() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new(folder.path());
    bench.rest(&mut []);
    let mut late = reader();
    // Scans that wait already do not wait for the answer: the next part is said behind them.
    (0..8).for_each(|_| bench.ask());
    (0..3).for_each(|_| bench.scan());
    let said = bench.turn();
    let order: Vec<&str> =
        said.iter().map(|said| if matches!(said, Said::Part(_)) { "part" } else { "update" }).collect();
    assert_eq!(order, ["part", "update", "update", "update"]);
    said.iter().for_each(|said| bench.tell(&mut late, said));
    let mut rest = Vec::new();
    for _ in 0..4 {
        bench.scan();
        let said = bench.turn();
        assert!(parts(&said).len() <= 1);
        said.iter().for_each(|said| bench.tell(&mut late, said));
        rest.extend(said);
    }
    rest.extend(bench.rest(&mut [&mut late]));
    let firsts: Vec<u64> = parts(&said).iter().chain(&parts(&rest)).map(|(_, first, _)| *first).collect();
    assert_eq!(firsts[..5], [0, 2048, 4096, 6144, 0], "one round for all eight");
    assert!(
        firsts.len() <= 7,
        "and what is left of another one for who noticed after two parts that an update was missing"
    );
    is_copied(&mut bench, &[&late]);
}

#[test]
fn a_small_map_is_not_said_as_often_as_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new(folder.path());
    bench.stage.settings.clear();
    bench.stage.exchange();
    bench.rest(&mut []);
    bench.scan();
    bench.rest(&mut []);
    (0..8).for_each(|_| bench.ask());
    bench.scan();
    assert_eq!(parts(&bench.turn()).len(), 1);
    assert_eq!(parts(&bench.rest(&mut [])).len(), 1, "once more for who asked after it was said");
}

#[test]
fn an_answer_needs_no_scan_to_go_on_and_ends() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new(folder.path());
    let (mut ready, mut late) = (reader(), reader());
    bench.rest(&mut [&mut ready]);
    bench.ask();
    let said = bench.rest(&mut [&mut ready, &mut late]);
    assert_eq!(parts(&said), [(1, 0, 2048), (1, 2048, 2048), (1, 4096, 2048), (1, 6144, 856), (1, 0, 2048)]);
    assert_eq!((late.grid().revision(), late.grid().free()), (1, BRICKS as usize));
    bench.ask();
    assert_eq!(parts(&bench.rest(&mut [])).len(), 5, "whoever asks again has it again");
    is_copied(&mut bench, &[&ready, &late]);
}

#[test]
fn who_asks_in_the_middle_of_an_answer_is_whole_after_one_round_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new(folder.path());
    bench.rest(&mut []);
    let (mut early, mut late) = (reader(), reader());
    bench.ask();
    for _ in 0..2 {
        let said = bench.turn();
        said.iter().for_each(|said| bench.tell(&mut early, said));
    }
    bench.ask();
    bench.scan();
    let said = bench.rest(&mut [&mut early, &mut late]);
    assert!(parts(&said).len() <= 7, "{:?}", parts(&said));
    is_copied(&mut bench, &[&early, &late]);
}

/// What the map was about to say died with it; its successor has the map from a copy, and says it all.
#[test]
fn a_map_that_is_killed_in_the_middle_leaves_nobody_waiting() {
    let folder = tempfile::tempdir().unwrap();
    for scans in [0, 2] {
        let mut bench = Bench::new(folder.path());
        let (mut ready, mut late) = (reader(), reader());
        bench.rest(&mut [&mut ready]);
        (0..scans).for_each(|_| bench.scan());
        bench.rest(&mut [&mut ready]);
        bench.ask();
        let said = bench.turn();
        assert_eq!(parts(&said).len(), 1);
        said.iter().for_each(|said| bench.tell(&mut late, said));
        bench.stage.exchange();
        bench.rest(&mut [&mut ready, &mut late]);
        bench.scan();
        bench.rest(&mut [&mut ready, &mut late]);
        assert_eq!(late.grid().revision(), scans + 2);
        is_copied(&mut bench, &[&ready, &late]);
    }
}

/// Parts of somebody else's neither drive the map nor last.
#[test]
fn a_part_of_somebody_elses_is_no_part_of_the_answer() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new(folder.path());
    bench.rest(&mut []);
    let mut late = reader();
    bench.ask();
    let said = bench.turn();
    let Some(Said::Part(first)) = said.first() else { panic!("it answers") };
    bench.tell(&mut late, &said[0]);
    // It is the next one, but that it says something else.
    let lie = MapPart { first: 2048, bricks: first.bricks.iter().rev().cloned().collect(), ..first.clone() };
    bench.stage.others.comms.publish(&MAP_PART, &lie).unwrap();
    bench.tell(&mut late, &Said::Part(lie));
    let said = bench.turn();
    assert!(parts(&said).len() <= 1);
    said.iter().for_each(|said| bench.tell(&mut late, said));
    bench.scan();
    bench.rest(&mut [&mut late]);
    is_copied(&mut bench, &[&late]);
}
