//! Who writes what, who reads it, and what several apps have in common.

use std::path::Path;

use elk_mission::{AppType, Kind, Mission, Mode, Override, ParamSpec, Registry};

use crate::table::{LISTING_2, app, param, parse, registry, settings, unbuilt, with};

#[test]
fn filters_are_wired_in_a_row_unless_the_mission_says_otherwise() {
    let two = with("<Filter type=\"Distance\"/><Filter type=\"Distance\"/>");
    let mission = parse(&two, &[]).unwrap();
    assert_eq!(settings(&mission, "Filter"), "Threshold=10 Input=SCAN Output=SCAN_1");
    assert_eq!(settings(&mission, "Filter2"), "Threshold=10 Input=SCAN_1 Output=SCAN_2");
    assert_eq!(settings(&mission, "Map"), "Res=0.1 Input=SCAN_2");

    let mission = parse(&two, &["Filter.Output=NEAR", "Map.Input=SCAN"]).unwrap();
    assert_eq!(settings(&mission, "Filter2"), "Threshold=10 Input=NEAR Output=SCAN_2");
    assert_eq!(settings(&mission, "Map"), "Res=0.1 Input=SCAN");

    let mission = parse(&with(""), &[]).unwrap();
    assert_eq!(settings(&mission, "Map"), "Res=0.1 Input=SCAN");
}

#[test]
fn what_two_apps_have_in_common_need_be_said_of_one_only() {
    let listing = |from: &str, to: &str| LISTING_2.replace(from, to);
    // The listing says `Res` of both; without the explorer's it is the map's, and the other way round.
    let one = |without: &str| {
        let (before, rest) = LISTING_2.split_once(without).unwrap();
        let (_, after) = rest.split_once("</Res>").unwrap();
        format!("{before}{}{after}", without.split("<Res>").next().unwrap())
    };
    let mapped = parse(&one("<Dim> 5.7; 4.3; 4.5 </Dim>\n        <Res>"), &["Map.Res=0.05"]).unwrap();
    assert!(settings(&mapped, "Explorer").contains("Res=0.05"), "{}", settings(&mapped, "Explorer"));
    let explored = parse(&one("<Map type=\"OctoMap\">\n        <Res>"), &["Explorer.Res=0.05"]).unwrap();
    assert!(settings(&explored, "Map").contains("Res=0.05"), "{}", settings(&explored, "Map"));
    let posed = parse(&listing("SIM_SENSOR", "POSE"), &[]).unwrap();
    assert!(settings(&posed, "Controller").contains("MOOSPoseVarName=POSE"), "{}", settings(&posed, "Controller"));

    assert_eq!(
        parse(LISTING_2, &["Map.Res=0.05"]).unwrap_err(),
        "m.xml:19:15: Res: \"0.1\" is not the Map's \"0.05\"; right is the same for Map and Explorer"
    );
    parse(LISTING_2, &["Map.Res=0.05", "Explorer.Res=5e-2 m"]).unwrap();
}

/// A controller that can be told to wait.
static WAITING: &[AppType] = &[AppType {
    element: "Controller",
    name: "MOOSSim",
    summary: "Commands poses.",
    params: &[param("Manual", Kind::Flag, Some("false"), "Pause.")],
    build: unbuilt,
    preflight: None,
}];

/// A registry whose sensor says where its scans go, and whose controller waits.
fn wired(line: &str, sets: &[&str]) -> Result<Mission, String> {
    static TYPES: &[AppType] = &[AppType {
        element: "Sensor",
        name: "Simulator",
        summary: "A depth camera.",
        params: &[
            param("Output", Kind::Variable, Some("SCAN"), "Scans to publish."),
            param("MOOSPoseVarName", Kind::Variable, Some("SIM_SENSOR"), "Variable of its pose."),
        ],
        build: unbuilt,
        preflight: None,
    }];
    let rest: Registry = registry().types().filter(|one| !["Sensor", "Controller"].contains(&one.element)).collect();
    let registry: Registry = TYPES.iter().chain(WAITING).chain(rest.types()).collect();
    let overrides: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    Mission::parse(&with(line), Path::new("m.xml"), &registry, &overrides).map_err(|e| e.to_string())
}

