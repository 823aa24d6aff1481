//! A message on its way to all who get it: at once, or as often as they want it.

use super::membership::Standing;
use super::message::Message;
use super::{Broker, ClientId};
use super::{registration, variable};
use crate::wire::{self, BULK, FrameKind, Header, Named, ValueKind};

/// A time that can be ordered (s; never NaN here).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Due(f64);

impl Eq for Due {}
impl PartialOrd for Due {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Due {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl Broker {
    /// Says on `DB_EVENT` what happened.
    pub fn publish_event(&mut self, now: f64, event: &str) {
        self.publish_own(now, "DB_EVENT", ValueKind::Text, event.as_bytes());
    }

    pub(super) fn publish_own(&mut self, now: f64, key: &str, kind: ValueKind, value: &[u8]) {
        let key = self.number(Named::Key, key, 0);
        self.own_sequence += 1;
        let header = Header {
            value_kind: kind,
            key,
            source: self.own_source,
            sequence: self.own_sequence,
            time: self.time(now),
            ..Header::new(FrameKind::Notify)
        };
        let mut frame = Vec::new();
        wire::put(&mut frame, &header, &[], value);
        self.variables[key as usize].writers.insert(self.own_source);
        self.store_and_deliver(now, None, &Message::new(header, &frame));
    }

    pub(super) fn store_and_deliver(&mut self, now: f64, from: Option<ClientId>, message: &Message<'_>) {
        let (key, source) = (message.header.key, message.header.source);
        self.settle_owed(now, key);
        self.keep_as_latest(now, from, message);
        let route = self.route(key, source);
        let deliveries = std::mem::take(&mut self.variables[key as usize].routes[route].deliveries);
        for delivery in &deliveries {
            if delivery.lossless
                && let Some(feeder) = from.and_then(|f| self.clients.get_mut(&f))
            {
                feeder.feeds.insert(delivery.client);
            }
            match delivery.min_interval > 0.0 {
                true => self.deliver_throttled(now, delivery.client, delivery.min_interval, message),
                false => self.deliver(now, delivery.client, message),
            }
        }
        self.variables[key as usize].routes[route].deliveries = deliveries;
    }

    /// The place of (key, source) in the variable's routes; a pair that is new is matched against all registrations.
    fn route(&mut self, key: u32, source: u32) -> usize {
        if let Some(known) = self.variables[key as usize].routes.iter().position(|r| r.source == source) {
            return known;
        }
        let (key_name, source_name) = (self.keys.name(key), self.sources.name(source));
        let deliveries = self
            .clients
            .iter()
            .filter(|(_, c)| !c.is_joining())
            .filter_map(|(id, c)| registration::combine(*id, &c.registrations, key_name, source_name))
            .collect();
        let routes = &mut self.variables[key as usize].routes;
        self.routes += 1;
        routes.push(variable::Route { source, deliveries });
        routes.len() - 1
    }

    pub(super) fn deliver(&mut self, now: f64, to: ClientId, message: &Message<'_>) {
        let Some(client) = self.clients.get_mut(&to) else { return };
        if !self.reached.contains(&to) {
            self.reached.push(to);
        }
        if message.header.flags & BULK != 0 && matches!(client.standing, Standing::Disconnected { .. }) {
            self.to_resolve.insert(to);
        }
        client.mailbox.push(now, message, self.config.lossless_patience_secs);
    }

    fn deliver_throttled(&mut self, now: f64, to: ClientId, interval: f64, message: &Message<'_>) {
        let key = message.header.key;
        let throttle = self.variables[key as usize].throttle(to);
        let due = throttle.last_sent + interval;
        if now >= due && throttle.pending.is_none() {
            throttle.last_sent = now;
            self.deliver(now, to, message);
        } else {
            throttle.pending = Some(message.to_bytes());
            self.due.insert((Due(due), key, to));
        }
    }

    /// Delivers what throttled registrations held back and whose time has come.
    pub(super) fn deliver_due(&mut self, now: f64) {
        while let Some(&(due, key, client)) = self.due.first().filter(|(due, ..)| due.0 <= now) {
            self.due.remove(&(due, key, client));
            let throttle = self.variables[key as usize].throttle(client);
            throttle.last_sent = now;
            if let Some(frame) = throttle.pending.take()
                && let Some(message) = Message::stored(&frame)
            {
                self.deliver(now, client, &message);
            }
        }
    }

    /// When the next of these is due (s).
    pub(super) fn next_due(&self) -> f64 {
        self.due.first().map_or(f64::INFINITY, |(due, ..)| due.0)
    }
}
