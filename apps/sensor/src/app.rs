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
mod tests {
    use std::time::Duration;

    use elk_bus::memory::MemoryBroker;
    use elk_bus::{BrokerConfig, Client, Clock, Community, any};
    use elk_geometry::{State, Voxel};
    use elk_spatial::keys::SCAN;
    use elk_spatial::playback::Playback;

    use super::*;
    use crate::simulator::{Settings, Simulator};
    use crate::surroundings::Body;
    use elk_world::{CAR_INTERIOR, Placement, World};
    use nalgebra::Point3;

    fn app() -> Handled<SensorApp> {
        let world = World::load(CAR_INTERIOR, &Placement::default()).unwrap();
        let start = Pose::from_yaw_pitch(Point3::new(0.0, 0.0, 0.8), 0.0, 0.0);
        let simulator = Simulator::new(Body::new(world, start, 0.05), Settings::default());
        SensorApp::new(Robot::new(Box::new(simulator)).unwrap(), (SCAN, camera_pose("SIM_SENSOR"))).on_the_bus()
    }

    fn join(broker: &MemoryBroker, name: &str) -> Client {
        let community = Community::new("sensor-test").unwrap();
        Client::over(broker.connect(name).unwrap(), name, &community)
    }

    /// Hands the app what has come for it, on the spot.
    fn serve(app: &mut Handled<SensorApp>, client: &mut Client) {
        let (comms, inbox) = (&mut client.comms, &mut client.inbox);
        while inbox.receive(comms, Duration::ZERO, |comms, mail| app.on_new_mail(comms, mail)).unwrap() > 0 {}
        comms.flush().unwrap();
    }

