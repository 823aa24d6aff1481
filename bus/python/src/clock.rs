//! The time of the community that this process has joined last, for whoever asks on any thread.

use std::sync::{Mutex, MutexGuard, PoisonError};

use elk_bus::clock::Clock;
use pyo3::prelude::*;

static PRESENT: Mutex<Present> = Mutex::new(Present { clock: None, joined: 0 });

/// The process' clock; how many clients have joined a community so far: the last one's clock it is.
struct Present {
    clock: Option<Clock>,
    joined: u64,
}

impl Present {
    fn lock() -> MutexGuard<'static, Self> {
        PRESENT.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn clock() -> Clock {
        Self::lock().clock.unwrap_or_else(|| Clock::new(1.0))
    }
}

/// A client's clock, which the process' follows until another client joins.
pub struct Followed {
    clock: Clock,
    number: u64,
}

impl Followed {
    /// That of a client that has just joined.
    pub fn joined(clock: Clock) -> Self {
        let mut present = Present::lock();
        present.joined += 1;
        present.clock = Some(clock);
        Self { clock, number: present.joined }
    }

    /// The client's clock is this now.
    pub fn follow(&mut self, clock: Clock) {
        if self.clock != clock {
            self.clock = clock;
            let mut present = Present::lock();
            if present.joined == self.number {
                present.clock = Some(clock);
            }
        }
    }
}

/// The time (s) of the community that this process has joined last, as its client knew it at its last callback; before that the
/// machine's, since 1970, times the warp. Without `apply_timewarping` it is the machine's as it is.
#[pyfunction]
#[pyo3(signature = (apply_timewarping=true))]
pub fn time(apply_timewarping: bool) -> f64 {
    if apply_timewarping { Present::clock().now() } else { Clock::new(1.0).own() }
}

/// The machine's time (s since 1970), times the warp if that is to be applied: what `time` is unless somebody drives the
/// community's clock, as a player of logs does.
#[pyfunction]
#[pyo3(signature = (apply_timewarping=true))]
pub fn local_time(apply_timewarping: bool) -> f64 {
    if apply_timewarping { Present::clock().own() } else { Clock::new(1.0).own() }
}

/// How many times as fast as the machine's the community's clock runs.
#[pyfunction]
pub fn get_moos_timewarp() -> f64 {
    Present::clock().warp()
}

/// Says so for a process that has joined no community yet; whether it is so. A community's own warp is what its broker was told
/// (`elk db --time-warp`), and no client changes it.
#[pyfunction]
pub fn set_moos_timewarp(warp: f64) -> bool {
    let mut present = Present::lock();
    if present.joined == 0 && warp.is_finite() && warp > 0.0 {
        present.clock = Some(Clock::new(warp));
    }
    present.clock.is_some_and(|clock| clock.warp() == warp)
}
