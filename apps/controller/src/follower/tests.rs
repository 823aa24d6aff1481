use super::*;
use crate::allowance::Allowance;
use crate::drive::{Axis, Limits, Noise};
use elk_spatial::messages::MotionPolicy;
use nalgebra::{Isometry3, Vector3};

/// A map, a camera that goes where it is told, and the follower between them.
struct Bench {
    map: OccupancyGrid,
    follower: Follower,
    commands: Vec<PoseCommand>,
    /// The last scan in the map.
    scan: u64,
    /// Whether a successor takes over before each message.
    restless: bool,
}

impl Bench {
    /// A free corridor of 40 × 5 × 5 voxels of 0.1 m, the camera at its beginning.
    fn new() -> (Self, PlanRequest) {
        Self::of(Follower::default())
    }

    /// The same with a robot that takes its time.
    fn driven(limits: Limits) -> (Self, PlanRequest) {
        let robot = Robot::new(&Pose(nalgebra::Isometry3::identity()), limits, Noise { sigma: 0.02, seed: 1 });
        Self::of(Follower::of(Some(robot)))
    }

    fn of(follower: Follower) -> (Self, PlanRequest) {
        let map = OccupancyGrid::new(0.1);
        let mut bench = Self { map, follower, commands: vec![], scan: 0, restless: false };
        let pose = Pose::looking(at(0.2), Vector3::x());
        let first = bench.follower.on_camera_pose(&CameraPose { command: 0, pose }).unwrap();
        assert_eq!(first, [Action::Command(PoseCommand { id: 1, via: vec![], pose })]);
        let cells = (0..40).flat_map(|x| (0..5).flat_map(move |y| (0..5).map(move |z| Voxel::new(x, y, z))));
        let actions = bench.scan(1, cells.map(|v| (v, State::Free)).collect());
        let request = request(&actions);
        assert_eq!((request.id, request.revision, request.outcome), (1, 1, Outcome::First));
        (bench, request)
    }

    /// Puts a successor in the follower's place, and tells it what the bus remembers. It says nothing but, perhaps, the
    /// other one's last words again.
    fn exchange(&mut self) -> Vec<Action> {
        let robot = self.follower.robot().copied();
        self.follower = Follower::successor(&self.follower.memory(&Allowance::default()), robot).unwrap();
        assert!(self.follower.on_map(&MapUpdate::new(self.map.whole(), self.scan)).unwrap().is_empty());
        self.follower.resume()
    }

    /// Scan `id` came and changed `cells`.
    fn scan(&mut self, id: u64, cells: Vec<(Voxel, State)>) -> Vec<Action> {
        if self.restless {
            self.exchange();
        }
        self.scan = id;
        let changed: Vec<Voxel> = cells.iter().map(|c| c.0).collect();
        for (voxel, state) in cells {
            self.map.set(voxel, state);
        }
        let update = MapUpdate::new(self.map.advance(&changed), id);
        self.follower.on_map(&update).unwrap()
    }

    /// Answers the request with a path; then each command with a scan that changes nothing, until the next request.
    fn follow(&mut self, plan: &Plan) -> PlanRequest {
        if self.restless {
            self.exchange();
        }
        let mut actions = self.follower.on_plan(plan).unwrap();
        loop {
            match actions.last() {
                Some(Action::Command(command)) => {
                    self.commands.push(command.clone());
                    let id = command.id;
                    actions = self.scan(id, vec![]);
                }
                _ => return request(&actions),
            }
        }
    }
}

fn at(x: f64) -> Point3<f64> {
    Point3::new(x, 0.25, 0.25)
}

fn request(actions: &[Action]) -> PlanRequest {
    match actions.last() {
        Some(Action::Request(request)) => request.clone(),
        other => panic!("{other:?}"),
    }
}

/// Straight on to x = 3.2 and to the side there; the frontier is the corridor's end.
fn plan(request: &PlanRequest, early_stop: bool) -> Plan {
    let end = Point3::new(3.2, 0.35, 0.25);
    let look = |direction| Pose::looking(end, direction);
    Plan {
        request: request.id,
        revision: request.revision,
        decision: Decision::Go(Path {
            points: vec![at(0.2), at(3.2), end],
            target: Voxel::new(39, 2, 2),
            unknown: vec![Voxel::new(40, 2, 2)],
            looks: vec![look(Vector3::x()), look(Vector3::y())],
            again: false,
        }),
        motion: MotionPolicy {
            name: "test".into(),
            scan_spacing_m: 0.4,
            early_stop,
            look_at_target: true,
            clearance_m: 0.1,
            level: false,
        },
        cpu_secs: 0.0,
    }
}

