//! The follower as an app: camera poses, map updates and plans in; pose commands, requests and progress out.

use std::collections::VecDeque;
use std::time::Duration;

use elk_bus::{AppError, Comms, Handled, Handlers, Key, Mail, Rejection, number, tell, text};
use elk_mission::{AppType, Kind, ParamSpec, Params};
use elk_spatial::keyframe::MapPart;
use elk_spatial::keys::{
    CAMERA_POSE, MAP, MAP_PART, MAP_RECALL, MAP_REQUEST, MAP_UPDATE, MOTION, MOTION_MEMORY, MOTION_REPORT, PLAN,
    PLAN_REQUEST, POSE_COMMAND, PROGRESS, STEP, TRAVEL_REPORT, camera_pose,
};
use elk_spatial::map::MapUpdate;
use elk_spatial::messages::{Awaited, CameraPose, MotionMemory, Plan};

use crate::allowance::Allowance;
use crate::drive::Robot;
use crate::follower::{Action, Follower, Unfit};
use crate::pace::Pace;

/// Its row in the table of controllers.
pub(crate) const TYPE: AppType = AppType {
    element: "Controller",
    name: "MOOSSim",
    summary: "Moves a simulated camera along the explorer's paths, scanning on the way.",
    params: PARAMS,
    build: |params| Ok(Box::new(ControllerApp::new(params).on_the_bus())),
    preflight: None,
};

/// So many times it is said that the robot stopped.
const STOPS_SAID: u64 = 20;

/// How often it is seen whether a robot that takes its time has arrived.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// A parameter with a default.
pub(crate) const fn param(name: &'static str, kind: Kind, default: &'static str, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind, default: Some(default), doc }
}

/// Whether a person allows each command; of every controller.
pub(crate) const MANUAL: ParamSpec =
    param("Manual", Kind::Flag, "false", "Pause before the first pose command: as if MOTION had said pause.");

/// Where a controller that follows paths hears of the camera's pose.
pub(crate) const POSE_VARIABLE: ParamSpec = param(
    "MOOSPoseVarName",
    Kind::Variable,
    CAMERA_POSE,
    "Variable under which the sensor publishes the camera's pose.",
);

const PARAMS: &[ParamSpec] = &[
    POSE_VARIABLE,
    param(
        "Pace",
        Kind::Number { unit: "", min: 0.0, max: 1000.0 },
        "0",
        "How many times as fast as Speed and TurnRate the robot goes; 0: it is where it is sent to at once.",
    ),
    param("Speed", Kind::Number { unit: "m/s", min: 0.001, max: 1000.0 }, "0.5", "The robot's speed, at Pace 1."),
    param(
        "TurnRate",
        Kind::Number { unit: "deg/s", min: 0.1, max: 36_000.0 },
        "90",
        "How fast the robot turns, while it goes or on the spot, at Pace 1.",
    ),
    MANUAL,
];

/// The [`Follower`] on the bus.
pub struct ControllerApp {
    follower: Follower,
    camera_pose: Key<CameraPose>,
    allowance: Allowance,
    pace: Pace,
    /// What the follower wants said, held back from the first command on that waits for a step.
    held: VecDeque<Action>,
    /// The memory as it was last published.
    remembered: Option<MotionMemory>,
    /// How often a robot that takes its time had stopped when that was last said.
    stops: u64,
}

impl ControllerApp {
    /// A controller whose robot is where it is sent at once, with checked parameters.
    pub fn new(params: &Params) -> Self {
        let pace = Pace::new(params.number("Speed"), params.number("TurnRate").to_radians(), params.number("Pace"));
        Self { pace, ..Self::with(params, Follower::default()) }
    }

    /// One whose robot takes its time.
    pub fn driving(params: &Params, robot: Robot) -> Self {
        Self::with(params, Follower::of(Some(robot)))
    }

    fn with(params: &Params, follower: Follower) -> Self {
        Self {
            follower,
            camera_pose: camera_pose(params.text("MOOSPoseVarName")),
            allowance: Allowance { paused: params.flag("Manual"), ..Allowance::default() },
            pace: Pace::default(),
            held: VecDeque::new(),
            remembered: None,
            stops: 0,
        }
    }

