//! Follows plans: from pose to pose, a scan at each, until the explorer has nowhere left to go.
//!
//! The robot moves in straight lines from point to point of the path; every point is passed, and every segment of a
//! command was free, with the robot's clearance, in the map that the command was made from.

use elk_spatial::clearance::Clearance;
use elk_spatial::map::{MapUpdate, UpdateError};
use elk_spatial::messages::{
    CameraPose, Decision, MotionReport, Outcome, Path, Plan, PlanRequest, PoseCommand, Progress,
};
use elk_spatial::replica::Arrival;
use elk_spatial::{OccupancyGrid, Polyline, Pose, Replica, State, Voxel};
use nalgebra::Point3;

use crate::record::Record;

/// What the follower wants said.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// Go there and scan.
    Command(PoseCommand),
    /// Where to next?
    Request(PlanRequest),
    /// How far the run is.
    Progress(Progress),
    /// A revision is missing: the whole map, please.
    MapRequest,
    /// The run is over; nothing more will come.
    Finished(MotionReport),
}

/// What it is waiting for.
#[derive(Debug, Clone)]
enum Waiting {
    /// The camera's first pose.
    Start,
    /// The map with the scan of the last command in it.
    Map,
    /// The answer to the last request.
    Plan,
    /// Nothing: the run is over.
    Over,
}

/// A path on the way.
#[derive(Debug, Clone)]
struct Leg {
    plan: Plan,
    path: Path,
    way: Polyline,
    clearance: Clearance,
    resolution: f64,
    /// Where the robot is too close to something from the start, as the explorer knows.
    allowed: Vec<Voxel>,
    /// Length of way done (m).
    done: f64,
    /// Length of the last step (m).
    step: f64,
    /// The sensor refused to go on.
    blocked: bool,
    /// Looks taken at its end.
    looks: usize,
}

/// The state machine. Give it what arrives, in order, and do what it answers, in order.
#[derive(Debug, Clone)]
pub struct Follower {
    replica: Replica,
    pose: Pose,
    waiting: Waiting,
    leg: Option<Leg>,
    commands: u64,
    requests: u64,
    scans: u64,
    path_length_m: f64,
    record: Record,
}

impl Default for Follower {
    /// Waits for the camera's pose.
    fn default() -> Self {
        Self {
            replica: Replica::new(None),
            pose: Pose(nalgebra::Isometry3::identity()),
            waiting: Waiting::Start,
            leg: None,
            commands: 0,
            requests: 0,
            scans: 0,
            path_length_m: 0.0,
            record: Record::default(),
        }
    }
}

impl Follower {
    /// The sensor says where the camera is. The first time the run begins, with a scan from there; later this only
    /// matters if the sensor could not do as it was told.
    pub fn on_camera_pose(&mut self, camera: &CameraPose) -> Vec<Output> {
        if matches!(self.waiting, Waiting::Start) {
            self.commands = camera.command;
            return vec![self.command(camera.pose, vec![])];
        }
        if camera.command == self.commands && camera.pose != self.pose {
            self.pose = camera.pose;
            if let Some(leg) = &mut self.leg {
                self.path_length_m -= leg.step;
                leg.blocked = true;
            }
        }
        vec![]
    }

    /// The map has changed, or it is here whole.
    ///
    /// # Errors
    /// The map's voxels are not what they were.
    pub fn on_map(&mut self, update: &MapUpdate) -> Result<Vec<Output>, UpdateError> {
        match self.replica.take(update)? {
            Arrival::Applied(_) => {}
            Arrival::Old => return Ok(vec![]),
            Arrival::Gap => return Ok(vec![Output::MapRequest]),
        }
        if !matches!(self.waiting, Waiting::Map) || update.scan < self.commands {
            return Ok(vec![]);
        }
        self.scans += 1;
        self.record.add(self.replica.grid().free() as u64, self.path_length_m);
        Ok(vec![self.progress(update.scan, false), self.go_on()])
    }

    /// The explorer's answer.
    pub fn on_plan(&mut self, plan: &Plan) -> Vec<Output> {
        if !matches!(self.waiting, Waiting::Plan) || plan.request != self.requests {
            return vec![];
        }
        match &plan.decision {
            Decision::Done => {
                self.waiting = Waiting::Over;
                let progress = self.progress(self.commands, true);
                vec![progress, Output::Finished(self.record.report())]
            }
            Decision::Go(path) => {
                self.leg = Leg::new(plan, path, self.replica.grid());
                vec![self.go_on()]
            }
        }
    }

    /// Whether the run is over.
    pub fn finished(&self) -> bool {
        matches!(self.waiting, Waiting::Over)
    }

