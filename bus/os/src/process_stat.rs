//! What the system says of a process in `/proc/PID/stat`.

/// Some of a process' fields there, numbered as in proc_pid_stat(5).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProcessStat {
    /// Field 3: `R`, `S`, …; `Z` if it has ended and nobody has waited for it.
    pub state: char,
    /// Field 4: its parent; 0 if that cannot be seen from here.
    pub parent: i32,
    /// Field 5: its group; 0 if the group's leader cannot be seen from here.
    pub group: i32,
    /// Fields 14 and 15: CPU that it has used, in the kernel and outside (ticks).
    pub cpu_ticks: u64,
    /// Field 22: when it was started (ticks since the machine was).
    pub started: u64,
    /// Field 24: memory that is resident (pages).
    pub resident_pages: u64,
}

impl ProcessStat {
    /// That of the process that has this number now; `None`: there is none.
    pub fn of(pid: i32) -> Option<Self> {
        // The kernel cuts names in the midst of a letter.
        Self::parse(&String::from_utf8_lossy(&std::fs::read(format!("/proc/{pid}/stat")).ok()?))
    }

    /// The name may hold anything, parentheses too; the fields behind it are counted from the third.
    fn parse(stat: &str) -> Option<Self> {
        let fields: Vec<&str> = stat.rsplit_once(") ")?.1.split_whitespace().collect();
        let field = |number: usize| fields.get(number - 3).copied();
        let count = |number: usize| field(number)?.parse::<u64>().ok();
        Some(Self {
            state: field(3)?.chars().next()?,
            parent: field(4)?.parse().ok()?,
            group: field(5)?.parse().ok()?,
            cpu_ticks: count(14)?.saturating_add(count(15)?),
            started: count(22)?,
            resident_pages: count(24)?,
        })
    }

    /// Whether the process has ended, though nobody may have waited for it yet.
    pub fn has_ended(&self) -> bool {
        ['Z', 'X', 'x'].contains(&self.state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_may_look_like_fields() {
        let mut stat = "7 (a) R 1) S 1 7 7 0 -1 0 0 0 0 0 100 20 0 0 20 0 1 0 4242 999 3\n".to_owned();
        let found = ProcessStat { state: 'S', parent: 1, group: 7, cpu_ticks: 120, started: 4242, resident_pages: 3 };
        assert_eq!(ProcessStat::parse(&stat), Some(found));
        assert!(!found.has_ended() && ProcessStat { state: 'Z', ..found }.has_ended());
        stat.truncate(30);
        assert_eq!(ProcessStat::parse(&stat), None);
    }

    #[test]
    fn a_process_finds_itself() {
        let own = ProcessStat::of(std::process::id() as i32).unwrap();
        assert!(own.started > 0 && own.resident_pages > 0 && !own.has_ended());
    }
}
