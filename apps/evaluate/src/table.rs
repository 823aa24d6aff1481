//! What runs came to as tables: a line a strategy, compared with the first one start by start.

use std::collections::BTreeMap;

use crate::oracle::{Length, Lengths};
use crate::outcome::{Mark, Outcome, SHARES};
use crate::parts;
use crate::pool::Case;
use crate::statistics::{Paired, Sample};
use crate::store::Row;
use crate::suite::Suite;

/// A table with a head, as text.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// What it is of.
    pub caption: String,
    /// The names of its columns.
    pub head: Vec<String>,
    /// Its lines.
    pub lines: Vec<Vec<String>>,
}

impl Table {
    /// As Markdown.
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule = format!("|{}\n", "---|".repeat(self.head.len()));
        let lines: String = self.lines.iter().map(|cells| line(cells)).collect();
        format!("## {}\n\n{}{rule}{lines}\n", self.caption, line(&self.head))
    }

    /// As HTML.
    pub fn html(&self) -> String {
        let row = |cells: &[String], tag: &str| {
            let cells: String = cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell))).collect();
            format!("<tr>{cells}</tr>\n")
        };
        let lines: String = self.lines.iter().map(|cells| row(cells, "td")).collect();
        format!("<h2>{}</h2>\n<table>\n{}{lines}</table>\n", escaped(&self.caption), row(&self.head, "th"))
    }
}

/// A text between tags.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The rows of a suite, as far as there are any.
pub struct Rows<'a> {
    suite: &'a Suite,
    rows: &'a BTreeMap<Case, Row>,
    lengths: &'a Lengths,
}

/// The name of the reference that knows the world.
const ORACLE: &str = "Oracle";
/// The column of the share that is known at the end.
const SEEN: &str = "seen %";

/// What is measured of a run; `None`: not of this one.
type Measure = fn(&Outcome) -> Option<f64>;

const WAY: Measure = |run| Some(run.way_m);
const WAY_99: Measure = |run| run.marks[2].map(|mark| mark.way_m);

impl<'a> Rows<'a> {
    /// All that is there of a suite, and what the oracle's ways come to in it.
    pub fn new(suite: &'a Suite, rows: &'a BTreeMap<Case, Row>, lengths: &'a Lengths) -> Self {
        Self { suite, rows, lengths }
    }

    /// The runs of a strategy in a world that came to their end, by start: others are no part of any mean.
    fn complete(&self, world: usize, strategy: usize) -> impl Iterator<Item = (usize, &'a Outcome)> {
        let of = move |start: usize| Some((start, &self.rows.get(&Case { world, start, strategy })?.outcome));
        (0..self.suite.starts)
            .filter_map(of)
            .filter(|(_, outcome)| outcome.is_complete())
            .collect::<Vec<_>>()
            .into_iter()
    }

    /// A measure of a strategy and of the first one, from each start from which both came to their end.
    fn pairs(&self, world: usize, strategy: usize, measure: Measure) -> Vec<[f64; 2]> {
        let first: BTreeMap<usize, &Outcome> = self.complete(world, 0).collect();
        let pair = |(start, outcome): (usize, &Outcome)| Some([measure(outcome)?, measure(first.get(&start)?)?]);
        self.complete(world, strategy).filter_map(pair).collect()
    }

    /// The oracle's ways in a world, by start.
    fn oracle(&self, world: usize) -> BTreeMap<usize, Length> {
        let own = self.lengths.range((world, 0)..(world + 1, 0));
        own.filter_map(|((_, start), length)| Some((*start, (*length)?))).collect()
    }

    /// How much longer than the oracle's the complete ways of a strategy are, as logarithms.
    fn over_oracle(&self, world: usize, strategy: usize) -> Vec<f64> {
        let oracle = self.oracle(world);
        let ratio = |(start, run): (usize, &Outcome)| Some((run.way_m / oracle.get(&start)?.way_m).ln());
        self.complete(world, strategy).filter_map(ratio).filter(|ratio| ratio.is_finite()).collect()
    }

    /// All tables.
    pub fn tables(&self) -> Vec<Table> {
        let worlds = (0..self.suite.worlds.len()).flat_map(|world| [self.of_world(world), self.on_the_way(world)]);
        [self.overall(), self.parts()].into_iter().chain(worlds).chain(self.failures()).collect()
    }

