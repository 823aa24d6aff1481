//! Why a launch failed.

use std::io;
use std::path::PathBuf;

use elk_bus::{Owner, remedy};

/// Why a mission could not be started, or did not run to its end.
#[derive(Debug, thiserror::Error)]
pub enum LaunchError {
    /// The run's folder cannot be made or written to.
    #[error("cannot make the run's folder in {}: {source}; choose another one with --log-dir", .folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file of the run cannot be written.
    #[error("cannot write {}: {source}", .file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// What a program of MOOS' is to be told cannot be put into words for it.
    #[error("{app} cannot be told by {}: {source}", .file.display())]
    MoosFile {
        /// The app.
        app: String,
        /// Its file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// No port is free for clients of MOOS'.
    #[error("no port of {address} is free for clients of MOOS': {source}; <Bus moos=\"HOST:PORT\"/> names one")]
    NoPort {
        /// Where one was looked for.
        address: String,
        /// Why.
        source: io::Error,
    },
    /// An app's parameter cannot be set to what this run needs.
    #[error(transparent)]
    Setting(#[from] elk_mission::Problems),
    /// What the mission needs is not there, or is not as it has to be.
    #[error(transparent)]
    NotReady(#[from] elk_mission::NotReady),
    /// An executable cannot be started at all.
    #[error("{app} cannot be started: {}: {source}{}", .program.display(), remedy(.source))]
    CannotStart {
        /// The app.
        app: String,
        /// The executable.
        program: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// An app ended although the mission was not over.
    #[error("{app} ended {when}: {how}{}", log_lines(.log, .tail))]
    Died {
        /// The app.
        app: String,
        /// When, seen from the mission.
        when: &'static str,
        /// Its exit code or signal, or what it failed with.
        how: String,
        /// Its text log.
        log: PathBuf,
        /// The log's last lines.
        tail: Vec<String>,
    },
    /// An app, or the broker, died once too often.
    #[error("{died}\n    it had been started again {limit}, which is its limit")]
    GaveUp {
        /// How often, in words.
        limit: String,
        /// Its last death.
        died: Box<LaunchError>,
    },
    /// Somebody launches this community already.
    #[error(
        "community {community} is launched already, by {}: choose another --community, or end that mission first",
        holder_in_words(*.holder)
    )]
    Launched {
        /// The community.
        community: elk_bus::Community,
        /// Whoever has the launcher's name; `None`: its queue is full or closed, so it cannot be asked.
        holder: Option<Owner>,
    },
    /// A broker that is not the launcher's serves this community.
    #[error(
        "community {0} is served already, by a broker that is not this mission's: choose another --community, end that \
         broker, or, if its mission was launched with --detach, pick it up with `elk attach --community {0}`"
    )]
    Served(elk_bus::Community),
    /// Another launcher has taken the mission over.
    #[error("the mission goes on, and `elk attach` has taken it over from here")]
    Relieved,
    /// There is no mission to pick up.
    #[error("community {community}: {why}")]
    Attach {
        /// The community.
        community: elk_bus::Community,
        /// Why not.
        why: String,
    },
    /// What another launcher has to know cannot be kept.
    #[error("if launcher and broker die at once, `elk attach` will not find the mission: {0}")]
    Unkept(elk_bus::FolderError),
    /// The mission was over, and what an app had yet to do it could not.
    #[error("{app} could not end in good order: {how}{}", log_lines(.log, .tail))]
    Unfinished {
        /// The app.
        app: String,
        /// Its exit code or signal.
        how: String,
        /// Its text log.
        log: PathBuf,
        /// The log's last lines.
        tail: Vec<String>,
    },
    /// A file that an app writes at the end cannot be written.
    #[error("{app} cannot write {param}={}: {source}; choose another one", .file.display())]
    Unwritable {
        /// The app.
        app: String,
        /// The parameter that names the file.
        param: &'static str,
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// As [`LaunchError::Died`], of an app that is a thread.
    #[error("{app} ended {when}: {how}")]
    ThreadEnded {
        /// The app.
        app: String,
        /// When, seen from the mission.
        when: &'static str,
        /// What it failed with.
        how: String,
    },
    /// Another executable cannot be a thread.
    #[error("{0} is an executable of its own: it cannot run inside this process, launch without --in-process")]
    NoThread(String),
    /// Nobody comes into a process over the network.
    #[error(
        "<Bus moos>, or MOOSHost and MOOSPort, let clients of MOOS' in, and moos=\"true\" starts one: that takes a broker of its own, launch without --in-process"
    )]
    NoSockets,
    /// An app runs but did not come to the bus.
    #[error("{} did not register within {secs} s; what they say is in {}", .apps.join(", "), .folder.display())]
    NotRegistered {
        /// The apps.
        apps: Vec<String>,
        /// How long they were waited for.
        secs: u64,
        /// Where their text logs are.
        folder: PathBuf,
    },
    /// Everybody is there, nobody holds the robot, and yet nothing happens.
    #[error(
        "nothing has moved for {secs} s although everybody runs; the last word was {last_word}, and whoever should have \
         answered did not{}: what they say is in {}",
        if .rejection.is_empty() { String::new() } else { format!(" ({})", .rejection) }, .folder.display()
    )]
    Standstill {
        /// How long it was waited.
        secs: u64,
        /// The last message of a step, and whose it was.
        last_word: String,
        /// What was rejected of it, by whom and why; empty: nothing was.
        rejection: String,
        /// Where their text logs are.
        folder: PathBuf,
    },
    /// The launcher itself cannot join the community.
    #[error(transparent)]
    Connect(#[from] elk_bus::ConnectError),
    /// The bus failed.
    #[error(transparent)]
    Comms(#[from] elk_bus::CommsError),
    /// The run was stopped by a person or by the system.
    #[error("stopped")]
    Stopped,
    /// The system refused something that every launch needs.
    #[error("{what}: {source}{}", remedy(.source))]
    System {
        /// What was wanted.
        what: &'static str,
        /// Why not.
        source: io::Error,
    },
}

fn log_lines(log: &std::path::Path, tail: &[String]) -> String {
    match tail {
        // It ended while there was no launcher, or before the mission did.
        [] if log.as_os_str().is_empty() => String::new(),
        [] => format!("; its log {} is empty", log.display()),
        lines => format!("; the end of {}:\n    {}", log.display(), lines.join("\n    ")),
    }
}

fn holder_in_words(holder: Option<Owner>) -> String {
    match holder {
        Some(Owner { process, user }) => format!("process {process} of user {user}"),
        None => "a launcher that takes nobody in".to_owned(),
    }
}
