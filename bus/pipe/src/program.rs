//! The process: what waits for it, and what it has said and nobody has read. Both are bounded.
//!
//! A thread reads its output, another writes its input, a third waits for its end; whoever owns the program hears of all of
//! it by one descriptor.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use std::{io, thread};

use elk_bus::child::{Bond, keep_to_itself};
use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::io::Errno;
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

/// The longest line that is read (bytes); of a longer one nothing is kept.
pub const LONGEST_LINE: usize = 8 << 20;
/// As much of its output waits to be read (bytes): with more it has to wait itself.
const MOST_SAID: usize = 1 << 20;
/// With more waiting for it (bytes) it is behind with its mail.
const MUCH_TO_SAY: usize = 1 << 20;
/// With more waiting for it (bytes) it is told nothing more.
const MOST_TO_SAY: usize = 64 << 20;
/// How long its output is still read once it has ended: a process that it has left behind may hold it open.
const REST_PATIENCE: Duration = Duration::from_secs(1);
/// The longest of its last words on standard error that are kept (bytes).
const LAST_WORDS: usize = 4 << 10;

/// Where the program's standard error goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Errors {
    /// Where this process' own goes.
    Inherited,
    /// Nowhere; its end is kept for who asks why the program failed.
    Kept,
}

/// What comes from the program.
#[derive(Debug)]
pub enum Heard {
    /// A line, with its number from 1; or why it is none.
    Line(u64, Result<String, String>),
    /// It has ended, and that was all: on standard error as well.
    Ended(ExitStatus),
}

/// A program that runs. Dropped, it is killed.
pub struct Program {
    id: Pid,
    shared: Arc<Shared>,
    lines: u64,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    /// Readable from when something has happened until that was looked at.
    bell: OwnedFd,
}

#[derive(Default)]
struct State {
    said: VecDeque<Result<String, String>>,
    said_bytes: usize,
    output_closed: bool,
    /// So is its standard error, or it is not kept.
    errors_closed: bool,
    to_say: Vec<u8>,
    /// Bytes that are on their way into its input.
    saying: usize,
    input_closed: bool,
    /// Its number may be another process' by now.
    gone: bool,
    ended: Option<ExitStatus>,
    last_words: Vec<u8>,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the state, and lets everybody know.
    fn change<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        let changed = change(&mut self.lock());
        self.changed.notify_all();
        self.ring();
        changed
    }

    /// Waits until the state is right.
    fn once(&self, is_right: impl Fn(&State) -> bool) -> MutexGuard<'_, State> {
        let wait = self.changed.wait_while(self.lock(), |state| !is_right(state));
        wait.unwrap_or_else(PoisonError::into_inner)
    }

    fn ring(&self) {
        // One that is full is readable.
        let _ = rustix::io::write(&self.bell, &1_u64.to_ne_bytes());
    }
}

impl Program {
    /// Starts a program in a process group of its own, which ends with the thread that starts it.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(mut command: Command, errors: Errors) -> io::Result<Self> {
        let bell = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).process_group(0);
        command.stderr(if errors == Errors::Kept { Stdio::piped() } else { Stdio::inherit() });
        keep_to_itself(&mut command, Bond::Parent);
        let mut child = command.spawn()?;
        let id = Pid::from_child(&child);
        let shared = Arc::new(Shared { state: Mutex::default(), changed: Condvar::new(), bell });
        let program = Self { id, shared: Arc::clone(&shared), lines: 0 };
        let (input, output, errors) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        program.spawn("output", move |shared| output.into_iter().for_each(|output| read_lines(shared, output)))?;
        program.spawn("input", move |shared| input.into_iter().for_each(|input| write_lines(shared, input)))?;
        program.spawn("errors", move |shared| keep_words(shared, errors))?;
        program.spawn("end", move |shared| wait_for_end(shared, id, child))?;
        Ok(program)
    }

    fn spawn(&self, what: &str, work: impl FnOnce(&Shared) + Send + 'static) -> io::Result<()> {
        let shared = Arc::clone(&self.shared);
        thread::Builder::new().name(format!("pipe-{what}")).spawn(move || work(&shared)).map(drop)
    }

    /// A descriptor that is readable when there may be something to hear, or room for more to say.
    pub fn bell(&self) -> BorrowedFd<'_> {
        self.shared.bell.as_fd()
    }

    /// Waits for the bell.
    pub fn wait(&self, timeout: Duration) {
        let timeout = Timespec::try_from(timeout).ok();
        let mut fds = [PollFd::new(&self.shared.bell, PollFlags::IN)];
        // An interruption ends the wait like a bell that rings for nothing.
        let _ = poll(&mut fds, timeout.as_ref());
    }

    /// The next of what it has said; once that is all and it has ended, that. The bell rings on as long as there is more.
    pub fn hear(&mut self) -> Option<Heard> {
        self.hush();
        let mut state = self.shared.lock();
        let Some(line) = state.said.pop_front() else { return state.ended.map(Heard::Ended) };
        state.said_bytes -= bytes(&line);
        if !state.said.is_empty() || state.ended.is_some() {
            self.shared.ring();
        }
        drop(state);
        self.shared.changed.notify_all();
        self.lines += 1;
        Some(Heard::Line(self.lines, line))
    }

    /// Silences the bell, for who leaves unheard what there is.
    pub fn hush(&self) {
        // One that is empty is silent.
        let _ = rustix::io::read(&self.shared.bell, &mut [0; 8]);
    }

    /// Rings the bell, for who has left something unheard.
    pub fn ring(&self) {
        self.shared.ring();
    }

    /// Puts a line down for it; whether there was room. What is said to one whose input is closed is lost.
    pub fn say(&self, line: &str) -> bool {
        let mut state = self.shared.lock();
        if state.input_closed || state.to_say.len() + line.len() >= MOST_TO_SAY {
            return false;
        }
        state.to_say.extend_from_slice(line.as_bytes());
        state.to_say.push(b'\n');
        drop(state);
        self.shared.changed.notify_all();
        true
    }

    /// Whether it is not behind with reading.
    pub fn reads(&self) -> bool {
        let state = self.shared.lock();
        state.to_say.len() + state.saying < MUCH_TO_SAY
    }

    /// Its input ends behind what it was told.
    pub fn close_input(&self) {
        self.shared.change(|state| state.input_closed = true);
    }

    /// Sends a signal to it and all that it has started, in its process group.
    pub fn signal(&self, signal: Signal) {
        let state = self.shared.lock();
        if !state.gone {
            // Whoever has ended meanwhile needs none.
            let _ = kill_process_group(self.id, signal);
        }
    }

    /// The last line that it has said on standard error, if that is kept.
    pub fn last_words(&self) -> Option<String> {
        let state = self.shared.lock();
        let text = String::from_utf8_lossy(&state.last_words);
        text.lines().rev().find(|line| !line.trim().is_empty()).map(str::to_owned)
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.signal(Signal::KILL);
    }
}

