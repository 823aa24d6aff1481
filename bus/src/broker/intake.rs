//! A client's message on its way in: taken, or refused with a reason.

use super::limits::{REFUSED, UNNAMED};
use super::message::Message;
use super::naming::OWN_PREFIX;
use super::variable::TypeLock;
use super::{Broker, ClientId, table};
use crate::wire::{self, Frame, FrameKind, Header, ValueKind};

impl Broker {
    /// Takes in a message, in the numbers of its client.
    pub(super) fn notify(&mut self, now: f64, from: ClientId, frame: &Frame<'_>) -> Result<(), &'static str> {
        let client = self.clients.get_mut(&from).ok_or("the client is not connected")?;
        let header = client.renumber(&frame.header)?;
        let Header { key, source, .. } = header;
        if [key, source, header.type_, header.community].contains(&REFUSED) {
            return Ok(()); // the client was told when it named it
        }
        if client.is_joining() {
            Self::hold(client, frame);
            return Ok(());
        }
        let variable = &mut self.variables[key as usize];
        if variable.is_own && self.keys.name(key) == table::REQUEST {
            self.answer_with_table(now, from);
            return Ok(());
        }
        if source == UNNAMED {
            self.name_source(from)?;
            return self.notify(now, from, frame);
        }
        // A driven clock, which may have been set meanwhile, tells nothing of how long a message took.
        client.latency.note(self.driver.is_none().then_some(now - header.time));
        if client.last_published.replace(key) != Some(key) && client.published.insert(key) {
            variable.writers.insert(source);
        }
        let is_as_before = variable.lock == Some(TypeLock::of(&header));
        if let Some(reason) = self.refusal(&header, frame.bytes.len()) {
            let name = self.keys.name(key).to_owned();
            return self.refuse(from, &name, header.sequence, &reason);
        }
        self.store_and_deliver(now, Some(from), &Message::new(header, frame.bytes));
        if !is_as_before {
            self.tell_those_who_expect_else(key);
        }
        Ok(())
    }

    /// Why a client's message of so many bytes is not taken, if so.
    fn refusal(&self, header: &Header, bytes: usize) -> Option<String> {
        let variable = &self.variables[header.key as usize];
        if variable.is_own {
            return Some(format!("{OWN_PREFIX}* are written by the broker alone"));
        }
        if bytes > self.config.limits.message_bytes {
            return Some(format!(
                "a message of {bytes} bytes; at most {} travel in a batch",
                self.config.limits.message_bytes
            ));
        }
        let is_known = || variable.routes.iter().any(|route| route.source == header.source);
        if self.routes >= self.config.limits.routes && !is_known() {
            return Some(format!("the community has {} pairs of variable and source already", self.routes));
        }
        let lock = TypeLock::of(header);
        match variable.lock {
            None => self.contradicts_readers(header.key, lock),
            Some(_) => self.type_conflict(header.key, lock).filter(|_| !self.changes_over(header.key, lock)),
        }
        .or_else(|| self.latest_refusal(variable.latest.len(), bytes))
    }

    fn type_conflict(&self, key: u32, lock: TypeLock) -> Option<String> {
        let locked = self.variables[key as usize].lock?;
        (locked != lock).then(|| {
            let (was, is) = (self.describe(locked), self.describe(lock));
            format!("{} carries {was} since its first write; {is} was refused", self.keys.name(key))
        })
    }

    pub(super) fn describe(&self, lock: TypeLock) -> String {
        match lock.kind {
            ValueKind::Double => "numbers".into(),
            ValueKind::Text => "texts".into(),
            ValueKind::Binary => {
                format!("{} (layout {:016x})", self.types.name(lock.type_), self.types.layout(lock.type_))
            }
        }
    }

    /// Tells a client what of its own was not taken, and why.
    pub(super) fn refuse(&mut self, to: ClientId, name: &str, sequence: u64, reason: &str) -> Result<(), &'static str> {
        if self.is_full_of_refusals(to) {
            return Ok(());
        }
        // A name that is too long is refused under its beginning.
        let name = &name[..name.floor_char_boundary(wire::MAX_NAME)];
        let client = self.clients.get_mut(&to).ok_or("the client is not connected")?;
        let header = Header { sequence, ..Header::new(FrameKind::Refused) };
        wire::put(client.mailbox.notices(), &header, name.as_bytes(), reason.as_bytes());
        Ok(())
    }
}
