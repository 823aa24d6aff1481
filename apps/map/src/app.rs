//! The process around the map: scans in, what they changed out.

use std::path::{Path, PathBuf};

use elk_bus::clock::thread_cpu_secs;
use elk_bus::{App, AppError, Comms, Key, Mail};
use elk_mission::{AppType, Kind, ParamSpec, Params};
use elk_spatial::keys::{MAP, MAP_KNOWN, MAP_REQUEST, MAP_UPDATE};
use elk_spatial::messages::MapStatus;
use elk_spatial::{Bounds, Scan};
use nalgebra::Vector3;

use crate::bt::write_bt;
use crate::insertion::Dropped;
use crate::occupancy::{Grazing, MapConfig, OccupancyMap};

/// The maps that a mission can name.
pub static TYPES: &[AppType] = &[AppType {
    element: "Map",
    name: "OctoMap",
    summary: "Log-odds occupancy of voxels, with its frontier; writes OctoMap's .bt files.",
    params: PARAMS,
    build: |params| Ok(Box::new(MapApp::new(params)?)),
}];

const fn number(
    name: &'static str,
    (unit, min, max): (&'static str, f64, f64),
    default: &'static str,
    doc: &'static str,
) -> ParamSpec {
    ParamSpec { name, kind: Kind::Number { unit, min, max }, default: Some(default), doc }
}

const fn point(name: &'static str, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind: Kind::Point { unit: "m" }, default: Some("0; 0; 0"), doc }
}

const PARAMS: &[ParamSpec] = &[
    number("Res", ("m", 0.001, 10.0), "0.1", "Edge of a voxel."),
    ParamSpec {
        name: "Input",
        kind: Kind::Variable,
        default: Some("SCAN"),
        doc: "The variable of the scans to insert: the sensor's, or the last filter's.",
    },
    ParamSpec {
        name: "Grazing",
        kind: Kind::Choice(&["guard", "sticky", "none"]),
        default: Some("guard"),
        doc: "Which voxels passing rays spare: once hit and beside a hit of the same scan (guard), once hit (sticky: \
              only without noise), none (plain log-odds).",
    },
    number(
        "MaxRange",
        ("m", 0.0, 1e4),
        "0",
        "Farther points are no hits, their rays free only up to here; 0: no limit.",
    ),
    point("Mid", "Middle of the volume in which frontiers count."),
    point("Dim", "Size of the volume in which frontiers count; all 0: everywhere."),
    number("LogOddsHit", ("", 0.01, 10.0), "0.85", "Added to a voxel that a scan hit."),
    number("LogOddsMiss", ("", -10.0, -0.01), "-0.4", "Added to a voxel that a scan's rays only passed."),
    number("ClampMin", ("", -100.0, 0.0), "-2", "Smallest log-odds of a voxel."),
    number("ClampMax", ("", 0.01, 100.0), "3.5", "Largest log-odds of a voxel."),
    ParamSpec {
        name: "File",
        kind: Kind::Text,
        default: Some(""),
        doc: "Where to write the map as a .bt file when the mission ends; empty: nowhere.",
    },
];

/// The map's settings as a mission gives them.
fn config(params: &Params) -> Result<MapConfig, AppError> {
    let dim = Vector3::from(params.point("Dim"));
    let bounds = (dim != Vector3::zeros()).then(|| Bounds::from_mid_dim(params.point("Mid").into(), dim));
    if bounds.is_some() && dim.iter().any(|edge| *edge <= 0.0) {
        return Err(format!(
            "Dim is {}; {}; {} m: all three must be positive, or all 0 for no bounds",
            dim.x, dim.y, dim.z
        )
        .into());
    }
    Ok(MapConfig {
        resolution: params.number("Res"),
        hit: params.number("LogOddsHit") as f32,
        miss: params.number("LogOddsMiss") as f32,
        clamp_min: params.number("ClampMin") as f32,
        clamp_max: params.number("ClampMax") as f32,
        grazing: match params.text("Grazing") {
            "none" => Grazing::None,
            "sticky" => Grazing::Sticky,
            _ => Grazing::Guard,
        },
        max_range: params.number("MaxRange"),
        bounds,
    })
}

struct MapApp {
    map: OccupancyMap,
    input: Key<Scan<'static>>,
    file: Option<PathBuf>,
    last_scan: u64,
    cpu_secs: f64,
}

impl MapApp {
    fn new(params: &Params) -> Result<Self, AppError> {
        let file = params.text("File");
        Ok(Self {
            map: OccupancyMap::new(config(params)?),
            input: Key::named(params.text("Input")),
            file: (!file.is_empty()).then(|| file.into()),
            last_scan: 0,
            cpu_secs: 0.0,
        })
    }

    fn insert(&mut self, comms: &mut Comms, scan: &Scan<'_>) -> Result<(), AppError> {
        if scan.id == self.last_scan {
            eprintln!("{}: scan {} came twice; the second one is left out", comms.name(), scan.id);
            return Ok(());
        }
        if scan.id != self.last_scan + 1 {
            let (name, last) = (comms.name(), self.last_scan);
            eprintln!("{name}: scan {} follows scan {last}: scans were lost, or the sensor started again", scan.id);
        }
        self.last_scan = scan.id;
        let start = thread_cpu_secs();
        let seen = self.map.insert(scan.pose.position(), scan.world_points());
        self.cpu_secs += thread_cpu_secs() - start;
        if seen.dropped != Dropped::default() {
            let Dropped { invalid, out_of_range } = seen.dropped;
            eprintln!(
                "{}: scan {}: {invalid} points are not finite or at the camera itself, {out_of_range} lie beyond the \
                 map's 65536 voxels an axis; left out",
                comms.name(),
                scan.id
            );
        }
        comms.publish(&MAP_UPDATE, &self.map.advance(&seen.changed, scan.id))?;
        comms.publish(&MAP_KNOWN, &self.status())?;
        Ok(())
    }

    fn status(&self) -> MapStatus {
        let grid = self.map.grid();
        MapStatus {
            revision: grid.revision(),
            free: grid.free() as u64,
            occupied: grid.occupied() as u64,
            frontier: self.map.frontier_len() as u64,
            resolution: grid.resolution(),
            cpu_secs: self.cpu_secs,
        }
    }

    fn publish_whole(&self, comms: &mut Comms) -> Result<(), AppError> {
        comms.publish(&MAP, &self.map.grid().whole(self.last_scan))?;
        Ok(())
    }

    fn save(&self, path: &Path) -> Result<(), AppError> {
        let write = || {
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder)?;
            }
            let mut bytes = Vec::new();
            write_bt(&mut bytes, &self.map.occupancy_tree(), self.map.config().resolution)?;
            std::fs::write(path, bytes)
        };
        let name = path.display();
        write().map_err(|e| format!("cannot write the map to {name}: {e}; choose another File").into())
    }
}

impl App for MapApp {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        comms.register(&self.input)?;
        comms.register_variable(MAP_REQUEST, 0.0)?;
        Ok(())
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        if mail.key() == MAP_REQUEST {
            return self.publish_whole(comms);
        }
        if mail.is(&self.input) {
            self.insert(comms, &mail.decode(&self.input)?)?;
        }
        Ok(())
    }

    fn on_stop(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        if let Some(path) = &self.file {
            self.save(path)?;
        }
        self.publish_whole(comms)
    }
}
