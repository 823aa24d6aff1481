//! A building of as many rooms as are wanted: wings side by side, each a corridor with rooms on both sides, and a cross
//! corridor that joins the wings. Doors and furniture are drawn by a seed.

use elk_geometry::{Bounds, Pose};
use nalgebra::{Point3, Vector3};

use super::solid::OFF_LATTICE;
use super::{Scenery, Solid};
use elk_geometry::random::Random;

/// Edge of a room (m).
const ROOM: f64 = 3.4;
/// Thickness of a wall (m).
const WALL: f64 = 0.2;
/// Width of a corridor (m).
const CORRIDOR: f64 = 1.6;
/// Height of rooms and corridors (m).
const CEILING: f64 = 2.4;
/// Width and height of a door (m).
const DOOR: [f64; 2] = [0.9, 2.0];
/// Rooms on one side of a wing, at most.
const COLUMNS: usize = 10;

/// From one room of a row to the next (m).
const ALONG: f64 = ROOM + WALL;
/// From one wing to the next (m).
const ACROSS: f64 = 2.0 * ROOM + CORRIDOR + 3.0 * WALL;
/// Where the rooms of a wing begin (m).
const FIRST: f64 = CORRIDOR + WALL;

/// A building, as boxes.
#[derive(Debug, Clone)]
pub struct Building {
    wings: usize,
    /// Rooms on one side of a wing.
    columns: usize,
    blocks: Vec<(String, Bounds)>,
}

impl Building {
    /// The building of at least so many rooms that belongs to a seed: all wings have as many.
    pub fn new(rooms: usize, seed: u64) -> Self {
        let wings = rooms.div_ceil(2 * COLUMNS).max(1);
        let columns = rooms.div_ceil(2 * wings).max(1);
        let mut building = Self { wings, columns, blocks: Vec::new() };
        (0..wings).for_each(|wing| building.build_wing(wing));
        (0..building.rooms()).for_each(|room| building.build_room(room, &mut Random::new(seed, room as u64)));
        building
    }

    /// Number of rooms.
    pub fn rooms(&self) -> usize {
        2 * self.columns * self.wings
    }

    /// The place (wing, column, side) of a room: those of a wing follow each other along its corridor.
    fn place(&self, room: usize) -> (usize, usize, usize) {
        (room / (2 * self.columns), room / 2 % self.columns, room % 2)
    }

    /// Corners of a room's floor (m): x and y of the smaller, and of the larger one.
    fn floor(&self, room: usize) -> [[f64; 2]; 2] {
        let (wing, column, side) = self.place(room);
        let x = FIRST + column as f64 * ALONG;
        let y = wing as f64 * ACROSS + side as f64 * (ROOM + CORRIDOR + 2.0 * WALL);
        [[x, y], [x + ROOM, y + ROOM]]
    }

    /// The box that all of it is in (m, world).
    pub fn extents(&self) -> Bounds {
        let dim = [FIRST + self.columns as f64 * ALONG, self.wings as f64 * ACROSS, CEILING];
        placed([0.0; 3], dim)
    }

    /// The walls and the furniture (m, world): what is in the extents and in none of them is free.
    pub fn blocks(&self) -> impl Iterator<Item = Bounds> {
        self.blocks.iter().map(|(_, block)| placed(block.min.into(), block.max.into()))
    }

    /// Which room a place (m, world) belongs to, with its walls and its part of the corridor; of what the building does not
    /// have, as if it had.
    pub fn room_at(&self, place: Point3<f64>) -> usize {
        let place = place - OFF_LATTICE;
        let along = |c: f64, pitch: f64| (c / pitch).floor().max(0.0);
        let (wing, column) = (along(place.y, ACROSS), along(place.x - FIRST, ALONG).min(self.columns as f64 - 1.0));
        let side = usize::from(place.y - wing * ACROSS > ROOM + WALL + CORRIDOR / 2.0);
        (wing as usize * self.columns + column as usize) * 2 + side
    }

