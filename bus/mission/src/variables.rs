//! The variables that a mission names: one variable carries one thing, and what is read somebody writes.

use std::collections::BTreeMap;
use std::path::Path;

use elk_bus::Payload;
use elk_spatial::keys::{CAMERA_POSE, MAP_RECALL, MAP_REQUEST, MOTION, STEP};
use elk_spatial::messages::CameraPose;
use elk_spatial::{Scan, catalogue};

use crate::draft::Draft;
use crate::problem::{Place, Problems};
use crate::spec::Kind;
use crate::wiring::SCAN;

/// Variables of an exploration that carry texts and numbers. Those that carry a type are in [`catalogue`].
const PLAIN: [&str; 7] = [MOTION, STEP, MAP_REQUEST, MAP_RECALL, "LAUNCH_STATE", "LOGGER_ERROR", "MAIL_REJECTED"];
/// What every app says of itself is called after it.
const STATUS: &str = "_STATUS";

/// Parameters that name a variable which an app of this element writes, and the type that it then carries.
const WRITTEN: [(&str, &str, &str); 3] = [
    ("Sensor", "Output", <Scan<'_> as Payload>::NAME),
    ("Filter", "Output", <Scan<'_> as Payload>::NAME),
    ("Sensor", "MOOSPoseVarName", CameraPose::NAME),
];
/// Parameters that name a variable of scans which an app of this element reads.
const READ: [(&str, &str); 2] = [("Filter", "Input"), ("Map", "Input")];

/// Whether the broker writes a variable itself.
pub(crate) fn is_of_the_broker(name: &str) -> bool {
    name.starts_with("DB_")
}

/// Whether a parameter can name a variable so.
pub(crate) fn is_name(name: &str) -> bool {
    Kind::Variable.parse(name, Path::new("")).is_ok()
}

/// Sees that no two apps write different things under one name, and that whoever reads scans reads what somebody of the
/// mission publishes.
pub(crate) fn check(drafts: &[Draft], problems: &mut Problems) {
    let mut written: BTreeMap<&str, String> = BTreeMap::new();
    for draft in drafts {
        for (element, param, carried) in WRITTEN {
            if let Some((name, place)) = of_element(draft, element, param) {
                let who = format!("{} ({param})", draft.name());
                if let Err(said) = may_write(name, carried) {
                    problems.add(place, format!("{param}: {said}"));
                } else if let Some(other) = written.get(name) {
                    problems
                        .add(place, format!("{param}: {name} is written by {other} already; right is another name"));
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
    let elses = match catalogue::carried_by(name) {
        Some(payload) if payload.name != carried => format!("{} values", payload.name),
        None if PLAIN.contains(&name) || name.ends_with(STATUS) => "what apps say to each other".to_owned(),
        _ => return Ok(()),
    };
    Err(format!("{name} carries {elses} in every mission; right is a name of its own"))
}

fn read_what_is_written(drafts: &[Draft], problems: &mut Problems) {
    let outputs = drafts.iter().flat_map(|draft| {
        let said = ["Sensor", "Filter"].map(|element| of_element(draft, element, "Output").map(|(name, _)| name));
        said.into_iter().flatten()
    });
    // A sensor whose type has no word for it publishes where sensors do.
    let silent = drafts.iter().any(|one| one.element == "Sensor" && one.said_or_default("Output").is_none());
    let published: Vec<&str> = silent.then_some(SCAN).into_iter().chain(outputs).collect();
    for draft in drafts {
        for (element, param) in READ {
            if let Some((name, place)) = of_element(draft, element, param)
                && is_name(name)
                && !published.contains(&name)
            {
                let known = published.join(", ");
                problems.add(place, format!("{param}: nobody in the mission publishes {name}; published are {known}"));
            }
        }
    }
}

/// The variable that a parameter of an app of this element names, and where that is said.
fn of_element<'a>(draft: &'a Draft, element: &str, param: &str) -> Option<(&'a str, &'a Place)> {
    if draft.element != element {
        return None;
    }
    let default = if param == "MOOSPoseVarName" { Some(CAMERA_POSE) } else { None };
    let name = draft.said_or_default(param).or(default.filter(|_| draft.is_builtin()))?;
    Some((name, draft.value_place(param)))
}
