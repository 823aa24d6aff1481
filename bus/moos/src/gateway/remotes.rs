//! The clients of MOOS', as the broker's host has to know them beside its others.

use std::collections::BTreeMap;

use elk_proto::host::{Endpoints, Progress};
use elk_proto::wire::ClientId;

/// Endpoints with those of MOOS' clients among them.
pub trait WithRemotes: Endpoints {
    /// Those of MOOS' clients.
    fn remotes(&mut self) -> &mut Remotes;
}

/// How far MOOS' clients are with their mail, and who of them is to leave.
#[derive(Debug, Default)]
pub struct Remotes {
    progress: BTreeMap<ClientId, Progress>,
    retiring: Vec<ClientId>,
}

impl Remotes {
    /// How far a client is; `None`: it is none of MOOS'.
    pub fn progress(&self, id: ClientId) -> Option<Progress> {
        self.progress.get(&id).copied()
    }

    /// Asks a client to leave, if it is one of MOOS'.
    pub fn retire(&mut self, id: ClientId) {
        if self.progress.contains_key(&id) {
            self.retiring.push(id);
        }
    }

    pub(super) fn enter(&mut self, id: ClientId) {
        self.progress.insert(id, Progress::default());
    }

    pub(super) fn leave(&mut self, id: ClientId) -> Progress {
        self.progress.remove(&id).unwrap_or_default()
    }

    pub(super) fn take_retiring(&mut self) -> Vec<ClientId> {
        std::mem::take(&mut self.retiring)
    }

    /// At `at` (ns, monotonic) a client has been given so many messages, all of them.
    pub(super) fn note_handled(&mut self, id: ClientId, handled: u64, at: u64) {
        if let Some(progress) = self.progress.get_mut(&id).filter(|progress| progress.handled < handled) {
            let first_handled_at = if progress.first_handled_at == 0 { at } else { progress.first_handled_at };
            *progress = Progress { handled, first_handled_at, last_handled_at: at };
        }
    }
}
