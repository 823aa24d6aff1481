//! The commands over a community in memory: what they say, and to whom.

use std::sync::atomic::AtomicBool;

use elk_bus::broker::table::{ClockEntry, VariableKind};
use elk_bus::memory::MemoryBroker;
use elk_bus::{BrokerConfig, Client, Clock, Community, Origin, TypeRef, ValueRef};
use serde_json::{Value, json};

use crate::{Drawing, Echo, Info, List, Output, Pattern, Scope, ScopeError, Screen, Top, graph};

/// A community in memory.
pub(crate) struct Lab(MemoryBroker);

impl Lab {
    pub fn new() -> Self {
        Self::with_mailboxes_of(4 << 20)
    }

    fn with_mailboxes_of(mailbox_bytes: usize) -> Self {
        let config = BrokerConfig { mailbox_bytes, ..BrokerConfig::new("lab") };
        Self(MemoryBroker::new(config, Clock::new(1.0)))
    }

    pub fn client(&self, name: &str) -> Client {
        Client::over(self.0.connect(name).unwrap(), name, &Community::new("lab").unwrap())
    }

    pub fn scope(&self, name: &str) -> Scope {
        Scope::over(self.client(name))
    }

    /// Map and Sensor, who talk to each other; the sensor's value is of a type that elk does not know.
    fn with_two_apps(&self) -> [Client; 2] {
        let (mut sensor, mut map) = (self.client("Sensor"), self.client("Map"));
        map.comms.register(elk_bus::any("SC*").from("Sensor").every(std::time::Duration::from_millis(500))).unwrap();
        map.comms.notify("MAP_SIZE", 12.0).unwrap();
        map.comms.notify("MAP_STATUS", "Uptime=3").unwrap();
        map.comms.flush().unwrap();
        sensor.comms.register("MAP_SIZE").unwrap();
        let scan = ValueRef::Binary { type_: TypeRef::undescribed("Theirs", 1), bytes: &[7; 20] };
        sensor.comms.publish_value("SCAN", scan, Origin::default()).unwrap();
        sensor.comms.flush().unwrap();
        [sensor, map]
    }
}

fn any() -> Pattern {
    Pattern::any()
}

