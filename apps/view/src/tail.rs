//! The end of an app's text log, followed as it grows.

use std::io::{Read, Seek, SeekFrom};
use std::path::PathBuf;

use serde_json::{Value, json};

/// Bytes that are read at a time, and before the end at first.
const MOST: u64 = 64 << 10;

/// A text log, and how far it was read.
pub(crate) struct Tail {
    app: String,
    path: PathBuf,
    at: Option<u64>,
    lines: usize,
    /// The beginning of a line whose end is not there yet.
    begun: Vec<u8>,
}

impl Tail {
    pub fn new(app: String, path: PathBuf) -> Self {
        Self { app, path, at: None, lines: 0, begun: Vec::new() }
    }

    /// The message with the lines that have come; `None`: there are none, or no log yet.
    pub fn read(&mut self) -> Option<Value> {
        let mut file = elk_outside::file::open(&self.path).ok()?;
        let length = file.metadata().ok()?.len();
        // One that is shorter than it was has begun anew.
        let at = self.at.filter(|at| *at <= length).unwrap_or(length.saturating_sub(MOST));
        file.seek(SeekFrom::Start(at)).ok()?;
        let read = file.take(MOST).read_to_end(&mut self.begun).ok()?;
        self.at = Some(at + read as u64);
        let end = self.begun.iter().rposition(|byte| *byte == b'\n').map_or(0, |newline| newline + 1);
        // A line without an end is not kept for ever.
        let end = if self.begun.len() as u64 > MOST { self.begun.len() } else { end };
        let whole: Vec<u8> = self.begun.drain(..end).collect();
        let text = String::from_utf8_lossy(&whole);
        let lines: Vec<&str> = text.lines().collect();
        if lines.is_empty() {
            return None;
        }
        let from = self.lines;
        self.lines += lines.len();
        Some(json!({"type": "log", "app": self.app, "from": from, "lines": lines}))
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Write;

    use super::*;

    #[test]
    fn lines_come_once_and_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("Map.log");
        let mut tail = Tail::new("Map".into(), path.clone());
        assert_eq!(tail.read(), None);
        let mut file = File::create(&path).unwrap();
        file.write_all(b"one\ntwo\nthr").unwrap();
        let lines = |message: Option<Value>| message.map(|message| (message["from"].clone(), message["lines"].clone()));
        assert_eq!(lines(tail.read()), Some((0.into(), json!(["one", "two"]))));
        assert_eq!(tail.read(), None);
        file.write_all(b"ee\n").unwrap();
        assert_eq!(lines(tail.read()), Some((2.into(), json!(["three"]))));
    }
}
