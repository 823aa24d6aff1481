//! What is not taken, because the broker would have to keep more than its [`Limits`] say.

use super::state::names::Definition;
use super::state::{Broker, Limits};
use crate::wire::{ClientId, Frame, FrameKind, Named};

/// Refusals that wait for a client (bytes); further ones are not put down.
const REFUSAL_BYTES: usize = 64 << 10;

impl Broker {
    /// Why a name that is new cannot be taken, if so.
    pub(super) fn name_refusal(&self, from: ClientId, what: Named, definition: Definition<'_>) -> Option<String> {
        let limits = &self.config.limits;
        let (most, kind) = match what {
            Named::Key => (limits.variables, "variables"),
            Named::Source => (limits.other_names, "sources"),
            Named::Type => (limits.other_names, "types"),
            Named::Community => (limits.other_names, "communities"),
        };
        let len = definition.name.len();
        if len > limits.name_bytes {
            Some(format!("a name of {len} bytes; at most {} are allowed", limits.name_bytes))
        } else if self.sessions.clients.get(&from).is_some_and(|client| client.brought >= limits.names_of_a_client) {
            Some(format!("this client has brought {} names already, and no more are allowed", limits.names_of_a_client))
        } else if self.names.count(what) >= most {
            Some(format!("the community has {most} {kind} already, and no more are allowed"))
        } else {
            self.no_room_for(len + definition.description.len()).or_else(|| definition.mistake())
        }
    }

    /// Why the description of a type that is known by its name cannot be taken, if so.
    pub(super) fn description_refusal(&self, definition: Definition<'_>) -> Option<String> {
        self.no_room_for(definition.description.len()).or_else(|| definition.mistake())
    }

    pub(super) fn no_room_for(&self, bytes: usize) -> Option<String> {
        let most = self.config.limits.all_name_bytes;
        let is_full = self.names.bytes() + bytes > most;
        is_full.then(|| format!("the names of the community fill {most} bytes already"))
    }

    /// Why a registration with these patterns cannot be taken, if so.
    pub(super) fn registration_refusal(&self, frame: &Frame<'_>) -> Option<String> {
        let limits = &self.config.limits;
        let longest = frame.aux.len().max(frame.value.len());
        if frame.header.kind != FrameKind::Register {
            None
        } else if longest > limits.name_bytes {
            Some(format!("a pattern of {longest} bytes; at most {} are allowed", limits.name_bytes))
        } else if self.sessions.registration_bytes() + frame.bytes.len() > limits.registration_bytes {
            Some(format!("the registrations of the community fill {} bytes already", limits.registration_bytes))
        } else {
            None
        }
    }

    /// Bytes that a message may add to the latest values in place of one of `old` bytes, or why it may not.
    pub(super) fn latest_refusal(&self, old: usize, new: usize) -> Option<String> {
        let most = self.config.limits.latest_bytes;
        let would_be = self.variables.latest_bytes - old + new;
        (new > old && would_be > most).then(|| format!("the latest values of the community fill {most} bytes already"))
    }

    /// Whether a number that a client gives to a name is one too many; the client is told so once.
    pub(super) fn is_out_of_numbers(
        &mut self,
        id: ClientId,
        what: Named,
        number: u32,
        name: &str,
    ) -> Result<bool, &'static str> {
        let all = self.sessions.numbers;
        let limits = &self.config.limits;
        let client = self.sessions.clients.get_mut(&id).ok_or("the client is not connected")?;
        let is_new = client.numbers[what as usize].len() <= number as usize;
        if !is_new || client.is_out_of_numbers {
            return Ok(is_new);
        }
        client.is_out_of_numbers = client.given_numbers() >= limits.numbers_of_a_client || all >= limits.numbers;
        if client.is_out_of_numbers {
            let reason = "so many names are in use that no more are taken from this client";
            self.refuse(id, name, 0, reason)?;
            return Ok(true);
        }
        Ok(false)
    }

    /// Whether a message of so many bytes may go into a client's mailbox: of those that are larger than the mailboxes that
    /// they go into there are only so many.
    pub(super) fn has_room_for(&self, to: ClientId, bytes: usize) -> bool {
        // That every mailbox holds.
        if bytes <= LEAST_MAILBOX.min(self.config.mailbox_bytes) {
            return true;
        }
        let is_large = self.sessions.clients.get(&to).is_some_and(|client| bytes > client.mailbox.limit());
        let oversize = || self.sessions.clients.values().map(|client| client.mailbox.oversize_bytes()).sum::<usize>();
        !is_large || oversize().saturating_add(bytes) <= self.config.limits.oversize_bytes
    }

    /// Whether no new pair of a variable and a source is taken. There is still room for readers of what there is, such as
    /// an app that was started again.
    pub(super) fn is_full_of_routes(&self) -> bool {
        let Limits { routes, deliveries, .. } = &self.config.limits;
        self.variables.routes >= *routes || self.variables.deliveries >= deliveries / 4 * 3
    }

    /// Whether a client has so many refusals waiting that further ones are not put down.
    pub(super) fn is_full_of_refusals(&self, id: ClientId) -> bool {
        self.sessions.clients.get(&id).is_none_or(|client| client.mailbox.notice_bytes() >= REFUSAL_BYTES)
    }

    /// Gives every mailbox its share.
    pub(super) fn share_out_mail(&mut self) {
        let share = self.config.limits.mail_bytes / self.sessions.clients.len().max(1);
        let limit = share.max(LEAST_MAILBOX).min(self.config.mailbox_bytes);
        self.sessions.clients.values_mut().for_each(|client| client.mailbox.set_limit(limit));
    }
}

/// No mailbox is smaller (bytes), however many clients there are.
const LEAST_MAILBOX: usize = 64 << 10;
