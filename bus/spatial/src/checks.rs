//! What a value from outside has to keep to before anybody believes it: finite, within what any mission can mean, and its
//! lists as long as each other say. The messages name it field by field (see [`elk_bus::Describe`]); it is asked at every
//! decode, so that nothing behind it has to.
//!
//! The limits are those of the largest and finest map and of the parameters' own ranges. What only an app can know (its
//! resolution, how far its map reaches) is not looked at here.

use std::ops::RangeInclusive;

use elk_bus::Invalid;
pub use elk_bus::describe::MAX_COUNT;
use nalgebra::Point3;

use crate::bricks::BRICK;
use crate::clearance::{self, Clearance};
use crate::map::{BrickStates, MapUpdate, OccupancyGrid};
use crate::messages::{Awaited, BrickMemory, Decision, ExplorerMemory, Leg, MotionMemory, Path};
use crate::polyline::Polyline;
use crate::pose::Pose;
use crate::scan::Scan;
use crate::voxel::{INDEX_RANGE, Voxel, reach_m};

/// What a check comes to.
pub type Checked = Result<(), Invalid>;

/// Edges of voxels (m), as the parameter `Res` has them.
pub const RESOLUTIONS_M: RangeInclusive<f64> = 0.001..=10.0;
/// Largest distance of anything from the world's origin along an axis (m): 32,768 of the coarsest voxels.
pub const FARTHEST_M: f64 = reach_m(*RESOLUTIONS_M.end());
/// Clearances (m), as the parameter `Radius` has them.
pub const CLEARANCES_M: RangeInclusive<f64> = 0.0..=10.0;
/// Lengths of way between two scans (m), as the parameter `ScanSpacing` has them.
pub const SPACINGS_M: RangeInclusive<f64> = 0.01..=1000.0;
/// Bricks of a map (8³ voxels each): 36 MB as a message.
pub const MAX_BRICKS: usize = 1 << 18;
/// Points of a scan: 2048 × 2048 pixels, 50 MB.
pub const MAX_POINTS: usize = 1 << 22;
/// Corners of a path.
pub const MAX_CORNERS: usize = 1 << 17;
/// Poses to look from at the end of a path.
pub const MAX_LOOKS: usize = 64;
/// Entries of the lists in which apps remember voxels, targets and scans.
pub const MAX_REMEMBERED: usize = 1 << 17;
/// Phases whose CPU time is told apart.
pub const MAX_PHASES: usize = 64;
/// Bytes of a text for people.
pub const MAX_TEXT: usize = 4096;
/// How far a revision may lie above what is known of the map. It grows by one a scan, and by one when a map is lost.
pub const MAX_REVISIONS_AHEAD: u64 = 1000;
/// Commands by which the sensor's count and the controller's may differ: more than get lost when several die at once.
pub const MAX_COMMANDS_LOST: u64 = 16;
/// Voxels of length that a path may have.
pub const MAX_WAY_VOXELS: f64 = 1e6;
/// Voxels to look at, all in all, to see whether a path keeps its clearance: some seconds of work.
pub const MAX_LOOKUPS: f64 = 5e8;

/// Largest length of way and amount of time that anything adds up to (m, s).
pub const LARGEST_SUM: f64 = 1e12;
/// Times that add up (s).
pub const SUMS: RangeInclusive<f64> = 0.0..=LARGEST_SUM;
/// Lengths of way (m), which rounding may have put below 0 by a hair.
pub const LENGTHS_M: RangeInclusive<f64> = -1e-6..=LARGEST_SUM;
/// Largest log-odds of a voxel, either way: twice what the map's parameters allow.
const LARGEST_LOG_ODDS: f32 = 200.0;
/// Largest count of what an explorer tried with one target.
pub const MAX_TRIES: u32 = 1 << 30;

fn holds(field: &str, true_: bool, found: impl std::fmt::Display, wanted: &str) -> Checked {
    if true_ { Ok(()) } else { Err(Invalid::new(field, found, wanted)) }
}