#[test]
fn what_the_broker_writes_is_nobody_elses_to_write_or_to_read() {
    let broker = "is a variable that the broker writes itself, as all of DB_*; right is another name";
    let said = |set: &str| wired("", &[set]).unwrap_err();
    assert_eq!(
        said("Sensor.Output=DB_CLIENTS"),
        format!("--set Sensor.Output=DB_CLIENTS: Output: DB_CLIENTS {broker}")
    );
    assert_eq!(
        said("Sensor.MOOSPoseVarName=DB_X"),
        format!("--set Sensor.MOOSPoseVarName=DB_X: MOOSPoseVarName: DB_X {broker}")
    );
    assert_eq!(said("Map.Input=DB_TABLE"), format!("--set Map.Input=DB_TABLE: Input: DB_TABLE {broker}"));
    let line = "<Filter type=\"Distance\"><Output>DB_TIME</Output></Filter>";
    assert_eq!(wired(line, &[]).unwrap_err(), format!("m.xml:7:33: Output: DB_TIME {broker}"));
    assert!(said(&format!("Sensor.Output={}", "x".repeat(257))).contains("is no name of a variable"));
}

#[test]
fn one_variable_carries_one_thing_and_has_one_writer() {
    let said = |line: &str, sets: &[&str]| wired(line, sets).unwrap_err();
    let of_plan = "Output: PLAN carries Plan values in every mission; right is a name of its own";
    assert_eq!(said("", &["Sensor.Output=PLAN"]), format!("--set Sensor.Output=PLAN: {of_plan}"));
    // As in MOOS, the case of a parameter's name does not count.
    assert_eq!(said("", &["Sensor.output=PLAN"]), format!("--set Sensor.output=PLAN: {of_plan}"));
    for (set, carried) in [
        ("Sensor.Output=MAP_UPDATE", "MapUpdate values"),
        ("Sensor.Output=SIM_SENSOR", "CameraPose values"),
        ("Sensor.Output=EXPLORER_GOALS", "Candidates values"),
        ("Sensor.Output=EXPLORER_MEMORY_Potential", "what a strategy remembers"),
        ("Sensor.Output=LOGGER_ERROR", "what apps say to each other"),
        ("Sensor.Output=MOTION", "what apps say to each other"),
        ("Sensor.Output=MAP_STATUS", "what apps say to each other"),
        ("Sensor.MOOSPoseVarName=SCAN_7", "Scan values"),
        ("Sensor.MOOSPoseVarName=LAUNCH_STATE", "what apps say to each other"),
    ] {
        let name = set.split_once('=').unwrap().1;
        let found = said("", &[set]);
        assert!(found.contains(&format!("{name} carries {carried} in every mission")), "{set}: {found}");
    }
    let line = "<Filter type=\"Distance\" Output=\"SCAN\"/>";
    let twice = "m.xml:7:33: Output: SCAN is written by Sensor (Output) already; right is another name";
    assert_eq!(said(line, &[]), twice);
    let twice = said("<Filter type=\"Distance\"/><Filter type=\"Distance\" Output=\"SCAN_1\"/>", &[]);
    assert!(twice.contains("SCAN_1 is written by Filter (Output) already"), "{twice}");
    assert!(said("", &["Sensor.Output=POSE", "Sensor.MOOSPoseVarName=POSE"]).contains("POSE is written by Sensor"));
    let mission = wired("", &["Sensor.Output=DEPTH", "Sensor.MOOSPoseVarName=CAMERA"]).unwrap();
    assert_eq!(settings(&mission, "Map"), "Res=0.1 Input=DEPTH");
}

#[test]
fn what_is_read_somebody_publishes() {
    let said = |line: &str, sets: &[&str]| wired(line, sets).unwrap_err();
    assert_eq!(
        said("", &["Map.Input=SCAN_9"]),
        "--set Map.Input=SCAN_9: Input: nobody in the mission publishes SCAN_9; published are SCAN"
    );
    let filter = "<Filter type=\"Distance\"><Input>SCN</Input></Filter>";
    assert_eq!(said(filter, &[]), "m.xml:7:32: Input: nobody in the mission publishes SCN; published are SCAN, SCAN_1");
    // Somebody else's program may publish it.
    assert!(wired("<App exec=\"./mine\"/>", &["Map.Input=SCAN_9"]).is_ok());
}

#[test]
fn a_mission_waits_for_a_person_if_its_controller_is_told_so_wherever_that_is_said() {
    let mode = |sets: &[&str]| wired("", sets).unwrap().mode;
    assert_eq!(
        [mode(&[]), mode(&["Controller.Manual=true"]), mode(&["Controller.Manual=false"])],
        [Mode::Auto, Mode::Manual, Mode::Auto]
    );
    // In the file, and against the Scenario's type: the parameter says it more exactly.
    let file = |scenario: &str, manual: &str| {
        let text = with("").replace("type=\"auto\"", scenario).replace("<Controller type=\"MOOSSim\"/>", manual);
        let rest: Registry = registry().types().filter(|one| one.element != "Controller").collect();
        let registry: Registry = WAITING.iter().chain(rest.types()).collect();
        Mission::parse(&text, Path::new("m.xml"), &registry, &[]).unwrap().mode
    };
    let said = |value: &str| format!("<Controller type=\"MOOSSim\"><Manual>{value}</Manual></Controller>");
    assert_eq!(file("type=\"manual\"", "<Controller type=\"MOOSSim\"/>"), Mode::Manual);
    assert_eq!(file("type=\"manual\"", &said("false")), Mode::Auto);
    assert_eq!(file("type=\"auto\"", &said("true")), Mode::Manual);
}

