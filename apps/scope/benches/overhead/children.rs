//! Processes that play a role: started, listened to, and never left behind.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child as Process, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rustix::process::{Pid, Signal, kill_process};

use crate::BenchResult;

/// A process that plays a role.
pub struct Child {
    process: Process,
    /// Bytes of its output that were read and thrown away.
    output: Arc<AtomicU64>,
}

impl Child {
    /// Starts this executable again, in a role.
    pub fn start(role: &[&str]) -> BenchResult<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("--role").args(role).stdin(Stdio::piped()).stdout(Stdio::piped());
        Ok(Self { process: command.spawn()?, output: Arc::default() })
    }

    /// Writes it a line.
    pub fn tell(&mut self, word: &str) -> BenchResult {
        let words = self.process.stdin.as_mut().ok_or("the child has no input")?;
        Ok(writeln!(words, "{word}")?)
    }

    /// Waits for its next line.
    pub fn hear(&mut self) -> BenchResult<String> {
        let output = self.process.stdout.as_mut().ok_or("the child has no output")?;
        let mut line = String::new();
        match BufReader::with_capacity(1, output).read_line(&mut line)? {
            0 => Err("a child ended early".into()),
            _ => Ok(line.trim().to_owned()),
        }
    }

    /// Reads all that it writes from now on, as whoever is at the other end of its pipe would.
    pub fn drain(&mut self) -> BenchResult {
        let mut from = self.process.stdout.take().ok_or("the child has no output")?;
        let read = self.output.clone();
        std::thread::spawn(move || {
            let mut buffer = vec![0; 64 << 10];
            while let Ok(bytes) = from.read(&mut buffer)
                && bytes > 0
            {
                read.fetch_add(bytes as u64, Ordering::Relaxed);
            }
        });
        Ok(())
    }

    /// Bytes that were drained so far.
    pub fn output(&self) -> u64 {
        self.output.load(Ordering::Relaxed)
    }

    /// Seconds of CPU that its main thread, which does all the work, has used.
    pub fn cpu_secs(&self) -> BenchResult<f64> {
        let text = std::fs::read_to_string(format!("/proc/{}/schedstat", self.process.id()))?;
        let nanos: f64 = text.split(' ').next().ok_or("an empty schedstat")?.parse()?;
        Ok(nanos * 1e-9)
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        if let Some(id) = Pid::from_raw(self.process.id() as i32) {
            // It may be gone already; then it only has to be waited for.
            let _ = kill_process(id, Signal::TERM);
        }
        let _ = self.process.wait();
    }
}
