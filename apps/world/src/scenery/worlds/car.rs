//! Scenario 1, 7×4×4 m: the cabin of a car, about twice life size. Its middle is at the origin, forwards is +x.
//!
//! The volume that the thesis' Listing 2 explores, 5.7×4.3×4.5 m around the origin, holds the seats and most of dashboard
//! and boot; nose and tail reach out of it.

use crate::scenery::{Scenery, Solid};

const FLOOR: f64 = -2.0;
const SEAT: f64 = -1.15;

pub fn build() -> Scenery {
    // Corners as [z, x]: roof, windscreen, nose, floor, tail.
    let body = [[2.0, -2.6], [2.0, 1.6], [-0.3, 3.5], [FLOOR, 3.5], [FLOOR, -3.5], [0.2, -3.5]];
    let mut s = Scenery::within(Solid::prism("cabin", 1, &body, -2.0, 2.0));
    dashboard(&mut s);
    for (name, y) in [("driver", 0.5), ("passenger", -1.6)] {
        front_seat(&mut s, name, y);
    }
    rear(&mut s);
    fittings(&mut s);
    s
}

fn dashboard(s: &mut Scenery) {
    s.block("dashboard", [1.9, -2.0, -0.9], [3.5, 2.0, -0.3]);
    s.block("tunnel", [1.9, -0.15, FLOOR], [3.5, 0.15, -0.9]);
    s.block("console", [-0.6, -0.15, FLOOR], [1.9, 0.15, -1.1]);
    s.block("gear-lever", [0.9, -0.04, -1.1], [0.98, 0.04, -0.7]);
    s.round("cup", [-0.3, 0.0], 0.1, -1.1, 0.22);
    s.block("steering-column", [1.5, 1.01, -0.5], [1.9, 1.09, -0.42]);
    s.add(Solid::cylinder("steering-wheel", 0, [1.05, -0.46], 0.38, (1.44, 1.5), 12));
    for (name, y) in [("clutch", 0.5), ("brake", 0.95), ("throttle", 1.4)] {
        s.block(name, [2.3, y, FLOOR], [2.36, y + 0.14, -1.7]);
    }
    s.block("glove-box", [1.8, -1.5, -0.8], [1.9, -0.6, -0.45]);
}

fn front_seat(s: &mut Scenery, name: &str, y: f64) {
    s.block(&format!("{name}-seat"), [-0.5, y, FLOOR], [0.7, y + 1.1, SEAT]);
    let back = [[0.15, -0.8], [0.15, -0.55], [SEAT, -0.2], [SEAT, -0.5]];
    s.add(Solid::prism(&format!("{name}-backrest"), 1, &back, y, y + 1.1));
    s.block(&format!("{name}-headrest"), [-0.8, y + 0.3, 0.15], [-0.55, y + 0.8, 0.5]);
}

fn rear(s: &mut Scenery) {
    s.block("bench", [-2.3, -1.6, FLOOR], [-1.4, 1.6, SEAT]);
    let back = [[0.0, -2.5], [0.0, -2.25], [SEAT, -2.0], [SEAT, -2.3]];
    s.add(Solid::prism("bench-backrest", 1, &back, -1.6, 1.6));
    for (name, y) in [("left-headrest", 0.7), ("right-headrest", -1.2)] {
        s.block(name, [-2.5, y, 0.0], [-2.25, y + 0.5, 0.32]);
    }
    s.block("parcel-shelf", [-3.5, -2.0, -0.05], [-2.4, 2.0, 0.0]);
    s.block("hat", [-3.15, -0.2, 0.0], [-2.85, 0.2, 0.2]);
    s.block("bag", [-3.5, -0.8, FLOOR], [-2.9, 0.6, -1.4]);
    s.block("child-seat", [-2.0, 0.5, SEAT], [-1.5, 1.0, -0.75]);
}

fn fittings(s: &mut Scenery) {
    s.block("roof-lamp", [-0.6, -0.2, 1.88], [-0.3, 0.2, 2.0]);
    s.block("mirror-rod", [1.4, -0.03, 1.5], [1.46, 0.03, 2.0]);
    s.block("mirror", [1.4, -0.35, 1.25], [1.46, 0.35, 1.5]);
    for (side, y) in [("left", [1.85, 2.0]), ("right", [-2.0, -1.85])] {
        s.block(&format!("{side}-armrest"), [0.2, y[0], -0.8], [1.4, y[1], -0.65]);
        s.block(&format!("{side}-rear-armrest"), [-1.9, y[0], -0.8], [-1.0, y[1], -0.65]);
        s.block(&format!("{side}-belt-pillar"), [-1.0, y[0], FLOOR], [-0.85, y[1], 2.0]);
    }
    s.block("parcel", [0.15, -1.3, SEAT], [0.6, -0.8, -0.8]);
}
