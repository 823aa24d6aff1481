//! What clients can call: the launcher's orders, as on the page and on the command line.

use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::words::Order;

/// A service.
struct Service {
    name: &'static str,
    summary: &'static str,
    /// The fields of a request, each with its JSON schema.
    fields: &'static [(&'static str, &'static str)],
}

const APP: (&str, &str) = ("app", r#"{"type":"string","description":"the app's name"}"#);
const TYPE: (&str, &str) =
    ("type", r#"{"type":"string","description":"another type of its element; without it, the one that it has"}"#);
const PARAMS: (&str, &str) =
    ("params", r#"{"type":"object","properties":{},"description":"parameters that are said anew, by name"}"#);

/// All of them; a service's number is its place here, from 1.
const SERVICES: [Service; 6] = [
    Service { name: "pause", summary: "Hold the robot before its next pose", fields: &[] },
    Service { name: "resume", summary: "Let the robot go on", fields: &[] },
    Service { name: "step", summary: "Let the robot take one pose command, paused as it is", fields: &[] },
    Service { name: "stop", summary: "Stop an app", fields: &[APP] },
    Service { name: "start", summary: "Start an app that is stopped", fields: &[APP] },
    Service { name: "swap", summary: "Exchange an app for a successor", fields: &[APP, TYPE, PARAMS] },
];

/// Their names.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    SERVICES.iter().map(|service| service.name)
}

/// The message that tells of them.
pub(super) fn advertisement() -> Value {
    let services = SERVICES.iter().zip(1..).map(|(service, id): (_, u32)| {
        let read = |schema: &str| serde_json::from_str::<Value>(schema).unwrap_or_default();
        let fields: Map<_, _> = service.fields.iter().map(|(name, one)| ((*name).to_owned(), read(one))).collect();
        let request = json!({"type": "object", "title": service.summary, "properties": fields});
        let response = json!({
            "type": "object", "properties": {"text": {"type": "string", "description": "what was done, in words"}},
        });
        let said = |name: String, schema: Value| {
            json!({"encoding": "json", "schemaName": name, "schemaEncoding": "jsonschema", "schema": schema.to_string()})
        };
        json!({
            "id": id, "name": service.name, "type": format!("elk.{}", service.name),
            "request": said(format!("elk.{}", service.name), request), "response": said("elk.Done".into(), response),
        })
    });
    json!({"op": "advertiseServices", "services": services.collect::<Vec<_>>()})
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Nothing {}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfApp {
    app: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Swap {
    app: String,
    #[serde(default, rename = "type")]
    type_name: Option<String>,
    #[serde(default)]
    params: Map<String, Value>,
}

/// The order that a call means.
///
/// # Errors
/// There is no such service, or that is no request to it; in words what would be right.
pub(super) fn order(service: u32, request: &[u8]) -> Result<Order, String> {
    let place = (service as usize).wrapping_sub(1);
    let found = SERVICES.get(place).ok_or_else(|| format!("there is no service {service}"))?;
    // Who has nothing to say may say nothing.
    let request = if request.is_empty() { b"{}" } else { request };
    match found.name {
        "pause" => read::<Nothing>(found, request).map(|_| Order::Pause),
        "resume" => read::<Nothing>(found, request).map(|_| Order::Resume),
        "step" => read::<Nothing>(found, request).map(|_| Order::Step),
        "stop" => read(found, request).map(|OfApp { app }| Order::Stop { app }),
        "start" => read(found, request).map(|OfApp { app }| Order::Start { app }),
        _ => {
            let Swap { app, type_name, params } = read(found, request)?;
            let params = params.iter().map(|(name, value)| Ok((name.clone(), said_in_words(name, value)?)));
            Ok(Order::Swap { app, type_name, params: params.collect::<Result<_, String>>()? })
        }
    }
}

fn read<'a, T: Deserialize<'a>>(service: &Service, request: &'a [u8]) -> Result<T, String> {
    serde_json::from_slice(request).map_err(|error| {
        let fields: Vec<&str> = service.fields.iter().map(|(name, _)| *name).collect();
        let right = if fields.is_empty() { "{}".into() } else { format!("an object with {}", fields.join(", ")) };
        format!("{} takes {right}: {error}", service.name)
    })
}

/// The value of a parameter as a mission file has it.
///
/// # Errors
/// It can be no parameter's; in words why.
pub(super) fn said_in_words(name: &str, value: &Value) -> Result<String, String> {
    match value {
        Value::String(text) => Ok(text.clone()),
        Value::Number(_) | Value::Bool(_) => Ok(value.to_string()),
        Value::Array(numbers) if numbers.iter().all(Value::is_number) => {
            Ok(numbers.iter().map(Value::to_string).collect::<Vec<_>>().join("; "))
        }
        _ => Err(format!("{name} is {value}; right is a number, a text, true, false, or a list of numbers")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_are_the_orders_of_their_names() {
        assert_eq!(order(1, b""), Ok(Order::Pause));
        assert_eq!(order(2, b"{}"), Ok(Order::Resume));
        assert_eq!(order(4, br#"{"app":"Map"}"#), Ok(Order::Stop { app: "Map".into() }));
        let swap = br#"{"app":"Explorer","type":"Potential","params":{"Res":0.1,"Start":[1,2,3.5],"Fast":true}}"#;
        let params = [("Res", "0.1"), ("Start", "1; 2; 3.5"), ("Fast", "true")];
        let params = params.map(|(name, text)| (name.to_owned(), text.to_owned())).to_vec();
        let wanted = Order::Swap { app: "Explorer".into(), type_name: Some("Potential".into()), params };
        assert_eq!(order(6, swap), Ok(wanted));
    }

    #[test]
    fn what_a_service_does_not_take_it_refuses_and_says_what_is_right() {
        assert_eq!(order(0, b"{}"), Err("there is no service 0".into()));
        assert_eq!(order(7, b"{}"), Err("there is no service 7".into()));
        assert!(order(1, br#"{"app":"Map"}"#).unwrap_err().starts_with("pause takes {}: unknown field `app`"));
        assert!(order(5, b"{}").unwrap_err().starts_with("start takes an object with app: missing field `app`"));
        let nested = order(6, br#"{"app":"Map","params":{"Res":{}}}"#).unwrap_err();
        assert!(nested.starts_with("Res is {}; right is a number"), "{nested}");
    }

    #[test]
    fn every_service_is_told_with_a_schema_that_viewers_take() {
        let said = advertisement();
        let services = said["services"].as_array().unwrap();
        assert_eq!(
            services.iter().map(|one| one["name"].as_str().unwrap()).collect::<Vec<_>>(),
            names().collect::<Vec<_>>()
        );
        for service in services {
            let schema: Value = serde_json::from_str(service["request"]["schema"].as_str().unwrap()).unwrap();
            for (name, field) in schema["properties"].as_object().unwrap() {
                assert!(field["type"].is_string(), "{name} of {service}");
            }
        }
    }
}
