//! Launches of small missions in one process: apps that do just enough of a step to be observed.

use std::path::{Path, PathBuf};

use elk_bus::{App, AppError, Comms, Community, Mail};
use elk_geometry::Pose;
use elk_launcher::{FinishedRun, LaunchError, LaunchOptions, launch};
use elk_mission::{AppType, Kind, Mission, ParamSpec, Params, Registry};
use elk_spatial::CameraInfo;
use elk_spatial::keys::{
    ACCURACY_REPORT, EXPLORATION_REPORT, MAP_KNOWN, MAP_REQUEST, MOTION_REPORT, POSE_COMMAND, PROGRESS, SENSOR_REPORT,
};
use elk_spatial::messages::{
    AccuracyReport, CoverageMark, ExplorationReport, FrontiersLeft, MapStatus, MotionReport, PoseCommand, Progress,
    SensorReport,
};
use elk_spatial::rays::RayTally;
use nalgebra::Point3;

/// Answers pose commands, and evaluates maps; touches the world as often as it is told.
struct Sensor {
    contacts: u64,
}

impl App for Sensor {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        comms.register(&POSE_COMMAND)?;
        Ok(comms.register("EVALUATE")?)
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        if mail.is(&POSE_COMMAND) {
            let scan = mail.decode(&POSE_COMMAND)?.id;
            let contacts = Some(self.contacts);
            comms.publish(&SENSOR_REPORT, &SensorReport { scans: scan, contacts, scan, cpu_secs: 0.5 })?;
            comms.notify("SCAN", scan as f64)?;
        } else {
            comms.publish(&ACCURACY_REPORT, &AccuracyReport { revision: 2, accuracy: 0.75, voxels: 4 })?;
        }
        Ok(())
    }
}

/// Says how much is known, and fails at a scan if it is told so.
struct Map {
    fails_at: i64,
}

impl App for Map {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        comms.register("SCAN")?;
        Ok(comms.register(MAP_REQUEST)?)
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        if mail.key() == MAP_REQUEST {
            return Ok(comms.notify("EVALUATE", 1.0)?);
        }
        let elk_bus::ValueRef::Double(scan) = mail.value() else { return Err("no scan".into()) };
        if scan as i64 == self.fails_at {
            return Err("no room".into());
        }
        let revision = scan as u64;
        let rays = RayTally { measured: 4, received: 4, ..RayTally::default() };
        let status = MapStatus {
            revision,
            free: 3,
            occupied: 1,
            frontier: 0,
            resolution: 0.1,
            cpu_secs: 0.25,
            full: false,
            rays,
            camera: CameraInfo::default(),
        };
        comms.publish(&MAP_KNOWN, &status)?;
        Ok(comms.notify("MAPPED", scan)?)
    }
}

/// Commands two poses, then ends.
struct Controller;

impl Controller {
    fn command(comms: &mut Comms, id: u64) -> Result<(), AppError> {
        let pose = Pose::from_yaw_pitch(Point3::origin(), 0.0, 0.0);
        Ok(comms.publish(&POSE_COMMAND, &PoseCommand { id, via: Vec::new(), pose })?)
    }
}

impl App for Controller {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        comms.register("MAPPED")?;
        comms.register("EXPLORE")?;
        Ok(())
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        let elk_bus::ValueRef::Double(scan) = mail.value() else { return Err("no number".into()) };
        let scans = scan as u64;
        if scans < 2 {
            return Self::command(comms, scans + 1);
        }
        let progress = Progress { scan: 2, revision: 2, scans: 2, path_length_m: 1.5, free: 3, finished: true };
        comms.publish(&PROGRESS, &progress)?;
        let marks = vec![CoverageMark { share: 1.0, scans: 2, path_length_m: 1.5 }];
        comms.publish(&MOTION_REPORT, &MotionReport { scans: 2, path_length_m: 1.5, free: 3, marks })?;
        Ok(comms.notify("OVER", 1.0)?)
    }
}

/// Begins, and says at the end what it is told to say.
struct Explorer {
    complete: bool,
}

impl App for Explorer {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        comms.register("OVER")?;
        Ok(comms.notify("EXPLORE", 0.0)?)
    }

    fn on_new_mail(&mut self, comms: &mut Comms, _: &Mail<'_>) -> Result<(), AppError> {
        let report = ExplorationReport {
            explorer: "Test".into(),
            policy: "elk".into(),
            settings: "as always".into(),
            complete: self.complete,
            reason: "nothing is left".into(),
            frontiers_left: FrontiersLeft { invisible: 2, ..FrontiersLeft::default() },
            plans: 1,
            counters: Vec::new(),
            cpu_secs: vec![("field".into(), 0.125)],
        };
        Ok(comms.publish(&EXPLORATION_REPORT, &report)?)
    }
}

