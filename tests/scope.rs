//! Looks into communities as people do: the real program beside a real broker.

mod common;

use elk_bus::text;
use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Output, Stdio};

use common::lab::{hear, wait_for_reader};
use common::{Elk, kill};
use elk_bus::Client;
use elk_spatial::keys;
use rustix::process::Signal;
use serde_json::{Value, json};

const PROGRESS: &str = r#"{"scan":1,"revision":2,"scans":1,"path_length_m":2.5,"free":8,"finished":false}"#;

/// A community with a broker and nobody else.
struct Lab {
    elk: Elk,
    broker: Child,
}

impl Lab {
    fn new(test: &str) -> Self {
        let elk = Elk::new(test);
        let broker = elk.command(&["db", "--community", elk.community()]).spawn().unwrap();
        drop(elk.join("usher"));
        Self { elk, broker }
    }

    fn arguments<'a>(&'a self, arguments: &[&'a str]) -> Vec<&'a str> {
        [arguments, &["--community", self.elk.community()]].concat()
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.elk.command(&self.arguments(arguments)).output().unwrap()
    }

    /// What a command that succeeds says.
    fn said(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success() && errors.is_empty(), "{arguments:?}: {errors}");
        String::from_utf8(output.stdout).unwrap()
    }

    fn json(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(&self.said(&[arguments, &["--json"]].concat())).unwrap()
    }

    /// The one line that a command fails with.
    fn failed(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), output.stdout.as_slice()), (Some(1), &b""[..]), "{errors}");
        assert_eq!(errors.lines().count(), 1, "{errors}");
        errors.trim_end().to_owned()
    }

    /// Starts a command that goes on.
    fn start(&self, arguments: &[&str]) -> Running {
        let mut command = self.elk.command(&self.arguments(arguments));
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let lines = child.stdout.take().map(BufReader::new);
        Running { child, lines }
    }

    /// An app that reads `PROGRESS`, and so says what type that is.
    fn reader_of_progress(&self) -> Client {
        let mut app = self.elk.join("app");
        app.comms.register(&keys::PROGRESS).unwrap();
        app.comms.flush().unwrap();
        app
    }

    /// Waits until a client whose name begins so has registered.
    fn wait_for_reader(&self, beginning: &str) {
        wait_for_reader(&mut self.elk.join("witness"), |name| name.starts_with(beginning));
    }
}

impl Drop for Lab {
    fn drop(&mut self) {
        let _ = self.broker.kill();
        let _ = self.broker.wait();
    }
}

/// A command that goes on until it is told to stop. Killed, should the test fail before.
struct Running {
    child: Child,
    lines: Option<BufReader<ChildStdout>>,
}

impl Running {
    fn line(&mut self) -> String {
        let mut line = String::new();
        assert!(self.lines.as_mut().unwrap().read_line(&mut line).unwrap() > 0, "it ended");
        line.trim_end().to_owned()
    }

    fn json(&mut self) -> Value {
        serde_json::from_str(&self.line()).unwrap()
    }

    /// As `head` does when it has enough; its exit code.
    fn leave(mut self) -> Option<i32> {
        self.lines = None;
        self.child.wait().unwrap().code()
    }

