//! What the apps of an exploration say to each other, in the order in which a step says it; and at the end their memories:
//! what each says to its own successor.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::checks;
use crate::pose::Pose;
use crate::voxel::Voxel;

elk_bus::payload! {
    /// Controller to sensor: go there and take a scan.
    #[derive(Debug, Clone, PartialEq)]
    pub struct PoseCommand checked by checks::pose_command {
        /// Number of the command, from 1, unbroken; the scan that answers carries it.
        pub id: u64,
        /// Positions (m, world) to pass on the way from where the camera is, in straight lines from one to the next and
        /// from the last one to `pose`. Empty: go straight, or turn on the spot. Contacts are judged on every segment.
        pub via: Vec<Point3<f64>>,
        /// The camera's pose to take (world).
        pub pose: Pose,
    }

    /// Sensor to anyone, on start-up and after every motion: where the camera is.
    #[derive(Debug, Clone, PartialEq)]
    pub struct CameraPose checked by checks::camera_pose {
        /// The last pose command carried out; 0: none yet, this is the start.
        pub command: u64,
        /// The camera's pose (world).
        pub pose: Pose,
    }

    /// Sensor to anyone, with each pose, and before the scan that is taken there: what a simulated sensor knows of its true
    /// world so far. A successor knows by it, the pose and the last scan where to go on.
    #[derive(Debug, Clone, PartialEq)]
    pub struct SensorReport checked by checks::sensor_report {
        /// Scans taken.
        pub scans: u64,
        /// Motions on which the robot's body touched the true world.
        pub contacts: u64,
        /// The scan after which this was said.
        pub scan: u64,
        /// Seconds of CPU spent on ray casting.
        pub cpu_secs: f64,
    }

    /// Sensor to anyone: the final map held against the true world.
    #[derive(Debug, Clone, PartialEq)]
    pub struct AccuracyReport checked by checks::accuracy_report {
        /// Revision of the map that was judged.
        pub revision: u64,
        /// Known voxels whose state is that of the true world, of all known voxels (0 to 1).
        pub accuracy: f64,
        /// Known voxels judged.
        pub voxels: u64,
    }

    /// Map to anyone: how much is known.
    #[derive(Debug, Clone, PartialEq)]
    pub struct MapStatus checked by checks::map_status {
        /// Revision of the map that this describes.
        pub revision: u64,
        /// Free voxels.
        pub free: u64,
        /// Occupied voxels.
        pub occupied: u64,
        /// Frontier voxels of the whole map, reachable or not.
        pub frontier: u64,
        /// Edge of a voxel (m).
        pub resolution: f64,
        /// Seconds of CPU spent on insertion.
        pub cpu_secs: f64,
        /// Whether it has all the bricks that it may have (`MaxBricks`): of what lies in others it comes to know nothing.
        pub full: bool,
        /// What became of the rays of all scans so far.
        pub rays: RayTally,
    }

    /// Controller to explorer: where to go from here?
    #[derive(Debug, Clone, PartialEq)]
    pub struct PlanRequest checked by checks::plan_request {
        /// Number of the request, from 1, unbroken.
        pub id: u64,
        /// The camera's pose now (world).
        pub pose: Pose,
        /// The revision that the map has to be at for the answer.
        pub revision: u64,
        /// What became of the plan before.
        pub outcome: Outcome,
    }

    /// Explorer to controller: the answer to a [`PlanRequest`].
    #[derive(Debug, Clone, PartialEq)]
    pub struct Plan checked by checks::plan {
        /// The request that it answers.
        pub request: u64,
        /// The revision of the map that it was made from.
        pub revision: u64,
        /// Where to go, or that there is nowhere left to go.
        pub decision: Decision,
        /// How the controller is to move and scan along the path; one for all strategies.
        pub motion: MotionPolicy,
        /// Seconds of CPU that the planning took.
        pub cpu_secs: f64,
    }

    /// Explorer to anyone, once, with its last plan: why it ended and what is left.
    #[derive(Debug, Clone, PartialEq)]
    pub struct ExplorationReport checked by checks::exploration_report {
        /// The explorer's type.
        pub explorer: String,
        /// The motion policy's name.
        pub policy: String,
        /// Strategy, policy and clearance with all their settings, for people.
        pub settings: String,
        /// Whether every frontier that can be reached and seen is resolved.
        pub complete: bool,
        /// Why it ended, for people.
        pub reason: String,
        /// Frontier voxels left, by cause.
        pub frontiers_left: FrontiersLeft,
        /// Plans made.
        pub plans: u64,
        /// Streamlines that stalled before they reached a frontier.
        pub stalls: u64,
        /// Seconds of CPU by phase of planning, by name.
        pub cpu_secs: Vec<(String, f64)>,
    }

    /// Controller to anyone, after every scan that is in the map: how far the run is.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Progress checked by checks::progress {
        /// The scan after which this holds.
        pub scan: u64,
        /// Revision of the map.
        pub revision: u64,
        /// Scans so far.
        pub scans: u64,
        /// Length of the way so far (m).
        pub path_length_m: f64,
        /// Free voxels known.
        pub free: u64,
        /// Whether the run is over.
        pub finished: bool,
    }

    /// Controller to anyone, once, when the run is over: what it cost to get how far.
    #[derive(Debug, Clone, PartialEq)]
    pub struct MotionReport checked by checks::motion_report {
        /// Scans taken.
        pub scans: u64,
        /// Length of the way (m).
        pub path_length_m: f64,
        /// Free voxels known at the end.
        pub free: u64,
        /// Scans and way to 95, 99, 99.9 and 100 % of these free voxels.
        pub marks: Vec<CoverageMark>,
    }

    /// Map to its successor: all that it knows.
    #[derive(Debug, Clone, PartialEq)]
    pub struct MapMemory checked by checks::map_memory {
        /// The map's revision.
        pub revision: u64,
        /// The last scan in it (see [`crate::Scan::id`]).
        pub scan: u64,
        /// Edge of a voxel (m).
        pub resolution: f64,
        /// The bricks, in the order in which they were first entered.
        pub bricks: Vec<BrickMemory>,
    }

    /// Controller to its successor: how it stands.
    #[derive(Debug, Clone, PartialEq)]
    pub struct MotionMemory checked by checks::motion_memory {
        /// The camera's pose (world), once the last command is carried out.
        pub pose: Pose,
        /// What it waits for.
        pub awaited: Awaited,
        /// The last pose command made.
        pub commands: u64,
        /// The last pose command that was not held back by a pause.
        pub allowed: u64,
        /// Steps that a person allowed and that were not taken yet.
        pub steps: u64,
        /// The last plan request made.
        pub requests: u64,
        /// Length of the way so far (m).
        pub path_length_m: f64,
        /// The path that it is on.
        pub leg: Option<Leg>,
        /// What was known after each scan so far; of a very long run, after some of them and the last.
        pub samples: Vec<CoverageSample>,
    }

    /// Explorer to its successor, of whatever type: what it knows.
    #[derive(Debug, Clone, PartialEq)]
    pub struct ExplorerMemory checked by checks::explorer_memory {
        /// The last plan.
        pub plan: Plan,
        /// Why it ended, if that was the last plan.
        pub ended: Option<ExplorationReport>,
        /// Plans made.
        pub plans: u64,
        /// Streamlines that stalled before they reached a frontier.
        pub stalls: u64,
        /// Plans for which the strategy had no answer.
        pub fallbacks: u64,
        /// Iterations of the field's solver.
        pub iterations: u64,
        /// Seconds of CPU by phase of planning, by name.
        pub cpu_secs: Vec<(String, f64)>,
        /// The voxels that the robot went through.
        pub trail: Vec<Voxel>,
        /// What came of the targets so far, in lexicographic order.
        pub targets: Vec<TargetRecord>,
        /// Targets that no new place saw when they were last looked for, in lexicographic order.
        pub hidden: Vec<Voxel>,
        /// How things stood when they last changed.
        pub standing: Standing,
        /// The map's revision then.
        pub progress_at: u64,
        /// Paths on which the sensor did not take a single step.
        pub refused: u64,
        /// Rays of all scans that had gone without a return when the last plan was made.
        pub no_return: u64,
    }
}

