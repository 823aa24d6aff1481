//! Where a command's result goes: files that are there when they are whole, not before; or, for `-`, standard output.

use std::fs::{DirBuilder, File};
use std::io::{ErrorKind, IsTerminal};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use elk_bus::tell;
use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::terminal::{complain, say};

/// A result that is yet to be written: under its own name, in a folder that is gone when this is.
pub struct Target {
    /// What was said; none: standard output.
    output: Option<PathBuf>,
    folder: PathBuf,
    draft: PathBuf,
}

impl Target {
    /// A new file at `output`, or standard output if that is `-`; `name` is what it is called meanwhile.
    pub fn new(output: &Path, name: &str) -> Result<Self> {
        let unwritable = || format!("cannot write {}", output.display());
        let to_file = (output != Path::new("-")).then(|| output.to_owned());
        if to_file.as_ref().is_some_and(|file| file.symlink_metadata().is_ok()) {
            bail!("{}: it is there already; say another file with -o", unwritable());
        }
        let (place, name) = match &to_file {
            Some(file) => {
                (file.parent().unwrap_or(Path::new("")).to_owned(), file.file_name().with_context(unwritable)?)
            }
            None => (std::env::temp_dir(), name.as_ref()),
        };
        let folder = own_folder(&place).with_context(unwritable)?;
        let draft = folder.join(name);
        Ok(Self { output: to_file, draft, folder })
    }

    /// Sees to it that a person who ends the program leaves no part of the result.
    pub fn gone_at_a_signal(self) -> Result<Self> {
        let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).context("signals cannot be caught")?;
        let folder = self.folder.clone();
        let wait = move || {
            if let Some(signal) = signals.forever().next() {
                let _ = std::fs::remove_dir_all(&folder);
                std::process::exit(128 + signal);
            }
        };
        let spawned = std::thread::Builder::new().spawn(wait);
        spawned.map_err(|error| anyhow!("no thread for signals: {error}{}", elk_bus::remedy(&error)))?;
        Ok(self)
    }

    /// Where it is to be written.
    pub fn draft(&self) -> &Path {
        &self.draft
    }

    /// Whether it goes to standard output, so that nothing else may.
    fn is_standard_output(&self) -> bool {
        self.output.is_none()
    }

    /// Says something that is no part of the result.
    pub fn say(&self, words: &str) -> Result<()> {
        match self.is_standard_output() {
            true => tell(words.trim_end()),
            false => say(words)?,
        }
        Ok(())
    }

    /// What the result is called, for people.
    pub fn shown(&self) -> String {
        self.output.as_ref().map_or("standard output".to_owned(), |file| file.display().to_string())
    }

    /// Puts the result into its place, then says what is to be said of it.
    pub fn conclude(self, said: &str) -> Result<()> {
        let piped = self.is_standard_output();
        for beside in self.finish()? {
            let name = beside.file_name().unwrap_or_default().to_string_lossy().into_owned();
            complain(&format!("{name} is left out: standard output has no room for a second file; right is -o FILE"));
        }
        match piped {
            true if said.is_empty() => {}
            true => tell(said.trim_end()),
            false => say(said)?,
        }
        Ok(())
    }

    /// The result is whole: it takes its place, along with what was written beside it. Answers what of that standard
    /// output has no place for.
    fn finish(self) -> Result<Vec<PathBuf>> {
        let mut files: Vec<PathBuf> = std::fs::read_dir(&self.folder)?.flatten().map(|entry| entry.path()).collect();
        files.sort();
        match &self.output {
            None => {
                let mut whole = File::open(&self.draft)?;
                std::io::copy(&mut whole, &mut std::io::stdout().lock())?;
                files.retain(|file| *file != self.draft);
                return Ok(files);
            }
            Some(output) => {
                let place = output.parent().unwrap_or(Path::new(""));
                // What belongs to it comes before it.
                files.sort_by_key(|file| *file == self.draft);
                for file in files {
                    let Some(name) = file.file_name() else { continue };
                    let to = place.join(name);
                    rename(&file, &to).with_context(|| format!("cannot write {}", to.display()))?;
                }
            }
        }
        Ok(Vec::new())
    }
}

impl Drop for Target {
    fn drop(&mut self) {
        // What cannot be removed harms nobody.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// Makes a folder that nobody else has.
fn own_folder(place: &Path) -> std::io::Result<PathBuf> {
    let named = |number: u32| place.join(format!(".elk-{}-{number}", std::process::id()));
    for number in 0..1000 {
        match DirBuilder::new().mode(0o700).create(named(number)) {
            // One that was killed has left it.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            made => return made.map(|()| named(number)),
        }
    }
    Err(ErrorKind::AlreadyExists.into())
}

/// Renames a file, unless there is one of the new name.
fn rename(from: &Path, to: &Path) -> std::io::Result<()> {
    match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        // Not every file system can do that in one.
        Err(Errno::INVAL | Errno::NOSYS) => std::fs::hard_link(from, to).and_then(|()| std::fs::remove_file(from)),
        done => Ok(done?),
    }
}

/// Refuses to write what no terminal can show to one.
pub fn not_to_a_terminal(output: &Path) -> Result<()> {
    if output == Path::new("-") && std::io::stdout().is_terminal() {
        bail!("a log is nothing that a terminal can show; right is -o FILE, or a pipe behind the command");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            std::fs::read_dir(folder).unwrap().map(|one| one.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_result_is_there_when_it_is_whole_and_nothing_of_it_when_it_fails() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.alog");
        let target = Target::new(&output, "").unwrap();
        std::fs::write(target.draft(), "half").unwrap();
        assert!(!output.exists());
        drop(target);
        assert_eq!(names(folder.path()), [""; 0]);

        let target = Target::new(&output, "").unwrap();
        std::fs::write(target.draft(), "whole").unwrap();
        std::fs::write(target.draft().with_extension("blog"), "more").unwrap();
        assert!(target.finish().unwrap().is_empty());
        assert_eq!(names(folder.path()), ["run.alog", "run.blog"]);
        assert_eq!(std::fs::read_to_string(&output).unwrap(), "whole");
    }

    #[test]
    fn nothing_that_is_there_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("run.csv");
        let target = Target::new(&output, "").unwrap();
        std::fs::write(target.draft(), "new").unwrap();
        std::fs::write(&output, "came meanwhile").unwrap();
        assert!(target.finish().is_err());
        assert_eq!(std::fs::read_to_string(&output).unwrap(), "came meanwhile");
        assert!(Target::new(&output, "").is_err());
        let error = format!("{:#}", Target::new(&folder.path().join("no/such/run.csv"), "").err().unwrap());
        assert!(error.starts_with("cannot write ") && error.contains("no/such/run.csv: No such file"), "{error}");
        assert_eq!(names(folder.path()), ["run.csv"]);
    }
}
