// What every kernel over a level of the multigrid knows.
//
// Two cells that follow each other along x are a pair, a vec2: they have the same parent on the next coarser level. A
// row of pairs ends, and a plane of rows ends, in cells that are outside and stay zero: they are the margin of what
// comes after them too.

/// A level: how many pairs, rows and planes have cells, how far apart rows and planes are in pairs, and how far apart
/// they are on the next coarser level in cells.
struct Level {
    pairs: u32,
    rows: u32,
    planes: u32,
    row: u32,
    plane: u32,
    coarse_row: u32,
    coarse_plane: u32,
    coarse_rows: u32,
    coarse_planes: u32,
}

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> state: State;

/// Damping of the two sweeps: the roots of Chebyshev's polynomial for the upper 5/6 of the spectrum of D^-1 A, [1/3,
/// 2], which the next coarser level does not see. Afterwards they come in reverse, so that the cycle is symmetric.
const OMEGA = vec2<f32>(0.5695, 1.7320);
/// Planes that one invocation walks through.
const PLANES = 4u;

fn index(x: u32, y: u32, z: u32) -> u32 {
    return level.plane * (z + 1u) + level.row * y + x;
}

/// 1 / d, and 0 for cells outside.
fn inverse(d: vec2<f32>) -> vec2<f32> {
    return select(vec2<f32>(0.0), 1.0 / d, d > vec2<f32>(0.0));
}
