//! What a value from outside has to keep to before anybody believes it: finite, within what any mission can mean, and its
//! lists as long as each other say. Asked at every decode ([`elk_bus::Payload::check`]), so that nothing behind it has to.
//!
//! The limits are those of the largest and finest map and of the parameters' own ranges. What only an app can know (its
//! resolution, how far its map reaches) is not looked at here.

use std::ops::RangeInclusive;

use elk_bus::key::Invalid;
use nalgebra::Point3;

use crate::bricks::BRICK;
use crate::clearance::{self, Clearance};
use crate::map::{BrickStates, MapUpdate, OccupancyGrid};
use crate::messages::{
    AccuracyReport, Awaited, BrickMemory, CameraPose, CoverageMark, CoverageSample, Decision, ExplorationReport,
    ExplorerMemory, FrontiersLeft, Leg, MapMemory, MapStatus, MotionMemory, MotionPolicy, MotionReport, Path, Plan,
    PlanRequest, PoseCommand, Progress, RayTally, SensorReport, Standing, TargetRecord,
};
use crate::polyline::Polyline;
use crate::pose::Pose;
use crate::scan::Scan;
use crate::voxel::{INDEX_RANGE, Voxel, reach_m};

/// What a check comes to.
pub type Checked = Result<(), Invalid>;

/// The largest count, number or revision: one more never overflows, and a double holds it exactly.
pub const MAX_COUNT: u64 = (1 << 48) - 1;
/// Edges of voxels (m), as the parameter `Res` has them.
pub const RESOLUTIONS_M: RangeInclusive<f64> = 0.001..=10.0;
/// Largest distance of anything from the world's origin along an axis (m): 32,768 of the coarsest voxels.
pub const FARTHEST_M: f64 = reach_m(*RESOLUTIONS_M.end());
/// Clearances (m), as the parameter `Radius` has them.
pub const CLEARANCES_M: RangeInclusive<f64> = 0.0..=10.0;
/// Lengths of way between two scans (m), as the parameter `ScanSpacing` has them.
pub const SPACINGS_M: RangeInclusive<f64> = 0.01..=1000.0;
/// How far a rotation's quaternion may be from length one: what people round to three digits still turns.
pub const UNIT_TOLERANCE: f64 = 1e-3;
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
/// Largest log-odds of a voxel: twice what the map's parameters allow.
const LOG_ODDS: RangeInclusive<f64> = -200.0..=200.0;
/// Largest count of what an explorer tried with one target.
pub const MAX_TRIES: u32 = 1 << 30;

/// The same, of what lies in `field`.
fn within(field: &str, checked: Checked) -> Checked {
    checked.map_err(|inner| {
        let joint = if inner.field.is_empty() || inner.field.starts_with('[') { "" } else { "." };
        Invalid { field: format!("{field}{joint}{}", inner.field), ..inner }
    })
}

/// A list of at most `most` entries, each of which is as it should be.
fn list<T>(field: &str, entries: &[T], most: usize, check: impl Fn(&T) -> Checked) -> Checked {
    if entries.len() > most {
        return Err(Invalid::new(field, format!("a list of {}", entries.len()), format!("at most {most} entries")));
    }
    let wrong = |(i, entry)| check(entry).map_err(|inner| (i, inner));
    match entries.iter().enumerate().try_for_each(wrong) {
        Ok(()) => Ok(()),
        Err((i, inner)) => within(field, within(&format!("[{i}]"), Err(inner))),
    }
}

fn holds(field: &str, true_: bool, found: impl std::fmt::Display, wanted: &str) -> Checked {
    if true_ { Ok(()) } else { Err(Invalid::new(field, found, wanted)) }
}

/// A number in a range; `unit` is for people.
fn number(field: &str, value: f64, range: RangeInclusive<f64>, unit: &str) -> Checked {
    if range.contains(&value) {
        return Ok(());
    }
    Err(Invalid::new(field, value, format!("{} to {}{unit}", range.start(), range.end())))
}

/// A count, or the number of something that is counted.
pub fn count(field: &str, value: u64) -> Checked {
    holds(field, value <= MAX_COUNT, value, "below 2^48")
}

fn counts<const N: usize>(fields: [(&str, u64); N]) -> Checked {
    fields.into_iter().try_for_each(|(field, value)| count(field, value))
}

/// Edge of a voxel (m).
pub fn resolution(field: &str, value: f64) -> Checked {
    number(field, value, RESOLUTIONS_M, " m")
}

