//! Where the bus and the clients meet: the channels, who wants which, and the latest message of those that somebody wants.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::body::Bytes;
use elk_bus::broker::table::{CommunityTable, VariableEntry, VariableKind};
use elk_bus::{Type, TypeRef, ValueRef};
use elk_log::RecordRef;
use elk_log::shown::{self, Announcement, nanoseconds};
use serde_json::Value;

use super::graph::Graph;
use super::outbox::Outbox;
use super::protocol::{self, Level, Parameter, Subscription};
use super::services;

/// Variables that have a channel.
const MOST_CHANNELS: usize = 4_096;
/// Channels in one message.
const CHANNELS_A_MESSAGE: usize = 100;
/// Names of parameters that one client watches.
const MOST_WATCHED: usize = 4_096;
/// The status that tells of the community's end.
const COMMUNITY: &str = "community";
/// The status that tells of variables without a channel.
const LEFT_OUT: &str = "left-out";
/// Who does what services do, in the graph.
const PROVIDER: &str = "launcher";

/// See the module.
#[derive(Default)]
pub(super) struct Hub {
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// By the variable's name.
    channels: BTreeMap<String, Channel>,
    /// The last number that a channel was given.
    last_id: u64,
    clients: BTreeMap<u64, Client>,
    graph: Arc<Graph>,
    parameters: Vec<Parameter>,
    /// Why there is no community; `None`: there is one.
    gone: Option<String>,
    left_out: u64,
    /// Somebody has begun to look at voxels: what changes in a map says little without the map.
    map_is_wanted: bool,
}

struct Client {
    outbox: Arc<Outbox>,
    parameters: BTreeSet<String>,
}

struct Channel {
    id: u64,
    kind: VariableKind,
    schema_name: String,
    advertised: Value,
    shows_voxels: bool,
    /// When it was received (ns), and the message.
    latest: Option<(u64, Bytes)>,
    /// The clients that want it, and what each calls its subscription.
    readers: BTreeMap<u64, u32>,
}

impl Hub {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A client has come, and is told of all there is.
    pub fn join(&self, number: u64, outbox: &Arc<Outbox>) {
        let mut state = self.state();
        state.clients.insert(number, Client { outbox: outbox.clone(), parameters: BTreeSet::new() });
        let all: Vec<&Value> = state.channels.values().map(|channel| &channel.advertised).collect();
        all.chunks(CHANNELS_A_MESSAGE).for_each(|some| outbox.say(protocol::advertise(some.iter().copied())));
        if let Some(why) = &state.gone {
            outbox.say(protocol::status(Level::Warning, why, Some(COMMUNITY)));
        }
    }

    /// A client has gone.
    pub fn leave(&self, number: u64) {
        let mut state = self.state();
        state.clients.remove(&number);
        state.channels.values_mut().for_each(|channel| {
            channel.readers.remove(&number);
        });
    }

    /// Whether there is any client.
    pub fn is_watched(&self) -> bool {
        !self.state().clients.is_empty()
    }

    /// A client wants the messages of a channel, and is given the latest one at once.
    ///
    /// # Errors
    /// It cannot have them; in words why.
    pub fn subscribe(&self, number: u64, wanted: Subscription) -> Result<(), String> {
        let state = &mut *self.state();
        let Subscription { id, channel_id } = wanted;
        let is_taken = state.channels.values().any(|channel| channel.readers.get(&number) == Some(&id));
        let found = state.channels.iter_mut().find(|(_, channel)| channel.id == channel_id);
        let (key, channel) = found.ok_or_else(|| format!("there is no channel {channel_id}"))?;
        if is_taken {
            return Err(format!("the subscription {id} is there already"));
        }
        if channel.readers.contains_key(&number) {
            return Err(format!("{key} is subscribed to already"));
        }
        channel.readers.insert(number, id);
        state.map_is_wanted |= channel.shows_voxels;
        if let (Some((received, payload)), Some(client)) = (&channel.latest, state.clients.get(&number)) {
            client.outbox.publish(id, *received, payload.clone());
        }
        Ok(())
    }

    /// A client wants them no longer.
    pub fn unsubscribe(&self, number: u64, id: u32) {
        let state = &mut *self.state();
        for channel in state.channels.values_mut().filter(|channel| channel.readers.get(&number) == Some(&id)) {
            channel.readers.remove(&number);
        }
        if let Some(client) = state.clients.get(&number) {
            client.outbox.forget(id);
        }
    }