    /// What the ways of all worlds are made of.
    fn parts(&self) -> Table {
        let head = std::iter::once("strategy".to_owned()).chain(parts::heads(ORACLE)).collect();
        let line = |strategy: usize| {
            let of_world = |world: usize| {
                let oracle = self.oracle(world);
                self.complete(world, strategy)
                    .map(move |(start, run)| (run, oracle.get(&start).map(|length| length.way_m)))
            };
            let runs: Vec<(&Outcome, Option<f64>)> = (0..self.suite.worlds.len()).flat_map(of_world).collect();
            std::iter::once(self.suite.strategies[strategy].name.clone()).chain(parts::cells(&runs)).collect()
        };
        let caption = "All worlds: what the ways are made of".to_owned();
        Table { caption, head, lines: (0..self.suite.strategies.len()).map(line).collect() }
    }

    /// What it took to come to each share of what is visible, besides the way.
    fn on_the_way(&self, world: usize) -> Table {
        let mut head = vec!["strategy".to_owned()];
        head.extend(SHARES.iter().flat_map(|share| {
            ["rotation °", "scans", "travel s"].map(|what| format!("to {}: {what}", percent(*share)))
        }));
        let line = |strategy: usize| {
            let runs: Vec<&Outcome> = self.complete(world, strategy).map(|(_, outcome)| outcome).collect();
            let mut cells = vec![self.suite.strategies[strategy].name.clone()];
            for place in 0..SHARES.len() {
                let mean =
                    |of: fn(&Mark) -> Option<f64>| mean_of(&runs, |run| run.marks[place].as_ref().and_then(of), 0);
                cells.extend([
                    mean(|mark| Some(mark.rotation_deg)),
                    mean(|mark| Some(mark.scans as f64)),
                    mean(|mark| mark.travel_secs),
                ]);
            }
            cells
        };
        let caption = format!("{}: on the way", self.suite.worlds[world].name);
        Table { caption, head, lines: (0..self.suite.strategies.len()).map(line).collect() }
    }

    /// Ratios to the first strategy over all worlds, as geometric means over the pairs: a long way weighs no more than a short
    /// one.
    fn overall(&self) -> Table {
        let first = &self.suite.strategies[0].name;
        let head = ["strategy", "complete", "pairs"].into_iter().map(str::to_owned);
        let head = head.chain(["way", "way to 99 %"].map(|what| format!("{what} ÷ {first} [95 %], p")));
        let head = head.chain([format!("way ÷ {ORACLE} [95 %]")]).collect();
        let worlds = 0..self.suite.worlds.len();
        let line = |strategy: usize| {
            let ratio = |measure: Measure| {
                let pairs = worlds.clone().flat_map(|world| self.pairs(world, strategy, measure));
                pairs
                    .filter(|[own, first]| *own > 0.0 && *first > 0.0)
                    .map(|[own, first]| (own / first).ln())
                    .collect::<Vec<_>>()
            };
            let complete: usize = worlds.clone().map(|world| self.complete(world, strategy).count()).sum();
            let all = self.rows.keys().filter(|case| case.strategy == strategy).count();
            let mut cells = vec![self.suite.strategies[strategy].name.clone(), format!("{complete} of {all}")];
            cells.push(ratio(WAY).len().to_string());
            cells.extend(
                [WAY, WAY_99].map(|measure| if strategy == 0 { "1".to_owned() } else { shown_ratio(&ratio(measure)) }),
            );
            let over: Vec<f64> = worlds.clone().flat_map(|world| self.over_oracle(world, strategy)).collect();
            cells.push(Paired::of(&over).map_or("–".to_owned(), |over| shown_exp(&over)));
            cells
        };
        Table { caption: "All worlds".to_owned(), head, lines: (0..self.suite.strategies.len()).map(line).collect() }
    }