/// A sum of lengths or times (m or s).
fn sum(field: &str, value: f64) -> Checked {
    number(field, value, 0.0..=LARGEST_SUM, "")
}

/// A length of way, which rounding may have put below 0 by a hair (m).
fn length(field: &str, value: f64) -> Checked {
    number(field, value, -1e-6..=LARGEST_SUM, " m")
}

fn share(field: &str, value: f64) -> Checked {
    number(field, value, 0.0..=1.0, "")
}

/// A text for people: not long, and without what would steer a terminal.
fn text(field: &str, value: &str) -> Checked {
    if value.len() > MAX_TEXT {
        return Err(Invalid::new(field, format!("{} bytes long", value.len()), format!("at most {MAX_TEXT} bytes")));
    }
    match value.chars().find(|c| c.is_control()) {
        None => Ok(()),
        Some(control) => Err(Invalid::new(field, format!("a text with {control:?}"), "without control characters")),
    }
}

/// A point of the world (m).
pub fn point(point: &Point3<f64>) -> Checked {
    let inside = |c: f64| c.abs() <= FARTHEST_M;
    match ["x", "y", "z"].into_iter().zip(point.iter()).find(|(_, c)| !inside(**c)) {
        None => Ok(()),
        Some((axis, c)) => number(axis, *c, -FARTHEST_M..=FARTHEST_M, " m"),
    }
}

/// A pose in the world.
pub fn pose(pose: &Pose) -> Checked {
    within("translation", point(&pose.position()))?;
    let length = pose.0.rotation.coords.norm();
    let unit = (length - 1.0).abs() <= UNIT_TOLERANCE;
    holds("rotation", unit, format!("a quaternion of length {length}"), "of length 1")
}

/// A voxel of a map, or one beside it.
fn voxel(voxel: &Voxel) -> Checked {
    let range = INDEX_RANGE.start() - 1..=INDEX_RANGE.end() + 1;
    match voxel.to_array().into_iter().find(|c| !range.contains(c)) {
        None => Ok(()),
        Some(c) => Err(Invalid::new("", format!("a voxel with index {c}"), "within the 16 bits of a map")),
    }
}

/// The position of a map's brick.
fn brick(brick: [i16; 3]) -> Checked {
    let range = INDEX_RANGE.start() / BRICK..=INDEX_RANGE.end() / BRICK;
    let outside = brick.into_iter().find(|c| !range.contains(&i32::from(*c)));
    outside.map_or(Ok(()), |c| Err(Invalid::new("brick", c, "-4096 to 4095")))
}

pub(crate) fn pose_command(command: &PoseCommand) -> Checked {
    count("id", command.id)?;
    list("via", &command.via, MAX_CORNERS, point)?;
    within("pose", pose(&command.pose))
}

pub(crate) fn camera_pose(camera: &CameraPose) -> Checked {
    count("command", camera.command)?;
    within("pose", pose(&camera.pose))
}

pub(crate) fn sensor_report(report: &SensorReport) -> Checked {
    counts([("scans", report.scans), ("contacts", report.contacts), ("scan", report.scan)])?;
    sum("cpu_secs", report.cpu_secs)
}

pub(crate) fn accuracy_report(report: &AccuracyReport) -> Checked {
    counts([("revision", report.revision), ("voxels", report.voxels)])?;
    share("accuracy", report.accuracy)
}

pub(crate) fn map_status(status: &MapStatus) -> Checked {
    let MapStatus { revision, free, occupied, frontier, .. } = *status;
    counts([("revision", revision), ("free", free), ("occupied", occupied), ("frontier", frontier)])?;
    resolution("resolution", status.resolution)?;
    sum("cpu_secs", status.cpu_secs)?;
    within("rays", ray_tally(&status.rays))
}

fn ray_tally(rays: &RayTally) -> Checked {
    let RayTally { no_return, measured, received, invalid, outside, too_far, no_room } = *rays;
    counts([("no_return", no_return), ("measured", measured), ("received", received), ("invalid", invalid)])?;
    counts([("outside", outside), ("too_far", too_far), ("no_room", no_room)])
}

pub(crate) fn plan_request(request: &PlanRequest) -> Checked {
    counts([("id", request.id), ("revision", request.revision)])?;
    within("pose", pose(&request.pose))
}

pub(crate) fn plan(plan: &Plan) -> Checked {
    counts([("request", plan.request), ("revision", plan.revision)])?;
    if let Decision::Go(way) = &plan.decision {
        within("decision", path(way))?;
    }
    within("motion", motion_policy(&plan.motion))?;
    sum("cpu_secs", plan.cpu_secs)
}

