//! What can be looked into from where, over free voxels.

use nalgebra::{Point3, Vector3};

use crate::ray::Traversal;
use crate::set::{Near, VoxelSet};
use crate::voxel::{FACES, Voxel};

/// Whether a camera at `from` (m, world) can look into voxel `target` among voxels of `resolution` (m): every voxel before it,
/// on the straight line to its centre, is free.
pub fn sees(free: &VoxelSet, resolution: f64, from: Point3<f64>, target: Voxel) -> bool {
    let mut free = free.near();
    in_sight(resolution, |voxel| free.contains(voxel), from, target)
}

/// The same where this says what is free.
pub fn in_sight(resolution: f64, is_free: impl FnMut(Voxel) -> bool, from: Point3<f64>, target: Voxel) -> bool {
    let way = Traversal::new(from, target.center(resolution), resolution);
    way.take_while(|v| *v != target).all(is_free)
}

/// Looks for places that see into a voxel, over all directions at the map's resolution.
///
/// The rays run backwards, from the centre of the voxel to those of the surface of a cube around it, and only through
/// faces behind which there is something free; nearly all of them die at once, since what hides a voxel is next to it. So
/// the search is exhaustive, at a small part of the price of trying every place. The rays are cast in an order that
/// spreads over all directions from the start, and a search that finds places is cut short.
#[derive(Debug, Clone)]
pub struct Lookout {
    /// For each face, in the order of [`FACES`]: the ways to go from the centre of a voxel through it (m).
    ways: [Vec<Vector3<f64>>; 6],
    /// Edge of a voxel (m).
    resolution: f64,
    /// Corners of a box outside of which there is no place to look from (m, world).
    places: Option<[Point3<f64>; 2]>,
}

/// A search ends that has found this many places.
const ENOUGH: usize = 64;
/// Steps of about the golden section of a list, coprime to its length, visit all of it, spread evenly.
const STRIDE: f64 = 0.618_033_988_749_895;

impl Lookout {
    /// Looks from at most `range` (m) away, over voxels of `resolution` (m).
    pub fn new(range: f64, resolution: f64) -> Self {
        let surface: Vec<Voxel> = cube_surface((range / resolution).ceil() as i32).collect();
        let through = |face: Voxel| {
            let leaves = |d: &&Voxel| first_face(**d) == face;
            let ends: Vec<Voxel> = surface.iter().filter(leaves).copied().collect();
            spread(&ends).map(|d| Vector3::new(d.x.into(), d.y.into(), d.z.into()).normalize() * range).collect()
        };
        Self { ways: FACES.map(through), resolution, places: None }
    }

    /// The same for who can only be in `reach`: rays that do not come near it are not cast. A robot that is wide, or shut in,
    /// reaches little.
    pub fn from_within(self, reach: &VoxelSet) -> Self {
        let nowhere = [Point3::from([f64::INFINITY; 3]), Point3::from([f64::NEG_INFINITY; 3])];
        let [min, max] = reach.corners().map_or(nowhere, |corners| corners.map(|v| v.center(self.resolution)));
        // Half a voxel, and as much for rounding.
        let margin = Vector3::repeat(self.resolution);
        Self { places: Some([min - margin, max + margin]), ..self }
    }

    /// Corners of the box outside of which there is no place to look from (m, world); `None`: a place may be anywhere.
    pub fn places(&self) -> Option<[Point3<f64>; 2]> {
        self.places
    }

    /// Whether the way from `aim` comes to where there may be a place.
    fn comes_near(&self, aim: Point3<f64>, way: Vector3<f64>) -> bool {
        let Some([min, max]) = self.places else { return true };
        let (mut enters, mut leaves) = (0.0f64, 1.0f64);
        for axis in 0..3 {
            let [one, other] = [min, max].map(|corner| (corner[axis] - aim[axis]) / way[axis]);
            (enters, leaves) = (enters.max(one.min(other)), leaves.min(one.max(other)));
        }
        enters <= leaves
    }

    /// Places in `reach` that look into voxel `target`, one a ray: the first reachable voxel on it, with the point there.
    /// None only if there is none. And the corners of the box in which it looked, both in it: as long as there every voxel
    /// stays as it is, free or not, in `reach` or not, so does the answer.
    pub fn viewpoints(&self, free: &VoxelSet, reach: &VoxelSet, target: Voxel) -> (Vec<Place>, [Voxel; 2]) {
        let (aim, resolution) = (target.center(self.resolution), self.resolution);
        let open = |(face, _): &(&Voxel, &Vec<Vector3<f64>>)| free.contains(target + **face);
        let mut found = std::collections::BTreeMap::new();
        let around = Voxel::new(1, 1, 1);
        let mut within = [target - around, target + around];
        let mut sets = (free.near(), reach.near());
        let ways = FACES.iter().zip(&self.ways).filter(open).flat_map(|(_, ways)| ways);
        for way in ways.filter(|way| self.comes_near(aim, **way)) {
            let ray = Traversal::new(aim, aim + way, resolution).skip_while(|voxel| *voxel == target);
            let (end, is_place) = along_ray(&mut sets, target, ray);
            within = [within[0].inf(end), within[1].sup(end)];
            if is_place {
                let point = nearest_on_line(aim, way.normalize(), end.center(resolution));
                if Voxel::containing(point, resolution) == end {
                    found.entry(end.raster()).or_insert((end, point));
                }
            }
            if found.len() >= ENOUGH {
                break;
            }
        }
        (found.into_values().collect(), within)
    }
}

/// A place to look from: the voxel, and the point in it (m, world).
pub type Place = (Voxel, Point3<f64>);

