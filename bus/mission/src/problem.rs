//! What is wrong with a mission, and where.

use std::fmt;
use std::path::PathBuf;

use elk_outside::text;

/// Where something was said.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// In the mission file, counted from 1.
    File {
        /// The line.
        line: u32,
        /// The column, in characters.
        column: u32,
    },
    /// On the command line, as it was written there.
    CommandLine(String),
}

/// One thing that is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Where it was said.
    pub place: Place,
    /// What was found, and what would be right.
    pub message: String,
}

/// Everything that is wrong with a mission, one line each: `file:line:column: what was found; what would be right`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problems {
    /// The mission file.
    pub file: PathBuf,
    /// In the order of the file, then of the command line.
    pub list: Vec<Problem>,
}

impl Problems {
    pub(crate) fn new(file: PathBuf) -> Self {
        let list = Vec::new();
        Self { file, list }
    }

    /// Notes a problem; beyond the first hundred nobody reads them, and only the last of the list says that there are more.
    pub(crate) fn add(&mut self, place: &Place, message: impl Into<String>) {
        const MOST: usize = 100;
        /// Characters of a message: it quotes what was found, which may be anything.
        const LONGEST: usize = 2000;
        let message = match self.list.len() {
            0..MOST => text::clipped(&message.into(), LONGEST).into_owned(),
            MOST => "and there is more that is wrong".to_owned(),
            _ => return,
        };
        self.list.push(Problem { place: place.clone(), message });
    }

    pub(crate) fn sort(&mut self) {
        self.list.sort_by_key(|problem| match problem.place {
            Place::File { line, column } => (line, column),
            Place::CommandLine(_) => (u32::MAX, u32::MAX),
        });
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, problem) in self.list.iter().enumerate() {
            let separator = if n > 0 { "\n" } else { "" };
            match &problem.place {
                Place::File { line, column } => write!(f, "{separator}{}:{line}:{column}: ", self.file.display())?,
                Place::CommandLine(said) => write!(f, "{separator}{said}: ")?,
            }
            f.write_str(&problem.message)?;
        }
        Ok(())
    }
}

impl std::error::Error for Problems {}
