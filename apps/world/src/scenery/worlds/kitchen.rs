//! Scenario 3, 8×8×3 m: a kitchen with an island, and a dining corner behind a partition. Corner at the origin; south is −y.

use crate::scenery::furniture::{Back, Opening, Wall};
use crate::scenery::{Scenery, Solid};

const CEILING: f64 = 3.0;
const COUNTER: f64 = 0.9;

pub fn build() -> Scenery {
    let mut s = Scenery::within(Solid::block("kitchen", [0.0; 3], [8.0, 8.0, CEILING]));
    counters(&mut s);
    island(&mut s);
    partition(&mut s);
    dining_corner(&mut s);
    east_side(&mut s);
    s
}

fn counters(s: &mut Scenery) {
    s.block("south-counter", [0.0, 0.0, 0.0], [4.5, 0.65, COUNTER]);
    s.block("west-counter", [0.0, 0.65, 0.0], [0.65, 4.0, COUNTER]);
    s.block("fridge", [4.5, 0.0, 0.0], [5.3, 0.75, 2.0]);
    s.block("oven-tower", [5.3, 0.0, 0.0], [6.0, 0.65, 2.2]);
    s.block("south-cabinet", [0.0, 0.0, 1.5], [2.0, 0.38, 2.4]);
    s.block("west-cabinet", [0.0, 1.2, 1.5], [0.38, 3.4, 2.4]);
    s.block("hood", [2.6, 0.0, 1.7], [3.5, 0.5, 2.0]);
    s.block("duct", [2.9, 0.0, 2.0], [3.2, 0.3, CEILING]);
    s.block("toaster", [1.0, 0.0, COUNTER], [1.3, 0.2, 1.1]);
    s.block("coffee-machine", [0.0, 2.0, COUNTER], [0.35, 2.3, 1.2]);
    s.round("pot", [3.05, 0.43], 0.1, COUNTER, 0.2);
}

fn island(s: &mut Scenery) {
    let top = COUNTER + 0.04;
    s.block("island", [2.6, 2.6, 0.0], [4.6, 3.6, COUNTER]);
    s.block("island-top", [2.4, 2.5, COUNTER], [4.8, 3.9, top]);
    s.round("fruit-bowl", [3.0, 3.1], 0.15, top, 0.12);
    s.block("knife-block", [4.0, 3.0, top], [4.2, 3.2, top + 0.25]);
    for x in [3.0, 4.1] {
        s.round_table("stool", [x, 4.5], 0.2, 0.65);
        s.hanging_lamp("island-lamp", [x + 0.1, 3.2], 1.9, CEILING);
    }
}

/// Leaves the west end open; a door and a hatch besides.
fn partition(s: &mut Scenery) {
    let wall = Wall { along: 0, faces: [5.2, 5.3], span: [3.0, 8.0], height: CEILING };
    let hatch = Opening { from: 6.5, to: 7.5, sill: 1.0, head: 2.0 };
    s.wall("partition", wall, &[Opening::door(5.0, 6.0, 2.1), hatch]);
}

fn dining_corner(s: &mut Scenery) {
    s.table("dining-table", [3.8, 6.4], [1.8, 0.8], 0.75);
    s.round("vase", [4.5, 6.8], 0.1, 0.75, 0.3);
    s.round("bowl", [5.2, 6.8], 0.15, 0.75, 0.1);
    s.chair("west-chair", [3.0, 6.55], Back::West);
    s.chair("east-chair", [5.95, 6.55], Back::East);
    s.chair("south-chair", [4.2, 5.62], Back::South);
    s.block("bench", [4.0, 7.6, 0.0], [5.4, 8.0, 0.45]);
    s.hanging_lamp("dining-lamp", [4.7, 6.8], 1.7, CEILING);
    s.shelf("shelf", [1.2, 7.65], [1.4, 0.35], 1.76, Back::North, &[0.44, 0.88, 1.32, 1.76]);
    s.block("jars", [1.24, 7.7, 0.44], [1.6, 7.96, 0.84]);
    s.block("crockery", [2.2, 7.7, 0.88], [2.56, 7.96, 1.28]);
    s.block("cupboard", [0.0, 6.2, 0.0], [0.5, 8.0, 2.0]);
}

fn east_side(s: &mut Scenery) {
    s.block("sideboard", [7.4, 1.5, 0.0], [8.0, 4.0, 0.85]);
    s.block("microwave", [7.55, 2.0, 0.85], [8.0, 2.5, 1.15]);
    s.block("crate", [7.6, 3.2, 0.85], [8.0, 3.7, 1.1]);
    s.block("bin", [7.5, 0.0, 0.0], [8.0, 0.5, 0.7]);
    s.block("wall-shelf", [7.7, 1.5, 1.6], [8.0, 4.0, 1.65]);
    s.block("books", [7.75, 1.6, 1.65], [8.0, 2.4, 1.95]);
}