/// What became of the rays of all scans, on their way from the sensor into the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct RayTally {
    /// Rays that saw nothing up to the sensor's range.
    pub no_return: u64,
    /// Points that the sensor measured.
    pub measured: u64,
    /// Of these, points that came to the map: the others were left out by filters.
    pub received: u64,
    /// Of those received, points that are not finite, or at the camera itself.
    pub invalid: u64,
    /// Of those received, points outside the map's 65,536 voxels an axis.
    pub outside: u64,
    /// Of those received, points farther than the map's `MaxRange`.
    pub too_far: u64,
    /// Of those received, points for which the map had no more bricks (`MaxBricks`).
    pub no_room: u64,
}

impl RayTally {
    /// Points that the map took, as hits or as free ways up to its `MaxRange`.
    pub fn taken(&self) -> u64 {
        self.received.saturating_sub(self.invalid).saturating_sub(self.outside).saturating_sub(self.no_room)
    }
}

/// When a share of what was known in the end was first known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CoverageMark {
    /// Share of the free voxels known at the end (0 to 1).
    pub share: f64,
    /// Scans taken by then.
    pub scans: u64,
    /// Length of the way by then (m).
    pub path_length_m: f64,
}

/// What was known after a scan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CoverageSample {
    /// Scans taken by then.
    pub scans: u64,
    /// Free voxels known.
    pub free: u64,
    /// Length of the way by then (m).
    pub path_length_m: f64,
}