#[test]
fn it_scans_every_spacing_passes_every_bend_and_takes_every_look() {
    let (mut bench, first) = Bench::new();
    let asked = bench.follow(&plan(&first, true));
    assert_eq!((asked.outcome, asked.id), (Outcome::Unresolved, 2));
    // 3.1 m in steps of 0.4 m, the last one 0.3 m around the bend, and one more look.
    let ids: Vec<u64> = bench.commands.iter().map(|c| c.id).collect();
    assert_eq!(ids, (2..=10).collect::<Vec<_>>());
    for (k, command) in bench.commands[..7].iter().enumerate() {
        assert!((command.pose.position() - at(0.6 + 0.4 * k as f64)).norm() < 1e-9);
        assert!(command.via.is_empty());
        assert!(command.pose.forward().x > 0.99, "towards the target");
    }
    assert_eq!(bench.commands[7].via, [at(3.2)]);
    assert!(bench.commands[8].pose.forward().y > 0.99, "the second look");
    assert_eq!(asked.pose, bench.commands[8].pose);
}

/// A fan that is tilted on its way would see another plane.
#[test]
fn a_sensor_that_is_held_level_is_so_on_the_way() {
    let steepest = |level: bool| {
        let (mut bench, first) = Bench::new();
        let mut plan = plan(&first, true);
        let Decision::Go(path) = &mut plan.decision else { unreachable!() };
        (path.target, plan.motion.level) = (Voxel::new(39, 2, 3), level);
        bench.follow(&plan);
        bench.commands.iter().map(|command| command.pose.forward().z).fold(0.0, f64::max)
    };
    assert!(steepest(true) < 1e-12);
    assert!(steepest(false) > 0.01);
}

#[test]
fn a_resolved_target_ends_the_path_if_the_policy_says_so() {
    for early_stop in [true, false] {
        let (mut bench, first) = Bench::new();
        let actions = bench.follower.on_plan(&plan(&first, early_stop)).unwrap();
        assert!(matches!(actions[..], [Action::Command(_)]));
        let actions = bench.scan(2, vec![(Voxel::new(40, 2, 2), State::Occupied)]);
        match early_stop {
            true => assert_eq!(request(&actions).outcome, Outcome::Resolved),
            false => assert!(matches!(actions[..], [Action::Progress(_), Action::Command(_)])),
        }
    }
}

/// What is looked at again is known from the beginning: the robot goes there, and takes all looks.
#[test]
fn what_is_looked_at_again_is_not_resolved_by_being_known() {
    for again in [false, true] {
        let (mut bench, first) = Bench::new();
        let mut plan = plan(&first, true);
        let Decision::Go(path) = &mut plan.decision else { unreachable!() };
        (path.unknown, path.again) = (vec![Voxel::new(1, 2, 2)], again);
        let asked = bench.follow(&plan);
        match again {
            true => assert_eq!((asked.outcome, bench.commands.len()), (Outcome::Unresolved, 9)),
            false => assert_eq!((asked.outcome, bench.commands.len()), (Outcome::Resolved, 0)),
        }
    }
}

#[test]
fn a_new_obstacle_near_the_rest_of_the_path_cuts_it() {
    let (mut bench, first) = Bench::new();
    bench.follower.on_plan(&plan(&first, true)).unwrap();
    let behind = bench.scan(2, vec![(Voxel::new(1, 0, 0), State::Occupied)]);
    assert!(matches!(behind.last(), Some(Action::Command(_))), "behind the robot it does not matter");
    let beside = bench.scan(3, vec![(Voxel::new(20, 1, 3), State::Occupied)]);
    assert_eq!(request(&beside).outcome, Outcome::Cut);
}

