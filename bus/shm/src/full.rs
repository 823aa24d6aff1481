//! Shared memory that runs out under a process' hands.
//!
//! The system gives shared memory when it is touched first, not when it is asked for. If there is none left then, the
//! process is ended by SIGBUS, in the midst of whatever it did; all that can be done is to say why.

use std::sync::Once;

use elk_os::stop::end_saying;
use signal_hook::consts::SIGBUS;

use super::home::SHARED_MEMORY;

/// What a process says that touches shared memory where there is none left.
static LAST_WORDS: [&str; 3] = [
    "elk: there was no room left in ",
    SHARED_MEMORY,
    ": remove what fills it, or enlarge it with `mount -o remount,size=…` (in a container, --shm-size), and start again\n",
];

/// Has this process say why, should it be ended for want of shared memory.
pub fn say_why() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // A refusal leaves the process to end without a word.
        let _ = end_saying(SIGBUS, &LAST_WORDS);
    });
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use rustix::fs::{MemfdFlags, ftruncate, memfd_create};

    use super::super::page::{BrokerPage, Page};
    use super::*;
    use crate::alone::run_test;

    const RUN_OUT: &str = "ELK_TEST_RUNS_OUT";

    /// Not a test by itself: a process of [`who_runs_out_of_shared_memory_says_so`].
    #[test]
    fn touches_what_is_not_there() {
        if std::env::var_os(RUN_OUT).is_none() {
            return;
        }
        say_why();
        // A page of the bus is sealed against this; shared memory that the system has none of left is not.
        let file = memfd_create("elk-test", MemfdFlags::CLOEXEC).unwrap();
        ftruncate(&file, size_of::<BrokerPage>() as u64).unwrap();
        let page = Page::<BrokerPage>::map(file).unwrap();
        ftruncate(page.file(), 0).unwrap();
        page.bell.rings();
    }

    #[test]
    fn who_runs_out_of_shared_memory_says_so() {
        let ended = run_test("full::tests::touches_what_is_not_there", RUN_OUT, "1");
        assert_eq!(ended.status.signal(), Some(SIGBUS), "{ended:?}");
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(said.contains(&LAST_WORDS.concat()), "{said}");
    }
}
