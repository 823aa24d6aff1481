//! `elk compare`: strategies against each other, as the real program does it.

mod common;

use std::os::unix::fs::PermissionsExt;

use common::events::{Events, end_of};
use common::small::small;
use common::{Elk, kill};
use rustix::process::Signal;

/// An executable that takes an explorer's place, as what type it is told.
fn explorer_script(elk: &Elk, name: &str, type_name: &str) {
    let program = env!("CARGO_BIN_EXE_elk");
    let line = "--name $ELK_NAME --community $ELK_COMMUNITY";
    elk.script(name, &format!("exec {program} explorer --type {type_name} {line} \"$@\"\n"));
}

#[test]
fn strategies_are_compared_over_seeds_and_a_failed_run_is_a_row_that_says_why() {
    let elk = Elk::new("compare");
    std::fs::write(elk.folder().join("mission.xml"), small("manual", "")).unwrap();
    explorer_script(&elk, "mine.sh", "ClosestFrontier");
    elk.script("dies.sh", "echo alas; exit 3\n");
    let strategies = ["compare", "ClosestFrontier", "./mine.sh", "./dies.sh"];
    let out = elk
        .command(&[&strategies[..], &["--seeds", "1..2", "-j", "2", "mission.xml", "-o", "out.csv"]].concat())
        .output()
        .unwrap();
    let (table, said) = (String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
    assert_eq!(out.status.code(), Some(1), "not all are complete: {table}{said}");

    let line = |strategy: &str| table.lines().find(|line| line.starts_with(strategy)).unwrap_or_default().to_owned();
    assert!(line("ClosestFrontier").contains("2 of 2") && line("ClosestFrontier").contains(" ± "), "{table}");
    let measured =
        |strategy: &str| line(strategy).split("2 of 2").nth(1).map(|rest| rest.split("  ").take(3).collect::<String>());
    assert_eq!(measured("ClosestFrontier"), measured("./mine.sh"), "the same strategy, the same way: {table}");
    assert!(line("./dies.sh").contains("0 of 2"), "{table}");
    assert!(
        table.contains("./dies.sh, seed 2: NOT complete: Explorer ended before it registered: exit code 3"),
        "{table}"
    );

    // A folder as runs have it: of its owner alone, called after the mission and the second.
    let folder = elk.run();
    assert!(folder.file_name().unwrap().to_str().unwrap().starts_with("compare-mission-20"), "{}", folder.display());
    assert_eq!(folder.metadata().unwrap().permissions().mode() & 0o777, 0o700);
    let csv = std::fs::read_to_string(elk.folder().join("out.csv")).unwrap();
    let rows: Vec<&str> =
        csv.lines().filter(|row| !row.starts_with(' ') && row.contains(",1,") | row.contains(",2,")).collect();
    assert!(rows[0].starts_with("ClosestFrontier,1,true,"), "{csv}");
    assert!(csv.contains("\n./mine.sh,2,true,") && csv.contains("\n./dies.sh,1,false,,,,"), "{csv}");
}

/// Regression: a mission that says something to one strategy alone was refused by all others, and a parameter could only be
/// the same for all.
#[test]
fn a_strategy_has_parameters_of_its_own_and_is_not_told_those_of_others() {
    let elk = Elk::new("compare-parameters");
    let text = small("auto", "").replace("\"ClosestFrontier\">", "\"Potential\"><Solver>jacobi</Solver>");
    std::fs::write(elk.folder().join("mission.xml"), text).unwrap();
    std::fs::write(elk.folder().join("other.xml"), small("auto", "")).unwrap();
    explorer_script(&elk, "mine.sh", "Potential");
    let compare = |arguments: &[&str]| {
        let out = elk.command(&[&["compare"], arguments].concat()).output().unwrap();
        let said = String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
        assert!(out.status.success(), "{said}");
        said
    };
    let said =
        compare(&["ClosestFrontier", "Potential Start=flux Solver=multigrid", "./mine.sh Start=flux", "mission.xml"]);
    let line = |strategy: &str| said.lines().any(|line| line.starts_with(strategy) && line.contains("1 of 1"));
    assert!(line("Potential Start=flux Solver=multigrid") && line("./mine.sh Start=flux"), "{said}");
    assert!(said.contains("note: ClosestFrontier: what mission.xml says is left out: Solver=jacobi\n"), "{said}");
    let settings = |logs: &str, number: usize| {
        let place = elk.run_in(elk.folder().join(logs)).join(format!("run-{number:03}"));
        let run = std::fs::read_dir(place).unwrap().map(|entry| entry.unwrap().path()).find(|path| path.is_dir());
        common::summary_of(&run.unwrap())["settings"].as_str().unwrap().to_owned()
    };
    let [two, three] = [2, 3].map(|number| settings("logs", number));
    assert!(two.contains("largest flux; field by multigrid"), "{two}");
    assert!(three.contains("largest flux; field by Jacobi"), "{three}");

    // What is said for all is for all of these, whatever explorer the file names; and one's own words go before it.
    let said = compare(&[
        "./mine.sh",
        "./mine.sh Start=flux",
        "other.xml",
        "--set",
        "Explorer.Start=shortest",
        "--log-dir",
        "more",
    ]);
    assert!(said.contains("all rows are in "), "{said}");
    let starts = [1, 2].map(|number| settings("more", number));
    assert!(starts[0].contains("the shortest of 26") && starts[1].contains("largest flux"), "{starts:?}");
}

#[test]
fn a_comparison_that_cannot_be_right_starts_nothing() {
    let elk = Elk::new("compare-wrong");
    std::fs::write(elk.folder().join("mission.xml"), small("auto", "")).unwrap();
    let app = "<App name=\"Lamp\" exec=\"./no-lamp\"/>";
    std::fs::write(elk.folder().join("lamp.xml"), small("auto", app)).unwrap();
    for (arguments, right) in [
        (vec!["Potential", "lamp.xml"], "Potential: Lamp: ./no-lamp cannot be run: No such file or directory"),
        (
            vec!["Potential", "mission.xml", "--set", "Sensor.Seed=5", "--seeds", "1..2"],
            "--seeds and --set Sensor.Seed=5 both say the seed; one of them is right",
        ),
        (
            vec!["Potential", "mission.xml", "--seeds", "1,18446744073709551615"],
            "--set Sensor.Seed=18446744073709551615: ",
        ),
        (vec!["./mine", "Climb=2", "mission.xml"], "right is a parameter in quotes with its strategy"),
        (
            vec!["Potential Climb=2", "mission.xml"],
            "Potential Climb=2: --set Explorer.Climb=2: Explorer Potential has no parameter Climb",
        ),
        (vec!["Potental", "mission.xml"], "Potental is no strategy; did you mean Potential?"),
        (vec!["./none", "mission.xml"], "./none cannot be run: No such file or directory"),
        (vec!["mission.xml"], "mission.xml alone: right is one strategy at least, and then the mission"),
        (vec!["Potential", "none.xml"], "cannot read the mission file none.xml"),
    ] {
        let out = elk.command(&[&["compare"][..], &arguments].concat()).output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.code() == Some(1) && said.contains(right), "{said}");
    }
    assert!(!elk.folder().join("logs").exists());
}