    /// As Ctrl-C does; its exit code.
    fn interrupt(mut self) -> Option<i32> {
        kill(self.child.id() as i32, Signal::INT);
        self.child.wait().unwrap().code()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn what_was_poked_is_echoed_listed_and_known() {
    let lab = Lab::new("poked");
    let mut echo = lab.start(&["echo", "SPEED", "PROG*", "--json"]);
    lab.wait_for_reader("echo-");
    let _app = lab.reader_of_progress();
    assert!(lab.said(&["poke", "SPEED", "-3.5"]).starts_with("SPEED = -3.5 (number), heard by echo-"));
    assert!(lab.said(&["poke", "OTHER", "unheard"]).ends_with("heard by nobody\n"));
    assert!(lab.said(&["poke", "PROGRESS", PROGRESS]).contains("revision: 2"));
    let first = echo.json();
    assert_eq!((&first["key"], &first["type"], &first["value"]), (&json!("SPEED"), &json!("number"), &json!(-3.5)));
    assert!(first["source"].as_str().unwrap().starts_with("poke-"), "{first}");
    let second = echo.json();
    assert_eq!((&second["type"], &second["value"]), (&json!("Progress"), &serde_json::from_str(PROGRESS).unwrap()));
    let graph = lab.said(&["graph"]);
    assert!(graph.contains("SPEED  → echo-") && graph.contains("OTHER  → nobody"), "{graph}");
    assert!(lab.said(&["graph", "--dot"]).contains("[label=\"SPEED\"];"));
    assert_eq!(echo.interrupt(), Some(0));

    let listed = lab.json(&["list", "*E?D"]);
    assert_eq!(listed["variables"].as_array().unwrap().len(), 1);
    assert_eq!((&listed["variables"][0]["name"], &listed["variables"][0]["value"]), (&json!("SPEED"), &json!(-3.5)));
    assert!(lab.said(&["list"]).contains("scan: 1, revision: 2"));
    let info = lab.said(&["info", "PROGRESS"]);
    assert!(info.contains("written     once, last by poke-") && info.contains("latest      scan: 1"), "{info}");
    let latest = lab.said(&["echo", "SPEED", "--latest", "--count", "1"]);
    assert!(latest.contains("SPEED") && latest.ends_with("-3.5\n"), "{latest}");
}

#[test]
fn a_sensor_that_is_told_by_hand_where_to_look_is_seen_to_answer() {
    let lab = Lab::new("by-hand");
    let world = format!("World={}/mission-files/worlds/car.obj", env!("CARGO_MANIFEST_DIR"));
    let _sensor = lab.start(&["sensor", "--type", "Simulator", &world]);
    lab.wait_for_reader("Sensor");
    let mut echo = lab.start(&["echo", "SCAN", "--json"]);
    let mut bandwidth = lab.start(&["bw", "SCAN", "--window", "3600", "--json"]);
    lab.wait_for_reader("echo-");
    lab.wait_for_reader("bw-");
    // The first value comes as a copy, with the hint to open the sensor's shared memory; the others are read there.
    for id in 1..=3 {
        let command =
            format!(r#"{{"id":{id},"via":[],"pose":{{"rotation":[-0.5,0.5,-0.5,0.5],"translation":[0.1,0.0,0.5]}}}}"#);
        assert!(lab.said(&["poke", "POSE_COMMAND", &command]).ends_with("heard by Sensor\n"));
        let scan = echo.json();
        assert_eq!((&scan["type"], &scan["value"]["command"]), (&json!("Scan"), &json!(id)));
        let points = scan["value"]["points"].as_array().unwrap();
        assert!(points.len() > 1000 && points[0].as_array().unwrap().len() == 3, "{} points", points.len());
    }
    assert_eq!(echo.interrupt(), Some(0));
    let counted = loop {
        let page = bandwidth.json();
        if page["sources"][0]["messages"] == 3 {
            break page["sources"][0].clone();
        }
    };
    assert!(counted["min_bytes"].as_f64().unwrap() > 16384.0, "{counted}");
    let listed = lab.json(&["list", "SCAN"])["variables"][0].clone();
    assert_eq!((&listed["type"], &listed["messages"]), (&json!("Scan"), &json!(3)));
    assert_eq!(listed["bytes"].as_f64(), Some(3.0 * counted["mean_bytes"].as_f64().unwrap()));
    let info = lab.said(&["info", "SCAN"]);
    let points = ["rotation: [-0.5, 0.5, -0.5, 0.5]", " points\n"];
    assert!(points.iter().all(|part| info.contains(part)), "{info}");
}

#[test]
fn clients_are_known_with_what_they_read_and_write() {
    let lab = Lab::new("clients");
    let (program, arguments) = lab.elk.idle_client("Recorder");
    assert_eq!(program, env!("CARGO_BIN_EXE_elk"));
    let mut recorder = lab.elk.command(&arguments.split(' ').collect::<Vec<_>>()).spawn().unwrap();
    lab.wait_for_reader("Recorder");
    let mut witness = lab.elk.join("witness");
    witness.comms.register(text("RECORDER_STATUS")).unwrap();
    hear(&mut witness, "how it is", |_| Some(()));
    drop(witness);
    let info = lab.said(&["info", "Recorder"]);
    for part in ["Recorder: a client", "writes      RECORDER_STATUS", "* (lossless)", "status      AppErrorFlag=false"]
    {
        assert!(info.contains(part), "{part:?} is not in {info}");
    }
    let mission = lab.json(&["graph"]);
    let status = mission["says"].as_array().unwrap().iter().find(|one| one["variable"] == "RECORDER_STATUS").unwrap();
    assert_eq!(status["readers"], json!(["Recorder"]));
    kill(recorder.id() as i32, Signal::TERM);
    assert!(recorder.wait().unwrap().success());
}

#[test]
fn rates_and_tops_come_page_by_page() {
    let lab = Lab::new("pages");
    let mut hz = lab.start(&["hz", "BEAT", "--window", "3600", "--json"]);
    lab.wait_for_reader("hz-");
    (1..=3).for_each(|beat| assert!(lab.said(&["poke", "BEAT", &beat.to_string()]).contains("heard by hz-")));
    let counted = loop {
        let page = hz.json();
        if page["sources"].as_array().is_some_and(|sources| sources.len() == 3) {
            break page;
        }
    };
    assert_eq!((&counted["sources"][0]["messages"], &counted["missed"]), (&json!(1), &json!(0)));
    assert_eq!(hz.interrupt(), Some(0));
    let bw = lab.json(&["bw", "--count", "1"]);
    assert!(bw["sources"].as_array().unwrap().iter().all(|one| one["bytes_per_sec"].as_f64().unwrap() >= 0.0), "{bw}");
    let top = lab.said(&["top", "--count", "2"]);
    let pages: Vec<&str> = top.split("\ncommunity ").collect();
    assert_eq!(pages.len(), 2, "{top}");
    assert!(pages[1].contains("\nBEAT") && pages[1].contains("VARIABLE"), "{top}");
    assert!(lab.json(&["top", "--count", "1"])["variables"].as_array().unwrap().iter().any(|v| v["name"] == "BEAT"));
}

#[test]
fn a_reader_that_has_enough_is_no_failure() {
    let lab = Lab::new("head");
    for arguments in [["top", "--json"].as_slice(), &["hz", "*", "--json"], &["echo", "DB_TIME", "--json"]] {
        let mut running = lab.start(arguments);
        running.line();
        assert_eq!(running.leave(), Some(0), "{arguments:?}");
    }
}

#[test]
fn looks_go_on_when_the_broker_was_killed_and_another_took_its_place() {
    let mut lab = Lab::new("killed");
    let (mut echo, mut top) = (lab.start(&["echo", "SPEED", "--json"]), lab.start(&["top", "--json"]));
    lab.wait_for_reader("echo-");
    lab.said(&["poke", "SPEED", "1"]);
    assert_eq!(echo.json()["value"], 1.0);
    top.json();
    lab.broker.kill().unwrap();
    lab.broker.wait().unwrap();
    lab.broker = lab.elk.command(&["db", "--community", lab.elk.community()]).spawn().unwrap();
    drop(lab.elk.join("usher"));
    lab.wait_for_reader("echo-");
    assert!(lab.said(&["poke", "SPEED", "2"]).contains("heard by echo-"));
    assert_eq!(echo.json()["value"], 2.0);
    let shows_speed = |page: Value| page["variables"].as_array().unwrap().iter().any(|one| one["name"] == "SPEED");
    while !shows_speed(top.json()) {}
    assert_eq!((echo.interrupt(), top.interrupt()), (Some(0), Some(0)));
}

#[test]
fn ctrl_c_ends_an_echo_whose_output_nobody_reads() {
    let lab = Lab::new("blocked");
    let echo = lab.start(&["echo", "LONG"]);
    lab.wait_for_reader("echo-");
    // More than a pipe holds.
    let long = "long ".repeat(20_000);
    (0..3).for_each(|_| assert!(lab.said(&["poke", "LONG", &long]).contains("heard by echo-")));
    assert_eq!(echo.interrupt(), Some(0));
}

#[test]
fn communities_of_the_machine_are_listed() {
    let lab = Lab::new("communities");
    let mut echo = lab.start(&["echo", "DB_TIME"]);
    lab.wait_for_reader("echo-");
    let said = lab.elk.command(&["communities", "--json"]).output().unwrap();
    let all: Value = serde_json::from_slice(&said.stdout).unwrap();
    let ours =
        all["communities"].as_array().unwrap().iter().find(|one| one["community"] == lab.elk.community()).unwrap();
    assert_eq!((&ours["own"], &ours["process"]), (&json!(true), &json!(lab.broker.id())));
    assert!(ours["clients"][0].as_str().unwrap().starts_with("echo-") && ours["uptime_secs"].is_f64(), "{ours}");
    let text = lab.elk.command(&["communities"]).output().unwrap();
    assert!(String::from_utf8(text.stdout).unwrap().contains(lab.elk.community()));
    echo.line();
    assert_eq!(echo.interrupt(), Some(0));
}

#[test]
fn mistakes_are_answered_with_one_line_that_says_what_is_right() {
    let lab = Lab::new("mistakes");
    let _app = lab.reader_of_progress();
    lab.said(&["poke", "SPEED", "1"]);
    lab.said(&["poke", "DONE", PROGRESS, "--type", "Progress"]);
    let failed = |arguments: &[&str]| lab.failed(arguments);
    assert_eq!(failed(&["list", "SPED"]), "elk: nobody has written a variable SPED; did you mean SPEED?");
    assert_eq!(failed(&["info", "SPED"]), "elk: there is no client and no variable SPED; did you mean SPEED?");
    let wrong = failed(&["poke", "SPEED", "fast", "--text"]);
    assert_eq!(wrong, "elk: SPEED carries numbers, not texts; right is, for example, elk poke SPEED 3.5");
    assert!(failed(&["poke", "DONE", "{\"scan\":1}"]).contains("revision is missing; its form is {"));
    assert!(failed(&["poke", "DONE", "{\"scan\"}"]).contains("no JSON: expected `:` at line 1 column 8"));
    assert!(failed(&["poke", "SPEED*", "1"]).contains("is no variable's name"));

    let waiting = lab.start(&["echo", "SPED"]);
    lab.wait_for_reader("echo-");
    lab.said(&["poke", "SPED", "2"]);
    let mut waiting = waiting;
    assert!(waiting.line().ends_with(" 2"), "a variable that comes late is echoed all the same");
    let mut warned = String::new();
    BufReader::new(waiting.child.stderr.take().unwrap()).read_line(&mut warned).unwrap();
    assert_eq!(warned, "elk: nobody has written a variable SPED; did you mean SPEED? (waiting for it)\n");
    assert_eq!(waiting.interrupt(), Some(0));

    let bad = lab.run(&["hz", ""]);
    assert!(!bad.status.success());
    assert!(String::from_utf8(bad.stderr).unwrap().contains("is no name and no pattern"));
    let nobody = lab.elk.command(&["list", "--community", "nobody-serves-this"]).output().unwrap();
    assert_eq!(nobody.status.code(), Some(1));
    let said = String::from_utf8(nobody.stderr).unwrap();
    assert!(said.starts_with("elk: no community nobody-serves-this runs here: running are "), "{said}");
    assert!(said.contains(lab.elk.community()) && said.lines().count() == 1, "{said}");
}