    /// Variables that somebody wants.
    pub fn wanted(&self) -> BTreeSet<String> {
        let state = self.state();
        let wanted = state.channels.iter().filter(|(_, channel)| !channel.readers.is_empty());
        wanted.map(|(key, _)| key.clone()).collect()
    }

    /// Whether the map is to be asked for, once.
    pub fn take_map_is_wanted(&self) -> bool {
        std::mem::take(&mut self.state().map_is_wanted)
    }

    /// Nothing is heard of a variable any more, so its latest message is old.
    pub fn unheard(&self, key: &str) {
        if let Some(channel) = self.state().channels.get_mut(key) {
            channel.latest = None;
        }
    }

    /// A message of the bus, for those who want it.
    pub fn hear(&self, record: &RecordRef<'_>) {
        {
            let state = &mut *self.state();
            let Some(channel) = state.channels.get(record.key).filter(|channel| !channel.readers.is_empty()) else {
                return;
            };
            // A value that is too long to be shown with its fields lies otherwise, and whoever reads it has to know.
            if channel.schema_name != Announcement::schema_name(&record.value) {
                let (kind, shows_voxels) = (channel.kind.clone(), channel.shows_voxels);
                state.retract(record.key);
                state.announce(record.key, kind, &record.value, shows_voxels);
                state.say_to_all(&state.advertisement(record.key));
            }
        }
        // This takes its time, and is not to hold up clients.
        let mut message = Vec::new();
        if shown::encode(record, &mut message).is_err() {
            return; // An auxiliary name of gigabytes: the logger tells of it.
        }
        let (received, payload) = (nanoseconds(record.received), Bytes::from(message));
        let state = &mut *self.state();
        let Some(channel) = state.channels.get_mut(record.key) else { return };
        for (number, subscription) in &channel.readers {
            if let Some(client) = state.clients.get(number) {
                client.outbox.publish(*subscription, received, payload.clone());
            }
        }
        channel.latest = Some((received, payload));
    }

    /// Who is in the community, and which variables there are.
    pub fn table(&self, table: &CommunityTable) {
        let state = &mut *self.state();
        let mut variables: Vec<&VariableEntry> = table.variables.iter().collect();
        variables.truncate(MOST_CHANNELS);
        let there: BTreeMap<&str, &VariableKind> =
            variables.iter().map(|variable| (variable.name.as_str(), &variable.kind)).collect();
        let gone = state.channels.iter().filter(|(key, channel)| there.get(key.as_str()) != Some(&&channel.kind));
        let gone: Vec<String> = gone.map(|(key, _)| key.clone()).collect();
        gone.iter().for_each(|key| state.retract(key));
        let new: Vec<&VariableEntry> =
            variables.into_iter().filter(|variable| !state.channels.contains_key(&variable.name)).collect();
        for variable in &new {
            let type_ = type_of(table, &variable.kind);
            let value = any_value(&variable.kind, type_.as_ref().map(Type::as_ref));
            let shows_voxels = type_.as_ref().is_some_and(|type_| type_.as_ref().drawn() == "voxels");
            state.announce(&variable.name, variable.kind.clone(), &value, shows_voxels);
        }
        for some in new.chunks(CHANNELS_A_MESSAGE) {
            let some = some.iter().filter_map(|variable| state.channels.get(&variable.name));
            state.say_to_all(&protocol::advertise(some.map(|channel| &channel.advertised)));
        }
        let graph = Graph::of(table, services::names(), PROVIDER);
        if graph != *state.graph {
            state.graph = Arc::new(graph);
            state.clients.values().for_each(|client| client.outbox.graph(&state.graph));
        }
        let left_out = table.left_out + table.variables.len().saturating_sub(MOST_CHANNELS) as u64;
        if std::mem::replace(&mut state.left_out, left_out) != left_out {
            let words = format!("{left_out} variables have no channel: a view has {MOST_CHANNELS} at most");
            state.say_to_all(&protocol::status(Level::Warning, &words, Some(LEFT_OUT)));
        }
    }

    /// The community's time (s).
    pub fn time(&self, time: f64) {
        self.state().clients.values().for_each(|client| client.outbox.time(nanoseconds(time)));
    }

