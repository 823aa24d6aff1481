//! Copies of a map that is said whole in parts, over a bus on which messages are lost, readers come and go, maps die, and
//! anybody may lie: what is known in the end is the map.

use elk_geometry::state::BrickStates;
use elk_geometry::{OccupancyGrid, State, Voxel};
use elk_spatial::Replica;
use elk_spatial::keyframe::{MapPart, Round};
use elk_spatial::map::MapUpdate;
use proptest::prelude::*;

const MOST_BRICKS: usize = 500;
/// Bricks of a part.
const PART: usize = 4;

#[derive(Debug, Clone)]
enum Said {
    Update(MapUpdate),
    Part(MapPart),
}

/// A map that says its parts as the map on the bus does, one between two scans.
struct Map {
    grid: OccupancyGrid,
    scan: u64,
    next: u64,
    round: Option<Round>,
    parts: usize,
}

impl Map {
    fn new() -> Self {
        Self { grid: OccupancyGrid::new(0.1), scan: 0, next: 0, round: None, parts: 0 }
    }

    fn scan(&mut self, voxels: &[(Voxel, State)]) -> Said {
        let changed: Vec<Voxel> = voxels.iter().filter(|(v, state)| self.grid.set(*v, *state)).map(|v| v.0).collect();
        self.scan += 1;
        Said::Update(MapUpdate::new(self.grid.advance(&changed), self.scan))
    }

    fn ask(&mut self) {
        self.round = Some(Round::from(self.next));
    }

    fn part(&mut self) -> Option<Said> {
        let round = self.round.as_mut()?;
        let part = MapPart::of(&self.grid, self.scan, round.next() as usize, PART);
        let over = round.take(&part);
        (self.next, self.parts) = (round.next(), self.parts + 1);
        self.round = self.round.filter(|_| !over);
        Some(Said::Part(part))
    }

    /// Another one in its place, that has its map from a copy, and asks nobody who waited.
    fn die(&mut self, copy: &Replica) {
        let Some(whole) = copy.copy_of(0.0) else { return };
        let mut grid = OccupancyGrid::new(0.1);
        grid.apply(&whole.delta()).unwrap();
        *self = Self { grid, scan: whole.scan, parts: self.parts, ..Self::new() };
        self.ask();
    }
}

fn hear(reader: &mut Replica, said: &Said) -> bool {
    // What does not fit is passed over.
    let _ = match said {
        Said::Update(update) => reader.take(update),
        Said::Part(part) => reader.take_part(part),
    };
    reader.take_question()
}

fn new_reader() -> Replica {
    Replica::new(Some(0.1), MOST_BRICKS)
}

fn cells(grid: &OccupancyGrid) -> Vec<BrickStates> {
    let mut bricks = grid.whole().bricks.into_owned();
    bricks.retain(|brick| brick.unpack() != Default::default());
    bricks.sort_by_key(|brick| brick.brick);
    bricks
}

fn is_copy(map: &Map, reader: &Replica) -> bool {
    let revisions = map.grid.revision() == reader.grid().revision() && map.scan == reader.scan();
    revisions && !reader.is_doubtful() && cells(&map.grid) == cells(reader.grid())
}

/// One scan and, after it, what is due of the whole map; until all have it and nobody asks. The scans that took.
fn settle(map: &mut Map, readers: &mut [Replica]) -> usize {
    for scans in 1..400 {
        let mut said = vec![map.scan(&[(Voxel::new(scans % 7, 0, 0), State::Free)])];
        said.extend(map.part());
        let asked =
            said.iter().flat_map(|said| readers.iter_mut().map(|r| hear(r, said)).collect::<Vec<_>>()).filter(|a| *a);
        if asked.count() > 0 {
            map.ask();
        }
        if map.round.is_none() && readers.iter().all(|reader| is_copy(map, reader)) {
            return scans as usize;
        }
    }
    panic!("they do not come to know the map");
}

/// What may happen.
#[derive(Debug, Clone)]
enum Event {
    Scan(Vec<(Voxel, State)>),
    Part,
    /// The reader does not hear the next message.
    Loss(usize),
    Ask,
    Come(usize),
    Die(usize),
    /// Somebody says a part again that was said, changed so.
    Lie {
        bricks: Option<u8>,
        first: u64,
        revision: u64,
        total: u64,
    },
    /// Somebody says an update of his own.
    Update(u64, Vec<(Voxel, State)>),
}