fn said(run: impl FnOnce(&mut Output<'_>) -> Result<(), ScopeError>) -> Result<String, String> {
    let mut to = Vec::new();
    run(&mut Output::new(&mut to, None)).map_err(|error| error.to_string())?;
    Ok(String::from_utf8(to).unwrap())
}

fn parsed(said: Result<String, String>) -> Value {
    serde_json::from_str(&said.unwrap()).unwrap()
}

fn never() -> AtomicBool {
    AtomicBool::new(false)
}

#[test]
fn a_list_says_who_is_there_and_what_was_said() {
    let lab = Lab::new();
    let _apps = lab.with_two_apps();
    let list = |pattern: &str, json| {
        let list = List { pattern: pattern.parse().unwrap(), json };
        said(|output| list.run(&mut lab.scope("list"), output))
    };
    let text = list("*", false).unwrap();
    assert!(text.starts_with("community lab: clients Sensor Map\nVARIABLE"), "{text}");
    assert!(text.contains("Theirs (layout 0000000000000001), 20 bytes: 07 07"), "{text}");
    let json = parsed(list("MAP*", true));
    let names: Vec<&Value> = json["variables"].as_array().unwrap().iter().map(|one| &one["name"]).collect();
    assert_eq!(names, ["MAP_SIZE", "MAP_STATUS"]);
    assert_eq!((&json["variables"][0]["value"], &json["variables"][0]["writer"]), (&json!(12.0), &json!("Map")));
    assert!(list("X*", false).unwrap().ends_with("no variables\n"));
    assert_eq!(list("MAP_SZIE", false).unwrap_err(), "nobody has written a variable MAP_SZIE; did you mean MAP_SIZE?");
}

#[test]
fn an_echo_begins_with_the_latest_values_if_it_is_told_to_and_ends_after_its_count() {
    let lab = Lab::new();
    let _apps = lab.with_two_apps();
    let echo = |patterns: &[&str], source: &str, count, json| {
        let patterns = patterns.iter().map(|pattern| pattern.parse().unwrap()).collect();
        let echo = Echo { patterns, source: source.parse().unwrap(), latest: true, count: Some(count), json };
        said(|output| echo.run(&mut lab.scope("echo"), output, &never()))
    };
    let lines = echo(&["*SIZE", "SCAN"], "*", 2, true).unwrap();
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(
        (&lines[0]["key"], &lines[0]["type"], &lines[0]["value"]),
        (&json!("MAP_SIZE"), &json!("number"), &json!(12.0))
    );
    assert_eq!((&lines[0]["latest"], &lines[0]["sequence"]), (&json!(true), &json!(1)));
    assert_eq!((&lines[1]["key"], &lines[1]["value"]["bytes"]), (&json!("SCAN"), &json!(20)));
    let line = echo(&["*"], "Sens?r", 1, false).unwrap();
    assert!(line.contains("SCAN             Sensor       Theirs (layout"), "{line}");
}

#[test]
fn an_echo_that_is_told_to_stop_stops() {
    let lab = Lab::new();
    let echo = Echo { patterns: vec![any()], source: any(), latest: false, count: None, json: false };
    assert_eq!(said(|output| echo.run(&mut lab.scope("echo"), output, &AtomicBool::new(true))).unwrap(), "");
}

#[test]
fn what_an_echo_missed_is_said() {
    let (messages, kept) = (500, 73);
    let lab = Lab::with_mailboxes_of(4096);
    let echo =
        Echo { patterns: vec!["N".parse().unwrap()], source: any(), latest: false, count: Some(kept), json: true };
    let lines = std::thread::scope(|threads| {
        let echoing = threads.spawn(|| said(|output| echo.run(&mut lab.scope("echo"), output, &never())).unwrap());
        let mut asker = lab.scope("asker");
        while asker.table().unwrap().clients.iter().all(|client| client.registrations.is_empty()) {}
        let mut talker = lab.client("talker");
        (0..messages).for_each(|i| talker.comms.notify("N", format!("{i:4}")).unwrap());
        talker.comms.flush().unwrap();
        echoing.join().unwrap()
    });
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len() as u64, kept + 1);
    assert_eq!((&lines[0]["value"], &lines[72]["value"]), (&json!(" 427"), &json!(" 499")), "the newest are kept");
    assert_eq!(lines[73], json!({"missed": 427}));
}

#[test]
fn a_terminal_is_given_no_more_lines_than_a_person_could_want() {
    let lab = Lab::new();
    let stop = AtomicBool::new(false);
    let echo = Echo { patterns: vec!["N".parse().unwrap()], source: any(), latest: false, count: None, json: false };
    let text = std::thread::scope(|threads| {
        let echoing = threads.spawn(|| {
            let (mut to, screen) = (Vec::new(), Screen { columns: 80, rows: 24 });
            echo.run(&mut lab.scope("echo"), &mut Output::new(&mut to, Some(screen)), &stop).unwrap();
            String::from_utf8(to).unwrap()
        });
        let mut asker = lab.scope("asker");
        while asker.table().unwrap().clients.iter().all(|client| client.registrations.is_empty()) {}
        let mut talker = lab.client("talker");
        (0..20_000).for_each(|i| talker.comms.notify("N", f64::from(i)).unwrap());
        talker.comms.flush().unwrap();
        let echo = |table: &elk_bus::broker::table::CommunityTable| {
            table.clients.iter().any(|client| client.name == "echo" && client.waiting_bytes > 0)
        };
        while echo(&asker.table().unwrap()) {}
        stop.store(true, std::sync::atomic::Ordering::Relaxed);
        echoing.join().unwrap()
    });
    let shown = text.lines().filter(|line| line.contains("talker")).count();
    let missed = text.lines().filter_map(|line| line.strip_prefix("… ")?.split(' ').next()?.parse::<usize>().ok());
    assert_eq!(shown + missed.sum::<usize>(), 20_000, "what was not shown was said");
    assert!(shown < 20_000);
}

