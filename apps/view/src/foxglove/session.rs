//! One client: what it says, and who does that. What takes its time is done beside it, and answered when it is done.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{Message, WebSocket};
use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use tokio::sync::mpsc;
use tokio::task::spawn_blocking;
use tokio::time::{interval, timeout};

use super::host::Host;
use super::outbox::Outbox;
use super::protocol::{self, ClientChannel, JSON, Level, Parameter, Said, SaidBinary};
use super::services;
use crate::connections::PING_EVERY;
use crate::words::Order;

/// How long a client may take to take a message, before it is given up.
const SEND_PATIENCE: Duration = Duration::from_secs(30);
/// Channels that a client publishes.
const MOST_ADVERTISED: usize = 256;
/// What a client has said and is done one after another, as far as it waits.
const MOST_JOBS: usize = 64;
/// Calls of a client that are under way at a time.
const MOST_CALLS: usize = 8;

/// What is done one after another.
type Job = Box<dyn FnOnce() + Send>;

/// A client, told apart from the others by its number.
struct Session {
    number: u64,
    host: Arc<Host>,
    outbox: Arc<Outbox>,
    /// What it publishes.
    channels: BTreeMap<u32, ClientChannel>,
    jobs: mpsc::Sender<Job>,
    calls: Arc<AtomicUsize>,
}

/// Serves a client until it goes.
pub(super) async fn serve(number: u64, socket: WebSocket, host: Arc<Host>) {
    let (mut out, mut said) = socket.split();
    let outbox = Arc::new(Outbox::default());
    outbox.say(protocol::text(&host.info));
    if host.may_steer() {
        outbox.say(protocol::text(&services::advertisement()));
    }
    host.hub.join(number, &outbox);
    let (jobs, waiting) = mpsc::channel(MOST_JOBS);
    tokio::spawn(work(waiting));
    let calls = Arc::default();
    let mut session =
        Session { number, host: host.clone(), outbox: outbox.clone(), channels: BTreeMap::new(), jobs, calls };
    let mut pings = interval(PING_EVERY);
    loop {
        let message = tokio::select! {
            heard = said.next() => match heard {
                Some(Ok(message)) => match session.take_message(&message) {
                    true => continue,
                    false => break,
                },
                Some(Err(_)) | None => break,
            },
            message = outbox.next() => match message {
                Ok(message) => message,
                Err(_) => break,
            },
            _ = pings.tick() => Message::Ping(Bytes::new()),
        };
        match timeout(SEND_PATIENCE, out.send(message)).await {
            Ok(Ok(())) => {}
            Ok(Err(_)) | Err(_) => break,
        }
    }
    host.hub.leave(number);
}

/// Does one after another what a client has said, in its order.
async fn work(mut waiting: mpsc::Receiver<Job>) {
    while let Some(job) = waiting.recv().await {
        // One that panicked has said why; the next one is another.
        let _ = spawn_blocking(job).await;
    }
}

impl Session {
    fn complain(&self, why: &str) {
        self.outbox.say(protocol::status(Level::Error, why, None));
    }

    /// Takes what has come; whether the client stays.
    fn take_message(&mut self, message: &Message) -> bool {
        match message {
            Message::Text(text) => self.hear(text),
            Message::Binary(bytes) => self.hear_binary(bytes),
            Message::Ping(_) | Message::Pong(_) => {}
            Message::Close(_) => return false,
        }
        true
    }

    fn hear(&mut self, text: &str) {
        let done = match Said::read(text) {
            Err(why) => Err(format!("not understood: {why}")),
            Ok(said) => self.take(said),
        };
        if let Err(why) = done {
            self.complain(&why);
        }
    }

