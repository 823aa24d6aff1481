//! The lines: one JSON object each. What a program says, and what it is told.

use std::str::FromStr;
use std::time::Duration;

use elk_bus::{Mail, Subscription, any, pattern, subscription};
use serde_json::{Map, Value, json};

/// What a program says in a line.
#[derive(Debug, Clone, PartialEq)]
pub enum Said {
    /// `{"register": "NAV_*", "from": "gps", "rate": 10, "lossless": true}`: it wants to hear these variables.
    Register(Registration),
    /// `{"unregister": "NAV_*", "from": "gps"}`: no longer.
    Unregister(Registration),
    /// `{"publish": "SPEED", "value": 1.5, "type": "Speed"}`: a value, and of which type if nobody else says it.
    Publish(Publish),
    /// `{"describe": "PLAN"}`: what does this variable carry?
    Describe(String),
    /// `{"arrays": "base64"}`: so are lists of numbers in its mail from now on.
    Arrays(Arrays),
    /// `{"log": "words"}`: words for the app's log.
    Log(String),
    /// `{"ready": true}`: it has registered for what it needs, and takes its mail.
    Ready,
}

/// How a program is told lists of numbers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Arrays {
    /// Number by number.
    #[default]
    Json,
    /// In base64, with their type and shape.
    Base64,
}

/// Which variables to hear.
#[derive(Debug, Clone, PartialEq)]
pub struct Registration {
    /// Pattern of the variables.
    pub keys: String,
    /// Pattern of who publishes them.
    pub from: String,
    /// The most messages a second of each variable; `None`: all.
    pub rate: Option<f64>,
    /// Whether publishers wait for this reader.
    pub lossless: bool,
}

/// A value to be published.
#[derive(Debug, Clone, PartialEq)]
pub struct Publish {
    /// The variable.
    pub variable: String,
    /// The value as JSON.
    pub value: Value,
    /// Its type's name, if it is said.
    pub type_name: Option<String>,
}

const VERBS: [&str; 7] = ["register", "unregister", "publish", "describe", "arrays", "log", "ready"];

impl Said {
    /// What a line says.
    ///
    /// # Errors
    /// It says nothing that is known: what was found, and what would be right.
    pub fn of(line: &str) -> Result<Self, String> {
        let mut fields = match serde_json::from_str(line) {
            Ok(Value::Object(fields)) => Fields(fields),
            Ok(_) => return Err("a line is one JSON object, as {\"log\": \"words\"}".to_owned()),
            Err(error) => return Err(format!("this is no JSON: {error}")),
        };
        let verbs: Vec<&str> = VERBS.into_iter().filter(|verb| fields.0.contains_key(*verb)).collect();
        let [verb] = verbs[..] else {
            let found: Vec<&str> = fields.0.keys().take(8).map(String::as_str).collect();
            return Err(format!("a line says one of {}; this one says {}", VERBS.join(", "), found.join(", ")));
        };
        let said = match verb {
            "register" => Self::Register(fields.registration(verb)?),
            "unregister" => Self::Unregister(fields.registration(verb)?),
            "publish" => Self::Publish(Publish {
                variable: fields.text(verb)?,
                value: fields.0.shift_remove("value").ok_or("publish without a value; right is \"value\": …")?,
                type_name: fields.0.contains_key("type").then(|| fields.text("type")).transpose()?,
            }),
            "describe" => Self::Describe(fields.text(verb)?),
            "arrays" => Self::Arrays(match fields.text(verb)?.as_str() {
                "json" => Arrays::Json,
                "base64" => Arrays::Base64,
                other => return Err(format!("arrays is {other:?}; it has to be \"base64\" or \"json\"")),
            }),
            "log" => Self::Log(fields.text(verb)?),
            _ => match fields.flag(verb)? {
                true => Self::Ready,
                false => return Err("ready is false; right is true, or no word of it".to_owned()),
            },
        };
        match fields.0.keys().next() {
            Some(odd) => Err(format!("{odd} says nothing beside {verb}")),
            None => Ok(said),
        }
    }
}

/// The fields of a line that were not read yet.
struct Fields(Map<String, Value>);

impl Fields {
    fn text(&mut self, name: &str) -> Result<String, String> {
        match self.0.shift_remove(name) {
            Some(Value::String(text)) => Ok(text),
            other => Err(format!("{name} is {}; it has to be a text", other.unwrap_or_default())),
        }
    }

