//! The results' folder: what was asked, what came of each run so far, and how an evaluation goes on from there.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use elk_outside::file;
use nalgebra::Point3;

use crate::oracle::{Length, Lengths};
use crate::outcome::{Mark, Outcome, Times, TracePoint};
use crate::pool::Case;
use crate::suite::Suite;
use crate::truth::Start;

/// The longest of its files that is read (bytes).
const LONGEST: u64 = 1 << 28;
const SUITE: &str = "suite.txt";
const RUNS: &str = "runs.csv";
const TIMES: &str = "times.csv";
const ORACLE: &str = "oracle.csv";
const TRACES: &str = "traces";
const ORACLE_HEADS: &str = "world,start,way_m,seen\n";
/// What a run is, before what came of it.
const RUN_HEADS: [&str; 9] = ["run", "world", "strategy", "start", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg"];

/// Why results cannot be kept.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The system does not let them.
    #[error("cannot write the results to {}: {source}", .folder.display())]
    Io {
        /// The folder.
        folder: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// They are of something else.
    #[error(
        "the results in {} are of another suite, or of another elk: {what}; choose another folder (--output), or remove that one",
        .folder.display()
    )]
    Other {
        /// The folder.
        folder: PathBuf,
        /// The first difference.
        what: String,
    },
}

/// A results' folder.
pub struct Store {
    folder: PathBuf,
    runs: File,
    times: File,
}

/// A run and what came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Which.
    pub case: Case,
    /// Where it began; `None`: it did not.
    pub start: Option<Start>,
    /// What came of it.
    pub outcome: Outcome,
}

impl Store {
    /// Opens a folder, or makes it, for the results of what `asked` says in full; and answers what is in it already: runs that
    /// came to an end of their own, whatever that was. Those that failed are to be tried again.
    ///
    /// # Errors
    /// It cannot be written, or holds other results.
    pub fn open(folder: &Path, suite: &Suite, asked: &str) -> Result<(Self, BTreeMap<Case, Row>), StoreError> {
        let failed = |source| StoreError::Io { folder: folder.to_owned(), source };
        let traces = folder.join(TRACES);
        if traces.is_symlink() {
            let what = format!("{TRACES} in it is a link, and not a folder of its own");
            return Err(StoreError::Other { folder: folder.to_owned(), what });
        }
        std::fs::create_dir_all(traces).map_err(failed)?;
        let before = folder.join(SUITE);
        if before.exists() {
            let said = file::read_text(&before, LONGEST).map_err(failed)?;
            if said != asked {
                return Err(StoreError::Other { folder: folder.to_owned(), what: difference(&said, asked) });
            }
        } else if folder.join(RUNS).exists() {
            return Err(StoreError::Other {
                folder: folder.to_owned(),
                what: format!("it has a {RUNS}, and no {SUITE}"),
            });
        }
        let mut rows = read_rows(folder, suite).map_err(failed)?;
        rows.retain(|_, row| row.outcome.end != crate::outcome::End::Failed);
        // Half a line of a run that was cut off is not left before the next one.
        write_rows(folder, suite, rows.values()).map_err(failed)?;
        file::place(&before, asked.as_bytes()).map_err(failed)?;
        let append = |name: &str| OpenOptions::new().append(true).open(folder.join(name)).map_err(failed);
        Ok((Self { folder: folder.to_owned(), runs: append(RUNS)?, times: append(TIMES)? }, rows))
    }

