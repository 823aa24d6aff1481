//! Scenario 4, 8×18×5 m: a warehouse of three bays in a row. Corner at the origin; south is −y.

use crate::scenery::furniture::{Back, Opening, Wall};
use crate::scenery::{Scenery, Solid};

const CEILING: f64 = 5.0;
const BOARDS: [f64; 4] = [0.7, 1.4, 2.1, 2.8];

pub fn build() -> Scenery {
    let mut s = Scenery::within(Solid::block("hall-long", [0.0; 3], [8.0, 18.0, CEILING]));
    walls(&mut s);
    arrivals(&mut s);
    racks(&mut s);
    packing(&mut s);
    for y in [3.0, 9.0, 15.0] {
        s.block("roof-beam", [0.0, y, 4.3], [8.0, y + 0.25, 4.6]);
        s.hanging_lamp("lamp", [4.0, y + 1.2], 3.6, CEILING);
    }
    s
}

fn walls(s: &mut Scenery) {
    let wall = |faces| Wall { along: 0, faces, span: [0.0, 8.0], height: CEILING };
    let window = Opening { from: 5.2, to: 6.8, sill: 1.2, head: 2.4 };
    s.wall("south-wall", wall([5.8, 6.0]), &[Opening::door(1.2, 3.2, 3.0), window]);
    s.wall("north-wall", wall([12.2, 12.4]), &[Opening::door(0.8, 1.8, 2.2), Opening::door(4.8, 6.4, 3.0)]);
}

/// South bay: pallets, barrels and a van's load.
fn arrivals(s: &mut Scenery) {
    for (x, y, height) in [(0.0, 0.0, 1.2), (1.8, 0.0, 0.8), (6.8, 2.2, 1.5), (3.2, 2.6, 0.6)] {
        s.block("pallet", [x, y, 0.0], [x + 1.2, y + 1.0, height]);
        s.block("load", [x, y, height], [x + 0.8, y + 0.7, height + 0.5]);
    }
    for (x, y) in [(4.6, 0.8), (5.6, 0.8), (5.1, 1.7)] {
        s.round("barrel", [x, y], 0.3, 0.0, 0.9);
    }
    s.block("forklift", [1.0, 3.4, 0.0], [1.9, 4.6, 0.9]);
    s.block("forklift-mast", [1.9, 3.5, 0.0], [2.0, 4.5, 2.2]);
    s.block("forklift-roof", [1.0, 3.4, 1.9], [1.9, 4.6, 2.0]);
    s.block("forklift-post", [1.0, 3.4, 0.9], [1.1, 4.6, 1.9]);
}

/// Middle bay: racks along the walls and a double one between them.
fn racks(s: &mut Scenery) {
    s.shelf("west-rack", [0.0, 7.2], [0.7, 3.6], 2.8, Back::West, &BOARDS);
    s.shelf("east-rack", [7.3, 7.2], [0.7, 3.6], 2.8, Back::East, &BOARDS);
    s.shelf("middle-rack-a", [3.2, 7.6], [0.7, 3.0], 2.8, Back::East, &BOARDS);
    s.shelf("middle-rack-b", [3.9, 7.6], [0.7, 3.0], 2.8, Back::West, &BOARDS);
    for (i, y) in [7.24, 8.4, 9.6].into_iter().enumerate() {
        let top = BOARDS[i];
        s.block("west-box", [0.04, y, top], [0.6, y + 0.6, top + 0.66]);
        s.block("east-box", [7.4, y + 0.56, top], [7.96, y + 1.16, top + 0.66]);
    }
    s.block("middle-box", [3.3, 7.64, 0.7], [3.86, 8.3, 1.36]);
    s.block("ladder-platform", [5.6, 11.2, 0.0], [6.2, 12.2, 1.0]);
}

/// North bay: a gallery on posts, packing tables, an office corner.
fn packing(s: &mut Scenery) {
    s.block("gallery", [0.0, 16.4, 2.5], [8.0, 18.0, 2.7]);
    s.block("gallery-parapet", [0.0, 16.4, 2.7], [8.0, 16.5, 3.5]);
    s.block("gallery-crate", [0.0, 17.2, 2.7], [0.8, 18.0, 3.4]);
    s.block("gallery-locker", [5.0, 17.5, 2.7], [6.4, 18.0, 4.4]);
    for x in [2.5, 5.5] {
        s.block("gallery-post", [x, 16.4, 0.0], [x + 0.2, 16.6, 2.5]);
    }
    for y in [13.4, 14.9] {
        s.table("packing-table", [2.4, y], [2.2, 0.8], 0.9);
        s.block("packet", [2.8, y + 0.2, 0.9], [3.2, y + 0.6, 1.2]);
        s.round("tape", [4.2, y + 0.4], 0.12, 0.9, 0.15);
    }
    s.table("office-desk", [7.3, 13.6], [0.7, 1.5], 0.74);
    s.block("office-monitor", [7.9, 14.1, 0.74], [8.0, 14.6, 1.2]);
    s.chair("office-chair", [6.4, 14.1], Back::West);
    s.sofa("sofa", [0.0, 13.4], [0.85, 1.8], Back::West);
    s.shelf("parts", [3.2, 17.55], [1.8, 0.45], 1.9, Back::North, &[0.46, 0.94, 1.42, 1.9]);
}