fn path(path: &Path) -> Checked {
    holds("points", !path.points.is_empty(), "empty", "at least one point")?;
    list("points", &path.points, MAX_CORNERS, point)?;
    within("target", voxel(&path.target))?;
    list("unknown", &path.unknown, 6, voxel)?;
    list("looks", &path.looks, MAX_LOOKS, pose)
}

fn motion_policy(motion: &MotionPolicy) -> Checked {
    text("name", &motion.name)?;
    number("scan_spacing_m", motion.scan_spacing_m, SPACINGS_M, " m")?;
    number("clearance_m", motion.clearance_m, CLEARANCES_M, " m")
}

pub(crate) fn exploration_report(report: &ExplorationReport) -> Checked {
    let ExplorationReport { explorer, policy, settings, reason, .. } = report;
    let texts = [("explorer", explorer), ("policy", policy), ("settings", settings), ("reason", reason)];
    texts.into_iter().try_for_each(|(field, value)| text(field, value))?;
    counts([("plans", report.plans), ("stalls", report.stalls)])?;
    within("frontiers_left", frontiers_left(&report.frontiers_left))?;
    phases(&report.cpu_secs)
}

fn frontiers_left(left: &FrontiersLeft) -> Checked {
    let FrontiersLeft {
        unreachable,
        invisible,
        unresolved,
        no_return,
        too_small,
        open,
        map_edge,
        no_room,
        volume_edge,
    } = *left;
    counts([("unreachable", unreachable), ("invisible", invisible), ("unresolved", unresolved)])?;
    counts([("no_return", no_return), ("too_small", too_small), ("open", open)])?;
    counts([("map_edge", map_edge), ("no_room", no_room), ("volume_edge", volume_edge)])
}

fn phases(cpu_secs: &[(String, f64)]) -> Checked {
    list("cpu_secs", cpu_secs, MAX_PHASES, |(name, secs)| text("name", name).and_then(|()| sum("secs", *secs)))
}

pub(crate) fn progress(progress: &Progress) -> Checked {
    let Progress { scan, revision, scans, free, .. } = *progress;
    counts([("scan", scan), ("revision", revision), ("scans", scans), ("free", free)])?;
    length("path_length_m", progress.path_length_m)
}

pub(crate) fn motion_report(report: &MotionReport) -> Checked {
    counts([("scans", report.scans), ("free", report.free)])?;
    length("path_length_m", report.path_length_m)?;
    list("marks", &report.marks, MAX_PHASES, |mark: &CoverageMark| {
        share("share", mark.share)?;
        count("scans", mark.scans)?;
        length("path_length_m", mark.path_length_m)
    })
}

pub(crate) fn map_update(update: &MapUpdate) -> Checked {
    counts([("revision", update.revision), ("since", update.since), ("scan", update.scan)])?;
    let onward = update.since <= update.revision;
    holds("since", onward, update.since, "no later than the revision")?;
    resolution("resolution", update.resolution)?;
    list("bricks", &update.bricks, MAX_BRICKS, |states: &BrickStates| {
        brick(states.brick)?;
        holds("states", states.states.len() == BrickStates::BYTES, states.states.len(), "128 bytes")
    })
}

pub(crate) fn map_memory(memory: &MapMemory) -> Checked {
    counts([("revision", memory.revision), ("scan", memory.scan)])?;
    resolution("resolution", memory.resolution)?;
    list("bricks", &memory.bricks, MAX_BRICKS, brick_memory)
}

fn brick_memory(memory: &BrickMemory) -> Checked {
    brick(memory.brick)?;
    let known: u32 = memory.known.iter().map(|word| word.count_ones()).sum();
    let right = memory.log_odds.len() == known as usize;
    holds("log_odds", right, format!("a list of {}", memory.log_odds.len()), "as long as known has bits")?;
    list("log_odds", &memory.log_odds, usize::MAX, |log_odds| number("", f64::from(*log_odds), LOG_ODDS, ""))
}

