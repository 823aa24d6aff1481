//! When to say what was said: recorded time on the wall's clock, at any rate, with pauses and jumps.
//!
//! A state machine that is handed the time and sleeps nowhere: the player asks it what to do.

use std::str::FromStr;
use std::time::Duration;

use elk_outside::time;

/// A step back in recorded time by more than this (s) is not waited for: what follows is played at its own pace.
const STEP_BACK_SECS: f64 = 1.0;
/// The slowest rate.
const SLOWEST: f64 = 0.1;
/// The fastest rate that is not [`Rate::Max`].
const FASTEST: f64 = 1000.0;

/// How fast recorded time passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rate {
    /// So many times as fast as it did.
    Times(f64),
    /// As fast as the machine can.
    Max,
}

/// A text that is no rate.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("right is a number from {SLOWEST} to {FASTEST}, or max")]
pub struct RateError;

impl FromStr for Rate {
    type Err = RateError;

    fn from_str(text: &str) -> Result<Self, RateError> {
        if text == "max" {
            return Ok(Rate::Max);
        }
        let times: f64 = text.parse().map_err(|_| RateError)?;
        if (SLOWEST..=FASTEST).contains(&times) { Ok(Rate::Times(times)) } else { Err(RateError) }
    }
}

impl Rate {
    /// Twice as fast, or half as fast; what is as fast as can be slows down to the fastest number.
    pub fn changed(self, faster: bool) -> Self {
        match (self, faster) {
            (Rate::Max, true) => Rate::Max,
            (Rate::Max, false) => Rate::Times(FASTEST),
            (Rate::Times(times), true) => Rate::Times((times * 2.0).min(FASTEST)),
            (Rate::Times(times), false) => Rate::Times((times / 2.0).max(SLOWEST)),
        }
    }
}

impl std::fmt::Display for Rate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Rate::Times(times) => write!(f, "{times}x"),
            Rate::Max => f.write_str("max"),
        }
    }
}

/// What to do about the next message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wait {
    /// Say it.
    Now,
    /// Wait so long (real time).
    For(Duration),
    /// Wait until somebody resumes.
    Paused,
}

/// Recorded time against the real one.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    rate: Rate,
    /// A moment of real time, and the recorded time (s) at it.
    anchor: Option<(Duration, f64)>,
    paused: bool,
    /// Recorded time of the message asked for last (s).
    last: f64,
}

impl Schedule {
    /// Starts with the first message that is asked for.
    pub fn new(rate: Rate) -> Self {
        Self { rate, anchor: None, paused: false, last: f64::NEG_INFINITY }
    }

    /// The rate.
    pub fn rate(&self) -> Rate {
        self.rate
    }

    /// Whether it stands still.
    pub fn paused(&self) -> bool {
        self.paused
    }

    /// What to do at `now` about the message that was recorded at `recorded` (s).
    pub fn wait(&mut self, now: Duration, recorded: f64) -> Wait {
        if self.anchor.is_none() || recorded < self.last - STEP_BACK_SECS {
            self.anchor = Some((now, recorded));
        }
        self.last = recorded;
        if self.paused {
            return Wait::Paused;
        }
        match self.due(recorded) {
            Some(due) if due > now => Wait::For(due - now),
            _ => Wait::Now,
        }
    }

    /// When the message that was recorded at `recorded` (s) is to be said; nothing: at once.
    pub fn due(&self, recorded: f64) -> Option<Duration> {
        let ((start, origin), Rate::Times(times)) = (self.anchor?, self.rate) else {
            return None;
        };
        Some(start.saturating_add(time::duration((recorded - origin) / times)))
    }

    /// The recorded time (s) at `now`; nothing: no message was asked for yet.
    pub fn position(&self, now: Duration) -> Option<f64> {
        let (start, origin) = self.anchor?;
        Some(match self.rate {
            _ if self.paused => origin,
            Rate::Times(times) => origin + now.saturating_sub(start).as_secs_f64() * times,
            Rate::Max => self.last,
        })
    }

    /// What a clock that goes by recorded time shows at `now` (s), and how many times as fast as the wall's it runs:
    /// not at all during a pause, and at rate `max`, where it steps from message to message. Nothing: as above.
    pub fn clock(&self, now: Duration) -> Option<(f64, f64)> {
        let rate = match self.rate {
            Rate::Times(times) if !self.paused => times,
            _ => 0.0,
        };
        Some((self.position(now)?, rate))
    }

    /// Stands still, or goes on.
    pub fn pause(&mut self, now: Duration, paused: bool) {
        let position = self.position(now);
        self.anchor = position.map(|position| (now, position));
        self.paused = paused;
    }

    /// Goes on at another rate.
    pub fn set_rate(&mut self, now: Duration, rate: Rate) {
        self.anchor = self.position(now).map(|position| (now, position));
        self.rate = rate;
    }

    /// So much real time has passed that is no recorded time.
    pub fn pass_over(&mut self, time: Duration) {
        self.anchor = self.anchor.map(|(start, origin)| (start.saturating_add(time), origin));
    }

