//! A depth source as an app: pose commands in, poses and scans out.

use elk_bus::clock::thread_cpu_secs;
use elk_bus::{App, AppError, Comms, Handled, Handlers, Key, Mail, Rejection, Subscribe, tell};
use elk_geometry::{OccupancyGrid, Pose};
use elk_mission::Params;
use elk_spatial::Scan;
use elk_spatial::checks::{MAX_COMMANDS_LOST, MAX_REVISIONS_AHEAD};
use elk_spatial::keyframe::{Keyframe, MapPart, Step};
use elk_spatial::keys::{
    ACCURACY_REPORT, MAP, MAP_PART, MOTION_REPORT, PLAYBACK, POSE_COMMAND, POSE_ESTIMATE, SENSOR_REPORT, camera_pose,
};
use elk_spatial::map::{MapUpdate, UpdateError};
use elk_spatial::messages::{AccuracyReport, CameraPose, MotionReport, PoseCommand, SensorReport};
use nalgebra::Isometry3;

use crate::localised::{Estimating, Localised};
use crate::recording::{Advance, Player};
use crate::robot::{Robot, ScanError};
use crate::source::{Accuracy, DepthSource};

/// Frames that were passed over are said one by one, up to so many.
const SAID: u64 = 20;

/// A sensor of any source, with the parameters that all share.
///
/// # Errors
/// Its robot cannot be where the source says that it starts.
pub fn app(params: &Params, source: Box<dyn DepthSource>) -> Result<Box<dyn App>, AppError> {
    Ok(on_the_bus(params, Robot::new(source).map_err(|refusal| format!("start: {refusal}"))?))
}

/// A simulated sensor of any source, with the parameters that all share: told where it is, or going by an estimate.
///
/// # Errors
/// Its robot cannot be where the source says that it starts.
pub(crate) fn simulated(
    params: &Params,
    source: Box<dyn DepthSource>,
    estimating: Option<Estimating>,
) -> Result<Box<dyn App>, AppError> {
    match estimating {
        None => app(params, source),
        Some(estimating) => {
            let robot = Robot::localised(Localised::new(source, estimating));
            Ok(on_the_bus(params, robot.map_err(|refusal| format!("start: {refusal}"))?))
        }
    }
}

/// The sensor of a recording, with the parameters that all share.
pub fn recorded(params: &Params, player: Player) -> Box<dyn App> {
    on_the_bus(params, Robot::carried(player))
}

fn on_the_bus(params: &Params, robot: Robot) -> Box<dyn App> {
    let keys = (Key::named(params.text("Output")), camera_pose(params.text("MOOSPoseVarName")));
    Box::new(SensorApp::new(robot, keys).on_the_bus())
}

/// A [`Robot`] on the bus.
struct SensorApp {
    robot: Robot,
    scan: Key<Scan<'static>>,
    camera_pose: Key<CameraPose>,
    /// CPU spent on scans so far (s).
    cpu_secs: f64,
    /// Until it has begun.
    past: Option<Past>,
    /// What it knows of commands is a predecessor's word, which perhaps missed some.
    inherited: bool,
    /// The last evaluation of a map.
    evaluated: Option<AccuracyReport>,
    /// Whether the controller has said that the robot goes no farther.
    is_over: bool,
    /// What has come of the whole map.
    coming: Option<Keyframe>,
    /// Frames of a recording that were passed over.
    passed_over: u64,
}

/// What is known of a predecessor.
#[derive(Debug, Default)]
struct Past {
    pose: Option<CameraPose>,
    report: Option<SensorReport>,
    /// The last scan that was published.
    scan: u64,
}