    /// The next command on the way, or the request for a new plan.
    fn go_on(&mut self) -> Output {
        let Some(mut leg) = self.leg.take() else {
            return self.request(Outcome::First);
        };
        leg.step = 0.0;
        let (from, to) = match leg.next(self.replica.grid()) {
            Next::Ask(outcome) => return self.request(outcome),
            Next::Look(pose) => {
                self.leg = Some(leg);
                return self.command(pose, vec![]);
            }
            Next::Travel { from, to } => (from, to),
        };
        let via = leg.way.bends(from, to);
        let pose = leg.pose_at(to);
        leg.step = to - from;
        self.path_length_m += leg.step;
        self.leg = Some(leg);
        self.command(pose, via)
    }

    fn command(&mut self, pose: Pose, via: Vec<Point3<f64>>) -> Output {
        self.commands += 1;
        self.pose = pose;
        self.waiting = Waiting::Map;
        Output::Command(PoseCommand { id: self.commands, via, pose })
    }

    fn request(&mut self, outcome: Outcome) -> Output {
        self.requests += 1;
        self.waiting = Waiting::Plan;
        Output::Request(PlanRequest {
            id: self.requests,
            pose: self.pose,
            revision: self.replica.grid().revision(),
            outcome,
        })
    }

    fn progress(&self, scan: u64, finished: bool) -> Output {
        Output::Progress(Progress {
            scan,
            revision: self.replica.grid().revision(),
            scans: self.scans,
            path_length_m: self.path_length_m,
            free: self.replica.grid().free() as u64,
            finished,
        })
    }
}

/// What to do next on a leg.
enum Next {
    Travel { from: f64, to: f64 },
    Look(Pose),
    Ask(Outcome),
}

impl Leg {
    /// `None` if the path has no point at all.
    fn new(plan: &Plan, path: &Path, grid: &OccupancyGrid) -> Option<Self> {
        let way = Polyline::new(path.points.iter().copied())?;
        let clearance = Clearance::new(plan.motion.clearance_m, grid.resolution());
        let refused = way.points().windows(2);
        let allowed = refused.flat_map(|p| clearance.refused(grid, p[0], p[1])).collect();
        Some(Self {
            plan: plan.clone(),
            path: path.clone(),
            way,
            clearance,
            resolution: grid.resolution(),
            allowed,
            done: 0.0,
            step: 0.0,
            blocked: false,
            looks: 0,
        })
    }

    fn next(&mut self, grid: &OccupancyGrid) -> Next {
        if self.blocked {
            return Next::Ask(Outcome::Cut);
        }
        let resolved = self.resolved(grid);
        if resolved && (self.plan.motion.early_stop || self.looks > 0) {
            return Next::Ask(Outcome::Resolved);
        }
        let left = self.way.length() - self.done;
        if left > 1e-9 {
            if self.cut(grid) {
                return Next::Ask(Outcome::Cut);
            }
            let from = self.done;
            self.done += self.plan.motion.scan_spacing_m.min(left);
            if self.way.length() - self.done <= 1e-9 {
                self.done = self.way.length();
                self.looks = 1;
            }
            return Next::Travel { from, to: self.done };
        }
        self.looks += 1;
        match self.path.looks.get(self.looks - 1) {
            Some(pose) => Next::Look(*pose),
            None => Next::Ask(Outcome::Unresolved),
        }
    }

    /// The camera after `s` (m) of way: at the end the first look, before it whatever the policy says.
    fn pose_at(&self, s: f64) -> Pose {
        let position = self.way.at(s);
        let along = self.way.heading(s);
        let ahead = along.unwrap_or_else(nalgebra::Vector3::x);
        if s >= self.way.length() {
            let look = self.path.looks.first();
            return look.map_or_else(|| Pose::looking(position, ahead), |p| *p);
        }
        let target = self.path.target.center(self.resolution);
        let toward = (target - position).try_normalize(1e-6);
        match toward.filter(|_| self.plan.motion.look_at_target) {
            Some(direction) => Pose::looking(position, direction),
            None => Pose::looking(position, ahead),
        }
    }

    /// Whether the target is no longer a frontier voxel.
    fn resolved(&self, grid: &OccupancyGrid) -> bool {
        let unknown = |v: &Voxel| grid.state(*v) == State::Unknown;
        grid.state(self.path.target) != State::Free || !self.path.unknown.iter().any(unknown)
    }

    /// Whether what was learned since the plan was made is in the way.
    fn cut(&self, grid: &OccupancyGrid) -> bool {
        let rest = self.way.part(self.done, self.way.length());
        rest.windows(2).any(|p| {
            let mut refused = self.clearance.refused(grid, p[0], p[1]);
            refused.any(|v| grid.state(v) == State::Occupied || !self.allowed.contains(&v))
        })
    }
}

#[cfg(test)]
mod tests;