    /// Goes on from the recorded time `to` (s).
    pub fn jump(&mut self, now: Duration, to: f64) {
        self.anchor = Some((now, to));
        self.last = to;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn secs(secs: f64) -> Duration {
        Duration::from_secs_f64(secs)
    }

    #[test]
    fn messages_are_as_far_apart_as_they_were_at_the_rate() {
        let mut schedule = Schedule::new(Rate::Times(2.0));
        assert_eq!(schedule.wait(secs(100.0), 5000.0), Wait::Now, "the first one begins");
        assert_eq!(schedule.wait(secs(100.0), 5001.0), Wait::For(secs(0.5)));
        assert_eq!(schedule.wait(secs(100.5), 5001.0), Wait::Now);
        assert_eq!(schedule.wait(secs(102.0), 5001.5), Wait::Now, "what is late is said at once");
        assert_eq!(schedule.wait(secs(102.0), 5008.0), Wait::For(secs(2.0)), "and nothing shifts for it");
    }

    #[test]
    fn a_pause_takes_no_recorded_time_and_a_new_rate_holds_from_now_on() {
        let mut schedule = Schedule::new(Rate::Times(1.0));
        schedule.wait(secs(0.0), 10.0);
        schedule.pause(secs(1.0), true);
        assert_eq!((schedule.wait(secs(50.0), 12.0), schedule.position(secs(50.0))), (Wait::Paused, Some(11.0)));
        assert_eq!(schedule.clock(secs(50.0)), Some((11.0, 0.0)));
        schedule.pause(secs(60.0), false);
        assert_eq!(schedule.wait(secs(60.0), 12.0), Wait::For(secs(1.0)));
        schedule.set_rate(secs(60.5), Rate::Times(0.5));
        assert_eq!(schedule.wait(secs(60.5), 12.0), Wait::For(secs(1.0)));
        assert_eq!(schedule.clock(secs(61.5)), Some((12.0, 0.5)));
        schedule.set_rate(secs(60.5), Rate::Max);
        assert_eq!(schedule.wait(secs(60.5), 99.0), Wait::Now);
        assert_eq!(schedule.clock(secs(99.5)), Some((99.0, 0.0)));
    }

    #[test]
    fn a_clock_that_was_set_back_costs_no_pause_and_no_rush() {
        let mut schedule = Schedule::new(Rate::Times(1.0));
        schedule.wait(secs(0.0), 1000.0);
        assert_eq!(schedule.wait(secs(0.0), 999.5), Wait::Now, "a little back: late");
        assert_eq!(schedule.wait(secs(1.0), 10.0), Wait::Now, "far back: a new beginning");
        assert_eq!(schedule.wait(secs(1.0), 12.0), Wait::For(secs(2.0)));
    }

    #[test]
    fn a_jump_goes_both_ways() {
        let mut schedule = Schedule::new(Rate::Times(1.0));
        schedule.wait(secs(0.0), 10.0);
        for to in [50.0, 20.0] {
            schedule.jump(secs(3.0), to);
            assert_eq!(schedule.wait(secs(3.0), to + 1.0), Wait::For(secs(1.0)));
        }
    }

    #[test]
    fn time_that_is_passed_over_makes_nothing_due() {
        let mut schedule = Schedule::new(Rate::Times(2.0));
        schedule.wait(secs(0.0), 10.0);
        schedule.pass_over(secs(100.0));
        assert_eq!(schedule.position(secs(101.0)), Some(12.0));
        assert_eq!(schedule.wait(secs(101.0), 13.0), Wait::For(secs(0.5)));
    }

    #[test]
    fn rates_are_numbers_within_bounds_or_max() {
        assert_eq!("max".parse(), Ok(Rate::Max));
        assert_eq!("0.1".parse(), Ok(Rate::Times(0.1)));
        for wrong in ["0.05", "0", "-1", "nan", "inf", "1001", "fast", ""] {
            assert_eq!(wrong.parse::<Rate>(), Err(RateError), "{wrong}");
        }
    }

    proptest! {
        /// Whatever is pressed, recorded time never runs backwards by itself, and the waits end.
        #[test]
        fn recorded_time_only_runs_forwards(presses in prop::collection::vec((0..4u8, 0.0..5.0f64), 0..30)) {
            let mut schedule = Schedule::new(Rate::Times(1.0));
            let mut now = 0.0;
            schedule.wait(secs(now), 0.0);
            let mut before = 0.0;
            for (press, after) in presses {
                now += after;
                let here = schedule.position(secs(now)).unwrap();
                prop_assert!(here >= before - 1e-6, "{here} after {before}");
                match press {
                    0 => schedule.pause(secs(now), !schedule.paused()),
                    1 => schedule.set_rate(secs(now), schedule.rate().changed(true)),
                    2 => schedule.set_rate(secs(now), schedule.rate().changed(false)),
                    _ => {}
                }
                before = schedule.position(secs(now)).unwrap();
                prop_assert!((before - here).abs() < 1e-6, "a press moved {here} to {before}");
            }
        }
    }
}