    /// Keeps what came of a run: what lies beside its row first, so that a row means that all is there.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn keep(&mut self, suite: &Suite, row: &Row, trace: &[TracePoint]) -> io::Result<()> {
        let number = row.case.number(suite);
        file::place(&trace_file(&self.folder, number), trace_text(trace).as_bytes())?;
        self.times.write_all(times_line(number, &row.outcome).as_bytes())?;
        self.runs.write_all(run_line(suite, row).as_bytes())
    }

    /// Writes the tables again, in the order of the runs.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn sort<'a>(&self, suite: &Suite, rows: impl Iterator<Item = &'a Row> + Clone) -> io::Result<()> {
        write_rows(&self.folder, suite, rows)
    }

    /// Writes a file beside the tables.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, name: &str, text: &str) -> io::Result<()> {
        let named = |error: io::Error| io::Error::new(error.kind(), format!("{name}: {error}"));
        file::place(&self.folder.join(name), text.as_bytes()).map_err(named)
    }

    /// The oracle's ways that were found so far.
    ///
    /// # Errors
    /// They cannot be read.
    pub fn lengths(&self, suite: &Suite) -> io::Result<Lengths> {
        let of = |cells: &Vec<String>| {
            let [world, start, way_m, seen] = &cells[..] else { return None };
            let world = suite.worlds.iter().position(|one| one.name == *world)?;
            let start = start.parse::<usize>().ok()?.checked_sub(1).filter(|start| *start < suite.starts)?;
            let length = match way_m.is_empty() {
                true => None,
                false => Some(Length { way_m: way_m.parse().ok()?, seen: seen.parse().ok()? }),
            };
            Some(((world, start), length))
        };
        Ok(lines(&text(&self.folder, ORACLE)?).filter_map(|cells| of(&cells)).collect())
    }

    /// Keeps the oracle's ways.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn keep_lengths(&self, suite: &Suite, lengths: &Lengths) -> io::Result<()> {
        let of = |((world, start), length): (&(usize, usize), &Option<Length>)| {
            let numbers = length.map(|length| [length.way_m, length.seen].map(|number| number.to_string()));
            let [way_m, seen] = numbers.unwrap_or_default();
            line(&[suite.worlds[*world].name.clone(), (start + 1).to_string(), way_m, seen])
        };
        self.write(ORACLE, &(ORACLE_HEADS.to_owned() + &lengths.iter().map(of).collect::<String>()))
    }

    /// What was known after each scan of a run; empty: it is not there.
    pub fn trace(&self, suite: &Suite, case: Case) -> Vec<TracePoint> {
        let text = file::read_text(&trace_file(&self.folder, case.number(suite)), LONGEST).unwrap_or_default();
        text.lines().skip(1).filter_map(trace_point).collect()
    }
}

fn difference(before: &str, now: &str) -> String {
    let (mut before, mut now) = (before.lines(), now.lines());
    loop {
        match (before.next(), now.next()) {
            (None, None) => return "they end otherwise".to_owned(),
            (before, now) if before != now => {
                let shown = |line: Option<&str>| line.map_or("nothing".to_owned(), |line| format!("{:?}", line.trim()));
                return format!("there it says {}, and now {}", shown(before), shown(now));
            }
            _ => {}
        }
    }
}

fn trace_file(folder: &Path, number: usize) -> PathBuf {
    folder.join(TRACES).join(format!("{number:05}.csv"))
}

fn trace_text(trace: &[TracePoint]) -> String {
    let line = |TracePoint { mark, coverage, surface, position: p }: &TracePoint| {
        let travel = mark.travel_secs.map_or(String::new(), |secs| secs.to_string());
        let took = format!("{},{},{travel}", mark.rotation_deg, mark.scans);
        format!("{},{coverage},{},{},{},{took},{surface}\n", mark.way_m, p.x, p.y, p.z)
    };
    let lines: String = trace.iter().map(line).collect();
    format!("way_m,coverage,x_m,y_m,z_m,rotation_deg,scans,travel_s,surface\n{lines}")
}

