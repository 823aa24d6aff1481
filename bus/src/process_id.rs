//! Which process is meant: a number alone becomes another's, in time, after the next start of the machine, and in the
//! next container.

use serde::{Deserialize, Serialize};

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
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        Some(Self { pid, started: started(&stat)?, boot: boot()?, namespace: namespace()? })
    }

    /// Whether the process is there and has not ended. One that cannot be seen from here counts as gone.
    pub fn lives(&self) -> bool {
        Self::of(self.pid) == Some(*self)
    }
}

/// From `/proc/PID/stat`: the name may hold anything, parentheses too; the fields behind it are counted from the third.
/// `None` for one that has ended, though nobody has waited for it yet.
fn started(stat: &str) -> Option<u64> {
    let mut fields = stat.rsplit_once(") ")?.1.split(' ');
    let state = fields.next()?;
    let started = fields.nth(22 - 4)?.parse().ok()?;
    (!["Z", "X", "x"].contains(&state)).then_some(started)
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
    fn a_name_may_look_like_fields() {
        let stat = "7 (a) R 1) S 1 7 7 0 -1 0 0 0 0 0 100 20 0 0 20 0 1 0 4242 999 3";
        assert_eq!(started(stat), Some(4242));
        assert_eq!(started(&stat.replace(") S", ") Z")), None);
        assert_eq!(started("7 (a) S 1"), None);
    }

    #[test]
    fn it_survives_the_way_through_a_file() {
        let mut bytes = Vec::new();
        crate::codec::encode_onto(&own(), &mut bytes).unwrap();
        assert_eq!(crate::codec::decode_owned::<ProcessId>(&bytes, "a process").unwrap(), own());
    }
}