#[test]
fn a_refused_command_is_said_to_be_one_and_is_no_way() {
    let (mut bench, first) = Bench::new();
    let actions = bench.follower.on_plan(&plan(&first, true)).unwrap();
    let Some(Action::Command(command)) = actions.last() else { panic!() };
    let stayed = first.pose;
    bench.follower.on_camera_pose(&CameraPose { command: command.id, pose: stayed }).unwrap();
    let actions = bench.scan(2, vec![]);
    let [Action::Progress(progress), Action::Request(asked)] = &actions[..] else { panic!("{actions:?}") };
    assert_eq!((asked.outcome, asked.pose, progress.path_length_m), (Outcome::Refused, stayed, 0.0));
}

/// A robot that goes by an estimate of its pose comes near: the path goes on, and the next plan begins where it is.
/// Regression: a program that planned through a wall that it knew of, or that the sensor had refused it, was asked for another plan for ever.
#[test]
fn a_plan_through_a_known_wall_or_to_where_it_was_just_refused_is_rejected() {
    let (mut bench, request) = Bench::new();
    let wall = Voxel::new(12, 2, 2);
    bench.map.set(wall, State::Occupied);
    let update = MapUpdate::new(bench.map.advance(&[wall]), 1);
    bench.follower.on_map(&update).unwrap();
    let through = plan(&PlanRequest { revision: 2, ..request.clone() }, true);
    let said = bench.follower.on_plan(&through).unwrap_err().to_string();
    let wanted = "path.points is from (0.20; 0.25; 0.25) to (3.20; 0.25; 0.25) through a wall at (1.25; 0.25; 0.25); it has to be through \
                  nothing that the map calls occupied";
    assert_eq!(said, wanted);
    // Of a map in which the wall was not known it is none: the path is cut.
    let cut = request_of(bench.follower.on_plan(&plan(&request, true)));
    assert_eq!(cut.outcome, Outcome::Cut);

    let (mut bench, request) = Bench::new();
    let stayed = Pose::looking(at(0.2), Vector3::x());
    assert!(matches!(bench.follower.on_plan(&plan(&request, true)).as_deref(), Ok([Action::Command(_)])));
    bench.follower.on_camera_pose(&CameraPose { command: 2, pose: stayed }).unwrap();
    let refused = self::request(&bench.scan(2, vec![]));
    let said = bench.follower.on_plan(&plan(&refused, true)).unwrap_err().to_string();
    assert!(said.contains("again, where the sensor has just refused to go; it has to be another way"), "{said}");
    let mut aside = plan(&refused, true);
    let Decision::Go(path) = &mut aside.decision else { panic!() };
    path.points = vec![at(0.2), Point3::new(0.2, 0.45, 0.25)];
    assert!(matches!(bench.follower.on_plan(&aside).as_deref(), Ok([Action::Command(_)])), "another way is one");
}

fn request_of(actions: Result<Vec<Action>, Unfit>) -> PlanRequest {
    request(&actions.unwrap())
}

#[test]
fn a_robot_that_comes_near_to_where_it_was_sent_has_arrived() {
    let (mut bench, first) = Bench::new();
    let actions = bench.follower.on_plan(&plan(&first, true)).unwrap();
    let Some(Action::Command(command)) = actions.last() else { panic!() };
    let aside = |metres: f64| Pose(Isometry3::translation(0.0, metres, 0.0) * command.pose.0);
    bench.follower.on_camera_pose(&CameraPose { command: command.id, pose: aside(0.01) }).unwrap();
    let actions = bench.scan(2, vec![]);
    let Some(Action::Command(next)) = actions.last() else { panic!("{actions:?}") };
    let far = Pose(Isometry3::translation(0.0, 0.03, 0.0) * next.pose.0);
    bench.follower.on_camera_pose(&CameraPose { command: next.id, pose: far }).unwrap();
    let actions = bench.scan(3, vec![]);
    assert_eq!((request(&actions).outcome, request(&actions).pose), (Outcome::Cut, far));
}

/// Regression: the map knew better than before what the robot stood in, and each path out of it was cut before its first step.
#[test]
fn the_robot_may_leave_the_voxel_that_it_is_in() {
    let (mut bench, first) = Bench::new();
    let robot = Voxel::containing(first.pose.position(), 0.1);
    bench.scan(2, vec![(robot, State::Occupied)]);
    let plan = Plan { revision: 2, ..plan(&first, true) };
    bench.follower.on_plan(&plan).unwrap();
    let there = bench.scan(3, vec![(robot + Voxel::new(0, 0, 1), State::Occupied)]);
    assert!(matches!(there.last(), Some(Action::Command(_))), "{there:?}");
}

