//! What is measured of a run while it goes on: by listening, as anybody in a community could.

use std::time::Duration;

use elk_bus::codec::DecodeError;
use elk_bus::{Client, CommsError, Key, Mail};
use elk_geometry::{OccupancyGrid, Pose, VoxelSet};
use elk_spatial::Replica;
use elk_spatial::checks::MAX_BRICKS;
use elk_spatial::keys::{
    EXPLORATION_REPORT, MAP_UPDATE, MOTION_REPORT, PLAN, PLAN_REQUEST, POSE_COMMAND, PROGRESS, SENSOR_REPORT,
    TRAVEL_REPORT, camera_pose,
};
use elk_spatial::messages::{CameraPose, ExplorationReport, MotionReport, PoseCommand, Progress};
use nalgebra::Point3;

use crate::outcome::{End, Mark, Outcome, SHARES, Times, TracePoint, area_above, last_gain, mark_at};
use crate::site::Site;
use crate::suite::Limits;
use crate::tail::{LATE, Tail};
use crate::truth::Coverage;

/// Listens to a community.
pub struct Observer<'a> {
    client: Client,
    camera_pose: Key<CameraPose>,
    heard: Heard<'a>,
}

/// What was heard.
struct Heard<'a> {
    site: &'a Site,
    coverage: Coverage<'a>,
    surface: Coverage<'a>,
    /// What was known, and how many points the trace had, once [`LATE`] of all that is visible was.
    before_late: Option<(VoxelSet, usize)>,
    map: Replica,
    pose: Option<Pose>,
    command: Option<PoseCommand>,
    rotation_rad: f64,
    /// As the controller says it, or its speeds do.
    travel_secs: Option<f64>,
    scans: u64,
    contacts: u64,
    /// CPU time of each plan (s).
    plan_secs: Vec<f64>,
    /// The last request for a plan, and the last one that was answered.
    requests: [u64; 2],
    trace: Vec<TracePoint>,
    motion: Option<MotionReport>,
    exploration: Option<ExplorationReport>,
}

impl<'a> Observer<'a> {
    /// An observer of a run at `site`, as this client.
    ///
    /// # Errors
    /// The bus failed.
    pub fn new(site: &'a Site, mut client: Client) -> Result<Self, CommsError> {
        let camera_pose = camera_pose(&site.pose_variable);
        let comms = &mut client.comms;
        comms.register(&MAP_UPDATE)?;
        comms.register(&camera_pose)?;
        comms.register(&POSE_COMMAND)?;
        comms.register(&PROGRESS)?;
        comms.register(&PLAN_REQUEST)?;
        comms.register(&PLAN)?;
        comms.register(&SENSOR_REPORT)?;
        comms.register(&MOTION_REPORT)?;
        comms.register(&TRAVEL_REPORT)?;
        comms.register(&EXPLORATION_REPORT)?;
        comms.flush()?;
        let heard = Heard {
            site,
            coverage: site.truth.coverage(),
            surface: site.truth.surface_coverage(),
            before_late: None,
            map: Replica::new(Some(site.truth.resolution()), MAX_BRICKS),
            pose: None,
            command: None,
            rotation_rad: 0.0,
            travel_secs: site.speed.map(|_| 0.0),
            scans: 0,
            contacts: 0,
            plan_secs: Vec::new(),
            requests: [0; 2],
            trace: Vec::new(),
            motion: None,
            exploration: None,
        };
        Ok(Self { client, camera_pose, heard })
    }

    /// Takes note of all that was said; whether that was anything.
    ///
    /// # Errors
    /// The bus failed.
    pub fn listen(&mut self) -> Result<bool, CommsError> {
        let Self { client, camera_pose, heard } = self;
        // What cannot be read is nothing that an app can go by either: it comes to a standstill, and that is said.
        let count = client.receive(Duration::ZERO, |mail| drop(heard.take(mail, camera_pose)))?;
        Ok(count > 0)
    }

    /// Whether controller and explorer have said their last.
    pub fn has_ended(&self) -> bool {
        self.heard.motion.is_some() && self.heard.exploration.is_some()
    }

    /// What of the run is more than it may take.
    pub fn beyond(&self, limits: &Limits) -> Option<String> {
        let Heard { scans, travel_secs, .. } = &self.heard;
        let way_m = self.heard.way_m();
        match () {
            () if *scans > limits.scans => Some(format!("more than {} scans", limits.scans)),
            () if way_m > limits.way_m => Some(format!("a way of more than {} m", limits.way_m)),
            () if travel_secs.is_some_and(|secs| secs > limits.travel_secs) => {
                Some(format!("more than {} s on the way", limits.travel_secs))
            }
            () => None,
        }
    }

    /// Why nobody has anything to do, as far as one can tell by listening.
    pub fn standstill(&self) -> String {
        let [asked, answered] = self.heard.requests;
        match asked > answered {
            true => format!("the explorer does not answer: request {asked} has no plan, and nobody has anything to do"),
            false => format!("nobody has anything to do after {} scans, and the run is not over", self.heard.scans),
        }
    }