    fn of_world(&self, world: usize) -> Table {
        let entry = &self.suite.worlds[world];
        let first = &self.suite.strategies[0].name;
        let mut head: Vec<String> = ["strategy", "complete", "way m"].map(str::to_owned).to_vec();
        head.extend([format!("− {first} [95 %], p"), format!("÷ {ORACLE}")]);
        head.extend(SHARES.map(|share| format!("to {}", percent(share))));
        let others = [
            "area m",
            "scans",
            "rotation °",
            "travel s",
            SEEN,
            "recall %",
            "precision %",
            "contacts",
            "plan p50, p99 ms",
        ];
        head.extend(others.map(str::to_owned));
        if self.has_noise(world) {
            head.extend(["as exact %", "as exact, of known %"].map(str::to_owned));
        }
        if !entry.references.is_empty() {
            head.push("published way m".to_owned());
        }
        let mut lines: Vec<Vec<String>> =
            (0..self.suite.strategies.len()).map(|strategy| self.line(world, strategy)).collect();
        lines.extend(self.oracle_line(world, &head));
        // What others have measured of a strategy that is not in the suite.
        let is_here = |name: &str| self.suite.strategies.iter().any(|one| one.name == name);
        for reference in entry.references.iter().filter(|one| !is_here(&one.strategy)) {
            let mut cells = vec![reference.strategy.clone(), "not run".to_owned()];
            cells.resize(head.len() - 1, "–".to_owned());
            cells.push(published(reference));
            lines.push(cells);
        }
        Table { caption: entry.name.clone(), head, lines }
    }

    /// Whether maps of a world were held against those without noise.
    fn has_noise(&self, world: usize) -> bool {
        self.rows.values().any(|row| row.case.world == world && row.outcome.agreement.is_some())
    }

    /// What the oracle's ways come to; `None`: there are none.
    fn oracle_line(&self, world: usize, head: &[String]) -> Option<Vec<String>> {
        let lengths: Vec<Length> = self.oracle(world).into_values().collect();
        let ways = Sample::of(&lengths.iter().map(|length| length.way_m).collect::<Vec<_>>())?;
        let seen = Sample::of(&lengths.iter().map(|length| length.seen).collect::<Vec<_>>())?;
        let mut cells = vec![format!("{ORACLE}: knows the world, no bound"), format!("{} starts", lengths.len())];
        cells.extend([format!("{:.1} ± {:.1}", ways.mean, ways.sd), "–".to_owned(), "1".to_owned()]);
        let others = head.iter().skip(cells.len()).map(|name| match name == SEEN {
            true => format!("{:.2}", 100.0 * seen.mean),
            false => "–".to_owned(),
        });
        cells.extend(others.collect::<Vec<_>>());
        Some(cells)
    }

    fn line(&self, world: usize, strategy: usize) -> Vec<String> {
        let entry = &self.suite.worlds[world];
        let runs: Vec<&Outcome> = self.complete(world, strategy).map(|(_, outcome)| outcome).collect();
        let all = self.rows.keys().filter(|case| case.world == world && case.strategy == strategy).count();
        let mean = |measure: Measure, decimals: usize| mean_of(&runs, measure, decimals);
        let name = &self.suite.strategies[strategy].name;
        let mut cells = vec![name.clone(), format!("{} of {all}", runs.len())];
        let ways: Vec<f64> = runs.iter().map(|run| run.way_m).collect();
        cells.push(Sample::of(&ways).map_or("–".to_owned(), |way| format!("{:.1} ± {:.1}", way.mean, way.sd)));
        let differences: Vec<f64> = self.pairs(world, strategy, WAY).iter().map(|[own, first]| own - first).collect();
        cells.push(if strategy == 0 { "0".to_owned() } else { shown_difference(&differences) });
        let over = Sample::of(&self.over_oracle(world, strategy));
        cells.push(over.map_or("–".to_owned(), |over| format!("{:.2}", over.mean.exp())));
        let marks = (0..SHARES.len()).map(|place| mean_of(&runs, |run| run.marks[place].map(|mark| mark.way_m), 1));
        cells.extend(marks);
        cells.push(mean(|run| Some(run.area_m), 2));
        cells.push(mean(|run| Some(run.scans as f64), 0));
        cells.push(mean(|run| Some(run.rotation_deg), 0));
        cells.push(mean(|run| run.travel_secs, 0));
        let shares: [Measure; 3] = [|run| Some(run.coverage), |run| run.recall, |run| run.precision];
        cells.extend(shares.map(|share| percent_of(&runs, share)));
        let contacts: u64 = self
            .rows
            .values()
            .filter(|row| row.case.world == world && row.case.strategy == strategy)
            .map(|row| row.outcome.contacts)
            .sum();
        cells.push(contacts.to_string());
        let millis: [Measure; 2] =
            [|run| Some(1e3 * run.times.plan_p50_secs), |run| Some(1e3 * run.times.plan_p99_secs)];
        cells.push(millis.map(|time| mean(time, 1)).join(", "));
        if self.has_noise(world) {
            let shares: [Measure; 2] =
                [|run| run.agreement.map(|one| one.of_world), |run| run.agreement.map(|one| one.of_known)];
            cells.extend(shares.map(|share| percent_of(&runs, share)));
        }
        if !entry.references.is_empty() {
            let own: Vec<String> = entry.references.iter().filter(|one| one.strategy == *name).map(published).collect();
            cells.push(if own.is_empty() { "–".to_owned() } else { own.join(", ") });
        }
        cells
    }