#[test]
fn a_lost_update_is_asked_for_and_the_run_goes_on() {
    let (mut bench, first) = Bench::new();
    bench.follower.on_plan(&plan(&first, true)).unwrap();
    bench.map.advance(&[]);
    assert!(bench.scan(2, vec![]).is_empty() && bench.follower.take_question());
    let whole = MapUpdate::new(bench.map.whole(), 2);
    let actions = bench.follower.on_map(&whole).unwrap();
    assert!(matches!(actions[..], [Action::Progress(_), Action::Command(_)]));
}

#[test]
fn when_nothing_is_left_it_reports_and_falls_silent() {
    let (mut bench, first) = Bench::new();
    let asked = bench.follow(&plan(&first, true));
    let done = Plan { request: asked.id, decision: Decision::Done, ..plan(&asked, true) };
    assert!(bench.follower.on_plan(&plan(&first, true)).unwrap().is_empty(), "an answer to an old request");
    let actions = bench.follower.on_plan(&done).unwrap();
    let [Action::Progress(progress), Action::Finished(report)] = &actions[..] else { panic!("{actions:?}") };
    assert!(progress.finished && bench.follower.finished());
    assert_eq!((report.scans, report.free), (10, 1000));
    assert!((report.path_length_m - 3.1).abs() < 1e-9);
    assert!(bench.scan(11, vec![]).is_empty() && bench.follower.on_plan(&done).unwrap().is_empty());
}

#[test]
fn a_successor_at_every_step_goes_the_same_way() {
    let run = |restless| {
        let (mut bench, first) = Bench::new();
        bench.restless = restless;
        let asked = bench.follow(&plan(&first, true));
        let over = bench
            .follower
            .on_plan(&Plan { request: asked.id, decision: Decision::Done, ..plan(&asked, true) })
            .unwrap();
        (bench.commands, asked, over)
    };
    assert_eq!(run(true), run(false));
}

fn limits(lateral: f64) -> Limits {
    let axis = |speed: f64| Axis { speed, acceleration: 0.5 };
    Limits {
        forward: axis(0.5),
        lateral: axis(lateral),
        vertical: axis(0.3),
        yaw: Axis { speed: 1.5, acceleration: 3.0 },
    }
}

#[test]
fn a_robot_that_takes_its_time_scans_as_often_and_a_successor_at_every_step_drives_the_same_way() {
    for lateral in [0.5, 0.0] {
        let run = |restless| {
            let (mut bench, first) = Bench::driven(limits(lateral));
            bench.restless = restless;
            let asked = bench.follow(&plan(&first, true));
            (bench.commands, asked, bench.follower.travel().unwrap(), bench.follower.path_length_m)
        };
        let (commands, asked, travel, length_m) = run(false);
        assert_eq!(run(true), (commands.clone(), asked.clone(), travel.clone(), length_m));
        assert_eq!((asked.outcome, commands.len(), travel.stops), (Outcome::Unresolved, 9, 0));
        let end = Point3::new(3.2, 0.35, 0.25);
        assert!(commands[7..].iter().all(|c| (c.pose.position() - end).norm() < 0.006), "{commands:?}");
        assert!(commands[8].pose.forward().y > 0.999 && commands[0].via.len() > 5, "{commands:?}");
        assert!((length_m - 3.1).abs() < 0.1 && travel.secs > 3.1 / 0.5, "{length_m} {travel:?}");
        for pair in commands[..7].windows(2) {
            let gone = (pair[1].pose.position() - pair[0].pose.position()).norm();
            // It goes 2.5 cm between two looks at where it is.
            assert!((0.4 - 1e-9..0.43).contains(&gone), "{gone}");
        }
    }
}

