//! Whether a simulated mission can be run in its world, looked at before anything starts.

use elk_mission::{Mission, Params, PreflightReport};
use elk_spatial::Bounds;
use elk_world::suitability::{Suitability, Wanted, suitability};
use nalgebra::{Point3, Vector3};

use crate::app::{pixels, start, world};

/// The map's parameters where the mission has a map of another kind.
const RESOLUTION_M: f64 = 0.1;

/// Loads the world, and sees that the robot can start in it, and that map and filters have something of what it sees
/// there.
pub(crate) fn preflight(params: &Params, mission: &Mission) -> PreflightReport {
    let looked = pixels(params).and_then(|_| {
        let world = world(params)?;
        let start = start(params, &world)?;
        Ok(suitability(&world, &wanted(start.position(), params, mission)))
    });
    let named = |what: String| format!("World {}: {what}", params.text("World"));
    match looked {
        Ok(Suitability { faults, warnings }) => PreflightReport {
            faults: faults.into_iter().map(named).collect(),
            warnings: warnings.into_iter().map(named).collect(),
        },
        Err(error) => PreflightReport::fault(error),
    }
}

/// What the sensor itself and the mission's other apps, whose parameters are checked, say of it.
fn wanted(start: Point3<f64>, params: &Params, mission: &Mission) -> Wanted {
    let numbers = |element: &'static str, param: &'static str| {
        mission.of_element(element).filter_map(move |app| app.setting(param)?.parse::<f64>().ok())
    };
    let limits = numbers("Map", "MaxRange").chain([params.number("Range")]).filter(|range| *range > 0.0);
    let ranges = numbers("Filter", "Threshold").chain(limits);
    Wanted {
        resolution: numbers("Map", "Res").next().filter(|res| *res > 0.0).unwrap_or(RESOLUTION_M),
        start: Some(start),
        range_m: ranges.fold(f64::INFINITY, f64::min),
        volume: mission.of_element("Explorer").find_map(|app| volume(app.setting("Mid")?, app.setting("Dim")?)),
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
