//! A room that is explored, beside a corridor in which a robot goes on: once nothing flows in the room, it is sealed.

use elk_field::{Cell, Isovolumes};
use elk_geometry::Voxel;
use elk_geometry::bricks::voxel_at;

/// A corridor along x of 96 × 16 × 16 voxels, and a room of 32 × 64 × 16 beside its beginning, behind a door.
fn cell(voxel: Voxel, robot: Voxel) -> Cell {
    let Voxel { x, y, z } = voxel;
    let corridor = (0..96).contains(&x) && (0..16).contains(&y);
    let room = (0..32).contains(&x) && (17..80).contains(&y);
    let door = (4..12).contains(&x) && y == 16;
    match voxel {
        _ if voxel == robot => Cell::Source,
        _ if !(0..16).contains(&z) || !(corridor || room || door) => Cell::Outside,
        _ if x == 95 => Cell::Sink,
        _ => Cell::Inside,
    }
}

fn main() {
    let mut domain = Isovolumes::new(0.01);
    for step in 0..10 {
        let robot = Voxel::new(20 + 4 * step, 8, 8);
        for block in (0..12).flat_map(|x| (0..10).flat_map(move |y| (0..2).map(move |z| Voxel::new(x, y, z)))) {
            domain.set_block(block, &std::array::from_fn(|n| cell(voxel_at(block, n), robot)));
        }
        let (convergence, bound) = domain.solve(1e-6, || false);
        let sealed = domain.sealed().count();
        println!("{sealed} blocks sealed, {} iterations, {bound:?}", convergence.iterations);
        assert!(bound.excess <= 0.01 * bound.flow);
    }
    assert!(domain.sealed().count() >= 64, "the room is sealed");
}
