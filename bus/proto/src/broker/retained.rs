//! Retained values: latest values of clients that are gone, which nobody would say again after the broker's death.

use serde::{Deserialize, Serialize};

use super::state::Broker;
use super::state::message::Message;
use super::state::names::Definition;
use super::state::variable::Variable;
use crate::wire::{self, BULK, BulkRef, ClientId, Header, Named, ValueKind};

/// The latest value of a variable whose publisher is gone, with its names written out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Retained {
    key: String,
    source: String,
    community: String,
    /// Name, layout and description.
    type_: (String, u64, String),
    /// The whole frame, its value in it.
    frame: Vec<u8>,
}

impl Broker {
    /// A client is gone: if it leaves anything, that has to be kept.
    pub(super) fn note_departure(&mut self, id: ClientId) {
        self.actions.keep_retained |= self.variables.iter().any(|variable| variable.latest_from == Some(id));
    }

    /// What clients have left that are gone: what has to outlive the broker (see [`super::Action::KeepRetained`]).
    /// `bulk` finds values that lie in shared memory.
    pub fn retained<'a>(&self, bulk: impl Fn(BulkRef) -> Option<&'a [u8]>) -> Vec<Retained> {
        let left = |v: &&Variable| {
            v.latest_from.is_none_or(|id| !self.sessions.clients.contains_key(&id) || self.sessions.is_disconnected(id))
        };
        self.variables.iter().filter(left).filter_map(|variable| self.retained_of(variable, &bulk)).collect()
    }

    fn retained_of<'a>(&self, variable: &Variable, bulk: &impl Fn(BulkRef) -> Option<&'a [u8]>) -> Option<Retained> {
        let frame = wire::first_frame(&variable.latest).ok()?;
        let header = frame.header;
        if header.source == self.own.source {
            return None; // the next broker has its own
        }
        let mut whole = Vec::new();
        match header.flags & BULK {
            0 => whole.extend_from_slice(frame.bytes),
            _ => {
                let value = bulk(BulkRef::from_bytes(frame.value)?)?;
                wire::put(&mut whole, &Header { flags: header.flags & !BULK, ..header }, frame.aux, value);
            }
        }
        let type_ = match header.value_kind {
            ValueKind::Binary => {
                let (name, layout, description) = self.names.types.said(header.type_);
                (name.to_owned(), layout, description.to_owned())
            }
            _ => Default::default(),
        };
        Some(Retained {
            key: self.names.keys.name(header.key).to_owned(),
            source: self.names.sources.name(header.source).to_owned(),
            community: self.names.communities.name(header.community).to_owned(),
            type_,
            frame: whole,
        })
    }

    /// Begins with what the clients of the broker before this one had left. Damaged ones are left out.
    pub fn inherit(&mut self, now: f64, retained: &[Retained]) {
        for one in retained {
            let Ok(frame) = wire::first_frame(&one.frame) else { continue };
            let header = Header {
                flags: 0,
                key: self.number(Named::Key, Definition::of(&one.key)),
                source: self.number(Named::Source, Definition::of(&one.source)),
                type_: match frame.header.value_kind {
                    ValueKind::Binary => {
                        let (name, layout, description) = &one.type_;
                        self.number(Named::Type, Definition { name, layout: *layout, description })
                    }
                    _ => 0,
                },
                community: self.number(Named::Community, Definition::of(&one.community)),
                ..frame.header
            };
            self.variables.keep_as_latest(now, None, &Message::new(header, &frame));
        }
        self.actions.keep_retained = !retained.is_empty();
    }
}