/// What a controller waits for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Leg {
    /// The plan that it is of.
    pub plan: Plan,
    /// Edge of a voxel of the map (m).
    pub resolution: f64,
    /// Where the robot is too close to something from the start, as the explorer knows.
    pub allowed: Vec<Voxel>,
    /// Length of way done (m).
    pub done_m: f64,
    /// Length of the last step (m).
    pub step_m: f64,
    /// The sensor refused to go on.
    pub blocked: bool,
    /// Looks taken at its end.
    pub looks: u64,
}

/// A brick of the map as the map knows it (cells as in [`crate::bricks::cell_of`], cell `i` in bit `i mod 64` of word
/// `i / 64`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BrickMemory {
    /// The brick's position, in bricks.
    pub brick: [i16; 3],
    /// The cells that were ever updated.
    pub known: [u64; 8],
    /// The cells that were ever hit.
    pub ever_hit: [u64; 8],
    /// Log-odds of being occupied of the known cells, ascending by cell.
    pub log_odds: Vec<f32>,
}

/// What came of an explorer's target.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct TargetRecord {
    /// The frontier voxel.
    pub target: Voxel,
    /// The voxels from which it was looked at in vain.
    pub tried: Vec<Voxel>,
    /// Paths to it that were cut in a row.
    pub cuts: u32,
    /// Plans made for it.
    pub planned: u32,
    /// When it was looked at in vain, rays went without a return.
    pub no_return: bool,
}

/// What changes as long as there is progress. A voxel that flickers changes it too, but is given up in time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Standing {
    /// Free voxels.
    pub free: u64,
    /// Occupied voxels.
    pub occupied: u64,
    /// Frontier voxels.
    pub frontier: u64,
    /// Looks in vain.
    pub attempts: u64,
}

/// What became of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Outcome {
    /// There was none: this is the first request.
    First,
    /// Its target is resolved.
    Resolved,
    /// Followed to the end, every look taken, and the target is still unresolved.
    Unresolved,
    /// New obstacles cut the path before its end.
    Cut,
}

/// What an explorer decides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Decision {
    /// Follow this path.
    Go(Path),
    /// Exploration is over; the reason is in the [`ExplorationReport`].
    Done,
}

/// A way to a frontier voxel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Path {
    /// Positions to pass in straight lines (m, world), the robot's own first. A single one: look from where you are.
    pub points: Vec<Point3<f64>>,
    /// The frontier voxel to be resolved.
    pub target: Voxel,
    /// Its unknown neighbours: it is resolved once they are all known, or it is no longer free.
    pub unknown: Vec<Voxel>,
    /// Poses to scan from at the end of the path, in order, as long as the target is not resolved.
    pub looks: Vec<Pose>,
}

/// How to move and when to scan: the same for all strategies (thesis 6.5.1, and what a prototype paid for).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MotionPolicy {
    /// The policy's name: `thesis` or `elk`.
    pub name: String,
    /// Length of way between two scans (m).
    pub scan_spacing_m: f64,
    /// Ask for a new plan as soon as the target is no longer a frontier.
    pub early_stop: bool,
    /// Look at the target while travelling; otherwise along the motion.
    pub look_at_target: bool,
    /// The robot's clearance from occupied voxels (m, see [`crate::clearance`]): a path that comes closer is cut.
    pub clearance_m: f64,
}

/// Frontier voxels that exploration leaves behind, by cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct FrontiersLeft {
    /// Not in the free component of the robot.
    pub unreachable: u64,
    /// No pose that the robot can take sees the unknown beyond them.
    pub invisible: u64,
    /// Looked at as often as the policy allows, and still there.
    pub unresolved: u64,
    /// The same, while rays went without a return: the world is open there, or goes on beyond the sensor's range.
    pub no_return: u64,
    /// In clusters below the size that counts.
    pub too_small: u64,
    /// Still to be resolved when the run ended before its time.
    pub open: u64,
    /// Where the map ends: it has no place for what is beyond (65,536 voxels an axis).
    pub map_edge: u64,
    /// Where a full map has no brick (`MaxBricks`): what is there it cannot come to know.
    pub no_room: u64,
    /// Where the volume to explore ends (`Mid`, `Dim`): what is beyond is not asked for.
    pub volume_edge: u64,
}

impl FrontiersLeft {
    /// All of them.
    pub fn total(&self) -> u64 {
        let looked_for = self.unreachable + self.invisible + self.unresolved + self.too_small + self.open;
        looked_for + self.no_return + self.map_edge + self.no_room + self.volume_edge
    }
}
