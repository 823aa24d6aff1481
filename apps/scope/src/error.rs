//! Why a look into a community failed, or a poke.

use elk_bus::Type;
use elk_bus::describe::WriteError;
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
    Poke(#[from] PokeError),
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

/// Why a variable was not written.
#[derive(Debug, thiserror::Error)]
pub enum PokeError {
    /// The name cannot be a variable's.
    #[error("{0:?} is no variable's name: one variable is written at a time, and '*' and '?' stand in patterns only")]
    Name(String),
    /// The variable is the broker's own.
    #[error("{0} is the broker's own variable: DB_* are written by it alone")]
    Brokers(String),
    /// The variable carries something else.
    #[error("{name} carries {carries}, not {said}; right is, for example, {example}")]
    Carries {
        /// The variable.
        name: String,
        /// What it carries.
        carries: String,
        /// What was said.
        said: String,
        /// A command that is right.
        example: String,
    },
    /// The value is no number.
    #[error("{name} has to be a number, and {value:?} is none; right is, for example, 3.5")]
    Number {
        /// The variable.
        name: String,
        /// What was typed.
        value: String,
    },
    /// The variable carries a type that nobody has described.
    #[error("{name} carries {type_}, which nobody has described: only an app that has the type can write it")]
    Undescribed {
        /// The variable.
        name: String,
        /// The type.
        type_: Type,
    },
    /// There is no such type.
    #[error("nobody in this community writes or reads a type {type_name:?}; {instead}")]
    Type {
        /// The type's name.
        type_name: String,
        /// What there is.
        instead: String,
    },
    /// The value is no JSON.
    #[error("{name} carries {type_name}, and the value is no JSON: {source}; its form is {example}")]
    Json {
        /// The variable.
        name: String,
        /// The type's name.
        type_name: String,
        /// What is wrong, and where.
        source: serde_json::Error,
        /// A value of its form: zeros, empty lists.
        example: String,
    },
    /// The value is JSON, and no value of the type.
    #[error("{name} cannot be written: {source}; its form is {example}")]
    Value {
        /// The variable.
        name: String,
        /// What is wrong.
        source: WriteError,
        /// A value of its form: zeros, empty lists.
        example: String,
    },
    /// Nobody has written the variable, and the value looks like a typed one.
    #[error(
        "nobody has written {0} yet, and the value looks like JSON: say of which type it is with --type TYPE, or --text"
    )]
    Undecided(String),
    /// The broker did not take it.
    #[error("the broker refused it: {0}")]
    Refused(String),
}
