//! A message on its way to all who get it: at once, or as often as they want it.

use super::state::message::Message;
use super::state::names::Definition;
use super::state::{Broker, registration, variable};
use crate::wire::{self, BULK, ClientId, FrameKind, Header, Named, ValueKind};

impl Broker {
    /// Says on `DB_EVENT` what happened.
    pub fn publish_event(&mut self, now: f64, event: &str) {
        self.publish_own(now, "DB_EVENT", ValueKind::Text, event.as_bytes());
    }

    pub(super) fn publish_own(&mut self, now: f64, key: &str, kind: ValueKind, value: &[u8]) {
        let key = self.number(Named::Key, Definition::of(key));
        let sequence = self.own.next();
        let header = Header {
            value_kind: kind,
            key,
            source: self.own.source,
            sequence,
            time: self.time.of_community(now),
            ..Header::new(FrameKind::Notify)
        };
        let mut frame = Vec::new();
        wire::put(&mut frame, &header, &[], value);
        self.variables[key].writers.insert(self.own.source);
        if let Some(message) = Message::stored(&frame) {
            self.store_and_deliver(now, None, &message);
        }
    }

    pub(super) fn store_and_deliver(&mut self, now: f64, from: Option<ClientId>, message: &Message<'_>) {
        let (key, source) = (message.header.key, message.header.source);
        self.settle_owed(now, key);
        self.variables.keep_as_latest(now, from, message);
        let route = self.route(key, source);
        let deliveries = std::mem::take(&mut self.variables[key].routes[route].deliveries);
        for delivery in &deliveries {
            if delivery.lossless
                && let Some(feeder) = from.and_then(|f| self.sessions.clients.get_mut(&f))
            {
                feeder.feeds.insert(delivery.client);
            }
            match delivery.min_interval > 0.0 {
                true => self.deliver_throttled(now, delivery.client, delivery.min_interval, message),
                false => self.deliver(now, delivery.client, message),
            }
        }
        self.variables[key].routes[route].deliveries = deliveries;
    }

    /// The index of (key, source) in the variable's routes; a pair that is new is matched against all registrations.
    fn route(&mut self, key: u32, source: u32) -> usize {
        if let Some(known) = self.variables[key].routes.iter().position(|r| r.source == source) {
            return known;
        }
        let (key_name, source_name) = (self.names.keys.name(key), self.names.sources.name(source));
        let mut deliveries = Vec::new();
        for (id, client) in self.sessions.clients.iter_mut().filter(|(_, c)| !c.is_joining()) {
            let delivery = registration::combine(*id, &client.registrations, key_name, source_name);
            client.deliveries += usize::from(delivery.is_some());
            deliveries.extend(delivery);
        }
        self.variables.deliveries += deliveries.len();
        deliveries.shrink_to_fit();
        self.variables.routes += 1;
        let routes = &mut self.variables[key].routes;
        routes.push(variable::Route { source, deliveries });
        routes.len() - 1
    }

    pub(super) fn deliver(&mut self, now: f64, to: ClientId, message: &Message<'_>) {
        let has_room = self.has_room_for(to, message.len());
        let Some(client) = self.sessions.clients.get_mut(&to) else { return };
        if !has_room {
            client.mailbox.note_dropped();
            return;
        }
        if !self.reached.contains(&to) {
            self.reached.push(to);
        }
        if message.header.flags & BULK != 0 && client.is_disconnected() {
            self.actions.resolve.insert(to);
        }
        client.mailbox.push(now, message, self.config.lossless_patience());
    }

    fn deliver_throttled(&mut self, now: f64, to: ClientId, interval: f64, message: &Message<'_>) {
        if !self.variables.holds(now, to, interval, message, self.config.limits.pending_bytes) {
            self.deliver(now, to, message);
        }
    }

    /// Delivers what throttled registrations held back and whose time has come.
    pub(super) fn deliver_due(&mut self, now: f64) {
        while let Some((client, frame)) = self.variables.take_due(now) {
            Message::stored(&frame).into_iter().for_each(|message| self.deliver(now, client, &message));
        }
    }
}
