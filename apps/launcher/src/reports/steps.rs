//! Where the time of a step goes: told from the times of the messages that make it up.
//!
//! Exploration is in lockstep: each message of the chain pose command, scan, filtered scans, map update, plan request, plan,
//! pose command is the answer to the one before it. So what lies between two of them is the time of the app that published
//! the later one, its way over the bus included.

use std::collections::BTreeMap;

use serde::Serialize;

/// Times that are kept of one app, and apps whose times are: more than any mission has, and a bound for who makes them up.
const MOST_TIMES: usize = 1 << 20;
const MOST_APPS: usize = 64;

/// Times of steps, by app.
#[derive(Debug, Clone, Default)]
pub struct StepTimes {
    last: Option<f64>,
    last_command: Option<f64>,
    by_app: BTreeMap<String, Vec<f64>>,
    whole: Vec<f64>,
}

/// Statistics of times.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// How many there were.
    pub count: usize,
    /// Their median (ms).
    pub median_ms: f64,
    /// Their 99th percentile (ms).
    pub p99_ms: f64,
}

impl StepTimes {
    /// A message of the chain, published by `app` at `time` (s); `command`: it is the pose command that begins a step.
    pub fn note(&mut self, app: &str, time: f64, command: bool) {
        if !time.is_finite() {
            return;
        }
        if let Some(last) = self.last
            && (self.by_app.len() < MOST_APPS || self.by_app.contains_key(app))
        {
            keep(self.by_app.entry(app.to_owned()).or_default(), time - last);
        }
        self.last = Some(time);
        if command {
            if let Some(last) = self.last_command {
                keep(&mut self.whole, time - last);
            }
            self.last_command = Some(time);
        }
    }

    /// The time of the last message of the chain (s).
    pub fn last(&self) -> Option<f64> {
        self.last
    }

    /// From one pose command to the next.
    pub fn whole_step(&self) -> Option<Spread> {
        spread(&self.whole)
    }

    /// Of each app that took part.
    pub fn by_app(&self) -> BTreeMap<String, Spread> {
        let spreads = self.by_app.iter().map(|(app, times)| (app.clone(), spread(times)));
        spreads.filter_map(|(app, spread)| Some((app, spread?))).collect()
    }
}

fn keep(times: &mut Vec<f64>, secs: f64) {
    if times.len() < MOST_TIMES {
        times.push(secs);
    }
}

/// Median and 99th percentile by nearest rank; `None` of nothing.
fn spread(times: &[f64]) -> Option<Spread> {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = |share: f64| (share * sorted.len() as f64).ceil() as usize;
    let at = |share: f64| sorted.get(rank(share).saturating_sub(1)).map(|secs| secs * 1e3);
    Some(Spread { count: sorted.len(), median_ms: at(0.5)?, p99_ms: at(0.99)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_split_among_those_who_answer_each_other() {
        let mut times = StepTimes::default();
        for (app, time, command) in [
            ("Controller", 10.0, true),
            ("Sensor", 10.5, false),
            ("Map", 10.75, false),
            ("Controller", 10.875, true),
            ("Sensor", 11.125, false),
        ] {
            times.note(app, time, command);
        }
        let one = |ms| Spread { count: 1, median_ms: ms, p99_ms: ms };
        assert_eq!(times.whole_step(), Some(one(875.0)));
        let by_app = times.by_app();
        assert_eq!(by_app["Map"], one(250.0));
        assert_eq!(by_app["Controller"], one(125.0));
        assert_eq!(by_app["Sensor"], Spread { count: 2, median_ms: 250.0, p99_ms: 500.0 });
    }

    #[test]
    fn no_more_is_kept_than_a_mission_has() {
        let mut times = StepTimes::default();
        for n in 0..200 {
            times.note(&format!("liar{n}"), f64::from(n), false);
        }
        assert_eq!(times.by_app().len(), MOST_APPS);
        times.note("Map", f64::NAN, true);
        assert_eq!(times.last(), Some(199.0));
    }

    #[test]
    fn ranks_are_the_nearest() {
        let times: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        let spread = spread(&times).unwrap();
        assert_eq!((spread.median_ms, spread.p99_ms), (100e3, 198e3));
        assert_eq!(super::spread(&[]), None);
    }
}