/// A way that shuts before a robot that moves: it comes to stand, says that its way is cut, and is asked anew from there.
#[test]
fn a_robot_under_way_is_planned_for_from_where_it_is_and_a_refused_one_stands() {
    let (mut bench, first) = Bench::driven(limits(0.5));
    bench.follower.on_plan(&plan(&first, true)).unwrap();
    let cut = request(&bench.scan(2, vec![(Voxel::new(20, 1, 3), State::Occupied)]));
    assert!(cut.outcome == Outcome::Cut && bench.follower.robot().unwrap().moves());
    // Back to where it came from: it brakes on the way that was free.
    let mut back = plan(&cut, true);
    let Decision::Go(path) = &mut back.decision else { panic!() };
    (path.points, path.looks) = (vec![cut.pose.position(), at(0.2)], vec![first.pose]);
    let said = bench.follower.on_plan(&back).unwrap();
    let Some(Action::Command(command)) = said.last() else { panic!("{said:?}") };
    let farthest = command.via.iter().map(|p| p.x).fold(0.0, f64::max);
    assert!(farthest > cut.pose.position().x + 0.1 && farthest < 1.3, "{farthest}");
    // The sensor does not let it.
    let before = bench.follower.path_length_m;
    bench.follower.on_camera_pose(&CameraPose { command: command.id, pose: cut.pose }).unwrap();
    assert!(bench.follower.path_length_m < before - 0.2);
    let refused = request(&bench.scan(3, vec![]));
    assert_eq!((refused.outcome, refused.pose), (Outcome::Refused, cut.pose));
    assert!(!bench.follower.robot().unwrap().moves());
}

#[test]
fn a_successor_says_again_what_was_perhaps_not_said() {
    let (mut bench, first) = Bench::new();
    assert_eq!(bench.exchange(), [Action::Request(first.clone())]);
    assert!(bench.follower.resume().is_empty(), "once");
    let said = bench.follower.on_plan(&plan(&first, true)).unwrap();
    assert_eq!(bench.exchange(), said);
    let Some(Action::Command(command)) = said.last() else { panic!("{said:?}") };
    bench.follower = Follower::successor(&bench.follower.memory(&Allowance::default()), None).unwrap();
    bench.follower.on_camera_pose(&CameraPose { command: command.id, pose: command.pose }).unwrap();
    assert!(bench.follower.resume().is_empty(), "the sensor has carried it out");
    let actions = bench.scan(2, vec![(Voxel::new(20, 1, 3), State::Occupied)]);
    assert!(actions.is_empty() && bench.follower.take_question(), "the map is not here yet");
    let asked = request(&bench.follower.on_map(&MapUpdate::new(bench.map.whole(), 2)).unwrap());
    assert_eq!(asked.outcome, Outcome::Cut);
    let over =
        bench.follower.on_plan(&Plan { request: asked.id, decision: Decision::Done, ..plan(&asked, true) }).unwrap();
    assert_eq!(bench.exchange(), over);
}

#[test]
fn a_plan_waits_for_the_map_that_it_was_made_from() {
    let (mut bench, first) = Bench::new();
    bench.follower = Follower::successor(&bench.follower.memory(&Allowance::default()), None).unwrap();
    assert!(bench.follower.on_plan(&plan(&first, true)).unwrap().is_empty());
    let actions = bench.follower.on_map(&MapUpdate::new(bench.map.whole(), 1)).unwrap();
    assert!(matches!(actions[..], [Action::Command(_)]), "{actions:?}");
}

/// Regression: a clearance of 100 m took 4 GB, one of 1,000 m never ended, nor did a point at 10⁹ m.
#[test]
fn a_plan_of_another_map_is_refused_and_the_right_one_still_taken() {
    let (mut bench, first) = Bench::new();
    let right = plan(&first, true);
    let with = |change: &dyn Fn(&mut Plan, &mut Path)| {
        let mut plan = right.clone();
        let Decision::Go(mut path) = plan.decision.clone() else { panic!() };
        change(&mut plan, &mut path);
        plan.decision = Decision::Go(path);
        plan
    };
    let wrong = [
        with(&|plan, _| plan.motion.clearance_m = 3.5),
        with(&|plan, _| plan.motion.clearance_m = 1000.0),
        with(&|_, path| path.points.push(at(300.0))),
        with(&|_, path| path.points.push(at(1e9))),
        with(&|_, path| path.points = (0..5000).map(|i| at(f64::from(i % 2) * 3.0)).collect()),
        with(&|plan, _| plan.revision = 1 << 47),
    ];
    for plan in wrong {
        let refused = bench.follower.on_plan(&plan);
        assert!(matches!(refused, Err(Unfit::Path(_) | Unfit::Revision(..))), "{refused:?}");
    }
    assert_eq!(bench.follower.on_plan(&right).unwrap().len(), 1);
}