fn bytes(line: &Result<String, String>) -> usize {
    line.as_ref().map_or_else(String::len, String::len)
}

fn read_lines(shared: &Shared, output: ChildStdout) {
    let mut output = BufReader::with_capacity(64 << 10, output);
    while let Some(line) = next_line(&mut output) {
        drop(shared.once(|state| state.said_bytes < MOST_SAID));
        shared.change(|state| {
            state.said_bytes += bytes(&line);
            state.said.push_back(line);
        });
    }
    shared.change(|state| state.output_closed = true);
}

/// The next line, without its end; or why it is none.
fn next_line(output: &mut impl BufRead) -> Option<Result<String, String>> {
    let mut line = Vec::new();
    let most = LONGEST_LINE as u64 + 1;
    output.by_ref().take(most).read_until(b'\n', &mut line).ok().filter(|read| *read > 0)?;
    match line.pop_if(|last| *last == b'\n') {
        None if line.len() > LONGEST_LINE => {
            // Where it ends, if it does, the next one begins.
            let _ = output.skip_until(b'\n');
            Some(Err(format!("it is longer than {LONGEST_LINE} bytes")))
        }
        _ => Some(String::from_utf8(line).map_err(|error| format!("it is not UTF-8: {error}"))),
    }
}

fn write_lines(shared: &Shared, mut input: ChildStdin) {
    loop {
        let mut state = shared.once(|state| !state.to_say.is_empty() || state.input_closed || state.gone);
        let lines = std::mem::take(&mut state.to_say);
        state.saying = lines.len();
        drop(state);
        if lines.is_empty() || input.write_all(&lines).is_err() {
            break;
        }
        shared.change(|state| state.saying = 0);
    }
    shared.change(|state| {
        state.input_closed = true;
        (state.to_say, state.saying) = (Vec::new(), 0);
    });
}

fn keep_words(shared: &Shared, errors: Option<ChildStderr>) {
    let mut words = [0; LAST_WORDS];
    if let Some(mut errors) = errors {
        while let Ok(read @ 1..) = errors.read(&mut words) {
            let mut state = shared.lock();
            state.last_words.extend_from_slice(&words[..read]);
            let over = state.last_words.len().saturating_sub(LAST_WORDS);
            state.last_words.drain(..over);
        }
    }
    shared.change(|state| state.errors_closed = true);
}

/// Waits for its end, and ends what it has left behind in its group.
fn wait_for_end(shared: &Shared, id: Pid, mut child: Child) {
    // Until somebody asks how it ended, its number is its own.
    while matches!(waitid(WaitId::Pid(id), WaitIdOptions::EXITED | WaitIdOptions::NOWAIT), Err(Errno::INTR)) {}
    let status = shared.change(|state| {
        let _ = kill_process_group(id, Signal::KILL);
        state.gone = true;
        child.wait()
    });
    let is_open = |state: &mut State| !(state.output_closed && state.errors_closed);
    let rest = shared.changed.wait_timeout_while(shared.lock(), REST_PATIENCE, is_open);
    drop(rest);
    // A child of ours that nobody else waits for has a status; this one says that there is none.
    shared.change(|state| state.ended = Some(status.unwrap_or(ExitStatus::from_raw(0xffff))));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What it has started may still speak for it, in a session of its own, where its end does not reach.
    #[test]
    fn the_end_comes_after_the_last_words() {
        let mut command = Command::new("sh");
        // It ends once the other has its session, and has closed the output that is read here.
        command.args(["-c", "word=$(setsid sh -c 'exec >&-; sleep 0.2; echo late >&2' &); exit 3"]);
        let mut program = Program::start(command, Errors::Kept).unwrap();
        let ended = loop {
            program.wait(Duration::from_secs(1));
            if let Some(Heard::Ended(status)) = program.hear() {
                break status;
            }
        };
        assert_eq!((ended.code(), program.last_words().as_deref()), (Some(3), Some("late")));
    }
}
