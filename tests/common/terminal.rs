//! A pseudo-terminal, and a program in it.

use std::fs::File;
use std::io::{PipeReader, PipeWriter, Read, Write, pipe};
use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{Mode, OFlags, open};
use rustix::process::{ioctl_tiocsctty, setsid};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, SpecialCodeIndex, Winsize, tcgetattr, tcsetwinsize};

use super::events::{Patience, end_of};

/// A terminal, and the program that was started in it. Killed, should the test fail before its
/// end.
pub struct Terminal {
    /// The side of the pseudo terminal at which a person would sit.
    pty: File,
    /// The program's end.
    tty: OwnedFd,
    pub program: Child,
    shown: Shown,
    /// How its settings were before the program came.
    before: Settings,
}

/// Whether keys wait for Enter and are shown, and which codes are special.
type Settings = (LocalModes, [u8; 4]);

impl Terminal {
    /// Starts `command` in a terminal of so many columns, which is that of its session: Ctrl-C is a signal there.
    pub fn start(command: Command, columns: u16) -> Self {
        Self::start_with(command, columns, || {
            setsid()?;
            ioctl_tiocsctty(rustix::stdio::stdin())?;
            Ok(())
        })
    }

    /// Starts `command` in a terminal that is no session's: the program hears nothing of its end.
    pub fn start_without_session(command: Command, columns: u16) -> Self {
        Self::start_with(command, columns, || Ok(()))
    }

    fn start_with(mut command: Command, columns: u16, before: fn() -> std::io::Result<()>) -> Self {
        let pty = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&pty).unwrap();
        unlockpt(&pty).unwrap();
        let name = ptsname(&pty, Vec::new()).unwrap();
        let tty = open(name, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty()).unwrap();
        let end = || tty.try_clone().unwrap();
        command.stdin(end()).stdout(end()).stderr(end());
        // SAFETY: between fork and exec there are two system calls, and no memory is taken.
        unsafe { command.pre_exec(before) };
        resize(&tty, columns);
        let before = settings(&tty);
        let shown = Shown::of(pty.try_clone().unwrap());
        let program = command.spawn().unwrap();
        Self { pty: pty.into(), tty, program, shown, before }
    }

    /// Makes the terminal's window so many columns wide.
    pub fn resize(&self, columns: u16) {
        resize(&self.tty, columns);
    }

    /// Presses keys.
    pub fn press(&mut self, keys: &str) {
        self.pty.write_all(keys.as_bytes()).unwrap();
    }

    /// All that the program has shown so far.
    pub fn shown(&self) -> String {
        text(&self.shown.bytes.0.lock().unwrap())
    }

    /// Waits until the program has shown something that is as it should be.
    pub fn wait_until(&self, what: &str, mut happened: impl FnMut(&str) -> bool) {
        let (bytes, came) = &*self.shown.bytes;
        let (mut shown, patience) = (bytes.lock().unwrap(), Patience::new());
        while !happened(&text(&shown)) {
            let left = patience.left(format_args!("{what}; what is shown: {:?}", text(&shown)));
            shown = came.wait_timeout(shown, left).unwrap().0;
        }
    }

    /// Whether the terminal's settings are those from before the program came.
    pub fn is_as_before(&self) -> bool {
        settings(&self.tty) == self.before
    }

    /// Waits for the end of the program, which is to leave the terminal as it was; how it ended, and all that it has
    /// shown.
    pub fn end(mut self) -> (ExitStatus, String) {
        let status = self.wait();
        // What it said last may still be on its way.
        self.shown.stop();
        assert!(self.is_as_before(), "the terminal was left with {:?}", settings(&self.tty));
        (status, self.shown())
    }

    /// Closes the window; how the program ended.
    pub fn close(mut self) -> ExitStatus {
        self.shown.stop();
        // Nothing else holds that side.
        self.pty = File::open("/dev/null").unwrap();
        self.wait()
    }

    fn wait(&mut self) -> ExitStatus {
        end_of(&mut self.program).unwrap_or_else(|| panic!("never ended; what is shown: {:?}", self.shown()))
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

fn settings(tty: &OwnedFd) -> Settings {
    let found = tcgetattr(tty).unwrap();
    let codes = [SpecialCodeIndex::VMIN, SpecialCodeIndex::VTIME, SpecialCodeIndex::VSUSP, SpecialCodeIndex::VINTR];
    (found.local_modes, codes.map(|code| found.special_codes[code]))
}

fn resize(tty: &OwnedFd, columns: u16) {
    tcsetwinsize(tty, Winsize { ws_row: 24, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 }).unwrap();
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// What a terminal shows: read by a thread, since a terminal that nobody reads makes its program wait.
struct Shown {
    /// All of it, and the news that there is more.
    bytes: Arc<(Mutex<Vec<u8>>, Condvar)>,
    /// Closed when it is enough.
    enough: Option<PipeWriter>,
    reader: Option<JoinHandle<()>>,
}

impl Shown {
    fn of(pty: OwnedFd) -> Self {
        let bytes: Arc<(Mutex<Vec<u8>>, Condvar)> = Arc::default();
        let (until, enough) = pipe().unwrap();
        let all = bytes.clone();
        let reader = std::thread::spawn(move || {
            let mut pty = File::from(pty);
            let mut some = [0; 4096];
            while is_readable(&pty, &until) {
                let count = pty.read(&mut some).unwrap_or(0);
                all.0.lock().unwrap().extend_from_slice(&some[..count]);
                all.1.notify_all();
            }
        });
        Self { bytes, enough: Some(enough), reader: Some(reader) }
    }

    /// What is there by now is taken all the same.
    fn stop(&mut self) {
        self.enough = None;
        if let Some(reader) = self.reader.take() {
            reader.join().unwrap();
        }
    }
}

impl Drop for Shown {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Waits until there is something to be read; `false`: there is nothing, and it is enough.
fn is_readable(pty: &File, until: &PipeReader) -> bool {
    let mut both = [PollFd::new(pty, PollFlags::IN), PollFd::new(until, PollFlags::IN)];
    poll(&mut both, None).unwrap();
    both[0].revents().contains(PollFlags::IN)
}
