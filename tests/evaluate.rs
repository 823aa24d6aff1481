//! `elk evaluate`: a suite from its file to its report, as the real program does it.

mod common;

use std::path::Path;
use std::process::Output;

use common::car::car;
use common::events::end_of;
use common::{Elk, kill, said, summary_of};
use elk_spatial::keys::PROGRESS;
use rustix::process::Signal;

/// Coarse voxels and few pixels, so that a run is over in a moment.
const COARSE: &str = "Map.Res=\"0.25\" Explorer.Res=\"0.25\" Sensor.Width=\"24\" Sensor.Height=\"24\"";

/// Two strategies in the car, and what else is in the suite.
fn suite(starts: u32, more: &str) -> String {
    format!(
        "<Suite name=\"test\" starts=\"{starts}\" seed=\"5\">\n    <World name=\"car\" mission=\"car.xml\" {COARSE}/>\n    \
         <Explorer type=\"ClosestFrontier\"/>\n    <Explorer name=\"pot\" type=\"Potential\" Policy=\"elk\"/>\n    {more}\n</Suite>\n"
    )
}

fn elk(test: &str, suite: &str) -> Elk {
    let elk = Elk::new(test);
    std::fs::write(elk.folder().join("car.xml"), car("auto")).unwrap();
    std::fs::write(elk.folder().join("suite.xml"), suite).unwrap();
    elk
}

fn evaluate(elk: &Elk, arguments: &[&str]) -> Output {
    elk.command(&[&["evaluate"], arguments].concat()).output().unwrap()
}

fn text(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
}

/// The named cell of a row of a CSV file without quotes.
fn cell<'a>(csv: &'a str, row: usize, name: &str) -> &'a str {
    let column = csv.lines().next().unwrap().split(',').position(|head| head == name).unwrap();
    csv.lines().nth(row).unwrap().split(',').nth(column).unwrap()
}

#[test]
fn a_suite_comes_to_the_same_on_one_thread_and_on_two_and_from_where_it_was_cut_off() {
    let elk = elk("evaluate", &suite(2, ""));
    let results = |name: &str| elk.folder().join(name);
    for (jobs, folder) in [("1", "one"), ("2", "two")] {
        let out = evaluate(&elk, &["suite.xml", "-j", jobs, "-o", folder]);
        assert!(out.status.success() && said(&out).contains("4 of 4 runs\n"), "{}", said(&out));
    }
    let runs = text(&results("one"), "runs.csv");
    assert_eq!(runs, text(&results("two"), "runs.csv"));
    assert_eq!(runs.lines().count(), 5, "{runs}");
    for file in ["table.md", "curves.svg", "paths-car.svg", "report.html", "times.csv", "traces/00004.csv"] {
        assert!(!text(&results("one"), file).is_empty(), "{file}");
    }
    let report = text(&results("one"), "report.html");
    let outside = report.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    assert!(!outside.contains("http") && report.contains("<table>") && report.contains("<polyline"), "all by itself");

    // It is killed while it writes its third row.
    let half: String = runs.split_inclusive('\n').take(4).collect();
    std::fs::write(results("two").join("runs.csv"), &half[..half.len() - 9]).unwrap();
    let out = evaluate(&elk, &["suite.xml", "-o", "two"]);
    assert!(out.status.success() && said(&out).contains("4 of 4 runs, 2 of them from before"), "{}", said(&out));
    assert!(said(&out).contains("[4/4]") && !said(&out).contains("[2/4]"), "{}", said(&out));
    assert_eq!(runs, text(&results("two"), "runs.csv"));

    std::fs::write(elk.folder().join("suite.xml"), suite(2, "<Limits scans=\"700\"/>")).unwrap();
    let out = evaluate(&elk, &["suite.xml", "-o", "two"]);
    assert_eq!(out.status.code(), Some(1));
    assert!(said(&out).contains("are of another suite") && said(&out).contains("700"), "{}", said(&out));
    assert_eq!(runs, text(&results("two"), "runs.csv"));
}

