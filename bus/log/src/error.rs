//! What can go wrong with a log.

use std::path::PathBuf;

/// Why a log could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file could not be created.
    #[error("cannot create the log {}: {source}; is its folder there, and writable?", path.display())]
    Create {
        /// The log.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// What is recorded could not be written to the file; it is kept and tried again with the next flush.
    #[error("cannot write to the log {}: {source}; {waiting} bytes wait in memory for the disk", path.display())]
    Write {
        /// The log.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
        /// Bytes that wait to be written.
        waiting: usize,
    },
    /// The disk itself could not be made to take what was written; with the next flush it is asked again.
    #[error("the disk does not say that it has the log {}: {source}; what it was given last may not outlive the machine", path.display())]
    Sync {
        /// The log.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// So much waits for the disk that this record was not taken.
    #[error("the log {} takes no more: {waiting} bytes wait in memory for the disk; make room on it", path.display())]
    Full {
        /// The log.
        path: PathBuf,
        /// Bytes that wait to be written.
        waiting: usize,
    },
    /// The record does not fit into the format.
    #[error("{key} from {source_name} cannot be put into the log: {reason}")]
    Record {
        /// The record's key.
        key: String,
        /// Who published it.
        source_name: String,
        /// What the format says.
        reason: String,
    },
    /// The file could not be opened or read.
    #[error("cannot read the log {}: {source}", path.display())]
    Read {
        /// The log.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is something else.
    #[error("{} is no log of elk: {reason}", path.display())]
    NoLog {
        /// The file.
        path: PathBuf,
        /// What it is instead.
        reason: String,
    },
    /// A later elk wrote it.
    #[error("the log {} has format {found}, and this elk reads format {known}: read it with a newer one", path.display())]
    Newer {
        /// The log.
        path: PathBuf,
        /// Its format.
        found: String,
        /// The format that is read here.
        known: u32,
    },
    /// A message in a valid chunk is not what its channel announces.
    #[error("message {number} of the log {} is not what its channel says: {reason}; was it written by another version?", path.display())]
    Message {
        /// The log.
        path: PathBuf,
        /// Number of the message in the file, from 0.
        number: u64,
        /// What is wrong with it.
        reason: String,
    },
    /// Two logs have too much of which the other one has nothing.
    #[error(
        "{} and {} cannot be compared: more than {} MB of messages wait for their counterparts; choose some variables with \
         --keys, or a part with --from and --to", first.display(), second.display(), most / 1_000_000
    )]
    TooDifferent {
        /// A log.
        first: PathBuf,
        /// The other.
        second: PathBuf,
        /// The most that may wait (bytes).
        most: usize,
    },
}