    fn take(&mut self, said: Said) -> Result<(), String> {
        let (hub, number) = (&self.host.hub, self.number);
        match said {
            Said::Subscribe { subscriptions } => {
                subscriptions.into_iter().try_for_each(|one| hub.subscribe(number, one))
            }
            Said::Unsubscribe { subscription_ids } => {
                subscription_ids.into_iter().for_each(|id| hub.unsubscribe(number, id));
                Ok(())
            }
            Said::Advertise { channels } => channels.into_iter().try_for_each(|channel| self.advertise(channel)),
            Said::Unadvertise { channel_ids } => {
                self.channels.retain(|id, _| !channel_ids.contains(id));
                Ok(())
            }
            Said::GetParameters { parameter_names, id } => {
                self.queue(move |host, outbox| answer_parameters(host, outbox, &parameter_names, id.as_deref()))
            }
            Said::SetParameters { parameters, id } => {
                self.steered()?;
                self.queue(move |host, outbox| set_parameters(host, outbox, &parameters, id.as_deref()))
            }
            Said::SubscribeParameterUpdates { parameter_names } => hub.watch_parameters(number, parameter_names),
            Said::UnsubscribeParameterUpdates { parameter_names } => {
                hub.unwatch_parameters(number, &parameter_names);
                Ok(())
            }
            Said::SubscribeConnectionGraph {} => {
                hub.wants_graph(number, true);
                Ok(())
            }
            Said::UnsubscribeConnectionGraph {} => {
                hub.wants_graph(number, false);
                Ok(())
            }
        }
    }

    fn steered(&self) -> Result<(), String> {
        self.host.may_steer().then_some(()).ok_or_else(|| "this view only looks (--read-only)".to_owned())
    }

    fn advertise(&mut self, channel: ClientChannel) -> Result<(), String> {
        self.steered()?;
        let ClientChannel { id, topic, encoding } = &channel;
        if encoding != JSON {
            return Err(format!("{topic}: elk takes what is published as json, not as {encoding}"));
        }
        if self.channels.len() >= MOST_ADVERTISED && !self.channels.contains_key(id) {
            return Err(format!("{topic}: a client publishes at most {MOST_ADVERTISED} channels"));
        }
        self.channels.insert(*id, channel);
        Ok(())
    }

    fn hear_binary(&mut self, bytes: &[u8]) {
        match SaidBinary::read(bytes) {
            Err(why) => self.complain(&format!("not understood: {why}")),
            Ok(SaidBinary::Publish { channel, payload }) => {
                if let Err(why) = self.publish(channel, payload) {
                    self.complain(&why);
                }
            }
            Ok(SaidBinary::Call { service, call, encoding, payload }) => {
                if let Err(why) = self.call(service, call, encoding, payload) {
                    self.outbox.say(protocol::failure(service, call, &why));
                }
            }
        }
    }

    /// What a client publishes is a poke.
    fn publish(&mut self, channel: u32, payload: &[u8]) -> Result<(), String> {
        let channel = self.channels.get(&channel).ok_or_else(|| format!("no channel {channel} was advertised"))?;
        let (key, value) = (channel.topic.clone(), poked(&channel.topic, payload)?);
        self.steered()?;
        self.queue(move |host, outbox| {
            if let Some(Err(why)) = host.mission.as_ref().map(|mission| mission.poke(&key, &value)) {
                outbox.say(protocol::status(Level::Error, &format!("{key}: {why}"), None));
            }
        })
    }

    fn call(&mut self, service: u32, call: u32, encoding: &str, payload: &[u8]) -> Result<(), String> {
        self.steered()?;
        if encoding != JSON {
            return Err(format!("elk takes requests as json, not as {encoding}"));
        }
        let order = services::order(service, payload)?;
        let busy = || format!("{MOST_CALLS} calls are under way; try again");
        let calls = Place::take(&self.calls).ok_or_else(busy)?;
        let (host, outbox) = (self.host.clone(), self.outbox.clone());
        spawn_blocking(move || {
            let _calls = calls;
            let done = host.mission.as_ref().map(|mission| mission.order(&order, &mut |_| {}));
            outbox.say(match done.unwrap_or_else(|| Err("nobody takes orders".into())) {
                Ok(text) => protocol::response(service, call, &json!({"text": text})),
                Err(why) => protocol::failure(service, call, &why),
            });
        });
        Ok(())
    }

    /// Has something done after all that was said before.
    fn queue(&self, what: impl FnOnce(&Host, &Outbox) + Send + 'static) -> Result<(), String> {
        let (host, outbox) = (self.host.clone(), self.outbox.clone());
        let queued = self.jobs.try_send(Box::new(move || what(&host, &outbox)));
        queued.map_err(|_| format!("{MOST_JOBS} messages wait to be done: this one was left out"))
    }
}

/// A call's place among those that may be under way.
struct Place(Arc<AtomicUsize>);

