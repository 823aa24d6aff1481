//! What a run cost to get how far.

use elk_spatial::messages::{CoverageMark, CoverageSample, MotionReport};

/// The shares of the final free voxels that are reported.
const SHARES: [f64; 4] = [0.95, 0.99, 0.999, 1.0];

/// How much was known after each scan, and how long the way was.
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
        self.samples.push(CoverageSample { free, path_length_m });
    }

    /// What was known after each scan.
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
            let i = self.samples.iter().position(|s| s.free >= enough)?;
            // The whole run is what it cost, even if nothing was learned in its last scans.
            let i = if share < 1.0 { i } else { self.samples.len() - 1 };
            Some(CoverageMark { share, scans: i as u64 + 1, path_length_m: self.samples[i].path_length_m })
        };
        MotionReport {
            scans: self.samples.len() as u64,
            path_length_m,
            free,
            marks: SHARES.into_iter().filter(|_| free > 0).filter_map(mark).collect(),
        }
    }
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

    #[test]
    fn without_a_scan_there_is_no_mark() {
        assert!(Record::default().report().marks.is_empty());
        let mut blind = Record::default();
        blind.add(0, 0.0);
        assert!(blind.report().marks.is_empty(), "all of nothing is no mark either");
    }
}