/// Regression: an explorer from outside had a Res of its own, and its volume was not the map's.
#[test]
fn another_executable_has_in_common_with_others_what_a_type_would_have() {
    let text = with("").replace("type=\"OctoMap\"", "type=\"OctoMap\" Res=\"0.2\"");
    let mission = parse(&text, &["Explorer.exec=/bin/sh"]).unwrap();
    assert_eq!(app(&mission, "Explorer").setting("Res"), Some("0.2"));
    let mission = parse(&with(""), &["Explorer.exec=/bin/sh", "Explorer.Res=0.4"]).unwrap();
    assert_eq!(app(&mission, "Map").setting("Res"), Some("0.4"));
    let error = parse(&text, &["Explorer.exec=/bin/sh", "Explorer.Res=0.4"]).unwrap_err();
    assert!(error.contains("right is the same for Map and Explorer"), "{error}");
    let error = parse(&with(""), &["Explorer.exec=/bin/sh", "Explorer.Res=wide"]).unwrap_err();
    assert!(error.contains("--set Explorer.Res=wide: Res: \"wide\""), "{error}");
}

/// Map and explorer with a volume that need not be said.
fn bounded(sets: &[&str]) -> Result<Mission, String> {
    const ORIGIN: Option<&str> = Some("0; 0; 0");
    const VOLUME: &[ParamSpec] = &[
        param("Mid", Kind::Point { unit: "m" }, ORIGIN, "Middle."),
        param("Dim", Kind::Size { unit: "m" }, ORIGIN, "Size."),
    ];
    const fn with_volume(element: &'static str, name: &'static str) -> AppType {
        AppType { element, name, summary: "Has a volume.", params: VOLUME, build: unbuilt, preflight: None }
    }
    static TYPES: &[AppType] = &[with_volume("Map", "OctoMap"), with_volume("Explorer", "Potential")];
    let others = registry().types().filter(|one| !["Map", "Explorer"].contains(&one.element)).collect::<Registry>();
    let all: Registry = others.types().chain(TYPES).collect();
    let text = "<Scenario><Sensor type=\"Simulator\"/><Map type=\"OctoMap\"/><Explorer type=\"Potential\"/>\
                <Controller type=\"MOOSSim\"/></Scenario>";
    let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    Mission::parse(text, Path::new("m.xml"), &all, &sets).map_err(|problems| problems.to_string())
}

/// Regression: a middle without a size was passed over, and a size alone lay around the origin.
#[test]
fn a_volume_has_a_middle_and_a_size() {
    let said = |sets: &[&str]| bounded(sets).map(|_| ()).unwrap_err();
    let right = "right is both, the middle (Mid) and the size (Dim) of a volume";
    for app in ["Map", "Explorer"] {
        let mid = format!("{app}.Mid=1; 2; 3");
        assert_eq!(said(&[&mid]), format!("--set {mid}: Mid without Dim; {right}"));
        let dim = format!("{app}.Dim=1; 2; 3");
        assert_eq!(said(&[&dim]), format!("--set {dim}: Dim without Mid; {right}"));
        bounded(&[&mid, &format!("{app}.Dim=0; 0; 0")]).unwrap();
        bounded(&[&format!("{app}.Dim=0; 0; 0")]).unwrap();
    }
}

/// Regression: what was said of the map's volume limited nothing.
#[test]
fn a_volume_is_said_of_map_or_explorer_for_both() {
    for (said, other) in [("Map", "Explorer"), ("Explorer", "Map")] {
        let sets = [format!("{said}.Mid=1; 2; 3"), format!("{said}.Dim=4; 5; 6")];
        let mission = bounded(&[&sets[0], &sets[1]]).unwrap();
        assert_eq!(settings(&mission, other), "Mid=1; 2; 3 Dim=4; 5; 6");
    }
    let own = ["Map.Mid=1; 2; 3", "Map.Dim=4; 5; 6", "Explorer.Mid=0; 0; 1", "Explorer.Dim=1; 1; 1"];
    assert_eq!(settings(&bounded(&own).unwrap(), "Explorer"), "Mid=0; 0; 1 Dim=1; 1; 1");
}
