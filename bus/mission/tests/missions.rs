//! Whole mission files against a small table of types: what parses, what it means, and what every mistake is answered with.

use std::path::Path;

use elk_bus::{App, AppError};
use elk_mission::{
    AppSpec, AppType, Exchange, Findings, Kind, Mission, MissionError, Mode, Override, ParamSpec, Params, Policy,
    Preflight, Program, Registry, Restart, describe,
};
use proptest::prelude::*;

fn unbuilt(_: &Params) -> Result<Box<dyn App>, AppError> {
    Err("the types of these tests are only parsed".into())
}

const fn param(name: &'static str, kind: Kind, default: Option<&'static str>, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind, default, doc }
}

const RES: ParamSpec = param("Res", Kind::Number { unit: "m", min: 0.001, max: 10.0 }, Some("0.1"), "Edge of a voxel.");
const HOST: ParamSpec = param("MOOSHost", Kind::Text, Some("localhost"), "Accepted.");
const PORT: ParamSpec = param("MOOSPort", Kind::Integer { min: 1, max: 65535 }, Some("9000"), "Accepted.");
const INPUT: ParamSpec = param("Input", Kind::Variable, Some("SCAN"), "Scans to read.");
const OUTPUT: ParamSpec = param("Output", Kind::Variable, Some("SCAN_1"), "Scans to publish.");
const MID: ParamSpec = param("Mid", Kind::Point { unit: "m" }, None, "Centre of the volume.");
const DIM: ParamSpec = param("Dim", Kind::Point { unit: "m" }, None, "Size of the volume.");
const POLICY: ParamSpec = param("Policy", Kind::Choice(&["elk", "thesis"]), Some("elk"), "How to move.");

const SENSOR: &[AppType] = &[AppType {
    element: "Sensor",
    name: "Simulator",
    summary: "A depth camera in a world of triangles.",
    params: &[
        HOST,
        PORT,
        param("MOOSPoseVarName", Kind::Variable, Some("SIM_SENSOR"), "Variable of its pose."),
        param("PoseEstimator", Kind::Choice(&["none"]), Some("none"), "Accepted."),
        param("World", Kind::File { builtin: &["car-interior"] }, Some("car-interior"), "World."),
    ],
    build: unbuilt,
    preflight: None,
}];

const THRESHOLD: Kind = Kind::Number { unit: "m", min: 0.0, max: f64::INFINITY };

