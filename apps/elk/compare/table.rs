//! Rows of a comparison as a table for people, a line a strategy, and as CSV, a line a run.

use elk_scope::Table;

use super::run::Row;

/// A column of the table: its head, its value in a row, and its decimals.
type Measure = (&'static str, fn(&Row) -> Option<f64>, usize);

const MEASURES: [Measure; 6] = [
    ("WAY m", |row| row.way_m, 1),
    ("SCANS", |row| row.scans, 1),
    ("TIME s", |row| row.seconds, 1),
    ("KNOWN m³", |row| row.known_m3, 2),
    ("ACCURACY %", |row| row.accuracy.map(|share| 100.0 * share), 2),
    ("CONTACTS", |row| row.contacts, 1),
];

/// Columns that can be done without, the first one first.
const SPARE: [usize; 4] = [7, 5, 6, 4];

/// A line a strategy: how many of its runs are complete, and mean ± standard deviation of what its runs measured, complete
/// or not.
pub fn table(rows: &[Row]) -> Table<'static> {
    let strategies = strategies(rows);
    let heads = ["STRATEGY", "COMPLETE"].into_iter().chain(MEASURES.iter().map(|(head, ..)| *head));
    let mut cells = vec![heads.map(str::to_owned).collect()];
    cells.extend(strategies.iter().map(|strategy| line(strategy, rows)));
    // The last column is free: an empty one has all others aligned.
    cells.iter_mut().for_each(|line: &mut Vec<String>| line.push(String::new()));
    let is_bad = |strategy: &str| rows.iter().any(|row| row.strategy == strategy && !row.complete);
    let bad = (1..).zip(&strategies).filter(|(_, strategy)| is_bad(strategy)).map(|(line, _)| line).collect();
    Table { rows: cells, right: &[1, 2, 3, 4, 5, 6, 7], spare: &SPARE, bad, all: "the CSV file" }
}

/// A word on strategies whose runs were all the same, whatever their seed: their spread of 0 says nothing.
pub fn unseeded(rows: &[Row]) -> String {
    let measured = |row: &Row| [row.way_m, row.scans, row.known_voxels, row.accuracy, row.contacts];
    let is_same = |strategy: &&str| {
        let own: Vec<&Row> = rows.iter().filter(|row| row.strategy == *strategy).collect();
        own.len() > 1 && own.iter().all(|row| row.complete && measured(row) == measured(own[0]))
    };
    let same: Vec<&str> = strategies(rows).into_iter().filter(is_same).collect();
    match same.is_empty() {
        true => String::new(),
        false => format!(
            "note: the seed made no difference to {}: their spread of 0 says nothing; a sensor's RandomStart=true or \
             NoiseSigma makes runs differ\n",
            same.join(", ")
        ),
    }
}

/// The strategies, each once, in the order of the rows.
fn strategies(rows: &[Row]) -> Vec<&str> {
    let mut strategies: Vec<&str> = Vec::new();
    for row in rows {
        if !strategies.contains(&row.strategy.as_str()) {
            strategies.push(&row.strategy);
        }
    }
    strategies
}

/// A line for each run that is not complete.
pub fn incomplete(rows: &[Row]) -> String {
    rows.iter().filter(|row| !row.complete).map(|row| format!("{row}\n")).collect()
}

fn line(strategy: &str, rows: &[Row]) -> Vec<String> {
    let own: Vec<&Row> = rows.iter().filter(|row| row.strategy == strategy).collect();
    let complete = own.iter().filter(|row| row.complete).count();
    let mut line = vec![strategy.to_owned(), format!("{complete} of {}", own.len())];
    line.extend(MEASURES.iter().map(|(_, value, decimals)| {
        let values: Vec<f64> = own.iter().filter_map(|row| value(row)).collect();
        mean_and_spread(&values, *decimals)
    }));
    line
}

