//! What happens when an app dies, or hangs: the attributes that say so, and what they mean.

use std::path::Path;

use crate::kind::Kind;
use crate::nearest::{instead, nearest};
use crate::params::ParamValue;
use crate::value::ValueError;

/// What happens when an app dies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Restart {
    /// The mission fails.
    #[default]
    Never,
    /// It is started again, unless it ended well (exit code 0).
    OnFailure,
    /// It is started again, however it ended.
    Always,
}

/// When an app is started again, how often, and when it counts as hung.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Policy {
    /// What happens when it dies.
    pub restart: Restart,
    /// How often it is started again within [`Policy::window_secs`]; once more, and the mission fails.
    pub restarts: u32,
    /// The window of that count (s).
    pub window_secs: f64,
    /// Without a sign of life for so long it is killed (s); `None`: it may be silent.
    pub health_secs: Option<f64>,
}

impl Default for Policy {
    fn default() -> Self {
        Self { restart: Restart::Never, restarts: 5, window_secs: 60.0, health_secs: None }
    }
}

impl Policy {
    /// That of a broker: it is started again unless somebody ended it on purpose.
    pub const BROKER: Self = Self { restart: Restart::OnFailure, restarts: 5, window_secs: 60.0, health_secs: None };
}

/// How long an app that comes with elk may be silent, if it is to be restarted and the mission does not say. Its framework
/// speaks every 2 s, but not from within a callback, and an explorer may think for seconds on a busy machine: what is killed
/// after half a minute does hang.
const HEALTH_SECS: f64 = 30.0;

/// Mail that a broker keeps for each client, if the mission does not say (MB).
const MAILBOX_MB: u32 = 4;

/// One of the attributes that make up a policy.
pub(crate) struct Attribute {
    pub name: &'static str,
    pub kind: Kind,
    pub default: &'static str,
    pub doc: &'static str,
}

/// The Scenario's attribute that says how long the start of an `<App>` waits for the one before.
pub(crate) const LAUNCH_PAUSE: &str = "launch-pause";
const PAUSE: Kind = Kind::Number { unit: "s", min: 0.0, max: 60.0 };

/// The attributes of a Scenario that say how its apps come to be there.
pub(crate) const OF_LAUNCH: [Attribute; 2] = [
    Attribute {
        name: "community",
        kind: Kind::Text,
        default: "elk",
        doc: "The community that it is launched in, if neither --community nor $ELK_COMMUNITY says another.",
    },
    Attribute {
        name: LAUNCH_PAUSE,
        kind: PAUSE,
        default: "0",
        doc: "How long each <App> waits for the one before it to be started, as MSBetweenLaunches has it.",
    },
];

/// What [`LAUNCH_PAUSE`] says (s).
pub(crate) fn launch_pause(value: &str) -> Result<f64, ValueError> {
    number(PAUSE, value, 0.0)
}

/// The words of `restart`.
const RESTART: [(&str, Restart); 3] =
    [("never", Restart::Never), ("on-failure", Restart::OnFailure), ("always", Restart::Always)];
/// The word of `health` for an app that may be silent.
pub(crate) const OFF: &str = "off";

const COUNT: Kind = Kind::Integer { min: 1, max: 1_000_000 };
/// As fast as MOOS' clients can go.
const WARP: Kind = Kind::Number { unit: "", min: 0.01, max: 400.0 };
const MAILBOX: Kind = Kind::Integer { min: 1, max: 1024 };
const SPAN: Kind = Kind::Number { unit: "s", min: 1.0, max: 86_400.0 };

/// The attributes of an app's element that make up its policy.
pub(crate) const OF_APP: [Attribute; 4] = [
    Attribute {
        name: "restart",
        kind: Kind::Choice(&["never", "on-failure", "always"]),
        default: "never",
        doc: "What happens when the app dies: the mission fails, or it is started again.",
    },
    Attribute {
        name: "restarts",
        kind: COUNT,
        default: "5",
        doc: "How often it is started again within restart-window; once more, and the mission fails.",
    },
    Attribute { name: "restart-window", kind: SPAN, default: "60", doc: "The window in which restarts are counted." },
    Attribute {
        name: "health",
        kind: SPAN,
        default: "30 for a restarted app of elk's own, else off",
        doc: "Without a sign of life for so long, it is killed; off: it may be silent.",
    },
];

/// The attributes of a Scenario that make up its broker's policy.
pub(crate) const OF_BROKER: [Attribute; 4] = [
    Attribute {
        name: "broker-restarts",
        kind: COUNT,
        default: "5",
        doc: "How often the broker is started again within broker-window; once more, and the mission fails.",
    },
    Attribute { name: "broker-window", kind: SPAN, default: "60", doc: "The window in which they are counted." },
    Attribute {
        name: "mailbox",
        kind: MAILBOX,
        default: "4",
        doc: "Mail that the broker keeps for each client, and for one that died and is started again.",
    },
    Attribute {
        name: "time-warp",
        kind: WARP,
        default: "1",
        doc: "How many times as fast as the wall's the community's clock runs, as MOOSTimeWarp has it.",
    },
];

/// What an app's element says of its policy, as far as it has been read.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Said {
    restart: Option<Restart>,
    restarts: Option<u32>,
    window_secs: Option<f64>,
    /// `Some(None)`: off.
    health_secs: Option<Option<f64>>,
}

/// What a Scenario says of its broker, as far as it has been read.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SaidOfBroker {
    restarts: Option<u32>,
    window_secs: Option<f64>,
    mailbox_mb: Option<u32>,
    time_warp: Option<f64>,
}