    /// A line for each run that is not complete; `None`: all are.
    fn failures(&self) -> Option<Table> {
        let failed: Vec<Vec<String>> = self
            .rows
            .values()
            .filter(|row| !row.outcome.is_complete())
            .map(|row| {
                let Case { world, start, strategy } = row.case;
                let (world, strategy) = (&self.suite.worlds[world].name, &self.suite.strategies[strategy].name);
                let Outcome { end, reason, scans, way_m, .. } = &row.outcome;
                let reason = reason.replace('|', "/");
                vec![
                    world.clone(),
                    (start + 1).to_string(),
                    strategy.clone(),
                    end.word().to_owned(),
                    reason,
                    scans.to_string(),
                    format!("{way_m:.1}"),
                ]
            })
            .collect();
        let head = ["world", "start", "strategy", "end", "why", "scans", "way m"].map(str::to_owned).to_vec();
        let caption = format!("Not complete, and no part of any mean: {}", failed.len());
        (!failed.is_empty()).then_some(Table { caption, head, lines: failed })
    }
}

/// `99.9 %`
fn percent(share: f64) -> String {
    format!("{} %", (share * 1e3).round() / 10.0)
}

fn published(reference: &crate::suite::Reference) -> String {
    let sd = reference.sd_m.map_or(String::new(), |sd| format!(" ± {sd}"));
    let source = if reference.source.is_empty() { String::new() } else { format!(" ({})", reference.source) };
    format!("{}{sd}{source}", reference.way_m)
}

/// A mean; of how many, if some have no such number.
fn mean_of(runs: &[&Outcome], measure: impl Fn(&Outcome) -> Option<f64>, decimals: usize) -> String {
    let values: Vec<f64> = runs.iter().filter_map(|run| measure(run)).collect();
    let Some(sample) = Sample::of(&values) else { return "–".to_owned() };
    let of = if values.len() < runs.len() { format!(" ({} of {})", values.len(), runs.len()) } else { String::new() };
    format!("{:.decimals$}{of}", sample.mean)
}

fn percent_of(runs: &[&Outcome], measure: Measure) -> String {
    let values: Vec<f64> = runs.iter().filter_map(|run| measure(run)).collect();
    Sample::of(&values).map_or("–".to_owned(), |sample| format!("{:.2}", 100.0 * sample.mean))
}

fn shown_difference(differences: &[f64]) -> String {
    let Some(Paired { mean, interval: [low, high], p, .. }) = Paired::of(differences) else { return "–".to_owned() };
    format!("{mean:+.1} [{low:+.1}, {high:+.1}], {}", shown_p(p))
}

fn shown_ratio(logarithms: &[f64]) -> String {
    Paired::of(logarithms).map_or("–".to_owned(), |paired| format!("{}, {}", shown_exp(&paired), shown_p(paired.p)))
}

/// A geometric mean with its interval, of logarithms.
fn shown_exp(Paired { mean, interval: [low, high], .. }: &Paired) -> String {
    format!("{:.3} [{:.3}, {:.3}]", mean.exp(), low.exp(), high.exp())
}

