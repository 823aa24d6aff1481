//! The end of whoever asks.

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;

use elk_bus::shm::abstract_socket;
use elk_bus::{Community, Owner, own_user};

use super::socket::{MAX_ANSWER, name};
use super::words::{Answer, Order};

/// How long a launcher may take to take one more in.
const PATIENCE: Duration = Duration::from_secs(5);

/// Why a question has no answer.
#[derive(Debug, thiserror::Error)]
pub enum AskError {
    /// Nobody is there to be asked.
    #[error(
        "nobody launches community {0} here: `elk launch` starts a mission, \
         `elk attach --community {0}` picks a detached one up"
    )]
    NoLauncher(Community),
    /// The launcher is another user's.
    #[error(
        "community {community} is launched by process {process} of user {user}: only that user gives orders there; choose \
         another --community"
    )]
    ForeignUser {
        /// The community.
        community: Community,
        /// The process that listens there.
        process: u32,
        /// The user's id.
        user: u32,
    },
    /// The launcher did not answer in time.
    #[error("the launcher of community {community} did not answer within {secs} s")]
    NoAnswer {
        /// The community.
        community: Community,
        /// How long it was waited for.
        secs: u64,
    },
    /// The launcher went away, or said something odd.
    #[error("the launcher of community {community} did not answer: {why}")]
    Broken {
        /// The community.
        community: Community,
        /// Why.
        why: String,
    },
}

/// Asks the launcher of a community, and waits for its last word, for at most `patience` between two words.
///
/// # Errors
/// There is no launcher, or it does not answer. That it cannot do what it was asked is an [`Answer::Failed`].
pub fn ask(
    community: &Community,
    question: &Order,
    patience: Duration,
    mut on_progress: impl FnMut(&str),
) -> Result<Answer, AskError> {
    let broken = |why: String| AskError::Broken { community: community.clone(), why };
    let io = |error: std::io::Error| match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut => {
            AskError::NoAnswer { community: community.clone(), secs: patience.as_secs() }
        }
        _ => broken(error.to_string()),
    };
    let mut stream = connect(community, patience)?;
    let mut line = serde_json::to_vec(question).map_err(|error| broken(error.to_string()))?;
    line.push(b'\n');
    stream.write_all(&line).map_err(io)?;
    let mut answers = BufReader::new(stream.take(MAX_ANSWER));
    loop {
        let mut line = String::new();
        answers.read_line(&mut line).map_err(io)?;
        if line.is_empty() {
            return Err(broken("it ended before it had".to_owned()));
        }
        match serde_json::from_str(&line).map_err(|error| broken(error.to_string()))? {
            Answer::Progress { text } => on_progress(&text),
            answer => return Ok(answer),
        }
    }
}

fn connect(community: &Community, patience: Duration) -> Result<UnixStream, AskError> {
    let broken = |error: std::io::Error| AskError::Broken { community: community.clone(), why: error.to_string() };
    let stream =
        abstract_socket::connect(&name(community), patience.min(PATIENCE)).map_err(|error| match error.kind() {
            ErrorKind::WouldBlock => broken(error),
            _ => AskError::NoLauncher(community.clone()),
        })?;
    let Owner { process, user } = Owner::at_other_end(&stream).map_err(broken)?;
    if user != own_user() {
        return Err(AskError::ForeignUser { community: community.clone(), process, user });
    }
    stream.set_read_timeout(Some(patience)).and_then(|()| stream.set_write_timeout(Some(patience))).map_err(broken)?;
    Ok(stream)
}
