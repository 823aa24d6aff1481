//! What is played: elk's own logs, and MOOS' text logs.

use std::path::Path;

use elk_log::alog::AlogReader;
use elk_log::index::OnProgress;
use elk_log::selection::Window;
use elk_log::{Index, LogError, LogReader, Record, RecordRef, Selection};

/// A log that can be played from any place.
pub struct Tape(Kind);

enum Kind {
    Log { reader: Box<LogReader>, index: Box<Index> },
    Alog(Box<Alog>),
}

/// One of MOOS' logs: they have no index and are small, so a jump reads from the beginning.
struct Alog {
    reader: AlogReader,
    /// The message that was found last.
    found: Option<Record>,
    /// The message that a jump has come to.
    next: Option<Record>,
    span: (f64, f64),
    messages: u64,
    /// What all of it was found to be damaged by, in words.
    damage: Vec<String>,
}

impl Tape {
    /// Opens the log at `path`: a run's folder, a file of elk's, or an `.alog`; `on_progress` is told how far a log
    /// without an index has been read.
    pub fn open(path: &Path, on_progress: OnProgress<'_>) -> Result<Self, LogError> {
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("alog")) {
            return Ok(Self(Kind::Alog(Box::new(Alog::open(path)?))));
        }
        let index = Box::new(Index::read(path, on_progress)?);
        Ok(Self(Kind::Log { reader: Box::new(LogReader::open(path)?), index }))
    }

    /// Messages in the log.
    pub fn messages(&self) -> u64 {
        match &self.0 {
            Kind::Log { index, .. } => index.messages(),
            Kind::Alog(alog) => alog.messages,
        }
    }

    /// When the first message was recorded, and the last (s); both 0: there is none.
    pub fn span(&self) -> (f64, f64) {
        match &self.0 {
            Kind::Log { index, .. } => index.span().unwrap_or_default(),
            Kind::Alog(alog) => alog.span,
        }
    }

    /// Goes on with the first message that was recorded at `time` (s) or later.
    pub fn seek(&mut self, time: f64) -> Result<(), LogError> {
        match &mut self.0 {
            Kind::Log { reader, index } => reader.seek(index, time),
            Kind::Alog(alog) => alog.seek(time),
        }
    }

    /// Nothing outside of this part is asked for: see [`LogReader::within`].
    pub fn within(&mut self, selection: &Selection) {
        let (origin, _) = self.span();
        if let Kind::Log { reader, .. } = &mut self.0 {
            reader.within(&Window { selection, origin });
        }
    }

    /// The type of the message that was found last, if it is another tool's and nobody here knows it.
    pub fn unknown_type(&self) -> Option<&str> {
        match &self.0 {
            Kind::Log { reader, .. } => reader.unknown_type(),
            Kind::Alog(_) => None,
        }
    }

    /// Finds the next message; whether there is one.
    pub fn advance(&mut self) -> Result<bool, LogError> {
        match &mut self.0 {
            Kind::Log { reader, .. } => reader.advance(),
            Kind::Alog(alog) => alog.advance(),
        }
    }

    /// Variable, source and time of recording (s) of the message that was found last.
    pub fn head(&self) -> Option<(&str, &str, f64)> {
        match &self.0 {
            Kind::Log { reader, .. } => reader.head(),
            Kind::Alog(alog) => {
                alog.found.as_ref().map(|record| (record.key.as_str(), record.source.as_str(), record.received))
            }
        }
    }

    /// The message that was found last.
    pub fn record(&mut self) -> Option<Result<RecordRef<'_>, LogError>> {
        match &mut self.0 {
            Kind::Log { reader, .. } => reader.record(),
            Kind::Alog(alog) => alog.found.as_ref().map(|record| Ok(record.as_ref())),
        }
    }

    /// What was found to be damaged or cut short so far, in words; of an `.alog` in all of it.
    pub fn damage(&self) -> Vec<String> {
        match &self.0 {
            Kind::Log { reader, .. } => reader.damage(),
            Kind::Alog(alog) => alog.damage.clone(),
        }
    }
}

impl Alog {
    fn open(path: &Path) -> Result<Self, LogError> {
        let (mut span, mut messages) = ((f64::INFINITY, f64::NEG_INFINITY), 0);
        let mut all = AlogReader::open(path)?;
        let reader = all.again()?;
        for record in &mut all {
            let time = record?.received;
            span = (span.0.min(time), span.1.max(time));
            messages += 1;
        }
        Ok(Self { reader, found: None, next: None, span, messages, damage: all.damage() })
    }

    fn seek(&mut self, time: f64) -> Result<(), LogError> {
        self.reader = self.reader.again()?;
        let there = |record: &Result<Record, LogError>| record.as_ref().map_or(true, |r| r.received >= time);
        self.next = self.reader.find(there).transpose()?;
        Ok(())
    }

    fn advance(&mut self) -> Result<bool, LogError> {
        self.found = match self.next.take() {
            Some(record) => Some(record),
            None => self.reader.next().transpose()?,
        };
        Ok(self.found.is_some())
    }
}
