//! What a run saw late: could it have been seen in passing?
//!
//! Half of a way and more goes into the last hundredth of what is visible. Of the free voxels that were known only after [`LATE`] of
//! all were, this says how many lay in sight of the way that the robot had gone by then, had it only looked there, and how many it
//! would have seen for a detour of at most [`DETOUR_M`]. Poses are those at which it scanned; a voxel is in sight where nothing lies
//! between its centre and the camera, within the sensor's range.

use elk_geometry::{Voxel, VoxelSet};
use elk_world::World;
use nalgebra::{Point3, Vector3};

use crate::truth::{Truth, sees};

/// Share of what is truly visible after which a voxel is found late.
pub const LATE: f64 = 0.99;
/// The longest detour, there and back (m).
pub const DETOUR_M: f64 = 1.0;
/// Late voxels that are looked at; of more, every so manieth stands for them.
const MOST: usize = 400;
/// Poses of which detours begin are at least this far apart (m).
const APART_M: f64 = 0.5;

/// What of the free voxels that a run saw late could have been seen earlier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tail {
    /// Free voxels that were known only after [`LATE`] of all were.
    pub voxels: u64,
    /// Share of them that was in sight from a pose of the way up to there (0 to 1).
    pub in_sight: f64,
    /// Share of them that was in sight from there, or from a place to which a detour of [`DETOUR_M`] leads (0 to 1).
    pub by_detour: f64,
}

impl Tail {
    /// Of a way (m, world; a point a scan) after which `late` was found, by a sensor that sees so far (m). `None`: nothing was.
    pub fn of((world, truth): (&World, &Truth), range_m: f64, way: &[Point3<f64>], late: &VoxelSet) -> Option<Self> {
        let sample: Vec<Voxel> = late.iter().step_by(late.len().div_ceil(MOST).max(1)).collect();
        let aside = aside(world, truth, way);
        let [mut in_sight, mut by_detour] = [0_u32; 2];
        for voxel in &sample {
            let target = voxel.center(truth.resolution());
            let is_seen = |from: &Point3<f64>| (target - from).norm() <= range_m && sees(world, *from, target);
            let passed = nearest_first(way, target).iter().any(is_seen);
            in_sight += u32::from(passed);
            by_detour += u32::from(passed || nearest_first(&aside, target).iter().any(is_seen));
        }
        let share = |count: u32| f64::from(count) / sample.len() as f64;
        (!sample.is_empty()).then(|| Self {
            voxels: late.len() as u64,
            in_sight: share(in_sight),
            by_detour: share(by_detour),
        })
    }
}

/// What is near is most likely to be in sight.
fn nearest_first(places: &[Point3<f64>], target: Point3<f64>) -> Vec<Point3<f64>> {
    let mut sorted = places.to_vec();
    sorted.sort_by(|one, other| (one - target).norm_squared().total_cmp(&(other - target).norm_squared()));
    sorted
}

/// The ends of detours: places half of [`DETOUR_M`] beside the way, all around, to which the robot can go straight. A robot that never
/// left its height has none above and below.
fn aside(world: &World, truth: &Truth, way: &[Point3<f64>]) -> Vec<Point3<f64>> {
    let is_level = way.windows(2).all(|pair| (pair[0].z - pair[1].z).abs() < 1e-9) && way.len() > 1;
    let steps: Vec<Vector3<f64>> = around().filter(|step| !is_level || step.z.abs() < 1e-9).collect();
    let mut last: Option<Point3<f64>> = None;
    let mut ends = Vec::new();
    for place in way {
        if last.is_some_and(|last| (place - last).norm() < APART_M) {
            continue;
        }
        last = Some(*place);
        let can_go = |end: &Point3<f64>| truth.can_go(world, *place, *end);
        ends.extend(steps.iter().map(|step| place + 0.5 * DETOUR_M * step).filter(can_go));
    }
    ends
}

/// Directions to the faces, edges and corners of a cube.
fn around() -> impl Iterator<Item = Vector3<f64>> {
    let axis = || [-1.0, 0.0, 1.0].into_iter();
    let all = axis().flat_map(move |x| axis().flat_map(move |y| axis().map(move |z| Vector3::new(x, y, z))));
    all.filter(|step| step.norm() > 0.0).map(|step| step.normalize())
}

#[cfg(test)]
mod tests {
    use elk_world::scenery::{Scenery, Solid};

    use super::*;
    use crate::truth::Terms;

    /// A room of 4 × 4 × 2 m with a wall at x = 2 m that is open beyond y = 3 m.
    fn room() -> (World, Truth) {
        let mut scenery = Scenery::within(Solid::block("room", [0.0; 3], [4.0, 4.0, 2.0]));
        scenery.block("wall", [1.95, -0.05, -0.05], [2.05, 3.0, 2.05]);
        let world = World::from_triangles("room", scenery.triangles_at(Vector3::zeros())).unwrap();
        let truth = Truth::of(&world, Terms { resolution: 0.1, radius_m: 0.1, bounds: None }).unwrap();
        (world, truth)
    }

    fn at(x: f64, y: f64) -> Point3<f64> {
        Point3::new(x, y, 1.0)
    }

    #[test]
    fn what_was_in_sight_is_told_from_what_a_detour_would_have_shown_and_from_what_neither_would() {
        let (world, truth) = room();
        let late = |places: &[(f64, f64)]| -> VoxelSet {
            places.iter().map(|(x, y)| Voxel::containing(at(*x, *y), 0.1)).collect()
        };
        let of = |way: &[Point3<f64>], range_m: f64, places: &[(f64, f64)]| {
            let tail = Tail::of((&world, &truth), range_m, way, &late(places)).unwrap();
            (tail.voxels, tail.in_sight, tail.by_detour)
        };
        let way = [at(0.5, 0.5), at(1.0, 2.7)];
        // Before the wall; behind it, where half a metre on it is in sight; and behind it near its foot, where nothing shows it.
        let [before, beyond, far] = [(1.5, 0.5), (3.0, 3.2), (2.15, 0.5)];
        assert_eq!(of(&way, f64::INFINITY, &[before]), (1, 1.0, 1.0));
        assert_eq!(of(&way[..1], f64::INFINITY, &[far]), (1, 0.0, 0.0));
        assert_eq!(of(&[at(1.0, 2.7)], f64::INFINITY, &[(2.35, 2.95)]), (1, 0.0, 1.0));
        assert_eq!(of(&way, f64::INFINITY, &[before, far]), (2, 0.5, 0.5));
        assert_eq!(of(&way, f64::INFINITY, &[before, beyond, far]).0, 3);
        assert_eq!(of(&way, 0.3, &[before]), (1, 0.0, 0.0), "the sensor does not see that far");
        assert_eq!(Tail::of((&world, &truth), f64::INFINITY, &way, &VoxelSet::new()), None);
    }

    #[test]
    fn detours_lead_nowhere_the_robot_cannot_be_and_stay_level_where_the_way_does() {
        let (world, truth) = room();
        let level = [at(1.8, 0.5), at(1.7, 0.5), at(1.0, 0.5)];
        let ends = aside(&world, &truth, &level);
        assert!(!ends.is_empty() && ends.iter().all(|end| (end.z - 1.0).abs() < 1e-9), "{ends:?}");
        assert!(ends.iter().all(|end| end.x < 1.95), "through the wall: {ends:?}");
        let climbing = [at(1.0, 1.0), Point3::new(1.0, 1.0, 1.2)];
        assert_eq!(aside(&world, &truth, &climbing).len(), 26, "the second is too near to the first");
    }
}
