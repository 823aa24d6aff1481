//! Strategies with every fault there is, evaluated beside one without: each is reported by name, and the rest goes on.

mod common;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use common::registry;
use elk_evaluate::store::{Row, Store};
use elk_evaluate::{End, Evaluation, Missions, Suite};
use elk_explorer::app::{COMMON, app};
use elk_explorer::{Journal, Route, Strategy, View};
use elk_mission::{AppType, Mission, Override};
use nalgebra::Point3;

/// What is wrong with a strategy.
#[derive(Clone, Copy)]
enum Fault {
    /// It goes straight to the farthest goal, whatever lies between.
    Wall,
    /// It does not count.
    Nan,
    /// It has no answer.
    Nothing,
    /// It never answers.
    Hangs,
    /// It panics.
    Panics,
}

struct Faulty(Fault);

impl Strategy for Faulty {
    fn name(&self) -> &'static str {
        "Faulty"
    }

    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        let route = view.closest(journal)?;
        match self.0 {
            Fault::Wall => {
                let away = |goal: &elk_explorer::goals::Goal| (goal.position - view.from).norm();
                let goal = view.goals.iter().max_by(|one, other| away(one).total_cmp(&away(other)))?;
                Some(Route { points: vec![view.from, goal.position], goal: goal.voxel })
            }
            Fault::Nan => Some(Route { points: vec![view.from, Point3::new(f64::NAN, 0.0, 0.0)], ..route }),
            Fault::Nothing => None,
            Fault::Hangs => loop {
                std::thread::park();
            },
            Fault::Panics => panic!("this strategy knows no way out"),
        }
    }
}

/// An explorer of such a strategy.
macro_rules! faulty {
    ($name:literal, $fault:expr) => {
        AppType {
            element: "Explorer",
            name: $name,
            summary: "Has a fault.",
            params: COMMON,
            build: |params| app(params, Box::new(Faulty($fault))),
            preflight: None,
        }
    };
}

static FAULTY: &[AppType] = &[
    faulty!("Wall", Fault::Wall),
    faulty!("Nan", Fault::Nan),
    faulty!("Nothing", Fault::Nothing),
    faulty!("Hangs", Fault::Hangs),
    faulty!("Panics", Fault::Panics),
];

fn no_file(file: &Path, _: &[Override]) -> Result<Mission, String> {
    Err(format!("nobody asked for {}", file.display()))
}

/// These strategies in a coarse kitchen, from so many starts.
fn suite(starts: usize, strategies: &[&str]) -> Suite {
    let explorers: String = strategies.iter().map(|type_name| format!("<Explorer type=\"{type_name}\"/>")).collect();
    let text = format!(
        "<Suite name=\"faults\" starts=\"{starts}\"><Limits scans=\"600\" answer=\"10 s\"/><World file=\"kitchen\" \
         Map.Res=\"0.25\" Explorer.Res=\"0.25\" Sensor.Width=\"24\" Sensor.Height=\"24\" Explorer.Patience=\"20\"/>{explorers}</Suite>"
    );
    Suite::parse(&text, Path::new("faults.xml")).unwrap()
}

fn evaluation(suite: Suite) -> Evaluation {
    Evaluation::new(suite, Missions { registry: registry(FAULTY), load: Box::new(no_file) }, "test").unwrap()
}

/// What came of all runs of a suite, on so many threads.
fn rows(suite: &Suite, jobs: usize) -> Vec<Row> {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("results");
    let stop = Arc::new(AtomicBool::new(false));
    let finished = evaluation(suite.clone()).run(&place, (jobs, &stop), |_| {}).unwrap();
    assert_eq!((finished.before, finished.done), (0, finished.all));
    let asked = std::fs::read_to_string(place.join("suite.txt")).unwrap();
    let runs = std::fs::read_to_string(place.join("runs.csv")).unwrap();
    assert_eq!(runs.lines().count(), finished.all + 1);
    let table = std::fs::read_to_string(place.join("table.md")).unwrap();
    assert!(
        finished.incomplete == 0 || table.contains(&format!("no part of any mean: {}", finished.incomplete)),
        "{table}"
    );
    let (_, mut kept) = Store::open(&place, suite, &asked).unwrap();
    kept.values_mut().for_each(|row| row.outcome.times = Default::default());
    kept.into_values().collect()
}

