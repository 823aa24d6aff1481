//! The variables that a mission names: one variable carries one thing, and what is read somebody writes.

use std::collections::BTreeMap;
use std::path::Path;

use elk_bus::Payload;
use elk_bus::rejection::REJECTED;
use elk_spatial::Scan;
use elk_spatial::keys::{self, CAMERA_POSE};
use elk_spatial::messages::CameraPose;

use crate::draft::Draft;
use crate::element;
use crate::kind::Kind;
use crate::problem::{At, Findings};

/// Launcher to the next one: all that it takes to pick the mission up (JSON).
pub const LAUNCH_STATE: &str = "LAUNCH_STATE";
/// Logger to anyone: why the log cannot be written; empty: it can again.
pub const LOGGER_ERROR: &str = "LOGGER_ERROR";

/// Texts that every run has besides those of the exploration itself ([`keys::PLAIN`]).
const OF_EVERY_RUN: [&str; 3] = [LAUNCH_STATE, LOGGER_ERROR, REJECTED];
/// What the sensor publishes its scans under, if its type does not say.
pub(crate) const SCAN: &str = "SCAN";
/// What every app says of itself is called after it.
const STATUS: &str = "_STATUS";

/// A parameter that names a variable which apps of an element write.
struct Written {
    element: &'static str,
    param: &'static str,
    /// The type that the variable then carries.
    carried: &'static str,
    /// What those of elk's types write that have no such parameter.
    otherwise: Option<&'static str>,
}

const SCANS: &str = <Scan<'_> as Payload>::NAME;
const WRITTEN: [Written; 3] = [
    Written { element: element::SENSOR, param: "Output", carried: SCANS, otherwise: Some(SCAN) },
    Written { element: element::FILTER, param: "Output", carried: SCANS, otherwise: None },
    Written {
        element: element::SENSOR,
        param: "MOOSPoseVarName",
        carried: CameraPose::NAME,
        otherwise: Some(CAMERA_POSE),
    },
];

impl Written {
    /// The variable that an app writes, if it is of this element, and where that is said.
    fn by<'a>(&self, draft: &'a Draft) -> Option<(&'a str, &'a At)> {
        let otherwise = || self.otherwise.filter(|_| draft.is_builtin());
        let name = (draft.element == self.element).then(|| draft.said_or_default(self.param).or_else(otherwise))??;
        Some((name, draft.value_at(self.param)))
    }
}

/// Parameters that name a variable of scans which an app of this element reads.
const READ: [(&str, &str); 2] = [(element::FILTER, "Input"), (element::MAP, "Input")];

/// Whether a parameter can name a variable so.
pub(crate) fn is_name(name: &str) -> bool {
    Kind::Variable.parse(name, Path::new("")).is_ok()
}

/// Sees that no two apps write different things under one name, and that whoever reads scans reads what somebody of the
/// mission publishes.
pub(crate) fn check(drafts: &[Draft], problems: &mut Findings) {
    let mut written: BTreeMap<&str, String> = BTreeMap::new();
    for draft in drafts {
        for one in &WRITTEN {
            if let Some((name, at)) = one.by(draft) {
                let param = one.param;
                let who = format!("{} ({param})", draft.name());
                if let Err(said) = may_write(name, one.carried) {
                    problems.add(at, format!("{param}: {said}"));
                } else if let Some(other) = written.get(name) {
                    problems.add(at, format!("{param}: {name} is written by {other} already; right is another name"));
                }
                written.entry(name).or_insert(who);
            }
        }
    }
    // A program of somebody else's may publish anything; what is unknown, or no name, is a problem of its own.
    if drafts.iter().all(Draft::is_known) && written.keys().all(|name| is_name(name)) {
        read_what_is_written(drafts, problems);
    }
}

/// Whether values of the type `carried` may be written under `name`.
fn may_write(name: &str, carried: &str) -> Result<(), String> {
    let elses = match keys::carried_by(name) {
        Some(other) if other != carried => format!("{other} values"),
        None if keys::is_strategy_memory(name) => "what a strategy remembers".to_owned(),
        None if keys::PLAIN.contains(&name) || OF_EVERY_RUN.contains(&name) || name.ends_with(STATUS) => {
            "what apps say to each other".to_owned()
        }
        _ => return Ok(()),
    };
    Err(format!("{name} carries {elses} in every mission; right is a name of its own"))
}

fn read_what_is_written(drafts: &[Draft], problems: &mut Findings) {
    let of_scans = |draft| WRITTEN.iter().filter(|one| one.carried == SCANS).filter_map(move |one| one.by(draft));
    let published: Vec<&str> = drafts.iter().flat_map(of_scans).map(|(name, _)| name).collect();
    for draft in drafts {
        for (element, param) in READ {
            if draft.element == element
                && let Some(name) = draft.said_or_default(param).filter(|name| is_name(name))
                && !published.contains(&name)
                // A mission without a sensor is a problem of its own.
                && !published.is_empty()
            {
                let known = published.join(", ");
                let at = draft.value_at(param);
                problems.add(at, format!("{param}: nobody in the mission publishes {name}; published are {known}"));
            }
        }
    }
}