fn trace_point(line: &str) -> Option<TracePoint> {
    let cells: Vec<&str> = line.split(',').collect();
    let [way_m, coverage, x, y, z, rotation_deg, scans, travel, surface] = cells[..] else { return None };
    let number = |text: &str| text.parse::<f64>().ok();
    let travel_secs = if travel.is_empty() { None } else { Some(number(travel)?) };
    let (rotation_deg, scans) = (number(rotation_deg)?, scans.parse().ok()?);
    let mark = Mark { way_m: number(way_m)?, rotation_deg, scans, travel_secs };
    let position = Point3::new(number(x)?, number(y)?, number(z)?);
    Some(TracePoint { mark, coverage: number(coverage)?, surface: number(surface)?, position })
}

fn run_line(suite: &Suite, row: &Row) -> String {
    let Case { world, start, strategy } = row.case;
    let mut cells = vec![row.case.number(suite).to_string(), suite.worlds[world].name.clone()];
    cells.extend([suite.strategies[strategy].name.clone(), (start + 1).to_string()]);
    match &row.start {
        Some(Start { position: p, yaw_deg, pitch_deg }) => {
            cells.extend([p.x, p.y, p.z, *yaw_deg, *pitch_deg].map(|number| number.to_string()));
        }
        None => cells.extend([const { String::new() }; 5]),
    }
    cells.extend(row.outcome.cells());
    line(&cells)
}

fn times_line(number: usize, outcome: &Outcome) -> String {
    let mut cells = vec![number.to_string()];
    cells.extend(outcome.times.cells());
    line(&cells)
}

/// A line of a CSV file (RFC 4180); a text stays on its line.
fn line(cells: &[String]) -> String {
    let quoted = |cell: &String| {
        let cell = cell.replace(['\n', '\r'], " ");
        if cell.contains([',', '"']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell }
    };
    cells.iter().map(quoted).collect::<Vec<_>>().join(",") + "\n"
}

/// The cells of such a line.
fn cells(line: &str) -> Vec<String> {
    let (mut cells, mut cell, mut is_quoted) = (Vec::new(), String::new(), false);
    let mut letters = line.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '"' if is_quoted && letters.peek() == Some(&'"') => cell.extend(letters.next()),
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => cells.push(std::mem::take(&mut cell)),
            letter => cell.push(letter),
        }
    }
    cells.push(cell);
    cells
}

/// The text of a table; empty: it is not there.
fn text(folder: &Path, name: &str) -> io::Result<String> {
    match file::read_text(&folder.join(name), LONGEST) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(String::new()),
        Err(error) => Err(io::Error::new(error.kind(), format!("{name}: {error}"))),
        text => text,
    }
}

/// The cells of a table's whole lines, without its head.
fn lines(text: &str) -> impl Iterator<Item = Vec<String>> {
    text.split_inclusive('\n').skip(1).filter_map(|line| line.strip_suffix('\n')).map(cells)
}

fn read_rows(folder: &Path, suite: &Suite) -> io::Result<BTreeMap<Case, Row>> {
    let numbered = |cells: &Vec<String>| cells.first().and_then(|number| number.parse::<usize>().ok());
    let timed = |cells: Vec<String>| Some((numbered(&cells)?, Times::from_cells(&cells[1..])?));
    let times: BTreeMap<usize, Times> = lines(&text(folder, TIMES)?).filter_map(timed).collect();
    let cases: BTreeMap<usize, Case> = Case::all(suite).into_iter().map(|case| (case.number(suite), case)).collect();
    let row = |cells: &Vec<String>| {
        let number = numbered(cells)?;
        let (case, head) = (*cases.get(&number)?, cells.get(..RUN_HEADS.len())?);
        let outcome = Outcome::from_cells(&cells[RUN_HEADS.len()..], times.get(&number).copied()?)?;
        let start: Option<Vec<f64>> = head[4..].iter().map(|cell| cell.parse().ok()).collect();
        let start = start.map(|numbers| Start {
            position: Point3::new(numbers[0], numbers[1], numbers[2]),
            yaw_deg: numbers[3],
            pitch_deg: numbers[4],
        });
        Some((case, Row { case, start, outcome }))
    };
    Ok(lines(&text(folder, RUNS)?).filter_map(|cells| row(&cells)).collect())
}