    /// The middle of the corridor before a room (m, world), as a robot stands there that looks along it.
    pub fn before(&self, room: usize) -> Pose {
        let (wing, ..) = self.place(room);
        let [[x, _], [to, _]] = self.floor(room);
        let y = wing as f64 * ACROSS + ROOM + WALL + CORRIDOR / 2.0;
        Pose::from_yaw_pitch(Point3::new((x + to) / 2.0, y, CEILING / 2.0) + OFF_LATTICE, 0.0, 0.0)
    }

    /// As a world.
    pub fn scenery(&self) -> Scenery {
        let extents = self.extents();
        let mut scenery =
            Scenery::within(Solid::block("building", [0.0; 3], (extents.max - OFF_LATTICE).coords.into()));
        self.blocks.iter().for_each(|(name, block)| scenery.block(name, block.min.into(), block.max.into()));
        scenery
    }

    fn add(&mut self, name: String, min: [f64; 3], max: [f64; 3]) {
        self.blocks.push((name, Bounds { min: min.into(), max: max.into() }));
    }

    /// What parts a wing from the cross corridor.
    fn build_wing(&mut self, wing: usize) {
        let y = wing as f64 * ACROSS;
        let south = y + ROOM + WALL;
        self.add(format!("wing-{wing}-south"), [CORRIDOR, y, 0.0], [FIRST, south, CEILING]);
        self.add(format!("wing-{wing}-north"), [CORRIDOR, south + CORRIDOR, 0.0], [FIRST, y + ACROSS, CEILING]);
    }

    /// A room's walls to the corridor and to the next room, and what is in it.
    fn build_room(&mut self, room: usize, random: &mut Random) {
        let [[x, y], [to, _]] = self.floor(room);
        let wall = if is_south(room) { [y + ROOM, y + ROOM + WALL] } else { [y - WALL, y] };
        let door = x + random.between(0.3, ROOM - DOOR[0] - 0.3);
        let mut piece = |name: &str, [from, to]: [f64; 2], low: f64| {
            self.add(format!("room-{room}-{name}"), [from, wall[0], low], [to, wall[1], CEILING]);
        };
        piece("wall", [x, door], 0.0);
        piece("wall", [door + DOOR[0], to], 0.0);
        piece("lintel", [door, door + DOOR[0]], DOOR[1]);
        let [low, high] = if is_south(room) { [y, wall[1]] } else { [wall[0], y + ROOM] };
        self.add(format!("room-{room}-end"), [to, low, 0.0], [to + WALL, high, CEILING]);
        if !is_south(room) {
            // To the next wing.
            self.add(format!("room-{room}-back"), [x, y + ROOM, 0.0], [to + WALL, y + ROOM + WALL, CEILING]);
        }
        self.furnish(room, random);
    }

    /// A cupboard, a bench and a table, away from the door's wall.
    fn furnish(&mut self, room: usize, random: &mut Random) {
        let [[x, y], [to, _]] = self.floor(room);
        // Depth is counted from the wall that faces the door's.
        let mut put = |name: &str, [from, to]: [f64; 2], [near, far]: [f64; 2], [low, high]: [f64; 2]| {
            let (a, b) = if is_south(room) { (y + near, y + far) } else { (y + ROOM - far, y + ROOM - near) };
            self.add(format!("room-{room}-{name}"), [from, a, low], [to, b, high]);
        };
        let (width, height) = (random.between(0.8, 1.2), random.between(1.2, 2.1));
        let bench = random.between(0.9, 1.3);
        put("cupboard", [x, x + width], [0.0, random.between(0.35, 0.5)], [0.0, height]);
        put("bench", [to - bench, to], [0.0, random.between(0.35, 0.45)], [0.0, 0.45]);
        let table = x + random.between(0.9, 1.3);
        put("table", [table, table + 1.2], [1.1, 1.8], [0.7, 0.76]);
        put("leg", [table + 0.5, table + 0.7], [1.35, 1.55], [0.0, 0.7]);
    }
}

/// Whether a room lies south of its wing's corridor.
fn is_south(room: usize) -> bool {
    room.is_multiple_of(2)
}

/// The box between two corners of the plan (m), in the world.
fn placed(min: [f64; 3], max: [f64; 3]) -> Bounds {
    let shift = |corner: [f64; 3]| Point3::from(Vector3::from(corner) + OFF_LATTICE);
    Bounds { min: shift(min), max: shift(max) }
}