    fn flag(&mut self, name: &str) -> Result<bool, String> {
        match self.0.shift_remove(name) {
            None => Ok(false),
            Some(Value::Bool(flag)) => Ok(flag),
            Some(other) => Err(format!("{name} is {other}; it has to be true or false")),
        }
    }

    fn registration(&mut self, verb: &str) -> Result<Registration, String> {
        let keys = self.text(verb)?;
        let from = if self.0.contains_key("from") { self.text("from")? } else { "*".to_owned() };
        let (mut rate, mut lossless) = (None, false);
        if verb == "register" {
            rate = self.0.shift_remove("rate").map(|said| said.as_f64().and_then(right_rate).ok_or(wrong_rate(&said)));
            lossless = self.flag("lossless")?;
        }
        Ok(Registration { keys, from, rate: rate.transpose()?, lossless })
    }
}

/// Messages a second whose distance is a time.
fn right_rate(rate: f64) -> Option<f64> {
    (1e-6..=1e9).contains(&rate).then_some(rate)
}

fn wrong_rate(said: &dyn std::fmt::Display) -> String {
    format!("rate is {said}; right is how many messages a second at most, from 0.000001")
}

impl Registration {
    /// As the bus takes it.
    pub fn subscription(&self) -> Subscription<subscription::Any> {
        let mut wanted = any(self.keys.as_str()).from(self.from.as_str());
        if let Some(rate) = self.rate {
            wanted = wanted.every(Duration::from_secs_f64(1.0 / rate));
        }
        if self.lossless { wanted.lossless() } else { wanted }
    }
}

impl FromStr for Registration {
    type Err = String;

    /// `PATTERN`, or `PATTERN@RATE` for at most so many messages a second.
    fn from_str(said: &str) -> Result<Self, String> {
        let (keys, rate) = match said.rsplit_once('@') {
            None => (said, None),
            Some((keys, rate)) => {
                let right = rate.parse().ok().and_then(right_rate);
                (keys, Some(right.ok_or_else(|| wrong_rate(&rate))?))
            }
        };
        match keys.is_empty() {
            true => Err("there is no pattern; right is PATTERN or PATTERN@RATE, as 'NAV_*@10'".to_owned()),
            false => Ok(Self { keys: keys.to_owned(), from: "*".to_owned(), rate, lossless: false }),
        }
    }
}

/// Whether something can be a variable that a program publishes.
///
/// # Errors
/// Why not.
pub fn check_variable(name: &str) -> Result<(), String> {
    if name.trim().is_empty() || name.chars().any(char::is_control) || !pattern::is_literal(name) {
        return Err(format!("{name:?} is no variable's name: no * and no ?, and at least a letter"));
    }
    match name.starts_with("DB_") {
        true => Err(format!("{name} is the broker's own")),
        false => Ok(()),
    }
}

/// The version of these lines.
const PROTOCOL: u32 = 1;

/// The first line: who the program is, where, and what the mission says to it.
pub fn hello(name: &str, community: &str, parameters: &[(String, String)]) -> Value {
    let parameters: Map<String, Value> =
        parameters.iter().map(|(name, text)| (name.clone(), text.as_str().into())).collect();
    json!({"hello": {"name": name, "community": community, "protocol": PROTOCOL, "parameters": parameters}})
}

/// A message, its value as JSON, and the name of its type. One that was said before the program registered says so.
pub fn mail(mail: &Mail<'_>, type_name: &str, value: Value) -> Value {
    let mut said = Map::from_iter([
        ("mail".to_owned(), mail.key().into()),
        ("source".to_owned(), mail.source().into()),
        ("time".to_owned(), number(mail.time())),
        ("type".to_owned(), type_name.into()),
        ("value".to_owned(), value),
    ]);
    said.extend(mail.is_latest().then(|| ("latest".to_owned(), true.into())));
    said.into()
}

/// What a variable carries: its type with an example and a description, or that nobody knows.
pub fn described(variable: &str, carried: Option<Value>) -> Value {
    let mut said = Map::from_iter([("described".to_owned(), variable.into())]);
    match carried {
        Some(Value::Object(carried)) => said.extend(carried),
        _ => drop(said.insert("type".to_owned(), Value::Null)),
    }
    said.into()
}

/// So many messages of the program's were lost, because it did not read.
pub fn lost(count: u64) -> Value {
    json!({"lost": count})
}

/// A line of the program's was not taken, or, without its number, a message of it by the broker. What was not taken is named: a
/// variable, or nothing if it is not known which.
pub fn refused(what: Option<&str>, line: Option<u64>, reason: &str) -> Value {
    let mut said = Map::from_iter([("refused".to_owned(), what.into()), ("reason".to_owned(), reason.into())]);
    said.extend(line.map(|line| ("line".to_owned(), line.into())));
    said.into()
}

