//! A client's message on its way in: taken, or refused with a reason.

use super::state::Broker;
use super::state::client::{UNDEFINED, UNNAMED, Unnumbered};
use super::state::message::Message;
use super::state::names::OWN_PREFIX;
use super::state::variable::TypeLock;
use super::table;
use crate::wire::{self, BULK, BulkRef, ClientId, Frame, FrameKind, Header, MAX_FRAME};

/// Whether a reference can be to one of the bulk values of client `from`: only those are its to give to readers, who let
/// go of all values before the one that they are referred to, and see that there is room to map it.
fn refers_to_own(from: ClientId, value: &[u8]) -> bool {
    BulkRef::from_bytes(value).is_some_and(|it| it.client == from && it.len <= MAX_FRAME as u64)
}

impl Broker {
    /// Takes in a message, in the numbers of its client.
    pub(super) fn notify(&mut self, now: f64, from: ClientId, frame: &Frame<'_>) -> Result<(), &'static str> {
        let client = self.sessions.clients.get_mut(&from).ok_or("the client is not connected")?;
        let header = match client.renumber(&frame.header, &self.names) {
            Ok(header) => header,
            Err(Unnumbered::Refused) => return Ok(()), // the client was told when it named it
            Err(Unnumbered::Undefined) => return Err(UNDEFINED),
        };
        let Header { key, source, .. } = header;
        let build = client.build_number;
        if client.is_joining() {
            return self.hold(from, header.key, frame);
        }
        let variable = &mut self.variables[key];
        if variable.is_own && self.names.keys.name(key) == table::REQUEST {
            self.answer_with_table(now, from);
            return Ok(());
        }
        if source == UNNAMED {
            self.name_source(from)?;
            return self.notify(now, from, frame);
        }
        // A driven clock, which may have been set meanwhile, tells nothing of how long a message took; nor does a time that
        // the client may have from somebody else.
        let is_measured = !self.time.is_driven() && !client.is_inside;
        client.latency.note(is_measured.then_some(now - header.time));
        let (was, is) = (variable.lock, TypeLock::of(&header));
        let is_as_last_time = client.last_published == Some(key);
        if let Some(reason) = self.refusal(from, &header, frame) {
            let name = self.names.keys.name(key).to_owned();
            self.tell_readers_of_refused(from, key, is);
            return self.refuse(from, &name, header.sequence, &reason);
        }
        if !is_as_last_time {
            self.note_writer(from, key, source);
        }
        self.store_and_deliver(now, Some(from), &Message::new(header, frame));
        let variable = &mut self.variables[key];
        if variable.latest_from == Some(from) {
            variable.latest_build = build;
        }
        if was != Some(is) {
            self.tell_those_who_expect_else(key, from);
        }
        Ok(())
    }

    /// Takes note that a client inside gave a sign of life at `sent_at` (s, by its own clock): how long that took is the
    /// client's latency. Its messages' times tell nothing of it: they may be those of a log that is played.
    pub fn note_sign_of_life(&mut self, now: f64, from: ClientId, sent_at: f64) {
        if let Some(client) = self.sessions.clients.get_mut(&from).filter(|_| !self.time.is_driven()) {
            client.latency.measure(now - sent_at);
        }
    }

    fn note_writer(&mut self, from: ClientId, key: u32, source: u32) {
        if let Some(client) = self.sessions.clients.get_mut(&from) {
            client.last_published = Some(key);
            if client.published.insert(key) {
                self.variables[key].writers.insert(source);
            }
        }
    }

    /// Why a client's message is not taken, if so.
    fn refusal(&self, from: ClientId, header: &Header, frame: &Frame<'_>) -> Option<String> {
        let (variable, bytes) = (&self.variables[header.key], frame.encoded_len());
        if variable.is_own {
            return Some(format!("{OWN_PREFIX}* are written by the broker alone"));
        }
        if bytes > self.config.limits.message_bytes {
            return Some(format!(
                "a message of {bytes} bytes; at most {} travel in a batch",
                self.config.limits.message_bytes
            ));
        }
        if header.flags & BULK != 0 && !refers_to_own(from, frame.value) {
            return Some("it refers to a value that cannot be one of its publisher's".into());
        }
        let is_known = || variable.routes.iter().any(|route| route.source == header.source);
        if self.is_full_of_routes() && !is_known() {
            let (routes, readers) = (self.variables.routes, self.variables.deliveries);
            return Some(format!(
                "the community has {routes} pairs of variable and source already, with {readers} readers all together"
            ));
        }
        let lock = TypeLock::of(header);
        match variable.lock {
            None => self.contradicts_readers(header.key, lock),
            Some(_) => self.type_conflict(from, header.key, lock).filter(|_| !self.changes_over(header.key, lock)),
        }
        .or_else(|| self.latest_refusal(variable.latest.len(), bytes))
    }

    fn type_conflict(&self, from: ClientId, key: u32, lock: TypeLock) -> Option<String> {
        let is_another = |locked: &TypeLock| *locked != lock && !self.names.are_versions(*locked, lock);
        let locked = self.variables[key].lock.filter(is_another)?;
        if self.gives_way(key, locked, lock) {
            return None;
        }
        let (was, is) = (self.names.describe(locked), self.names.describe(lock));
        let how = self.how_they_differ(key, locked, from, lock).unwrap_or_default();
        Some(format!("{} carries {was} since its first write; {is} was refused{how}", self.names.keys.name(key)))
    }

    /// Tells a client what of its own was not taken, and why.
    pub(super) fn refuse(&mut self, to: ClientId, name: &str, sequence: u64, reason: &str) -> Result<(), &'static str> {
        if self.is_full_of_refusals(to) {
            return Ok(());
        }
        // A name that is too long is refused under its beginning.
        let name = &name[..name.floor_char_boundary(wire::MAX_NAME)];
        let client = self.sessions.clients.get_mut(&to).ok_or("the client is not connected")?;
        let header = Header { sequence, ..Header::new(FrameKind::Refused) };
        wire::put(client.mailbox.notices(), &header, name.as_bytes(), reason.as_bytes());
        Ok(())
    }
}
