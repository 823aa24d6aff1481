//! What of the community can be read from beside it: for transports whose clients ask in words of their own.

use std::collections::{BTreeMap, BTreeSet};

use super::state::Broker;
use super::state::expected::Expected;
use crate::pattern;
use crate::wire::{self, Frame, ValueKind};

/// A variable of the community.
#[derive(Debug, Clone)]
pub struct Surveyed<'a> {
    /// Its name.
    pub key: &'a str,
    /// Its latest value, if it has one; its numbers are the broker's.
    pub latest: Option<Frame<'a>>,
    /// Who wrote that.
    pub source: &'a str,
    /// In which community that was.
    pub community: &'a str,
    /// When that was, since the broker's start (s).
    pub written_secs: f64,
    /// How often it is written (Hz).
    pub rate_hz: f64,
}

/// What a variable carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Carried<'a> {
    /// Numbers or texts.
    Plain,
    /// Values of a type.
    Typed {
        /// The type's name.
        name: &'a str,
        /// The hash of all that decides what its bytes mean.
        layout: u64,
        /// What its bytes are, as it travels; empty: nobody has said.
        description: &'a str,
    },
}

impl Broker {
    /// All variables, in the order in which they were first named; then those that nobody has named but who waits for them.
    pub fn survey(&self) -> impl Iterator<Item = Surveyed<'_>> {
        let named = (0..).zip(self.variables.iter()).map(|(key, variable)| {
            let latest = wire::first_frame(&variable.latest).ok();
            Surveyed {
                key: self.names.keys.name(key),
                source: latest.as_ref().map_or("", |frame| self.names.sources.name(frame.header.source)),
                community: latest.as_ref().map_or("", |frame| self.names.communities.name(frame.header.community)),
                latest,
                written_secs: variable.last_write - self.time.started,
                rate_hz: variable.rate_hz,
            }
        });
        let nothing = |key| Surveyed { key, latest: None, source: "", community: "", written_secs: -1.0, rate_hz: 0.0 };
        named.chain(self.awaited().into_iter().map(nothing))
    }

    /// The names that clients who are there have registered for, and under which nothing was ever said, in their order.
    fn awaited(&self) -> BTreeSet<&str> {
        let registrations = self.sessions.present().flat_map(|(_, client)| &client.registrations);
        let keys = registrations.map(|registration| registration.key_pattern.as_str());
        keys.filter(|key| pattern::is_literal(key) && self.names.keys.known(key).is_none()).collect()
    }

    fn is_unwritten(&self, key: &str) -> bool {
        self.names.keys.known(key).is_none_or(|key| self.variables[key].routes.is_empty())
    }

    /// What a variable carries; `None`: it carries nothing yet.
    pub fn carried(&self, key: &str) -> Option<Carried<'_>> {
        let lock = self.variables[self.names.keys.known(key)?].lock?;
        Some(if lock.kind == ValueKind::Binary { self.typed(lock.type_) } else { Carried::Plain })
    }

    /// What those read in a variable who have registered for it by its name; `None`: nobody has said.
    pub fn read_as<'a>(&'a self, key: &'a str) -> Option<Carried<'a>> {
        self.expectations(key).find_map(|(_, expected)| match expected {
            Expected::Numbers | Expected::Texts => Some(Carried::Plain),
            Expected::Values(name, layout) => self.names.types.known(name, *layout).map(|type_| self.typed(type_)),
        })
    }

    fn typed(&self, type_: u32) -> Carried<'_> {
        let (name, layout, description) = self.names.types.said(type_);
        Carried::Typed { name, layout, description }
    }

    /// Of each client that is there its name, and the variables that it reads and writes.
    pub fn reads_and_writes(&self) -> impl Iterator<Item = (&str, Vec<&str>, Vec<&str>)> {
        let indices: BTreeMap<_, _> = self.sessions.present().map(|(id, _)| id).zip(0..).collect();
        let mut read = vec![Vec::new(); indices.len()];
        for (key, variable) in (0..).zip(self.variables.iter()) {
            let readers: BTreeSet<_> = variable.routes.iter().flat_map(|r| &r.deliveries).map(|d| d.client).collect();
            for index in readers.iter().filter_map(|reader| indices.get(reader)) {
                read[*index as usize].push(self.names.keys.name(key));
            }
        }
        self.sessions.present().zip(read).map(|((_, client), mut read)| {
            let keys = client.registrations.iter().map(|registration| registration.key_pattern.as_str());
            read.extend(keys.filter(|key| pattern::is_literal(key) && self.is_unwritten(key)));
            let written = client.published.iter().map(|key| self.names.keys.name(*key));
            (client.name.as_str(), read, written.collect())
        })
    }
}