    /// As [`serve`], until nothing comes any more; the number of rejections.
    fn rejections(app: &mut Handled<SensorApp>, client: &mut Client) -> usize {
        let (comms, inbox) = (&mut client.comms, &mut client.inbox);
        let mut count = 0;
        let mut give = |comms: &mut Comms, mail: &Mail<'_>| match app.on_new_mail(comms, mail) {
            Err(failure) if failure.is::<Rejection>() || failure.is::<elk_bus::codec::DecodeError>() => {
                count += 1;
                Ok::<(), AppError>(())
            }
            done => done,
        };
        while inbox.receive(comms, Duration::ZERO, &mut give).unwrap() > 0 {
            comms.flush().unwrap();
        }
        count
    }

    /// Regression: whoever said once that a recording was elsewhere stopped who plays it, for good.
    #[test]
    fn who_says_that_the_recording_is_elsewhere_is_answered_where_it_is() {
        let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
        let (mut sensor, mut probe) = (join(&broker, "Recorded"), join(&broker, "probe"));
        let robot = Robot::carried(crate::recording::mostly(1, 100, 0.0));
        let mut app = SensorApp::new(robot, (SCAN, camera_pose("SIM_SENSOR"))).on_the_bus();
        app.on_start_up(&mut sensor.comms).unwrap();
        probe.comms.register(PLAYBACK.subscription().from("Recorded")).unwrap();
        let command = |id| PoseCommand { id, via: Vec::new(), pose: Pose(Isometry3::identity()) };
        for id in 1..=3 {
            probe.comms.publish(&POSE_COMMAND, &command(id)).unwrap();
        }
        probe.comms.flush().unwrap();
        assert_eq!(rejections(&mut app, &mut sensor), 0);
        let truth = app.state.robot.playback().unwrap();
        assert_eq!((truth.command, truth.scans), (3, 3));
        let mut last = || {
            let mut last = None;
            probe.receive(Duration::ZERO, |mail| last = mail.decode(&PLAYBACK).ok().or(last.take())).unwrap();
            last
        };
        assert_eq!(last().as_ref(), Some(&truth));
        let mut liar = join(&broker, "liar");
        for lie in [
            Playback { command: 1 << 40, ..truth.clone() },
            Playback { command: 1, ..truth.clone() },
            Playback { scans: 1 << 40, ..truth.clone() },
            Playback { next_secs: Some(1e9), ..truth.clone() },
        ] {
            liar.comms.publish(&PLAYBACK, &lie).unwrap();
            liar.comms.flush().unwrap();
            assert_eq!(rejections(&mut app, &mut sensor), 1, "{lie:?}");
            assert_eq!(last().as_ref(), Some(&truth), "{lie:?}");
        }
        // What is true may be said by anybody; commands of elsewhere are answered as well.
        liar.comms.publish(&PLAYBACK, &truth).unwrap();
        liar.comms.flush().unwrap();
        assert_eq!((rejections(&mut app, &mut sensor), last()), (0, None));
        for (id, rejected) in [(1, 0), (1 << 40, 1)] {
            liar.comms.publish(&POSE_COMMAND, &command(id)).unwrap();
            liar.comms.flush().unwrap();
            assert_eq!((rejections(&mut app, &mut sensor), last().as_ref()), (rejected, Some(&truth)));
        }
    }

    /// What the probe has been sent, as key and the command, scan or revision that it carries.
    fn heard(probe: &mut Client) -> Vec<(String, u64)> {
        let mut heard = Vec::new();
        probe
            .receive(Duration::ZERO, |mail| {
                let number = match mail.key() {
                    "SIM_SENSOR" => mail.decode(&camera_pose("SIM_SENSOR")).unwrap().command,
                    "SCAN" => mail.decode(&SCAN).unwrap().command,
                    "SENSOR_REPORT" => mail.decode(&SENSOR_REPORT).unwrap().contacts.unwrap(),
                    _ => mail.decode(&ACCURACY_REPORT).unwrap().voxels,
                };
                heard.push((mail.key().to_owned(), number));
            })
            .unwrap();
        heard
    }

    #[test]
    fn a_command_is_answered_by_pose_scan_and_report_once_and_a_map_by_its_accuracy() {
        let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
        let (mut app, mut sensor, mut probe) = (app(), join(&broker, "Simulator"), join(&broker, "probe"));
        probe.comms.register(any("*").from("Simulator")).unwrap();
        probe.comms.flush().unwrap();
        app.on_start_up(&mut sensor.comms).unwrap();
        serve(&mut app, &mut sensor);
        assert_eq!(heard(&mut probe), [("SIM_SENSOR".to_owned(), 0)]);

        let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
        let command = PoseCommand { id: 1, via: Vec::new(), pose };
        for _ in 0..2 {
            probe.comms.publish(&POSE_COMMAND, &command).unwrap();
        }
        probe.comms.flush().unwrap();
        serve(&mut app, &mut sensor);
        let expected = [("SIM_SENSOR", 1), ("SENSOR_REPORT", 0), ("SCAN", 1)];
        assert_eq!(heard(&mut probe), expected.map(|(key, n)| (key.to_owned(), n)));
        assert_eq!(app.state.robot.pose(), pose);

        let mut map = OccupancyGrid::new(0.1);
        map.set(Voxel::new(0, 0, 8), State::Free);
        // Somebody asks for the map on the way: a robot has no time to evaluate it.
        let part = MapPart::of(&map, 1, 0, 8);
        probe.comms.publish(&MAP_PART, &part).unwrap();
        probe.comms.publish(&MAP, &MapUpdate::new(map.whole(), 1)).unwrap();
        probe.comms.flush().unwrap();
        serve(&mut app, &mut sensor);
        assert_eq!(heard(&mut probe), []);
        probe
            .comms
            .publish(&MOTION_REPORT, &MotionReport { scans: 1, path_length_m: 0.4, free: 1, marks: Vec::new() })
            .unwrap();
        probe.comms.publish(&MAP_PART, &part).unwrap();
        probe.comms.publish(&MAP, &MapUpdate::new(map.whole(), 1)).unwrap();
        probe.comms.flush().unwrap();
        serve(&mut app, &mut sensor);
        // The second one is of the same revision: it is said again, not evaluated again.
        assert_eq!(heard(&mut probe), [("ACCURACY_REPORT".to_owned(), 1), ("ACCURACY_REPORT".to_owned(), 1)]);
    }
    #[test]
    fn a_successor_goes_on_from_where_the_other_one_stood_and_takes_the_scan_that_is_missing() {
        let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
        let mut probe = join(&broker, "probe");
        let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
        let mut other = app();
        other.state.robot.go(&PoseCommand { id: 1, via: Vec::new(), pose });
        let scan = other.state.robot.scan(0.0).unwrap();
        let report = SensorReport { contacts: Some(2), ..other.state.report() };
        probe.comms.publish(&other.state.camera_pose, &CameraPose { command: 1, pose }).unwrap();
        probe.comms.publish(&SENSOR_REPORT, &report).unwrap();
        probe.comms.register(any("*").from("Simulator")).unwrap();
        probe.comms.flush().unwrap();
        for published in [vec![("SCAN".to_owned(), 1)], vec![]] {
            let (mut successor, mut sensor) = (app(), join(&broker, "Simulator"));
            successor.on_start_up(&mut sensor.comms).unwrap();
            serve(&mut successor, &mut sensor);
            assert_eq!(heard(&mut probe), published);
            assert_eq!(successor.state.robot.scan(0.0).unwrap(), scan);
            assert_eq!((successor.state.robot.pose(), successor.state.report()), (pose, report.clone()));
        }
    }

    /// Regression: it stayed at the start, refused what did not begin there, and the mission stood still.
    #[test]
    fn a_successor_that_nothing_was_left_for_goes_where_the_controller_sends_it() {
        let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
        let (mut app, mut sensor, mut probe) = (app(), join(&broker, "Simulator"), join(&broker, "probe"));
        let there = Point3::new(0.4, 0.0, 0.8);
        let pose = Pose::from_yaw_pitch(Point3::new(0.6, 0.2, 0.8), 1.0, 0.0);
        probe.comms.register(any("*").from("Simulator")).unwrap();
        probe.comms.publish(&POSE_COMMAND, &PoseCommand { id: 7, via: vec![there], pose }).unwrap();
        probe.comms.flush().unwrap();
        app.on_start_up(&mut sensor.comms).unwrap();
        serve(&mut app, &mut sensor);
        let expected = [("SIM_SENSOR", 0), ("SIM_SENSOR", 7), ("SENSOR_REPORT", 0), ("SCAN", 7)];
        assert_eq!(heard(&mut probe), expected.map(|(key, n)| (key.to_owned(), n)));
        assert_eq!((app.state.robot.pose(), app.state.robot.scans()), (pose, 7), "scans are counted on");
    }

    /// Regression: it ended, and so did each that came after it.
    #[test]
    fn a_successor_in_another_world_begins_at_its_own_start() {
        let (mut app, start) = (app(), Point3::new(0.0, 0.0, 0.8));
        let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
        let (mut sensor, mut probe) = (join(&broker, "Simulator"), join(&broker, "probe"));
        let pose = Pose::from_yaw_pitch(Point3::new(0.0, 0.0, 99.0), 0.0, 0.0);
        probe.comms.publish(&camera_pose("SIM_SENSOR"), &CameraPose { command: 3, pose }).unwrap();
        probe.comms.register(any("*").from("Simulator")).unwrap();
        probe.comms.flush().unwrap();
        app.on_start_up(&mut sensor.comms).unwrap();
        serve(&mut app, &mut sensor);
        assert_eq!(heard(&mut probe), [("SIM_SENSOR".to_owned(), 0)]);
        assert_eq!(app.state.robot.pose().position(), start);
    }

    #[test]
    fn a_command_of_a_foreign_number_is_refused_and_the_next_one_carried_out() {
        let (mut app, broker) = (app(), MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0)));
        let mut sensor = join(&broker, "Simulator");
        let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
        let command = |id| PoseCommand { id, via: Vec::new(), pose };
        app.state.on_command(&mut sensor.comms, command(1)).unwrap();
        for foreign in [3, 1000, 1 << 47] {
            let failure = app.state.on_command(&mut sensor.comms, command(foreign)).unwrap_err();
            assert!(failure.is::<Rejection>(), "{failure}");
        }
        app.state.on_command(&mut sensor.comms, command(2)).unwrap();
        assert_eq!((app.state.robot.command(), app.state.robot.scans()), (2, 2));
        // Of a predecessor's last commands the word may be lost.
        app.state.inherited = true;
        app.state.on_command(&mut sensor.comms, command(4)).unwrap();
        assert!(app.state.on_command(&mut sensor.comms, command(6)).is_err());
    }

    /// Regression: it was scanned, and counted as a contact.
    #[test]
    fn a_pose_that_is_no_number_is_no_motion() {
        let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
        let (mut app, mut sensor, mut probe) = (app(), join(&broker, "Simulator"), join(&broker, "probe"));
        app.on_start_up(&mut sensor.comms).unwrap();
        serve(&mut app, &mut sensor);
        let (here, nowhere) = (app.state.robot.pose(), Point3::new(f64::NAN, 0.0, 0.8));
        let lost = Pose::from_yaw_pitch(nowhere, 0.0, 0.0);
        for (via, pose) in [(vec![], lost), (vec![nowhere], here)] {
            probe.comms.publish(&POSE_COMMAND, &PoseCommand { id: 1, via, pose }).unwrap();
            probe.comms.flush().unwrap();
            assert_eq!(rejections(&mut app, &mut sensor), 1);
        }
        assert_eq!((app.state.robot.scans(), app.state.robot.contacts(), app.state.robot.pose()), (0, Some(0), here));
    }

    /// Regression: nobody contradicted a pose that somebody made up, and the controller stood there for ever.
    #[test]
    fn a_pose_that_is_not_the_sensors_own_is_answered_by_the_true_one() {
        let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
        let (mut app, mut sensor, mut probe) = (app(), join(&broker, "Simulator"), join(&broker, "probe"));
        let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
        let memory = CameraPose { command: 3, pose };
        probe.comms.publish(&app.state.camera_pose, &memory).unwrap();
        probe.comms.register(any("*").from("Simulator")).unwrap();
        probe.comms.flush().unwrap();
        app.on_start_up(&mut sensor.comms).unwrap();
        assert_eq!(rejections(&mut app, &mut sensor), 0, "what was left is memory");
        assert_eq!((app.state.place(), heard(&mut probe)), (memory.clone(), vec![]));
        let elsewhere = Pose::from_yaw_pitch(Point3::new(0.6, 0.2, 0.8), 1.0, 0.0);
        let lies = [CameraPose { command: 3, pose: elsewhere }, CameraPose { command: 4, pose }];
        for (said, rejected) in [(&memory, 0), (&lies[0], 1), (&lies[1], 1)] {
            probe.comms.publish(&app.state.camera_pose, said).unwrap();
            probe.comms.flush().unwrap();
            assert_eq!(rejections(&mut app, &mut sensor), rejected);
            assert_eq!(heard(&mut probe), vec![("SIM_SENSOR".to_owned(), 3); rejected]);
        }
    }

    #[test]
    fn whoever_counts_fewer_commands_is_told_how_many_there_were() {
        let broker = MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0));
        let (mut app, mut sensor, mut probe) = (app(), join(&broker, "Simulator"), join(&broker, "probe"));
        let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
        let command = |id| PoseCommand { id, via: Vec::new(), pose };
        app.state.on_command(&mut sensor.comms, command(1)).unwrap();
        app.state.on_command(&mut sensor.comms, command(2)).unwrap();
        sensor.comms.flush().unwrap();
        probe.comms.register(any("SIM_SENSOR").from("Simulator")).unwrap();
        probe.comms.flush().unwrap();
        assert_eq!(heard(&mut probe), [("SIM_SENSOR".to_owned(), 2)]);
        app.state.on_command(&mut sensor.comms, command(1)).unwrap();
        sensor.comms.flush().unwrap();
        assert_eq!(heard(&mut probe), [("SIM_SENSOR".to_owned(), 2)]);
    }

    /// A report that speaks of far more scans than there were commands is of another run, or made up.
    #[test]
    fn a_report_that_the_pose_contradicts_is_not_believed() {
        let (mut app, broker) = (self::app(), MemoryBroker::new(BrokerConfig::new("sensor-test"), Clock::new(1.0)));
        let pose = Pose::from_yaw_pitch(Point3::new(0.4, 0.0, 0.8), 1.0, 0.0);
        let report = Some(SensorReport { scans: 1 << 47, contacts: Some(9), scan: 1 << 47, cpu_secs: 0.0 });
        app.state.past = Some(Past { pose: Some(CameraPose { command: 5, pose }), report, scan: 5 });
        app.state.begin(&mut join(&broker, "Simulator").comms).unwrap();
        assert_eq!((app.state.robot.scans(), app.state.robot.contacts()), (5, Some(0)));
        // Nor is a pose after commands of which nobody has seen a scan.
        let mut app = self::app();
        app.state.past = Some(Past { pose: Some(CameraPose { command: 1 << 47, pose }), ..Past::default() });
        app.state.begin(&mut join(&broker, "Another").comms).unwrap();
        assert_eq!((app.state.robot.command(), app.state.robot.scans()), (0, 0));
    }
}