fn voxels() -> impl Strategy<Value = Vec<(Voxel, State)>> {
    let state = prop_oneof![Just(State::Unknown), Just(State::Free), Just(State::Occupied)];
    let voxel = prop::array::uniform3(-20..20i32).prop_map(Voxel::from);
    prop::collection::vec((voxel, state), 0..9)
}

fn event() -> impl Strategy<Value = Event> {
    let lie = (prop::option::of(0..3u8), 0..3u64, 0..3u64, 0..3u64);
    prop_oneof![
        4 => voxels().prop_map(Event::Scan),
        4 => Just(Event::Part),
        2 => (0..3usize).prop_map(Event::Loss),
        1 => Just(Event::Ask),
        1 => (0..3usize).prop_map(Event::Come),
        1 => (0..3usize).prop_map(Event::Die),
        1 => lie.prop_map(|(bricks, first, revision, total)| Event::Lie { bricks, first, revision, total }),
        1 => (0..3u64, voxels()).prop_map(|(ahead, voxels)| Event::Update(ahead, voxels)),
    ]
}

fn lie(about: &MapPart, (bricks, first, revision, total): (Option<u8>, u64, u64, u64)) -> MapPart {
    let mut lie = about.clone();
    lie.first = (lie.first + 4 * first).min(lie.total);
    lie.revision += revision;
    lie.total = (lie.first + lie.bricks.len() as u64).max(lie.total + total) - total.min(1);
    lie.total = lie.total.max(lie.first + lie.bricks.len() as u64);
    if let (Some(cells), Some(brick)) = (bricks, lie.bricks.first_mut()) {
        brick.cells = vec![[0x00, 0x55, 0xaa][usize::from(cells)]; BrickStates::BYTES];
    }
    lie
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]
    /// Whatever is lost, said twice or made up, whoever comes or dies: when that is over, all have the map. (Of a map that dies
    /// while a reader believes a lie, the lie may be what is left: where somebody lies here, no map dies. And an update that
    /// somebody says in the place of one that a reader has lost is contradicted by nothing: where updates are made up, none is lost.)
    #[test]
    fn all_come_to_know_the_map(events in prop::collection::vec(event(), 0..80)) {
        let (mut map, mut readers) = (Map::new(), [new_reader(), new_reader(), new_reader()]);
        let (mut deaf, mut last) = ([false; 3], None);
        let lies = events.iter().any(|event| matches!(event, Event::Lie { .. } | Event::Update(..)));
        let updates = events.iter().any(|event| matches!(event, Event::Update(..)));
        for event in events {
            let said = match event {
                Event::Scan(voxels) => Some(map.scan(&voxels)),
                Event::Part => map.part(),
                Event::Loss(_) if updates => None,
                Event::Loss(reader) => { deaf[reader] = true; None }
                Event::Ask => { map.ask(); None }
                Event::Come(reader) => { readers[reader] = new_reader(); None }
                Event::Die(_) if lies => None,
                Event::Die(reader) => { map.die(&readers[reader]); None }
                Event::Lie { bricks, first, revision, total } => {
                    last.as_ref().map(|part| Said::Part(lie(part, (bricks, first, revision, total))))
                }
                Event::Update(ahead, voxels) => {
                    let mut liar = Map { grid: map.grid.clone(), ..Map::new() };
                    liar.scan = map.scan;
                    liar.grid.skip_to(map.grid.revision() + ahead);
                    Some(liar.scan(&voxels))
                }
            };
            let Some(said) = said else { continue };
            if let Said::Part(part) = &said {
                last = Some(part.clone());
            }
            for (reader, deaf) in readers.iter_mut().zip(&mut deaf) {
                if !std::mem::take(deaf) && hear(reader, &said) {
                    map.ask();
                }
            }
        }
        settle(&mut map, &mut readers);
    }
}

/// A map of so many bricks in a row, and a reader that knows it.
fn known(bricks: i32) -> (Map, Replica) {
    let (mut map, mut reader) = (Map::new(), new_reader());
    let update = map.scan(&(0..bricks).map(|x| (Voxel::new(8 * x, 0, 0), State::Free)).collect::<Vec<_>>());
    assert!(!hear(&mut reader, &update), "the first update says all there is");
    assert!(is_copy(&map, &reader));
    (map, reader)
}

