//! What the broker holds: parts with methods of their own, none of which knows the broker.

mod actions;
pub mod client;
mod config;
pub mod expected;
mod interner;
pub mod latency;
mod limits;
pub mod mailbox;
pub mod message;
pub mod names;
pub mod reached;
pub mod registration;
pub mod sessions;
mod time;
mod types;
pub mod variable;
pub mod variables;

pub use actions::Action;
use actions::Actions;
pub use config::BrokerConfig;
pub use limits::Limits;
use names::Names;
use sessions::Sessions;
use time::Time;
use variables::Variables;

use std::collections::BTreeMap;

use crate::wire::{self, ClientId};

/// The broker's whole state.
pub struct Broker {
    pub(super) config: BrokerConfig,
    pub(super) sessions: Sessions,
    pub(super) names: Names,
    pub(super) variables: Variables,
    pub(super) time: Time,
    pub(super) own: Own,
    /// Who got mail from the batch that is being taken in.
    pub(super) reached: Vec<ClientId>,
    pub(super) actions: Actions,
    /// Whether anybody listens to variables of some beginning, as it was said last.
    pub(super) answers: BTreeMap<String, bool>,
}

/// The broker as a source of messages.
pub struct Own {
    pub source: u32,
    sequence: u64,
}

impl Own {
    /// The sequence of its next message.
    pub fn next(&mut self) -> u64 {
        self.sequence += 1;
        self.sequence
    }
}

impl Broker {
    /// A broker without clients or variables, started at `now` (s).
    pub fn new(config: BrokerConfig, now: f64) -> Self {
        let mut names = Names::default();
        let source = names.sources.number(&format!("MOOSDB_{}", config.community));
        names.communities.number(&config.community);
        let millis = (now.max(0.0) * 1e3) as u64;
        Self {
            config,
            // Numbers of clients of a broker that died are not to be taken for those of this one.
            sessions: Sessions::new((millis & 0x0fff_ffff) as ClientId + 1),
            names,
            variables: Variables::default(),
            time: Time::new(now),
            // A broker that takes another's place is not to be taken for it.
            own: Own { source, sequence: wire::first_sequence(millis) },
            reached: Vec::new(),
            actions: Actions::default(),
            answers: BTreeMap::new(),
        }
    }
}
