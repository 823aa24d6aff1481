//! Why a look into a community failed.

use elk_bus::{CommsError, Community, ConnectError};

/// Why a look into a community failed.
#[derive(Debug, thiserror::Error)]
pub enum ScopeError {
    /// Nobody serves the community.
    #[error("no community {community} runs here: {instead}")]
    NoCommunity {
        /// The community.
        community: Community,
        /// The communities that run, or how to start one.
        instead: String,
    },
    /// The community did not let the scope in.
    #[error(transparent)]
    Connect(#[from] ConnectError),
    /// The bus failed.
    #[error(transparent)]
    Comms(#[from] CommsError),
    /// The broker does not answer.
    #[error(
        "the broker of community {0} has not said who and what is there: is its process stopped, or much too busy?"
    )]
    Silent(String),
    /// The broker's answer cannot be read.
    #[error(transparent)]
    Answer(#[from] elk_bus::DecodeError),
    /// Neither a client nor a variable has the name.
    #[error("{what} {name}; {instead}")]
    Unknown {
        /// What there is none of.
        what: &'static str,
        /// The name.
        name: String,
        /// What there is.
        instead: String,
    },
    /// What is to be poked does not fit.
    #[error(transparent)]
    Poke(#[from] crate::poke::PokeError),
    /// The kernel does not list its sockets.
    #[error("the communities of this machine cannot be listed: {0}")]
    Sockets(std::io::Error),
    /// Ctrl-C cannot be caught.
    #[error("signals cannot be caught: {}{}", .0, elk_bus::remedy(.0))]
    Signals(std::io::Error),
    /// The output cannot be written.
    #[error("the output cannot be written: {0}")]
    Output(std::io::Error),
    /// Whoever read the output has gone (`elk top | head`): no failure, only the end.
    #[error("nobody reads the output any more")]
    ReaderGone,
}

impl From<std::io::Error> for ScopeError {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::BrokenPipe => Self::ReaderGone,
            _ => Self::Output(error),
        }
    }
}
