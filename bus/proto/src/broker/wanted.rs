//! Whether anybody listens: so that what is dear to say need not be said to nobody.
//!
//! Whoever registers for `DB_WANTED/` and the beginning of variables' names is told 1 while somebody else is registered for
//! any variable of that beginning, of that client's, and 0 while nobody is; whenever it changes, and at once. A client that
//! is gone and whose session is kept still listens.

use super::state::Broker;
use super::state::registration::Registration;
use crate::pattern;
use crate::wire::{ClientId, ValueKind};

/// What the variables begin with that answer.
pub const WANTED: &str = "DB_WANTED/";

/// Beginnings of names that can be asked for; who asks for more is not told.
const MOST_ASKED: usize = 64;

fn asked(registration: &Registration) -> Option<&str> {
    registration.key_pattern.strip_prefix(WANTED).filter(|beginning| pattern::is_literal(beginning))
}

impl Broker {
    /// A client wants to know whether anybody listens, perhaps: then there is an answer before it is given latest values.
    pub(super) fn take_up_question(&mut self, now: f64, registration: &Registration) {
        let Some(beginning) = asked(registration) else { return };
        if self.answers.len() < MOST_ASKED && !self.answers.contains_key(beginning) {
            self.answer(now, beginning.to_owned());
        }
    }

    /// Registrations have changed: says what is other than it was, and forgets what nobody asks any more.
    pub(super) fn answer_anew(&mut self, now: f64) {
        let is_asked = |beginning: &str| {
            let all = self.sessions.clients.values().flat_map(|client| &client.registrations);
            all.filter_map(asked).any(|other| other == beginning)
        };
        let (kept, dropped): (Vec<String>, Vec<String>) = self.answers.keys().cloned().partition(|one| is_asked(one));
        self.answers.retain(|one, _| !dropped.contains(one));
        for beginning in kept {
            if self.answers.get(&beginning) != Some(&self.is_wanted(&beginning)) {
                self.answer(now, beginning);
            }
        }
    }

    fn answer(&mut self, now: f64, beginning: String) {
        let is = self.is_wanted(&beginning);
        self.publish_own(
            now,
            &format!("{WANTED}{beginning}"),
            ValueKind::Double,
            &f64::from(u8::from(is)).to_le_bytes(),
        );
        self.answers.insert(beginning, is);
    }

    fn is_wanted(&self, beginning: &str) -> bool {
        let all = || self.sessions.clients.iter().filter(|(_, client)| !client.is_joining());
        let asks = |client: &[Registration]| client.iter().filter_map(asked).any(|other| other == beginning);
        let askers: Vec<(ClientId, &str)> = all()
            .filter(|(_, client)| asks(&client.registrations))
            .map(|(id, client)| (*id, client.name.as_str()))
            .collect();
        let names = format!("{beginning}*");
        let listens = |id: ClientId, one: &Registration| {
            let from = |(asker, name): &(ClientId, &str)| *asker != id && pattern::matches(&one.source_pattern, name);
            pattern::meet(&one.key_pattern, &names) && askers.iter().any(from)
        };
        all().any(|(id, client)| client.registrations.iter().any(|one| listens(*id, one)))
    }
}
