//! Scenario 5, 6×8×2 m: an apartment of four rooms. Corner at the origin; south is −y.

use crate::scenery::furniture::{Back, Opening, Wall};
use crate::scenery::{Scenery, Solid};

const CEILING: f64 = 2.0;
const DOOR: f64 = 1.85;
const SHELF_BOARDS: [f64; 4] = [0.42, 0.84, 1.26, 1.66];

pub fn build() -> Scenery {
    let mut s = Scenery::within(Solid::block("apartment", [0.0; 3], [6.0, 8.0, CEILING]));
    walls(&mut s);
    living_room(&mut s);
    bedroom(&mut s);
    kitchen(&mut s);
    bathroom(&mut s);
    s
}

fn walls(s: &mut Scenery) {
    let door = |from, to| Opening::door(from, to, DOOR);
    let wall = |along, faces, span| Wall { along, faces, span, height: CEILING };
    s.wall("middle-wall", wall(0, [3.9, 4.0], [0.0, 6.0]), &[door(1.0, 1.9), door(4.2, 5.1)]);
    s.wall("south-wall", wall(1, [2.9, 3.0], [0.0, 3.9]), &[door(2.7, 3.6)]);
    s.wall("north-wall", wall(1, [3.3, 3.4], [4.0, 8.0]), &[door(5.6, 6.5)]);
}

/// South-west.
fn living_room(s: &mut Scenery) {
    s.sofa("sofa", [0.0, 0.8], [0.85, 1.8], Back::West);
    s.table("coffee-table", [1.3, 1.2], [0.6, 0.9], 0.45);
    s.round("vase", [1.6, 1.6], 0.08, 0.45, 0.3);
    s.shelf("bookshelf", [1.5, 0.0], [1.4, 0.35], 1.66, Back::South, &SHELF_BOARDS);
    s.block("books", [1.54, 0.04, 0.42], [1.94, 0.3, 0.8]);
    s.block("more-books", [2.46, 0.04, 0.84], [2.86, 0.3, 1.22]);
    s.block("sideboard", [2.5, 0.9, 0.0], [2.9, 2.3, 0.45]);
    s.block("television", [2.82, 1.1, 0.45], [2.9, 2.1, 1.1]);
    s.block("planter", [0.0, 3.5, 0.0], [0.4, 3.9, 0.4]);
    s.block("plant", [0.0, 3.55, 0.4], [0.35, 3.9, 1.1]);
    s.hanging_lamp("living-lamp", [1.5, 2.6], 1.5, CEILING);
}

/// South-east.
fn bedroom(s: &mut Scenery) {
    s.bed("bed", [4.0, 0.0], [2.0, 1.4], Back::East);
    s.block("nightstand", [5.6, 1.4, 0.0], [6.0, 1.8, 0.5]);
    s.block("night-lamp", [5.85, 1.4, 0.5], [6.0, 1.6, 0.85]);
    s.block("wardrobe", [3.0, 0.0, 0.0], [3.6, 1.4, CEILING]);
    s.table("desk", [5.3, 2.7], [0.7, 1.2], 0.74);
    s.block("monitor", [5.9, 3.1, 0.74], [6.0, 3.6, 1.2]);
    s.block("papers", [5.35, 2.75, 0.74], [5.6, 3.0, 0.88]);
    s.chair("desk-chair", [4.45, 2.75], Back::West);
}

/// North-west.
fn kitchen(s: &mut Scenery) {
    s.block("counter", [0.0, 7.4, 0.0], [2.6, 8.0, 0.9]);
    s.block("fridge", [2.6, 7.35, 0.0], [3.3, 8.0, 1.65]);
    s.block("wall-cabinet", [0.0, 7.65, 1.4], [1.6, 8.0, CEILING]);
    s.block("microwave", [0.0, 7.6, 0.9], [0.5, 8.0, 1.08]);
    s.block("kettle", [2.0, 7.8, 0.9], [2.2, 8.0, 1.15]);
    s.block("broom-cupboard", [0.0, 4.0, 0.0], [0.5, 4.6, CEILING]);
    s.table("dining-table", [1.2, 5.2], [1.2, 0.8], 0.75);
    s.chair("north-chair", [1.4, 6.35], Back::North);
    s.chair("south-chair", [2.0, 4.4], Back::South);
    s.round("bowl", [1.6, 5.6], 0.14, 0.75, 0.1);
    s.round("bottle", [2.15, 5.5], 0.05, 0.75, 0.3);
    s.hanging_lamp("kitchen-lamp", [1.8, 5.6], 1.4, CEILING);
}

/// North-east.
fn bathroom(s: &mut Scenery) {
    s.block("bathtub", [4.4, 7.2, 0.0], [6.0, 8.0, 0.55]);
    s.block("washbasin", [5.5, 6.0, 0.0], [6.0, 6.6, 0.85]);
    s.block("tap", [5.88, 6.25, 0.85], [6.0, 6.35, 1.05]);
    s.block("mirror", [5.94, 6.0, 1.36], [6.0, 6.6, 1.7]);
    s.block("toilet", [5.4, 4.9, 0.0], [6.0, 5.3, 0.42]);
    s.block("cistern", [5.8, 4.9, 0.42], [6.0, 5.3, 0.85]);
    s.block("washing-machine", [3.4, 7.4, 0.0], [4.0, 8.0, 0.85]);
    s.block("laundry", [3.4, 7.6, 0.85], [3.8, 8.0, 1.1]);
    s.shelf("towel-shelf", [3.4, 4.0], [0.35, 1.1], 1.66, Back::West, &SHELF_BOARDS);
    s.block("towels", [3.44, 4.04, 0.84], [3.72, 4.4, 1.22]);
}