const STAGES: &[AppType] = &[
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
        params: &[HOST, PORT, param("MOOSPoseVarName", Kind::Variable, Some("SIM_SENSOR"), "The sensor's pose.")],
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

const LISTING_2: &str = include_str!("../../../mission-files/thesis-listing-2.xml");

fn registry() -> Registry {
    Registry::new(&[SENSOR, STAGES])
}

fn parse(text: &str, sets: &[&str]) -> Result<Mission, String> {
    let overrides: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    Mission::parse(text, Path::new("m.xml"), &registry(), &overrides).map_err(|e| e.to_string())
}

/// A mission whose lines 2 to 6 are right, with `line` as line 7.
fn with(line: &str) -> String {
    format!(
        "<Scenario name=\"t\" type=\"auto\">\n<Sensor type=\"Simulator\"/>\n<Map type=\"OctoMap\"/>\n\
         <Explorer type=\"Potential\"><Mid>0;0;0</Mid><Dim>1;1;1</Dim></Explorer>\n\
         <Controller type=\"MOOSSim\"/>\n<!-- here: -->\n{line}\n</Scenario>"
    )
}

fn wrong(line: &str) -> String {
    parse(&with(line), &[]).unwrap_err()
}

fn settings(mission: &Mission, app: &str) -> String {
    let app = mission.apps.iter().find(|one| one.name == app).unwrap();
    let texts = app.settings.iter().map(|(name, text)| format!("{name}={text}"));
    texts.collect::<Vec<_>>().join(" ")
}

#[test]
fn the_listing_of_the_thesis_parses_as_printed() {
    let mission = parse(LISTING_2, &[]).unwrap();
    assert_eq!((mission.name.as_str(), mission.mode), ("Simulator", Mode::Manual));
    let apps: Vec<String> = mission.apps.iter().map(|app| format!("{} {}", app.name, app.type_name())).collect();
    assert_eq!(
        apps,
        [
            "Sensor Simulator",
            "Filter Distance",
            "Map OctoMap",
            "Explorer Potential",
            "Controller MOOSSim",
            "Logger Mcap"
        ]
    );
    assert_eq!(
        settings(&mission, "Sensor"),
        "MOOSHost=localhost MOOSPort=9000 MOOSPoseVarName=SIM_SENSOR PoseEstimator=none World=car-interior"
    );
    assert_eq!(settings(&mission, "Explorer"), "Mid=0; 0; 0 Dim=5.7; 4.3; 4.5 Res=0.1 Policy=elk");
    let Program::Builtin(_, params) = &mission.apps[3].program else { panic!("not built in") };
    assert_eq!(params.point("Dim"), [5.7, 4.3, 4.5]);
    assert_eq!(params.number("Res"), 0.1);
    assert_eq!(params.text("Policy"), "elk");
}

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
fn any_executable_can_take_a_stages_place() {
    let exec = r#"<Filter exec="./mine" args="-v  --fast" name="Mine" restart="on-failure"><K>3</K></Filter>"#;
    let mission = parse(&with(exec), &[]).unwrap();
    let mine = mission.apps.iter().find(|app| app.name == "Mine").unwrap();
    let Program::Foreign { exec, args } = &mine.program else { panic!("not foreign") };
    assert_eq!((exec.as_path(), args.len()), (Path::new("./mine"), 2));
    assert_eq!(mine.policy, Policy { restart: Restart::OnFailure, ..Policy::default() });
    assert_eq!(settings(&mission, "Mine"), "K=3 Input=SCAN Output=SCAN_1");
    assert_eq!(settings(&mission, "Map"), "Res=0.1 Input=SCAN_1");
}

#[test]
fn what_happens_to_those_who_die_or_hang_is_said_in_attributes() {
    let policy = |line: &str| {
        let mission = parse(&with(line), &[]).unwrap();
        mission.of_element("Filter").next().unwrap().policy
    };
    assert_eq!(policy(r#"<Filter type="Distance"/>"#), Policy::default());
    let (restart, health_secs) = (Restart::Always, Some(30.0));
    let always = Policy { restart, health_secs, ..Policy::default() };
    assert_eq!(policy(r#"<Filter type="Distance" restart="always"/>"#), always);
    let said = r#"<Filter type="Distance" restart="always" restarts="9" restart-window="2 s" health="off"/>"#;
    assert_eq!(policy(said), Policy { restart, restarts: 9, window_secs: 2.0, health_secs: None });
    // Somebody else's program need not speak.
    assert_eq!(policy(r#"<Filter exec="x" restart="always"/>"#), Policy { restart, ..Policy::default() });
    assert_eq!(policy(r#"<Filter exec="x" health="7"/>"#), Policy { health_secs: Some(7.0), ..Policy::default() });

    let text = with("").replace("type=\"auto\"", "broker-restarts=\"1000\" broker-window=\"3600\" mailbox=\"64\"");
    let mission = parse(&text, &[]).unwrap();
    assert_eq!(mission.broker, Policy { restarts: 1000, window_secs: 3600.0, ..Policy::BROKER });
    assert_eq!((mission.mailbox_mb, parse(&with(""), &[]).unwrap().mailbox_mb), (64, 4));
    let text = with("").replace("type=\"auto\"", "broker-restarts=\"some\"");
    let said = "m.xml:1:37: broker-restarts \"some\" is no whole number; right is a whole number from 1 to 1000000";
    assert_eq!(parse(&text, &[]).unwrap_err(), said);
}

fn app(mission: &Mission, name: &str) -> AppSpec {
    mission.apps.iter().find(|app| app.name == name).unwrap().clone()
}

fn exchange(said: &[&str]) -> Exchange {
    let mut wanted = Exchange { folder: "/".into(), ..Exchange::default() };
    for (name, text) in said.iter().map(|one| one.split_once('=').unwrap()) {
        match name {
            "type" => wanted.type_name = Some(text.to_owned()),
            "exec" => wanted.exec = Some((text.to_owned(), vec!["-v".to_owned()])),
            _ => wanted.params.push((name.to_owned(), text.to_owned())),
        }
    }
    wanted
}

#[test]
fn an_exchanged_app_keeps_what_was_set_and_what_the_new_one_has() {
    let mission = parse(LISTING_2, &["Explorer.Policy=thesis"]).unwrap();
    let explorer = app(&mission, "Explorer");
    let swap = |said: &[&str]| explorer.exchange(&exchange(said), &registry()).unwrap();

    let closest = swap(&["type=ClosestFrontier", "res=0.2"]);
    assert_eq!((closest.app.type_name(), closest.app.name.as_str()), ("ClosestFrontier", "Explorer"));
    assert_eq!(closest.app.setting("Res"), Some("0.2"));
    assert_eq!(closest.app.setting("Dim"), Some("5.7; 4.3; 4.5"));
    assert_eq!(closest.app.setting("Policy"), Some("thesis"));
    assert_eq!(closest.dropped, [""; 0]);
    // Of the thesis' policy, the simple one knows nothing.
    let simple = swap(&["type=Simple"]);
    assert_eq!(simple.dropped, ["Policy=thesis"]);
    assert_eq!(simple.app.setting("Res"), Some("0.1"));

    let mine = swap(&["exec=/bin/sh", "K=1"]).app;
    let Program::Foreign { exec, args } = &mine.program else { panic!("not foreign") };
    assert_eq!((exec.as_path(), args.as_slice()), (Path::new("/bin/sh"), ["-v".to_owned()].as_slice()));
    assert_eq!(mine.setting("Dim"), Some("5.7; 4.3; 4.5"));
    // Back again, what only a stranger understands is left behind.
    let back = mine.exchange(&exchange(&["type=Potential"]), &registry()).unwrap();
    assert_eq!(back.dropped, ["K=1"]);
    assert_eq!(back.app.setting("Policy"), Some("thesis"));
}

#[test]
fn an_exchange_that_is_wrong_says_what_would_be_right() {
    let explorer = app(&parse(LISTING_2, &[]).unwrap(), "Explorer");
    for (said, right) in [
        (vec!["type=Potentail"], r#"type=Potentail: Explorer has no type "Potentail"; did you mean Potential?"#),
        (
            vec!["type=ClosestFrontier", "Res=11"],
            r#"Res=11: Res: "11" is out of range; right is a number from 0.001 to 10, in m"#,
        ),
        (
            vec!["type=ClosestFrontier", "Polcy=elk"],
            "Polcy=elk: Explorer ClosestFrontier has no parameter Polcy; did you mean Policy?",
        ),
        (vec!["exec=/bin/sh", "type=Potential"], "exec=/bin/sh: type and exec are both said; one is right"),
        (vec!["exec=/"], "exec=/: / is no file; right is an executable"),
        (vec!["exec=./no/such"], "exec=./no/such: /./no/such cannot be run: No such file or directory (os error 2)"),
        (vec!["exec=/etc/passwd"], "exec=/etc/passwd: /etc/passwd is not executable; `chmod +x` makes a program of it"),
        (
            vec!["exec=no-such-program"],
            "exec=no-such-program: there is no no-such-program in PATH; right is an executable's name, or a path with a /",
        ),
    ] {
        let error = explorer.exchange(&exchange(&said), &registry()).unwrap_err().to_string();
        assert_eq!(error, right);
    }
}

#[test]
fn a_mission_without_a_logger_gets_one_unless_it_says_none() {
    let names = |line| {
        let mission = parse(&with(line), &[]).unwrap();
        mission.of_element("Logger").map(|app| app.name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(names(""), ["Logger"]);
    assert_eq!(names(r#"<Logger type="none"/>"#), [""; 0]);
    assert_eq!(names(r#"<Logger type="Mcap" name="L"/>"#), ["L"]);
}

#[test]
fn the_command_line_overrides_the_file_with_the_same_checks() {
    let sets = ["Map.Res=0.05 m", "Explorer.Res=0.05", "Explorer.type=ClosestFrontier", "Map.Res=0.2"];
    let said_twice = parse(LISTING_2, &sets).unwrap_err();
    assert_eq!(said_twice, "--set Map.Res=0.2: Res is said twice; once is enough");

    let mission = parse(LISTING_2, &sets[..3]).unwrap();
    assert_eq!(settings(&mission, "Map"), "Res=0.05 Input=SCAN_1");
    assert_eq!(mission.of_element("Explorer").next().unwrap().type_name(), "ClosestFrontier");

    for (set, said) in [
        ("Map.Res=1 cm", r#"--set Map.Res=1 cm: Res: "1 cm" is in cm; the unit must be m"#),
        ("Mop.Res=1", "--set Mop.Res=1: the mission has no app Mop; did you mean Map?"),
        ("Map.Rse=1", "--set Map.Rse=1: Map OctoMap has no parameter Rse; did you mean Res?"),
        (
            "Explorer.type=Potentail",
            r#"--set Explorer.type=Potentail: Explorer has no type "Potentail"; did you mean Potential?"#,
        ),
    ] {
        assert_eq!(parse(LISTING_2, &[set]).unwrap_err(), said);
    }
}

#[test]
fn setting_a_parameter_of_a_checked_app_checks_it_too() {
    let mut mission = parse(LISTING_2, &[]).unwrap();
    let map = mission.apps.iter_mut().find(|app| app.name == "Map").unwrap();
    map.set("Res", "0.25").unwrap();
    assert_eq!(map.setting("Res"), Some("0.25"));
    assert!(map.set("Res", "wide").is_err());
    assert_eq!(map.setting("Res"), Some("0.25"));
    assert!(map.takes("Input") && !map.takes("World"));
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

#[test]
fn every_mistake_has_its_place_and_says_what_would_be_right() {
    for (line, said) in [
        ("<Filtre type=\"Distance\"/>", "m.xml:7:1: <Filtre> is no element of a Scenario; did you mean Filter?"),
        ("<Filter type=\"Distanze\"/>", "m.xml:7:15: Filter has no type \"Distanze\"; did you mean Distance?"),
        ("<Filter/>", "m.xml:7:1: <Filter> has no type; known: Distance"),
        ("<Filter tpye=\"Distance\"/>", "m.xml:7:9: <Filter> has no attribute tpye; did you mean type?"),
        ("<App/>", "m.xml:7:1: <App> has no exec; right is exec=\"program\""),
        ("<App exec=\"\"/>", "m.xml:7:12: exec is empty; right is an executable"),
        ("<Filter type=\"Distance\" exec=\"x\"/>", "m.xml:7:31: type and exec are both said; one is right"),
        ("<Filter type=\"Distance\" args=\"x\"/>", "m.xml:7:31: args without exec; right is both or neither"),
        (
            "<Filter type=\"Distance\"><Treshold>1</Treshold></Filter>",
            "m.xml:7:25: Filter Distance has no parameter Treshold; did you mean Threshold?",
        ),
        (
            "<Filter type=\"Distance\" Foo=\"1\"/>",
            "m.xml:7:25: Filter Distance has no parameter Foo; known: Threshold, Input, Output",
        ),
        (
            "<Filter type=\"Distance\"><Threshold>  -1 </Threshold></Filter>",
            "m.xml:7:38: Threshold: \"-1\" is out of range; right is a number of at least 0, in m",
        ),
        (
            "<Filter type=\"Distance\"><Threshold>1</Threshold><Threshold>2</Threshold></Filter>",
            "m.xml:7:49: Threshold is said twice; once is enough",
        ),
        (
            "<Filter type=\"Distance\"><Threshold/></Filter>",
            "m.xml:7:25: Threshold: \"\" is no number; right is a number of at least 0, in m",
        ),
        (
            "<Filter type=\"Distance\"><Threshold unit=\"m\">1</Threshold></Filter>",
            "m.xml:7:36: <Threshold> has the attribute unit; a parameter has none",
        ),
        (
            "<Filter type=\"Distance\"><Threshold><A/></Threshold></Filter>",
            "m.xml:7:36: <A> stands in the parameter <Threshold>; right is its value alone",
        ),
        (
            "<Filter type=\"Distance\"> 10.0 </Filter>",
            "m.xml:7:26: \"10.0\" stands loose in <Filter>; right is an element",
        ),
        ("hello", "m.xml:7:1: \"hello\" stands loose in <Scenario>; right is an element"),
        (
            "<Filter type=\"Distance\" name=\"Map\"/>",
            "m.xml:7:31: the name Map is already that of a <Map>; names are unique",
        ),
        (
            "<Filter type=\"Distance\" name=\"launcher\"/>",
            "m.xml:7:31: the name launcher is taken by elk itself; choose another one",
        ),
        (
            "<Filter type=\"Distance\" name=\"a b\"/>",
            "m.xml:7:31: \"a b\" is no name for an app; right are 1 to 48 letters, digits, '-' or '_', the first a letter or a digit",
        ),
        (
            "<Filter type=\"Distance\" restart=\"allways\"/>",
            "m.xml:7:34: restart \"allways\" is not offered; did you mean always?",
        ),
        (
            "<Filter type=\"Distance\" restart=\"always\" restarts=\"0\"/>",
            "m.xml:7:52: restarts \"0\" is out of range; right is a whole number from 1 to 1000000",
        ),
        (
            "<Filter type=\"Distance\" restart=\"always\" restart-window=\"1 min\"/>",
            "m.xml:7:58: restart-window \"1 min\" is in min; the unit must be s",
        ),
        (
            "<Filter type=\"Distance\" health=\"never\"/>",
            "m.xml:7:33: health \"never\" is no number; right is a number from 1 to 86400, in s, or off",
        ),
        (
            "<Filter type=\"Distance\" helth=\"5\"/>",
            "m.xml:7:25: <Filter> has no attribute helth; did you mean health?",
        ),
        (
            "<Filter type=\"Distance\" restarts=\"3\"/>",
            "m.xml:7:25: restarts without restart; right is restart=\"on-failure\" or \"always\" with it",
        ),
        // Accepted, and without effect there.
        (
            "<Filter type=\"Distance\" mailbox=\"64\"/>",
            "m.xml:7:25: <Filter> has no attribute mailbox; it is one of the Scenario's",
        ),
        (
            "<App exec=\"x\" restart=\"always\" broker-restarts=\"3\"/>",
            "m.xml:7:32: <App> has no attribute broker-restarts; it is one of the Scenario's",
        ),
        ("<Map type=\"OctoMap\"/>", "m.xml:7:1: a second <Map>; one is right"),
        ("<Logger type=\"Mcp\"/>", "m.xml:7:15: Logger has no type \"Mcp\"; did you mean Mcap?"),
    ] {
        let found = if line.contains("name=\"Map\"") { named_map(line) } else { wrong(line) };
        assert_eq!(found, said, "{line}");
    }
}

/// As `wrong`, in a mission that says the name of its map.
fn named_map(line: &str) -> String {
    let text = with(line).replace("<Map type", "<Map name=\"Map\" type");
    parse(&text, &[]).unwrap_err()
}

#[test]
fn a_missing_world_says_where_it_was_looked_for() {
    let text = with("")
        .replace("<Sensor type=\"Simulator\"/>", "<Sensor type=\"Simulator\"><World>worlds/moon.obj</World></Sensor>");
    assert_eq!(
        parse(&text, &[]).unwrap_err(),
        "m.xml:2:33: World: there is no file worlds/moon.obj; known: car-interior"
    );
}

#[test]
fn all_mistakes_are_reported_together_in_the_order_of_the_file() {
    let text = "<Scenario type=\"atuo\" vers=\"1\" version=\"2\">\n  <Sensor type=\"Simulator\"/>\n  \
                <Explorer type=\"Potential\"><Mid>0;0</Mid></Explorer>\n</Scenario>";
    assert_eq!(
        parse(text, &["Map.Res=1"]).unwrap_err(),
        "m.xml:1:1: the Scenario has no <Map>; right is one\n\
         m.xml:1:1: the Scenario has no <Controller>; right is one\n\
         m.xml:1:17: a Scenario of type \"atuo\" is unknown; did you mean auto?\n\
         m.xml:1:23: Scenario has no attribute vers; known: name, type, version, broker-restarts, broker-window, mailbox\n\
         m.xml:1:41: version \"2\" is unknown; right is \"1\"\n\
         m.xml:3:3: Explorer Potential needs the parameter Dim; right is three numbers \"x; y; z\", in m\n\
         m.xml:3:35: Mid: \"0;0\" has 2 numbers; right is three numbers \"x; y; z\", in m\n\
         --set Map.Res=1: the mission has no app Map; known: Sensor, Explorer, Logger"
    );
}

#[test]
fn what_is_no_mission_is_said_so() {
    for (text, said) in [
        ("<Scenari/>", "m.xml:1:1: the mission is a <Scenari>; right is <Scenario>"),
        ("<Scenario>\n</Scenaro>", "m.xml:2:1: this is no well-formed XML: expected 'Scenario' tag, not 'Scenaro'"),
        ("", "m.xml:1:1: this is no well-formed XML: the document does not have a root node"),
        (
            "<!DOCTYPE a [<!ENTITY b \"c\">]><a>&b;</a>",
            "m.xml:1:1: a mission has no <!DOCTYPE …>; right is to take it out, and what it defines along with it",
        ),
    ] {
        assert_eq!(parse(text, &[]).unwrap_err(), said);
    }
    let missing = Mission::load(Path::new("no-such.xml"), &registry(), &[]).unwrap_err();
    assert!(matches!(missing, MissionError::Unreadable { .. }));
    assert_eq!(missing.to_string(), "cannot read the mission file no-such.xml: No such file or directory (os error 2)");
}

#[test]
fn one_app_by_itself_is_checked_against_the_same_table() {
    let filter = registry().find("Filter", "Distance").unwrap();
    let pair = |name: &str, text: &str| (name.to_owned(), text.to_owned());
    let params = filter.check(&[pair("Threshold", "3 m")], Path::new("")).unwrap();
    assert_eq!(params.number("Threshold"), 3.0);
    let error = filter.check(&[pair("Threshold", "3 km")], Path::new("")).unwrap_err();
    assert_eq!(error.to_string(), r#"Threshold=3 km: Threshold: "3 km" is in km; the unit must be m"#);
}

#[test]
fn the_table_is_shown_to_people() {
    let text = describe(&Registry::new(&[SENSOR]));
    assert!(text.starts_with(
        "<Sensor type=\"Simulator\">  A depth camera in a world of triangles.\n    MOOSHost         Accepted.\n"
    ));
    assert!(text.contains("(a whole number from 1 to 65535; default: 9000)"));
    assert!(text.contains("    restart         What happens when the app dies"));
    assert!(text.contains("(a number from 1 to 86400, in s; default: 60)"));
    let text = describe(&registry());
    assert!(text.contains("(three numbers \"x; y; z\", in m; must be said)"));
}

proptest! {
    #[test]
    fn no_text_makes_the_parser_panic(text in "\\PC{0,200}") {
        let _ = parse(&text, &[]);
    }

    #[test]
    fn no_mutation_of_a_mission_makes_the_parser_panic(
        cut in 0..LISTING_2.len(), length in 0usize..40, put in "[<>/&=\"'a-zA-Z0-9; éλ\\n-]{0,12}"
    ) {
        let end = (cut + length).min(LISTING_2.len());
        let text = format!("{}{put}{}", &LISTING_2[..cut], &LISTING_2[end..]);
        match parse(&text, &[]) {
            Ok(mission) => prop_assert!(mission.apps.len() >= 4),
            Err(said) => prop_assert!(said.starts_with("m.xml:"), "{}", said),
        }
    }

    #[test]
    fn settings_say_the_same_again(x in -1e6..1e6f64, y in -1e6..1e6f64, res in 0.001..10.0f64) {
        let sets = [format!("Explorer.Mid={x}; {y}; 0"), format!("Explorer.Res={res}"), format!("Map.Res={res}")];
        let mission = parse(LISTING_2, &[&sets[0], &sets[1], &sets[2]]).unwrap();
        let explorer = mission.of_element("Explorer").next().unwrap();
        let Program::Builtin(app_type, params) = &explorer.program else { panic!("not built in") };
        let again = app_type.check(&explorer.settings, Path::new("")).unwrap();
        prop_assert_eq!(params, &again);
        prop_assert_eq!(params.point("Mid"), [x, y, 0.0]);
    }
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

/// None of these may take long, nor much memory; each is answered, with its place.
#[test]
fn files_that_are_made_to_be_too_much_are_refused() {
    let said = |text: &str| parse(text, &[]).unwrap_err();
    let many = format!("<Scenario>\n{}</Scenario>", "<App exec=\"x\"/>\n".repeat(20_000));
    let many = said(&many);
    assert!(many.contains("m.xml:1002:1: one app more than 1000; right is a mission of at most so many"), "{many}");
    let deep = said(&format!("{}{}", "<a>".repeat(40_000), "</a>".repeat(40_000)));
    assert_eq!(deep, "m.xml:1:1: the mission is a <a>; right is <Scenario>");
    assert!(said(&format!("<Scenario>{}</Scenario>", "<a/>".repeat(110_000))).contains("this is no well-formed XML"));
    // Of what is wrong a hundred thousand times, the first hundred are told.
    let wrong = said(&format!("<Scenario>{}</Scenario>", "<x/>y".repeat(40_000)));
    assert_eq!((wrong.lines().count(), wrong.lines().last().unwrap().contains("there is more")), (101, true));
    // Names that are as long as the file, in one line of half a megabyte.
    let long = "n".repeat(200_000);
    let wrong = said(&format!("<Scenario {long}=\"{long}\"><Filter type=\"{long}\"/></Scenario>"));
    assert!(wrong.len() < 20_000, "{} bytes", wrong.len());
    let attributes: String = (0..8_000).map(|n| format!(" a{n}=\"{n}\"")).collect();
    let wrong = said(&format!("<Scenario><Filter type=\"Distance\"{attributes}/></Scenario>"));
    assert_eq!(wrong.lines().count(), 101);
    let laughs: String =
        (1..10).map(|n| format!("<!ENTITY l{n} \"{}\">", format!("&l{};", n - 1).repeat(10))).collect();
    let wrong = said(&format!("<!DOCTYPE a [<!ENTITY l0 \"ha\">{laughs}]><Scenario>&l9;</Scenario>"));
    assert!(wrong.starts_with("m.xml:1:1: a mission has no <!DOCTYPE …>"), "{wrong}");
}

#[test]
fn what_is_no_file_is_no_mission_and_nobody_waits_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("mission.xml");
    assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let said = |path: &Path| Mission::load(path, &registry(), &[]).unwrap_err().to_string();
    assert!(said(&fifo).ends_with("mission.xml: it is a FIFO; right is an ordinary file"), "{}", said(&fifo));
    assert!(said(folder.path()).ends_with(": it is a folder; right is a file"));
    assert!(said(Path::new("/dev/zero")).ends_with("/dev/zero: it is a device; right is an ordinary file"));
    let long = folder.path().join("long.xml");
    std::fs::File::create(&long).unwrap().set_len(1 << 40).unwrap();
    assert!(said(&long).ends_with("long.xml: it is longer than 512 kB"), "{}", said(&long));
}

/// What the file cannot show is looked at before anything starts, all of it at once.
#[test]
fn executables_and_what_apps_need_are_looked_at() {
    fn look(params: &Params, mission: &Mission) -> Findings {
        let warnings = vec![format!("{} apps, K is {}", mission.apps.len(), params.number("K"))];
        let faults = if params.number("K") > 2.0 { vec!["K is too much".to_owned()] } else { Vec::new() };
        Findings { faults, warnings }
    }
    const K: ParamSpec = param("K", Kind::Number { unit: "", min: 0.0, max: 9.0 }, Some("1"), "A number.");
    const fn row(name: &'static str, preflight: Option<Preflight>) -> AppType {
        AppType { element: "Filter", name, summary: "Looks around.", params: &[K], build: unbuilt, preflight }
    }
    static TYPES: &[AppType] = &[row("Looking", Some(look)), row("Plain", None)];
    let registry = Registry::new(&[TYPES]);
    let preflight = |filter: &str| {
        let text = format!(
            "<Scenario><Sensor exec=\"/bin/sh\"/><Map exec=\"sh\"/>{filter}<Explorer exec=\"sh\"/><Controller exec=\"sh\"/></Scenario>"
        );
        Mission::parse(&text, Path::new("m.xml"), &registry, &[])
            .unwrap()
            .preflight()
            .map_err(|error| error.to_string())
    };
    assert_eq!(preflight("<Filter type=\"Looking\"/>"), Ok(vec!["Filter: 5 apps, K is 1".to_owned()]));
    assert_eq!(
        preflight("<Filter type=\"Looking\" K=\"3\"/><App exec=\"/no/such\"/><App name=\"Odd\" exec=\"no-such\"/>"),
        Err("Filter: K is too much\n\
             App: /no/such cannot be run: No such file or directory (os error 2)\n\
             Odd: there is no no-such in PATH; right is an executable's name, or a path with a /"
            .to_owned())
    );
    let of_no_look = preflight("<Filter type=\"Plain\"/>");
    assert_eq!(of_no_look, Err("Filter: the types of these tests are only parsed".to_owned()), "it is built");
}

#[test]
fn any_executable_takes_a_place_from_the_command_line() {
    let sets = ["Explorer.K=1", "Explorer.args=-v --fast", "Explorer.exec=/bin/sh"];
    let mine = app(&parse(LISTING_2, &sets).unwrap(), "Explorer");
    let Program::Foreign { exec, args } = &mine.program else { panic!("not foreign") };
    assert_eq!((exec.as_path(), args.join(" ").as_str()), (Path::new("/bin/sh"), "-v --fast"));
    assert_eq!((mine.setting("K"), mine.setting("Dim")), (Some("1"), Some("5.7; 4.3; 4.5")));
    for (sets, said) in [
        (
            vec!["Explorer.exec=./no/such"],
            "--set Explorer.exec=./no/such: ./no/such cannot be run: No such file or directory (os error 2)",
        ),
        (vec!["Explorer.args=-v"], "--set Explorer.args=-v: args without exec; right is both or neither"),
        (
            vec!["Explorer.exec=/bin/sh", "Explorer.type=Simple"],
            "--set Explorer.type=Simple: what runs is said twice; one type or exec is right",
        ),
    ] {
        assert_eq!(parse(LISTING_2, &sets).unwrap_err(), said);
    }
}

#[test]
fn what_the_file_says_to_one_type_alone_is_left_behind_when_the_command_line_names_another() {
    let said = LISTING_2.replace("<Dim>", "<Policy> thesis </Policy> <Dim>");
    let simple = app(&parse(&said, &["Explorer.type=Simple"]).unwrap(), "Explorer");
    assert_eq!((simple.setting("Policy"), simple.setting("Res")), (None, Some("0.1")));
    // What no type has is still a mistake, and so is what the command line says to the wrong one.
    let odd = said.replace("Policy>", "Polcy>");
    assert!(parse(&odd, &["Explorer.type=Simple"]).unwrap_err().contains("has no parameter Polcy"));
    let wrong = parse(LISTING_2, &["Explorer.type=Simple", "Explorer.Policy=elk"]).unwrap_err();
    assert!(wrong.contains("Explorer Simple has no parameter Policy"), "{wrong}");
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

#[test]
fn a_mission_written_down_again_is_the_same_mission() {
    let more = "<App name=\"Mine\" exec=\"./mine\" args=\"-v\" restart=\"always\" restarts=\"3\"><K>a &lt; b</K></App>";
    let sets = ["Map.Res=0.05", "Explorer.type=ClosestFrontier"];
    for (text, sets) in
        [(LISTING_2.to_owned(), vec![]), (with(more), sets.to_vec()), (with("<Logger type=\"none\"/>"), vec![])]
    {
        let mission = parse(&text, &sets).unwrap();
        let again = parse(&mission.to_xml(&|_, _| false), &[]).unwrap();
        assert_eq!((&again.name, again.mode, again.broker), (&mission.name, mission.mode, mission.broker));
        assert_eq!(again.apps.len(), mission.apps.len());
        for (one, other) in again.apps.iter().zip(&mission.apps) {
            assert_eq!((&one.name, &one.element, one.type_name()), (&other.name, &other.element, other.type_name()));
            assert_eq!((&one.settings, one.policy), (&other.settings, other.policy));
            if let (Program::Foreign { exec, args }, Program::Foreign { args: others, .. }) =
                (&one.program, &other.program)
            {
                assert!(exec.is_absolute() && args == others);
            }
        }
    }
}