#[test]
fn each_fault_is_reported_by_name_and_the_rest_goes_on() {
    let suite = suite(1, &["ClosestFrontier", "Wall", "Nan", "Nothing", "Hangs", "Panics"]);
    let folder = tempfile::tempdir().unwrap();
    let mut outcomes = std::collections::BTreeMap::new();
    let stop = Arc::new(AtomicBool::new(false));
    let finished = evaluation(suite).run(folder.path(), (2, &stop), |step| {
        let strategy = step.run.rsplit(", ").next().unwrap().to_owned();
        outcomes.insert(strategy, (step.outcome.end, step.outcome.reason.clone()));
    });
    let finished = finished.unwrap();
    assert_eq!(finished.done, 6);
    let of = |strategy: &str| &outcomes[strategy];
    assert_eq!(of("ClosestFrontier").0, End::Complete, "{outcomes:?}");
    // The explorer goes to the closest goal then, and says so.
    assert!(of("Nothing").0 == End::Complete && of("Nothing").1.contains("the strategy had no answer"), "{outcomes:?}");
    assert!(
        of("Hangs").0 == End::Failed && of("Hangs").1 == "Explorer did not answer a message within 10 s",
        "{outcomes:?}"
    );
    assert!(of("Panics").0 == End::Failed && of("Panics").1.contains("this strategy knows no way out"), "{outcomes:?}");
    // The same for ways that cannot be gone; but then its run is none of the strategy's.
    for (strategy, fault) in [
        ("Wall", "m it leads through a wall: the map does not call free what is at ("),
        ("Nan", "its point 2 is (NaN; "),
    ] {
        let (end, reason) = of(strategy);
        let is_named = reason.starts_with("Faulty has answered ")
            && reason.contains("ways that cannot be gone, the first in plan ");
        assert!(*end == End::Incomplete && is_named && reason.contains(fault), "{strategy}: {outcomes:?}");
    }
    let failures = finished.tables.last().unwrap();
    assert_eq!(failures.lines.len(), 4, "{failures:?}");
}

#[test]
fn runs_are_the_same_on_one_thread_and_on_two() {
    let suite = suite(2, &["ClosestFrontier", "Potential"]);
    let one = rows(&suite, 1);
    assert!(one.len() == 4 && one.iter().all(|row| row.outcome.is_complete()), "{one:?}");
    assert_eq!(one, rows(&suite, 2));
    let starts: Vec<_> = one.iter().map(|row| row.start).collect();
    assert!(starts[0] == starts[1] && starts[2] == starts[3] && starts[0] != starts[2], "the same for all: {starts:?}");
    assert_ne!(one[0].outcome.map, one[1].outcome.map, "other strategies, other maps");
}

#[test]
fn an_evaluation_that_is_stopped_goes_on() {
    let suite = suite(12, &["ClosestFrontier"]);
    let (folder, stop) = (tempfile::tempdir().unwrap(), Arc::new(AtomicBool::new(false)));
    let evaluation = evaluation(suite);
    let first = evaluation.run(folder.path(), (1, &stop), |_| stop.store(true, Ordering::Relaxed)).unwrap();
    assert!((1..12).contains(&first.done), "{first:?}");
    stop.store(false, Ordering::Relaxed);
    let mut again = 0;
    let second = evaluation.run(folder.path(), (1, &stop), |_| again += 1).unwrap();
    assert_eq!((second.before, second.done, again), (first.done, 12, 12 - first.done));
    let third = evaluation.run(folder.path(), (1, &stop), |_| panic!("nothing is left to do")).unwrap();
    assert_eq!(third.tables, second.tables);
}
