//! What can be looked into from where, over free voxels.

mod centers;
mod sweep;

use nalgebra::{Point3, Vector3};

use crate::ray::Traversal;
use crate::set::{Near, VoxelSet};
use crate::voxel::{FACES, Voxel};
pub use centers::{Line, entered, line};
use sweep::{Layers, Rays, axes, first_face};

/// Whether a camera at `from` (m, world) can look into voxel `target` among voxels of `resolution` (m): every voxel before it,
/// on the straight line to its centre, is free.
pub fn sees(free: &VoxelSet, resolution: f64, from: Point3<f64>, target: Voxel) -> bool {
    let mut free = free.near();
    in_sight(resolution, |voxel| free.contains(voxel), from, target)
}

/// The same where this says what is free.
pub fn in_sight(resolution: f64, mut is_free: impl FnMut(Voxel) -> bool, from: Point3<f64>, target: Voxel) -> bool {
    // Mostly what hides a voxel is next to it.
    if last_before(resolution, from, target).is_some_and(|last| !is_free(last)) {
        return false;
    }
    let way = Traversal::new(from, target.center(resolution), resolution);
    way.take_while(|v| *v != target).all(is_free)
}

/// The last voxel on the straight line from `from` to the centre of `target`: beside the face of the axis along which it goes
/// farthest. `None`: it begins in `target`, or it goes about as far along another axis, and rounding says which is the last.
fn last_before(resolution: f64, from: Point3<f64>, target: Voxel) -> Option<Voxel> {
    const MORE: f64 = 1.001;
    let way = from - target.center(resolution);
    let axis = way.iamax();
    let second = (0..3).filter(|other| *other != axis).map(|other| way[other].abs()).fold(resolution / 2.0, f64::max);
    let mut last = target.to_array();
    last[axis] += way[axis].signum() as i32;
    (way[axis].abs() > MORE * second).then(|| last.into())
}

/// Looks for places that see into a voxel, over all directions at the map's resolution.
///
/// The rays run backwards, from the centre of the voxel to those of the surface of a cube around it, and only through
/// faces behind which there is something free. Nearly all of them die near by, since what hides a voxel is next to it: so a
/// sweep first sorts out those that come to no place, many at once, and only the others are walked one by one. The search is
/// exhaustive, at a small part of the price of trying every place. The rays are walked in an order that spreads over all
/// directions from the start, and a search that finds places is cut short.
#[derive(Debug, Clone)]
pub struct Lookout {
    /// How far it looks (m).
    range: f64,
    /// Edge of a voxel (m).
    resolution: f64,
    /// For each face, in the order of [`FACES`], the rays through it, as they are numbered in [`sweep`].
    rays: [Vec<[i32; 2]>; 6],
    layers: Layers,
    /// Corners of a box outside of which there is no place to look from (m, world).
    places: Option<[Point3<f64>; 2]>,
}

/// A search ends that has found this many places.
const ENOUGH: usize = 64;
/// Farther than so many voxels nothing is looked for: a ray for each voxel that far away is 1.6 million.
const FARTHEST: i32 = 256;
/// Steps of about the golden section of a list, coprime to its length, visit all of it, spread evenly.
const STRIDE: f64 = 0.618_033_988_749_895;

impl Lookout {
    /// Looks from at most `range` (m) away, and at most 256 voxels, over voxels of `resolution` (m).
    pub fn new(range: f64, resolution: f64) -> Self {
        let range = shortened(range, resolution);
        let edge = (range / resolution).ceil() as i32;
        let mut rays: [Vec<[i32; 2]>; 6] = Default::default();
        for end in cube_surface(edge) {
            let [_, u, v] = axes(first_face(end)).map(|axis| end.to_array()[axis]);
            let through = FACES.iter().zip(&mut rays).filter(|(face, _)| **face == first_face(end));
            through.for_each(|(_, rays)| rays.push([u, v]));
        }
        let rays = rays.map(|rays| spread(&rays).collect());
        Self { range, resolution, rays, layers: Layers::new(edge), places: None }
    }

