//! Scenario 6, 7×9×2 m: a garage with two cars, and a workshop behind it. Corner at the origin; south is −y.

use crate::scenery::furniture::{Back, Opening, Wall};
use crate::scenery::{Scenery, Solid};

const CEILING: f64 = 2.0;
/// A car's lower edge: high enough to look under.
const GROUND_CLEARANCE: f64 = 0.35;

pub fn build() -> Scenery {
    let mut s = Scenery::within(Solid::block("garage", [0.0; 3], [7.0, 9.0, CEILING]));
    for x in [0.9, 4.3] {
        car(&mut s, x, 0.9);
    }
    let wall = Wall { along: 0, faces: [6.2, 6.3], span: [0.0, 7.0], height: CEILING };
    s.wall("wall", wall, &[Opening::door(2.9, 4.1, 1.85), Opening::door(5.7, 6.6, 1.85)]);
    s.block("pillar", [3.3, 4.6, 0.0], [3.6, 4.9, CEILING]);
    s.block("gate-post", [3.3, 0.0, 0.0], [3.6, 0.4, CEILING]);
    along_the_cars(&mut s);
    workshop(&mut s);
    s
}

/// A car, 1.7×4.0×1.45 m, nose to the south.
fn car(s: &mut Scenery, x: f64, y: f64) {
    let body = [[0.0, GROUND_CLEARANCE], [4.0, GROUND_CLEARANCE], [4.0, 0.85], [1.1, 0.9], [0.0, 0.7]];
    let cabin = [[1.1, 0.9], [4.0, 0.85], [3.6, 1.45], [1.8, 1.45]];
    for (name, profile) in [("car-body", &body[..]), ("car-cabin", &cabin[..])] {
        let profile: Vec<_> = profile.iter().map(|[a, b]| [y + a, *b]).collect();
        s.add(Solid::prism(name, 0, &profile, x, x + 1.7));
    }
    for axle in [y + 0.75, y + 3.2] {
        for wheel in [x, x + 1.5] {
            s.add(Solid::cylinder("wheel", 0, [axle, 0.3], 0.3, (wheel, wheel + 0.2), 12));
        }
    }
}

fn along_the_cars(s: &mut Scenery) {
    s.block("meter-cupboard", [0.0, 0.0, 0.0], [0.4, 0.5, 1.6]);
    s.block("boxes", [0.0, 5.4, 0.0], [0.5, 6.2, 0.6]);
    s.block("box-on-boxes", [0.0, 5.7, 0.6], [0.4, 6.2, 1.0]);
    s.block("bracket-shelf", [6.7, 1.5, 1.2], [7.0, 3.5, 1.24]);
    s.block("paint-tins", [6.75, 2.0, 1.24], [7.0, 2.5, 1.5]);
    s.block("mower", [6.4, 5.5, 0.0], [7.0, 6.2, 0.4]);
}

fn workshop(s: &mut Scenery) {
    s.table("workbench", [0.6, 8.35], [2.4, 0.65], 0.9);
    s.block("vice", [0.9, 8.4, 0.9], [1.1, 8.6, 1.1]);
    s.block("toolbox", [1.9, 8.7, 0.9], [2.4, 9.0, 1.15]);
    s.block("tool-board", [0.6, 8.94, 1.45], [3.0, 9.0, CEILING]);
    s.shelf("shelf", [4.2, 8.6], [2.0, 0.4], 1.66, Back::North, &[0.42, 0.84, 1.26, 1.66]);
    s.block("shelf-box", [4.24, 8.65, 0.42], [4.7, 8.96, 0.8]);
    s.block("shelf-crate", [5.7, 8.65, 0.84], [6.16, 8.96, 1.22]);
    s.block("freezer", [0.0, 6.3, 0.0], [0.7, 7.5, 0.85]);
    s.round("tyres", [6.3, 7.5], 0.33, 0.0, 0.8);
    s.round_table("stool", [1.8, 7.6], 0.18, 0.6);
    s.block("bicycle-frame", [4.4, 7.1, 0.4], [5.1, 7.16, 0.8]);
    for x in [4.2, 5.3] {
        s.add(Solid::cylinder("bicycle-wheel", 1, [0.33, x], 0.33, (7.1, 7.16), 12));
    }
}
