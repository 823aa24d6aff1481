//! The tutorial of a strategy of one's own: its page is the code that is run here, and elsewhere.

mod common;

use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use common::skip::skip;
use common::{Elk, summary_of};
use serde_json::Value;

const PAGE: &str = include_str!("../docs/strategy.md");
const LOOK: &str = include_str!("../bus/pipe/examples/closest_look.py");

/// The one block of code in this language.
fn block(language: &str) -> String {
    let (_, behind) = PAGE.split_once(&format!("\n```{language}\n")).unwrap_or_else(|| panic!("no {language}"));
    assert!(!behind.contains(&format!("\n```{language}\n")), "one block of {language}");
    behind.split_once("```\n").unwrap().0.to_owned()
}

/// The strategy in Rust is the crate that `elk new explorer` makes: `tests/new.rs` and the guide's commands build and run it.
#[test]
fn the_page_s_code_is_that_of_the_examples() {
    assert_eq!(block("rust"), elk_explorer::EXAMPLE);
    assert_eq!(block("python"), LOOK);
}

#[test]
fn the_separate_program_is_short() {
    let comment = |line: &&str| line.trim().is_empty() || line.trim_start().starts_with('#');
    let lines = LOOK.lines().filter(|line| !comment(line)).count();
    assert!(lines <= 80, "{lines} lines");
}

/// The program that the page shows, in a folder of its own; `None`: there is no Python, and the test is skipped by this name.
fn program(elk: &Elk, test: &str) -> Option<String> {
    if !Command::new("python3").arg("--version").output().is_ok_and(|out| out.status.success()) {
        skip(test, "python3", "python3 does not run");
        return None;
    }
    let file = elk.folder().join("closest_look.py");
    std::fs::write(&file, block("python")).unwrap();
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o755)).unwrap();
    Some(file.display().to_string())
}

fn mission(name: &str) -> String {
    format!("{}/mission-files/{name}.xml", env!("CARGO_MANIFEST_DIR"))
}

fn assert_explored(summary: &Value, explorer: &str) {
    assert_eq!((&summary["complete"], &summary["contacts"]), (&true.into(), &0.into()), "{summary:#}");
    assert_eq!(summary["explorer"], explorer, "{summary:#}");
    assert_eq!(summary["frontiers_left"]["open"], 0, "{summary:#}");
    assert!(summary["accuracy"].as_f64().unwrap() > 0.99, "{summary:#}");
}

#[test]
fn a_separate_program_explores_the_apartment() {
    let elk = Elk::new("strategy-apartment");
    let Some(program) = program(&elk, "strategy apartment") else { return };
    let (file, set) = (mission("apartment"), format!("Explorer.pipe={program}"));
    let launch = ["launch", &file, "--headless", "--community", elk.community(), "--set", &set];
    // Half a minute of computing, which on a busy machine takes several.
    let (code, said) = elk.spawn("said.txt", elk.command(&launch)).end_of_several(5);
    assert_eq!(code, Some(0), "{said}");
    let summary = elk.summary();
    assert_explored(&summary, "closest_look.py");
    // Nearly the 94,758 voxels that are known once nothing is left.
    assert!(summary["known_voxels"].as_u64().unwrap() > 94_000, "{summary:#}");
}

/// It comes late, and asks for the map; another takes over from it in turn.
#[test]
fn a_separate_program_is_swapped_into_a_mission_and_out_of_it() {
    let elk = Elk::new("strategy-swap");
    let Some(program) = program(&elk, "strategy swap") else { return };
    let mut launcher = elk.launch(&common::car::car("manual"));
    launcher.wait_for("Enter takes a step");
    let mut watcher = elk.join("watcher");
    let mut step_until_planned_by = |who: &str| {
        // Each step is said with a pose; the next is asked for until the one who is meant has planned.
        watcher.comms.register(elk_bus::any("PLAN").from("Explorer")).unwrap();
        watcher.comms.register("SIM_SENSOR").unwrap();
        watcher.comms.flush().unwrap();
        elk.obeyed(&["step"]);
        let is_own = |name: &str| (name == "own") == (who == "python");
        common::lab::hear(&mut watcher, who, |mail| {
            if mail.key() == "SIM_SENSOR" {
                elk.obeyed(&["step"]);
                return None;
            }
            let plan = mail.decode(&elk_spatial::keys::PLAN).unwrap();
            (!mail.is_latest() && is_own(&plan.motion.name)).then_some(())
        });
    };
    step_until_planned_by("elk");
    elk.obeyed(&["swap", "Explorer", &format!("pipe={program}")]);
    step_until_planned_by("python");
    elk.obeyed(&["swap", "Explorer", "type=ClosestFrontier"]);
    step_until_planned_by("elk");
    elk.obeyed(&["swap", "Explorer", &format!("pipe={program}")]);
    elk.obeyed(&["resume"]);
    let (code, said) = launcher.end_of_several(5);
    assert_eq!(code, Some(0), "{said}");
    let summary = summary_of(&elk.run());
    assert_eq!((&summary["complete"], &summary["contacts"]), (&true.into(), &0.into()), "{summary:#}");
    assert_eq!(summary["swapped"], serde_json::json!(["Explorer"]), "{summary:#}");
}

/// The named cell of a row of a CSV file without quotes.
fn cell<'a>(csv: &'a str, row: usize, name: &str) -> &'a str {
    let column = csv.lines().next().unwrap().split(',').position(|head| head == name).unwrap();
    csv.lines().nth(row).unwrap().split(',').nth(column).unwrap()
}

