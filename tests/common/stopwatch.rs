//! What something costs, in CPU time of this thread.

use rustix::time::{ClockId, clock_gettime};

#[allow(clippy::disallowed_methods)] // A stopwatch: no decision and no output but the table depends on it.
fn now() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 / 1e6
}

/// The least time of some turns, milliseconds, and what came of the last one.
pub fn least<T>(turns: usize, mut work: impl FnMut() -> T) -> (f64, T) {
    let mut timed = || {
        let start = now();
        let done = work();
        (now() - start, done)
    };
    let first = timed();
    (1..turns).map(|_| timed()).fold(first, |best, next| (best.0.min(next.0), next.1))
}
