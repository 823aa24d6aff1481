//! How late messages were said: counts by size, so that a long replay costs no memory.

use std::time::Duration;

/// Steps of a doubling.
const STEPS: f64 = 8.0;
/// Sizes from below a microsecond to beyond an hour.
const SIZES: usize = 40 * STEPS as usize;

/// Latenesses, counted by size.
#[derive(Debug, Clone, PartialEq)]
pub struct Lateness {
    counts: Vec<u64>,
    total: u64,
}

impl Default for Lateness {
    fn default() -> Self {
        Self { counts: vec![0; SIZES], total: 0 }
    }
}

impl Lateness {
    /// Counts one message.
    pub fn note(&mut self, late: Duration) {
        let micros = (late.as_secs_f64() * 1e6).max(1.0);
        let size = (micros.log2() * STEPS).round() as usize;
        self.counts[size.min(SIZES - 1)] += 1;
        self.total += 1;
    }

    /// The lateness that `share` of the messages (0 to 1) did not exceed, to a tenth of itself.
    pub fn quantile(&self, share: f64) -> Duration {
        let wanted = (share * self.total as f64).ceil() as u64;
        let mut seen = 0;
        for (size, count) in self.counts.iter().enumerate() {
            seen += count;
            if seen >= wanted && seen > 0 {
                return Duration::from_secs_f64((size as f64 / STEPS).exp2() * 1e-6);
            }
        }
        Duration::ZERO
    }

    /// Messages counted.
    pub fn total(&self) -> u64 {
        self.total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_what_was_counted() {
        let mut lateness = Lateness::default();
        assert_eq!(lateness.quantile(0.5), Duration::ZERO);
        (1..=1000).for_each(|micros| lateness.note(Duration::from_micros(micros)));
        for (share, micros) in [(0.5, 500.0), (0.99, 990.0), (1.0, 1000.0)] {
            let found = lateness.quantile(share).as_secs_f64() * 1e6;
            assert!((found / micros - 1.0_f64).abs() < 0.1, "{share}: {found} instead of {micros}");
        }
    }
}
