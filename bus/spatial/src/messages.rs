//! What the apps of an exploration say to each other, in the order in which a step says it; and at the end their memories:
//! what each says to its own successor.

use elk_bus::payload;
use elk_geometry::limits::RESOLUTIONS_M;
use elk_geometry::state::check_brick;
use elk_geometry::{Pose, Voxel};
use nalgebra::Point3;

use crate::camera::CameraInfo;
use crate::checks;
use crate::rays::RayTally;
use crate::travel::Drive;

/// Controller to sensor: go there and take a scan. A sensor of a recording cannot go: for it, it is the word to take the next one.
#[payload]
#[describe(drawn = "pose")]
#[derive(Debug, Clone, PartialEq)]
pub struct PoseCommand {
    /// Number of the command, from 1, unbroken; the scan that answers carries it.
    #[describe(count)]
    pub id: u64,
    /// Positions (m, world) to pass on the way from where the camera is, in straight lines from one to the next and
    /// from the last one to `pose`. Empty: go straight, or turn on the spot. Contacts are judged on every segment.
    #[describe(unit = "m", any, longest = checks::MAX_CORNERS, check = checks::points)]
    pub via: Vec<Point3<f64>>,
    /// The camera's pose to take (world).
    pub pose: Pose,
}

/// Sensor to anyone, on start-up and after every motion: where the camera is.
#[payload]
#[describe(drawn = "pose")]
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPose {
    /// The last pose command carried out; 0: none yet, this is the start.
    #[describe(count)]
    pub command: u64,
    /// The camera's pose (world).
    pub pose: Pose,
}

/// Sensor to anyone, with each pose, and before the scan that is taken there: how much it has done so far, and what a
/// simulated one knows of its true world. A successor knows by it, the pose and the last scan where to go on.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct SensorReport {
    /// Scans taken.
    #[describe(count)]
    pub scans: u64,
    /// Motions on which the robot's body touched the true world; none: it is not known, as a real camera's is not.
    #[describe(count)]
    pub contacts: Option<u64>,
    /// The scan after which this was said.
    #[describe(count)]
    pub scan: u64,
    /// Seconds of CPU spent on scans.
    #[describe(unit = "s", range = checks::SUMS)]
    pub cpu_secs: f64,
}

/// Sensor to anyone: the final map held against the true world.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct AccuracyReport {
    /// Revision of the map that was judged.
    #[describe(count)]
    pub revision: u64,
    /// Known voxels whose state is that of the true world, of all known voxels (0 to 1).
    #[describe(range = 0.0..=1.0)]
    pub accuracy: f64,
    /// Known voxels judged.
    #[describe(count)]
    pub voxels: u64,
}

/// Map to anyone: how much is known.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct MapStatus {
    /// Revision of the map that this describes.
    #[describe(count)]
    pub revision: u64,
    /// Free voxels.
    #[describe(count)]
    pub free: u64,
    /// Occupied voxels.
    #[describe(count)]
    pub occupied: u64,
    /// Frontier voxels of the whole map, reachable or not.
    #[describe(count)]
    pub frontier: u64,
    /// Edge of a voxel (m).
    #[describe(unit = "m", range = RESOLUTIONS_M)]
    pub resolution: f64,
    /// Seconds of CPU spent on insertion.
    #[describe(unit = "s", range = checks::SUMS)]
    pub cpu_secs: f64,
    /// Whether it has all the bricks that it may have (`MaxBricks`): of what lies in others it comes to know nothing.
    pub full: bool,
    /// What became of the rays of all scans so far.
    pub rays: RayTally,
    /// The camera that the last scan was taken with.
    pub camera: CameraInfo,
}

/// Controller to explorer: where to go from here?
#[payload]
#[describe(drawn = "pose")]
#[derive(Debug, Clone, PartialEq)]
pub struct PlanRequest {
    /// Number of the request, from 1, unbroken.
    #[describe(count)]
    pub id: u64,
    /// The camera's pose now (world).
    pub pose: Pose,
    /// The revision that the map has to be at for the answer.
    #[describe(count)]
    pub revision: u64,
    /// What became of the plan before.
    pub outcome: Outcome,
}

