//! Scenario 2, 10×10×5 m: a workshop hall and a store with a mezzanine, divided by a wall. Corner at the origin; south is −y.

use crate::scenery::furniture::{Back, Opening, Wall};
use crate::scenery::{Scenery, Solid};

const CEILING: f64 = 5.0;
/// Upper face of the mezzanine.
const UPSTAIRS: f64 = 2.6;

pub fn build() -> Scenery {
    let mut s = Scenery::within(Solid::block("hall", [0.0; 3], [10.0, 10.0, CEILING]));
    dividing_wall(&mut s);
    workshop(&mut s);
    office(&mut s);
    mezzanine(&mut s);
    below_the_mezzanine(&mut s);
    s
}

fn dividing_wall(s: &mut Scenery) {
    let wall = Wall { along: 0, faces: [5.5, 5.7], span: [0.0, 10.0], height: CEILING };
    let window = Opening { from: 3.8, to: 5.0, sill: 1.5, head: 2.8 };
    s.wall("wall", wall, &[Opening::door(1.5, 2.7, 2.2), window, Opening::door(6.5, 8.5, 3.0)]);
}

fn workshop(s: &mut Scenery) {
    s.shelf("rack", [0.0, 1.0], [0.6, 2.5], 2.4, Back::West, &[0.6, 1.2, 1.8, 2.4]);
    s.block("rack-crate", [0.04, 1.04, 0.6], [0.5, 1.7, 1.16]);
    s.block("rack-box", [0.04, 2.86, 1.2], [0.5, 3.46, 1.76]);
    s.block("pallet", [2.2, 1.2, 0.0], [3.4, 2.2, 0.9]);
    s.block("pallet-box", [2.2, 1.2, 0.9], [2.9, 1.9, 1.6]);
    for (x, y) in [(4.7, 1.0), (5.7, 1.3)] {
        s.round("barrel", [x, y], 0.3, 0.0, 0.9);
    }
    s.table("conveyor", [3.6, 3.4], [2.4, 0.7], 0.8);
    s.block("parcel", [3.9, 3.6, 0.8], [4.3, 4.0, 1.1]);
    s.round("pillar", [2.2, 4.0], 0.2, 0.0, CEILING);
    s.block("crane-beam", [0.0, 2.6, 4.2], [10.0, 2.85, 4.6]);
    s.block("crane-chain", [5.0, 2.69, 2.9], [5.06, 2.75, 4.2]);
    s.block("crane-hook", [4.9, 2.6, 2.7], [5.16, 2.85, 2.9]);
}

/// A cabin in the south-east corner.
fn office(s: &mut Scenery) {
    let wall = |along, faces, span| Wall { along, faces, span, height: 2.5 };
    let window = Opening { from: 8.2, to: 9.2, sill: 1.0, head: 2.0 };
    s.wall("office-west", wall(1, [7.2, 7.3], [0.0, 2.5]), &[Opening::door(1.0, 1.9, 2.1)]);
    s.wall("office-north", wall(0, [2.5, 2.6], [7.2, 10.0]), &[window]);
    s.block("office-roof", [7.2, 0.0, 2.5], [10.0, 2.6, 2.6]);
    s.table("office-desk", [9.3, 0.8], [0.7, 1.4], 0.74);
    s.block("office-monitor", [9.9, 1.2, 0.74], [10.0, 1.7, 1.2]);
    s.chair("office-chair", [8.4, 1.2], Back::West);
    s.block("office-cabinet", [7.3, 0.0, 0.0], [8.1, 0.45, 1.8]);
}

fn mezzanine(s: &mut Scenery) {
    s.block("mezzanine", [0.0, 7.8, 2.4], [6.0, 10.0, UPSTAIRS]);
    s.block("parapet", [0.0, 7.8, UPSTAIRS], [6.0, 7.9, 3.5]);
    for x in [2.8, 5.8] {
        s.block("post", [x, 7.8, 0.0], [x + 0.2, 8.0, 2.4]);
    }
    for i in 0..9 {
        let (x, top) = (6.0 + 0.3 * f64::from(i), UPSTAIRS - 0.26 * f64::from(i + 1));
        s.block("step", [x, 8.9, 0.0], [x + 0.3, 10.0, top]);
    }
    s.block("upstairs-crate", [0.0, 9.1, UPSTAIRS], [0.9, 10.0, 3.3]);
    s.round("upstairs-barrel", [2.2, 9.0], 0.3, UPSTAIRS, 0.9);
    s.block("upstairs-locker", [3.4, 9.5, UPSTAIRS], [4.6, 10.0, 4.4]);
}

fn below_the_mezzanine(s: &mut Scenery) {
    s.table("workbench", [0.8, 9.2], [2.0, 0.8], 0.9);
    s.block("toolbox", [1.3, 9.6, 0.9], [1.8, 10.0, 1.15]);
    s.shelf("parts", [3.6, 9.6], [1.6, 0.4], 1.9, Back::North, &[0.46, 0.94, 1.42, 1.9]);
    s.block("parts-box", [3.64, 9.65, 0.46], [4.1, 9.96, 0.9]);
    s.block("trolley", [8.4, 6.4, 0.35], [9.3, 7.1, 0.9]);
    for (x, y) in [(8.4, 6.4), (9.2, 6.4), (8.4, 7.0), (9.2, 7.0)] {
        s.block("trolley-leg", [x, y, 0.0], [x + 0.1, y + 0.1, 0.35]);
    }
}