    /// The way that a ray through a face goes, from its beginning to its end (m).
    fn way(&self, face: Voxel, [u, v]: [i32; 2]) -> Vector3<f64> {
        let [_, aside, across] = axes(face);
        let mut way = face.to_array().map(|c| c * self.layers.n());
        (way[aside], way[across]) = (u, v);
        Vector3::from(way.map(f64::from)).normalize() * self.range
    }

    /// Whether it looks from so far away (m).
    pub fn is_of(&self, range: f64) -> bool {
        self.range == shortened(range, self.resolution)
    }

    /// The same for who can only be in the box between two voxels, both in it: rays that do not come near are not cast. A robot
    /// that is wide, or shut in, reaches little.
    pub fn from_within(self, corners: [Voxel; 2]) -> Self {
        let [min, max] = corners.map(|voxel| voxel.center(self.resolution));
        // Half a voxel, and as much for rounding.
        let margin = Vector3::repeat(self.resolution);
        Self { places: Some([min - margin, max + margin]), ..self }
    }

    /// The rays through a face that may come to where there may be a place.
    fn toward_places(&self, aim: Point3<f64>, face: Voxel) -> Rays {
        let n = self.layers.n();
        let Some(places) = self.places else { return Rays::within(n, -n..=n, -n..=n) };
        let [along, aside, across] = axes(face);
        let side = f64::from(face.to_array()[along]);
        let voxels = |axis: usize| places.map(|corner| (corner[axis] - aim[axis]) / self.resolution);
        let [one, other] = voxels(along).map(|at| side * at / f64::from(n));
        // The part of a ray in which it is between the corners along its own axis.
        let (enters, leaves) = (one.min(other).max(0.0), one.max(other).min(1.0));
        let directions = |axis| {
            let [low, high] = voxels(axis);
            let least = if low > 0.0 { low / leaves } else { -before(-low, enters) };
            let most = if high < 0.0 { high / leaves } else { before(high, enters) };
            (least.ceil() as i32).max(-n)..=(most.floor() as i32).min(n)
        };
        match enters < leaves {
            true => Rays::within(n, directions(aside), directions(across)),
            false => Rays::none(n),
        }
    }

    /// Places in `reach` that look into voxel `target`, one a ray: the first reachable voxel on it, with the point there.
    /// None only if there is none. And the corners of the box in which it looked, both in it: as long as there every voxel
    /// stays as it is, free or not, in `reach` or not, so does the answer.
    pub fn viewpoints(&self, free: &VoxelSet, reach: &VoxelSet, target: Voxel) -> (Vec<Place>, [Voxel; 2]) {
        let (aim, resolution) = (target.center(self.resolution), self.resolution);
        let mut found = std::collections::BTreeMap::new();
        let around = Voxel::new(1, 1, 1);
        let mut within = [target - around, target + around];
        let mut sets = (free.near(), reach.near());
        for (face, rays) in FACES.iter().zip(&self.rays).filter(|(face, _)| free.contains(target + **face)) {
            let lit = self.layers.lit(&mut sets, (target, *face), self.toward_places(aim, *face), &mut within);
            if lit.is_empty() {
                continue;
            }
            for way in rays.iter().filter(|ray| lit.contains(**ray)).map(|ray| self.way(*face, *ray)) {
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
                    return (found.into_values().collect(), within);
                }
            }
        }
        (found.into_values().collect(), within)
    }
}

/// A range (m), or as far as is looked.
fn shortened(range: f64, resolution: f64) -> f64 {
    range.min(f64::from(FARTHEST) * resolution)
}

/// How steep a way may be that is no farther aside than `aside` at `along`: not limited where it begins.
fn before(aside: f64, along: f64) -> f64 {
    if along > 0.0 { aside / along } else { f64::INFINITY }
}

/// A place to look from: the voxel, and the point in it (m, world).
pub type Place = (Voxel, Point3<f64>);