/// Explorer to controller: the answer to a [`PlanRequest`].
#[payload]
#[describe(drawn = "poses")]
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The request that it answers.
    #[describe(count)]
    pub request: u64,
    /// The revision of the map that it was made from.
    #[describe(count)]
    pub revision: u64,
    /// Where to go, or that there is nowhere left to go.
    pub decision: Decision,
    /// How the controller is to move and scan along the path; one for all strategies.
    pub motion: MotionPolicy,
    /// Seconds of CPU that the planning took.
    #[describe(unit = "s", range = checks::SUMS)]
    pub cpu_secs: f64,
}

/// Explorer to anyone, once, with its last plan: why it ended and what is left.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct ExplorationReport {
    /// The explorer's type.
    #[describe(check = checks::text)]
    pub explorer: String,
    /// The motion policy's name.
    #[describe(check = checks::text)]
    pub policy: String,
    /// Strategy, policy and clearance with all their settings, for people.
    #[describe(check = checks::text)]
    pub settings: String,
    /// Whether every frontier that can be reached and seen is resolved.
    pub complete: bool,
    /// Why it ended, for people.
    #[describe(check = checks::text)]
    pub reason: String,
    /// Frontier voxels left, by cause.
    pub frontiers_left: FrontiersLeft,
    /// Plans made.
    #[describe(count)]
    pub plans: u64,
    /// What the strategy counted, by name.
    #[describe(longest = checks::MAX_PHASES, check = checks::counters)]
    pub counters: Vec<(String, u64)>,
    /// Seconds of CPU by phase of planning, by name.
    #[describe(unit = "s", longest = checks::MAX_PHASES, check = checks::phases)]
    pub cpu_secs: Vec<(String, f64)>,
}

/// Controller to anyone, after every scan that is in the map: how far the run is.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// The scan after which this holds.
    #[describe(count)]
    pub scan: u64,
    /// Revision of the map.
    #[describe(count)]
    pub revision: u64,
    /// Scans so far.
    #[describe(count)]
    pub scans: u64,
    /// Length of the way so far (m).
    #[describe(unit = "m", range = checks::LENGTHS_M)]
    pub path_length_m: f64,
    /// Free voxels known.
    #[describe(count)]
    pub free: u64,
    /// Whether the run is over.
    pub finished: bool,
}

/// Controller to anyone, once, when the run is over: what it cost to get how far.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct MotionReport {
    /// Scans taken.
    #[describe(count)]
    pub scans: u64,
    /// Length of the way (m).
    #[describe(unit = "m", range = checks::LENGTHS_M)]
    pub path_length_m: f64,
    /// Free voxels known at the end.
    #[describe(count)]
    pub free: u64,
    /// Scans and way to 95, 99, 99.9 and 100 % of these free voxels.
    #[describe(longest = checks::MAX_PHASES)]
    pub marks: Vec<CoverageMark>,
}

/// Map to its successor: all that it knows.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct MapMemory {
    /// The map's revision.
    #[describe(count)]
    pub revision: u64,
    /// The last scan in it (see [`crate::Scan::id`]).
    #[describe(count)]
    pub scan: u64,
    /// Edge of a voxel (m).
    #[describe(unit = "m", range = RESOLUTIONS_M)]
    pub resolution: f64,
    /// The bricks, in the order in which they were first entered.
    #[describe(longest = checks::MAX_BRICKS)]
    pub bricks: Vec<BrickMemory>,
}

/// Controller to its successor: how it stands.
#[payload]
#[describe(check = motion_memory)]
#[derive(Debug, Clone, PartialEq)]
pub struct MotionMemory {
    /// The camera's pose (world), once the last command is carried out.
    pub pose: Pose,
    /// What it waits for.
    pub awaited: Awaited,
    /// The last pose command made.
    #[describe(count)]
    pub commands: u64,
    /// The last pose command that was not held back by a pause.
    #[describe(count)]
    pub allowed: u64,
    /// Steps that a person allowed and that were not taken yet.
    #[describe(count)]
    pub steps: u64,
    /// When the latest step that it has heard of was allowed (s, the community's clock).
    #[describe(unit = "s")]
    pub last_step: Option<f64>,
    /// The last plan request made.
    #[describe(count)]
    pub requests: u64,
    /// Length of the way so far (m).
    #[describe(unit = "m", range = checks::LENGTHS_M)]
    pub path_length_m: f64,
    /// The path that it is on.
    pub leg: Option<Leg>,
    /// How it moves, of a robot that takes its time, or of one before it that did.
    #[describe(default)]
    pub drive: Option<Drive>,
    /// What was known after each scan so far; of a very long run, after some of them and the last.
    #[describe(longest = checks::MAX_REMEMBERED)]
    pub samples: Vec<CoverageSample>,
}