/// With a star where chance alone is taken to be ruled out (p < 0.05).
fn shown_p(p: f64) -> String {
    let star = if p < 0.05 { " *" } else { "" };
    if p < 0.001 { format!("p < 0.001{star}") } else { format!("p = {p:.3}{star}") }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::outcome::End;
    use crate::outcome::tests::complete;

    fn suite() -> Suite {
        let text = "<Suite starts='4'><World mission='car'><Reference explorer='B' way='9.3 m' sd='2.39' source='6.16'/>\
                    <Reference explorer='C' way='22'/></World><Explorer type='A'/><Explorer type='B'/></Suite>";
        Suite::parse(text, Path::new("s.xml")).unwrap()
    }

    /// Ways of strategy A and of B from each start; the last run of B was capped.
    fn rows(ways: [[f64; 2]; 4]) -> BTreeMap<Case, Row> {
        let mut rows = BTreeMap::new();
        for (start, pair) in ways.into_iter().enumerate() {
            for (strategy, way_m) in pair.into_iter().enumerate() {
                let case = Case { world: 0, start, strategy };
                rows.insert(case, Row { case, start: None, outcome: complete(way_m) });
            }
        }
        let last = rows.get_mut(&Case { world: 0, start: 3, strategy: 1 }).unwrap();
        (last.outcome.end, last.outcome.reason) = (End::Capped, "more than 5 scans".into());
        rows
    }

    #[test]
    fn a_run_that_is_not_complete_is_shown_and_is_no_part_of_a_mean() {
        let (suite, rows) = (suite(), rows([[10.0, 12.0], [20.0, 23.0], [30.0, 34.0], [40.0, 1000.0]]));
        let length = |way_m: f64| Some(Length { way_m, seen: 0.9993 });
        let lengths =
            Lengths::from([((0, 0), length(5.0)), ((0, 1), length(8.0)), ((0, 2), None), ((1, 0), length(1.0))]);
        let tables = Rows::new(&suite, &rows, &lengths).tables();
        let [overall, parts, car, on_the_way, failures] = &tables[..] else { panic!("{tables:?}") };
        for table in [parts, on_the_way] {
            assert!(
                table.lines.len() == 2 && table.lines.iter().all(|line| line.len() == table.head.len()),
                "{table:?}"
            );
        }
        assert_eq!(car.lines[0][..5], ["A", "4 of 4", "25.0 ± 12.9", "0", "2.24"]);
        // Differences 2, 3 and 4: mean 3, standard error 1/√3, t(0.975, 2) = 4.3027, t = 5.196: p = 0.0351.
        assert_eq!(car.lines[1][..4], ["B", "3 of 4", "23.0 ± 11.0", "+3.0 [+0.5, +5.5], p = 0.035 *"]);
        assert_eq!(car.lines[1].last().unwrap(), "9.3 ± 2.39 (6.16)");
        // The geometric means of 10/5 and 20/8, and of 12/5 and 23/8; no way was found from the third start.
        assert_eq!(car.lines[1][4], "2.63");
        assert_eq!(car.lines[2][..5], ["Oracle: knows the world, no bound", "2 starts", "6.5 ± 2.1", "–", "1"]);
        assert_eq!(car.lines[2][13], "99.93");
        assert_eq!(car.lines[3][..2], ["C", "not run"]);
        assert!(car.lines.iter().all(|line| line.len() == car.head.len()), "{car:?}");
        assert_eq!(overall.lines[1][..3], ["B", "3 of 4", "3"]);
        // The geometric mean of 1.2, 1.15 and 34/30.
        assert!(overall.lines[1][3].starts_with("1.161 ["), "{overall:?}");
        assert_eq!(failures.lines, [["car", "4", "B", "capped", "more than 5 scans", "3", "1000.0"]]);
    }

    #[test]
    fn a_mark_that_some_did_not_reach_says_how_many_did() {
        let mut one = complete(5.0);
        one.marks[3] = Some(Mark { way_m: 4.0, ..Mark::default() });
        let way = |run: &Outcome| run.marks[3].map(|mark| mark.way_m);
        assert_eq!(mean_of(&[&one, &complete(6.0)], way, 1), "4.0 (1 of 2)");
        assert_eq!(mean_of(&[&complete(6.0)], way, 1), "–");
    }

    #[test]
    fn tables_are_markdown_and_html() {
        let table = Table {
            caption: "a < b".into(),
            head: vec!["x".into(), "y".into()],
            lines: vec![vec!["1".into(), "&".into()]],
        };
        assert_eq!(table.markdown(), "## a < b\n\n| x | y |\n|---|---|\n| 1 | & |\n\n");
        assert!(table.html().contains("<h2>a &lt; b</h2>") && table.html().contains("<td>&amp;</td>"));
    }
}
