//! `elk compare`: strategies against each other in the same mission, over seeds.

mod run;
mod strategy;
mod table;

use std::collections::{BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use clap::Args;
use elk_bus::clock::Clock;
use elk_bus::{stop_on_signals, tell};
use elk_launcher::{create_run_folder, handle};
use elk_mission::{AppSpec, Mission, Override, element};

use crate::missions::load;
use crate::terminal::{print_table, say};
pub use run::run_name;
use run::{Plan, Row, Running};
use strategy::{Strategy, set};

/// What is to be compared, and in which mission.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// Strategies, each a type of explorer or an executable (a path with a /), in quotes with parameters of its own
    /// ('./mine Climb=2'), and last the mission: a file, the name of a built-in one, or a run's folder
    #[arg(required = true, num_args = 1.., value_name = "STRATEGY… MISSION")]
    words: Vec<String>,
    /// Seeds, first and last included: `1..10`, `7`, `1,4,9`; the mission's own if not said
    #[arg(long)]
    seeds: Option<Seeds>,
    /// Runs at the same time
    #[arg(short, long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    /// Say a parameter for all runs instead of in the file; what only one strategy has is said with it, in its quotes
    #[arg(long = "set", value_name = "APP.PARAM=VALUE")]
    sets: Vec<Override>,
    /// Where the comparison's folder is made
    #[arg(long, default_value = "logs", value_name = "DIR")]
    log_dir: PathBuf,
    /// The CSV file; compare.csv in the comparison's folder if not said
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Which seeds.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Seeds(Vec<u64>);

/// The most seeds of one comparison.
const MOST_SEEDS: u64 = 100_000;

impl FromStr for Seeds {
    type Err = String;

    fn from_str(said: &str) -> Result<Self, String> {
        let wrong = || format!("right is 1..10, 7 or 1,4,9, at most {MOST_SEEDS} of them");
        let number = |text: &str| text.trim().parse::<u64>().map_err(|_| wrong());
        let mut seeds = Vec::new();
        for part in said.split(',') {
            let (first, last) = part.split_once("..").unwrap_or((part, part));
            let (first, last) = (number(first)?, number(last.trim_start_matches('='))?);
            if last < first || last - first >= MOST_SEEDS {
                return Err(wrong());
            }
            seeds.extend(first..=last);
        }
        if seeds.len() as u64 > MOST_SEEDS {
            return Err(wrong());
        }
        match twice(&seeds) {
            None => Ok(Self(seeds)),
            Some(seed) => Err(format!("seed {seed} is said twice, and would count as two runs")),
        }
    }
}

/// The first that is there again.
fn twice<T: Ord>(all: &[T]) -> Option<&T> {
    let mut seen = BTreeSet::new();
    all.iter().find(|one| !seen.insert(*one))
}

/// `elk compare`
pub fn compare(arguments: &CompareArgs) -> Result<ExitCode> {
    let Some((mission_file, strategies @ [_, ..])) = arguments.words.split_last() else {
        bail!("{} alone: right is one strategy at least, and then the mission", arguments.words.join(" "))
    };
    let strategies: Vec<Strategy> = strategies.iter().map(|words| Strategy::parse(words)).collect::<Result<_>>()?;
    let words: Vec<&str> = strategies.iter().map(|strategy| strategy.words.as_str()).collect();
    if let Some(strategy) = twice(&words) {
        bail!("{strategy} is said twice, and its runs would count as others'");
    }
    // Everything is looked at before anything starts.
    let mission = ComparedMission::look_at(Path::new(mission_file), arguments)?;
    let plans = mission.plans(&strategies)?;
    let folder = folder(&arguments.log_dir, &mission.name)?;
    let csv = arguments.output.clone().unwrap_or_else(|| folder.join("compare.csv"));
    elk_outside::file::try_write(&csv).with_context(|| format!("cannot write {}", csv.display()))?;
    let stop = stop_on_signals().context("signals cannot be caught")?;
    let rows = run_all(&plans, &folder, usize::from(arguments.jobs), &stop)?;
    elk_outside::file::write(&csv, table::csv(&rows).as_bytes())
        .with_context(|| format!("cannot write {}", csv.display()))?;
    print_table(&table::table(&rows))?;
    say(&table::incomplete(&rows))?;
    say(&table::unseeded(&rows))?;
    say(&format!("all rows are in {}, the runs beside them in {}\n", csv.display(), folder.display()))?;
    if stop.load(Ordering::Relaxed) {
        bail!("stopped: {} of {} runs came to their end", rows.iter().filter(|row| row.ended).count(), plans.len());
    }
    Ok(if rows.iter().all(|row| row.complete) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The mission that all have in common.
struct ComparedMission<'a> {
    file: &'a Path,
    arguments: &'a CompareArgs,
    /// What the comparison's folder is called after.
    name: String,
    /// The explorer that it names itself.
    explorer: AppSpec,
}

impl<'a> ComparedMission<'a> {
    /// As it is without what the command line says: that may be about a strategy which the file does not name. Only a file
    /// that is wrong without it is taken with it.
    fn look_at(file: &'a Path, arguments: &'a CompareArgs) -> Result<Self> {
        let (mission, _) = load(file, &[]).or_else(|_| load(file, &arguments.sets))?;
        let explorer = mission.of_element(element::EXPLORER).next().context("the mission has no Explorer")?.clone();
        let name = mission.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { file, arguments, name, explorer })
    }

    /// All runs, strategy by strategy for each seed, each checked. What is worth a word is said.
    fn plans(&self, strategies: &[Strategy]) -> Result<Vec<Plan>> {
        let (mut plans, mut notes) = (Vec::new(), BTreeSet::new());
        for strategy in strategies {
            let sets = strategy.sets(&self.explorer.name, &self.arguments.sets);
            let seedings = self.seedings(&sets).with_context(|| strategy.words.clone())?;
            let edge_m = self.check(strategy, &sets, &seedings, &mut notes).with_context(|| strategy.words.clone())?;
            plans.extend(seedings.into_iter().map(|(seed, seeding)| {
                let sets = sets.iter().cloned().chain(seeding).collect();
                Plan { strategy: strategy.words.clone(), seed, mission: self.file.to_owned(), sets, edge_m }
            }));
        }
        notes.iter().try_for_each(|note| say(&format!("note: {note}\n")))?;
        Ok(plans)
    }

    /// Each seed, and how it is said to the mission that `sets` make of this one.
    fn seedings(&self, sets: &[Override]) -> Result<Vec<Seeding>> {
        const SEED: &str = "Seed";
        let Some(Seeds(seeds)) = &self.arguments.seeds else { return Ok(vec![(None, None)]) };
        let (mission, _) = load(self.file, sets)?;
        let is_seeded = |app: &&AppSpec| app.element != element::LOGGER && app.takes(SEED);
        let Some(app) = mission.apps.iter().find(is_seeded) else {
            bail!("no app of the mission has a Seed; without --seeds each strategy runs once")
        };
        if let Some(said) = sets.iter().find(|set| set.app == app.name && set.param.eq_ignore_ascii_case(SEED)) {
            bail!("--seeds and {said} both say the seed; one of them is right");
        }
        Ok(seeds.iter().map(|seed| (Some(*seed), Some(set(&app.name, SEED, &seed.to_string())))).collect())
    }

    /// Sees that a strategy's runs would start, as `elk check` does: with the least and with the greatest seed. What holds of
    /// both as numbers holds of all between; of the starts that a seed chooses only these two are looked at. What is worth a
    /// word is put to the `notes`. Answers the edge of the map's voxels (m), if it is known.
    fn check(
        &self,
        strategy: &Strategy,
        sets: &[Override],
        seedings: &[Seeding],
        notes: &mut BTreeSet<String>,
    ) -> Result<Option<f64>> {
        let least = seedings.iter().min_by_key(|(seed, _)| seed);
        let most = seedings
            .iter()
            .max_by_key(|(seed, _)| seed)
            .filter(|(most, _)| least.is_some_and(|(least, _)| least < most));
        let mut edge_m = None;
        for (_, seeding) in least.into_iter().chain(most) {
            let (mission, found) = load(self.file, &[sets, seeding.as_slice()].concat())?;
            notes.extend(found);
            notes.extend(mission.preflight()?);
            notes.extend(self.left_out(strategy, &mission));
            edge_m = mission.of_element(element::MAP).find_map(|map| map.setting("Res")?.parse().ok());
        }
        Ok(edge_m)
    }

    /// A word on what the file says to its own explorer and `strategy`, as it runs in `mission`, has no word for.
    fn left_out(&self, strategy: &Strategy, mission: &Mission) -> Option<String> {
        let explorer = mission.of_element(element::EXPLORER).next()?;
        let lost = self.explorer.said.iter().filter(|name| !explorer.takes(name));
        let lost: Vec<String> =
            lost.filter_map(|name| Some(format!("{name}={}", self.explorer.setting(name)?))).collect();
        let file = self.file.display();
        (!lost.is_empty()).then(|| format!("{}: what {file} says is left out: {}", strategy.words, lost.join(", ")))
    }
}

/// Each seed, and how it is said to the mission.
type Seeding = (Option<u64>, Option<Override>);

/// Makes the comparison's folder.
fn folder(log_dir: &Path, mission: &str) -> Result<PathBuf> {
    Ok(create_run_folder(log_dir, &format!("compare-{mission}"), Clock::new(1.0).now())?)
}

/// How often it is seen whether the comparison is to stop.
const LOOK: Duration = Duration::from_millis(50);

/// Carries out all runs, at most `jobs` at a time, until they have ended or `stop` is set: then those that run are ended,
/// and those that have not begun are not. The rows are in the order of the plans.
fn run_all(plans: &[Plan], folder: &Path, jobs: usize, stop: &AtomicBool) -> Result<Vec<Row>> {
    let mut waiting: VecDeque<(usize, &Plan)> = plans.iter().enumerate().collect();
    let mut running: Vec<(usize, Running)> = Vec::new();
    let mut rows: Vec<(usize, Row)> = Vec::new();
    while !running.is_empty() || !waiting.is_empty() {
        let stopped = stop.load(Ordering::Relaxed);
        if stopped {
            running.iter_mut().for_each(|(_, run)| run.end());
            rows.extend(waiting.drain(..).map(|(number, plan)| (number, Row::failed(plan, "stopped before it began"))));
        }
        while running.len() < jobs
            && let Some((number, plan)) = waiting.pop_front()
        {
            match Running::start(plan, number, folder) {
                Ok(run) => running.push((number, run)),
                Err(error) => rows.push((number, Row::failed(plan, &format!("{error:#}")))),
            }
        }
        let ended = running.extract_if(.., |(_, run)| run.has_ended());
        let ended: Vec<(usize, Row)> = ended.map(|(number, run)| (number, run.row())).collect();
        ended.iter().for_each(|(_, row)| tell(row));
        rows.extend(ended);
        if !running.is_empty() {
            handle::wait(&running.iter().map(|(_, run)| run.handle()).collect::<Vec<_>>(), LOOK);
        }
    }
    rows.sort_by_key(|(number, _)| *number);
    Ok(rows.into_iter().map(|(_, row)| row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_ranges_and_lists() {
        let seeds = |said: &str| said.parse::<Seeds>().map(|Seeds(seeds)| seeds);
        assert_eq!(seeds("1..4"), Ok(vec![1, 2, 3, 4]));
        assert_eq!(seeds("7"), Ok(vec![7]));
        assert_eq!(seeds("9, 1..=2"), Ok(vec![9, 1, 2]));
        for wrong in ["", "1,1", "1..3,2", "4..1", "a..b", "1..", "0..18446744073709551615", "-1"] {
            assert!(seeds(wrong).is_err(), "{wrong}");
        }
    }
}