/// Explorer to its successor, of whatever type: what it knows.
#[payload]
#[describe(check = explorer_memory)]
#[derive(Debug, Clone, PartialEq)]
pub struct ExplorerMemory {
    /// The last plan.
    pub plan: Plan,
    /// Why it ended, if that was the last plan.
    pub ended: Option<ExplorationReport>,
    /// Plans made.
    #[describe(count)]
    pub plans: u64,
    /// Plans for which the strategy had no answer.
    #[describe(count)]
    pub fallbacks: u64,
    /// What the strategy counted, by name.
    #[describe(longest = checks::MAX_PHASES, check = checks::counters)]
    pub counters: Vec<(String, u64)>,
    /// The strategy that remembers something itself, for the next one of its name: under this variable's name, and its own.
    pub strategy: Option<String>,
    /// Seconds of CPU by phase of planning, by name.
    #[describe(unit = "s", longest = checks::MAX_PHASES, check = checks::phases)]
    pub cpu_secs: Vec<(String, f64)>,
    /// Whether `lists` has only what has come since the [`ExplorerPast`] that was said last, which has the rest: what is in both is as
    /// it is here.
    pub goes_on: bool,
    /// What it remembers of places.
    pub lists: ExplorerPast,
    /// How things stood when they last changed.
    pub standing: Standing,
    /// The map's revision then.
    #[describe(count)]
    pub progress_at: u64,
    /// Paths on which the sensor did not take a single step.
    #[describe(count)]
    pub refused: u64,
    /// Rays of all scans that had gone without a return when the last plan was made.
    #[describe(count)]
    pub no_return: u64,
}

/// Explorer to its successor, of whatever type: the long lists of what it knows, as they were with the memory said before. It is
/// said now and then, so that a memory need not have all of them each time.
#[payload]
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ExplorerPast {
    /// The voxels that the robot went through, in lexicographic order.
    #[describe(longest = checks::MAX_REMEMBERED)]
    pub trail: Vec<Voxel>,
    /// What came of the targets, in lexicographic order.
    #[describe(longest = checks::MAX_REMEMBERED)]
    pub targets: Vec<TargetRecord>,
    /// Targets that no new place saw when they were last looked for, in lexicographic order.
    #[describe(longest = checks::MAX_REMEMBERED)]
    pub hidden: Vec<Voxel>,
    /// Voxels of ways on which the sensor refused to go, in lexicographic order.
    #[describe(longest = checks::MAX_REMEMBERED)]
    pub barred: Vec<Voxel>,
}

impl ExplorerPast {
    /// How long the lists are together.
    pub fn entries(&self) -> usize {
        self.trail.len() + self.targets.len() + self.hidden.len() + self.barred.len()
    }
}

/// When a share of what was known in the end was first known.
#[payload]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoverageMark {
    /// Share of the free voxels known at the end (0 to 1).
    #[describe(range = 0.0..=1.0)]
    pub share: f64,
    /// Scans taken by then.
    #[describe(count)]
    pub scans: u64,
    /// Length of the way by then (m).
    #[describe(unit = "m", range = checks::LENGTHS_M)]
    pub path_length_m: f64,
}

/// What was known after a scan.
#[payload]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoverageSample {
    /// Scans taken by then.
    #[describe(count)]
    pub scans: u64,
    /// Free voxels known.
    #[describe(count)]
    pub free: u64,
    /// Length of the way by then (m).
    #[describe(unit = "m", range = checks::LENGTHS_M)]
    pub path_length_m: f64,
}

/// What a controller waits for.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub enum Awaited {
    /// The camera's first pose.
    Start,
    /// The map with the scan of this command, its last, in it.
    Map(PoseCommand),
    /// The answer to this request, its last.
    Plan(PlanRequest),
    /// Nothing: the run is over, and this is how far it came.
    Over(Progress),
}

