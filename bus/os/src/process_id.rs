//! Which process is meant: a number alone becomes another's, in time, after the next start of the machine, and in the
//! next container.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use crate::process_stat::ProcessStat;

/// A process, told from every other that had or will have its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct ProcessId {
    /// Its number, as this process sees it.
    pub pid: i32,
    /// When it was started (ticks since the machine was).
    pub started: u64,
    /// Which start of the machine that was: the first half of the kernel's boot id.
    boot: u64,
    /// In which namespace the number is its: that of whoever took it down.
    namespace: u64,
}

impl ProcessId {
    /// That of the process that has this number now; `None`: there is none, or it has ended.
    pub fn of(pid: i32) -> Option<Self> {
        let (boot, namespace) = here()?;
        let stat = ProcessStat::of(pid).filter(|stat| !stat.has_ended())?;
        Some(Self { pid, started: stat.started, boot, namespace })
    }

    /// Whether the process is there and has not ended. One that cannot be seen from here counts as gone.
    pub fn lives(&self) -> bool {
        Self::of(self.pid) == Some(*self)
    }

    /// Whether the process has ended for certain: its number is one of those that are seen from here, and it is not there.
    /// Of one of another container, or of another start of the machine, nothing is certain.
    pub fn has_ended(&self) -> bool {
        let is_of_here = here() == Some((self.boot, self.namespace));
        // Where not even this process is seen, for want of descriptors, say, nobody is.
        let are_seen = || Self::of(std::process::id() as i32).is_some();
        is_of_here && !self.lives() && are_seen()
    }
}

/// Which start of the machine this is, and in which namespace this process' numbers are: neither changes while it lives.
fn here() -> Option<(u64, u64)> {
    static HERE: OnceLock<(u64, u64)> = OnceLock::new();
    match HERE.get() {
        Some(here) => Some(*here),
        // That it cannot be read now, for want of descriptors, say, is not for good.
        None => boot().zip(namespace()).map(|here| *HERE.get_or_init(|| here)),
    }
}

fn boot() -> Option<u64> {
    let id = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    let digits: String = id.chars().filter(char::is_ascii_hexdigit).take(16).collect();
    u64::from_str_radix(&digits, 16).ok()
}

/// The number of this process' pid namespace: `pid:[4026531836]`.
fn namespace() -> Option<u64> {
    let link = std::fs::read_link("/proc/self/ns/pid").ok()?;
    let text = link.to_str()?;
    text.strip_prefix("pid:[")?.strip_suffix(']')?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own() -> ProcessId {
        ProcessId::of(std::process::id() as i32).unwrap()
    }

    #[test]
    fn a_number_of_another_time_start_or_container_is_another_process() {
        let own = own();
        assert!(own.lives());
        let others = [
            ProcessId { started: own.started + 1, ..own },
            ProcessId { boot: !own.boot, ..own },
            ProcessId { namespace: own.namespace + 1, ..own },
        ];
        assert!(others.iter().all(|other| !other.lives()));
        assert_eq!(others.map(|other| other.has_ended()), [true, false, false], "of the others nothing is certain");
        assert!(!own.has_ended());
        assert_eq!([0, -1, i32::MAX].map(ProcessId::of), [None; 3]);
    }

    #[test]
    fn a_process_that_nobody_has_waited_for_yet_has_ended() {
        let mut child = std::process::Command::new("sleep").arg("1000").spawn().unwrap();
        let id = ProcessId::of(child.id() as i32).unwrap();
        assert!(id.lives());
        child.kill().unwrap();
        while id.lives() {
            std::thread::yield_now();
        }
        assert!(std::path::Path::new(&format!("/proc/{}", id.pid)).exists());
        child.wait().unwrap();
    }

    #[test]
    fn it_survives_the_way_through_a_file() {
        let mut bytes = Vec::new();
        elk_proto::codec::encode_onto(&own(), &mut bytes).unwrap();
        assert_eq!(elk_proto::codec::decode_owned::<ProcessId>(&bytes, "a process").unwrap(), own());
    }
}
