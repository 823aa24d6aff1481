//! The only place that reads a clock of the operating system.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// A community's clock: seconds since the Unix epoch times the community's time warp, as in MOOS.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    warp: f64,
}

impl Clock {
    /// A clock that runs `warp` times as fast as the wall's (MOOS' time warp; 1: real time).
    pub fn new(warp: f64) -> Self {
        Self { warp }
    }

    /// How much faster than the wall's clock it runs.
    pub fn warp(&self) -> f64 {
        self.warp
    }

    /// The community's time (s).
    #[allow(clippy::disallowed_methods, reason = "this is the one clock")]
    pub fn now(&self) -> f64 {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        since.as_secs_f64() * self.warp
    }

    /// How long the wall's clock takes for `secs` of the community's time.
    pub fn real(&self, secs: f64) -> Duration {
        Duration::try_from_secs_f64((secs / self.warp).max(0.0)).unwrap_or(Duration::MAX)
    }
}

/// Seconds of the wall's clock since some fixed moment; never runs backwards.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch(Instant);

impl Stopwatch {
    /// Starts now.
    #[allow(clippy::disallowed_methods, reason = "this is the one clock")]
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// Time since the start.
    pub fn elapsed(&self) -> Duration {
        self.0.elapsed()
    }
}

/// Nanoseconds of `CLOCK_MONOTONIC`: the same in every process of the machine.
pub fn monotonic_nanos() -> u64 {
    nanos(rustix::time::ClockId::Monotonic)
}

/// Seconds of CPU that the calling thread has used.
pub fn thread_cpu_secs() -> f64 {
    nanos(rustix::time::ClockId::ThreadCPUTime) as f64 * 1e-9
}

/// Seconds of CPU that the process has used.
pub fn process_cpu_secs() -> f64 {
    nanos(rustix::time::ClockId::ProcessCPUTime) as f64 * 1e-9
}

fn nanos(clock: rustix::time::ClockId) -> u64 {
    let t = rustix::time::clock_gettime(clock);
    t.tv_sec as u64 * 1_000_000_000 + t.tv_nsec as u64
}