/// Mean and standard deviation (of the sample, so over n − 1); of one value there is no spread.
fn mean_and_spread(values: &[f64], decimals: usize) -> String {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    match values.len() {
        0 => "-".to_owned(),
        1 => format!("{mean:.decimals$}"),
        _ => {
            let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
            format!("{mean:.decimals$} ± {:.decimals$}", (squares / (count - 1.0)).sqrt())
        }
    }
}

/// A line a run, under a line of names; what nobody said is empty.
pub fn csv(rows: &[Row]) -> String {
    let names = "strategy,seed,complete,way_m,scans,seconds,known_voxels,known_m3,accuracy,contacts,reason,run\n";
    let lines = rows.iter().map(|row| {
        let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        let numbers =
            [row.way_m, row.scans, row.seconds, row.known_voxels, row.known_m3, row.accuracy, row.contacts].map(number);
        let seed = row.seed.map_or(String::new(), |seed| seed.to_string());
        let (strategy, reason, run) = (quoted(&row.strategy), quoted(&row.reason), quoted(&row.run));
        format!("{strategy},{seed},{},{},{reason},{run}\n", row.complete, numbers.join(","))
    });
    names.to_owned() + &lines.collect::<String>()
}

/// A text as a cell of a CSV file (RFC 4180).
fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use elk_outside::colour::Style;

    use super::*;

    fn row(strategy: &str, seed: u64, way_m: Option<f64>) -> Row {
        let (strategy, complete) = (strategy.to_owned(), way_m.is_some());
        let reason = if complete { "done" } else { "the camera fell off, \"again\"" }.to_owned();
        Row { strategy, seed: Some(seed), complete, reason, way_m, ..Row::default() }
    }

    #[test]
    fn a_strategy_is_a_line_with_mean_and_spread_and_a_failure_says_why() {
        let rows = [row("A", 1, Some(1.0)), row("B", 1, Some(7.25)), row("A", 2, Some(3.0)), row("A", 3, None)];
        let shown = table(&rows).lines(None);
        let lines: Vec<&str> = shown.iter().map(|line| line.text.as_str()).collect();
        assert_eq!(lines[0].split_whitespace().take(4).collect::<Vec<_>>(), ["STRATEGY", "COMPLETE", "WAY", "m"]);
        assert!(lines[1].starts_with("A") && lines[1].contains("2 of 3  2.0 ± 1.4"), "{lines:?}");
        assert!(lines[2].starts_with("B") && lines[2].contains("1 of 1") && lines[2].contains(" 7.2"), "{lines:?}");
        assert_eq!((lines.len(), shown[1].style, shown[2].style), (3, Style::Bad, Style::Plain));
        assert_eq!(incomplete(&rows), "A, seed 3: NOT complete: the camera fell off, \"again\"\n");
        let narrow = table(&rows).lines(Some(40));
        assert!(narrow.iter().all(|line| line.text.chars().count() <= 40), "{narrow:?}");
        assert!(narrow[3].text.starts_with("no room here for"), "{narrow:?}");
    }

    /// Regression: three equal runs were a strategy with a spread of 0.
    #[test]
    fn runs_that_no_seed_changed_are_said_to_be_the_same() {
        let rows = [row("A", 1, Some(2.0)), row("A", 2, Some(2.0)), row("B", 1, Some(2.0)), row("B", 2, Some(2.1))];
        assert!(unseeded(&rows).starts_with("note: the seed made no difference to A: "), "{}", unseeded(&rows));
        assert_eq!(unseeded(&rows[2..]), "");
        assert_eq!(unseeded(&rows[1..3]), "", "a single run is no spread");
    }

    #[test]
    fn a_run_is_a_line_of_csv() {
        let text = csv(&[row("A", 1, Some(1.5)), row("./b", 2, None)]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[1], "A,1,true,1.5,,,,,,,done,");
        assert_eq!(lines[2], "./b,2,false,,,,,,,,\"the camera fell off, \"\"again\"\"\",");
        assert_eq!(lines[0].split(',').count(), lines[1].split(',').count());
    }
}