/// A number in a range; `unit` is for people.
fn number(field: &str, value: f64, range: RangeInclusive<f64>, unit: &str) -> Checked {
    let wanted = || format!("{} to {}{unit}", range.start(), range.end());
    holds(field, range.contains(&value), value, &wanted())
}

/// The first entry of a list that is not as it should be.
fn each<T>(entries: &[T], check: impl Fn(&T) -> Checked) -> Checked {
    let mut entries = entries.iter().enumerate();
    entries.try_for_each(|(i, entry)| check(entry).map_err(|inner| inner.within(&format!("[{i}]"))))
}

/// A text for people: not long, and without what would steer a terminal.
pub(crate) fn text(value: &str) -> Checked {
    if value.len() > MAX_TEXT {
        return Err(Invalid::new("", format!("{} bytes long", value.len()), format!("at most {MAX_TEXT} bytes")));
    }
    match value.chars().find(|c| c.is_control()) {
        None => Ok(()),
        Some(control) => Err(Invalid::new("", format!("a text with {control:?}"), "without control characters")),
    }
}

/// A count that not everybody has.
pub(crate) fn count(value: &Option<u64>) -> Checked {
    let wanted = || format!("0 to {MAX_COUNT}");
    value.map_or(Ok(()), |count| holds("", count <= MAX_COUNT, count, &wanted()))
}

/// A point of the world (m).
pub fn point(point: &Point3<f64>) -> Checked {
    let inside = |c: f64| c.abs() <= FARTHEST_M;
    match ["x", "y", "z"].into_iter().zip(point.iter()).find(|(_, c)| !inside(**c)) {
        None => Ok(()),
        Some((axis, c)) => number(axis, *c, -FARTHEST_M..=FARTHEST_M, " m"),
    }
}

/// Points of the world (m).
pub(crate) fn points(points: &[Point3<f64>]) -> Checked {
    each(points, point)
}

/// The corners of a way (m, world): there is one at least.
pub(crate) fn corners(corners: &[Point3<f64>]) -> Checked {
    holds("", !corners.is_empty(), "empty", "at least one point")?;
    points(corners)
}

/// A pose within the world; that its rotation is one, its type sees to.
pub fn pose(pose: &Pose) -> Checked {
    point(&pose.position()).map_err(|inner| inner.within("translation"))
}

/// A voxel of a map, or one beside it.
pub(crate) fn voxel(voxel: &Voxel) -> Checked {
    let range = INDEX_RANGE.start() - 1..=INDEX_RANGE.end() + 1;
    match voxel.to_array().into_iter().find(|c| !range.contains(c)) {
        None => Ok(()),
        Some(c) => Err(Invalid::new("", format!("a voxel with index {c}"), "within the 16 bits of a map")),
    }
}

/// The position of a map's brick.
pub(crate) fn brick(brick: &[i16; 3]) -> Checked {
    let range = INDEX_RANGE.start() / BRICK..=INDEX_RANGE.end() / BRICK;
    let outside = brick.iter().find(|c| !range.contains(&i32::from(**c)));
    outside.map_or(Ok(()), |c| Err(Invalid::new("", c, "-4096 to 4095")))
}

/// Seconds of CPU by phase.
pub(crate) fn phases(cpu_secs: &[(String, f64)]) -> Checked {
    each(cpu_secs, |(name, secs)| text(name).and_then(|()| number("", *secs, SUMS, " s")))
}

/// Counts by name.
pub(crate) fn counters(counters: &[(String, u64)]) -> Checked {
    each(counters, |(name, total)| text(name).and_then(|()| count(&Some(*total))))
}

/// The cells of a brick.
pub(crate) fn cells(packed: &[u8]) -> Checked {
    holds("", packed.len() == BrickStates::BYTES, format!("{} bytes long", packed.len()), "128 bytes")
}

pub(crate) fn log_odds(log_odds: &[f32]) -> Checked {
    each(log_odds, |one| holds("", one.abs() <= LARGEST_LOG_ODDS, one, "-200 to 200"))
}

pub(crate) fn map_update(update: &MapUpdate) -> Checked {
    holds("since", update.since <= update.revision, update.since, "no later than the revision")
}

