//! Signals that ask a process to stop, and what becomes of one that does not heed them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use signal_hook::consts::{SIGALRM, SIGHUP, SIGINT, SIGTERM};
use signal_hook::low_level::{emulate_default_handler, register};

/// How long a callback of an app may go on once the app was asked to stop.
pub const STOP_PATIENCE: Duration = Duration::from_secs(5);

const LAST_WORDS: &str = "elk: asked to stop, and still in the midst of a message: this process ends here\n";

/// The signals that ask a process to stop: SIGTERM, SIGINT, and, of a terminal that is gone, SIGHUP. Who was started to
/// outlive its terminal (`nohup`) ignores the last one, and goes on doing so.
pub fn stop_signals() -> impl Iterator<Item = i32> {
    [SIGTERM, SIGINT].into_iter().chain((!is_ignored(SIGHUP)).then_some(SIGHUP))
}

/// Whether this process was started to ignore a signal.
fn is_ignored(signal: i32) -> bool {
    let mut action = std::mem::MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: without a new action the call only writes the present one to a place that has room for it.
    let known = unsafe { libc::sigaction(signal, std::ptr::null(), action.as_mut_ptr()) } == 0;
    // SAFETY: the action was written, and zeros are one as well.
    known && unsafe { action.assume_init() }.sa_sigaction == libc::SIG_IGN
}

/// Whether one of [`stop_signals`] has come to a process that `elk_bus::run_app` runs. A callback that computes for long
/// looks here now and then, and gives up: what it would come to is of no use any more.
pub fn asked_to_stop() -> bool {
    ASKED.load(Ordering::Relaxed)
}

static ASKED: AtomicBool = AtomicBool::new(false);

/// Sets `stop` on the signals that ask for it (see [`stop_signals`]).
pub fn stop_on_signals() -> std::io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in stop_signals() {
        signal_hook::flag::register(signal, stop.clone())?;
    }
    Ok(stop)
}

/// Sees to it that a process that was asked to stop does, whatever it is busy with, until it says that it heeds that.
pub struct Insistence(Arc<AtomicBool>);

impl Insistence {
    /// From now on, [`STOP_PATIENCE`] after the first of these signals the process ends. It begins before
    /// [`stop_on_signals`]: then whoever sees that it is to stop, and says that it heeds that, finds the alarm set already.
    ///
    /// # Errors
    /// The system takes no handler for one of the signals.
    pub fn begin() -> std::io::Result<Self> {
        let insists = Arc::new(AtomicBool::new(true));
        end_saying(SIGALRM, &[LAST_WORDS])?;
        for signal in stop_signals() {
            let insists = insists.clone();
            let set = move || {
                ASKED.store(true, Ordering::Relaxed);
                if insists.load(Ordering::Relaxed) {
                    alarm(STOP_PATIENCE.as_secs() as u32);
                }
            };
            // SAFETY: the action reads and writes atomics and calls alarm, which may be called in a handler.
            unsafe { register(signal, set)? };
        }
        Ok(Self(insists))
    }
}

impl Drop for Insistence {
    /// The process is on its way out; how long that takes is its own affair.
    fn drop(&mut self) {
        self.0.store(false, Ordering::Relaxed);
        alarm(0);
    }
}

fn alarm(secs: u32) {
    // SAFETY: no memory is involved.
    unsafe { libc::alarm(secs) };
}

/// From now on a process that this signal ends says why.
///
/// # Errors
/// The system takes no handler for the signal.
pub fn end_saying(signal: i32, words: &'static [&'static str]) -> std::io::Result<()> {
    let end = move || {
        for words in words {
            let _ = rustix::io::write(std::io::stderr(), words.as_bytes());
        }
        // An access that failed would be tried again for ever.
        let _ = emulate_default_handler(signal);
    };
    // SAFETY: the action writes to a descriptor and ends the process; both may be done in a handler.
    unsafe { register(signal, end)? };
    Ok(())
}

/// Runs a test of this crate by itself, in a process that may end with it.
#[cfg(test)]
pub(crate) fn run_test(name: &str, variable: &str, value: &str) -> std::process::Output {
    let mut command = std::process::Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", name, "--nocapture"]).env(variable, value).output().unwrap()
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use rustix::process::{Signal, getpid, kill_process};

    use super::*;

    const DEAF: &str = "ELK_TEST_IS_DEAF";

    /// Not a test by itself: a process of [`who_does_not_heed_a_signal_ends_all_the_same`].
    #[test]
    fn is_deaf() {
        let Ok(heeds) = std::env::var(DEAF) else { return };
        let insistence = Insistence::begin().unwrap();
        let stop = stop_on_signals().unwrap();
        assert!(!asked_to_stop());
        kill_process(getpid(), Signal::TERM).unwrap();
        while !asked_to_stop() {
            std::thread::yield_now();
        }
        while !stop.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
        if heeds == "yes" {
            drop(insistence);
            // SAFETY: no memory is involved. An alarm that was taken back has no seconds left.
            assert_eq!(unsafe { libc::alarm(0) }, 0);
            return;
        }
        loop {
            std::thread::sleep(Duration::from_secs(1));
        }
    }

    #[test]
    fn who_does_not_heed_a_signal_ends_all_the_same() {
        let run = |heeds| run_test("stop::tests::is_deaf", DEAF, heeds);
        let ended = run("no");
        assert_eq!(ended.status.signal(), Some(SIGALRM), "{ended:?}");
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(said.contains(LAST_WORDS), "{said}");
        assert!(run("yes").status.success(), "who heeds it has all the time it needs");
    }
}
