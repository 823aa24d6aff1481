//! A cube of 10 m, parted by horizontal and vertical walls, as the simulated environment of Shade and Newman, *Choosing Where To Go:
//! Complete 3D Exploration With Stereo* (ICRA 2011, VII.A) is said to be. Its model is not published: the size is the paper's, 51³
//! voxels of 0.2 m, where the walls stand is ours. Corner at the origin.

use super::furniture::{Opening, Wall};
use super::{Scenery, Solid};

/// Edge of the cube (m).
const EDGE: f64 = 10.0;
/// Underside and top of the floor between the storeys (m).
const FLOOR: [f64; 2] = [4.8, 5.1];

/// Two storeys, joined at two corners, each parted by two walls that leave a way round and a hatch; a half floor in each.
pub fn build() -> Scenery {
    let mut s = Scenery::within(Solid::block("cube", [0.0; 3], [EDGE; 3]));
    let [under, top] = FLOOR;
    s.block("floor-middle", [2.0, 0.0, under], [8.0, EDGE, top]);
    s.block("floor-west", [0.0, 0.0, under], [2.0, 7.5, top]);
    s.block("floor-east", [8.0, 2.5, under], [EDGE, EDGE, top]);

    let below = |faces: [f64; 2], span: [f64; 2]| Wall { along: 1, faces, span, height: under };
    let hatch = |from: f64, sill: f64| Opening { from, to: from + 1.5, sill, head: sill + 1.5 };
    s.wall("west-wall", below([3.2, 3.5], [0.0, 7.0]), &[hatch(1.5, 0.6)]);
    s.wall("east-wall", below([6.5, 6.8], [3.0, EDGE]), &[hatch(7.0, 2.9)]);
    s.block("half-floor", [6.8, 6.0, 2.3], [EDGE, EDGE, 2.6]);

    // A wall with a hatch that goes up to the ceiling.
    let mut above = |name: &str, [x, to]: [f64; 2], [y, behind]: [f64; 2], hatch: f64| {
        let mut part = |part: &str, x: [f64; 2], z: [f64; 2]| {
            s.block(&format!("{name}-{part}"), [x[0], y, z[0]], [x[1], behind, z[1]]);
        };
        part("pier", [x, hatch], [top, EDGE]);
        part("pier", [hatch + 1.5, to], [top, EDGE]);
        part("parapet", [hatch, hatch + 1.5], [top, 6.9]);
        part("lintel", [hatch, hatch + 1.5], [8.4, EDGE]);
    };
    above("south-wall", [0.0, 7.0], [3.2, 3.5], 1.5);
    above("north-wall", [3.0, EDGE], [6.5, 6.8], 7.0);
    s.block("gallery", [0.0, 0.0, 7.4], [4.0, 3.2, 7.7]);
    s
}
