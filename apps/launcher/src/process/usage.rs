//! What processes use, from `/proc`.

use std::collections::{HashMap, VecDeque};
use std::time::Duration;

use elk_bus::ProcessStat;
use rustix::process::Pid;

/// How often it is taken down what everyone uses.
const PERIOD: Duration = Duration::from_secs(1);

/// What a process uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Usage {
    /// When it started, in ticks since the machine did: tells it from a later process of the same number.
    pub started: u64,
    /// CPU that it has used (ticks).
    pub cpu: u64,
    /// Memory that is resident (bytes).
    pub resident: u64,
}

impl Usage {
    /// Of a process that is there.
    pub fn of(pid: Pid) -> Option<Self> {
        let ProcessStat { started, cpu_ticks: cpu, resident_pages, .. } = ProcessStat::of(pid.as_raw_nonzero().get())?;
        Some(Self { started, cpu, resident: resident_pages.saturating_mul(rustix::param::page_size() as u64) })
    }

    /// Seconds since it started.
    fn age_secs(&self) -> Option<f64> {
        let uptime = std::fs::read_to_string("/proc/uptime").ok()?;
        let uptime: f64 = uptime.split(' ').next()?.parse().ok()?;
        Some(uptime - self.started as f64 / hertz())
    }

    /// CPU since it started (% of one core).
    pub fn cpu_percent(&self) -> Option<f64> {
        let age = self.age_secs()?.max(1.0 / hertz());
        Some(100.0 * self.cpu as f64 / hertz() / age)
    }
}

fn hertz() -> f64 {
    rustix::param::clock_ticks_per_second() as f64
}

/// What everyone used one to two seconds ago.
#[derive(Debug, Default)]
pub(crate) struct Samples {
    /// The oldest first.
    taken: VecDeque<(Duration, HashMap<Pid, u64>)>,
}

impl Samples {
    /// Takes down what `processes` use, if it is time.
    pub fn take(&mut self, now: Duration, processes: impl Iterator<Item = Pid>) {
        if self.taken.back().is_some_and(|(then, _)| *then + PERIOD > now) {
            return;
        }
        let used = processes.filter_map(|pid| Some((pid, Usage::of(pid)?.cpu))).collect();
        self.taken.push_back((now, used));
        while self.taken.len() > 2 {
            self.taken.pop_front();
        }
    }

    /// CPU of late (% of one core).
    pub fn cpu_percent(&self, pid: Pid, usage: &Usage, now: Duration) -> Option<f64> {
        let (then, used) = self.taken.iter().find(|(_, used)| used.contains_key(&pid))?;
        let secs = now.saturating_sub(*then).as_secs_f64();
        let ticks = usage.cpu.saturating_sub(used[&pid]) as f64;
        (secs > 0.1).then(|| 100.0 * ticks / hertz() / secs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_reads_what_it_uses_itself() {
        let own = Usage::of(rustix::process::getpid()).unwrap();
        assert!(own.started > 0 && own.resident > 0);
        assert!(own.cpu_percent().unwrap() >= 0.0);
    }

    #[test]
    fn late_use_is_that_since_a_sample() {
        let mut samples = Samples::default();
        let own = rustix::process::getpid();
        let used = Usage::of(own).unwrap();
        samples.take(Duration::ZERO, [own].into_iter());
        let later = Usage { cpu: used.cpu + 50 + rustix::param::clock_ticks_per_second(), ..used };
        let percent = samples.cpu_percent(own, &later, Duration::from_secs(2)).unwrap();
        assert!(percent >= 50.0, "{percent}");
    }
}
