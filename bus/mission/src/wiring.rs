//! What follows from the other apps where the mission does not say: who reads whose scans, and where frontiers count.

use std::path::Path;

use crate::draft::Draft;
use crate::spec::Kind;

/// What the sensor publishes its scans under, if its type does not say.
const SCAN: &str = "SCAN";

/// Sets `Input` and `Output` of the filters and `Input` of the map: the first filter reads what the sensor publishes and
/// publishes `SCAN_1`, each later one reads what the one before it publishes, and the map reads the last. `Mid` and `Dim` of
/// the map, the volume in which frontiers count, are the explorer's.
pub(crate) fn connect(drafts: &mut [Draft]) {
    let sensor = drafts.iter().find(|draft| draft.element == "Sensor");
    let published = sensor.and_then(|sensor| sensor.said_or_default("Output"));
    let mut last = published.unwrap_or(SCAN).to_owned();
    let filters = drafts.iter_mut().filter(|draft| draft.element == "Filter");
    for (k, filter) in (1..).zip(filters) {
        filter.suppose("Input", &last);
        filter.suppose("Output", &format!("{SCAN}_{k}"));
        last = filter.said("Output").unwrap_or(&last).to_owned();
    }
    for map in drafts.iter_mut().filter(|draft| draft.element == "Map") {
        map.suppose("Input", &last);
    }
    for bound in ["Mid", "Dim"] {
        share_bound(drafts, bound);
    }
}

fn share_bound(drafts: &mut [Draft], bound: &str) {
    let mut explorers = drafts.iter().filter(|draft| draft.element == "Explorer");
    let said = explorers.find_map(|explorer| explorer.said(bound)).map(str::to_owned);
    // What is no point is reported where it stands, not here as well.
    let is_point = |text: &String| Kind::Point { unit: "m" }.parse(text, Path::new("")).is_ok();
    if let Some(said) = said.filter(is_point) {
        for map in drafts.iter_mut().filter(|draft| draft.element == "Map" && draft.is_builtin()) {
            map.suppose(bound, &said);
        }
    }
}
