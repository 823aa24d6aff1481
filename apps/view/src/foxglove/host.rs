//! What all clients have in common.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize};

use serde_json::Value;

use super::hub::Hub;
use super::protocol::Parameter;
use crate::steering::Steering;

/// Whoever does what clients say, and knows the mission.
pub trait Mission: Steering {
    /// The parameters of its apps as they are now, named `App.Param`; none: nobody launches the community.
    fn parameters(&self) -> Vec<Parameter>;
}

/// How to serve Foxglove's clients.
#[derive(Debug, Clone)]
pub struct FoxgloveOptions {
    /// Where to listen. Whoever is let in from other machines needs a token.
    pub address: SocketAddr,
    /// Pages of these sites may come besides those of this machine: `https://app.foxglove.dev`.
    pub origins: Vec<String>,
    /// Whether clients only look.
    pub read_only: bool,
}

/// What all clients have in common.
pub(super) struct Host {
    pub hub: Hub,
    pub mission: Option<Arc<dyn Mission>>,
    /// What a client is told first.
    pub info: Value,
    pub options: FoxgloveOptions,
    /// What a client has to know; `None`: it has to come from this machine, under one of its own names.
    pub token: Option<String>,
    /// How many clients are there.
    pub clients: AtomicUsize,
    /// The number of the next client.
    pub numbers: AtomicU64,
}

impl Host {
    /// Whether clients are let do anything.
    pub fn may_steer(&self) -> bool {
        !self.options.read_only && self.mission.is_some()
    }

    /// The mission's parameters as they are now.
    pub fn parameters(&self) -> Vec<Parameter> {
        self.mission.as_ref().map(|mission| mission.parameters()).unwrap_or_default()
    }
}
