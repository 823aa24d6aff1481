//! The JSON of types whose bytes are packed: what people read instead of numbers in bits.

use elk_bus::Payload;
use elk_bus::codec::{self, DecodeError};
use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{as_json, counted, encoded};
use crate::bricks::BRICK_CELLS;
use crate::map::{BrickStates, MapUpdate, State};
use crate::pose::Pose;
use crate::scan::{Points, Scan};

/// A scan with its points written out.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Scan")]
pub(super) struct ScanForm {
    id: u64,
    command: u64,
    pose: Pose,
    range_m: f64,
    measured: u64,
    no_return: Value,
    points: Value,
}

impl ScanForm {
    pub(super) fn read(bytes: &[u8], longest: usize) -> Result<Value, DecodeError> {
        let Scan { id, command, pose, range_m, measured, no_return, points } = codec::decode(bytes, Scan::NAME)?;
        let (no_return, points) = (listed(&no_return, "directions", longest), listed(&points, "points", longest));
        as_json(&Self { id, command, pose, range_m, measured, no_return, points }, Scan::NAME)
    }

    pub(super) fn write(json: &Value) -> Result<Vec<u8>, String> {
        let form = Self::deserialize(json).map_err(|error| error.to_string())?;
        let Self { id, command, pose, range_m, measured, no_return, points } = form;
        let (no_return, points) = (unlisted(&no_return, "directions")?, unlisted(&points, "points")?);
        encoded(&Scan { id, command, pose, range_m, measured, no_return, points })
    }
}

fn listed(points: &Points<'_>, what: &str, longest: usize) -> Value {
    match points.len() {
        many if many > longest => counted(many, what),
        _ => points.iter().map(|p| Value::from([p.x, p.y, p.z].map(shortest).to_vec())).collect(),
    }
}

fn unlisted(list: &Value, what: &str) -> Result<Points<'static>, String> {
    let points: Vec<[f32; 3]> =
        Vec::deserialize(list).map_err(|error| format!("the {what} are no list of [x, y, z]: {error}"))?;
    Ok(points.into_iter().map(Point3::from).collect())
}

/// The number that people write for an f32: 0.1 and not 0.10000000149011612. It reads back as the same f32.
fn shortest(single: f32) -> f64 {
    let exact = f64::from(single);
    single.to_string().parse().ok().filter(|short: &f64| *short as f32 == single).unwrap_or(exact)
}

/// A map's update with its cells written out.
#[derive(Serialize, Deserialize)]
#[serde(rename = "MapUpdate")]
pub(super) struct MapUpdateForm {
    revision: u64,
    since: u64,
    scan: u64,
    resolution: f64,
    bricks: Value,
}

/// A brick's cells, a character each.
#[derive(Serialize, Deserialize)]
#[serde(rename = "brick")]
struct BrickForm {
    brick: [i16; 3],
    cells: String,
}

impl MapUpdateForm {
    pub(super) fn read(bytes: &[u8], longest: usize) -> Result<Value, DecodeError> {
        let MapUpdate { revision, since, scan, resolution, bricks } = codec::decode(bytes, MapUpdate::NAME)?;
        let bricks = match bricks.len() {
            many if many > longest => counted(many, "bricks"),
            _ => {
                as_json(&bricks.iter().map(|brick| BrickForm::of(brick, longest)).collect::<Vec<_>>(), MapUpdate::NAME)?
            }
        };
        as_json(&Self { revision, since, scan, resolution, bricks }, MapUpdate::NAME)
    }

    pub(super) fn write(json: &Value) -> Result<Vec<u8>, String> {
        let Self { revision, since, scan, resolution, bricks } =
            Self::deserialize(json).map_err(|error| error.to_string())?;
        let bricks: Vec<BrickForm> =
            Vec::deserialize(&bricks).map_err(|error| format!("the bricks are no list of bricks: {error}"))?;
        let bricks = bricks.iter().map(BrickForm::packed).collect::<Result<_, _>>()?;
        encoded(&MapUpdate { revision, since, scan, resolution, bricks })
    }
}

/// What each state is written as.
const CELLS: [(State, char); 3] = [(State::Unknown, '?'), (State::Free, '.'), (State::Occupied, '#')];

impl BrickForm {
    fn of(brick: &BrickStates, longest: usize) -> Self {
        if BRICK_CELLS > longest {
            return Self { brick: brick.brick, cells: format!("{BRICK_CELLS} cells") };
        }
        let character = |cell| CELLS.iter().find(|(state, _)| *state == brick.state(cell)).map_or('?', |(_, c)| *c);
        Self { brick: brick.brick, cells: (0..BRICK_CELLS).map(character).collect() }
    }

    /// Cells that the text leaves out at its end are unknown.
    fn packed(&self) -> Result<BrickStates, String> {
        let mut states = [State::Unknown; BRICK_CELLS];
        for (at, character) in self.cells.chars().enumerate() {
            let state = CELLS.iter().find(|(_, c)| *c == character).map(|(state, _)| *state);
            let state =
                state.ok_or_else(|| format!("{character:?} is no cell: ? is unknown, . is free, # is occupied"))?;
            *states.get_mut(at).ok_or_else(|| format!("a brick has {BRICK_CELLS} cells, not more"))? = state;
        }
        Ok(BrickStates::pack(self.brick.map(i32::from).into(), &states))
    }
}
