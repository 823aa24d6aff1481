//! Processes that play a role: started, listened to, and never left behind. They speak in lines on their standard
//! output, are spoken to in lines on their standard input, and get SIGTERM when this process dies.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child as Process, ChildStdin, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use rustix::process::{Pid, Signal, kill_process};

use crate::transport::BenchResult;

/// How long a process gets to leave after SIGTERM.
const FAREWELL: Duration = Duration::from_secs(5);
/// How often a wait looks up.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// A process that plays a role.
pub struct Child {
    role: String,
    process: Process,
    words: Option<ChildStdin>,
    lines: Receiver<String>,
    /// The person who measures wants to stop.
    stop: Arc<AtomicBool>,
}

impl Child {
    /// Starts this executable again, in a role.
    pub fn start(stop: &Arc<AtomicBool>, role: &[String]) -> BenchResult<Self> {
        let mut process = Command::new(std::env::current_exe()?)
            .arg("--role")
            .args(role)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let (words, output) = (process.stdin.take(), process.stdout.take());
        let (sender, lines) = channel();
        let child = Self { role: role.join(" "), process, words, lines, stop: stop.clone() };
        let output = output.ok_or("the child has no output")?;
        std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Ok(child)
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Writes it a line.
    pub fn tell(&mut self, word: &str) -> BenchResult {
        let words = self.words.as_mut().ok_or("the child has no input")?;
        Ok(writeln!(words, "{word}")?)
    }

    /// Waits for its next line, which has to begin with `word`; answers the words after it.
    pub fn hear(&self, word: &str, patience: Duration) -> BenchResult<Vec<String>> {
        self.hear_while(word, patience, &mut || ())
    }

    /// As [`Child::hear`]; calls `meanwhile` every few milliseconds.
    pub fn hear_while(&self, word: &str, patience: Duration, meanwhile: &mut dyn FnMut()) -> BenchResult<Vec<String>> {
        let waited = Stopwatch::start();
        while waited.elapsed() < patience {
            if self.stop.load(Ordering::Relaxed) {
                return Err("interrupted".into());
            }
            match self.lines.recv_timeout(LOOK_EVERY) {
                Ok(line) => return self.after(word, &line),
                Err(RecvTimeoutError::Timeout) => meanwhile(),
                Err(RecvTimeoutError::Disconnected) => return Err(format!("{}: ended early", self.role).into()),
            }
        }
        Err(format!("{}: no {word:?} within {patience:?}", self.role).into())
    }

    fn after(&self, word: &str, line: &str) -> BenchResult<Vec<String>> {
        let mut words = line.split_whitespace().map(str::to_owned);
        match words.next() {
            Some(first) if first == word => Ok(words.collect()),
            _ => Err(format!("{}: said {line:?} instead of {word:?}", self.role).into()),
        }
    }

    fn has_left_within(&mut self, patience: Duration) -> bool {
        let waited = Stopwatch::start();
        while matches!(self.process.try_wait(), Ok(None)) {
            if waited.elapsed() > patience {
                return false;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        true
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        self.words = None;
        if let Some(id) = Pid::from_raw(self.process.id() as i32) {
            // It may be gone already; then it only has to be waited for.
            let _ = kill_process(id, Signal::TERM);
        }
        if !self.has_left_within(FAREWELL) {
            let _ = self.process.kill();
            let _ = self.process.wait();
        }
    }
}
