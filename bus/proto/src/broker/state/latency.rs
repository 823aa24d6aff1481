//! How long messages take.

/// How long a client's messages took to the broker (s): `DB_QOS`.
#[derive(Debug, Default)]
pub struct Latency {
    pub recent: f64,
    pub min: f64,
    pub max: f64,
    sum: f64,
    measured: u64,
    count: u64,
}

impl Latency {
    /// Counts one message, and takes note of how long it took, if that is known.
    pub fn note(&mut self, secs: Option<f64>) {
        self.count += 1;
        secs.into_iter().for_each(|secs| self.measure(secs));
    }

    /// Takes note of how long something took.
    pub fn measure(&mut self, secs: f64) {
        // A client's time may be anything.
        if !secs.is_finite() {
            return;
        }
        // The broker's time is that of the beginning of its round, and the message may have come during it.
        let secs = secs.max(0.0);
        self.min = if self.measured == 0 { secs } else { self.min.min(secs) };
        self.max = self.max.max(secs);
        self.recent = secs;
        self.sum += secs;
        self.measured += 1;
    }

    /// Messages noted.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Their mean.
    pub fn mean(&self) -> f64 {
        self.sum / (self.measured.max(1) as f64)
    }

    /// `recent:max:min:average` (ms).
    pub fn text(&self) -> String {
        let ms = |secs: f64| format!("{:.3}", secs * 1e3);
        [self.recent, self.max, self.min, self.mean()].map(ms).join(":")
    }
}