    /// What it came to, and the CPU time of each plan (s).
    pub fn outcome(&self) -> (Outcome, Vec<f64>) {
        let heard = &self.heard;
        let site = heard.site;
        let grid = heard.map.grid();
        let (end, reason) = heard.end();
        let [recall, precision] = site.truth.surfaces(&site.world, grid);
        let outcome = Outcome {
            end,
            reason,
            way_m: heard.way_m(),
            rotation_deg: heard.rotation_rad.to_degrees(),
            scans: heard.scans,
            plans: heard.exploration.as_ref().map_or(heard.plan_secs.len() as u64, |report| report.plans),
            travel_secs: heard.travel_secs,
            marks: SHARES.map(|share| mark_at(&heard.trace, share)),
            last_m: [last_gain(&heard.trace, |point| point.coverage), last_gain(&heard.trace, |point| point.surface)],
            tail: heard.tail(),
            area_m: area_above(&heard.trace),
            coverage: heard.coverage.share(),
            recall,
            precision,
            agreement: None,
            contacts: heard.contacts,
            known: (grid.free() + grid.occupied()) as u64,
            map: digest(grid),
            times: Times::default(),
        };
        (outcome, heard.plan_secs.clone())
    }

    /// What was known after each scan, and the map.
    pub fn into_trace_and_map(self) -> (Vec<TracePoint>, OccupancyGrid) {
        (self.heard.trace, self.heard.map.into_grid())
    }
}

impl Heard<'_> {
    fn take(&mut self, mail: &Mail<'_>, camera_pose: &Key<CameraPose>) -> Result<(), DecodeError> {
        match () {
            () if mail.is(&MAP_UPDATE) => {
                let update = mail.decode(&MAP_UPDATE)?;
                if let Ok(Some(changes)) = self.map.take(&update) {
                    self.coverage.update(self.map.grid(), &changes);
                    self.surface.update(self.map.grid(), &changes);
                }
            }
            () if mail.is(camera_pose) => self.on_pose(&mail.decode(camera_pose)?),
            () if mail.is(&POSE_COMMAND) => self.command = Some(mail.decode(&POSE_COMMAND)?),
            () if mail.is(&PROGRESS) => self.on_progress(&mail.decode(&PROGRESS)?),
            () if mail.is(&PLAN_REQUEST) => self.requests[0] = mail.decode(&PLAN_REQUEST)?.id,
            () if mail.is(&PLAN) => {
                let plan = mail.decode(&PLAN)?;
                self.requests[1] = plan.request;
                self.plan_secs.push(plan.cpu_secs);
            }
            () if mail.is(&SENSOR_REPORT) => {
                let report = mail.decode(&SENSOR_REPORT)?;
                (self.scans, self.contacts) = (report.scans, report.contacts.unwrap_or(0));
            }
            () if mail.is(&TRAVEL_REPORT) => self.travel_secs = Some(mail.decode(&TRAVEL_REPORT)?.secs),
            () if mail.is(&MOTION_REPORT) => self.motion = Some(mail.decode(&MOTION_REPORT)?),
            () if mail.is(&EXPLORATION_REPORT) => self.exploration = Some(mail.decode(&EXPLORATION_REPORT)?),
            () => {}
        }
        Ok(())
    }

    /// A robot that was refused its way stays where it is, and has neither gone nor turned.
    fn on_pose(&mut self, camera: &CameraPose) {
        let went = self.command.take_if(|command| command.id == camera.command && command.pose == camera.pose);
        if let (Some(from), Some(command)) = (self.pose, went) {
            self.rotation_rad += from.0.rotation.angle_to(&command.pose.0.rotation);
            let secs = self.site.speed.map(|speed| speed.secs(&from, &command));
            self.travel_secs = self.travel_secs.zip(secs).map(|(before, secs)| before + secs).or(self.travel_secs);
        }
        self.pose = Some(camera.pose);
    }

    fn on_progress(&mut self, progress: &Progress) {
        let Some(pose) = self.pose else { return };
        let mark = Mark {
            way_m: progress.path_length_m,
            rotation_deg: self.rotation_rad.to_degrees(),
            scans: progress.scans,
            travel_secs: self.travel_secs,
        };
        let (coverage, surface) = (self.coverage.share(), self.surface.share());
        self.trace.push(TracePoint { mark, coverage, surface, position: pose.position() });
        if coverage >= LATE && self.before_late.is_none() {
            self.before_late = Some((self.coverage.known().clone(), self.trace.len()));
        }
    }

    /// What of that which was seen late could have been seen earlier.
    fn tail(&self) -> Option<Tail> {
        let (known, points) = self.before_late.as_ref()?;
        let late: VoxelSet = self.coverage.known().iter().filter(|voxel| !known.contains(*voxel)).collect();
        let way: Vec<Point3<f64>> = self.trace[..*points].iter().map(|point| point.position).collect();
        Tail::of((&self.site.world, &self.site.truth), self.site.around?.range_m, &way, &late)
    }

    fn way_m(&self) -> f64 {
        let last = self.trace.last().map_or(0.0, |point| point.mark.way_m);
        self.motion.as_ref().map_or(last, |motion| motion.path_length_m)
    }

    fn end(&self) -> (End, String) {
        let contacts = self.contacts;
        match &self.exploration {
            Some(report) if report.complete && contacts > 0 => {
                (End::Incomplete, format!("the robot touched the world {contacts} times; else: {}", report.reason))
            }
            Some(report) if report.complete => (End::Complete, report.reason.clone()),
            Some(report) => (End::Incomplete, report.reason.clone()),
            None => (End::Failed, "it did not come to its end".to_owned()),
        }
    }
}

/// FNV-1a of a map's voxels, brick by brick in the order of space.
pub fn digest(map: &OccupancyGrid) -> u64 {
    let mut bricks: Vec<_> = map.bricks().iter().collect();
    bricks.sort_by_key(|(brick, _)| brick.to_array());
    let words = bricks.into_iter().flat_map(|(brick, cells)| {
        let place = brick.to_array().map(|index| index as u64);
        place.into_iter().chain(*cells.known()).chain(*cells.occupied())
    });
    let bytes = words.flat_map(u64::to_le_bytes);
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