/// Says all parts that are due, with a scan after each; how often the readers asked.
fn say_all(map: &mut Map, readers: &mut [&mut Replica]) -> usize {
    let mut asked = 0;
    while let Some(part) = map.part() {
        let x = map.scan as i32;
        for said in [part, map.scan(&[(Voxel::new(x, 1, 1), State::Free)])] {
            let questions = readers.iter_mut().map(|reader| usize::from(hear(reader, &said))).sum::<usize>();
            if questions > 0 {
                map.ask();
            }
            asked += questions;
        }
    }
    asked
}

#[test]
fn a_reader_that_missed_an_update_has_the_map_after_one_round_beside_the_updates() {
    let (mut map, mut reader) = known(30);
    let before = cells(reader.grid());
    map.scan(&[(Voxel::new(3, 3, 3), State::Occupied)]);
    assert!(hear(&mut reader, &map.scan(&[])), "it asks");
    map.ask();
    let first = map.part().unwrap();
    assert!(
        !hear(&mut reader, &first) && cells(reader.grid()) == before,
        "what it knows is as it was until all is here"
    );
    assert_eq!(say_all(&mut map, &mut [&mut reader]), 0);
    assert!(is_copy(&map, &reader));
    assert_eq!(map.parts, 30usize.div_ceil(PART) + 1, "the first one closes the round");
}

#[test]
fn who_asks_in_the_middle_of_a_round_needs_no_other_round() {
    let (mut map, mut early) = known(40);
    map.scan(&[]);
    assert!(hear(&mut early, &map.scan(&[])));
    map.ask();
    for _ in 0..5 {
        assert!(!hear(&mut early, &map.part().unwrap()));
    }
    let (mut late, update) = (new_reader(), map.scan(&[]));
    assert!(!hear(&mut early, &update) && hear(&mut late, &update));
    map.ask();
    assert_eq!(say_all(&mut map, &mut [&mut early, &mut late]), 0);
    assert!(is_copy(&map, &early) && is_copy(&map, &late));
    assert_eq!(map.parts, 16, "five were heard by the one alone, and one closes the round");
}

#[test]
fn a_lost_part_is_noticed_by_the_next_and_a_lost_last_one_by_the_updates() {
    for lost in [2, 8] {
        let (mut map, mut reader) = known(32);
        map.scan(&[]);
        assert!(hear(&mut reader, &map.scan(&[])));
        map.ask();
        let mut asked = false;
        for part in 0..9 {
            let part = (part, map.part().unwrap());
            asked |= part.0 != lost && hear(&mut reader, &part.1);
        }
        assert_eq!((asked, map.round), (lost == 2, None));
        let mut updates = 0;
        while !asked {
            asked = hear(&mut reader, &map.scan(&[]));
            updates += 1;
        }
        assert!(updates <= 16);
        map.ask();
        // Of the round before it had all but the last part, which the new round does not begin with.
        assert_eq!(say_all(&mut map, &mut [&mut reader]), usize::from(lost == 8));
        assert!(is_copy(&map, &reader));
    }
}

/// Regression: a controller that was started anew went back to the last map that had been said whole, in one part, before the
/// scan that it had heard of already, and its mission stood still.
#[test]
fn a_reader_does_not_go_back_to_a_map_that_was_said_before_what_it_knows() {
    let (mut map, mut reader) = known(PART as i32);
    map.ask();
    let before = map.part().unwrap();
    assert!(!hear(&mut reader, &map.scan(&[(Voxel::new(3, 3, 3), State::Free)])));
    assert!(hear(&mut reader, &before), "whether it is a map that goes on from there, only the map can say");
    assert_eq!((reader.grid().revision(), cells(reader.grid())), (2, cells(&map.grid)));
    map.ask();
    assert_eq!(say_all(&mut map, &mut [&mut reader]), 0);
    assert!(is_copy(&map, &reader));
}

