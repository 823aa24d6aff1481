//! The bus: a broker that mirrors the MOOSDB, lanes of shared memory to it, and the framework that apps are written in.
//!
//! This crate is what an app needs; what it is made of lies in crates of its own, and is to be had under its names here.
//!
//! | module | one idea | from |
//! |---|---|---|
//! | [`comms`], [`inbox`] | what a client says, and what it hears | |
//! | [`subscription`] | what a client wants to hear, and how | |
//! | [`client`], [`app`] | both ends together; MOOS' three callbacks | |
//! | [`drawing`] | what apps draw, and the keys that they take | `elk-drawing` |
//! | [`handlers`] | an app as one table: what it hears, does and remembers | |
//! | [`request`] | questions and answers: two variables, told apart by who asked which | |
//! | [`event_loop`] | a client in somebody's event loop: a descriptor that is readable when mail waits | |
//! | [`launched`] | what a launcher hands over to an app: name, community, parameters, lease | |
//! | [`rejection`] | messages that an app cannot use: said, counted, passed over | |
//! | [`memory`], [`shm`] | the transports: inside one process, and between processes over iceoryx2 | `elk-shm` |
//! | [`broker`], [`wire`], [`link`] | the broker, what is said to it, and the seam that a transport fills | `elk-proto` |
//! | [`key`], [`value`], [`types`], [`codec`] | typed keys, the three kinds of value, what a type is, its encoding | `elk-proto` |
//! | [`community`], [`pattern`] | names of communities, wildcards | `elk-proto` |
//! | [`clock`], [`stop`], [`child`] | the one clock, signals that ask a process to stop, processes that a process starts | `elk-os` |

// `#[payload]` names this crate by its own name, here as everywhere.
extern crate self as elk_bus;

pub mod app;
pub mod client;
pub mod comms;
mod complaints;
mod drawing_state;
pub mod event_loop;
mod failure;
pub mod handlers;
pub mod inbox;
pub mod launched;
pub mod memory;
mod numbering;
mod recall;
pub mod rejection;
pub mod request;
mod shown;
mod status;
#[cfg(feature = "tokio")]
pub mod stream;
pub mod subscription;

use std::sync::atomic::AtomicBool;

pub use app::{App, RunError, begin_app, run_app_on, take_turn, take_wake};
pub use client::Client;
pub use comms::{Comms, CommsError, Drive, Origin};
pub use drawing_state::MAX_DRAWINGS;
/// What [`payload`] derives besides: a type says what its bytes are, and what every value of it has to keep to.
pub use elk_describe as describe;
/// Makes a struct or an enum travel: as the value of a [`Key`], or as a field of one.
///
/// It derives serde's traits and [`Describe`], so that whoever has never seen the type can read its values, and implements
/// [`Payload`]. A rule of its own ([`Describe::check`]) is asked at every decode, so that nothing behind it has to:
///
/// ```
/// use elk_bus::{Payload, payload};
///
/// /// How fast the robot is.
/// #[payload]
/// #[derive(Debug, Clone, PartialEq)]
/// pub struct Speed {
///     /// Ahead.
///     #[describe(unit = "m/s", range = -50.0..=50.0)]
///     pub ahead: f64,
/// }
/// assert_eq!(Speed::NAME, "Speed");
/// ```
///
/// What borrows from a message in shared memory has one lifetime.
pub use elk_describe::payload;
pub use elk_describe::{Describe, Description, Invalid};
/// What apps draw ([`Comms::draw`]), and the keys that they take ([`Comms::take_keys`]).
pub use elk_drawing as drawing;
/// MOOS' own TCP clients.
pub use elk_moos as moos;
pub use elk_os::child;
pub use elk_os::clock::{self, Clock};
pub use elk_os::limits::let_owner_in;
pub use elk_os::stop::{self, asked_to_stop, stop_on_signals, stop_signals};
pub use elk_os::{Overheard, Owner, ProcessId, ProcessStat, own_user, tell};
pub use elk_proto::broker::{self, BrokerConfig, Introduction};
pub use elk_proto::codec::{self, DecodeError};
pub use elk_proto::community::{self, Community};
pub use elk_proto::key::{self, Key, Payload};
pub use elk_proto::mail::{self, Mail};
use elk_proto::outbox;
pub use elk_proto::rejection::Rejection;
pub use elk_proto::types::{self, Type, TypeRef};
pub use elk_proto::value::{self, Value, ValueRef};
pub use elk_proto::{ClockSetting, link, pattern, wire};
pub use elk_shm::{self as shm, ConnectError, Fault, FolderError, Running, ServeError, remedy, running};
pub use failure::{AppError, Failure};
pub use handlers::{Handled, Handlers};
pub use inbox::{Inbox, Refused};
pub use launched::{LEASE, OptionError, RunOptions, SUCCEED};
pub use request::{Asker, Question, Request};
/// What [`payload`] derives.
pub use serde;
pub use subscription::{Subscribe, Subscription, any, number, text};

impl Client {
    /// Joins a community of this machine over shared memory.
    pub fn connect(community: &Community, name: &str) -> Result<Self, ConnectError> {
        Self::join(&RunOptions::new(name, community.clone()))
    }

    /// Joins a community of this machine over shared memory, with all that an app can ask for.
    pub fn join(options: &RunOptions) -> Result<Self, ConnectError> {
        let RunOptions { name, community, build, lease, succeeds, .. } = options;
        let lease_secs = lease.as_secs_f64();
        let who = Introduction { build, lease_secs, succeeds: *succeeds, ..Introduction::new(name) };
        Ok(Self::over(shm::connect(community, &who)?, name, community))
    }
}

/// Runs an app as this process, over shared memory, until it stops itself, fails, its successor is ready, or one of
/// [`stop_signals`] comes; if it is in the midst of a message then, it has [`stop::STOP_PATIENCE`] to come to its end. What a
/// launcher has told this process is in the options of [`RunOptions::from_launcher`] and [`RunOptions::as_launched`]; here
/// nobody looks for it.
pub fn run_app(mut app: Box<dyn App>, options: &RunOptions) -> Result<(), RunError> {
    let insistence = stop::Insistence::begin().map_err(RunError::Signals)?;
    let stop = stop_on_signals().map_err(RunError::Signals)?;
    let mut client = Client::join(options)?;
    app::run(&mut *app, &mut client, &stop, Some(insistence))
}

/// Serves a community as this process until one of [`stop_signals`] comes.
pub fn serve_broker(community: Community, config: BrokerConfig, clock: Clock) -> Result<(), ServeError> {
    serve_broker_at(community, config, clock, None)
}

/// Serves a community as this process until one of [`stop_signals`] comes, also to clients of MOOS' where `moos` listens.
pub fn serve_broker_at(
    community: Community,
    config: BrokerConfig,
    clock: Clock,
    moos: Option<moos::gateway::Listening>,
) -> Result<(), ServeError> {
    let io = |source| ServeError::Io { community: community.clone(), source };
    let stop = stop_on_signals().map_err(io)?;
    shm::Server::start(community.clone(), config, clock, moos)?.run(&stop);
    Ok(())
}

/// Serves a community until `stop` is set.
pub fn serve_broker_until(
    community: Community,
    config: BrokerConfig,
    clock: Clock,
    stop: &AtomicBool,
) -> Result<(), ServeError> {
    shm::Server::start(community, config, clock, None)?.run(stop);
    Ok(())
}
