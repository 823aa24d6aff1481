//! What a page says.

use std::collections::BTreeSet;

use serde::Deserialize;

/// The most variables that a page watches at a time.
const MOST_WATCHED: usize = 64;

/// A message of a page.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(crate) enum Said {
    /// It has taken all up to this frame.
    Ack { number: u64 },
    /// It shows the values of these variables, and of no others.
    Watch { keys: BTreeSet<String> },
    /// It shows these layers.
    Show { layers: BTreeSet<String> },
    /// It shows this app's text log, or none.
    Logs { app: Option<String> },
    /// An order to the mission's launcher.
    Order { id: u64, order: Order },
    /// A key was pressed that an app has declared.
    Press { id: u64, app: String, key: String, shift: bool, alt: bool },
    /// A variable is to be written.
    Poke { id: u64, key: String, value: String },
    /// Which types of apps are there?
    Types { id: u64 },
    /// A recorded run is to be played, or held.
    Play { playing: bool, rate: f64, looping: bool },
    /// A recorded run is to go on from this time (s).
    Seek { time: f64 },
}

/// What a page has a launcher do.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "command", rename_all = "snake_case")]
pub enum Order {
    /// Hold the robot before its next pose.
    Pause,
    /// Let it go on.
    Resume,
    /// Let it take one pose command.
    Step,
    /// Stop an app.
    Stop {
        /// Its name.
        app: String,
    },
    /// Start an app that is stopped.
    Start {
        /// Its name.
        app: String,
    },
    /// Exchange an app for another type of its element, with parameters said anew.
    Swap {
        /// Its name.
        app: String,
        /// The type.
        #[serde(default)]
        type_name: Option<String>,
        /// Parameters.
        #[serde(default)]
        params: Vec<(String, String)>,
    },
}

impl Said {
    /// What `text` says.
    ///
    /// # Errors
    /// It is no message of a page; in words why.
    pub fn read(text: &str) -> Result<Self, String> {
        match serde_json::from_str(text) {
            Ok(Self::Watch { keys }) if keys.len() > MOST_WATCHED => {
                Err(format!("watch: {} variables; right are at most {MOST_WATCHED}", keys.len()))
            }
            Ok(Self::Play { rate, .. }) if !(0.01..=1000.0).contains(&rate) => {
                Err(format!("play: the rate is {rate}; right is a number from 0.01 to 1000"))
            }
            Ok(Self::Seek { time }) if !time.is_finite() => Err("seek: the time is none".to_owned()),
            Ok(said) => Ok(said),
            Err(error) => Err(error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_page_says_is_understood_and_nonsense_is_named() {
        let swap = r#"{"type":"order","id":3,"order":{"command":"swap","app":"Explorer","type_name":"Potential","params":[["Res","0.1"]]}}"#;
        let order = Order::Swap {
            app: "Explorer".into(),
            type_name: Some("Potential".into()),
            params: vec![("Res".into(), "0.1".into())],
        };
        assert_eq!(Said::read(swap), Ok(Said::Order { id: 3, order }));
        for (nonsense, why) in [
            ("", "EOF"),
            (r#"{"type":"explode"}"#, "unknown variant"),
            (r#"{"type":"ack"}"#, "missing field `number`"),
            (r#"{"type":"play","playing":true,"rate":0.0,"looping":false}"#, "the rate is 0"),
        ] {
            let error = Said::read(nonsense).unwrap_err();
            assert!(error.contains(why), "{nonsense}: {error}");
        }
        let many: Vec<String> = (0..100).map(|number| format!("\"V{number}\"")).collect();
        let many = format!(r#"{{"type":"watch","keys":[{}]}}"#, many.join(","));
        assert!(Said::read(&many).unwrap_err().contains("100 variables"));
    }
}