/// A suite of coarse voxels in the car.
fn suite(explorers: &str) -> String {
    let coarse = "Map.Res=\"0.25\" Explorer.Res=\"0.25\" Sensor.Width=\"24\" Sensor.Height=\"24\"";
    format!(
        "<Suite name=\"mine\" starts=\"2\" seed=\"5\"><World name=\"car\" mission=\"car.xml\" {coarse}/>{explorers}\
         <Limits answer=\"60 s\"/></Suite>"
    )
}

#[test]
fn a_separate_program_has_its_row_and_the_same_each_time() {
    let elk = Elk::new("strategy-suite");
    let Some(_) = program(&elk, "strategy suite") else { return };
    std::fs::write(elk.folder().join("car.xml"), common::car::car("auto")).unwrap();
    let rows = "<Explorer type=\"ClosestFrontier\"/><Explorer name=\"look\" pipe=\"./closest_look.py\"/>";
    std::fs::write(elk.folder().join("suite.xml"), suite(rows)).unwrap();
    let evaluate = |jobs: &str, folder: &str| {
        let out = elk.command(&["evaluate", "suite.xml", "-j", jobs, "-o", folder]).output().unwrap();
        let said = String::from_utf8_lossy(&out.stdout) + String::from_utf8_lossy(&out.stderr);
        assert!(out.status.success(), "{said}");
        std::fs::read_to_string(elk.folder().join(folder).join("runs.csv")).unwrap()
    };
    let csv = evaluate("1", "one");
    assert_eq!(csv, evaluate("2", "two"));
    assert_eq!((cell(&csv, 2, "strategy"), cell(&csv, 2, "end")), ("look", "complete"), "{csv}");
    let table = std::fs::read_to_string(elk.folder().join("one/table.md")).unwrap();
    assert!(table.contains("| look |"), "{table}");
}

#[test]
fn a_program_that_fails_is_a_run_that_failed_with_its_own_words() {
    let elk = Elk::new("strategy-fails");
    if program(&elk, "strategy fails").is_none() {
        return;
    }
    std::fs::write(elk.folder().join("car.xml"), common::car::car("auto")).unwrap();
    let prelude = "import json, sys\nprint(json.dumps(dict(register='PLAN_REQUEST')), flush=True)\n\
                   print(json.dumps(dict(ready=True)), flush=True)\n";
    let write = |name: &str, body: &str| std::fs::write(elk.folder().join(name), format!("{prelude}{body}\n")).unwrap();
    let on_request = |what: &str| format!("for line in sys.stdin:\n    if 'PLAN_REQUEST' in line: {what}");
    write("raises.py", &on_request("raise ValueError('no idea')"));
    write("ends.py", &on_request("break"));
    write("silent.py", "for line in sys.stdin: pass");
    write("seven.py", &on_request("print(json.dumps(dict(publish='PLAN', value=7)), flush=True)"));
    // Each goes straight to a point, all the time: through what it sees, to no number, and to where no map is.
    let goes = |to: &str| PLANS.replace("TO", to);
    write("wall.py", &goes("x + 3 * a, y + 3 * b, z + 3 * c"));
    write("nan.py", &goes("float('nan'), y, z"));
    write("far.py", &goes("x + 500, y, z"));
    let path = |name: &str| Path::new(elk.folder()).join(name).display().to_string();
    let reasons = [
        ("raises", "ended with exit code 1: ValueError: no idea"),
        ("ends", "Explorer ended by itself"),
        ("silent", "nothing came of the program for 3 s: the explorer does not answer: request 1 has no plan"),
        ("seven", "PLAN was not taken: this is no Plan: the value is 7; it has to be an object with request"),
        ("wall", "Controller rejects PLAN #2 by Explorer: path.points is from ("),
        ("nan", "was not taken: this is no JSON"),
        ("far", "it has to be near what is known of the map"),
    ];
    let rows: String = reasons
        .map(|(name, _)| format!("<Explorer name=\"{name}\" pipe=\"python3 {}\"/>", path(&format!("{name}.py"))))
        .concat();
    let text = suite(&rows).replace("starts=\"2\"", "starts=\"1\"").replace("60 s", "3 s");
    std::fs::write(elk.folder().join("suite.xml"), text).unwrap();
    let out = elk.command(&["evaluate", "suite.xml", "-o", "out"]).output().unwrap();
    assert_eq!(out.status.code(), Some(1), "{out:?}");
    let csv = std::fs::read_to_string(elk.folder().join("out/runs.csv")).unwrap();
    for (row, (name, reason)) in reasons.iter().enumerate() {
        assert_eq!((cell(&csv, row + 1, "strategy"), cell(&csv, row + 1, "end")), (*name, "failed"), "{csv}");
        assert!(csv.lines().nth(row + 1).unwrap().contains(reason), "{name}: {reason}: {csv}");
    }
    let wall = csv.lines().find(|line| line.contains(",wall,")).unwrap();
    assert!(wall.contains("through a wall at (") && wall.contains("that the map calls occupied"), "{wall}");
}

/// The body of a program that answers each request with a straight way to a point.
const PLANS: &str = "for said in map(json.loads, sys.stdin):
    if said.get('mail') == 'PLAN_REQUEST':
        request = said['value']
        x, y, z = request['pose']['translation']
        i, j, k, r = request['pose']['rotation']
        a, b, c = 2 * (i * k + r * j), 2 * (j * k - r * i), 1 - 2 * (i * i + j * j)  # where it looks
        here = dict(zip('xyz', (int(c // 0.25) for c in (x, y, z))))
        go = dict(points=[[x, y, z], [TO]], target=here, unknown=[here], looks=[])
        motion = dict(name='own', scan_spacing_m=0.5, early_stop=False, look_at_target=True, clearance_m=0.1)
        plan = dict(request=request['id'], revision=request['revision'], decision=dict(Go=go), motion=motion, cpu_secs=0.0)
        print(json.dumps(dict(publish='PLAN', value=plan)), flush=True)";
