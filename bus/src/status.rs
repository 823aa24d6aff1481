//! What an app says of itself every two seconds, `<APP>_STATUS`, in the words of MOOS' apps.

use std::time::Duration;

use crate::clock::{Stopwatch, process_cpu_secs};
use crate::comms::{Comms, CommsError};
use crate::inbox::Inbox;

/// How often it is published, as in MOOS.
const PERIOD: Duration = Duration::from_secs(2);
/// The most that a list of names takes (bytes): a reader that takes all there is should not be told of it at length, again and again.
const LONGEST_LIST: usize = 1000;

/// When an app has begun, and when it says its next word of itself.
pub(crate) struct Status {
    next: Duration,
    running: Stopwatch,
    /// The processor time that the process had used until then (s).
    cpu_before_secs: f64,
}

impl Status {
    /// That of an app that begins now.
    pub fn new() -> Self {
        Self { next: Duration::ZERO, running: Stopwatch::start(), cpu_before_secs: process_cpu_secs() }
    }

    /// How long it is until the next one is due.
    pub fn pause(&self) -> Duration {
        self.next.saturating_sub(self.running.elapsed())
    }

    /// Publishes it, if it is due.
    pub fn say(&mut self, comms: &mut Comms, inbox: &Inbox) -> Result<(), CommsError> {
        let uptime = self.running.elapsed();
        if uptime < self.next {
            return Ok(());
        }
        self.next = uptime + PERIOD;
        let uptime = uptime.as_secs_f64();
        let load = 100.0 * (process_cpu_secs() - self.cpu_before_secs) / uptime.max(1e-3);
        let [memory, most] = memory_kb();
        let (name, dropped, rejected) = (comms.name(), inbox.dropped(), comms.rejected());
        let (publishing, subscribing) = (list(comms.published()), list(comms.registered()));
        let key = format!("{}_STATUS", name.to_uppercase());
        let status = format!(
            "AppErrorFlag=false,Uptime={uptime:.1},cpuload={load:.1},memory_kb={memory},memory_max_kb={most},\
             dropped={dropped},rejected={rejected},MOOSName={name},Publishing=\"{publishing}\",\
             Subscribing=\"{subscribing}\""
        );
        comms.notify(&key, status)
    }
}

/// Names as MOOS' apps list them, a comma behind each: as many as there is room for, without those that would end the list, and
/// one that follows itself (a variable that is registered for of several sources) once.
fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let (mut list, mut last) = (String::new(), "");
    for name in names.filter(|name| !name.contains([',', '"'])) {
        if list.len() + name.len() >= LONGEST_LIST {
            break;
        }
        if name != std::mem::replace(&mut last, name) {
            list.push_str(name);
            list.push(',');
        }
    }
    list
}

/// The memory that the process has resident, and the most that it has had (kB).
fn memory_kb() -> [u64; 2] {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    ["VmRSS:", "VmHWM:"].map(|field| {
        let line = status.lines().find_map(|line| line.strip_prefix(field));
        line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_as_moos_has_it_and_ends_somewhere() {
        assert_eq!(list(["A", "A", "NAV_*"].into_iter()), "A,NAV_*,");
        assert_eq!(list(["A\",rejected=9", "B,C", "D"].into_iter()), "D,", "nothing ends it before its end");
        assert_eq!(list(std::iter::empty()), "");
        let names: Vec<String> = (1000..9999).map(|n| n.to_string()).collect();
        let long = list(names.iter().map(String::as_str));
        assert!(long.len() <= LONGEST_LIST && long.len() > LONGEST_LIST - 5 && long.ends_with("1199,"), "{long}");
    }
}