impl SensorApp {
    fn new(robot: Robot, (scan, camera_pose): (Key<Scan<'static>>, Key<CameraPose>)) -> Self {
        Self {
            robot,
            scan,
            camera_pose,
            cpu_secs: 0.0,
            past: Some(Past::default()),
            inherited: false,
            evaluated: None,
            is_over: false,
            coming: None,
            passed_over: 0,
        }
    }

    fn on_the_bus(self) -> Handled<Self> {
        let table = Handlers::<Self>::new()
            .on_start_up(Self::remark)
            .recall(&self.camera_pose, |sensor, _, pose| sensor.past(|past| past.pose = Some(pose)))
            .recall(&SENSOR_REPORT, |sensor, _, report| sensor.past(|past| past.report = Some(report)))
            .recall(&self.scan, |sensor, _, scan| sensor.past(|past| past.scan = scan.id))
            .recalled(Self::begin)
            .on(&POSE_COMMAND, Self::on_command)
            // What others say of it.
            .on(self.camera_pose.subscription().as_it_comes(), Self::on_camera_pose);
        match self.robot.truth().is_some() {
            true => table
                .recall(&ACCURACY_REPORT, Self::on_accuracy_report)
                .on(&MOTION_REPORT, Self::on_end)
                .on(&MAP, Self::on_map)
                .on(&MAP_PART, Self::on_map_part)
                .with(self),
            false if self.robot.playback().is_some() => {
                table.on(PLAYBACK.subscription().as_it_comes(), Self::on_playback).with(self)
            }
            false => table.with(self),
        }
    }

    fn remark(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        for remark in self.robot.remarks() {
            tell(format_args!("{}: {remark}", comms.name()));
        }
        Ok(())
    }

    fn past(&mut self, take_note: impl FnOnce(&mut Past)) -> Result<(), AppError> {
        if let Some(past) = &mut self.past {
            take_note(past);
        }
        Ok(())
    }

    fn on_accuracy_report(&mut self, _: &mut Comms, evaluated: AccuracyReport) -> Result<(), AppError> {
        self.evaluated = Some(evaluated);
        Ok(())
    }

    /// The mission is over: whole maps that come from now on are the map that counts. To evaluate one takes longer than a
    /// step does, so those that readers ask for on the way, as a view that comes late does, are passed over.
    fn on_end(&mut self, _: &mut Comms, _: MotionReport) -> Result<(), AppError> {
        self.is_over = true;
        Ok(())
    }

    /// Says where the camera is, or goes on where a predecessor stopped: takes the scan again that it did not come to
    /// publish.
    fn begin(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let Past { pose, report, scan } = self.past.take().unwrap_or_default();
        // Scans and commands go together: what is far from all else that was left is not of this run.
        let others = report.as_ref().map_or(scan, |report| report.scans.max(scan));
        let Some(pose) = pose.filter(|pose| pose.command <= others + MAX_REVISIONS_AHEAD) else {
            self.publish_pose(comms)?;
            return self.publish_playback(comms);
        };
        self.look_whether_it_can_succeed()?;
        let report = report.filter(|report| report.scans <= scan.max(pose.command) + MAX_REVISIONS_AHEAD);
        let (scans, contacts, cpu_secs) =
            report.map_or((scan, 0, 0.0), |r| (r.scans, r.contacts.unwrap_or(0), r.cpu_secs));
        if let Err(refusal) = self.robot.succeed(&pose, scans, contacts) {
            tell(format_args!(
                "{}: where the sensor before this one was ({}): {refusal}; give this one the same World. It begins at its own \
                 start, and goes where the next command begins",
                comms.name(),
                self.camera_pose.name()
            ));
            return self.publish_pose(comms);
        }
        self.inherited = true;
        self.cpu_secs = cpu_secs;
        self.publish_playback(comms)?;
        match scan < scans {
            true => {
                let scan = self.robot.scan(comms.time());
                self.publish(comms, scan)
            }
            false => Ok(()),
        }
    }

    fn on_command(&mut self, comms: &mut Comms, command: PoseCommand) -> Result<(), AppError> {
        if command.id <= self.robot.command() {
            let last = self.robot.command();
            // The last one comes again when the controller or the sensor was exchanged; an older one is a mistake.
            if command.id < last {
                tell(format_args!("pose command {} ignored: {last} is already carried out", command.id));
                self.publish_pose(comms)?;
                return self.publish_playback(comms);
            }
            return Ok(());
        }
        if let Err(foreign) = self.look_at_number(&command) {
            // Whoever counts otherwise learns from it how many there were.
            self.publish_pose(comms)?;
            self.publish_playback(comms)?;
            return Err(foreign.into());
        }
        if self.robot.command() == 0 && command.id > 1 {
            self.look_whether_it_can_succeed()?;
            self.find_robot(comms.name(), &command);
        }
        self.inherited = false;
        let before = thread_cpu_secs();
        let taken = self.robot.scans();
        let (travel, advance) = self.robot.go(&command);
        // A recording that is over has none.
        let scan = (self.robot.scans() > taken).then(|| self.robot.scan(comms.time()));
        self.cpu_secs += thread_cpu_secs() - before;
        self.say_passed_over(comms.name(), &advance);
        if let Some(refusal) = travel.refused {
            tell(format_args!("pose command {} refused, the robot stays: {refusal}", command.id));
        }
        // A successor finds the two together, and then knows by the last scan whether this one came to be published.
        self.publish_pose(comms)?;
        comms.publish(&SENSOR_REPORT, &self.report())?;
        advance.estimates.iter().try_for_each(|estimate| comms.publish(&POSE_ESTIMATE, estimate))?;
        self.publish_playback(comms)?;
        scan.map_or(Ok(()), |scan| self.publish(comms, scan))
    }

    /// How far a recording is.
    fn publish_playback(&self, comms: &mut Comms) -> Result<(), AppError> {
        let playback = self.robot.playback();
        playback.iter().try_for_each(|playback| Ok(comms.publish(&PLAYBACK, playback)?))
    }

    fn say_passed_over(&mut self, name: &str, advance: &Advance) {
        for frame in &advance.passed_over {
            self.passed_over += 1;
            match self.passed_over {
                0..SAID => tell(format_args!("{name}: {frame}; it is passed over")),
                SAID => {
                    tell(format_args!("{name}: {frame}; it is passed over, and so will be others, which are counted"))
                }
                _ => {}
            }
        }
    }

    /// Without a scan the app ends; that the robot has moved is out by then.
    fn publish(&self, comms: &mut Comms, scan: Result<Scan<'static>, ScanError>) -> Result<(), AppError> {
        match scan {
            Ok(scan) => Ok(comms.publish(&self.scan, &scan)?),
            Err(error) => {
                comms.flush()?;
                Err(error.into())
            }
        }
    }

    /// Commands are unbroken, as long as it has heard all of them itself; one of another number is not the controller's.
    fn look_at_number(&self, command: &PoseCommand) -> Result<(), Rejection> {
        let last = self.robot.command();
        let most = if self.inherited { last + MAX_COMMANDS_LOST } else { last + 1 };
        if last == 0 || command.id <= most {
            return Ok(());
        }
        Err(Rejection::new(format_args!("id is {}; the last command was {last}, and they are unbroken", command.id)))
    }

    /// Where a robot truly was that went by an estimate, no message says.
    fn look_whether_it_can_succeed(&self) -> Result<(), AppError> {
        match self.robot.can_succeed() {
            true => Ok(()),
            false => Err("a simulated robot that goes by an estimate cannot go on where another one stopped: where that one truly was \
                          died with it. Launch the mission anew, or with PoseEstimator none"
                .into()),
        }
    }

    /// Goes on from where a command begins: what the sensor before this one said has died with it and the broker, and of
    /// those who live only the controller knows where the robot is to be.
    fn find_robot(&mut self, name: &str, command: &PoseCommand) {
        let place = command.via.first().copied().unwrap_or(command.pose.position());
        let pose = Pose(Isometry3::from_parts(place.into(), command.pose.0.rotation));
        let last = command.id - 1;
        // Where it cannot be it is not taken to be; the command is refused then.
        if self.robot.succeed(&CameraPose { command: last, pose }, last, 0).is_ok() {
            tell(format_args!(
                "{name}: what became of pose commands 1 to {last} is lost with the sensor and the broker before this one; \
                 the robot is taken to be where command {} begins, and no contact before it counts",
                command.id
            ));
        }
    }

    fn place(&self) -> CameraPose {
        CameraPose { command: self.robot.command(), pose: self.robot.pose() }
    }

    fn publish_pose(&self, comms: &mut Comms) -> Result<(), AppError> {
        Ok(comms.publish(&self.camera_pose, &self.place())?)
    }

    /// Where somebody else says that the camera is: nobody but the sensor knows, and it has the last word.
    fn on_camera_pose(&mut self, comms: &mut Comms, mail: Mail<'_>) -> Result<(), AppError> {
        let said = mail.decode(&self.camera_pose);
        let place = self.place();
        if mail.source() == comms.name() || said.as_ref().is_ok_and(|said| *said == place) {
            return Ok(());
        }
        self.publish_pose(comms)?;
        let said = said?;
        let which = if said.command == place.command { "pose" } else { "command" };
        Err(Rejection::new(format_args!(
            "{which} is not the camera's, as {} knows, whose variable this is: its last command is {}, not {}",
            comms.name(),
            place.command,
            said.command
        ))
        .into())
    }

    /// How far somebody else says that the recording is. Whoever plays it goes by that, so the sensor has the last word here, too.
    fn on_playback(&mut self, comms: &mut Comms, mail: Mail<'_>) -> Result<(), AppError> {
        let said = mail.decode(&PLAYBACK);
        let Some(own) = self.robot.playback() else { return Ok(()) };
        if mail.source() == comms.name() || said.as_ref().is_ok_and(|said| *said == own) {
            return Ok(());
        }
        self.publish_playback(comms)?;
        let said = said?;
        Err(Rejection::new(format_args!(
            "it is not the recording's, as {} knows, whose variable this is: it is at command {} and scan {}, not {} and {}",
            comms.name(),
            own.command,
            own.scans,
            said.command,
            said.scans
        ))
        .into())
    }

    fn report(&self) -> SensorReport {
        SensorReport {
            scans: self.robot.scans(),
            contacts: self.robot.contacts(),
            scan: self.robot.scans(),
            cpu_secs: self.cpu_secs,
        }
    }

    /// Evaluates a whole map that comes in parts of one revision, as it does when the robot stands still.
    fn on_map_part(&mut self, comms: &mut Comms, part: MapPart) -> Result<(), AppError> {
        if !self.is_over {
            return Ok(());
        }
        let fits = self.coming.as_ref().is_some_and(|coming| coming.resolution() == part.resolution);
        let mut coming = self.coming.take().filter(|_| fits).unwrap_or_else(|| Keyframe::new(part.resolution));
        match coming.take(&part) {
            Step::Whole(map) => return self.on_map(comms, map),
            Step::Taken => {}
            Step::Apart => {
                coming = Keyframe::new(part.resolution);
                coming.take(&part);
            }
        }
        self.coming = Some(coming);
        Ok(())
    }

    /// Evaluates a whole map, or says again how right it was; only who knows the true world is asked.
    fn on_map(&mut self, comms: &mut Comms, update: MapUpdate) -> Result<(), AppError> {
        if !self.is_over {
            return Ok(());
        }
        self.evaluated = match self.evaluated.take_if(|evaluated| evaluated.revision == update.revision) {
            Some(evaluated) => Some(evaluated),
            None => self.evaluate(&update)?,
        };
        self.evaluated.iter().try_for_each(|report| Ok(comms.publish(&ACCURACY_REPORT, report)?))
    }

    fn evaluate(&self, update: &MapUpdate) -> Result<Option<AccuracyReport>, AppError> {
        let Some(truth) = self.robot.truth() else { return Ok(None) };
        let mut map = OccupancyGrid::new(update.resolution);
        map.apply(&update.delta()).map_err(|why| Rejection::new(UpdateError::from(why)))?;
        // Who cannot tell has evaluated no voxel: nobody waits for more.
        let accuracy = truth.evaluate(&map).map_err(Rejection::new)?;
        let Accuracy { share, voxels } = accuracy.unwrap_or(Accuracy { share: 0.0, voxels: 0 });
        Ok(Some(AccuracyReport { revision: update.revision, accuracy: share, voxels }))
    }
}

#[cfg(test)]
mod tests;