pub(crate) fn brick_memory(memory: &BrickMemory) -> Checked {
    let known: u32 = memory.known.iter().map(|word| word.count_ones()).sum();
    let right = memory.log_odds.len() == known as usize;
    holds("log_odds", right, format!("a list of {}", memory.log_odds.len()), "as long as known has bits")
}

pub(crate) fn motion_memory(memory: &MotionMemory) -> Checked {
    let MotionMemory { commands, allowed, requests, .. } = *memory;
    holds("allowed", allowed <= commands, allowed, "no later than commands")?;
    match &memory.awaited {
        Awaited::Start | Awaited::Over(_) => {}
        Awaited::Map(command) => holds("awaited.Map.id", command.id == commands, command.id, "the last of commands")?,
        Awaited::Plan(asked) => holds("awaited.Plan.id", asked.id == requests, asked.id, "the last of requests")?,
    }
    let ascending = memory.samples.is_sorted_by(|one, next| one.scans < next.scans);
    holds("samples", ascending, "a list out of order", "in the order of scans")
}

pub(crate) fn leg(leg: &Leg) -> Checked {
    let Decision::Go(path) = &leg.plan.decision else { return Ok(()) };
    let way = way(path, leg.plan.motion.clearance_m, leg.resolution);
    way.map(drop).map_err(|inner| inner.within("plan.decision.Go"))
}

/// A path that can be looked through voxel by voxel, with the clearance (m) that it asks for.
fn way(path: &Path, clearance_m: f64, resolution: f64) -> Result<Polyline, Invalid> {
    let radius = clearance_m / resolution;
    if !Clearance::affordable(clearance_m, resolution) {
        let wanted = format!("at most {} voxels of {resolution} m", clearance::MAX_RADIUS_VOXELS);
        return Err(Invalid::new("clearance_m", format!("{radius:.0} voxels"), wanted));
    }
    let none = || Invalid::new("points", "empty", "at least one point");
    let way = Polyline::new(path.points.iter().copied()).ok_or_else(none)?;
    let longest = (MAX_LOOKUPS / (2.0 * radius + 1.0).powi(3)).min(MAX_WAY_VOXELS);
    number("points", way.length() / resolution, 0.0..=longest.floor(), " voxels of way")?;
    Ok(way)
}

/// The way of a path that can be of the map that is known: no point of it lies farther than a brick from what is known, it is no longer
/// than a way through everything free and back, and it asks for a clearance that can be looked after.
///
/// # Errors
/// What it is instead.
pub fn path_in(grid: &OccupancyGrid, path: &Path, clearance_m: f64) -> Result<Polyline, Invalid> {
    let resolution = grid.resolution();
    let way = way(path, clearance_m, resolution)?;
    let near = |point: &Point3<f64>| {
        let near = grid.knows_near(Voxel::containing(*point, resolution));
        holds("", near, format!("({:.2}; {:.2}; {:.2})", point.x, point.y, point.z), "near what is known of the map")
    };
    each(&path.points, near).map_err(|inner| inner.within("points"))?;
    // Diagonally through every free voxel, there and back, and something to stand on where nothing is known yet.
    let longest = 2.0 * 3f64.sqrt() * resolution * (grid.free() + 100) as f64;
    number("points", way.length(), 0.0..=longest, " m of way in a map of this size")?;
    Ok(way)
}

pub(crate) fn explorer_memory(memory: &ExplorerMemory) -> Checked {
    let at = memory.progress_at;
    holds("progress_at", at <= memory.plan.revision, at, "no later than the plan's revision")
}

pub(crate) fn scan(scan: &Scan<'_>) -> Checked {
    for (field, length) in [("points", scan.points.len()), ("no_return", scan.no_return.len())] {
        holds(field, length <= MAX_POINTS, format!("a list of {length}"), "at most 4194304 points")?;
    }
    let measured = scan.points.len() as u64..=MAX_POINTS as u64;
    let wanted = "at least the number of points, and below 2^22 + 1";
    holds("measured", measured.contains(&scan.measured), scan.measured, wanted)
}

#[cfg(test)]
mod tests;