/// The face through which the way from a voxel's centre in direction `d` leaves it: that of the largest component, of
/// equals the first.
fn first_face(d: Voxel) -> Voxel {
    let components = d.to_array();
    let largest = (1..3).fold(0, |a, b| if components[b].abs() > components[a].abs() { b } else { a });
    let mut face = [0; 3];
    face[largest] = components[largest].signum();
    face.into()
}

/// All of `list`, neighbours far apart.
fn spread(list: &[Voxel]) -> impl Iterator<Item = Voxel> + '_ {
    let count = list.len();
    let near = ((count as f64 * STRIDE) as usize).max(1);
    let stride = (near..).find(|s| gcd(*s, count) == 1).unwrap_or(1);
    (0..count).map(move |k| list[k * stride % count])
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// The first voxel on a ray from `target` that is in the second set, if all before it are in the first one, else the one that
/// ends the ray; and whether it is the first.
fn along_ray((free, reach): &mut (Near, Near), target: Voxel, ray: impl Iterator<Item = Voxel>) -> (Voxel, bool) {
    let mut last = target;
    for voxel in ray {
        last = voxel;
        if !free.contains(voxel) {
            break;
        }
        if reach.contains(voxel) {
            return (voxel, true);
        }
    }
    (last, false)
}

/// The voxels of the surface of the cube of half edge `n`, relative to its centre.
fn cube_surface(n: i32) -> impl Iterator<Item = Voxel> {
    let side = move || -n..=n;
    side().flat_map(move |z| {
        side().flat_map(move |y| {
            let inside = z.abs() < n && y.abs() < n;
            let step = if inside { 2 * n } else { 1 };
            side().step_by(step.max(1) as usize).map(move |x| Voxel::new(x, y, z))
        })
    })
}

fn nearest_on_line(from: Point3<f64>, direction: Vector3<f64>, to: Point3<f64>) -> Point3<f64> {
    from + direction * direction.dot(&(to - from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_has_a_surface() {
        assert_eq!(cube_surface(1).count(), 26);
        assert_eq!(cube_surface(3).count(), 7 * 7 * 7 - 5 * 5 * 5);
    }

    /// A free room of 9 × 9 × 1 voxels with a wall at x = 4 that leaves a gap of one voxel at y = 0.
    fn room() -> VoxelSet {
        let all = (0..9).flat_map(|x| (0..9).map(move |y| Voxel::new(x, y, 0)));
        all.filter(|v| v.x != 4 || v.y == 0).collect()
    }

    #[test]
    fn a_wall_hides_what_is_behind() {
        let free = room();
        let at = |x, y| Voxel::new(x, y, 0).center(0.1);
        assert!(sees(&free, 0.1, at(1, 5), Voxel::new(-1, 5, 0)));
        assert!(!sees(&free, 0.1, at(1, 5), Voxel::new(9, 5, 0)));
        assert!(sees(&free, 0.1, at(1, 0), Voxel::new(9, 0, 0)));
    }

    #[test]
    fn viewpoints_are_all_that_see_and_none_that_does_not() {
        let free = room();
        let left: VoxelSet = free.iter().filter(|v| v.x < 3).collect();
        let target = Voxel::new(9, 1, 0);
        let lookout = Lookout::new(2.0, 0.1);
        let (found, _) = lookout.viewpoints(&free, &left, target);
        assert!(!found.is_empty());
        for (voxel, point) in &found {
            assert!(left.contains(*voxel));
            assert_eq!(Voxel::containing(*point, 0.1), *voxel);
            assert!(sees(&free, 0.1, *point, target), "{point:?}");
        }
        assert!(lookout.viewpoints(&free, &left, Voxel::new(9, 7, 0)).0.is_empty());
    }

    /// Regression: a robot that reached a single voxel had rays cast in all directions for each target, 37 s a plan.
    #[test]
    fn rays_that_are_not_cast_would_have_found_nothing() {
        let room = room();
        let (all, targets) = (Lookout::new(2.0, 0.1), [[9, 1, 0], [-1, 5, 0], [2, 9, 0], [3, 3, 1], [8, 8, -1]]);
        let free: Vec<Voxel> = room.iter().collect();
        let mut found = 0;
        for part in [&free[..1], &free[40..41], &free[20..50], &free[..]] {
            let reach: VoxelSet = part.iter().copied().collect();
            let near = all.clone().from_within(&reach);
            for target in targets.map(Voxel::from) {
                let (expected, _) = all.viewpoints(&room, &reach, target);
                assert_eq!(near.viewpoints(&room, &reach, target).0, expected, "{target:?}");
                found += expected.len();
            }
        }
        assert!(found > 10, "{found}");
    }

    /// Whatever changes where a search has not looked, it finds the same again.
    #[test]
    fn what_was_not_looked_at_changes_nothing() {
        let (free, lookout) = (room(), Lookout::new(2.0, 0.1));
        let reach: VoxelSet = free.iter().filter(|v| v.x == 1).collect();
        let all: Vec<Voxel> =
            (-2..11).flat_map(|x| (-2..11).flat_map(move |y| (-2..3).map(move |z| Voxel::new(x, y, z)))).collect();
        let mut outside = 0;
        for target in [[9, 1, 0], [-1, 5, 0], [9, 7, 0], [8, 8, -1], [2, 9, 0]].map(Voxel::from) {
            let (found, [least, most]) = lookout.viewpoints(&free, &reach, target);
            let elsewhere = |v: &Voxel| *v != v.sup(least) || *v != v.inf(most);
            outside += all.iter().filter(|voxel| elsewhere(voxel)).count();
            let other = all.iter().copied().filter(|voxel| elsewhere(voxel) != reach.contains(*voxel)).collect();
            assert_eq!(lookout.viewpoints(&free, &other, target), (found, [least, most]), "{target:?}");
        }
        assert!(outside > all.len(), "{outside}");
    }
}