const fn number(name: &'static str, default: &'static str) -> ParamSpec {
    let kind = Kind::Integer { min: 0, max: 100 };
    ParamSpec { name, kind, default: Some(default), doc: "What a test wants." }
}

type Build = fn(&Params) -> Result<Box<dyn App>, AppError>;

const fn row(element: &'static str, params: &'static [ParamSpec], build: Build) -> AppType {
    AppType { element, name: "Test", summary: "Does just enough.", params, build, preflight: None }
}

static TYPES: &[AppType] = &[
    row("Sensor", &[number("Contacts", "0"), number("Seed", "7")], |params| {
        Ok(Box::new(Sensor { contacts: params.integer("Contacts") as u64 }))
    }),
    row("Map", &[number("FailsAt", "0")], |params| Ok(Box::new(Map { fails_at: params.integer("FailsAt") }))),
    row("Controller", &[], |_| Ok(Box::new(Controller))),
    row("Explorer", &[number("Complete", "1")], |params| {
        Ok(Box::new(Explorer { complete: params.integer("Complete") == 1 }))
    }),
];

const MISSION: &str = r#"<Scenario name="Tiny"><Sensor type="Test"/><Map type="Test"/><Controller type="Test"/><Explorer type="Test"/></Scenario>"#;

fn run(folder: &Path, sets: &[&str]) -> FinishedRun {
    let file = folder.join("tiny.xml");
    std::fs::write(&file, MISSION).unwrap();
    let sets: Vec<_> = sets.iter().map(|set| set.parse().unwrap()).collect();
    let mission = Mission::load(&file, &Registry::new(&[TYPES]), &sets).unwrap();
    let options = LaunchOptions {
        program: PathBuf::from("true"),
        revision: "none".to_owned(),
        community: Community::new("in-process").unwrap(),
        log_dir: folder.join("logs"),
        headless: true,
        auto: true,
        in_process: true,
        detached: false,
        background: false,
        registry: Registry::new(&[TYPES]),
    };
    launch(mission, &options).unwrap()
}

#[test]
fn a_mission_that_completes_is_summed_up() {
    let folder = tempfile::tempdir().unwrap();
    let finished = run(folder.path(), &[]);
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let written = std::fs::read_to_string(finished.folder.join("summary.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&written).unwrap();
    for (field, value) in [
        ("mission", "\"Tiny\""),
        ("explorer", "\"Test\""),
        ("policy", "\"elk\""),
        ("seed", "7"),
        ("complete", "true"),
        ("reason", "\"nothing is left\""),
        ("scans", "2"),
        ("path_length_m", "1.5"),
        ("known_voxels", "4"),
        ("free_voxels", "3"),
        ("occupied_voxels", "1"),
        ("accuracy", "0.75"),
        ("contacts", "0"),
        ("plans", "1"),
    ] {
        assert_eq!(json[field].to_string(), value, "{field}");
    }
    assert_eq!(json["frontiers_left"]["invisible"], 2);
    assert_eq!(json["coverage"][0]["scans"], 2);
    assert_eq!(json["cpu_seconds"]["field"], 0.125);
    assert_eq!(json["step"]["count"], 1);
    assert_eq!(json["step_by_app"]["Sensor"]["count"], 2);
    assert!(finished.folder.join("tiny.xml").is_file());
}

#[test]
fn a_contact_or_an_explorer_that_gave_up_is_no_completion() {
    let folder = tempfile::tempdir().unwrap();
    let touched = run(folder.path(), &["Sensor.Contacts=3"]).summary;
    assert!(!touched.complete);
    assert_eq!(touched.reason, "nothing is left, but the robot touched the true world 3 times");
    let gave_up = run(folder.path(), &["Explorer.Complete=0"]).summary;
    assert!(!gave_up.complete);
    assert_eq!(gave_up.reason, "nothing is left");
}

#[test]
fn an_app_that_fails_in_the_midst_of_it_fails_the_mission_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let finished = run(folder.path(), &["Map.FailsAt=2"]);
    let Some(LaunchError::ThreadEnded { app, how, .. }) = &finished.error else { panic!("{:?}", finished.error) };
    assert_eq!((app.as_str(), how.as_str()), ("Map", "Map: no room"));
    assert!(!finished.summary.complete);
    // The launcher may not have come to see everybody register.
    let reason = &finished.summary.reason;
    assert!(reason.starts_with("Map ended before ") && reason.ends_with(": Map: no room"), "{reason}");
    assert!(finished.folder.join("summary.json").is_file());
}
