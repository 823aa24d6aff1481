//! A client's registrations change: what it is given from then on, and at once.

use super::state::Broker;
use super::state::message::Message;
use super::state::registration::{Change, Messages, Registration, bytes_of, combine};
use super::state::variable::Route;
use crate::pattern;
use crate::wire::{self, ClientId, Frame, LATEST, RESENT};

/// Latest values for which there is not room this many times over are given as the client reads on, and not put into its
/// mailbox: mail that comes meanwhile would drive them out.
const MANY: usize = 4;

impl Broker {
    /// Adds, replaces or takes back a registration. A client that is joining has to wait for it.
    pub(super) fn change_registration(
        &mut self,
        now: f64,
        from: ClientId,
        frame: &Frame<'_>,
    ) -> Result<(), &'static str> {
        let change = Change::read(frame, self.expected(from, frame)?)?;
        if let Some(reason) = self.registration_refusal(frame) {
            let (Change::Add(asked) | Change::Remove(asked)) = &change;
            return self.refuse(from, &asked.key_pattern, 0, &reason);
        }
        let client = self.sessions.clients.get_mut(&from).ok_or("the client is not connected")?;
        match client.is_joining() {
            true => client.asked.extend_from_slice(frame.bytes),
            false => self.change(now, from, change, &Messages::new()),
        }
        Ok(())
    }

    /// Carries a change out; a latest value that is among the `waiting` messages is not given, it is about to come.
    pub(super) fn change(&mut self, now: f64, id: ClientId, change: Change, waiting: &Messages) {
        if let Change::Add(registration) = &change
            && let Some(reason) =
                self.pattern_refusal(id, registration).or_else(|| self.delivery_refusal(id, registration))
        {
            // Whoever has gone meanwhile need not be told.
            let _ = self.refuse(id, &registration.key_pattern, 0, &reason);
            return;
        }
        let Some(client) = self.sessions.clients.get_mut(&id) else { return };
        change.apply(&mut client.registrations);
        client.registered_bytes = client.registrations.iter().map(bytes_of).sum();
        client.registered_patterns = client.registrations.iter().filter(|one| one.is_by_pattern()).count();
        self.actions.keep_sessions = true;
        self.mark_lossless(id);
        match &change {
            Change::Add(registration) => {
                self.take_up_question(now, registration);
                self.note_expectation(id, registration);
                self.carry_out(now, id, registration, waiting);
            }
            Change::Remove(registration) => {
                for key in self.keys_matching(&registration.key_pattern) {
                    self.match_routes(key, id);
                }
            }
        }
        self.answer_anew(now);
    }

    /// Why a registration is one by pattern too many, if so; one that the client has already may be changed.
    fn pattern_refusal(&self, id: ClientId, registration: &Registration) -> Option<String> {
        let most = self.config.limits.patterns;
        let is_full = registration.is_by_pattern() && self.sessions.patterns() >= most;
        let has = |one: &Registration| one.same_patterns(registration);
        let is_new = || self.sessions.clients.get(&id).is_none_or(|client| !client.registrations.iter().any(has));
        (is_full && is_new()).then(|| format!("the community has {most} registrations by pattern already"))
    }

    /// Why a registration asks for too much, if so.
    fn delivery_refusal(&self, id: ClientId, registration: &Registration) -> Option<String> {
        let room = self.config.limits.deliveries.saturating_sub(self.variables.deliveries);
        let asked_for = || {
            let keys = self.keys_matching(&registration.key_pattern).into_iter();
            let is_new = |route: &&Route| route.deliveries.iter().all(|delivery| delivery.client != id);
            keys.map(|key| self.variables[key].routes.iter().filter(is_new).count()).sum::<usize>()
        };
        let has_room = self.variables.routes <= room || asked_for() <= room;
        (!has_room).then(|| {
            format!("the readers of the community get {} variables already, all together", self.variables.deliveries)
        })
    }

    /// Routes what a registration asks for to its client, and gives it the latest values that it did not get before and
    /// that are not among the `waiting` ones, which it is about to get.
    pub(super) fn carry_out(&mut self, now: f64, client: ClientId, registration: &Registration, waiting: &Messages) {
        let keys = self.keys_matching(&registration.key_pattern);
        let bytes: usize = keys.iter().map(|key| self.variables[*key].latest.len()).sum();
        let many = self.sessions.clients.get(&client).is_some_and(|c| !c.mailbox.has_room(MANY * bytes));
        for key in keys {
            let latest = wire::first_frame(&self.variables[key].latest).map(|f| f.header);
            let had = latest.is_ok_and(|h| {
                self.is_delivered(key, h.source, client) || waiting.contains(&(key, h.source, h.sequence))
            });
            let waited = self.variables.end_wait(key, client);
            self.match_routes(key, client);
            // By the interval that it had it would have come: whoever changes that has it now, or might never.
            if let Some(message) = waited.as_deref().and_then(Message::stored) {
                self.deliver(now, client, &message);
                self.note_sent(now, key, client, registration);
            }
            self.give_latest(now, key, client, registration, had, many);
        }
    }

    pub(super) fn mark_lossless(&mut self, id: ClientId) {
        if let Some(client) = self.sessions.clients.get_mut(&id) {
            let lossless = client.registrations.iter().any(|r| r.lossless);
            client.mailbox.set_lossless(lossless);
        }
    }

    fn keys_matching(&self, key_pattern: &str) -> Vec<u32> {
        let all = 0..self.names.keys.len() as u32;
        all.filter(|key| pattern::matches(key_pattern, self.names.keys.name(*key))).collect()
    }

    fn is_delivered(&self, key: u32, source: u32, to: ClientId) -> bool {
        let routes = &self.variables[key].routes;
        routes.iter().any(|r| r.source == source && r.deliveries.iter().any(|d| d.client == to))
    }

    /// Works out anew what `client` gets of each source of `key`.
    fn match_routes(&mut self, key: u32, client: ClientId) {
        let Some(registrations) = self.sessions.clients.get(&client).map(|c| &c.registrations) else {
            return;
        };
        let key_name = self.names.keys.name(key);
        let variable = &mut self.variables[key];
        let (mut had, mut has, mut waits) = (0, 0, false);
        for route in &mut variable.routes {
            had += route.deliveries.extract_if(.., |d| d.client == client).count();
            if let Some(delivery) = combine(client, registrations, key_name, self.names.sources.name(route.source)) {
                let index = route.deliveries.partition_point(|d| d.client < client);
                route.deliveries.insert(index, delivery);
                (has, waits) = (has + 1, waits | (delivery.min_interval > 0.0));
            }
        }
        self.variables.deliveries = self.variables.deliveries - had + has;
        self.sessions.clients.entry(client).and_modify(|client| client.deliveries = client.deliveries - had + has);
        if !waits {
            self.variables.end_wait(key, client);
            self.variables[key].throttles.retain(|t| t.client != client);
        }
    }

    /// Gives a client a variable's latest value, unless it `had` it: at once, or, of `many`, as it reads on.
    fn give_latest(&mut self, now: f64, key: u32, to: ClientId, registration: &Registration, had: bool, many: bool) {
        let variable = &self.variables[key];
        let Some(source) = variable.latest_source() else {
            return;
        };
        if had || !pattern::matches(&registration.source_pattern, self.names.sources.name(source)) {
            return;
        }
        let flags = LATEST | if registration.again { RESENT } else { 0 };
        if many {
            self.variables[key].owed = true;
            self.sessions.clients.entry(to).and_modify(|client| client.mailbox.owe(key, flags));
        } else {
            let frame = variable.latest_message(flags).map(|message| message.to_bytes());
            let Some(message) = frame.as_deref().and_then(Message::stored) else { return };
            self.deliver(now, to, &message);
        }
        self.note_sent(now, key, to, registration);
    }

    /// A client was given a message of a variable: the interval of its registration begins.
    fn note_sent(&mut self, now: f64, key: u32, to: ClientId, registration: &Registration) {
        if registration.min_interval > 0.0 {
            self.variables[key].throttle(to).last_sent = now;
        }
    }
}
