//! A suite from its file to its report.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use elk_bus::clock::Stopwatch;
use elk_outside::file;

use crate::drawing::{self, Curves};
use crate::oracle::{self, Lengths};
use crate::outcome::{Outcome, TracePoint};
use crate::pool::{Case, Grounds, carry_out};
use crate::site::{Missions, Plans, check_strategies};
use crate::store::{Row, Store, StoreError};
use crate::suite::{Suite, SuiteError};
use crate::table::{Rows, Table, escaped};

/// The longest of its files that is read (bytes).
const LONGEST: u64 = 1 << 30;
const TABLE: &str = "table.md";
const CURVES: &str = "curves.svg";

/// Why an evaluation cannot begin, or go on.
#[derive(Debug, thiserror::Error)]
pub enum EvaluationError {
    /// The suite is wrong.
    #[error(transparent)]
    Suite(#[from] SuiteError),
    /// The results cannot be kept.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The results cannot be written, or there is no thread.
    #[error("the evaluation cannot go on: {0}")]
    Io(#[from] io::Error),
}

/// A suite whose missions are checked.
pub struct Evaluation {
    grounds: Arc<Grounds>,
    /// All that was asked, in full: what the results are of.
    asked: String,
}

/// A run has come to its end.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Which: world, start and strategy.
    pub run: String,
    /// What came of it.
    pub outcome: Outcome,
    /// Runs done, those of before among them.
    pub done: usize,
    /// Runs of the suite.
    pub all: usize,
    /// Time left, as long as runs go on as they went (s).
    pub left_secs: f64,
}

/// What an evaluation came to.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The results' folder.
    pub folder: PathBuf,
    /// Runs that were there before.
    pub before: usize,
    /// Runs that are there now.
    pub done: usize,
    /// Runs of the suite.
    pub all: usize,
    /// Runs that are not complete.
    pub incomplete: usize,
    /// The tables.
    pub tables: Vec<Table>,
}

impl Evaluation {
    /// Checks all missions of a suite. `build` says which elk this is: another one's results are other results.
    ///
    /// # Errors
    /// All strategies that there are not, or the first mission that is wrong, with its place in the suite.
    pub fn new(suite: Suite, missions: Missions, build: &str) -> Result<Self, EvaluationError> {
        check_strategies(&suite, &missions.registry)?;
        let plans: Vec<Result<Plans, String>> =
            suite.worlds.iter().map(|entry| Plans::of(&suite, entry, &missions)).collect::<Result<_, _>>()?;
        let asked = asked(&suite, &plans, build);
        Ok(Self { grounds: Arc::new(Grounds::new(suite, missions, plans)), asked })
    }

    /// Where the results lie if nobody says it: in a folder of their own for whatever was asked.
    pub fn folder(&self, results: &Path) -> PathBuf {
        let digest = self
            .asked
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
        let name = self.grounds.suite.name.replace(char::is_whitespace, "-");
        results.join(format!("{name}-{:08x}", digest >> 32))
    }

    /// Carries out the runs that are not in `folder` yet, `jobs` at a time, until all are done or `stop` is set, and reports.
    ///
    /// # Errors
    /// The folder holds other results, or cannot be written.
    pub fn run(
        &self,
        folder: &Path,
        (jobs, stop): (usize, &Arc<AtomicBool>),
        mut step: impl FnMut(&Step),
    ) -> Result<Finished, EvaluationError> {
        let suite = &self.grounds.suite;
        let (mut store, mut rows) = Store::open(folder, suite, &self.asked)?;
        let cases = Case::all(suite);
        let (all, before) = (cases.len(), rows.len());
        let to_do: Vec<Case> = cases.into_iter().filter(|case| !rows.contains_key(case)).collect();
        let running = Stopwatch::start();
        carry_out(&self.grounds, to_do, (jobs, stop), |case, outcome, trace| {
            let start = self.grounds.site(case.world).ok().map(|site| site.starts[case.start]);
            let row = Row { case, start, outcome };
            store.keep(suite, &row, &trace)?;
            let outcome = row.outcome.clone();
            rows.insert(case, row);
            let now = rows.len() - before;
            let left_secs = running.elapsed().as_secs_f64() / now as f64 * (all - rows.len()) as f64;
            step(&Step { run: named(suite, case), outcome, done: rows.len(), all, left_secs });
            Ok::<(), io::Error>(())
        })?;
        store.sort(suite, rows.values())?;
        let lengths = self.lengths(&store, &rows, (jobs, stop))?;
        let tables = Rows::new(suite, &rows, &lengths).tables();
        self.report(&store, &rows, &tables)?;
        let incomplete = rows.values().filter(|row| !row.outcome.is_complete()).count();
        Ok(Finished { folder: folder.to_owned(), before, done: rows.len(), all, incomplete, tables })
    }

    /// The oracle's ways from the starts of all complete runs; those that were not found before are looked for.
    fn lengths(
        &self,
        store: &Store,
        rows: &BTreeMap<Case, Row>,
        how: (usize, &Arc<AtomicBool>),
    ) -> io::Result<Lengths> {
        let suite = &self.grounds.suite;
        let mut lengths = store.lengths(suite)?;
        let complete = rows.values().filter(|row| row.outcome.is_complete());
        let wanted: BTreeSet<(usize, usize)> = complete.map(|row| (row.case.world, row.case.start)).collect();
        let missing: BTreeSet<_> = wanted.into_iter().filter(|start| !lengths.contains_key(start)).collect();
        if !missing.is_empty() {
            lengths.extend(oracle::lengths(&self.grounds, &missing, (how.0, how.1)));
            store.keep_lengths(suite, &lengths)?;
        }
        Ok(lengths)
    }

