//! Follows plans: from pose to pose, a scan at each, until the explorer has nowhere left to go.
//!
//! The robot moves in straight lines from point to point of the path; every point is passed, and every segment of a
//! command was free, with the robot's clearance, in the map that the command was made from.
//!
//! A follower can be exchanged for another one at any time: [`Follower::memory`] is all of it but the map, which its
//! successor gets from the map. The memory is published before what follows from it is said, so whatever was said is
//! remembered, and what was perhaps not said can be said again ([`Follower::resume`]).

use std::collections::BTreeSet;

use elk_bus::Invalid;
use elk_geometry::clearance::{Clearance, TooWide};
use elk_geometry::{OccupancyGrid, Polyline, Pose, State, Voxel};
use elk_spatial::Replica;
use elk_spatial::checks::{
    MAX_BRICKS, MAX_COMMANDS_LOST, MAX_REMEMBERED, MAX_REVISIONS_AHEAD, keeps_off_walls, path_in,
};
use elk_spatial::keyframe::MapPart;
use elk_spatial::map::{MapUpdate, UpdateError};
use elk_spatial::messages::{
    Awaited, CameraPose, Decision, Leg, MotionMemory, MotionPolicy, MotionReport, Outcome, Path, Plan, PlanRequest,
    PoseCommand, Progress,
};
use elk_spatial::record::Record;
use elk_spatial::travel::{Drive, TravelReport};
use nalgebra::Point3;

use crate::allowance::Allowance;
use crate::drive::{Body, Corridor, Errand, Robot};

/// A robot that says that it is at most so far (m) from where it was sent has arrived there: a fraction of any voxel in which plans are made.
const ARRIVED_M: f64 = 0.02;
/// … and turned by at most so much (rad).
const ARRIVED_RAD: f64 = 0.02;

/// What the follower wants done: a message that is to be published.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Go there and scan.
    Command(PoseCommand),
    /// Where to next?
    Request(PlanRequest),
    /// How far the run is.
    Progress(Progress),
    /// The run is over; nothing more will come.
    Finished(MotionReport),
}