/// Of several strategies, one of them a program of its own: after each scan the same way, at the end the same summary, and the same
/// map voxel for voxel.
#[test]
fn a_run_is_what_the_mission_of_processes_is() {
    let program = format!("{} explorer --type ClosestFrontier", env!("CARGO_BIN_EXE_elk"));
    let more = format!(
        "<Explorer type=\"Tour\"/>\n    <Explorer type=\"Random\"/>\n    <Explorer name=\"own\" exec=\"{program}\"/>"
    );
    let elk = elk("evaluate-same", &suite(1, &more));
    let out = evaluate(&elk, &["suite.xml", "-o", "out"]);
    assert!(out.status.success(), "{}", said(&out));
    let results = elk.folder().join("out");
    let csv = text(&results, "runs.csv");
    for (row, strategy, runs) in [
        (1, "ClosestFrontier", "type=ClosestFrontier"),
        (2, "pot", "type=Potential"),
        (3, "Tour", "type=Tour"),
        (4, "Random", "type=Random"),
    ] {
        assert_eq!((cell(&csv, row, "strategy"), cell(&csv, row, "end")), (strategy, "complete"), "{csv}");
        let logs = format!("{strategy}-logs");
        let mut sets: Vec<String> =
            COARSE.split(' ').map(|set| set.replace('"', "")).chain([format!("Explorer.{runs}")]).collect();
        let number = |name: &str| cell(&csv, row, name);
        sets.push(format!("Sensor.Start={}; {}; {}", number("x_m"), number("y_m"), number("z_m")));
        sets.push(format!("Sensor.StartYaw={}", number("yaw_deg")));
        sets.push(format!("Sensor.StartPitch={}", number("pitch_deg")));
        let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set.as_str()]).collect();
        let launch = [&["launch", "car.xml", "--headless", "--log-dir", &logs], &sets[..]].concat();
        let out = elk.command(&launch).output().unwrap();
        assert!(out.status.success(), "{}", said(&out));
        same_run(&elk.run_in(&logs), &csv, row, &text(&results, &format!("traces/{row:05}.csv")));
    }
    // But for who explores, and why it says to have ended, the program's row is that of the type.
    let of = |row: usize| csv.lines().nth(row).unwrap().splitn(4, ',').last().unwrap();
    assert_eq!(cell(&csv, 5, "strategy"), "own");
    assert_eq!(of(5), of(1));
    assert_eq!(text(&results, "traces/00005.csv"), text(&results, "traces/00001.csv"));
}

/// A mission's run is that of a row of an evaluation, by its summary, its map, and the way after each scan.
fn same_run(run: &Path, csv: &str, row: usize, trace: &str) {
    let summary = summary_of(run);
    for (ours, theirs) in [
        ("scans", "scans"),
        ("way_m", "path_length_m"),
        ("plans", "plans"),
        ("known_voxels", "known_voxels"),
        ("contacts", "contacts"),
    ] {
        assert_eq!(cell(csv, row, ours).parse::<f64>().ok(), summary[theirs].as_f64(), "{ours}: {csv}\n{summary}");
    }
    assert_eq!(Some(cell(csv, row, "reason")), summary["reason"].as_str(), "{summary}");
    let scene = elk_picture::Scene::from_log(elk_log::LogReader::open(&run.join("log.mcap")).unwrap()).unwrap();
    assert_eq!(cell(csv, row, "map"), format!("{:016x}", elk_evaluate::observer::digest(&scene.grid)));
    let mut progress = Vec::new();
    for record in elk_log::LogReader::open(&run.join("log.mcap")).unwrap() {
        let record = record.unwrap();
        if record.key == PROGRESS.name() {
            progress.push(record.value.as_ref().decode(&PROGRESS).unwrap());
        }
    }
    assert_eq!(progress.len() + 1, trace.lines().count(), "{trace}");
    for (n, progress) in progress.iter().enumerate() {
        let number = |name: &str| cell(trace, n + 1, name).parse::<f64>().unwrap();
        assert_eq!(
            (number("way_m"), number("scans")),
            (progress.path_length_m, progress.scans as f64),
            "after scan {n}"
        );
        let at = scene.scans[progress.scans as usize - 1].position();
        assert_eq!([number("x_m"), number("y_m"), number("z_m")], [at.x, at.y, at.z], "at scan {n}");
    }
}

/// The map of a noisy run is held against that of the run without noise; one that believes depth to be exact is worse.
#[test]
fn a_noisy_map_is_held_against_an_exact_one() {
    let noise = "Sensor.NoiseSigma=\"1\" Sensor.NoisePixel=\"stereo\"";
    let world =
        |name: &str, more: &str| format!("<World name=\"{name}\" mission=\"car.xml\" {COARSE} {noise} {more}/>");
    let more = world("noisy", "") + &world("naive", "Map.DepthError=\"none\"");
    let elk = elk("evaluate-noise", &suite(1, &more));
    let out = evaluate(&elk, &["suite.xml", "-o", "out"]);
    assert!(out.status.success(), "{}", said(&out));
    let csv = text(&elk.folder().join("out"), "runs.csv");
    let share = |row: usize, name: &str| cell(&csv, row, name).parse::<f64>().unwrap();
    for (noisy, naive) in [(3, 5), (4, 6)] {
        assert_eq!((cell(&csv, noisy, "world"), cell(&csv, naive, "world")), ("noisy", "naive"), "{csv}");
        assert!(share(noisy, "as_exact") > 0.85 && share(naive, "as_exact") < 0.85, "{csv}");
        assert!(share(noisy, "as_exact_of_known") < share(noisy, "as_exact"), "{csv}");
    }
    assert_eq!(cell(&csv, 1, "as_exact"), "", "without noise there is nothing to compare");
    assert!(text(&elk.folder().join("out"), "table.md").contains("| as exact % |"));
}

