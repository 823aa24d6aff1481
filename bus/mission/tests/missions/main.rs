//! Whole mission files against a small table of types: what parses, what it means, and what every mistake is answered with.

mod command_line;
mod exchange;
mod mistakes;
mod moos;
mod preflight;
mod table;
mod wiring;

use std::path::Path;

use elk_mission::{Mode, Policy, Program, Registry, Restart, Via, describe};
use proptest::prelude::*;

use table::{LISTING_2, SENSOR, parse, registry, settings, with};

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
    assert_eq!(settings(&mission, "Sensor"), "MOOSPoseVarName=SIM_SENSOR PoseEstimator=none World=car-interior");
    assert_eq!(settings(&mission, "Explorer"), "Mid=0; 0; 0 Dim=5.7; 4.3; 4.5 Res=0.1 Policy=elk");
    let Program::Builtin(_, params) = &mission.apps[3].program else { panic!("not built in") };
    assert_eq!(params.point("Dim"), [5.7, 4.3, 4.5]);
    assert_eq!(params.number("Res"), 0.1);
    assert_eq!(params.text("Policy"), "elk");
}

#[test]
fn any_executable_can_take_a_stages_place() {
    let exec = r#"<Filter exec="./mine" args="-v  --fast" name="Mine" restart="on-failure"><K>3</K></Filter>"#;
    let mission = parse(&with(exec), &[]).unwrap();
    let mine = mission.apps.iter().find(|app| app.name == "Mine").unwrap();
    let Program::Foreign { exec, args, via: Via::Itself } = &mine.program else { panic!("not foreign") };
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

#[test]
fn clients_of_moos_are_let_in_where_the_bus_says() {
    let moos = |line: &str| parse(&with(line), &[]).map(|mission| mission.moos);
    assert_eq!(moos("").unwrap(), None);
    let said = moos(r#"<Bus moos="0.0.0.0:9000" from="192.168.1.0/24 10.0.0.7" sources="any"/>"#).unwrap().unwrap();
    assert_eq!((said.address.to_string().as_str(), said.any_source), ("0.0.0.0:9000", true));
    assert!(said.admits("192.168.1.9".parse().unwrap()) && !said.admits("10.0.0.8".parse().unwrap()));
    let again = |line: &str| parse(&with(line), &[]).unwrap().to_xml(&|_, _| false);
    let said = again(r#"<Bus moos="localhost:9000"/>"#);
    assert!(said.contains(r#"<Bus moos="localhost:9000" sources="own"/>"#), "{said}");
    let said = again(r#"<Bus moos="localhost:9000" texts="SIM_SENSOR, NAV_*"/>"#);
    assert!(said.contains(r#"<Bus moos="localhost:9000" sources="own" texts="SIM_SENSOR NAV_*"/>"#), "{said}");

    let wrong = |line: &str, what: &str| {
        let said = parse(&with(line), &[]).unwrap_err();
        assert!(said.contains(what), "{said}");
    };
    wrong(r#"<Bus moos="9000"/>"#, "\"9000\" is no address to listen at; right is HOST:PORT");
    wrong(r#"<Bus moos="localhost:9000" from="here"/>"#, "\"here\" is no network");
    wrong(r#"<Bus moos="localhost:9000" sources="all"/>"#, "sources \"all\" is not offered; known: own, any");
    wrong(r#"<Bus mos="localhost:9000"/>"#, "Bus has no attribute mos; did you mean moos?");
    wrong("<Bus/>", "<Bus> says nothing of moos");
    let many = r#"<Bus moos="localhost:9000" sources="own" connections="1024"/>"#;
    assert_eq!(moos(many).unwrap().unwrap().connections, 1024);
    assert!(again(many).contains(many), "{}", again(many));
    assert_eq!(moos(r#"<Bus moos="localhost:9000"/>"#).unwrap().unwrap().connections, 128);
    for bad in ["0", "1025", "many"] {
        wrong(&format!(r#"<Bus moos="localhost:9000" connections="{bad}"/>"#), "whole number from 1 to 1024");
    }
    wrong(r#"<Bus moos="localhost:9000"><X/></Bus>"#, "<X> within <Bus>");
    wrong(r#"<Bus moos="localhost:9000"/><Bus moos="localhost:9001"/>"#, "a second <Bus>");
}

#[test]
fn what_moos_apps_are_told_is_where_clients_of_moos_are_let_in() {
    let moos = |text: &str, sets: &[&str]| parse(text, sets).map(|mission| mission.moos);
    let address = |text: &str, sets: &[&str]| moos(text, sets).unwrap().map(|moos| moos.address.to_string());
    assert_eq!(address(LISTING_2, &[]).as_deref(), Some("localhost:9000"));
    // As it ran, it says the same once, and of no app.
    let mission = parse(LISTING_2, &[]).unwrap().to_xml(&|_, _| false);
    assert!(
        mission.contains(r#"<Bus moos="localhost:9000" sources="own"/>"#) && !mission.contains("MOOSPort"),
        "{mission}"
    );
    assert_eq!(address(&mission, &[]).as_deref(), Some("localhost:9000"));

    let one = r#"<Filter type="Distance" MOOSPort="9001"/>"#;
    assert_eq!(address(&with(one), &[]).as_deref(), Some("localhost:9001"), "the host that is not said is MOOS' own");
    assert_eq!(address(&with(""), &["Map.MOOSHost=[::1]"]).as_deref(), Some("[::1]:9000"));
    let both = ["Sensor.MOOSPort=9100", "Controller.MOOSPort=9100"];
    assert_eq!(address(LISTING_2, &both).as_deref(), Some("localhost:9100"), "the command line comes before the file");
    // A program of somebody else's may have to be told where its database is.
    let other = r#"<App exec="pLogger" name="L"><MOOSPort>9000</MOOSPort></App>"#;
    let mission = parse(&with(other), &[]).unwrap();
    assert_eq!((mission.moos.clone(), settings(&mission, "L").as_str()), (None, "MOOSPort=9000"));
    // Where is said there, who here.
    let beside = format!(r#"{one}<Bus sources="any" texts="PLAN"/>"#);
    let said = moos(&with(&beside), &[]).unwrap().unwrap();
    assert_eq!((said.address.to_string().as_str(), said.any_source), ("localhost:9001", true));
    let same = format!(r#"{one}<Bus moos="127.0.0.1:9001"/>"#);
    assert_eq!(address(&with(&same), &[]).as_deref(), Some("127.0.0.1:9001"));
    let port_alone = format!(r#"{one}<Bus moos="0.0.0.0:9001" from="10.0.0.0/8"/>"#);
    assert_eq!(address(&with(&port_alone), &[]).as_deref(), Some("0.0.0.0:9001"));
}

#[test]
fn two_places_for_clients_of_moos_are_one_too_many() {
    let wrong = |text: &str, sets: &[&str], what: &str| {
        let said = parse(text, sets).unwrap_err();
        assert!(said.contains(what), "{said}");
    };
    let right = "right is one for all: clients of MOOS' connect there";
    let of_sensor = ["Sensor.MOOSPort=9001"];
    wrong(LISTING_2, &of_sensor, &format!("m.xml:24:20: MOOSPort: \"9000\" is not Sensor's \"9001\"; {right}"));
    wrong(LISTING_2, &["Map.MOOSHost=boat"], &format!("MOOSHost: \"boat\" is not Sensor's \"localhost\"; {right}"));
    let one = r#"<Filter type="Distance" MOOSHost="localhost" MOOSPort="9001"/>"#;
    let right = "of <Bus moos>; right is the same, or one of the two alone";
    wrong(
        &with(&format!(r#"{one}<Bus moos="localhost:9000"/>"#)),
        &[],
        &format!("MOOSPort: \"9001\" is not the \"9000\" {right}"),
    );
    wrong(
        &with(&format!(r#"{one}<Bus moos="boat:9001"/>"#)),
        &[],
        &format!("MOOSHost: \"localhost\" is not the \"boat\" {right}"),
    );
    wrong(&with(""), &["Map.MOOSPort=many"], "MOOSHost and MOOSPort: \"localhost:many\" is no address to listen at");
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
        "<Sensor type=\"Simulator\">  A depth camera in a world of triangles.\n    MOOSPoseVarName  Variable of its pose.\n"
    ));
    assert!(text.contains("(a whole number from 1 to 1024; default: 4)"));
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

#[test]
fn a_mission_written_down_again_is_the_same_mission() {
    let more = "<App name=\"Mine\" exec=\"./mine\" args=\"-v\" restart=\"always\" restarts=\"3\"><K>a &lt; b</K></App>";
    let piped = "<App name=\"Mine\" pipe=\"./mine.py 'two words' it\\'s &quot;&quot;\"><K>1</K></App>";
    let sets = ["Map.Res=0.05", "Explorer.type=ClosestFrontier"];
    for (text, sets) in [
        (LISTING_2.to_owned(), vec![]),
        (with(more), sets.to_vec()),
        (with(piped), vec![]),
        (with("<Logger type=\"none\"/>"), vec![]),
    ] {
        let mission = parse(&text, &sets).unwrap();
        let again = parse(&mission.to_xml(&|_, _| false), &[]).unwrap();
        assert_eq!((&again.name, again.mode, again.broker), (&mission.name, mission.mode, mission.broker));
        assert_eq!(again.apps.len(), mission.apps.len());
        for (one, other) in again.apps.iter().zip(&mission.apps) {
            assert_eq!((&one.name, &one.element, one.type_name()), (&other.name, &other.element, other.type_name()));
            assert_eq!((&one.settings, one.policy), (&other.settings, other.policy));
            if let (Program::Foreign { exec, args, via }, Program::Foreign { args: others, via: was, .. }) =
                (&one.program, &other.program)
            {
                assert!(exec.is_absolute() && args == others && via == was);
                assert_eq!(args.len(), if *via == Via::Lines { 3 } else { 1 });
            }
        }
    }
}
