//! A client of Foxglove's: what it is told is read by Foxglove's own code.

// Each of the tests that have it uses a part of it.
#![allow(dead_code)]

use std::collections::BTreeMap;
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use foxglove::protocol::v1::server::ServerMessage;
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

/// How long anything may take on a machine that has much to do.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// See the module.
pub struct Viewer {
    socket: WebSocket<TcpStream>,
    /// Channels by topic: number, encoding, schema's name, and the schema.
    pub channels: BTreeMap<String, (u64, String, String, String)>,
    /// Services by name.
    pub services: BTreeMap<String, u32>,
    /// What it was told as statuses.
    pub statuses: Vec<String>,
    last_id: u32,
}

impl Viewer {
    /// Connects, with more headers; or why it was not let in.
    pub fn open(address: SocketAddr, query: &str, headers: &[(&'static str, &str)]) -> Result<Self, String> {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut request = format!("ws://{address}/{query}").into_client_request().unwrap();
        for (name, value) in [("sec-websocket-protocol", "foxglove.sdk.v1")].iter().chain(headers) {
            request.headers_mut().insert(*name, HeaderValue::from_str(value).unwrap());
        }
        match tungstenite::client(request, stream) {
            Ok((socket, answer)) => {
                assert_eq!(answer.headers()["sec-websocket-protocol"], "foxglove.sdk.v1");
                let (channels, services) = (BTreeMap::new(), BTreeMap::new());
                Ok(Self { socket, channels, services, statuses: Vec::new(), last_id: 0 })
            }
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
                let body = answer.body().clone().unwrap_or_default();
                Err(format!("{} {}", answer.status().as_u16(), String::from_utf8_lossy(&body)))
            }
            Err(error) => Err(error.to_string()),
        }
    }

    /// Says something.
    pub fn say(&mut self, message: &Value) {
        self.socket.send(Message::text(message.to_string())).unwrap();
    }

    fn say_binary(&mut self, kind: u8, numbers: &[u32], payload: &[u8]) {
        let mut bytes = vec![kind];
        numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        bytes.extend(payload);
        self.socket.send(Message::binary(bytes)).unwrap();
    }

    /// Reads until `wanted` makes something of a message.
    pub fn until<T>(&mut self, what: &str, mut wanted: impl FnMut(&ServerMessage<'_>) -> Option<T>) -> T {
        let waited = Stopwatch::start();
        while waited.elapsed() < PATIENCE {
            let message = self.socket.read().unwrap();
            let read = match &message {
                Message::Text(text) => ServerMessage::parse_json(text).unwrap_or_else(|why| panic!("{why}: {text}")),
                Message::Binary(bytes) => ServerMessage::parse_binary(bytes).unwrap(),
                _ => continue,
            };
            match &read {
                ServerMessage::Advertise(said) => self.channels.extend(said.channels.iter().map(|one| {
                    let said = [&one.encoding, &one.schema_name, &one.schema].map(ToString::to_string);
                    let [encoding, name, schema] = said;
                    (one.topic.to_string(), (one.id, encoding, name, schema))
                })),
                ServerMessage::Unadvertise(said) => {
                    self.channels.retain(|_, (id, ..)| !said.channel_ids.contains(id));
                }
                ServerMessage::AdvertiseServices(said) => {
                    self.services.extend(said.services.iter().map(|one| (one.name.to_string(), one.id)));
                }
                ServerMessage::Status(said) => self.statuses.push(said.message.clone()),
                _ => {}
            }
            if let Some(found) = wanted(&read) {
                return found;
            }
        }
        panic!("no {what} has come; statuses: {:?}", self.statuses);
    }

    /// Waits until a topic has a channel.
    pub fn wait_for_channel(&mut self, topic: &str) {
        if !self.channels.contains_key(topic) {
            self.until(topic, |said| match said {
                ServerMessage::Advertise(said) => said.channels.iter().any(|one| one.topic == topic).then_some(()),
                _ => None,
            });
        }
    }

    /// Subscribes to a topic as soon as it has a channel; what the subscription is called.
    pub fn subscribe(&mut self, topic: &str) -> u32 {
        self.wait_for_channel(topic);
        self.last_id += 1;
        let subscription = json!({"id": self.last_id, "channelId": self.channels[topic].0});
        self.say(&json!({"op": "subscribe", "subscriptions": [subscription]}));
        self.last_id
    }

    /// The next message of a subscription.
    pub fn next(&mut self, subscription: u32) -> Vec<u8> {
        self.until("message", |said| match said {
            ServerMessage::MessageData(said) if said.subscription_id == subscription => Some(said.data.to_vec()),
            _ => None,
        })
    }

    /// The next message of a subscription to JSON.
    pub fn next_json(&mut self, subscription: u32) -> Value {
        serde_json::from_slice(&self.next(subscription)).unwrap()
    }

    /// Reads messages of a subscription until one has this value.
    pub fn until_value(&mut self, subscription: u32, value: &Value) {
        while self.next_json(subscription)["value"] != *value {}
    }

    /// Waits for a status with these words.
    pub fn until_status(&mut self, words: &str) {
        if !self.statuses.iter().any(|said| said.contains(words)) {
            self.until(words, |said| match said {
                ServerMessage::Status(said) => said.message.contains(words).then_some(()),
                _ => None,
            });
        }
    }

    /// Publishes on a channel of its own.
    pub fn publish(&mut self, topic: &str, payload: &str) {
        self.last_id += 1;
        let channel = json!({"id": self.last_id, "topic": topic, "encoding": "json", "schemaName": "any"});
        self.say(&json!({"op": "advertise", "channels": [channel]}));
        self.say_binary(1, &[self.last_id], payload.as_bytes());
    }

    /// Calls a service; what it answers, or why it has not done it.
    pub fn call(&mut self, service: &str, request: &Value) -> Result<String, String> {
        let (id, call) = (self.services[service], 77 + self.last_id);
        self.last_id += 1;
        self.say_binary(2, &[id, call, 4], format!("json{request}").as_bytes());
        self.until("answer", |said| match said {
            ServerMessage::ServiceCallResponse(said) if said.call_id == call => {
                let answer: Value = serde_json::from_slice(&said.payload).unwrap();
                Some(Ok(answer["text"].as_str().unwrap().to_owned()))
            }
            ServerMessage::ServiceCallFailure(said) if said.call_id == call => Some(Err(said.message.clone())),
            _ => None,
        })
    }

    /// The parameters of this name, or all.
    pub fn parameters(&mut self, names: &[&str]) -> Value {
        self.say(&json!({"op": "getParameters", "parameterNames": names, "id": "asked"}));
        self.answered_parameters("asked")
    }

    /// The parameters that answer a question.
    pub fn answered_parameters(&mut self, id: &str) -> Value {
        self.until("parameters", |said| match said {
            ServerMessage::ParameterValues(said) if said.id.as_deref() == Some(id) => Some(values(said)),
            _ => None,
        })
    }

    /// The parameters that are told unasked.
    pub fn told_parameters(&mut self) -> Value {
        self.until("parameters", |said| match said {
            ServerMessage::ParameterValues(said) if said.id.is_none() => Some(values(said)),
            _ => None,
        })
    }
}

fn values(said: &foxglove::protocol::v1::server::ParameterValues) -> Value {
    let of = |one: &foxglove::protocol::v1::parameter::Parameter| {
        (one.name.clone(), serde_json::to_value(&one.value).unwrap())
    };
    said.parameters.iter().map(of).collect::<serde_json::Map<_, _>>().into()
}
