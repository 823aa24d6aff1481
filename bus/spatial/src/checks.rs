//! What a value from outside has to keep to before anybody believes it: finite, within what any mission can mean, and its
//! lists as long as each other say. The messages name it field by field (see [`elk_bus::Describe`]); it is asked at every
//! decode, so that nothing behind it has to.
//!
//! The limits are those of the largest and finest map and of the parameters' own ranges. What only an app can know (its
//! resolution, how far its map reaches) is not looked at here.

use std::ops::RangeInclusive;

use elk_bus::Invalid;
pub use elk_bus::describe::MAX_COUNT;
use elk_geometry::clearance::{self, Clearance};
use elk_geometry::limits::check_point;
use elk_geometry::ray::led_through;
use elk_geometry::{OccupancyGrid, Polyline, State, Voxel};
use nalgebra::Point3;

/// What a check comes to.
pub type Checked = Result<(), Invalid>;

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
/// Times of a community's clock (s), which may be those since 1970.
pub const TIMES_S: RangeInclusive<f64> = 0.0..=LARGEST_SUM;

/// Lengths of way (m), which rounding may have put below 0 by a hair.
pub const LENGTHS_M: RangeInclusive<f64> = -1e-6..=LARGEST_SUM;
/// Largest log-odds of a voxel, either way: twice what the map's parameters allow.
const LARGEST_LOG_ODDS: f32 = 200.0;
/// Largest count of what an explorer tried with one target.
pub const MAX_TRIES: u32 = 1 << 30;

pub(crate) fn holds(field: &str, true_: bool, found: impl std::fmt::Display, wanted: &str) -> Checked {
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

/// Points of the world (m).
pub(crate) fn points(points: &[Point3<f64>]) -> Checked {
    each(points, check_point)
}

/// The corners of a way (m, world): there is one at least.
pub(crate) fn corners(corners: &[Point3<f64>]) -> Checked {
    holds("", !corners.is_empty(), "empty", "at least one point")?;
    points(corners)
}

/// Seconds of CPU by phase.
pub(crate) fn phases(cpu_secs: &[(String, f64)]) -> Checked {
    each(cpu_secs, |(name, secs)| text(name).and_then(|()| number("", *secs, SUMS, " s")))
}

/// Counts by name.
pub(crate) fn counters(counters: &[(String, u64)]) -> Checked {
    let count = |total: u64| holds("", total <= MAX_COUNT, total, "below 2^48");
    each(counters, |(name, total)| text(name).and_then(|()| count(*total)))
}

pub(crate) fn log_odds(log_odds: &[f32]) -> Checked {
    each(log_odds, |one| holds("", one.abs() <= LARGEST_LOG_ODDS, one, "-200 to 200"))
}

/// The way through points (m, world) that can be looked through voxel by voxel, with the clearance (m) that it asks for.
pub(crate) fn way(points: &[Point3<f64>], clearance_m: f64, resolution: f64) -> Result<Polyline, Invalid> {
    let radius = clearance_m / resolution;
    if !Clearance::affordable(clearance_m, resolution) {
        let wanted = format!("at most {} voxels of {resolution} m", clearance::MAX_RADIUS_VOXELS);
        return Err(Invalid::new("clearance_m", format!("{radius:.0} voxels"), wanted));
    }
    let none = || Invalid::new("points", "empty", "at least one point");
    let way = Polyline::new(points.iter().copied()).ok_or_else(none)?;
    let longest = (MAX_LOOKUPS / (2.0 * radius + 1.0).powi(3)).min(MAX_WAY_VOXELS);
    number("points", way.length() / resolution, 0.0..=longest.floor(), " voxels of way")?;
    Ok(way)
}

/// The way through the points of a path (m, world) that can be of the map that is known: no point lies farther than a brick
/// from what is known, it is no longer than a way through everything free and back, and it asks for a clearance (m) that can
/// be looked after.
///
/// # Errors
/// What it is instead.
pub fn path_in(grid: &OccupancyGrid, points: &[Point3<f64>], clearance_m: f64) -> Result<Polyline, Invalid> {
    let resolution = grid.resolution();
    let way = way(points, clearance_m, resolution)?;
    let near = |point: &Point3<f64>| {
        let near = grid.knows_near(Voxel::containing(*point, resolution));
        holds("", near, format!("({:.2}; {:.2}; {:.2})", point.x, point.y, point.z), "near what is known of the map")
    };
    each(points, near).map_err(|inner| inner.within("points"))?;
    // Diagonally through every free voxel, there and back, and something to stand on where nothing is known yet.
    let longest = 2.0 * 3f64.sqrt() * resolution * (grid.free() + 100) as f64;
    number("points", way.length(), 0.0..=longest, " m of way in a map of this size")?;
    Ok(way)
}

/// That a way leads through nothing that the map calls occupied, but for the voxel that the robot at `from` (m, world) is in.
///
/// # Errors
/// Where it does.
pub fn keeps_off_walls(grid: &OccupancyGrid, from: Point3<f64>, way: &Polyline) -> Result<(), Invalid> {
    let resolution = grid.resolution();
    let robot = Voxel::containing(from, resolution);
    let is_wall = |voxel: &Voxel| *voxel != robot && grid.state(*voxel) == State::Occupied;
    let walls =
        |part: &[Point3<f64>]| Some((part[0], part[1], led_through(part[0], part[1], resolution).find(is_wall)?));
    let shown = |p: Point3<f64>| format!("({:.2}; {:.2}; {:.2})", p.x, p.y, p.z);
    way.points().windows(2).find_map(walls).map_or(Ok(()), |(from, to, wall)| {
        let through =
            format!("from {} to {} through a wall at {}", shown(from), shown(to), shown(wall.center(resolution)));
        Err(Invalid::new("points", through, "through nothing that the map calls occupied"))
    })
}

/// Rays without a return that would be believed farther than any other ray.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "FreeNoReturn {free_m} m is farther than MaxRange, {max_range_m} m; right is at most that, or a larger MaxRange (0: no limit)"
)]
pub struct BeyondRange {
    /// How far such rays are to free (m).
    pub free_m: f64,
    /// How far the map believes any ray (m).
    pub max_range_m: f64,
}

/// Whether a map that believes rays up to `max_range_m` (0: as far as they go) may let those without a return free up to
/// `free_m`.
///
/// # Errors
/// That is farther.
pub fn within_range(free_m: f64, max_range_m: f64) -> Result<(), BeyondRange> {
    match max_range_m > 0.0 && free_m > max_range_m {
        true => Err(BeyondRange { free_m, max_range_m }),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests;
