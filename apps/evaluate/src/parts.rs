//! What ways are made of: how much of them is the tail, what of it was in sight before, and what they have over the oracle's.

use crate::outcome::Outcome;
use crate::statistics::Sample;
use crate::tail::{DETOUR_M, LATE};

/// Names of what [`cells`] says.
pub fn heads(reference: &str) -> Vec<String> {
    let late = 100.0 * LATE;
    vec![
        "runs".to_owned(),
        format!("way after {late} %, of all %"),
        "seen there: was in sight %".to_owned(),
        format!("or for {DETOUR_M} m %"),
        format!("to {late} % ÷ {reference}"),
        "+ to the last free voxel".to_owned(),
        "+ to the last surface voxel".to_owned(),
        "+ in vain".to_owned(),
        format!("= way ÷ {reference}"),
    ]
}

/// The parts of a way, one after the other (m): to [`LATE`] of what is visible, on to the last visible free voxel, on to the last
/// surface voxel that can be seen, and what came after that and showed neither. They sum up to the way.
pub fn parts_m(run: &Outcome) -> Option<[f64; 4]> {
    let (late, free) = (run.marks[2]?.way_m, run.last_m[0]?);
    let surface = run.last_m[1].unwrap_or(free).max(free);
    Some([late, free - late, surface - free, run.way_m - surface])
}

/// What complete runs come to, each with the length of the oracle's way from its start (m), if that is known: means.
pub fn cells(runs: &[(&Outcome, Option<f64>)]) -> Vec<String> {
    let mean = |values: Vec<f64>| Sample::of(&values).map(|sample| sample.mean);
    let percent = |values: Vec<f64>| mean(values).map_or("–".to_owned(), |mean| format!("{:.1}", 100.0 * mean));
    let of_parts: Vec<_> = runs.iter().filter_map(|(run, oracle)| Some((run, parts_m(run)?, *oracle))).collect();
    let mut cells = vec![of_parts.len().to_string()];
    cells.push(percent(of_parts.iter().map(|(run, [late, ..], _)| 1.0 - late / run.way_m.max(*late)).collect()));
    cells.push(percent(runs.iter().filter_map(|(run, _)| Some(run.tail?.in_sight)).collect()));
    cells.push(percent(runs.iter().filter_map(|(run, _)| Some(run.tail?.by_detour)).collect()));
    let known =
        || of_parts.iter().filter_map(|(run, parts, oracle)| Some((run.way_m, parts, (*oracle).filter(|m| *m > 0.0)?)));
    let over = (0..4).map(|part| mean(known().map(|(_, parts, oracle)| parts[part] / oracle).collect()));
    let sum = mean(known().map(|(way_m, _, oracle)| way_m / oracle).collect());
    cells.extend(over.chain([sum]).map(|mean| mean.map_or("–".to_owned(), |mean| format!("{mean:.2}"))));
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::Mark;
    use crate::outcome::tests::complete;
    use crate::tail::Tail;

    #[test]
    fn the_parts_of_a_way_sum_up_to_it() {
        let mark = |way_m: f64| Some(Mark { way_m, ..Mark::default() });
        let mut run = complete(10.0);
        (run.marks[2], run.last_m) = (mark(4.0), [Some(7.0), Some(9.0)]);
        run.tail = Some(Tail { voxels: 8, in_sight: 0.25, by_detour: 0.5 });
        assert_eq!(parts_m(&run), Some([4.0, 3.0, 2.0, 1.0]));
        assert_eq!(
            cells(&[(&run, Some(5.0)), (&complete(1.0), Some(1.0))]),
            ["1", "60.0", "25.0", "50.0", "0.80", "0.60", "0.40", "0.20", "2.00"]
        );
        assert_eq!(cells(&[(&run, None)])[4..], ["–"; 5]);
        // The last surface voxel may have been known before the last free one.
        run.last_m = [Some(7.0), Some(2.0)];
        assert_eq!(parts_m(&run), Some([4.0, 3.0, 0.0, 3.0]));
        assert_eq!(parts_m(&complete(1.0)), None);
        assert_eq!(heads("Oracle").len(), cells(&[]).len());
    }
}
