//! What follows from the other apps where the mission does not say: who reads whose scans, where frontiers count, and what
//! two apps have to have in common.

use elk_geometry::clearance::{Clearance, MAX_RADIUS_VOXELS};
use elk_spatial::checks;

use crate::draft::Draft;
use crate::element;
use crate::params::ParamValue;
use crate::problem::{At, Findings};
use crate::resolve::Given;
use crate::spec::Mode;
use crate::variables::{self, SCAN};

/// Parameters that are the same for both elements: said of one, they hold for the other.
const COMMON: [(&str, [&str; 2]); 3] = [
    ("Res", [element::MAP, element::EXPLORER]),
    ("MaxBricks", [element::MAP, element::EXPLORER]),
    ("MOOSPoseVarName", [element::SENSOR, element::CONTROLLER]),
];

/// Parameters that say something only together, as middle and size of a volume.
const TOGETHER: [&str; 2] = ["Mid", "Dim"];

/// Sets `Input` and `Output` of the filters and `Input` of the map: the first filter reads what the sensor publishes and
/// publishes `SCAN_1`, each later one reads what the one before it publishes, and the map reads the last. `Mid` and `Dim` are
/// the volume to explore and that in which the map counts frontiers: said of one of the two, they hold for both. What two
/// apps have to have in common goes from the one that says it to the other; that they say it differently is a problem.
pub(crate) fn connect(drafts: &mut [Draft], problems: &mut Findings) {
    let sensor = drafts.iter().find(|draft| draft.element == element::SENSOR);
    let published = sensor.and_then(|sensor| sensor.said_or_default("Output"));
    // What is no variable's name is a problem where it stands, and not of those who would read it.
    let mut last = published.filter(|name| variables::is_name(name)).unwrap_or(SCAN).to_owned();
    let filters = drafts.iter_mut().filter(|draft| draft.element == element::FILTER);
    for (k, filter) in (1..).zip(filters) {
        filter.suppose("Input", &last);
        filter.suppose("Output", &format!("{SCAN}_{k}"));
        last = filter.said("Output").filter(|name| variables::is_name(name)).unwrap_or(&last).to_owned();
    }
    for map in drafts.iter_mut().filter(|draft| draft.element == element::MAP) {
        map.suppose("Input", &last);
    }
    drafts.iter().for_each(|draft| both_or_neither(draft, problems));
    for bound in TOGETHER {
        hand_on(drafts, bound, [element::EXPLORER, element::MAP]);
        hand_on(drafts, bound, [element::MAP, element::EXPLORER]);
    }
    for (param, [one, other]) in COMMON {
        hand_on(drafts, param, [one, other]);
        hand_on(drafts, param, [other, one]);
        agree(drafts, param, [one, other], problems);
    }
    for draft in drafts.iter() {
        affordable(draft, problems);
        within_range(draft, problems);
    }
}

/// What a number is, and where it is said if it is not the default.
fn number<'a>(draft: &'a Draft, param: &str) -> Option<(f64, Option<&'a Given>)> {
    match draft.value(param) {
        Some((ParamValue::Number(value), given)) => Some((value, Some(given))),
        Some(_) => None,
        None => Some((draft.said_or_default(param)?.parse().ok()?, None)),
    }
}

/// One of [`TOGETHER`] alone would do nothing, or something else than was meant; one that is as it is anyway says nothing.
fn both_or_neither(draft: &Draft, problems: &mut Findings) {
    let [mid, dim] = TOGETHER;
    for (said, missing) in [(mid, dim), (dim, mid)] {
        let (Some((value, given)), Some(spec), Some(other)) =
            (draft.value(said), draft.spec(said), draft.spec(missing))
        else {
            continue;
        };
        let usual = spec.default.and_then(|text| spec.kind.parse(text, "".as_ref()).ok());
        if other.default.is_some() && draft.said(missing).is_none() && usual != Some(value) {
            let words =
                format!("{said} without {missing}; right is both, the middle ({mid}) and the size ({dim}) of a volume");
            problems.add(&given.at, words);
        }
    }
}

/// What a map frees without a return is no farther than it believes of any ray.
fn within_range(draft: &Draft, problems: &mut Findings) {
    let (Some((free, said)), Some((most, most_said))) = (number(draft, "FreeNoReturn"), number(draft, "MaxRange"))
    else {
        return;
    };
    if let (Some(given), Err(beyond)) = (said.or(most_said), checks::within_range(free, most)) {
        problems.add(&given.value_at, beyond.to_string());
    }
}

/// A robot's `Radius` and the voxels' `Res` go together.
fn affordable(draft: &Draft, problems: &mut Findings) {
    let (Some((radius, said)), Some((res, res_said))) = (number(draft, "Radius"), number(draft, "Res")) else {
        return;
    };
    if let Some(given) = said.or(res_said).filter(|_| !Clearance::affordable(radius, res)) {
        let most = MAX_RADIUS_VOXELS;
        let said = format!(
            "Radius {radius} m are more than {most} voxels of {res} m (Res); right is a smaller Radius or a larger Res"
        );
        problems.add(&given.value_at, said);
    }
}

/// What the controller is told of waiting for a person, if it is: that holds whatever the Scenario's type says.
pub(crate) fn manual(drafts: &[Draft]) -> Option<Mode> {
    let mut controllers = drafts.iter().filter(|draft| draft.element == element::CONTROLLER);
    match controllers.find_map(|draft| draft.value("Manual"))? {
        (ParamValue::Flag(true), _) => Some(Mode::Manual),
        (ParamValue::Flag(false), _) => Some(Mode::Auto),
        _ => None,
    }
}

/// What was said of a parameter for the apps of one element goes to those of another of which nothing was said. What is
/// wrong is reported where it stands, not here as well.
fn hand_on(drafts: &mut [Draft], param: &str, [from, to]: [&str; 2]) {
    let mut givers = drafts.iter().filter(|draft| draft.element == from);
    if let Some(given) = givers.find_map(|draft| draft.given_right(param)).cloned() {
        drafts.iter_mut().filter(|draft| draft.element == to).for_each(|draft| draft.hand(&given));
    }
}

fn agree(drafts: &[Draft], param: &str, [one, other]: [&str; 2], problems: &mut Findings) {
    let find = |element: &str| drafts.iter().find(|draft| draft.element == element);
    let (Some(first), Some(second)) = (find(one), find(other)) else { return };
    if let Some(([right, text], at)) = at_odds(first, second, param) {
        let said = format!("{param}: {text:?} is not the {one}'s {right:?}; right is the same for {one} and {other}");
        problems.add(at, said);
    }
}

/// What a map holds is of its voxels' size, and so is what others have of it: who takes its place in mid-mission keeps
/// that.
pub(crate) fn keeps_resolution(old: &Draft, new: &Draft, problems: &mut Findings) {
    const RES: &str = "Res";
    if old.element == element::MAP
        && let Some(([right, text], at)) = at_odds(old, new, RES)
    {
        let name = old.name();
        let said = format!("{RES}: {text:?} is not the {name}'s {right:?}; right is the same while the mission runs");
        problems.add(at, said);
    }
}

/// What is said of a parameter to two apps, if it is not the same, and where the second is told.
fn at_odds<'a>(first: &'a Draft, second: &'a Draft, param: &str) -> Option<([&'a str; 2], &'a At)> {
    let spec = first.spec(param).or_else(|| second.spec(param))?;
    let ((value, given), (other, of_other)) = (first.value_as(spec, param)?, second.value_as(spec, param)?);
    (value != other).then_some(([given.text.as_str(), of_other.text.as_str()], &of_other.value_at))
}