/// Why a message is of no use to a follower.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unfit {
    /// The map's update does not fit what is known.
    #[error(transparent)]
    Map(#[from] UpdateError),
    /// The plan is not one of this map.
    #[error("path.{0}")]
    Path(Invalid),
    /// The plan is of a map that cannot be yet.
    #[error("revision is {0}; there were {1} commands, so the map cannot have come so far")]
    Revision(u64, u64),
    /// The sensor cannot have carried out what was not commanded.
    #[error("command is {0}; the last command was {1}")]
    Command(u64, u64),
    /// A path with a clearance that nobody could look after.
    #[error(transparent)]
    Clearance(#[from] TooWide),
}

/// A path on the way, with what follows from it.
#[derive(Debug, Clone)]
struct Underway {
    /// What is allowed there is in order.
    leg: Leg,
    path: Path,
    way: Polyline,
    clearance: Clearance,
}

/// The state machine. Give it what arrives, in order, and do what it answers, in order.
#[derive(Debug, Clone)]
pub struct Follower {
    replica: Replica,
    pose: Pose,
    awaited: Awaited,
    underway: Option<Underway>,
    commands: u64,
    /// The last command that was made here, or by a predecessor; `commands` is as the sensor counts.
    made: u64,
    /// The last command that the sensor has carried out.
    carried_out: u64,
    requests: u64,
    path_length_m: f64,
    record: Record,
    /// Where the robot was, and where it was refused to go, last (m, world).
    refused: Option<[Point3<f64>; 2]>,
    /// A plan from a later revision of the map than the one that is here.
    early: Option<Plan>,
    /// What it waits for is a predecessor's word, which perhaps never came to be said.
    inherited: bool,
    /// The robot, if it takes its time; else it is where it is sent at once.
    robot: Option<Robot>,
    /// How a robot before this one moved that took its time.
    drive: Option<Drive>,
}

impl Default for Follower {
    /// Waits for the camera's pose.
    fn default() -> Self {
        Self {
            replica: Replica::new(None, MAX_BRICKS),
            pose: Pose(nalgebra::Isometry3::identity()),
            awaited: Awaited::Start,
            underway: None,
            commands: 0,
            made: 0,
            carried_out: 0,
            requests: 0,
            path_length_m: 0.0,
            record: Record::default(),
            refused: None,
            early: None,
            inherited: false,
            robot: None,
            drive: None,
        }
    }
}

impl Follower {
    /// One whose robot takes its time, if it is one.
    pub fn of(robot: Option<Robot>) -> Self {
        Self { robot, ..Self::default() }
    }

    /// The successor of one that left this memory, with a robot that takes its time, if it is one.
    ///
    /// # Errors
    /// It was on a path that nobody could go.
    pub fn successor(memory: &MotionMemory, robot: Option<Robot>) -> Result<Self, Unfit> {
        let underway = memory.leg.clone().map(Underway::on).transpose()?;
        let robot = robot.map(|robot| recalled(&robot, memory));
        Ok(Self {
            pose: memory.pose,
            awaited: memory.awaited.clone(),
            underway,
            commands: memory.commands,
            made: memory.commands,
            requests: memory.requests,
            path_length_m: memory.path_length_m,
            record: Record::from(memory.samples.clone()),
            inherited: true,
            robot,
            drive: memory.drive.clone(),
            ..Self::default()
        })
    }

    /// The robot, if it takes its time.
    pub fn robot(&self) -> Option<&Robot> {
        self.robot.as_ref()
    }

    /// How long a robot that takes its time is on its way at the end of the last command.
    pub fn travel(&self) -> Option<TravelReport> {
        let Robot { secs, stops, .. } = self.robot.as_ref()?;
        Some(TravelReport { command: self.commands, secs: *secs, stops: *stops })
    }

    /// What a successor has to know, of what a person allowed as well.
    pub fn memory(&self, allowance: &Allowance) -> MotionMemory {
        let Allowance { allowed, steps, last_step, .. } = *allowance;
        MotionMemory {
            pose: self.pose,
            awaited: self.awaited.clone(),
            commands: self.commands,
            allowed,
            steps,
            last_step,
            requests: self.requests,
            path_length_m: self.path_length_m,
            leg: self.underway.as_ref().map(|u| u.leg.clone()),
            drive: self.robot.as_ref().map(left).or_else(|| self.drive.clone()),
            samples: self.record.samples().to_vec(),
        }
    }

    /// A successor that has been told all there is to tell says again what was perhaps not said before the other one
    /// died: its last words, unless the sensor has carried them out or they were answered. Saying them twice does no harm:
    /// the sensor carries out a command once, the explorer gives a request the same answer again.
    pub fn resume(&mut self) -> Vec<Action> {
        if !std::mem::take(&mut self.inherited) {
            return vec![];
        }
        match &self.awaited {
            Awaited::Map(command) if command.id > self.carried_out => vec![Action::Command(command.clone())],
            Awaited::Start | Awaited::Map(_) => vec![],
            Awaited::Plan(request) => vec![Action::Request(request.clone())],
            Awaited::Over(progress) => self.last_words(progress.clone()),
        }
    }

    /// The sensor says where the camera is. The first time the run begins, with a scan from there; later this only
    /// matters if the sensor could not do as it was told.
    ///
    /// # Errors
    /// It cannot have done what it says.
    pub fn on_camera_pose(&mut self, camera: &CameraPose) -> Result<Vec<Action>, Unfit> {
        if self.inherited && self.commands > camera.command + MAX_COMMANDS_LOST {
            // The sensor has the last word: what was remembered is of another run, or made up.
            let robot = self.robot.as_ref().map(Robot::anew);
            *self = Self { replica: self.replica.clone(), robot, ..Self::default() };
        }
        if self.awaited == Awaited::Start || self.began_beside(camera) {
            self.carried_out = camera.command;
            self.commands = camera.command;
            self.robot.iter_mut().for_each(|robot| robot.stand(&camera.pose));
            return Ok(vec![self.command(camera.pose, vec![])]);
        }
        if self.inherited && (self.commands..=self.commands + MAX_COMMANDS_LOST).contains(&camera.command) {
            // What the predecessor commanded last it perhaps died of, and its word of it is lost.
            self.commands = camera.command;
        }
        if self.counts_otherwise(camera) {
            let leap = camera.command.abs_diff(self.made);
            return match leap > MAX_COMMANDS_LOST {
                true if camera.command > self.commands => Err(Unfit::Command(camera.command, self.commands)),
                true => Ok(vec![]),
                false => Ok(self.go_on_from(camera)),
            };
        }
        self.carried_out = self.carried_out.max(camera.command);
        match camera.command == self.commands && !has_arrived(&camera.pose, &self.pose) {
            true => Ok(self.go_on_from(camera)),
            false => {
                // Of a robot that goes by an estimate what it says is where plans begin.
                if camera.command == self.commands {
                    self.pose = camera.pose;
                }
                Ok(vec![])
            }
        }
    }

    /// Whether the sensor has carried out other commands than those that were made here. It may be behind by the one that
    /// is under way; one that has carried out none at all has lost its memory, and learns from the next command.
    fn counts_otherwise(&self, camera: &CameraPose) -> bool {
        let under_way = matches!(&self.awaited, Awaited::Map(command) if command.id == self.commands);
        let behind = camera.command < self.commands && camera.command > 0 && !self.inherited;
        let expected = under_way && camera.command + 1 == self.commands;
        camera.command > self.commands || (behind && !expected)
    }

    /// Takes the sensor's word for where the camera is and after how many commands. The leg ends there, and what was asked
    /// is asked anew from there.
    fn go_on_from(&mut self, camera: &CameraPose) -> Vec<Action> {
        let sent = self.pose.position();
        (self.pose, self.commands) = match &self.awaited {
            // Its last word before the command that is under way.
            Awaited::Map(command) if command.id == camera.command + 1 => (command.pose, command.id),
            _ => (camera.pose, camera.command),
        };
        self.carried_out = camera.command;
        let place = camera.pose.position();
        let robot = self.robot.as_mut().filter(|_| self.pose == camera.pose);
        let stands_before = robot.as_ref().map(|robot| (robot.from - place).norm() < 1e-6);
        robot.into_iter().for_each(|robot| robot.stand(&camera.pose));
        if let Some(underway) = &mut self.underway {
            let stays = stands_before.unwrap_or_else(|| underway.stands_before_step(place));
            let stays = camera.command == self.commands && stays;
            let leg = &mut underway.leg;
            // Of the step that it did not take, once.
            self.path_length_m -= std::mem::take(&mut leg.step_m);
            leg.ended = Some(if stays { Outcome::Refused } else { Outcome::Cut });
            self.refused = stays.then_some([place, sent]);
        }
        match &self.awaited {
            Awaited::Plan(request) => self.ask_anew(request.clone()),
            // The scan from there came before the sensor's word of it.
            Awaited::Map(_) if self.replica.scan() >= self.commands => self.scanned(),
            _ => vec![],
        }
    }

    /// The request that was made from a wrong place, from the right one; a successor says it when it resumes.
    fn ask_anew(&mut self, asked: PlanRequest) -> Vec<Action> {
        self.requests += 1;
        let revision = asked.revision.max(self.replica.grid().revision());
        let request = PlanRequest { id: self.requests, pose: self.pose, revision, ..asked };
        self.awaited = Awaited::Plan(request.clone());
        if self.inherited { vec![] } else { vec![Action::Request(request)] }
    }

    /// Whether the run has hardly begun, and from another command than the sensor's last: of the two the sensor knows.
    fn began_beside(&self, camera: &CameraPose) -> bool {
        let hardly = self.record.scans() == 0 && matches!(self.awaited, Awaited::Map(_)) && !self.inherited;
        hardly && !(camera.command..=camera.command + 1).contains(&self.commands)
    }

    /// The map has changed, or it is here whole.
    ///
    /// # Errors
    /// It does not fit what is known of the map.
    pub fn on_map(&mut self, update: &MapUpdate) -> Result<Vec<Action>, Unfit> {
        self.look_how_far(update.revision)?;
        let changes = self.replica.take(update)?;
        changes.map_or(Ok(vec![]), |_| self.on_knowledge())
    }

    /// A part of the whole map is here.
    ///
    /// # Errors
    /// It does not fit what is known of the map.
    pub fn on_map_part(&mut self, part: &MapPart) -> Result<Vec<Action>, Unfit> {
        self.look_how_far(part.revision)?;
        let changes = self.replica.take_part(part)?;
        changes.map_or(Ok(vec![]), |_| self.on_knowledge())
    }

    /// Whether a map of this revision can come of the commands so far.
    fn look_how_far(&self, update: u64) -> Result<(), UpdateError> {
        let have = self.commands;
        if update > have + MAX_REVISIONS_AHEAD { Err(UpdateError::Ahead { have, update }) } else { Ok(()) }
    }

    /// More is known of the map.
    fn on_knowledge(&mut self) -> Result<Vec<Action>, Unfit> {
        if let Some(plan) = self.early.take_if(|plan| plan.revision <= self.replica.grid().revision()) {
            return self.on_plan(&plan);
        }
        if !matches!(self.awaited, Awaited::Map(_)) || self.replica.scan() < self.commands {
            return Ok(vec![]);
        }
        Ok(self.scanned())
    }

    /// The scan that was waited for is in the map.
    fn scanned(&mut self) -> Vec<Action> {
        self.record.add(self.replica.grid().free() as u64, self.path_length_m);
        vec![Action::Progress(self.progress(self.replica.scan(), false)), self.go_on()]
    }

    /// The explorer's answer.
    ///
    /// # Errors
    /// It is no plan of this map.
    pub fn on_plan(&mut self, plan: &Plan) -> Result<Vec<Action>, Unfit> {
        if !matches!(self.awaited, Awaited::Plan(_)) || plan.request != self.requests {
            return Ok(vec![]);
        }
        if plan.revision > self.commands + MAX_REVISIONS_AHEAD {
            return Err(Unfit::Revision(plan.revision, self.commands));
        }
        if plan.revision > self.replica.grid().revision() {
            self.early = Some(plan.clone());
            return Ok(vec![]);
        }
        match &plan.decision {
            Decision::Done => {
                let progress = self.progress(self.commands, true);
                self.awaited = Awaited::Over(progress.clone());
                self.inherited = false;
                Ok(self.last_words(progress))
            }
            Decision::Go(path) => {
                let grid = self.replica.grid();
                let way = path_in(grid, &path.points, plan.motion.clearance_m).map_err(Unfit::Path)?;
                // What was learned since cuts the path; what was known is the plan's own fault, and would come again with the next.
                if plan.revision == grid.revision() {
                    keeps_off_walls(grid, self.pose.position(), &way).map_err(Unfit::Path)?;
                }
                self.leads_elsewhere(way.at(plan.motion.scan_spacing_m.min(way.length()))).map_err(Unfit::Path)?;
                self.underway = Some(Underway::new(plan, path, way, grid)?);
                Ok(vec![self.go_on()])
            }
        }
    }

    /// That a way whose first step ends at `there` (m, world) is another than the one that the robot was just refused to go: it would be
    /// refused for ever.
    fn leads_elsewhere(&self, there: Point3<f64>) -> Result<(), Invalid> {
        let here = self.pose.position();
        let again = self.refused.filter(|[from, to]| (from - here).norm() < 1e-6 && (to - there).norm() < 1e-6);
        again.filter(|_| there != here).map_or(Ok(()), |[_, to]| {
            let found =
                format!("to ({:.2}; {:.2}; {:.2}) again, where the sensor has just refused to go", to.x, to.y, to.z);
            Err(Invalid::new("points", found, "another way"))
        })
    }

    fn last_words(&self, progress: Progress) -> Vec<Action> {
        vec![Action::Progress(progress), Action::Finished(self.record.report())]
    }

    /// The last command made.
    pub fn commands(&self) -> u64 {
        self.commands
    }

    /// Whether the whole map is to be asked for now (see [`Replica::take_question`]); look after each update.
    pub fn take_question(&mut self) -> bool {
        self.replica.take_question()
    }

    /// This copy of the map (see [`Replica::copy_of`]).
    pub fn replica(&self) -> &Replica {
        &self.replica
    }

    /// Whether the run is over.
    pub fn finished(&self) -> bool {
        matches!(self.awaited, Awaited::Over(_))
    }

    /// The next command on the way, or the request for a new plan.
    fn go_on(&mut self) -> Action {
        let Some(mut underway) = self.underway.take() else {
            return self.request(Outcome::First);
        };
        underway.leg.step_m = 0.0;
        let step = match underway.next(self.replica.grid()) {
            Next::Ask(outcome) => return self.request(outcome),
            Next::Look(pose) => Step { part: None, pose },
            Next::Travel { from, to } => Step { part: Some([from, to]), pose: underway.pose_at(to) },
        };
        let (pose, via) = match &mut self.robot {
            None => step.at_once(&mut underway),
            Some(robot) => step.ridden(robot, &mut underway, self.replica.grid(), self.commands + 1),
        };
        self.path_length_m += underway.leg.step_m;
        self.underway = Some(underway);
        self.command(pose, via)
    }

    fn command(&mut self, pose: Pose, via: Vec<Point3<f64>>) -> Action {
        self.commands += 1;
        self.made = self.commands;
        self.pose = pose;
        let command = PoseCommand { id: self.commands, via, pose };
        self.awaited = Awaited::Map(command.clone());
        self.inherited = false;
        Action::Command(command)
    }

    fn request(&mut self, outcome: Outcome) -> Action {
        self.requests += 1;
        let revision = self.replica.grid().revision();
        let request = PlanRequest { id: self.requests, pose: self.pose, revision, outcome };
        self.awaited = Awaited::Plan(request.clone());
        self.inherited = false;
        Action::Request(request)
    }

    fn progress(&self, scan: u64, finished: bool) -> Progress {
        Progress {
            scan,
            revision: self.replica.grid().revision(),
            scans: self.record.scans(),
            path_length_m: self.path_length_m,
            free: self.replica.grid().free() as u64,
            finished,
        }
    }
}

/// Whether a robot is where it was sent, as near as one comes that goes by an estimate of its pose.
fn has_arrived(pose: &Pose, sent: &Pose) -> bool {
    let turned = pose.0.rotation.angle_to(&sent.0.rotation);
    pose == sent || ((pose.position() - sent.position()).norm() <= ARRIVED_M && turned <= ARRIVED_RAD)
}

/// A part of the way (m), or a look from where one is, and the pose at its end.
struct Step {
    part: Option<[f64; 2]>,
    pose: Pose,
}

impl Step {
    /// Of a robot that is where it is sent at once: the pose, and the points to pass before it.
    fn at_once(self, underway: &mut Underway) -> (Pose, Vec<Point3<f64>>) {
        underway.leg.step_m = self.part.map_or(0.0, |[from, to]| to - from);
        (self.pose, self.part.map_or_else(Vec::new, |[from, to]| underway.way.bends(from, to)))
    }

    /// Of one that takes its time: where it gets, and how.
    fn ridden(
        self,
        robot: &mut Robot,
        underway: &mut Underway,
        grid: &OccupancyGrid,
        number: u64,
    ) -> (Pose, Vec<Point3<f64>>) {
        let Self { part, pose } = self;
        // Who looks from where it is has a way of that point alone.
        let spot = Polyline::new([pose.position()]).filter(|_| part.is_none());
        let way = spot.as_ref().unwrap_or(&underway.way);
        let [from, to] = part.unwrap_or_default();
        let corridor = Corridor::along(grid, &underway.clearance, way, from);
        let ride = robot.ride(&Errand { way, from, to, pose, number }, corridor);
        let leg = &mut underway.leg;
        leg.step_m = ride.length_m;
        if part.is_some() {
            leg.done_m = ride.done_m;
        }
        if ride.is_stopped {
            leg.ended = Some(Outcome::Cut);
        }
        let passed = ride.trace.get(1..ride.trace.len() - 1).unwrap_or_default().to_vec();
        (robot.body.pose(), passed)
    }
}

/// What is left to a successor of how a robot moves.
fn left(robot: &Robot) -> Drive {
    let Robot { body, secs, stops, from, .. } = robot;
    Drive { from: *from, yaw: body.yaw, pitch: body.pitch, rates: body.rates, secs: *secs, stops: *stops }
}

/// A robot that goes on as one that left this memory moved; where that is not how its pose has come about, it stands there.
fn recalled(robot: &Robot, memory: &MotionMemory) -> Robot {
    let mut robot = robot.anew();
    robot.stand(&memory.pose);
    if let Some(Drive { from, yaw, pitch, rates, secs, stops }) = &memory.drive {
        let body = Body { position: memory.pose.position(), yaw: *yaw, pitch: *pitch, rates: *rates };
        robot.body = if body.pose() == memory.pose { body } else { robot.body };
        (robot.from, robot.secs, robot.stops) = (*from, *secs, *stops);
    }
    robot
}

/// What to do next on a leg.
enum Next {
    Travel { from: f64, to: f64 },
    Look(Pose),
    Ask(Outcome),
}

impl Underway {
    /// At the beginning of a plan's path.
    fn new(plan: &Plan, path: &Path, way: Polyline, grid: &OccupancyGrid) -> Result<Self, Unfit> {
        let clearance = clearance(&plan.motion, grid.resolution())?;
        let refused = way.points().windows(2);
        let refused = refused.flat_map(|p| clearance.refused(grid, p[0], p[1]));
        // More than a successor could be told is not allowed: the path is cut where it comes to it.
        let allowed: BTreeSet<Voxel> = refused.take(MAX_REMEMBERED).collect();
        let leg = Leg {
            plan: plan.clone(),
            resolution: grid.resolution(),
            allowed: allowed.into_iter().collect(),
            done_m: 0.0,
            step_m: 0.0,
            ended: None,
            looks: 0,
        };
        Ok(Self { leg, path: path.clone(), way, clearance })
    }

    /// On a leg that was begun already.
    fn on(mut leg: Leg) -> Result<Self, Unfit> {
        let none = || Unfit::Path(Invalid::new("points", "empty", "at least one point"));
        let Decision::Go(path) = leg.plan.decision.clone() else {
            return Err(none());
        };
        let way = Polyline::new(path.points.iter().copied()).ok_or_else(none)?;
        let clearance = clearance(&leg.plan.motion, leg.resolution)?;
        leg.allowed.sort_unstable();
        Ok(Self { leg, path, way, clearance })
    }

    fn next(&mut self, grid: &OccupancyGrid) -> Next {
        if let Some(outcome) = self.leg.ended {
            return Next::Ask(outcome);
        }
        let resolved = self.resolved(grid);
        if resolved && (self.leg.plan.motion.early_stop || self.leg.looks > 0) {
            return Next::Ask(Outcome::Resolved);
        }
        let left = self.way.length() - self.leg.done_m;
        if left > 1e-9 {
            if self.cut(grid) {
                return Next::Ask(Outcome::Cut);
            }
            let from = self.leg.done_m;
            self.leg.done_m += self.leg.plan.motion.scan_spacing_m.min(left);
            if self.way.length() - self.leg.done_m <= 1e-9 {
                self.leg.done_m = self.way.length();
                self.leg.looks = 1;
            }
            return Next::Travel { from, to: self.leg.done_m };
        }
        self.leg.looks += 1;
        match self.path.looks.get(self.leg.looks as usize - 1) {
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
        let target = self.path.target.center(self.leg.resolution);
        let MotionPolicy { look_at_target, level, .. } = self.leg.plan.motion;
        let mut toward = target - position;
        if level {
            toward.z = 0.0;
        }
        match toward.try_normalize(1e-6).filter(|_| look_at_target) {
            Some(direction) => Pose::looking(position, direction),
            None => Pose::looking(position, ahead),
        }
    }

    /// Whether the target is no longer a frontier voxel. What is looked at again is never resolved: all looks are taken.
    fn resolved(&self, grid: &OccupancyGrid) -> bool {
        let unknown = |v: &Voxel| grid.state(*v) == State::Unknown;
        let is_frontier = || grid.state(self.path.target) == State::Free && self.path.unknown.iter().any(unknown);
        !self.path.again && !is_frontier()
    }

    /// Whether what was learned since the plan was made is in the way. The robot may always leave the voxel that it is in: of one
    /// that is occupied it is in the part that is not.
    fn cut(&self, grid: &OccupancyGrid) -> bool {
        let rest = self.way.part(self.leg.done_m, self.way.length());
        let robot = Voxel::containing(self.way.at(self.leg.done_m), self.leg.resolution);
        rest.windows(2).any(|p| {
            let mut refused = self.clearance.refused(grid, p[0], p[1]).filter(|v| *v != robot);
            refused.any(|v| grid.state(v) == State::Occupied || self.leg.allowed.binary_search(&v).is_err())
        })
    }

    /// Whether `position` (m, world) is where the last step began.
    fn stands_before_step(&self, position: Point3<f64>) -> bool {
        let Leg { done_m, step_m, .. } = self.leg;
        step_m > 0.0 && (self.way.at(done_m - step_m) - position).norm() < 1e-6
    }
}

/// What a robot keeps clear of that moves so, among voxels of `resolution` (m).
fn clearance(motion: &MotionPolicy, resolution: f64) -> Result<Clearance, TooWide> {
    let clearance = Clearance::new(motion.clearance_m, resolution)?;
    Ok(if motion.level { clearance.in_layer() } else { clearance })
}

#[cfg(test)]
mod tests;
