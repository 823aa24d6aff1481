//! What a run cost to get how far.

use crate::checks::{MAX_COUNT, MAX_REMEMBERED};
use crate::messages::{CoverageMark, CoverageSample, MotionReport};

/// The shares of the final free voxels that are reported.
const SHARES: [f64; 4] = [0.95, 0.99, 0.999, 1.0];

/// How much was known after each scan, and how long the way was.
///
/// It holds no more than a successor is told. Of a run of more scans it keeps every second, then every fourth, and so on, and
/// always the last: a mark is then late by as many scans at most.
#[derive(Debug, Clone, Default)]
pub struct Record {
    samples: Vec<CoverageSample>,
}

impl From<Vec<CoverageSample>> for Record {
    fn from(samples: Vec<CoverageSample>) -> Self {
        Self { samples }
    }
}

impl Record {
    /// One more scan is in the map.
    pub fn add(&mut self, free: u64, path_length_m: f64) {
        self.take(CoverageSample { scans: self.scans() + 1, free, path_length_m });
    }

    /// What was known after as many scans as a sample says; of no more scans than before it says nothing new.
    pub fn take(&mut self, sample: CoverageSample) {
        let scans = sample.scans.min(MAX_COUNT);
        if scans <= self.scans() {
            return;
        }
        let stride = stride(scans);
        let kept = |sample: &CoverageSample| sample.scans.is_multiple_of(stride);
        self.samples.pop_if(|last| !kept(last));
        if self.samples.len() >= MAX_REMEMBERED {
            self.samples.retain(kept);
        }
        self.samples.push(CoverageSample { scans, ..sample });
    }

    /// Scans so far.
    pub fn scans(&self) -> u64 {
        self.samples.last().map_or(0, |sample| sample.scans)
    }

    /// What was known after each scan that is kept.
    pub fn samples(&self) -> &[CoverageSample] {
        &self.samples
    }

    /// Scans and way to each share of what is known now, if that is anything. A share counts as known from the first scan on
    /// after which as many free voxels were known.
    pub fn report(&self) -> MotionReport {
        let free = self.samples.last().map_or(0, |s| s.free);
        let path_length_m = self.samples.last().map_or(0.0, |s| s.path_length_m);
        let mark = |share: f64| {
            let enough = (share * free as f64).ceil() as u64;
            let first = self.samples.iter().find(|s| s.free >= enough);
            // The whole run is what it cost, even if nothing was learned in its last scans.
            let CoverageSample { scans, path_length_m, .. } =
                *if share < 1.0 { first? } else { self.samples.last()? };
            Some(CoverageMark { share, scans, path_length_m })
        };
        MotionReport {
            scans: self.scans(),
            path_length_m,
            free,
            marks: SHARES.into_iter().filter(|_| free > 0).filter_map(mark).collect(),
        }
    }
}

/// Of so many scans every how manieth is kept: a power of two, so that what is kept later was kept before.
fn stride(scans: u64) -> u64 {
    (scans / MAX_REMEMBERED as u64 + 1).next_power_of_two()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_where_the_share_was_first_reached() {
        let mut record = Record::default();
        for (free, path) in [(500, 0.0), (950, 1.0), (989, 2.0), (999, 3.0), (1000, 4.0), (1000, 5.0)] {
            record.add(free, path);
        }
        let report = record.report();
        let marks: Vec<_> = report.marks.iter().map(|m| (m.share, m.scans, m.path_length_m)).collect();
        assert_eq!(marks, [(0.95, 2, 1.0), (0.99, 4, 3.0), (0.999, 4, 3.0), (1.0, 6, 5.0)]);
        assert_eq!((report.scans, report.path_length_m, report.free), (6, 5.0, 1000));
    }

    /// Regression: of a longer run more was left to a successor than it believes, so it was refused all of it.
    #[test]
    fn of_a_long_run_no_more_is_kept_than_a_successor_is_told() {
        let mut record = Record::default();
        let scans = 3 * MAX_REMEMBERED as u64;
        (1..=scans).for_each(|n| record.add(n.min(scans / 2), n as f64));
        let kept = record.samples();
        assert!((MAX_REMEMBERED / 2..=MAX_REMEMBERED).contains(&kept.len()) && kept.is_sorted_by_key(|s| s.scans));
        let report = Record::from(kept.to_vec()).report();
        assert_eq!((report.scans, report.path_length_m, report.free), (scans, scans as f64, scans / 2));
        let [most, .., all] = &report.marks[..] else { panic!("{report:?}") };
        let exact = (0.95 * (scans / 2) as f64).ceil() as u64;
        assert!((exact..exact + 4).contains(&most.scans), "{most:?}, and exactly it is {exact}");
        assert_eq!((most.path_length_m, all.scans), (most.scans as f64, scans));
    }

    #[test]
    fn without_a_scan_there_is_no_mark() {
        assert!(Record::default().report().marks.is_empty());
        let mut blind = Record::default();
        blind.add(0, 0.0);
        assert!(blind.report().marks.is_empty(), "all of nothing is no mark either");
    }
}
