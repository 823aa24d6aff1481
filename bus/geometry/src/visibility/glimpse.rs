//! From where a face of a voxel is seen, though its centre is not, or only past the corners of what hides it.

use nalgebra::{Point3, Vector3};

use super::{Place, nearest_on_line};
use crate::ray::{Traversal, leads_through};
use crate::set::VoxelSet;
use crate::voxel::Voxel;

/// Directions that are looked in, spread evenly over the half space before the face (a Fibonacci lattice).
const DIRECTIONS: u32 = 256;
/// The least cosine to the face's normal: what is seen more obliquely shows a camera next to nothing of itself.
const LEAST_COSINE: f64 = 0.25;
/// No more places than that are looked for.
const ENOUGH: usize = 16;

/// Places in `reach`, at most `range` (m) away, that see the face that voxel `target` has at `side`, one of its face neighbours, over voxels
/// of `resolution` (m): the straight line to its middle leads through no voxel that is not free, but past the corners of some
/// perhaps, as the rays did that made free what is behind a gap narrower than a voxel. Not all such places are found. And the corners of the box
/// in which it looked, both in it: as long as there every voxel stays as it is, so does the answer.
pub fn glimpses(
    (free, reach): (&VoxelSet, &VoxelSet),
    (range, resolution): (f64, f64),
    (target, side): (Voxel, Voxel),
) -> (Vec<Place>, [Voxel; 2]) {
    let normal = Vector3::from((side - target).to_array().map(f64::from));
    let (mut free, mut reach) = (free.near(), reach.near());
    let middle = target.center(resolution) + normal * (0.5 * resolution);
    let mut places: Vec<Place> = Vec::new();
    let mut within = [target.inf(side), target.sup(side)];
    for way in directions(normal).map(|direction| direction * range) {
        // It begins on the face, where rounding would say which voxel that is in.
        let (from, to) = (middle + normal * (1e-6 * resolution), middle + way);
        for voxel in Traversal::new(from, to, resolution) {
            within = [within[0].inf(voxel), within[1].sup(voxel)];
            let is_free = free.contains(voxel);
            if !is_free && leads_through(from, to, voxel, resolution) {
                break;
            }
            if is_free && reach.contains(voxel) {
                let point: Point3<f64> = nearest_on_line(from, way.normalize(), voxel.center(resolution));
                let is_new = places.iter().all(|(other, _)| *other != voxel);
                if is_new && Voxel::containing(point, resolution) == voxel {
                    places.push((voxel, point));
                }
                break;
            }
        }
        if places.len() >= ENOUGH {
            break;
        }
    }
    places.sort_by_key(|(voxel, _)| voxel.raster());
    (places, within)
}

/// Whether a camera at `from` (m, world) glimpses the face that voxel `target` has at `side`, one of its face neighbours, as [`glimpses`] has
/// it.
pub fn glimpsed(free: &VoxelSet, resolution: f64, from: Point3<f64>, (target, side): (Voxel, Voxel)) -> bool {
    let normal = Vector3::from((side - target).to_array().map(f64::from));
    let middle = target.center(resolution) + normal * ((0.5 + 1e-6) * resolution);
    let way = from - middle;
    let mut free = free.near();
    let is_clear = |voxel: Voxel| free.contains(voxel) || !leads_through(middle, from, voxel, resolution);
    way.dot(&normal) >= LEAST_COSINE * way.norm() && Traversal::new(middle, from, resolution).all(is_clear)
}

/// Directions in which a face with this normal is not seen too obliquely, from straight before it outwards.
fn directions(normal: Vector3<f64>) -> impl Iterator<Item = Vector3<f64>> {
    let aside = if normal.x == 0.0 { Vector3::x() } else { Vector3::y() };
    let across = normal.cross(&aside);
    (0..DIRECTIONS).map(move |k| {
        let along = 1.0 - (1.0 - LEAST_COSINE) * (f64::from(k) + 0.5) / f64::from(DIRECTIONS);
        let (off, turn) = ((1.0 - along * along).sqrt(), std::f64::consts::PI * (3.0 - 5f64.sqrt()) * f64::from(k));
        normal * along + (aside * turn.cos() + across * turn.sin()) * off
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::sees;

    const RANGE: (f64, f64) = (3.0, 0.1);

    /// A room of 20 × 9 × 9 free voxels.
    fn room() -> VoxelSet {
        (0..20).flat_map(|x| (0..9).flat_map(move |y| (0..9).map(move |z| Voxel::new(x, y, z)))).collect()
    }

    #[test]
    fn a_face_is_seen_from_before_it_and_not_from_beside_it() {
        let (free, wall) = (room(), Voxel::new(5, 5, -1));
        let here = |voxel: &Voxel| voxel.x > 14;
        let reach: VoxelSet = free.iter().filter(here).collect();
        let (places, within) = glimpses((&free, &reach), RANGE, (wall, Voxel::new(5, 5, 0)));
        assert!(!places.is_empty() && within[0].z == -1 && within[1].x >= 15, "{within:?}");
        assert!(places.iter().all(|(voxel, point)| here(voxel) && Voxel::containing(*point, 0.1) == *voxel));
        // Along the floor it is seen too obliquely: a camera a metre away is three voxels above it at least.
        assert!(places.iter().all(|(voxel, _)| voxel.z >= 2), "{places:?}");
        let from = |voxel: Voxel| glimpsed(&free, 0.1, voxel.center(0.1), (wall, Voxel::new(5, 5, 0)));
        assert!(places.iter().all(|(_, point)| glimpsed(&free, 0.1, *point, (wall, Voxel::new(5, 5, 0)))));
        assert!(from(Voxel::new(5, 5, 3)) && !from(Voxel::new(12, 5, 0)) && !from(Voxel::new(5, 5, -2)));
        let behind = glimpses((&free, &reach), RANGE, (Voxel::new(5, 5, 9), Voxel::new(5, 5, 10))).0;
        assert!(behind.is_empty(), "its other side");
    }

    /// A voxel in a hole, whose centre a lip hides.
    #[test]
    fn a_face_is_seen_whose_centre_is_hidden() {
        let mut free = room();
        // A niche in the wall at x = -1, one voxel deep; what is unknown lies below it.
        let niche = Voxel::new(-1, 4, 3);
        free.insert(niche);
        let below = niche - Voxel::new(0, 0, 1);
        let reach: VoxelSet = room().iter().filter(|voxel| voxel.z >= 6 && voxel.x < 4).collect();
        let hidden = reach.iter().all(|voxel| !sees(&free, 0.1, voxel.center(0.1), below));
        let (places, _) = glimpses((&free, &reach), RANGE, (below, niche));
        assert!(hidden && !places.is_empty(), "{hidden} {places:?}");
    }

    /// A pocket that touches the room at an edge only, past which it was seen.
    #[test]
    fn what_lies_in_a_pocket_is_seen_past_the_corners_of_what_shuts_it_off() {
        let mut free = room();
        let pocket = [Voxel::new(-1, 4, -1), Voxel::new(-2, 4, -2)];
        pocket.iter().for_each(|voxel| assert!(free.insert(*voxel)));
        let target = Voxel::new(-3, 4, -2);
        let reach = room();
        let (places, _) = glimpses((&free, &reach), RANGE, (target, pocket[1]));
        assert!(places.is_empty(), "straight before its face is a wall: {places:?}");
        let mut wider = free.clone();
        assert!(wider.insert(Voxel::new(-1, 4, -2)));
        let (places, _) = glimpses((&wider, &reach), RANGE, (target, pocket[1]));
        assert!(!places.is_empty(), "past the edge of the room");
    }
}
