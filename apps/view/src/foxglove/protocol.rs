//! What Foxglove's clients and a server say to each other:
//! <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>. Numbers in binary messages are little-endian.

use axum::body::Bytes;
use axum::extract::ws::{Message, Utf8Bytes};
use data_encoding::BASE64;
use elk_log::shown::Announcement;
use serde::Deserialize;
use serde_json::{Value, json};

/// Names of the protocol that a client may offer; older clients know it by the second.
pub(super) const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// The encoding of what clients publish, of requests and of answers.
pub(super) const JSON: &str = "json";

/// How bad it is, as a client shows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    Warning = 1,
    Error = 2,
}

/// A message of a client.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(super) enum Said {
    /// It wants the messages of channels.
    Subscribe { subscriptions: Vec<Subscription> },
    /// It wants them no longer.
    Unsubscribe { subscription_ids: Vec<u32> },
    /// It is about to publish.
    Advertise { channels: Vec<ClientChannel> },
    /// It publishes there no longer.
    Unadvertise { channel_ids: Vec<u32> },
    /// It asks for parameters; no names: for all.
    GetParameters { parameter_names: Vec<String>, id: Option<String> },
    /// It changes parameters.
    SetParameters { parameters: Vec<Parameter>, id: Option<String> },
    /// It wants to be told when these change.
    SubscribeParameterUpdates { parameter_names: Vec<String> },
    /// It wants that no longer.
    UnsubscribeParameterUpdates { parameter_names: Vec<String> },
    /// It wants to know who writes what, and who reads it.
    SubscribeConnectionGraph {},
    /// It wants that no longer.
    UnsubscribeConnectionGraph {},
}

/// What a client calls a channel whose messages it wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    pub id: u32,
    pub channel_id: u64,
}

/// What a client publishes.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub(super) struct ClientChannel {
    pub id: u32,
    pub topic: String,
    pub encoding: String,
}

/// A parameter of the mission: its name is `App.Param`, as in `--set` of `elk launch`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Parameter {
    /// The name.
    pub name: String,
    /// What it is.
    #[serde(default)]
    pub value: Value,
}

/// A binary message of a client.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum SaidBinary<'a> {
    /// A message of one of its channels.
    Publish { channel: u32, payload: &'a [u8] },
    /// It calls a service.
    Call { service: u32, call: u32, encoding: &'a str, payload: &'a [u8] },
}

impl Said {
    /// What `text` says.
    ///
    /// # Errors
    /// It is no message of a client; in words why.
    pub fn read(text: &str) -> Result<Self, String> {
        serde_json::from_str(text).map_err(|error| error.to_string())
    }
}

impl<'a> SaidBinary<'a> {
    /// What `bytes` say.
    ///
    /// # Errors
    /// They are no message of a client; in words why.
    pub fn read(bytes: &'a [u8]) -> Result<Self, String> {
        let (kind, mut rest) = bytes.split_first().ok_or("an empty binary message")?;
        let mut word = || {
            let (word, behind) = rest.split_first_chunk().ok_or("a binary message that is cut short")?;
            rest = behind;
            Ok::<_, &str>(u32::from_le_bytes(*word))
        };
        match kind {
            1 => Ok(Self::Publish { channel: word()?, payload: rest }),
            2 => {
                let (service, call, length) = (word()?, word()?, word()?);
                let cut = rest.split_at_checked(length as usize);
                let (encoding, payload) = cut.ok_or("a service call that is cut short")?;
                let encoding = std::str::from_utf8(encoding).map_err(|_| "an encoding that is no text")?;
                Ok(Self::Call { service, call, encoding, payload })
            }
            other => Err(format!("a binary message of kind {other}; right are 1 (a message) and 2 (a call)")),
        }
    }
}

/// A JSON message.
pub(super) fn text(message: &Value) -> Message {
    Message::Text(Utf8Bytes::from(message.to_string()))
}

/// Words for the person at the client. One with an `id` replaces the last one of it, and can be taken back.
pub(super) fn status(level: Level, words: &str, id: Option<&str>) -> Message {
    let mut message = json!({"op": "status", "level": level as u8, "message": words});
    if let Some(id) = id {
        message["id"] = id.into();
    }
    text(&message)
}

/// Takes a status back.
pub(super) fn remove_status(id: &str) -> Message {
    text(&json!({"op": "removeStatus", "statusIds": [id]}))
}