#[test]
fn info_tells_of_a_client_and_of_a_variable() {
    let lab = Lab::new();
    let _apps = lab.with_two_apps();
    let info = |name: &str, json| {
        let info = Info { pattern: name.parse().unwrap(), json };
        said(|output| info.run(&mut lab.scope("info"), output))
    };
    let map = info("Map", false).unwrap();
    for line in [
        "Map: a client of community lab\n",
        "  writes      MAP_SIZE, MAP_STATUS\n",
        "  registered  SC* from Sensor every 500 ms\n",
        "  reads       SCAN\n",
        "  status      Uptime=3\n",
    ] {
        assert!(map.contains(line), "{line:?} is not in {map}");
    }
    let scan = info("SCAN", false).unwrap();
    assert!(scan.contains("carries     Theirs (layout 0000000000000001; nobody has described it)"), "{scan}");
    assert!(scan.contains("written     once, last by Sensor") && scan.contains("  Sensor tells Map\n"), "{scan}");
    let json = parsed(info("MAP_SIZE", true));
    assert_eq!((&json["client"], &json["variable"]["value"]), (&Value::Null, &json!(12.0)));
    assert_eq!(json["variable"]["routes"], json!([{"source": "Map", "readers": ["Sensor"]}]));
    assert_eq!(info("SCX", false).unwrap(), "SCX: nobody has written it yet; waiting for it: Map\n");
    let some = info("MAP_S*", false).unwrap();
    assert!(some.starts_with("MAP_SIZE: a variable") && some.contains("\n\nMAP_STATUS: a variable"), "{some}");
    assert_eq!(info("M*", true).unwrap().lines().count(), 3, "the client Map, too");
    assert_eq!(info("X*", false).unwrap(), "");
    let error = info("Mop", false).unwrap_err();
    assert_eq!(error, "there is no client and no variable Mop; did you mean Map?");
}

#[test]
fn info_tells_of_both_if_both_have_the_name_and_shows_long_values_whole() {
    let lab = Lab::new();
    let mut both = lab.client("BOTH");
    both.comms.notify("BOTH", "long ".repeat(1000)).unwrap();
    both.comms.flush().unwrap();
    let info = Info { pattern: "BOTH".parse().unwrap(), json: true };
    let json = parsed(said(|output| info.run(&mut lab.scope("info"), output)));
    assert_eq!(json["client"]["name"], "BOTH");
    assert_eq!(json["variable"]["value"].as_str().unwrap().len(), 5000);
}

#[test]
fn a_graph_says_who_says_what_to_whom() {
    let lab = Lab::new();
    let [sensor, _map] = lab.with_two_apps();
    let drawn = |drawing| said(|output| graph(&mut lab.scope("graph"), output, drawing)).unwrap();
    let text = "Map\n  MAP_SIZE    → Sensor\n  MAP_STATUS  → nobody\nSensor\n  SCAN  → Map\n";
    assert_eq!(drawn(Drawing::Text), text);
    assert_eq!(
        drawn(Drawing::Dot),
        "digraph \"lab\" {\n  rankdir=LR; node [shape=box];\n  \"Sensor\";\n  \"Map\";\n  \
         \"Map\" -> \"Sensor\" [label=\"MAP_SIZE\"];\n  \"Sensor\" -> \"Map\" [label=\"SCAN\"];\n}\n"
    );
    let json: Value = serde_json::from_str(&drawn(Drawing::Json)).unwrap();
    assert_eq!(json["says"][0], json!({"writer": "Map", "variable": "MAP_SIZE", "readers": ["Sensor"]}));
    drop(sensor);
    assert!(drawn(Drawing::Text).contains("Sensor (gone)\n  SCAN  → Map"));
}