#[test]
fn a_map_that_is_ahead_of_all_scans_is_refused() {
    let (mut bench, first) = Bench::new();
    let far = MapUpdate { revision: 1_000_000, ..MapUpdate::new(bench.map.whole(), 1) };
    assert!(bench.follower.on_map(&far).is_err());
    assert_eq!(bench.follow(&plan(&first, true)).outcome, Outcome::Unresolved);
}

/// Whoever knows no map yet holds the first word of one against its own commands.
#[test]
fn a_first_map_that_is_ahead_of_all_scans_is_refused() {
    let ((bench, _), mut fresh) = (Bench::new(), Follower::default());
    let refused = Err(Unfit::Map(UpdateError::Ahead { have: 0, update: 1_000_000 }));
    let whole = MapUpdate::new(bench.map.whole(), 1);
    assert_eq!(fresh.on_map(&MapUpdate { revision: 1_000_000, ..whole.clone() }), refused);
    assert_eq!(fresh.on_map_part(&MapPart { revision: 1_000_000, ..MapPart::of(&bench.map, 1, 0, 8) }), refused);
    assert_eq!(fresh.on_map(&whole), Ok(vec![]));
}

#[test]
fn a_sensor_that_did_what_nobody_commanded_is_not_believed() {
    let (mut bench, first) = Bench::new();
    let camera = |command| CameraPose { command, pose: Pose::looking(at(0.2), Vector3::x()) };
    assert_eq!(bench.follower.on_camera_pose(&camera(18)), Err(Unfit::Command(18, 1)));
    let asked = bench.follow(&plan(&first, true));
    assert_eq!(asked.outcome, Outcome::Unresolved);
    // What stands in the way is said again and again: the way is taken back once.
    let command = bench.commands.last().unwrap().id;
    let length = bench.follower.memory(&Allowance::default()).path_length_m;
    (0..9).for_each(|_| drop(bench.follower.on_camera_pose(&camera(command)).unwrap()));
    assert!(bench.follower.memory(&Allowance::default()).path_length_m >= length - 0.4 - 1e-9);
}

/// Regression: the plan for a place where the robot was not was followed, and refused by the sensor.
#[test]
fn a_request_from_a_wrong_place_is_made_anew_from_the_right_one() {
    let (mut bench, first) = Bench::new();
    let mut actions = vec![];
    for (id, pose) in [(2, Pose::looking(at(0.9), Vector3::y())), (3, first.pose)] {
        actions = bench.follower.on_camera_pose(&CameraPose { command: 1, pose }).unwrap();
        assert_eq!(actions, [Action::Request(PlanRequest { id, pose, ..first.clone() })]);
    }
    assert!(bench.follower.on_plan(&plan(&first, true)).unwrap().is_empty(), "it is not the last request's");
    assert_eq!(bench.follow(&plan(&request(&actions), true)).outcome, Outcome::Unresolved);
    // A successor says what its predecessor would have said, once.
    let (mut bench, first) = Bench::new();
    bench.follower = Follower::successor(&bench.follower.memory(&Allowance::default()), None).unwrap();
    let pose = Pose::looking(at(0.9), Vector3::y());
    assert!(bench.follower.on_camera_pose(&CameraPose { command: 1, pose }).unwrap().is_empty());
    assert_eq!(bench.follower.resume(), [Action::Request(PlanRequest { id: 2, pose, ..first })]);
}

/// Regression: it refused the sensor's word for ever, and the sensor its commands.
#[test]
fn after_somebody_elses_commands_it_goes_on_from_where_the_sensor_is() {
    let elsewhere = Pose::looking(at(0.9), Vector3::y());
    let (mut bench, first) = Bench::new();
    bench.follower.on_plan(&plan(&first, true)).unwrap();
    let foreign = CameraPose { command: 4, pose: elsewhere };
    assert!(bench.follower.on_camera_pose(&foreign).unwrap().is_empty());
    assert!(bench.scan(2, vec![]).is_empty() && bench.scan(3, vec![]).is_empty());
    let asked = request(&bench.scan(4, vec![]));
    assert_eq!((asked.outcome, asked.pose), (Outcome::Cut, elsewhere));
    let next = bench.follower.on_plan(&plan(&asked, true)).unwrap();
    assert!(matches!(&next[..], [Action::Command(command)] if command.id == 5), "{next:?}");
    // While it waits for a plan it asks for another one at once.
    let (mut bench, _) = Bench::new();
    let asked = request(&bench.follower.on_camera_pose(&CameraPose { command: 2, pose: elsewhere }).unwrap());
    assert_eq!((asked.id, asked.pose, bench.follower.commands()), (2, elsewhere, 2));
}