impl Said {
    /// Nothing but that the app is started again if it fails.
    pub const AGAIN: Self =
        Self { restart: Some(Restart::OnFailure), restarts: None, window_secs: None, health_secs: None };

    /// Takes an attribute of an app's element; `None`: it is none of a policy.
    pub fn take(&mut self, name: &str, value: &str) -> Option<Result<(), ValueError>> {
        match name {
            "restart" => Some(restart(value).map(|restart| self.restart = Some(restart))),
            "restarts" => Some(count(value).map(|count| self.restarts = Some(count))),
            "restart-window" => Some(span(value).map(|secs| self.window_secs = Some(secs))),
            "health" if value == OFF => {
                self.health_secs = Some(None);
                Some(Ok(()))
            }
            "health" => Some(health(value).map(|secs| self.health_secs = Some(Some(secs)))),
            _ => None,
        }
    }

    /// What is said in vain: a limit on restarts of what is never restarted.
    pub fn in_vain(&self) -> Option<&'static str> {
        let never = self.restart.unwrap_or_default() == Restart::Never;
        match (never, self.restarts, self.window_secs) {
            (true, Some(_), _) => Some("restarts"),
            (true, None, Some(_)) => Some("restart-window"),
            _ => None,
        }
    }

    /// The policy of an app; `own`: it comes with elk, and so gives signs of life.
    pub fn policy(&self, own: bool) -> Policy {
        let Policy { restarts, window_secs, .. } = Policy::default();
        let restart = self.restart.unwrap_or_default();
        let health_secs = (own && restart != Restart::Never).then_some(HEALTH_SECS);
        Policy {
            restart,
            restarts: self.restarts.unwrap_or(restarts),
            window_secs: self.window_secs.unwrap_or(window_secs),
            health_secs: self.health_secs.unwrap_or(health_secs),
        }
    }
}

impl SaidOfBroker {
    /// Takes an attribute of the Scenario; `None`: it is none of its broker.
    pub fn take(&mut self, name: &str, value: &str) -> Option<Result<(), ValueError>> {
        match name {
            "broker-restarts" => Some(count(value).map(|count| self.restarts = Some(count))),
            "broker-window" => Some(span(value).map(|secs| self.window_secs = Some(secs))),
            "mailbox" => Some(integer(MAILBOX, value, MAILBOX_MB).map(|mb| self.mailbox_mb = Some(mb))),
            "time-warp" => Some(number(WARP, value, 1.0).map(|warp| self.time_warp = Some(warp))),
            _ => None,
        }
    }

    /// The policy of the broker.
    pub fn policy(&self) -> Policy {
        let Policy { restarts, window_secs, .. } = Policy::BROKER;
        let (restarts, window_secs) = (self.restarts.unwrap_or(restarts), self.window_secs.unwrap_or(window_secs));
        Policy { restarts, window_secs, ..Policy::BROKER }
    }

    /// Mail that the broker keeps for each client (MB).
    pub fn mailbox_mb(&self) -> u32 {
        self.mailbox_mb.unwrap_or(MAILBOX_MB)
    }

    /// How many times as fast as the wall's its clock runs.
    pub fn time_warp(&self) -> f64 {
        self.time_warp.unwrap_or(1.0)
    }
}

/// Whether an attribute is one of the broker's, which stand in the Scenario.
pub(crate) fn is_of_broker(name: &str) -> bool {
    OF_BROKER.iter().any(|attribute| attribute.name == name)
}

/// The attribute of a policy that `name` is most likely a slip of.
pub(crate) fn meant(name: &str) -> Option<&'static str> {
    nearest(name, OF_APP.iter().map(|attribute| attribute.name))
}

fn restart(value: &str) -> Result<Restart, ValueError> {
    let known = RESTART.map(|(word, _)| word);
    let found = RESTART.iter().find(|(word, _)| *word == value);
    found.map(|(_, restart)| *restart).ok_or_else(|| {
        let right = instead(value, &known);
        ValueError::new(format!("{value:?} is not offered"), right)
    })
}

fn count(value: &str) -> Result<u32, ValueError> {
    integer(COUNT, value, Policy::default().restarts)
}

/// A whole number of this kind.
pub(crate) fn integer(kind: Kind, value: &str, default: u32) -> Result<u32, ValueError> {
    match kind.parse(value, Path::new(""))? {
        ParamValue::Integer(count) => Ok(u32::try_from(count).unwrap_or(u32::MAX)),
        _ => Ok(default),
    }
}

fn span(value: &str) -> Result<f64, ValueError> {
    number(SPAN, value, Policy::default().window_secs)
}

fn number(kind: Kind, value: &str, default: f64) -> Result<f64, ValueError> {
    match kind.parse(value, Path::new(""))? {
        ParamValue::Number(number) => Ok(number),
        _ => Ok(default),
    }
}

fn health(value: &str) -> Result<f64, ValueError> {
    span(value).map_err(|error| error.or(OFF))
}

impl Restart {
    /// The word for it in a mission file.
    pub fn word(self) -> &'static str {
        RESTART.iter().find(|(_, restart)| *restart == self).map_or("never", |(word, _)| word)
    }

    /// The restart that a word of a mission file means.
    pub fn of_word(word: &str) -> Option<Self> {
        RESTART.iter().find(|(known, _)| *known == word).map(|(_, restart)| *restart)
    }
}