fn write_rows<'a>(folder: &Path, suite: &Suite, rows: impl Iterator<Item = &'a Row> + Clone) -> io::Result<()> {
    let head = |names: Vec<&str>| names.join(",") + "\n";
    let runs: String = rows.clone().map(|row| run_line(suite, row)).collect();
    let times: String = rows.map(|row| times_line(row.case.number(suite), &row.outcome)).collect();
    let run_heads = RUN_HEADS.into_iter().chain(Outcome::HEADS).collect();
    let times_heads = ["run"].into_iter().chain(Times::HEADS).collect();
    file::place(&folder.join(TIMES), (head(times_heads) + &times).as_bytes())?;
    file::place(&folder.join(RUNS), (head(run_heads) + &runs).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::tests::complete;

    fn suite() -> Suite {
        let text = "<Suite starts='2'><World mission='car'/><Explorer type='A'/><Explorer type='B'/></Suite>";
        Suite::parse(text, Path::new("s.xml")).unwrap()
    }

    fn row(start: usize, strategy: usize, way_m: f64) -> Row {
        let case = Case { world: 0, start, strategy };
        let place = Start { position: Point3::new(0.1, -2.0, 1.234), yaw_deg: 12.3, pitch_deg: -4.0 };
        Row { case, start: Some(place), outcome: complete(way_m) }
    }

    const TRACE: [TracePoint; 2] = [
        TracePoint {
            mark: Mark { way_m: 0.1, rotation_deg: 0.1 + 0.2, scans: 3, travel_secs: None },
            coverage: 1.0 / 3.0,
            surface: 0.25,
            position: Point3::new(1.0, 2.0, 3.0),
        },
        TracePoint {
            mark: Mark { way_m: 0.2, rotation_deg: 4.0, scans: 4, travel_secs: Some(1.0 / 7.0) },
            coverage: 0.5,
            surface: 1.0,
            position: Point3::new(1.0, -2.0, 3.0),
        },
    ];

    #[test]
    fn what_was_kept_is_there_again_and_half_a_line_is_not() {
        let (folder, suite) = (tempfile::tempdir().unwrap(), suite());
        let place = folder.path().join("results");
        let (mut store, before) = Store::open(&place, &suite, "asked\n").unwrap();
        assert!(before.is_empty());
        let mut odd = row(1, 0, 0.1 + 0.2);
        odd.outcome.reason = "a \"wall\", and\nmore".into();
        for kept in [&odd, &row(0, 1, 2.0)] {
            store.keep(&suite, kept, &TRACE).unwrap();
        }
        // A run that was cut off in the midst of its line.
        let torn = run_line(&suite, &row(0, 0, 9.0));
        store.runs.write_all(&torn.as_bytes()[..torn.len() - 1]).unwrap();
        drop(store);
        let (store, rows) = Store::open(&place, &suite, "asked\n").unwrap();
        odd.outcome.reason = "a \"wall\", and more".into();
        assert_eq!(rows.values().cloned().collect::<Vec<_>>(), [row(0, 1, 2.0), odd]);
        assert_eq!(store.trace(&suite, Case { world: 0, start: 1, strategy: 0 }), TRACE);
        assert_eq!(store.trace(&suite, Case { world: 0, start: 1, strategy: 1 }), []);
    }

    /// Regression: tables were written over whatever file a link in their place named.
    #[test]
    fn a_folder_from_elsewhere_leads_nowhere_else() {
        let (folder, suite) = (tempfile::tempdir().unwrap(), suite());
        let [mine, place] = ["mine", "results"].map(|name| folder.path().join(name));
        std::fs::write(&mine, "mine").unwrap();
        std::fs::create_dir_all(place.join(TRACES)).unwrap();
        for name in [RUNS, TIMES, SUITE, "traces/00001.csv", "report.html"] {
            std::os::unix::fs::symlink(&mine, place.join(name)).unwrap();
        }
        assert!(matches!(Store::open(&place, &suite, "asked"), Err(StoreError::Other { .. })));
        std::fs::remove_file(place.join(SUITE)).unwrap();
        std::os::unix::fs::symlink("nothing", place.join(SUITE)).unwrap();
        std::fs::remove_file(place.join(RUNS)).unwrap();
        let (mut store, _) = Store::open(&place, &suite, "asked").unwrap();
        store.keep(&suite, &row(0, 0, 1.0), &TRACE).unwrap();
        store.write("report.html", "a page").unwrap();
        assert_eq!(std::fs::read_to_string(&mine).unwrap(), "mine");
        assert!(!place.join("nothing").exists());
        std::fs::remove_dir_all(place.join(TRACES)).unwrap();
        std::os::unix::fs::symlink(folder.path(), place.join(TRACES)).unwrap();
        let said = Store::open(&place, &suite, "asked").err().unwrap().to_string();
        assert!(said.contains("traces in it is a link, and not a folder of its own"), "{said}");
    }

    #[test]
    fn what_failed_is_tried_again() {
        let (folder, suite) = (tempfile::tempdir().unwrap(), suite());
        let (mut store, _) = Store::open(folder.path(), &suite, "").unwrap();
        let failed = Row { outcome: Outcome::failed("no world"), start: None, ..row(0, 0, 0.0) };
        let capped = Outcome { end: crate::outcome::End::Capped, ..complete(5.0) };
        let capped = Row { outcome: capped, ..row(0, 1, 5.0) };
        store.keep(&suite, &failed, &[]).unwrap();
        store.keep(&suite, &capped, &[]).unwrap();
        let (_, rows) = Store::open(folder.path(), &suite, "").unwrap();
        assert_eq!(rows.into_values().collect::<Vec<_>>(), [capped]);
    }

    #[test]
    fn ways_of_the_oracle_are_there_again() {
        let (folder, suite) = (tempfile::tempdir().unwrap(), suite());
        let (store, _) = Store::open(folder.path(), &suite, "").unwrap();
        assert!(store.lengths(&suite).unwrap().is_empty());
        let lengths = Lengths::from([((0, 0), Some(Length { way_m: 0.1 + 0.2, seen: 1.0 / 3.0 })), ((0, 1), None)]);
        store.keep_lengths(&suite, &lengths).unwrap();
        assert_eq!(store.lengths(&suite).unwrap(), lengths);
    }

    #[test]
    fn results_of_another_suite_are_left_alone() {
        let (folder, suite) = (tempfile::tempdir().unwrap(), suite());
        drop(Store::open(folder.path(), &suite, "seed 1\nstarts 2\n").unwrap());
        let error = Store::open(folder.path(), &suite, "seed 1\nstarts 3\n").err().unwrap().to_string();
        assert!(error.contains("there it says \"starts 2\", and now \"starts 3\""), "{error}");
        assert!(Store::open(folder.path(), &suite, "seed 1\nstarts 2\n").is_ok());
    }

    #[test]
    fn the_order_in_which_runs_end_leaves_no_trace() {
        let suite = suite();
        let rows = [row(0, 0, 1.0), row(0, 1, 2.0), row(1, 0, 3.0)];
        let texts = [[0, 1, 2], [2, 0, 1]].map(|order| {
            let folder = tempfile::tempdir().unwrap();
            let (mut store, _) = Store::open(folder.path(), &suite, "").unwrap();
            order.iter().for_each(|i: &usize| store.keep(&suite, &rows[*i], &TRACE).unwrap());
            store.sort(&suite, rows.iter()).unwrap();
            std::fs::read_to_string(folder.path().join(RUNS)).unwrap()
        });
        assert_eq!(texts[0], texts[1]);
        assert_eq!(texts[0].lines().count(), 4);
    }
}
