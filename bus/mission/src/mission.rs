//! From a mission file to a mission, or to everything that is wrong with it.

use std::path::{Path, PathBuf};

use elk_outside::file;

use crate::antler;
use crate::problem::{Findings, Problems};
use crate::registry::Registry;
use crate::scenario;
use crate::setting::Override;
use crate::source;
use crate::spec::{Mission, is_moos_file};

/// Why there is no mission.
#[derive(Debug, thiserror::Error)]
pub enum MissionError {
    /// The file cannot be read.
    #[error("cannot read the mission file {}: {source}", .file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The mission, or what the command line changes in it, is wrong.
    #[error(transparent)]
    Wrong(#[from] Problems),
}

impl Mission {
    /// The longest mission file that is read (bytes); one of a thousand apps is shorter.
    pub const LONGEST: u64 = 512_000;
    /// The longest mission that a run keeps as it ran (bytes): every default is said in it, and a character of a text may
    /// have become six.
    pub const LONGEST_EFFECTIVE: u64 = 16 * Self::LONGEST;

    /// Reads and checks a mission file, changed by `overrides`.
    ///
    /// # Errors
    /// The file cannot be read, or everything that is wrong with it.
    pub fn load(file: &Path, registry: &Registry, overrides: &[Override]) -> Result<Self, MissionError> {
        Self::load_up_to(Self::LONGEST, file, registry, overrides)
    }

    /// As [`Mission::load`], of a mission as it ran ([`Mission::to_xml`]).
    ///
    /// # Errors
    /// As there.
    pub fn load_effective(file: &Path, registry: &Registry, overrides: &[Override]) -> Result<Self, MissionError> {
        Self::load_up_to(Self::LONGEST_EFFECTIVE, file, registry, overrides)
    }

    fn load_up_to(
        longest: u64,
        file: &Path,
        registry: &Registry,
        overrides: &[Override],
    ) -> Result<Self, MissionError> {
        let unreadable = |source| MissionError::Unreadable { file: file.to_owned(), source };
        let bytes = file::read(file, longest).map_err(unreadable)?;
        let text = source::text_of(&bytes).map_err(|(findings, text)| findings.located(file, &text))?;
        Ok(Self { bytes, ..Self::parse(&text, file, registry, overrides)? })
    }

    /// Checks the text of a mission file; `file` is named in errors, and relative files are looked for beside it.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn parse(text: &str, file: &Path, registry: &Registry, overrides: &[Override]) -> Result<Self, Problems> {
        let mut problems = Findings::default();
        let said = match is_moos_file(file) {
            true => antler::read(text, file, &mut problems),
            false => scenario::read(text, file, registry, &mut problems),
        };
        match said.map(|said| said.settled(text, file, registry, overrides, &mut problems)) {
            Some(mission) if problems.is_empty() => Ok(mission),
            _ => Err(problems.located(file, text)),
        }
    }
}
