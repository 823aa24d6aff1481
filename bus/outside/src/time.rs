//! Numbers of seconds that somebody says: on a command line, in a log, over the bus.

use std::time::Duration;

/// The latest moment there is (s since 1970): the end of the year 9999.
pub const LAST: f64 = 253_402_300_799.0;

/// The longest time that anything waits: a hundred years. Sums of a few of these overflow nothing.
pub const LONGEST: Duration = Duration::from_secs(100 * 365 * 86_400);

/// A number of seconds as a time to wait: nothing if it is negative or no number, and at most [`LONGEST`].
pub fn duration(secs: f64) -> Duration {
    match secs > 0.0 {
        true => Duration::try_from_secs_f64(secs).map_or(LONGEST, |wait| wait.min(LONGEST)),
        false => Duration::ZERO,
    }
}

/// A number of seconds, if it is one that a moment or a distance between moments can have: finite, and not beyond
/// [`LAST`] in either direction.
pub fn seconds(secs: f64) -> Option<f64> {
    (-LAST..=LAST).contains(&secs).then_some(secs)
}

/// The number of seconds that a text says.
///
/// # Errors
/// What is right, in words; the argument of a command line names what was found.
pub fn parse_seconds(said: &str) -> Result<f64, String> {
    let secs = said.parse().ok().and_then(seconds);
    secs.ok_or_else(|| "right is a number of seconds, for example 2.5".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_a_time_to_wait() {
        assert_eq!(duration(1.5), Duration::from_millis(1500));
        for nothing in [0.0, -0.0, -1.0, -1e300, f64::NAN, f64::NEG_INFINITY, 1e-300] {
            assert_eq!(duration(nothing), Duration::ZERO, "{nothing}");
        }
        for long in [1e10, 1e19, 1e20, 1e300, f64::INFINITY, f64::MAX] {
            assert_eq!(duration(long), LONGEST, "{long}");
        }
        assert!(LONGEST.checked_mul(1000).is_some());
    }

    #[test]
    fn not_every_number_is_a_moment() {
        for right in ["0", "-2.5", "1e9", "253402300799"] {
            assert!(parse_seconds(right).is_ok(), "{right}");
        }
        for wrong in ["nan", "inf", "-inf", "1e300", "1e12", "", "2 s"] {
            assert_eq!(parse_seconds(wrong).unwrap_err(), "right is a number of seconds, for example 2.5", "{wrong}");
        }
    }
}