/// A brick that only somebody else has said, in a message that nothing contradicted, lasts until the map is said whole.
#[test]
fn a_brick_that_the_map_does_not_have_is_found_out_by_a_round() {
    let (mut map, mut reader) = known(8);
    map.scan(&[]);
    assert!(hear(&mut reader, &map.scan(&[])), "it has lost an update, and asks");
    map.ask();
    assert!(!hear(&mut reader, &map.part().unwrap()));
    let mut liar = Map { grid: map.grid.clone(), ..Map::new() };
    liar.scan = map.scan;
    hear(&mut reader, &liar.scan(&[(Voxel::new(0, 80, 0), State::Free)]));
    // What is true in its place is lost.
    map.scan(&[]);
    assert!(say_all(&mut map, &mut [&mut reader]) >= 1);
    assert!(is_copy(&map, &reader));
}

#[test]
fn a_part_that_lies_does_not_last() {
    let spoil = |part: &Said| {
        let Said::Part(part) = part else { unreachable!() };
        Said::Part(lie(part, (Some(2), 0, 0, 0)))
    };
    // Before the part in whose place it stands: the first, one in the middle, the last one, and the first again.
    for at in [0, 3, 7, 8] {
        let (mut map, mut reader) = known(32);
        map.scan(&[]);
        assert!(hear(&mut reader, &map.scan(&[])));
        map.ask();
        let mut asked = 0;
        for i in 0.. {
            let Some(part) = map.part() else { break };
            if i == at {
                asked += usize::from(hear(&mut reader, &spoil(&part)));
            }
            if hear(&mut reader, &part) {
                asked += 1;
                map.ask();
            }
        }
        assert!((1..=2).contains(&asked), "asked again {asked} times, at {at}");
        assert!(is_copy(&map, &reader), "{at}");
    }
}

/// Regression: the last part of a round said something else of bricks that other parts had.
#[test]
fn a_last_part_that_lies_about_others_does_not_last() {
    let (mut map, mut reader) = known(32);
    map.scan(&[]);
    assert!(hear(&mut reader, &map.scan(&[])));
    map.ask();
    let parts: Vec<Said> = (0..8).filter_map(|_| map.part()).collect();
    assert!(!parts[..7].iter().any(|part| hear(&mut reader, part)));
    let [Said::Part(first), Said::Part(last)] = [&parts[0], &parts[7]] else { unreachable!() };
    let mut lying = last.clone();
    lying.bricks[0] = BrickStates { cells: vec![0xaa; BrickStates::BYTES], ..first.bricks[0].clone() };
    // With all that the true one has.
    lying.bricks.push(last.bricks[0].clone());
    lying.total += 1;
    assert!(!hear(&mut reader, &Said::Part(lying)) && !is_copy(&map, &reader));
    assert!(hear(&mut reader, &parts[7]));
    map.ask();
    say_all(&mut map, &mut [&mut reader]);
    assert!(is_copy(&map, &reader));
}

/// Whoever knows the map is not disturbed by an answer to others, and learns from it that what it knows is wrong.
#[test]
fn an_answer_to_others_is_held_against_what_is_known() {
    let (mut map, mut reader) = known(32);
    map.ask();
    assert_eq!(say_all(&mut map, &mut [&mut reader]), 0);
    assert!(is_copy(&map, &reader));
    let mut liar = Map { grid: map.grid.clone(), ..Map::new() };
    liar.scan = map.scan;
    let said = liar.scan(&[(Voxel::new(200, 0, 0), State::Occupied)]);
    assert!(!hear(&mut reader, &said), "it continues what is known");
    assert!(hear(&mut reader, &map.scan(&[])), "another one of that revision");
    map.ask();
    say_all(&mut map, &mut [&mut reader]);
    assert!(is_copy(&map, &reader));
    map.grid.set(Voxel::new(0, 0, 0), State::Occupied);
    let part = Said::Part(MapPart::of(&map.grid, map.scan, 0, PART));
    assert!(hear(&mut reader, &part), "what is known of this brick is wrong");
    assert!(reader.is_doubtful());
    map.ask();
    say_all(&mut map, &mut [&mut reader]);
    assert!(is_copy(&map, &reader));
}

#[test]
fn what_is_far_ahead_too_large_or_of_other_voxels_is_refused() {
    let (map, mut reader) = known(8);
    let part = MapPart::of(&map.grid, map.scan, 0, PART);
    assert!(reader.take_part(&MapPart { revision: 1_000_000, ..part.clone() }).is_err());
    assert!(reader.take_part(&MapPart { total: 501, ..part.clone() }).is_err());
    assert!(reader.take_part(&MapPart { resolution: 0.2, ..part }).is_err());
}