#[test]
fn top_shows_what_happened_since_the_page_before() {
    let lab = Lab::new();
    let [mut sensor, _map] = lab.with_two_apps();
    let mut asker = lab.scope("top");
    let before = asker.table().unwrap();
    (0..5).for_each(|_| sensor.comms.notify("BEAT", 1.0).unwrap());
    sensor.comms.flush().unwrap();
    let mut after = asker.table().unwrap();
    after.time = before.time + 2.0;
    let json = crate::top::change_as_json(&before, &after);
    let first = &json["variables"][0];
    assert_eq!(
        (&first["name"], &first["rate_hz"], &first["bytes_per_sec"]),
        (&json!("BEAT"), &json!(2.5), &json!(20.0))
    );
    assert_eq!((&json["clients"][0]["name"], &json["clients"][0]["says_hz"]), (&json!("Sensor"), &json!(2.5)));
    let top = Top { count: Some(1), json: false };
    let page = said(|output| top.run(&mut lab.scope("once"), output, &never())).unwrap();
    assert!(page.starts_with("community lab, up") && page.contains("\nSensor ") && page.contains("\nSCAN "), "{page}");
}

/// A broker of another version, or one that is none, may say anything: 66,000 characters once ended `list`, `graph` and `top`.
#[test]
fn names_that_no_broker_should_give_end_nobody_and_reach_no_terminal() {
    let lab = Lab::new();
    let _apps = lab.with_two_apps();
    let before = lab.scope("list").table().unwrap();
    for bad in ["x".repeat(66_000), "\x1b[2J\u{9b}31m\u{202e}\n".into(), "ä".repeat(70_000), String::new()] {
        let mut table = before.clone();
        table.community.clone_from(&bad);
        for client in &mut table.clients {
            client.name.clone_from(&bad);
            client.writes = vec![bad.clone(); 3];
            client.latency.mean_secs = f64::NAN;
        }
        for variable in &mut table.variables {
            variable.name.clone_from(&bad);
            variable.writer.clone_from(&bad);
            variable.kind = VariableKind::Typed { name: bad.clone(), layout: 7 };
            (variable.rate_hz, variable.written) = (f64::INFINITY, -1e308);
            for route in &mut variable.routes {
                (route.source, route.readers) = (bad.clone(), vec![bad.clone(); 3]);
            }
        }
        table.clock = Some(ClockEntry { driver: bad.clone(), time: 1e300, rate: f64::NAN });
        let variables: Vec<_> = table.variables.iter().collect();
        let lines = |page: Vec<String>| page.into_iter().map(crate::Line::from).collect::<Vec<_>>();
        let pages = [
            crate::list::as_text(&table, &variables, None),
            lines(crate::graph::drawn(&table)),
            crate::top::change_as_text(&before, &table),
            lines(crate::info::client_as_text(&table, &table.clients[0], Some(&bad))),
            lines(crate::info::variable_as_text(&table, variables[0], None)),
        ];
        for page in pages {
            let mut to = Vec::new();
            Output::new(&mut to, Some(Screen { columns: 80, rows: 100 })).page(&page).unwrap();
            let mut piped = Vec::new();
            Output::new(&mut piped, None).page(&page).unwrap();
            let shown = String::from_utf8(to).unwrap().replace("\r\x1b[2K", "").replace("\x1b[J", "");
            let piped = String::from_utf8(piped).unwrap();
            for text in [shown, piped] {
                let ruled = text.chars().find(|c| *c != '\n' && (c.is_control() || *c == '\u{202e}'));
                assert!(ruled.is_none() && text.lines().count() == page.len(), "{ruled:?} in {text}");
            }
        }
    }
}
