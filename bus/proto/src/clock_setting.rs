//! What a community's clock is set to, as it is said between clients and broker.

use serde::{Deserialize, Serialize};

/// What a community's clock is set to by whoever drives it: at own time `at` (s) it showed `time` (s), and since then it has
/// run `rate` times as fast as by itself; at 0 it stands still.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClockSetting {
    /// A moment of the clock's own time (s).
    pub at: f64,
    /// What it showed then (s).
    pub time: f64,
    /// How fast it runs.
    pub rate: f64,
}

impl ClockSetting {
    /// What the clock shows when its own time is `own` (s).
    pub fn time(&self, own: f64) -> f64 {
        self.time + (own - self.at) * self.rate
    }
}