/// A path on the way.
#[payload]
#[describe(check = leg)]
#[derive(Debug, Clone, PartialEq)]
pub struct Leg {
    /// The plan that it is of.
    pub plan: Plan,
    /// Edge of a voxel of the map (m).
    #[describe(unit = "m", range = RESOLUTIONS_M)]
    pub resolution: f64,
    /// Where the robot is too close to something from the start, as the explorer knows.
    #[describe(longest = checks::MAX_REMEMBERED)]
    pub allowed: Vec<Voxel>,
    /// Length of way done (m).
    #[describe(unit = "m", range = checks::LENGTHS_M)]
    pub done_m: f64,
    /// Length of the last step (m).
    #[describe(unit = "m", range = checks::LENGTHS_M)]
    pub step_m: f64,
    /// What it ended by that no map shows: the sensor refused to go on, or knew better where it was.
    pub ended: Option<Outcome>,
    /// Looks taken at its end.
    #[describe(count)]
    pub looks: u64,
}

/// A brick of the map as the map knows it (cells as in [`elk_geometry::bricks::cell_of`], cell `i` in bit `i mod 64` of word
/// `i / 64`).
#[payload]
#[describe(check = brick_memory)]
#[derive(Debug, Clone, PartialEq)]
pub struct BrickMemory {
    /// The brick's position, in bricks.
    #[describe(check = check_brick)]
    pub brick: [i16; 3],
    /// The cells that were ever updated.
    pub known: [u64; 8],
    /// The cells that were ever hit.
    pub ever_hit: [u64; 8],
    /// Log-odds of being occupied of the known cells, ascending by cell.
    #[describe(any, check = checks::log_odds)]
    pub log_odds: Vec<f32>,
}

/// What came of an explorer's target.
#[payload]
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TargetRecord {
    /// The frontier voxel.
    pub target: Voxel,
    /// The voxels from which it was looked at in vain.
    #[describe(longest = checks::MAX_CORNERS)]
    pub tried: Vec<Voxel>,
    /// Paths to it that were cut in a row.
    #[describe(range = 0..=checks::MAX_TRIES)]
    pub cuts: u32,
    /// Plans made for it.
    #[describe(range = 0..=checks::MAX_TRIES)]
    pub planned: u32,
    /// When it was looked at in vain, rays went without a return.
    pub no_return: bool,
}

/// What changes as long as there is progress. A voxel that flickers changes it too, but is given up in time.
#[payload]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Standing {
    /// Free voxels.
    #[describe(count)]
    pub free: u64,
    /// Occupied voxels.
    #[describe(count)]
    pub occupied: u64,
    /// Frontier voxels.
    #[describe(count)]
    pub frontier: u64,
    /// Looks in vain.
    #[describe(count)]
    pub attempts: u64,
}

/// What became of a plan.
#[payload]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// There was none: this is the first request.
    First,
    /// Its target is resolved.
    Resolved,
    /// Followed to the end, every look taken, and the target is still unresolved.
    Unresolved,
    /// New obstacles cut the path before its end.
    Cut,
    /// The sensor refused the next step: something is in the way that the map does not show.
    Refused,
}

/// What an explorer decides.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub enum Decision {
    /// Follow this path.
    Go(Path),
    /// Exploration is over; the reason is in the [`ExplorationReport`].
    Done,
}

/// A way to a frontier voxel.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    /// Positions to pass in straight lines (m, world), the robot's own first. A single one: look from where you are.
    #[describe(unit = "m", any, longest = checks::MAX_CORNERS, check = checks::corners)]
    pub points: Vec<Point3<f64>>,
    /// The frontier voxel to be resolved.
    pub target: Voxel,
    /// Its unknown neighbours: it is resolved once they are all known, or it is no longer free.
    #[describe(longest = 6)]
    pub unknown: Vec<Voxel>,
    /// Poses to scan from at the end of the path, in order, as long as the target is not resolved.
    #[describe(longest = checks::MAX_LOOKS)]
    pub looks: Vec<Pose>,
    /// Whether all that is to be seen there is known already, and is looked at again: no map of three values tells when that is
    /// resolved, so all looks are taken.
    #[describe(default)]
    pub again: bool,
}