#[test]
fn ctrl_c_ends_all_runs_and_what_there_is_is_shown() {
    let elk = Elk::new("compare-stop");
    std::fs::write(elk.folder().join("mission.xml"), small("auto", "")).unwrap();
    // An explorer that never has a plan: the run would wait for it.
    let client = elk.idle_client("Explorer");
    let joined = elk.folder().join("joined");
    let command = client.1.replace(&format!("--community {}", elk.community()), "--community $ELK_COMMUNITY");
    elk.script("waits.sh", &format!("echo $$ >>{}\nexec {} {command}\n", joined.display(), client.0));
    let events = Events::in_folders([elk.folder()]);
    let mut command =
        elk.command(&["compare", "./waits.sh", "mission.xml", "--seeds", "1..3", "-j", "2", "-o", "out.csv"]);
    let out = std::fs::File::create(elk.folder().join("said.txt")).unwrap();
    let mut compare = command.stdout(out.try_clone().unwrap()).stderr(out).spawn().unwrap();
    let explorers = || -> Vec<i32> {
        let said = std::fs::read_to_string(&joined).unwrap_or_default();
        said.lines().filter_map(|line| line.parse().ok()).collect()
    };
    events.wait_until("two explorers", || explorers().len() == 2);
    kill(compare.id() as i32, Signal::INT);
    let status = end_of(&mut compare).unwrap();
    let said = std::fs::read_to_string(elk.folder().join("said.txt")).unwrap();
    assert_eq!(status.code(), Some(1), "{said}");
    assert!(explorers().iter().all(|id| !common::alive(*id)), "{said}");
    assert!(said.contains("seed 3: NOT complete: stopped before it began"), "{said}");
    assert_eq!(std::fs::read_to_string(elk.folder().join("out.csv")).unwrap().lines().count(), 4, "{said}");
}