/// Whatever somebody made up, before or after the command is carried out and its scan is in the map.
#[test]
fn a_count_that_was_made_up_is_taken_back_when_the_sensor_says_the_true_one() {
    let elsewhere = Pose::looking(at(0.9), Vector3::y());
    for made_up in [1, 2, 3, 18] {
        for (carried_out, scanned) in [(false, false), (true, false), (true, true)] {
            let (mut bench, first) = Bench::new();
            let actions = bench.follower.on_plan(&plan(&first, true)).unwrap();
            let [Action::Command(command)] = &actions[..] else { panic!("{actions:?}") };
            let done = CameraPose { command: 2, pose: command.pose };
            let truth = if carried_out { done.clone() } else { CameraPose { command: 1, pose: first.pose } };
            let mut said = bench.follower.on_camera_pose(&CameraPose { command: made_up, pose: elsewhere }).unwrap();
            if scanned {
                said.extend(bench.scan(2, vec![]));
            }
            said.extend(bench.follower.on_camera_pose(&truth).unwrap());
            if !scanned {
                said.extend(bench.follower.on_camera_pose(&done).unwrap());
                said.extend(bench.scan(2, vec![]));
            }
            let why = format!("{made_up} {carried_out} {scanned}: {said:?}");
            assert_eq!(bench.follower.commands(), if said.iter().any(is_third) { 3 } else { 2 }, "{why}");
            assert!(said.iter().any(is_third) || request(&said).pose == done.pose, "{why}");
        }
    }
}

fn is_third(action: &Action) -> bool {
    matches!(action, Action::Command(command) if command.id == 3)
}

/// A memory that the sensor contradicts by far is of another run, or made up.
#[test]
fn the_sensor_has_the_last_word_on_how_many_commands_there_were() {
    let (bench, _) = Bench::new();
    let mut memory = bench.follower.memory(&Allowance::default());
    let pose = memory.pose;
    memory.commands = 1 << 47;
    memory.awaited = Awaited::Map(PoseCommand { id: memory.commands, via: vec![], pose });
    let mut successor = Follower::successor(&memory, None).unwrap();
    let actions = successor.on_camera_pose(&CameraPose { command: 7, pose }).unwrap();
    assert_eq!(actions, [Action::Command(PoseCommand { id: 8, via: vec![], pose })]);
    assert!(successor.resume().is_empty());
    // One command that was lost with its predecessor is no contradiction.
    memory.commands = 6;
    memory.awaited = Awaited::Map(PoseCommand { id: 6, via: vec![], pose });
    let mut successor = Follower::successor(&memory, None).unwrap();
    assert!(successor.on_camera_pose(&CameraPose { command: 7, pose }).unwrap().is_empty());
    assert_eq!(successor.commands(), 7);
}

/// Regression: a path that nothing of is allowed made a memory that no successor believed.
#[test]
fn no_more_is_allowed_than_a_successor_is_told() {
    let (bench, first) = Bench::new();
    let mut plan = plan(&first, true);
    let row = |y: i32| {
        let ends = if y % 2 == 0 { [0, 399] } else { [399, 0] };
        ends.map(|x| Voxel::new(x, y, 9).center(0.1))
    };
    let Decision::Go(mut path) = plan.decision.clone() else { panic!() };
    path.points = (0..400).flat_map(row).collect();
    plan.decision = Decision::Go(path.clone());
    let way = Polyline::new(path.points.iter().copied()).unwrap();
    let underway = Underway::new(&plan, &path, way, &bench.map).unwrap();
    assert!((100_000..=MAX_REMEMBERED).contains(&underway.leg.allowed.len()));
}
