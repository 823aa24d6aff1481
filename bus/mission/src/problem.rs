//! What is wrong with a mission, and where.

use std::fmt;
use std::path::{Path, PathBuf};

use elk_outside::text;

/// Where something was said.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Location {
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
    pub location: Location,
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

/// Where something was found, while a mission is checked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum At {
    /// In the mission file.
    Byte(usize),
    /// On the command line, as it was written there.
    CommandLine(String),
}

/// What is wrong with a mission, as it is found: whatever is said of the file may become a problem, and few are, so lines
/// and columns are counted at the end.
#[derive(Debug, Default)]
pub(crate) struct Findings(Vec<(At, String)>);

/// So many problems are told; beyond them nobody reads on.
const MOST: usize = 100;
/// Characters of a message: it quotes what was found, which may be anything.
const LONGEST: usize = 2000;

impl Findings {
    /// Notes a problem; the last of the list says that there are more.
    pub fn add(&mut self, at: &At, message: impl Into<String>) {
        let message = match self.0.len() {
            0..MOST => text::clipped(&message.into(), LONGEST).into_owned(),
            MOST => "and there is more that is wrong".to_owned(),
            _ => return,
        };
        self.0.push((at.clone(), message));
    }

    /// Whether nothing is wrong.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// With lines and columns of `file`, whose text this is, in the order of the file, then of the command line.
    pub fn located(mut self, file: &Path, text: &str) -> Problems {
        self.0.sort_by_key(|(at, _)| match at {
            At::Byte(byte) => *byte,
            At::CommandLine(_) => usize::MAX,
        });
        let mut cursor = Cursor { text, byte: 0, line: 1, column: 1 };
        let located = |(at, message)| match at {
            At::Byte(byte) => Problem { location: cursor.location(byte), message },
            At::CommandLine(said) => Problem { location: Location::CommandLine(said), message },
        };
        Problems { file: file.to_owned(), list: self.0.into_iter().map(located).collect() }
    }
}

/// A byte of a text, and its line and column.
struct Cursor<'a> {
    text: &'a str,
    byte: usize,
    line: u32,
    column: u32,
}

impl Cursor<'_> {
    /// Goes on to a byte that is not before this one.
    fn location(&mut self, byte: usize) -> Location {
        for letter in self.text.get(self.byte..byte).unwrap_or_default().chars() {
            let ends = letter == '\n';
            (self.line, self.column) = if ends { (self.line + 1, 1) } else { (self.line, self.column + 1) };
        }
        self.byte = byte;
        Location::File { line: self.line, column: self.column }
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, problem) in self.list.iter().enumerate() {
            let separator = if n > 0 { "\n" } else { "" };
            match &problem.location {
                Location::File { line, column } => write!(f, "{separator}{}:{line}:{column}: ", self.file.display())?,
                Location::CommandLine(said) => write!(f, "{separator}{said}: ")?,
            }
            f.write_str(&problem.message)?;
        }
        Ok(())
    }
}

impl std::error::Error for Problems {}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn every_letter_is_where_counting_finds_it(text in "[ä\n€a]{0,90}") {
            let mut findings = Findings::default();
            text.char_indices().rev().for_each(|(at, _)| findings.add(&At::Byte(at), ""));
            let lines = text.split_inclusive('\n').zip(1..);
            let located = lines.flat_map(|(line, row)| (1..).zip(line.chars()).map(move |(column, _)| (row, column)));
            let expected: Vec<Location> = located.map(|(line, column)| Location::File { line, column }).collect();
            let found = findings.located(Path::new(""), &text).list.into_iter().map(|problem| problem.location);
            prop_assert_eq!(found.collect::<Vec<_>>(), expected);
        }
    }
}