pub(crate) fn motion_memory(memory: &MotionMemory) -> Checked {
    within("pose", pose(&memory.pose))?;
    let MotionMemory { commands, allowed, steps, requests, .. } = *memory;
    counts([("commands", commands), ("allowed", allowed), ("steps", steps), ("requests", requests)])?;
    holds("allowed", allowed <= commands, allowed, "no later than commands")?;
    within("awaited", awaited(&memory.awaited, memory))?;
    length("path_length_m", memory.path_length_m)?;
    memory.leg.as_ref().map_or(Ok(()), |underway| within("leg", leg(underway)))?;
    list("samples", &memory.samples, MAX_REMEMBERED, |sample: &CoverageSample| {
        counts([("scans", sample.scans), ("free", sample.free)])?;
        length("path_length_m", sample.path_length_m)
    })?;
    let ascending = memory.samples.is_sorted_by(|one, next| one.scans < next.scans);
    holds("samples", ascending, "a list out of order", "in the order of scans")
}

fn awaited(awaited: &Awaited, memory: &MotionMemory) -> Checked {
    match awaited {
        Awaited::Start => Ok(()),
        Awaited::Map(command) => {
            pose_command(command)?;
            holds("id", command.id == memory.commands, command.id, "the last of commands")
        }
        Awaited::Plan(request) => {
            plan_request(request)?;
            holds("id", request.id == memory.requests, request.id, "the last of requests")
        }
        Awaited::Over(last) => progress(last),
    }
}

fn leg(leg: &Leg) -> Checked {
    within("plan", plan(&leg.plan))?;
    resolution("resolution", leg.resolution)?;
    if let Decision::Go(path) = &leg.plan.decision {
        within("plan", within("decision", way(path, leg.plan.motion.clearance_m, leg.resolution).map(drop)))?;
    }
    list("allowed", &leg.allowed, MAX_REMEMBERED, voxel)?;
    length("done_m", leg.done_m)?;
    length("step_m", leg.step_m)?;
    count("looks", leg.looks)
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
    list("points", &path.points, MAX_CORNERS, |point| {
        let near = grid.knows_near(Voxel::containing(*point, resolution));
        holds("", near, format!("({:.2}; {:.2}; {:.2})", point.x, point.y, point.z), "near what is known of the map")
    })?;
    // Diagonally through every free voxel, there and back, and something to stand on where nothing is known yet.
    let longest = 2.0 * 3f64.sqrt() * resolution * (grid.free() + 100) as f64;
    number("points", way.length(), 0.0..=longest, " m of way in a map of this size")?;
    Ok(way)
}

pub(crate) fn explorer_memory(memory: &ExplorerMemory) -> Checked {
    within("plan", plan(&memory.plan))?;
    memory.ended.as_ref().map_or(Ok(()), |report| within("ended", exploration_report(report)))?;
    let ExplorerMemory { plans, stalls, fallbacks, iterations, progress_at, refused, .. } = *memory;
    counts([("plans", plans), ("stalls", stalls), ("fallbacks", fallbacks), ("iterations", iterations)])?;
    counts([("refused", refused), ("no_return", memory.no_return)])?;
    phases(&memory.cpu_secs)?;
    list("trail", &memory.trail, MAX_REMEMBERED, voxel)?;
    list("targets", &memory.targets, MAX_REMEMBERED, target_record)?;
    list("hidden", &memory.hidden, MAX_REMEMBERED, voxel)?;
    let Standing { free, occupied, frontier, attempts } = memory.standing;
    let standing = [("free", free), ("occupied", occupied), ("frontier", frontier), ("attempts", attempts)];
    within("standing", counts(standing))?;
    holds("progress_at", progress_at <= memory.plan.revision, progress_at, "no later than the plan's revision")
}

fn target_record(record: &TargetRecord) -> Checked {
    within("target", voxel(&record.target))?;
    list("tried", &record.tried, MAX_CORNERS, voxel)?;
    let tries = |field, value: u32| holds(field, value <= MAX_TRIES, value, "at most 2^30");
    tries("cuts", record.cuts).and_then(|()| tries("planned", record.planned))
}

/// Points and directions that are not finite the map leaves out one by one; to look for them here would cost a walk over
/// all.
pub(crate) fn scan(scan: &Scan<'_>) -> Checked {
    counts([("id", scan.id), ("command", scan.command)])?;
    within("pose", pose(&scan.pose))?;
    number("range_m", scan.range_m, 0.0..=FARTHEST_M, " m")?;
    for (field, length) in [("points", scan.points.len()), ("no_return", scan.no_return.len())] {
        holds(field, length <= MAX_POINTS, format!("a list of {length}"), "at most 4194304 points")?;
    }
    let measured = scan.points.len() as u64..=MAX_POINTS as u64;
    holds(
        "measured",
        measured.contains(&scan.measured),
        scan.measured,
        "at least the number of points, and below 2^22 + 1",
    )
}

#[cfg(test)]
mod tests;