    /// The controller as an app.
    pub fn on_the_bus(self) -> Handled<Self> {
        let table = Handlers::<Self>::new()
            .recall(&MOTION_MEMORY, Self::succeed)
            .on(text(MOTION), |app, _, word: &str| app.allowance.obey(word))
            .on_with(number(STEP), Self::on_step)
            .on(&self.camera_pose, Self::on_camera_pose)
            .on(&MAP, Self::on_map)
            .on(&MAP_UPDATE, Self::on_map)
            .on(&MAP_PART, Self::on_map_part)
            .on(number(MAP_RECALL), Self::on_map_recall)
            .on(&PLAN, Self::on_plan)
            .caught_up(Self::resume)
            .after_each(Self::say);
        // A robot that is slow has to be looked at until it is there.
        let table = if self.pace.is_slow() { table.iterate(LOOK_EVERY, Self::say) } else { table };
        table.with(self)
    }

    /// Goes on, once all is known that there is to tell.
    fn resume(&mut self, _: &mut Comms) -> Result<(), AppError> {
        self.held.extend(self.follower.resume());
        Ok(())
    }

    fn succeed(&mut self, _: &mut Comms, memory: MotionMemory) -> Result<(), AppError> {
        self.follower = Follower::successor(&memory, self.follower.robot().copied()).map_err(Rejection::new)?;
        self.stops = self.follower.robot().map_or(0, |robot| robot.stops);
        self.allowance = self.allowance.successor(&memory);
        self.remembered = Some(memory);
        Ok(())
    }

    fn on_camera_pose(&mut self, comms: &mut Comms, camera: CameraPose) -> Result<(), AppError> {
        let before = self.follower.commands();
        self.held.extend(self.follower.on_camera_pose(&camera).map_err(Rejection::new)?);
        self.pace.is_at(&camera.pose);
        if self.follower.commands() < before {
            (self.allowance.allowed, self.allowance.steps) = (0, 0);
            tell(format_args!(
                "{}: {before} commands were counted here, {} by the sensor, which knows: it goes on from there",
                comms.name(),
                camera.command
            ));
        }
        Ok(())
    }

    fn on_map(&mut self, comms: &mut Comms, update: MapUpdate) -> Result<(), AppError> {
        let taken = self.follower.on_map(&update);
        self.go_on_with(comms, taken)
    }

    fn on_map_part(&mut self, comms: &mut Comms, part: MapPart) -> Result<(), AppError> {
        let taken = self.follower.on_map_part(&part);
        self.go_on_with(comms, taken)
    }

    fn go_on_with(&mut self, comms: &mut Comms, taken: Result<Vec<Action>, Unfit>) -> Result<(), AppError> {
        if self.follower.take_question() {
            comms.notify(MAP_REQUEST, 1.0)?;
        }
        self.held.extend(taken.map_err(Rejection::new)?);
        Ok(())
    }

    fn on_map_recall(&mut self, comms: &mut Comms, revision: f64) -> Result<(), AppError> {
        self.follower.replica().answer(comms, revision)
    }

    fn on_plan(&mut self, _: &mut Comms, plan: Plan) -> Result<(), AppError> {
        self.held.extend(self.follower.on_plan(&plan).map_err(Rejection::new)?);
        Ok(())
    }

    fn on_step(&mut self, _: &mut Comms, _: f64, mail: &Mail<'_>) -> Result<(), AppError> {
        self.allowance.step(mail);
        Ok(())
    }

    /// Says what is not held back; before that it is remembered that it was going to be said.
    fn say(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let (mut actions, now) = (Vec::new(), comms.time());
        while let Some(action) = self
            .held
            .pop_front_if(|action| is_there(action, &mut self.pace, now) && allows(action, &mut self.allowance))
        {
            actions.push(action);
        }
        let memory = self.follower.memory(&self.allowance);
        if memory.awaited != Awaited::Start && self.remembered.as_ref() != Some(&memory) {
            comms.publish(&MOTION_MEMORY, &memory)?;
            self.remembered = Some(memory);
        }
        self.tell_of_stop(comms.name());
        actions.iter().try_for_each(|action| {
            publish(comms, action)?;
            let travel = self.follower.travel().filter(|_| matches!(action, Action::Command(_)));
            travel.iter().try_for_each(|travel| Ok(comms.publish(&TRAVEL_REPORT, travel)?))
        })
    }

