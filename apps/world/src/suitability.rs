//! Whether a mission can be run in a world.

use elk_geometry::Bounds;
use elk_geometry::voxel::reach_m;
use nalgebra::Point3;

use crate::bvh::overlap;
use crate::exits::direction;
use crate::inspection::{Start, starts};
use crate::units::{self, Unit, shown};
use crate::world::World;

/// Rays that are cast from the start.
const RAYS: usize = 256;

/// What a mission wants of a world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// Edge of a voxel (m).
    pub resolution: f64,
    /// Where the robot starts (m, world); `None`: not said.
    pub start: Option<Point3<f64>>,
    /// Points farther than this from the camera (m) do not come into the map.
    pub range_m: f64,
    /// The volume to explore (m, world); `None`: all.
    pub volume: Option<Bounds>,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Suitability {
    /// Why the mission cannot be run.
    pub faults: Vec<String>,
    /// What will probably not be as it was meant.
    pub warnings: Vec<String>,
}

/// Holds a world against what a mission wants of it.
pub fn suitability(world: &World, wanted: &Wanted) -> Suitability {
    let mut found = Suitability { faults: Vec::new(), warnings: world.reading().remarks() };
    found.warnings.extend(world.openness().words().map(|words| {
        format!(
            "it is open: {words}. Such rays say nothing; whoever wants all of it explored closes it or sets Mid and Dim"
        )
    }));
    found.warnings.extend(unit(world));
    look_at_limits(world, wanted, &mut found);
    if let Some(start) = wanted.start {
        look_around(world, start, wanted.range_m, &mut found);
    }
    if wanted.volume.is_some_and(|volume| !overlap(&volume, &world.extents())) {
        found.warnings.push("the volume to explore (Mid, Dim of the explorer) holds nothing of it".to_owned());
    }
    found
}

/// Whether its size is that of a world in another unit.
fn unit(world: &World) -> Option<String> {
    let longest = world.extents().dim().max();
    let Unit { name, metres } = units::guess(longest).filter(|unit| unit.metres != 1.0)?;
    Some(format!("it is {longest:.4} m long: if it is drawn in {name}, say so by Scale, {metres} times what it is now"))
}

/// A map ends.
fn look_at_limits(world: &World, wanted: &Wanted, found: &mut Suitability) {
    let reach = reach_m(wanted.resolution);
    let limits = Bounds { min: [-reach; 3].into(), max: [reach; 3].into() };
    let extents = world.extents();
    if limits.contains(extents.min) && limits.contains(extents.max) {
        return;
    }
    let words = format!(
        "it reaches from {} to {}, and a map of {} m voxels from {:.1} to {:.1} m along each axis (65,536 voxels)",
        shown(&extents.min, world.digits()),
        shown(&extents.max, world.digits()),
        wanted.resolution,
        limits.min.x,
        limits.max.x
    );
    let outside = wanted.start.map_or(!overlap(&limits, &extents), |start| !limits.contains(start));
    if outside {
        found.faults.push(format!(
            "{words}: the robot would be beyond it; move the world towards the origin, or choose a larger Res"
        ));
    } else {
        found.warnings.push(format!("{words}; what lies beyond is not explored"));
    }
}

/// What a robot at the start would see.
fn look_around(world: &World, start: Point3<f64>, range_m: f64, found: &mut Suitability) {
    if !start.iter().all(|c| c.is_finite()) || !world.is_free(start) {
        let instead = match starts(world).first() {
            Some(Start { place, .. }) => format!("free is, for example, {}; {}; {}", place.x, place.y, place.z),
            None => "nothing in it is free".to_owned(),
        };
        found.faults.push(format!(
            "the start {} is inside an obstacle or outside the world; {instead}",
            shown(&start, world.digits())
        ));
        return;
    }
    let returns = (0..RAYS).filter_map(|i| world.cast(start, direction(i, RAYS)));
    let nearest = returns.fold(f64::INFINITY, f64::min);
    if nearest.is_infinite() {
        found.faults.push(format!("no ray from the start {} meets a surface", shown(&start, world.digits())));
    } else if nearest > range_m {
        found.warnings.push(format!(
            "nothing is seen from the start {}: the next surface is {nearest:.2} m away, and what is farther than {range_m} m \
             does not come into the map (Threshold of a filter, MaxRange of the map)",
            shown(&start, world.digits())
        ));
    }
}