impl Place {
    fn take(calls: &Arc<AtomicUsize>) -> Option<Self> {
        let place = Self(calls.clone());
        (calls.fetch_add(1, Ordering::Relaxed) < MOST_CALLS).then_some(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The value that a message publishes, as `elk poke` takes it. It is made as messages of the variable are: `{"value": …}`.
fn poked(key: &str, payload: &[u8]) -> Result<String, String> {
    let wrong =
        |why: &str| format!("{key}: {why}; right is an object as this channel's messages are: {{\"value\": …}}");
    let message: Value = serde_json::from_slice(payload).map_err(|error| wrong(&error.to_string()))?;
    match message.get("value") {
        Some(Value::String(text)) => Ok(text.clone()),
        Some(value) => Ok(value.to_string()),
        None => Err(wrong("a message without a value")),
    }
}

fn answer_parameters(host: &Host, outbox: &Outbox, names: &[String], id: Option<&str>) {
    let all = host.parameters();
    let wanted = all.iter().filter(|one| names.is_empty() || names.contains(&one.name));
    outbox.say(protocol::parameter_values(wanted, id));
}

/// Parameters are changed as a running mission allows it: their app is swapped for one that has them.
fn set_parameters(host: &Host, outbox: &Outbox, wanted: &[Parameter], id: Option<&str>) {
    let complain = |why: &str| outbox.say(protocol::status(Level::Error, why, None));
    match swaps(&host.parameters(), wanted) {
        Err(why) => complain(&why),
        Ok(swaps) => {
            for (app, params) in swaps {
                let order = Order::Swap { app: app.clone(), type_name: None, params };
                if let Some(Err(why)) = host.mission.as_ref().map(|mission| mission.order(&order, &mut |_| {})) {
                    complain(&format!("{app}: {why}"));
                }
            }
        }
    }
    host.hub.parameters(host.parameters());
    // The answer has what is so now, whether it was changed or not.
    if id.is_some() {
        let names: Vec<String> = wanted.iter().map(|one| one.name.clone()).collect();
        answer_parameters(host, outbox, &names, id);
    }
}

/// The apps that are to be swapped, each with its parameters.
type Swaps = BTreeMap<String, Vec<(String, String)>>;

fn swaps(known: &[Parameter], wanted: &[Parameter]) -> Result<Swaps, String> {
    let mut swaps = Swaps::new();
    for Parameter { name, value } in wanted {
        let now = known.iter().find(|one| one.name == *name);
        let now = now.ok_or_else(|| format!("the mission has no parameter {name:?}; right is App.Param"))?;
        let text = services::said_in_words(name, value)?;
        let (app, param) = name.split_once('.').ok_or_else(|| format!("{name:?} is no App.Param"))?;
        // To swap an app for the same again would lose what it knows for nothing.
        if services::said_in_words(name, &now.value).as_ref() != Ok(&text) {
            swaps.entry(app.to_owned()).or_default().push((param.to_owned(), text));
        }
    }
    Ok(swaps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_published_is_what_a_person_would_type() {
        for (message, typed) in [
            (r#"{"value":1.5}"#, "1.5"),
            (r#"{"value":"go","time":1}"#, "go"),
            (r#"{"value":{"scan":1}}"#, r#"{"scan":1}"#),
        ] {
            assert_eq!(poked("A", message.as_bytes()), Ok(typed.into()));
        }
        for wrong in ["", "1.5", "{}", r#"{"data":1}"#] {
            let why = poked("A", wrong.as_bytes()).unwrap_err();
            assert!(why.starts_with("A: ") && why.contains(r#"{"value": …}"#), "{why}");
        }
    }

    #[test]
    fn parameters_are_changed_app_by_app_and_only_if_they_differ() {
        let parameter = |name: &str, value: Value| Parameter { name: name.into(), value };
        let known = [
            parameter("Map.Res", json!(0.1)),
            parameter("Map.File", json!("a")),
            parameter("Sensor.Start", json!([1.0, 2.0, 3.0])),
        ];
        let wanted = [parameter("Map.Res", json!(0.2)), parameter("Map.File", json!("b"))];
        let map = vec![("Res".into(), "0.2".into()), ("File".into(), "b".into())];
        assert_eq!(swaps(&known, &wanted), Ok(Swaps::from([("Map".into(), map)])));
        assert_eq!(swaps(&known, &known), Ok(Swaps::new()));
        assert!(swaps(&known, &[parameter("Map.Rez", json!(1))]).unwrap_err().contains("no parameter \"Map.Rez\""));
        assert!(swaps(&known, &[parameter("Map.Res", Value::Null)]).unwrap_err().contains("Map.Res is null"));
    }
}