/// How to move and when to scan: the same for all strategies (thesis 6.5.1, and what a prototype paid for).
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct MotionPolicy {
    /// The policy's name: `thesis` or `elk`.
    #[describe(check = checks::text)]
    pub name: String,
    /// Length of way between two scans (m).
    #[describe(unit = "m", range = checks::SPACINGS_M)]
    pub scan_spacing_m: f64,
    /// Ask for a new plan as soon as the target is no longer a frontier.
    pub early_stop: bool,
    /// Look at the target while travelling; otherwise along the motion.
    pub look_at_target: bool,
    /// The robot's clearance from occupied voxels (m, see [`elk_geometry::clearance`]): a path that comes closer is cut.
    #[describe(unit = "m", range = checks::CLEARANCES_M)]
    pub clearance_m: f64,
    /// The sensor sees a plane alone and is kept level on the way; so is the clearance, as what is above and below nobody knows.
    #[describe(default)]
    pub level: bool,
}

/// Frontier voxels that exploration leaves behind, by cause.
#[payload]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrontiersLeft {
    /// Not in the free component of the robot.
    #[describe(count)]
    pub unreachable: u64,
    /// No pose that the robot can take sees the unknown beyond them.
    #[describe(count)]
    pub invisible: u64,
    /// Looked at as often as the policy allows, and still there.
    #[describe(count)]
    pub unresolved: u64,
    /// The same, while rays went without a return: the world is open there, or goes on beyond the sensor's range.
    #[describe(count)]
    pub no_return: u64,
    /// In clusters below the size that counts.
    #[describe(count)]
    pub too_small: u64,
    /// Still to be resolved when the run ended before its time.
    #[describe(count)]
    pub open: u64,
    /// Where the map ends: it has no place for what is beyond (65,536 voxels an axis).
    #[describe(count)]
    pub map_edge: u64,
    /// Where a full map has no brick (`MaxBricks`): what is there it cannot come to know.
    #[describe(count)]
    pub no_room: u64,
    /// Where the volume to explore ends (`Mid`, `Dim`): what is beyond is not asked for.
    #[describe(count)]
    pub volume_edge: u64,
}

impl FrontiersLeft {
    /// All of them.
    pub fn total(&self) -> u64 {
        let looked_for = self.unreachable + self.invisible + self.unresolved + self.too_small + self.open;
        looked_for + self.no_return + self.map_edge + self.no_room + self.volume_edge
    }
}

/// There is one number for each known cell.
fn brick_memory(memory: &BrickMemory) -> checks::Checked {
    let known: u32 = memory.known.iter().map(|word| word.count_ones()).sum();
    let right = memory.log_odds.len() == known as usize;
    checks::holds("log_odds", right, format!("a list of {}", memory.log_odds.len()), "as long as known has bits")
}

/// What is allowed and waited for is among what was made, and the samples are in order.
fn motion_memory(memory: &MotionMemory) -> checks::Checked {
    let MotionMemory { commands, allowed, requests, .. } = *memory;
    checks::holds("allowed", allowed <= commands, allowed, "no later than commands")?;
    if let Some(time) = memory.last_step {
        checks::holds("last_step", checks::TIMES_S.contains(&time), time, "a time of 0 to 1e12 s")?;
    }
    match &memory.awaited {
        Awaited::Start | Awaited::Over(_) => {}
        Awaited::Map(command) => {
            checks::holds("awaited.Map.id", command.id == commands, command.id, "the last of commands")?
        }
        Awaited::Plan(asked) => {
            checks::holds("awaited.Plan.id", asked.id == requests, asked.id, "the last of requests")?
        }
    }
    let ascending = memory.samples.is_sorted_by(|one, next| one.scans < next.scans);
    checks::holds("samples", ascending, "a list out of order", "in the order of scans")
}

/// Its path can be looked through.
fn leg(leg: &Leg) -> checks::Checked {
    let Decision::Go(path) = &leg.plan.decision else { return Ok(()) };
    let way = checks::way(&path.points, leg.plan.motion.clearance_m, leg.resolution);
    way.map(drop).map_err(|inner| inner.within("plan.decision.Go"))
}

/// There was progress before the plan, not after it; and a strategy's name is a text.
fn explorer_memory(memory: &ExplorerMemory) -> checks::Checked {
    let at = memory.progress_at;
    checks::holds("progress_at", at <= memory.plan.revision, at, "no later than the plan's revision")?;
    memory.strategy.as_deref().map_or(Ok(()), checks::text).map_err(|inner| inner.within("strategy"))
}
