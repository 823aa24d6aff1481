//! What can be asked, and what is answered.

use std::path::PathBuf;

use elk_mission::Via;
use serde::{Deserialize, Serialize};

/// What a person has a launcher do, or say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "command", deny_unknown_fields)]
pub enum Order {
    /// Who runs?
    Apps,
    /// Which mission is it, as it runs now?
    Mission,
    /// Stop an app.
    Stop {
        /// Its name.
        app: String,
    },
    /// Start an app that is stopped, and wait until it has registered.
    Start {
        /// Its name.
        app: String,
        /// How long that may take (s).
        limit_secs: f64,
    },
    /// Exchange an app for a successor.
    Swap {
        /// Its name.
        app: String,
        /// Another type of its element.
        type_name: Option<String>,
        /// Any executable instead, and its arguments.
        exec: Option<(String, Vec<String>)>,
        /// How that executable comes to the bus.
        #[serde(default)]
        via: Via,
        /// Parameters that are said anew.
        params: Vec<(String, String)>,
        /// Where relative files are looked for.
        folder: PathBuf,
        /// How long the new one may take to be ready (s).
        limit_secs: f64,
    },
    /// Hold the robot before its next pose.
    Pause,
    /// Let it go on.
    Resume,
    /// Let it take one pose command, paused as it is.
    Step,
    /// A launcher in the background is to leave the mission to whoever asks.
    Leave,
}

/// What a launcher answers: any number of [`Answer::Progress`], then one of the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "answer")]
pub enum Answer {
    /// It is under way.
    Progress {
        /// What has happened.
        text: String,
    },
    /// It is done.
    Done {
        /// What has happened.
        text: String,
    },
    /// Who runs.
    Apps {
        /// The launcher, the broker, and the apps.
        rows: Vec<AppRow>,
    },
    /// The mission, in the words that a launcher leaves for the next one.
    Mission {
        /// These words.
        text: String,
    },
    /// It could not be done.
    Failed {
        /// Why.
        text: String,
    },
}

impl Answer {
    /// Whether more follows.
    pub fn is_last(&self) -> bool {
        !matches!(self, Self::Progress { .. })
    }
}

/// One line of `elk apps`. What is not known is `null`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AppRow {
    /// Its name on the bus.
    pub name: String,
    /// Its element in the mission; empty for launcher and broker.
    pub element: String,
    /// Its type; `exec`, `pipe` or `moos` for somebody else's program.
    #[serde(rename = "type")]
    pub type_name: String,
    /// Its process.
    pub pid: Option<i32>,
    /// `running`, `starting`, `restarting`, `stopping`, `stopped`, `ended`.
    pub state: String,
    /// For how long (s).
    pub state_secs: f64,
    /// CPU since it started (% of one core).
    pub cpu_percent: Option<f64>,
    /// CPU in the last second or two (% of one core).
    pub cpu_percent_now: Option<f64>,
    /// Memory that is resident (bytes).
    pub resident_bytes: Option<u64>,
    /// Messages that it has missed, because it did not keep up.
    pub dropped: Option<u64>,
    /// Messages that it was given and could not use.
    pub rejected: Option<u64>,
    /// How often it was started again after it had ended.
    pub restarts: u32,
    /// How often it was swapped.
    pub swaps: u32,
    /// How it last ended: code or signal, and the last line of its log.
    pub last_exit: Option<String>,
}