    /// Says where the robot stopped, if it did; after some times no more.
    fn tell_of_stop(&mut self, name: &str) {
        let Some(robot) = self.follower.robot().filter(|robot| robot.stops > self.stops) else { return };
        self.stops = robot.stops;
        let (p, secs) = (robot.body.position, robot.secs);
        if self.stops <= STOPS_SAID {
            let more = if self.stops == STOPS_SAID { "; later stops are only counted" } else { "" };
            tell(format_args!(
                "{name}: after {secs:.1} s the robot stopped at ({:.2}; {:.2}; {:.2}) m: on its way it would have left what is known \
                 to be free with its clearance; it asks for another way{more}",
                p.x, p.y, p.z
            ));
        }
    }
}

/// Whether `action` may be said now; a pose command that has to wait for a step takes one.
fn allows(action: &Action, allowance: &mut Allowance) -> bool {
    match action {
        Action::Command(command) => allowance.allows(command.id),
        _ => true,
    }
}

/// Whether a robot that goes at this pace would be where `action` sends it.
fn is_there(action: &Action, pace: &mut Pace, now: f64) -> bool {
    match action {
        Action::Command(command) => pace.is_there(command, now),
        _ => true,
    }
}

pub(crate) fn publish(comms: &mut Comms, action: &Action) -> Result<(), AppError> {
    match action {
        Action::Command(command) => comms.publish(&POSE_COMMAND, command)?,
        Action::Request(request) => comms.publish(&PLAN_REQUEST, request)?,
        Action::Progress(progress) => comms.publish(&PROGRESS, progress)?,
        Action::Finished(report) => comms.publish(&MOTION_REPORT, report)?,
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use elk_bus::memory::MemoryBroker;
    use elk_bus::{App, BrokerConfig, Client, Clock, Community};
    use elk_geometry::{OccupancyGrid, Pose};

    use super::*;

    /// A controller, and a person, a sensor and a map in one who answer each command when they are told to.
    struct Bench {
        broker: MemoryBroker,
        app: Handled<ControllerApp>,
        client: Client,
        others: Client,
        map: OccupancyGrid,
        pose: Pose,
    }

    fn app(paused: bool) -> Handled<ControllerApp> {
        let app = ControllerApp {
            follower: Follower::default(),
            camera_pose: camera_pose(CAMERA_POSE),
            allowance: Allowance { paused, ..Allowance::default() },
            pace: Pace::default(),
            held: VecDeque::new(),
            remembered: None,
            stops: 0,
        };
        app.on_the_bus()
    }

    fn join(broker: &MemoryBroker, name: &str) -> Client {
        Client::over(broker.connect(name).unwrap(), name, &Community::new("controller-test").unwrap())
    }

    impl Bench {
        fn new(paused: bool) -> Self {
            let broker = MemoryBroker::new(BrokerConfig::new("controller-test"), Clock::new(1.0));
            let (client, mut others) = (join(&broker, "Controller"), join(&broker, "others"));
            let pose = Pose::from_yaw_pitch(nalgebra::Point3::origin(), 0.0, 0.0);
            others.comms.register(&POSE_COMMAND).unwrap();
            others.comms.register(&PLAN_REQUEST).unwrap();
            others.comms.publish(&camera_pose(CAMERA_POSE), &CameraPose { command: 0, pose }).unwrap();
            let mut bench = Self { broker, app: app(paused), client, others, map: OccupancyGrid::new(0.1), pose };
            bench.start();
            bench
        }

        fn start(&mut self) {
            self.others.comms.flush().unwrap();
            self.app.on_start_up(&mut self.client.comms).unwrap();
        }

        /// Puts a successor in the controller's place, whose parameters know nothing of a pause.
        fn exchange(&mut self) {
            // Its name is free when its client is gone.
            self.client = join(&self.broker, "nobody");
            self.app = app(false);
            self.client = join(&self.broker, "Controller");
            self.start();
        }

        fn say(&mut self, key: &str, value: impl Into<elk_bus::Value>) {
            self.others.comms.notify(key, value).unwrap();
        }

        /// Lets the controller do what it can; the numbers of its commands and, negative, of its requests.
        fn heard(&mut self) -> Vec<i64> {
            self.others.comms.flush().unwrap();
            let (app, Client { comms, inbox }) = (&mut self.app, &mut self.client);
            let mut give = |comms: &mut Comms, mail: &Mail<'_>| match app.on_new_mail(comms, mail) {
                Err(failure) if failure.is::<Rejection>() => Ok::<(), AppError>(()),
                done => done,
            };
            while inbox.receive(comms, Duration::ZERO, &mut give).unwrap() > 0 {}
            let mut heard = Vec::new();
            let note = |mail: &Mail<'_>| match mail.is(&POSE_COMMAND) {
                true => heard.push(mail.decode(&POSE_COMMAND).unwrap().id as i64),
                false => heard.push(-(mail.decode(&PLAN_REQUEST).unwrap().id as i64)),
            };
            self.others.receive(Duration::ZERO, note).unwrap();
            heard
        }

        /// The sensor has carried out command `id`, and its scan is in the map.
        fn scanned(&mut self, id: u64) {
            let at = CameraPose { command: id, pose: self.pose };
            self.others.comms.publish(&camera_pose(CAMERA_POSE), &at).unwrap();
            let update = MapUpdate::new(self.map.advance(&[]), id);
            self.others.comms.publish(&MAP_UPDATE, &update).unwrap();
        }
    }

    #[test]
    fn a_step_is_one_command_and_a_run_all_of_them() {
        let mut bench = Bench::new(true);
        assert!(bench.heard().is_empty(), "Manual is a pause from the beginning");
        bench.say(STEP, 1.0);
        assert_eq!(bench.heard(), [1]);
        bench.scanned(1);
        assert_eq!(bench.heard(), [-1], "a pause is before a command, not before a question");
        let mut bench = Bench::new(true);
        bench.say(MOTION, "walk");
        assert!(bench.heard().is_empty(), "a word that it does not know changes nothing");
        bench.say(MOTION, "run");
        assert_eq!(bench.heard(), [1]);
        bench.say(STEP, 1.0);
        bench.say(MOTION, "pause");
        assert!(bench.heard().is_empty());
        assert_eq!(
            (bench.app.state.allowance.paused, bench.app.state.allowance.steps),
            (true, 0),
            "a step without a pause is none"
        );
    }

    #[test]
    fn a_step_is_taken_by_a_controller_that_starts_after_it() {
        let mut bench = Bench::new(true);
        bench.say(MOTION, "pause");
        bench.exchange();
        assert!(bench.heard().is_empty());
        // Its place is empty while a person is quick.
        bench.client = join(&bench.broker, "nobody");
        bench.app = app(false);
        bench.say(STEP, 1.0);
        bench.others.comms.flush().unwrap();
        bench.client = join(&bench.broker, "Controller");
        bench.start();
        assert_eq!(bench.heard(), [1]);
        bench.exchange();
        assert_eq!((bench.heard(), bench.app.state.allowance.steps), (vec![1], 0), "said again, and no second step");
    }

    #[test]
    fn a_successor_pauses_where_the_other_one_paused_and_takes_no_step_twice() {
        let mut bench = Bench::new(false);
        bench.say(MOTION, "pause");
        bench.others.comms.flush().unwrap();
        bench.exchange();
        assert!(bench.heard().is_empty(), "the latest MOTION is a pause");
        bench.exchange();
        assert!(bench.heard().is_empty());
        bench.say(STEP, 1.0);
        bench.say(STEP, 1.0);
        assert_eq!(bench.heard(), [1]);
        bench.exchange();
        assert_eq!(bench.heard(), [1], "the sensor has not carried it out: perhaps it was not said");
        assert_eq!(
            bench.app.state.allowance.steps, 1,
            "the second step is still to be taken, the latest STEP is no third"
        );
        bench.scanned(1);
        assert_eq!(bench.heard(), [-1]);
        bench.exchange();
        assert_eq!(bench.heard(), [-1], "not answered: perhaps it was not said");
    }
}
