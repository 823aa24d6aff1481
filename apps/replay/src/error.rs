//! What can go wrong with a replay.

use std::path::PathBuf;

use elk_bus::{CommsError, DecodeError};
use elk_log::LogError;

/// Why a log could not be played.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The bus failed.
    #[error(transparent)]
    Comms(#[from] CommsError),
    /// The broker's table cannot be understood.
    #[error(transparent)]
    Table(#[from] DecodeError),
    /// The broker does not answer.
    #[error("the broker of community {community} has not said within {secs} s who is there")]
    Silent {
        /// The community.
        community: String,
        /// How long it was waited for.
        secs: u64,
    },
    /// Another client drives the community's clock.
    #[error("--clock: {reason}, or play without --clock")]
    Clock {
        /// What the broker says.
        reason: String,
    },
    /// The log has nothing to play.
    #[error("{} has no message that is to be played: look at `elk log info`, and at --keys, --source, --exclude, --from and --to", .0.display())]
    Nothing(PathBuf),
    /// The folder of a new run cannot be made.
    #[error("cannot make the new run's folder in {}: {source}; choose another --log-dir", folder.display())]
    Folder {
        /// Where.
        folder: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// An app that is to be live is not in the mission.
    #[error("the mission has no app {name:?} that could be live; it has {known}")]
    NoApp {
        /// What was asked for.
        name: String,
        /// The mission's apps.
        known: String,
    },
    /// An app that is to be live cannot be.
    #[error("{app} cannot be live: {reason}")]
    App {
        /// Its name.
        app: String,
        /// Why.
        reason: String,
    },
    /// An app did not register in time.
    #[error("{app} has not registered for anything within {secs} s")]
    NotRegistered {
        /// Its name.
        app: String,
        /// How long it was waited for.
        secs: u64,
    },
}