#[test]
fn what_cannot_be_run_is_said_by_name_and_the_rest_goes_on() {
    let more = "<World name=\"none\" file=\"no-such.obj\"/>\n    <World name=\"unset\" file=\"$ELK_NO_SUCH/a.obj\"/>";
    let elk = elk("evaluate-wrong", &suite(1, more));
    let out = evaluate(&elk, &["suite.xml", "-o", "out"]);
    let words = said(&out);
    assert_eq!(out.status.code(), Some(1), "{words}");
    assert!(
        words.contains("none, start 1, pot: failed: there is no world ") && words.contains("no-such.obj"),
        "{words}"
    );
    assert!(
        words.contains("unset, start 1, pot: failed: ") && words.contains("the variable ELK_NO_SUCH is not set"),
        "{words}"
    );
    let table = text(&elk.folder().join("out"), "table.md");
    assert!(table.contains("| ClosestFrontier | 1 of 1 |"), "{table}");
    assert!(table.contains("| pot | 0 of 1 | – |") && table.contains("no part of any mean: 4"), "{table}");

    for (more, right) in [
        (
            "<Explorer type=\"Potental\"/>",
            "suite.xml:5:5: there is no Explorer of type \"Potental\"; did you mean Potential?",
        ),
        ("<Explorer name=\"x\" type=\"Potential\" Polcy=\"elk\"/>", "suite.xml:5:5: explorer x in world car: "),
        (
            "<World name=\"own\" mission=\"car.xml\" Sensor.Start=\"1; 1; 1\"/>",
            "suite.xml:5:5: world own: Sensor.Start cannot be said: an evaluation draws the starts",
        ),
        ("<World mission=\"no-such.xml\"/>", "suite.xml:5:5: world no-such: cannot read the mission file no-such.xml"),
        ("<Explorer name=\"own\" exec=\"./no-such\"/>", "suite.xml:5:5: explorer own in world car: "),
        ("<Limits scans=\"many\"/>", "suite.xml:5:20: scans is \"many\""),
    ] {
        std::fs::write(elk.folder().join("suite.xml"), suite(1, more)).unwrap();
        let out = evaluate(&elk, &["suite.xml", "-o", "wrong"]);
        assert!(out.status.code() == Some(1) && said(&out).contains(right), "{}", said(&out));
    }
    assert!(!elk.folder().join("wrong").exists(), "nothing was started");
}

/// A program that is on the bus itself and dies, and one that joins and never answers.
#[test]
fn a_program_that_fails_is_a_run_that_failed() {
    let more = "<Explorer name=\"dies\" exec=\"./dies.sh\"/>\n    <Explorer name=\"idles\" exec=\"./idles.sh\"/>\n    \
                <Limits answer=\"3 s\"/>";
    let elk = elk("evaluate-dies", &suite(1, more));
    elk.script("dies.sh", "echo no such luck >&2\nexit 3\n");
    elk.script("idles.sh", "exec sleep 1000\n");
    let out = evaluate(&elk, &["suite.xml", "-o", "out"]);
    let words = said(&out);
    assert_eq!(out.status.code(), Some(1), "{words}");
    let dies = "dies: failed: Explorer ended by itself: exit code 3; its last words: no such luck;";
    assert!(words.contains(dies) && words.contains("pot: complete"), "{words}");
    assert!(
        words.contains("idles: failed: nothing came of the program for 3 s: the explorer does not answer"),
        "{words}"
    );
}

#[test]
fn a_run_that_takes_more_than_it_may_is_capped_and_no_part_of_a_mean() {
    let elk = elk("evaluate-capped", &suite(1, "<Limits scans=\"3\"/>"));
    let out = evaluate(&elk, &["suite.xml", "-o", "out"]);
    assert!(out.status.code() == Some(1) && said(&out).contains("pot: capped: more than 3 scans"), "{}", said(&out));
    let table = text(&elk.folder().join("out"), "table.md");
    assert!(table.contains("| ClosestFrontier | 0 of 1 | – |"), "{table}");
}

#[test]
fn ctrl_c_stops_it_and_the_same_command_goes_on() {
    let elk = elk("evaluate-stop", &suite(40, ""));
    let events = elk.events();
    let mut command = elk.command(&["evaluate", "suite.xml", "-j", "1", "-o", "out"]);
    let file = std::fs::File::create(elk.folder().join("said.txt")).unwrap();
    let mut child = command.stdout(file.try_clone().unwrap()).stderr(file).spawn().unwrap();
    let words = || text(elk.folder(), "said.txt");
    events.wait_until("a run that is done", || words().contains("[1/80]"));
    kill(child.id() as i32, Signal::INT);
    let status = end_of(&mut child).unwrap();
    assert_eq!(status.code(), Some(1), "{}", words());
    assert!(words().contains("of 80 runs are done; the same command goes on from there"), "{}", words());
    let rows = text(&elk.folder().join("out"), "runs.csv").lines().count() - 1;
    assert!((1..80).contains(&rows), "{rows} of 80 runs");
    assert!(!text(&elk.folder().join("out"), "table.md").is_empty(), "what there is is shown");
}