/// All of `list`, neighbours far apart.
fn spread<T: Copy>(list: &[T]) -> impl Iterator<Item = T> + '_ {
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
    use std::collections::BTreeMap;

    use proptest::prelude::*;

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

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2048))]
        #[test]
        fn the_last_voxel_before_a_target_is_known(
            from in prop::array::uniform3(prop_oneof![-9.0..9.0f64, (-90..90i32).prop_map(|i| f64::from(i) * 0.05)]),
            target in prop::array::uniform3(-40..40i32),
            far in prop_oneof![Just(0), Just(-32_000), Just(31_900)],
        ) {
            let (target, by) = (Voxel::from(target.map(|c| c + far)), f64::from(far) * 0.1);
            let from = Point3::from(from.map(|c| c + by));
            let way: Vec<Voxel> = Traversal::new(from, target.center(0.1), 0.1).collect();
            if let Some(last) = last_before(0.1, from, target) {
                prop_assert_eq!(way[way.len() - 2], last);
            }
        }
    }

    /// Every ray walked, as far as the first voxel that ends it.
    fn walked(lookout: &Lookout, free: &VoxelSet, reach: &VoxelSet, target: Voxel) -> Vec<Place> {
        let aim = target.center(lookout.resolution);
        let mut found = BTreeMap::new();
        for (face, rays) in FACES.iter().zip(&lookout.rays).filter(|(face, _)| free.contains(target + **face)) {
            for ray in rays {
                let way = lookout.way(*face, *ray);
                let ray = Traversal::new(aim, aim + way, lookout.resolution).skip_while(|voxel| *voxel == target);
                let (end, is_place) = along_ray(&mut (free.near(), reach.near()), target, ray);
                let point = nearest_on_line(aim, way.normalize(), end.center(lookout.resolution));
                if is_place && Voxel::containing(point, lookout.resolution) == end && found.len() < ENOUGH {
                    found.entry(end.raster()).or_insert((end, point));
                }
            }
        }
        found.into_values().collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(96))]
        /// What is swept away would have found nothing, wherever in the world, whatever rounding does there; nor would rays that
        /// do not come near where the robot can be. Regression: one that reached a single voxel had rays cast in all directions
        /// for each target, 37 s a plan.
        #[test]
        fn rays_that_are_not_walked_would_have_found_nothing(
            seed in any::<u32>(),
            (gaps, reached) in (prop_oneof![Just(2), Just(7), 20..200u32], prop_oneof![Just(3), Just(60), 300..2000u32]),
            far in prop_oneof![Just(0), -30_000..30_000i32],
            (range, resolution) in prop_oneof![Just((0.75, 0.1)), Just((1.0, 0.1)), Just((0.6, 0.05)), Just((3.3, 0.5))],
        ) {
            let hash = |v: Voxel, salt: u32| {
                let parts = v.to_array().map(|c| (c - far) as u32);
                parts.iter().fold(seed ^ salt, |h, c| (h ^ c).wrapping_mul(0x9e37_79b1).rotate_left(13)) >> 7
            };
            let side = || far - 9..far + 9;
            let all = side().flat_map(|x| side().flat_map(move |y| side().map(move |z| Voxel::new(x, y, z))));
            let free: VoxelSet = all.filter(|v| hash(*v, 1) % gaps > 0).collect();
            let reach: VoxelSet = free.iter().filter(|v| hash(*v, 2) % reached == 0).collect();
            let lookout = Lookout::new(range, resolution);
            let near = reach.corners().map(|corners| lookout.clone().from_within(corners));
            for target in (0..6).map(|n| Voxel::from([0, 1, 2].map(|axis| far + (hash(Voxel::new(axis, n, 0), 3) % 18) as i32 - 9))) {
                let (found, within) = lookout.viewpoints(&free, &reach, target);
                prop_assert_eq!(&found, &walked(&lookout, &free, &reach, target), "{:?}", target);
                let outside = |v: &Voxel| *v != v.sup(within[0]) || *v != v.inf(within[1]);
                prop_assert!(!found.iter().any(|(voxel, _)| outside(voxel)));
                if let Some(near) = &near {
                    prop_assert_eq!(&near.viewpoints(&free, &reach, target).0, &found);
                }
                let elsewhere = free.iter().filter(|v| outside(v) != free.contains(*v)).collect();
                prop_assert_eq!(lookout.viewpoints(&elsewhere, &reach, target), (found, within));
            }
        }
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
