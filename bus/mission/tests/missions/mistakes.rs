//! What is wrong, and what it is answered with.

use std::path::Path;

use elk_mission::{AppType, Kind, Mission, MissionError, Override, Registry};

use crate::table::{param, parse, registry, unbuilt, with, wrong};

/// Regression: it was said when the sensor started.
#[test]
fn what_refines_nothing_is_a_mistake_with_its_place() {
    static TYPES: &[AppType] = &[AppType {
        element: "Filter",
        name: "Refining",
        summary: "Makes poses better.",
        params: &[
            param("PoseEstimator", Kind::Choice(&["none", "Odometry"]), Some("none"), "Estimates."),
            param(
                "Refine",
                Kind::Refinement { words: &["none", "ICP"], of: "PoseEstimator" },
                Some("none"),
                "Refines.",
            ),
        ],
        build: unbuilt,
        preflight: None,
    }];
    let registry: Registry = TYPES.iter().chain(registry().types()).collect();
    let said = |line: &str, sets: &[&str]| {
        let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
        Mission::parse(&with(line), Path::new("m.xml"), &registry, &sets).map(|_| ()).map_err(|error| error.to_string())
    };
    let why = "Refine is ICP, and PoseEstimator is none, of which there is nothing to be made better; right is Refine none, or \
               a PoseEstimator";
    let refining = "<Filter type=\"Refining\"><Refine> ICP </Refine></Filter>";
    assert_eq!(said(refining, &[]), Err(format!("m.xml:7:34: {why}")));
    assert_eq!(said(refining, &["Filter.PoseEstimator=Odometry"]), Ok(()));
    let estimating =
        "<Filter type=\"Refining\"><PoseEstimator> Odometry </PoseEstimator><Refine> ICP </Refine></Filter>";
    assert_eq!(said(estimating, &[]), Ok(()));
    assert_eq!(said(estimating, &["Filter.PoseEstimator=none"]), Err(format!("m.xml:7:75: {why}")));
    assert_eq!(
        said("<Filter type=\"Refining\"/>", &["Filter.Refine=ICP"]),
        Err(format!("--set Filter.Refine=ICP: {why}"))
    );
    let wrong = said("<Filter type=\"Refining\"><Refine> IPC </Refine></Filter>", &[]).unwrap_err();
    assert!(wrong.starts_with("m.xml:7:34: Refine: "), "{wrong}");
}

#[test]
fn every_mistake_has_its_place_and_says_what_would_be_right() {
    for (line, said) in [
        ("<Filtre type=\"Distance\"/>", "m.xml:7:1: <Filtre> is no element of a Scenario; did you mean Filter?"),
        ("<Filter type=\"Distanze\"/>", "m.xml:7:15: Filter has no type \"Distanze\"; did you mean Distance?"),
        ("<Filter/>", "m.xml:7:1: <Filter> has no type; known: Distance"),
        ("<Filter tpye=\"Distance\"/>", "m.xml:7:9: <Filter> has no attribute tpye; did you mean type?"),
        ("<App/>", "m.xml:7:1: <App> has no exec; right is exec=\"program\", or pipe=\"program arguments\""),
        ("<App pipe=\" \"/>", "m.xml:7:12: pipe is empty; right is a program with its arguments"),
        ("<Filter type=\"Distance\" pipe=\"x\"/>", "m.xml:7:15: type and pipe are both said; one is right"),
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
         m.xml:1:23: Scenario has no attribute vers; known: name, type, version, community, launch-pause, broker-restarts, broker-window, mailbox, time-warp\n\
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
    let one = said(&format!("<Scenario>\n<App {}/></Scenario>", "a='1' ".repeat(40_000)));
    assert!(
        one.ends_with("m.xml:2:1: there are 80000 quotes in one element; at most 1000 attributes are right"),
        "{one}"
    );
    // Of what is wrong a hundred thousand times, the first hundred are told.
    let wrong = said(&format!("<Scenario>{}</Scenario>", "<x/>y".repeat(40_000)));
    assert_eq!((wrong.lines().count(), wrong.lines().last().unwrap().contains("there is more")), (101, true));
    // Names that are as long as the file, in one line of half a megabyte.
    let long = "n".repeat(200_000);
    let wrong = said(&format!("<Scenario {long}=\"{long}\"><Filter type=\"{long}\"/></Scenario>"));
    assert!(wrong.len() < 20_000, "{} bytes", wrong.len());
    let attributes: String = (0..900).map(|n| format!(" a{n}=\"{n}\"")).collect();
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