/// A number; those that JSON does not have are the texts `inf`, `-inf` and `NaN`.
pub fn number(number: f64) -> Value {
    serde_json::Number::from_f64(number).map_or_else(|| number.to_string().into(), Value::Number)
}

/// The number that JSON says, as [`number`] writes it.
pub fn number_of(value: &Value) -> Option<f64> {
    match value.as_str() {
        Some("inf") => Some(f64::INFINITY),
        Some("-inf") => Some(f64::NEG_INFINITY),
        Some("NaN") => Some(f64::NAN),
        _ => value.as_f64(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_one_thing() {
        let registration = |rate, lossless| Registration { keys: "NAV_*".into(), from: "gps".into(), rate, lossless };
        let publish = |value, type_name: Option<&str>| {
            Said::Publish(Publish { variable: "X".into(), value, type_name: type_name.map(str::to_owned) })
        };
        for (line, said) in [
            (
                r#"{"register":"NAV_*","from":"gps","rate":10,"lossless":true}"#,
                Said::Register(registration(Some(10.0), true)),
            ),
            (r#"{"unregister":"NAV_*","from":"gps"}"#, Said::Unregister(registration(None, false))),
            (r#"{"value":[1,{"a":null}],"publish":"X"}"#, publish(json!([1, {"a": null}]), None)),
            (r#"{"publish":"X","type":"Speed","value":{}}"#, publish(json!({}), Some("Speed"))),
            (r#"{"describe":"PLAN"}"#, Said::Describe("PLAN".into())),
            (r#"{"arrays":"base64"}"#, Said::Arrays(Arrays::Base64)),
            (r#"{"log":"words"}"#, Said::Log("words".into())),
            (r#" {"ready":true} "#, Said::Ready),
        ] {
            assert_eq!(Said::of(line).unwrap(), said, "{line}");
        }
    }

    #[test]
    fn what_says_nothing_is_told_what_would_be_right() {
        for (line, reason) in [
            ("", "this is no JSON: EOF"),
            ("hello", "this is no JSON"),
            ("[1]", "a line is one JSON object"),
            ("{}", "a line says one of register, unregister, publish"),
            (r#"{"registre":"X"}"#, "this one says registre"),
            (r#"{"log":"a","ready":true}"#, "this one says log, ready"),
            (r#"{"publish":"X"}"#, "publish without a value"),
            (r#"{"publish":5,"value":1}"#, "publish is 5; it has to be a text"),
            (r#"{"publish":"X","value":1,"rate":2}"#, "rate says nothing beside publish"),
            (r#"{"register":"X","rate":0}"#, "rate is 0; right is how many messages a second"),
            (r#"{"register":"X","rate":"fast"}"#, "rate is \"fast\""),
            (r#"{"register":"X","lossless":1}"#, "lossless is 1; it has to be true or false"),
            (r#"{"unregister":"X","rate":1}"#, "rate says nothing beside unregister"),
            (r#"{"ready":false}"#, "ready is false"),
            (r#"{"arrays":"hex"}"#, "arrays is \"hex\"; it has to be \"base64\" or \"json\""),
        ] {
            let error = Said::of(line).unwrap_err();
            assert!(error.contains(reason), "{line}: {error}");
        }
    }

    #[test]
    fn a_pattern_may_have_a_rate() {
        let said = |text: &str| text.parse::<Registration>().map(|one| (one.keys, one.rate));
        assert_eq!(said("NAV_*").unwrap(), ("NAV_*".to_owned(), None));
        assert_eq!(said("NAV_*@2.5").unwrap(), ("NAV_*".to_owned(), Some(2.5)));
        for wrong in ["", "@5", "X@", "X@fast", "X@0", "X@NaN", "X@-1"] {
            assert!(said(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn numbers_that_json_does_not_have_are_texts() {
        for number_ in [1.5, f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
            assert_eq!(number_of(&number(number_)).unwrap().to_bits(), number_.to_bits());
        }
        assert_eq!(number_of(&"fast".into()), None);
    }

    #[test]
    fn the_broker_s_variables_and_patterns_are_not_published() {
        for wrong in ["", " ", "A*", "A?", "A\n", "DB_TIME"] {
            assert!(check_variable(wrong).is_err(), "{wrong}");
        }
        assert!(check_variable("NAV_X").is_ok());
    }
}