    /// Writes what an evaluation came to as a page that stands by itself, with its pictures in a folder of the page's name beside it.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn write_page(&self, finished: &Finished, page: &Path) -> io::Result<()> {
        let suite = &self.grounds.suite;
        let stem = page.file_stem().unwrap_or_default().to_string_lossy();
        let folder = page.with_extension("");
        std::fs::create_dir_all(&folder)?;
        let mut text = file::read_text(&finished.folder.join(TABLE), LONGEST)?;
        let names = suite.worlds.iter().map(|world| format!("paths-{}.svg", world.name));
        for name in std::iter::once(CURVES.to_owned()).chain(names) {
            let Ok(picture) = file::read_text(&finished.folder.join(&name), LONGEST) else { continue };
            file::place(&folder.join(&name), picture.as_bytes())?;
            let _ = write!(text, "![{}]({stem}/{name})\n\n", name.trim_end_matches(".svg"));
        }
        file::replace(page, text.as_bytes())
    }

    fn report(&self, store: &Store, rows: &BTreeMap<Case, Row>, tables: &[Table]) -> io::Result<()> {
        let suite = &self.grounds.suite;
        let mut head = format!("# {}\n\n", suite.name);
        if !suite.about.is_empty() {
            let _ = write!(head, "{}\n\n", suite.about);
        }
        let all = suite.worlds.len() * suite.strategies.len() * suite.starts;
        let _ = write!(
            head,
            "{} of {all} runs; {} starts in each world, seed {}.\n\n",
            rows.len(),
            suite.starts,
            suite.seed
        );
        let markdown: String = tables.iter().map(Table::markdown).collect();
        store.write(TABLE, &format!("{head}{markdown}"))?;
        let strategies: Vec<String> = suite.strategies.iter().map(|one| one.name.clone()).collect();
        let curves = drawing::curves(&self.curves(store, rows), &strategies);
        store.write(CURVES, &curves)?;
        let mut pictures = curves;
        for (name, svg) in self.ways(store, rows, &strategies) {
            store.write(&format!("paths-{name}.svg"), &svg)?;
            pictures += &svg;
        }
        store.write("report.html", &html(suite, tables, &pictures))
    }

    /// The curves of all complete runs, by world and strategy.
    fn curves(&self, store: &Store, rows: &BTreeMap<Case, Row>) -> Vec<(String, Vec<Curves>)> {
        let suite = &self.grounds.suite;
        let of = |world: usize, strategy: usize| -> Curves {
            let own = rows.values().filter(|row| row.case.world == world && row.case.strategy == strategy);
            own.filter(|row| row.outcome.is_complete()).map(|row| store.trace(suite, row.case)).collect()
        };
        let of_world = |world: usize| (0..suite.strategies.len()).map(|strategy| of(world, strategy)).collect();
        suite.worlds.iter().enumerate().map(|(world, entry)| (entry.name.clone(), of_world(world))).collect()
    }

    /// A picture of each world that can be read: the ways from the first start.
    fn ways(&self, store: &Store, rows: &BTreeMap<Case, Row>, strategies: &[String]) -> Vec<(String, String)> {
        let suite = &self.grounds.suite;
        let of = |world: usize| {
            let own = rows.values().filter(|row| row.case.world == world && row.case.start == 0);
            let ways: Vec<(usize, Vec<TracePoint>)> = own
                .map(|row| (row.case.strategy, store.trace(suite, row.case)))
                .filter(|(_, way)| !way.is_empty())
                .collect();
            if ways.is_empty() {
                return None;
            }
            let (truth, name) = (&self.grounds.site(world).ok()?.truth, suite.worlds[world].name.clone());
            let svg = drawing::ways(&name, truth.surface(), truth.resolution(), &ways, strategies);
            Some((name.replace(char::is_whitespace, "-"), svg))
        };
        (0..suite.worlds.len()).filter_map(of).collect()
    }
}

/// A run's name, for people.
fn named(suite: &Suite, Case { world, start, strategy }: Case) -> String {
    format!("{}, start {}, {}", suite.worlds[world].name, start + 1, suite.strategies[strategy].name)
}

/// All that decides what comes of a suite.
fn asked(suite: &Suite, plans: &[Result<Plans, String>], build: &str) -> String {
    let limits = &suite.limits;
    let mut text = format!("build {build}\nseed {}\nstarts {}\nlimits {limits:?}\n", suite.seed, suite.starts);
    for (entry, plans) in suite.worlds.iter().zip(plans) {
        let _ = writeln!(text, "world {}", entry.name);
        match plans {
            Ok(plans) => {
                let _ = writeln!(text, "world file {:016x}", plans.world_digest());
                for (strategy, mission) in suite.strategies.iter().zip(&plans.effective) {
                    let _ = writeln!(text, "explorer {}\n{mission}", strategy.name);
                }
            }
            Err(why) => text += &format!("no world: {why}\n"),
        }
    }
    text
}

/// The report: all of it in one file.
fn html(suite: &Suite, tables: &[Table], pictures: &str) -> String {
    let style = "body{font-family:sans-serif;margin:2em;color:#222}table{border-collapse:collapse;font-size:13px}\
                 td,th{border:1px solid #ccc;padding:3px 7px;text-align:right}td:first-child,th:first-child{text-align:left}\
                 svg{display:block;margin:1em 0}";
    let tables: String = tables.iter().map(Table::html).collect();
    let (name, about) = (escaped(&suite.name), escaped(&suite.about));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{name}</title><style>{style}</style></head>\n\
         <body><h1>{name}</h1>\n<p>{about}</p>\n{tables}{pictures}</body></html>\n"
    )
}
