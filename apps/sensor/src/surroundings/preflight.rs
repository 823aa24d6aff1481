//! Whether a simulated mission can be run in its world, looked at before anything starts.

use elk_bus::AppError;
use elk_geometry::Bounds;
use elk_mission::{AppSpec, Mission, Params, PreflightReport, element};
use elk_world::suitability::{Suitability, Wanted, suitability};
use nalgebra::{Point3, Vector3};

use super::parameters::{start, world};

/// The map's parameters where the mission has a map of another kind.
const RESOLUTION_M: f64 = 0.1;

/// Loads the world, and sees that the robot can start in it, and that map and filters have something of what it sees
/// there.
pub(crate) fn preflight(params: &Params, mission: &Mission) -> PreflightReport {
    let look = || -> Result<Suitability, AppError> {
        let world = world(params)?;
        let start = start(params, &world)?;
        Ok(suitability(&world, &wanted(start.position(), params, mission)))
    };
    let named = |what: String| format!("World {}: {what}", params.text("World"));
    match look() {
        Ok(Suitability { faults, warnings }) => PreflightReport {
            faults: faults.into_iter().map(named).collect(),
            warnings: warnings.into_iter().map(named).collect(),
        },
        Err(error) => PreflightReport::fault(error),
    }
}

/// What the sensor itself and the mission's other apps, whose parameters are checked, say of it.
fn wanted(start: Point3<f64>, params: &Params, mission: &Mission) -> Wanted {
    let map = mission.of_element(element::MAP).next();
    Wanted {
        resolution: map.and_then(|map| number(map, "Res")).filter(|res| *res > 0.0).unwrap_or(RESOLUTION_M),
        start: Some(start),
        range_m: map.map_or(f64::INFINITY, |map| range_m(map, params, mission)),
        volume: mission.of_element(element::EXPLORER).find_map(|app| volume(app.setting("Mid")?, app.setting("Dim")?)),
    }
}

fn number(app: &AppSpec, param: &str) -> Option<f64> {
    app.setting(param)?.parse().ok()
}

/// How far (m) what comes into the map is from the sensor, at most: as its own range, the map's, and those of the filters
/// say that are between the two.
fn range_m(map: &AppSpec, params: &Params, mission: &Mission) -> f64 {
    let limits = [number(map, "MaxRange"), Some(params.number("Range"))].into_iter().flatten();
    let mut range = limits.filter(|limit| *limit > 0.0).fold(f64::INFINITY, f64::min);
    let mut input = map.setting("Input");
    let filters: Vec<&AppSpec> = mission.of_element(element::FILTER).collect();
    // Each filter once: they may read each other in a circle.
    for _ in &filters {
        let Some(before) = filters.iter().find(|filter| filter.setting("Output") == input) else { break };
        range = range.min(number(before, "Threshold").unwrap_or(f64::INFINITY));
        input = before.setting("Input");
    }
    match input == Some(params.text("Output")) {
        true => range,
        false => f64::INFINITY,
    }
}

/// The volume to explore, if one is said.
fn volume(mid: &str, dim: &str) -> Option<Bounds> {
    let point = |text: &str| -> Option<[f64; 3]> {
        let numbers: Option<Vec<f64>> = text.split(';').map(|number| number.trim().parse().ok()).collect();
        numbers?.try_into().ok()
    };
    let dim = Vector3::from(point(dim)?);
    (dim != Vector3::zeros()).then_some(Bounds::from_mid_dim(point(mid)?.into(), dim))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use elk_bus::{App, AppError};
    use elk_mission::{AppType, Kind, ParamSpec, Registry};

    use super::*;

    fn unbuilt(_: &Params) -> Result<Box<dyn App>, AppError> {
        Err("it is only looked at".into())
    }

    const fn row(element: &'static str, params: &'static [ParamSpec]) -> AppType {
        let preflight = Some((|_, _| PreflightReport::default()) as elk_mission::Preflight);
        AppType { element, name: "Plain", summary: "Is looked at.", params, build: unbuilt, preflight }
    }

    const fn metres(name: &'static str, default: &'static str) -> ParamSpec {
        ParamSpec {
            name,
            kind: Kind::Number { unit: "m", min: 0.0, max: 1e4 },
            default: Some(default),
            doc: "A length.",
        }
    }

    const fn variable(name: &'static str, default: Option<&'static str>) -> ParamSpec {
        ParamSpec { name, kind: Kind::Variable, default, doc: "A variable." }
    }

    const INPUT: ParamSpec = variable("Input", None);
    const OUTPUT: ParamSpec = variable("Output", None);

    static OTHERS: &[AppType] = &[
        row("Filter", &[metres("Threshold", "10"), INPUT, OUTPUT]),
        row("Map", &[metres("Res", "0.1"), metres("MaxRange", "0"), INPUT]),
        row("Explorer", &[]),
        row("Controller", &[]),
    ];

    /// Whether it is said that nothing is seen from the start, in the car, whose next surface is about a metre away.
    fn sees_nothing(filters_and_map: &str) -> bool {
        let text = format!(
            "<Scenario><Sensor type=\"Simulator\"/>{filters_and_map}<Explorer type=\"Plain\"/>\
             <Controller type=\"Plain\"/></Scenario>"
        );
        let registry = Registry::new(&[crate::TYPES, OTHERS]);
        let mission = Mission::parse(&text, Path::new("m.xml"), &registry, &[]).unwrap();
        let notes = mission.preflight().unwrap();
        notes.iter().any(|note| note.contains("nothing is seen from the start"))
    }

    /// Regression: a filter counted that the map does not read.
    #[test]
    fn what_is_between_sensor_and_map_says_how_far_it_sees() {
        let near = "<Filter type=\"Plain\" Threshold=\"0.2\"/>";
        let far = "<Filter type=\"Plain\" name=\"Far\"/>";
        let aside = "<Filter type=\"Plain\" Threshold=\"0.2\" Output=\"NEAR\"/>";
        for (filters, map, expected) in [
            ("", "", false),
            ("", "MaxRange=\"0.2\"", true),
            (near, "", true),
            (&format!("{near}{far}"), "", true),
            (&format!("{far}{near}"), "", true),
            (near, "Input=\"SCAN\"", false),
            (&format!("{aside}<Filter type=\"Plain\" name=\"Far\" Input=\"SCAN\"/>"), "", false),
            (aside, "Input=\"NEAR\"", true),
        ] {
            let found = sees_nothing(&format!("{filters}<Map type=\"Plain\" {map}/>"));
            assert_eq!(found, expected, "{filters} {map}");
        }
    }
}