/// A channel as it is advertised.
pub(super) fn channel(id: u64, topic: &str, said: &Announcement) -> Value {
    let schema = match said.message_encoding {
        JSON => String::from_utf8_lossy(&said.schema).into_owned(),
        _ => BASE64.encode(&said.schema),
    };
    json!({
        "id": id, "topic": topic, "encoding": said.message_encoding, "schemaName": said.schema_name,
        "schemaEncoding": said.schema_encoding, "schema": schema,
    })
}

/// Channels that are there now.
pub(super) fn advertise<'a>(channels: impl Iterator<Item = &'a Value>) -> Message {
    text(&json!({"op": "advertise", "channels": channels.collect::<Vec<_>>()}))
}

/// Channels that are there no longer.
pub(super) fn unadvertise(ids: &[u64]) -> Message {
    text(&json!({"op": "unadvertise", "channelIds": ids}))
}

/// Parameters; `id`: that of the question.
pub(super) fn parameter_values<'a>(parameters: impl Iterator<Item = &'a Parameter>, id: Option<&str>) -> Message {
    let one = |Parameter { name, value }: &Parameter| match value {
        Value::Number(_) => json!({"name": name, "value": value, "type": "float64"}),
        Value::Array(_) => json!({"name": name, "value": value, "type": "float64_array"}),
        _ => json!({"name": name, "value": value}),
    };
    let mut message = json!({"op": "parameterValues", "parameters": parameters.map(one).collect::<Vec<_>>()});
    if let Some(id) = id {
        message["id"] = id.into();
    }
    text(&message)
}

/// A message of a channel: the client's name for its subscription, and when it was received (ns since 1970).
pub(super) fn message_data(subscription: u32, received: u64, payload: &[u8]) -> Message {
    binary(1, &[&subscription.to_le_bytes(), &received.to_le_bytes(), payload])
}

/// The community's time (ns since 1970).
pub(super) fn time(nanoseconds: u64) -> Message {
    binary(2, &[&nanoseconds.to_le_bytes()])
}

/// A service has done what it was called for, and answers in JSON.
pub(super) fn response(service: u32, call: u32, answer: &Value) -> Message {
    let (service, call, length) = (service.to_le_bytes(), call.to_le_bytes(), (JSON.len() as u32).to_le_bytes());
    binary(3, &[&service, &call, &length, JSON.as_bytes(), answer.to_string().as_bytes()])
}

/// A service has not done what it was called for.
pub(super) fn failure(service: u32, call: u32, why: &str) -> Message {
    text(&json!({"op": "serviceCallFailure", "serviceId": service, "callId": call, "message": why}))
}

fn binary(kind: u8, parts: &[&[u8]]) -> Message {
    let mut bytes = Vec::with_capacity(1 + parts.iter().map(|part| part.len()).sum::<usize>());
    bytes.push(kind);
    parts.iter().for_each(|part| bytes.extend_from_slice(part));
    Message::Binary(Bytes::from(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_client_says_is_understood_and_nonsense_is_named() {
        let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":7,"channelId":3}]}"#;
        let subscriptions = vec![Subscription { id: 7, channel_id: 3 }];
        assert_eq!(Said::read(subscribe), Ok(Said::Subscribe { subscriptions }));
        let all = r#"{"op":"getParameters","parameterNames":[]}"#;
        assert_eq!(Said::read(all), Ok(Said::GetParameters { parameter_names: vec![], id: None }));
        assert_eq!(Said::read(r#"{"op":"subscribeConnectionGraph"}"#), Ok(Said::SubscribeConnectionGraph {}));
        assert!(Said::read(r#"{"op":"explode"}"#).unwrap_err().contains("unknown variant"));
        assert!(Said::read("").is_err());
    }

    #[test]
    fn binary_messages_are_taken_whole_or_not_at_all() {
        let call = [&[2, 5, 0, 0, 0, 6, 0, 0, 0, 4, 0, 0, 0][..], b"json{}"].concat();
        let right = SaidBinary::Call { service: 5, call: 6, encoding: "json", payload: b"{}" };
        assert_eq!(SaidBinary::read(&call), Ok(right));
        assert_eq!(SaidBinary::read(&[1, 9, 0, 0, 0, 42]), Ok(SaidBinary::Publish { channel: 9, payload: &[42] }));
        for length in 0..13 + 4 {
            assert!(SaidBinary::read(&call[..length]).is_err(), "{length}");
        }
        let lying = [2, 5, 0, 0, 0, 6, 0, 0, 0, 255, 255, 255, 255, b'j'];
        assert!(SaidBinary::read(&lying).unwrap_err().contains("cut short"));
        assert!(SaidBinary::read(&[9]).unwrap_err().contains("kind 9"));
    }
}