    /// The community is there.
    pub fn joined(&self) {
        let state = &mut *self.state();
        if state.gone.take().is_some() {
            state.say_to_all(&protocol::remove_status(COMMUNITY));
        }
        // What is known is of the community before this one.
        let all: Vec<String> = state.channels.keys().cloned().collect();
        all.iter().for_each(|key| state.retract(key));
    }

    /// The community is not there, and why.
    pub fn left(&self, why: &str) {
        let state = &mut *self.state();
        if state.gone.as_deref() != Some(why) {
            state.gone = Some(why.to_owned());
            state.say_to_all(&protocol::status(Level::Warning, why, Some(COMMUNITY)));
        }
    }

    /// A client wants to know who writes and reads what, or does not any longer.
    pub fn wants_graph(&self, number: u64, wants: bool) {
        let state = self.state();
        if let Some(client) = state.clients.get(&number) {
            client.outbox.wants_graph(wants.then(|| state.graph.clone()));
        }
    }

    /// A client wants to be told when these parameters change.
    ///
    /// # Errors
    /// These are too many; in words.
    pub fn watch_parameters(&self, number: u64, names: Vec<String>) -> Result<(), String> {
        let state = &mut *self.state();
        let Some(client) = state.clients.get_mut(&number) else { return Ok(()) };
        if client.parameters.len() + names.len() > MOST_WATCHED {
            return Err(format!("a client watches at most {MOST_WATCHED} parameters"));
        }
        client.parameters.extend(names);
        Ok(())
    }

    /// A client wants that no longer.
    pub fn unwatch_parameters(&self, number: u64, names: &[String]) {
        if let Some(client) = self.state().clients.get_mut(&number) {
            client.parameters.retain(|name| !names.contains(name));
        }
    }

    /// Whether anybody watches parameters.
    pub fn watches_parameters(&self) -> bool {
        self.state().clients.values().any(|client| !client.parameters.is_empty())
    }

    /// The mission's parameters; who watches them is told which have changed.
    pub fn parameters(&self, parameters: Vec<Parameter>) {
        let state = &mut *self.state();
        let changed: Vec<&Parameter> = parameters.iter().filter(|one| !state.parameters.contains(one)).collect();
        for client in state.clients.values() {
            let mut told = changed.iter().copied().filter(|one| client.parameters.contains(&one.name)).peekable();
            if told.peek().is_some() {
                client.outbox.say(protocol::parameter_values(told, None));
            }
        }
        state.parameters = parameters;
    }
}

impl State {
    fn say_to_all(&self, message: &axum::extract::ws::Message) {
        self.clients.values().for_each(|client| client.outbox.say(message.clone()));
    }

    /// A new channel, in which such values lie.
    fn announce(&mut self, key: &str, kind: VariableKind, value: &ValueRef<'_>, shows_voxels: bool) {
        self.last_id += 1;
        let said = Announcement::of(value);
        let advertised = protocol::channel(self.last_id, key, &said);
        let (id, readers) = (self.last_id, BTreeMap::new());
        let channel =
            Channel { id, kind, schema_name: said.schema_name, advertised, shows_voxels, latest: None, readers };
        self.channels.insert(key.to_owned(), channel);
    }

    fn advertisement(&self, key: &str) -> axum::extract::ws::Message {
        protocol::advertise(self.channels.get(key).iter().map(|channel| &channel.advertised))
    }

    /// The channel of a variable is no more, nor are its subscriptions.
    fn retract(&mut self, key: &str) {
        let Some(channel) = self.channels.remove(key) else { return };
        for (number, subscription) in &channel.readers {
            if let Some(client) = self.clients.get(number) {
                client.outbox.forget(*subscription);
            }
        }
        self.say_to_all(&protocol::unadvertise(&[channel.id]));
    }
}

fn type_of(table: &CommunityTable, kind: &VariableKind) -> Option<Type> {
    match kind {
        VariableKind::Number | VariableKind::Text => None,
        VariableKind::Typed { name, layout } => Some(table.type_of(name, *layout)),
    }
}

/// Some value of a kind: all short ones lie in the same channel.
fn any_value<'a>(kind: &VariableKind, type_: Option<TypeRef<'a>>) -> ValueRef<'a> {
    match (kind, type_) {
        (VariableKind::Number, _) => ValueRef::Double(0.0),
        (VariableKind::Text, _) | (VariableKind::Typed { .. }, None) => ValueRef::Text(""),
        (VariableKind::Typed { .. }, Some(type_)) => ValueRef::Binary { type_, bytes: &[] },
    }
}
