//! The only place that reads a clock of the operating system.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use elk_proto::ClockSetting;

/// A community's clock. Its own time is that of the wall, seconds since the Unix epoch, times the community's time warp,
/// as in MOOS; as long as somebody drives it (see [`ClockSetting`]), it shows what that one has set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    warp: f64,
    setting: Option<ClockSetting>,
}

impl Clock {
    /// A clock that nobody drives, `warp` times as fast as the wall's (MOOS' time warp; 1: real time).
    pub fn new(warp: f64) -> Self {
        Self { warp, setting: None }
    }

    /// The same clock, driven, or left to itself again.
    pub fn driven(self, setting: Option<ClockSetting>) -> Self {
        Self { setting, ..self }
    }

    /// What it is set to, if somebody drives it.
    pub fn setting(&self) -> Option<ClockSetting> {
        self.setting
    }

    /// How much faster than the wall's clock it runs by itself.
    pub fn warp(&self) -> f64 {
        self.warp
    }

    /// The community's time (s).
    #[inline]
    pub fn now(&self) -> f64 {
        let own = self.own();
        self.setting.map_or(own, |setting| setting.time(own))
    }

    /// What the community's time would be if nobody drove it (s).
    #[allow(clippy::disallowed_methods, reason = "this is the one clock")]
    #[inline]
    pub fn own(&self) -> f64 {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        since.as_secs_f64() * self.warp
    }

    /// How long the wall's clock takes for `secs` of the community's time; for ever, if that stands still.
    pub fn real(&self, secs: f64) -> Duration {
        let speed = self.warp * self.setting.map_or(1.0, |setting| setting.rate);
        Duration::try_from_secs_f64((secs / speed).max(0.0)).unwrap_or(Duration::MAX)
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

/// A moment in the Gregorian calendar, UTC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Date {
    /// The year.
    pub year: i64,
    /// The month, from 1.
    pub month: i64,
    /// The day of the month, from 1.
    pub day: i64,
    /// The hour, 0 to 23.
    pub hour: i64,
    /// The minute.
    pub minute: i64,
    /// The second.
    pub second: i64,
    /// The day of the week: Monday is 0.
    pub weekday: i64,
}

impl Date {
    /// That of a time (s since 1970); what is less than a second is left out.
    pub fn of(secs: f64) -> Self {
        let secs = secs.floor() as i64;
        let (days, of_day) = (secs.div_euclid(86_400), secs.rem_euclid(86_400));
        let (year, month, day) = civil(days);
        let (hour, minute, second) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
        // The first day of 1970 was a Thursday.
        Self { year, month, day, hour, minute, second, weekday: (days + 3).rem_euclid(7) }
    }
}

/// Year, month and day of a day since 1970-01-01. Years are counted from March, so that the leap day is their last; 146,097
/// days are 400 years.
fn civil(days: i64) -> (i64, i64, i64) {
    let since_0000_03_01 = days + 719_468;
    let (era, of_era) = (since_0000_03_01.div_euclid(146_097), since_0000_03_01.rem_euclid(146_097));
    let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = (month_from_march + 2) % 12 + 1;
    (era * 400 + year_of_era + i64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driven_clock_shows_what_it_is_set_to_and_runs_at_its_rate() {
        let setting = ClockSetting { at: 1000.0, time: 50.0, rate: 2.0 };
        assert_eq!([1000.0, 1003.0].map(|own| setting.time(own)), [50.0, 56.0]);
        let clock = Clock::new(10.0);
        assert_eq!(clock.real(40.0), Duration::from_secs(4));
        assert_eq!(clock.driven(Some(setting)).real(40.0), Duration::from_secs(2));
        let standing = clock.driven(Some(ClockSetting { rate: 0.0, ..setting }));
        assert_eq!((standing.now(), standing.real(1.0)), (50.0, Duration::MAX));
        assert_eq!(standing.real(-1.0), Duration::ZERO, "what is past is due");
    }
}
