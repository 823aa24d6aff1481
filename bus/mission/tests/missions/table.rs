//! A small table of types, and missions against it.

use std::path::Path;

use elk_bus::{App, AppError};
use elk_mission::{AppSpec, AppType, Kind, Mission, Override, ParamSpec, Params, Registry};

pub fn unbuilt(_: &Params) -> Result<Box<dyn App>, AppError> {
    Err("the types of these tests are only parsed".into())
}

pub const fn param(name: &'static str, kind: Kind, default: Option<&'static str>, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind, default, doc }
}

pub const RES: ParamSpec =
    param("Res", Kind::Number { unit: "m", min: 0.001, max: 10.0 }, Some("0.1"), "Edge of a voxel.");
pub const INPUT: ParamSpec = param("Input", Kind::Variable, Some("SCAN"), "Scans to read.");
pub const OUTPUT: ParamSpec = param("Output", Kind::Variable, Some("SCAN_1"), "Scans to publish.");
pub const MID: ParamSpec = param("Mid", Kind::Point { unit: "m" }, None, "Centre of the volume.");
pub const DIM: ParamSpec = param("Dim", Kind::Point { unit: "m" }, None, "Size of the volume.");
pub const POLICY: ParamSpec = param("Policy", Kind::Choice(&["elk", "thesis"]), Some("elk"), "How to move.");

pub const SENSOR: &[AppType] = &[AppType {
    element: "Sensor",
    name: "Simulator",
    summary: "A depth camera in a world of triangles.",
    params: &[
        param("MOOSPoseVarName", Kind::Variable, Some("SIM_SENSOR"), "Variable of its pose."),
        param("PoseEstimator", Kind::Choice(&["none"]), Some("none"), "Accepted."),
        param("World", Kind::File { builtin: &["car-interior"], at_once: true }, Some("car-interior"), "World."),
    ],
    build: unbuilt,
    preflight: None,
}];

pub const THRESHOLD: Kind = Kind::Number { unit: "m", min: 0.0, max: f64::INFINITY };

pub const STAGES: &[AppType] = &[
    AppType {
        element: "Filter",
        name: "Distance",
        summary: "Drops points beyond a distance.",
        params: &[param("Threshold", THRESHOLD, Some("10"), "Distance."), INPUT, OUTPUT],
        build: unbuilt,
        preflight: None,
    },
    AppType {
        element: "Map",
        name: "OctoMap",
        summary: "Log-odds voxels.",
        params: &[RES, INPUT],
        build: unbuilt,
        preflight: None,
    },
    AppType {
        element: "Explorer",
        name: "Potential",
        summary: "Follows a harmonic potential.",
        params: &[MID, DIM, RES, POLICY],
        build: unbuilt,
        preflight: None,
    },
    AppType {
        element: "Explorer",
        name: "ClosestFrontier",
        summary: "Goes to the closest frontier.",
        params: &[MID, DIM, RES, POLICY],
        build: unbuilt,
        preflight: None,
    },
    AppType {
        element: "Explorer",
        name: "Simple",
        summary: "Goes somewhere.",
        params: &[MID, DIM, RES],
        build: unbuilt,
        preflight: None,
    },
    AppType {
        element: "Controller",
        name: "MOOSSim",
        summary: "Commands poses.",
        params: &[param("MOOSPoseVarName", Kind::Variable, Some("SIM_SENSOR"), "The sensor's pose.")],
        build: unbuilt,
        preflight: None,
    },
    AppType {
        element: "Logger",
        name: "Mcap",
        summary: "Records everything.",
        params: &[],
        build: unbuilt,
        preflight: None,
    },
];

pub const LISTING_2: &str = include_str!("../../../../mission-files/thesis-listing-2.xml");

pub fn registry() -> Registry {
    Registry::new(&[SENSOR, STAGES])
}

pub fn parse(text: &str, sets: &[&str]) -> Result<Mission, String> {
    let overrides: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    Mission::parse(text, Path::new("m.xml"), &registry(), &overrides).map_err(|e| e.to_string())
}

/// A mission whose lines 2 to 6 are right, with `line` as line 7.
pub fn with(line: &str) -> String {
    format!(
        "<Scenario name=\"t\" type=\"auto\">\n<Sensor type=\"Simulator\"/>\n<Map type=\"OctoMap\"/>\n\
         <Explorer type=\"Potential\"><Mid>0;0;0</Mid><Dim>1;1;1</Dim></Explorer>\n\
         <Controller type=\"MOOSSim\"/>\n<!-- here: -->\n{line}\n</Scenario>"
    )
}

pub fn wrong(line: &str) -> String {
    parse(&with(line), &[]).unwrap_err()
}

pub fn settings(mission: &Mission, app: &str) -> String {
    let app = mission.apps.iter().find(|one| one.name == app).unwrap();
    let texts = app.settings.iter().map(|(name, text)| format!("{name}={text}"));
    texts.collect::<Vec<_>>().join(" ")
}

pub fn app(mission: &Mission, name: &str) -> AppSpec {
    mission.apps.iter().find(|app| app.name == name).unwrap().clone()
}
