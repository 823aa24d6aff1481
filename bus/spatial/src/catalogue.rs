//! The catalogue of typed values: every payload type of elk, with its bytes turned into JSON and back.
//!
//! For whoever sees a value without knowing its type beforehand: a scope, a log's printout, a person who pokes. A type
//! is found by the name that its messages carry; the layout tells whether the bytes are of the same definition.
//!
//! ```
//! use elk_bus::Payload;
//! use elk_spatial::{catalogue, messages::CameraPose};
//!
//! let bytes = catalogue::named("CameraPose").unwrap().from_json(&serde_json::json!({
//!     "command": 3, "pose": {"rotation": [0.0, 0.0, 0.0, 1.0], "translation": [1.0, 2.0, 0.5]},
//! }))?;
//! let json = catalogue::to_json(CameraPose::NAME, CameraPose::LAYOUT, &bytes, usize::MAX)?;
//! assert_eq!(json["pose"]["translation"][1], 2.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The JSON is the type's fields by name, in their order; a pose is `{"rotation": [x, y, z, w], "translation": [x, y, z]}`,
//! an enum its variant's name. Two types have a form of their own: a scan's points and directions are `[[x, y, z], …]`, and the cells of
//! a map's brick a text of 512 characters, x fastest, `?` for unknown, `.` for free, `#` for occupied. JSON has no
//! infinity and no NaN: they become `null`, which is not taken back.

mod forms;

use elk_bus::codec::{self, DecodeError};
use elk_bus::{Key, Payload, ValueRef, pattern};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::keys::CAMERA_POSE;
use crate::map::MapUpdate;
use crate::messages::{
    AccuracyReport, CameraPose, ExplorationReport, ExplorerMemory, MapMemory, MapStatus, MotionMemory, MotionReport,
    Plan, PlanRequest, PoseCommand, Progress, SensorReport,
};
use crate::scan::Scan;
use forms::{MapUpdateForm, ScanForm};

/// Every payload type that elk's apps exchange. A new one gets its line here: see [`crate::keys`].
pub const CATALOGUE: &[PayloadType] = &[
    plain::<PoseCommand>(r#"{"id":1,"via":[],"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]}}"#),
    plain::<CameraPose>(r#"{"command":1,"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]}}"#),
    PayloadType {
        name: Scan::NAME,
        layout: Scan::LAYOUT,
        example: r#"{"id":1,"command":1,"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]},"range_m":5.0,"measured":1,"no_return":[[0.0,0.0,1.0]],"points":[[0.1,-0.2,3.0]]}"#,
        check: check::<Scan<'static>>,
        read: ScanForm::read,
        write: ScanForm::write,
    },
    PayloadType {
        name: MapUpdate::NAME,
        layout: MapUpdate::LAYOUT,
        example: r#"{"revision":1,"since":0,"scan":1,"resolution":0.1,"bricks":[{"brick":[0,0,-1],"cells":"?..#"}]}"#,
        check: check::<MapUpdate>,
        read: MapUpdateForm::read,
        write: MapUpdateForm::write,
    },
    plain::<MapStatus>(
        r#"{"revision":1,"free":8,"occupied":2,"frontier":3,"resolution":0.1,"cpu_secs":0.01,"full":false,"rays":{"no_return":1,"measured":9,"received":9,"invalid":0,"outside":0,"too_far":0,"no_room":0}}"#,
    ),
    plain::<PlanRequest>(
        r#"{"id":1,"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]},"revision":1,"outcome":"First"}"#,
    ),
    plain::<Plan>(
        r#"{"request":1,"revision":1,"decision":{"Go":{"points":[[1.0,2.0,0.5]],"target":{"x":1,"y":2,"z":3},"unknown":[],"looks":[]}},"motion":{"name":"elk","scan_spacing_m":0.5,"early_stop":true,"look_at_target":true,"clearance_m":0.2},"cpu_secs":0.01}"#,
    ),
    plain::<Progress>(r#"{"scan":1,"revision":1,"scans":1,"path_length_m":2.5,"free":8,"finished":false}"#),
    plain::<MotionReport>(
        r#"{"scans":9,"path_length_m":2.5,"free":8,"marks":[{"share":0.95,"scans":7,"path_length_m":2.0}]}"#,
    ),
    plain::<ExplorationReport>(
        r#"{"explorer":"Potential","policy":"elk","settings":"clearance 0.1 m","complete":true,"reason":"nothing is left","frontiers_left":{"unreachable":0,"invisible":1,"unresolved":0,"no_return":0,"too_small":2,"open":0,"map_edge":0,"no_room":0,"volume_edge":0},"plans":9,"stalls":0,"cpu_secs":[["solve",0.5]]}"#,
    ),
    plain::<SensorReport>(r#"{"scans":9,"contacts":0,"scan":9,"cpu_secs":0.5}"#),
    plain::<AccuracyReport>(r#"{"revision":9,"accuracy":0.99,"voxels":1000}"#),
    plain::<MapMemory>(
        r#"{"revision":1,"scan":1,"resolution":0.1,"bricks":[{"brick":[0,0,-1],"known":[3,0,0,0,0,0,0,0],"ever_hit":[2,0,0,0,0,0,0,0],"log_odds":[-0.5,0.75]}]}"#,
    ),
    plain::<MotionMemory>(
        r#"{"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]},"awaited":{"Map":{"id":1,"via":[],"pose":{"rotation":[0.0,0.0,0.0,1.0],"translation":[1.0,2.0,0.5]}}},"commands":1,"allowed":1,"steps":0,"requests":1,"path_length_m":2.5,"leg":{"plan":{"request":1,"revision":1,"decision":{"Go":{"points":[[1.0,2.0,0.5]],"target":{"x":1,"y":2,"z":3},"unknown":[],"looks":[]}},"motion":{"name":"elk","scan_spacing_m":0.5,"early_stop":true,"look_at_target":true,"clearance_m":0.2},"cpu_secs":0.01},"resolution":0.1,"allowed":[],"done_m":2.5,"step_m":0.5,"blocked":false,"looks":0},"samples":[{"scans":1,"free":8,"path_length_m":0.0}]}"#,
    ),
    plain::<ExplorerMemory>(
        r#"{"plan":{"request":1,"revision":1,"decision":{"Go":{"points":[[1.0,2.0,0.5]],"target":{"x":1,"y":2,"z":3},"unknown":[],"looks":[]}},"motion":{"name":"elk","scan_spacing_m":0.5,"early_stop":true,"look_at_target":true,"clearance_m":0.2},"cpu_secs":0.01},"ended":null,"plans":1,"stalls":0,"fallbacks":0,"iterations":14,"cpu_secs":[["field",0.5]],"trail":[{"x":1,"y":2,"z":3}],"targets":[{"target":{"x":1,"y":2,"z":4},"tried":[{"x":1,"y":2,"z":3}],"cuts":0,"planned":1,"no_return":false}],"hidden":[],"standing":{"free":8,"occupied":2,"frontier":3,"attempts":1},"progress_at":1,"refused":0,"no_return":0}"#,
    ),
];

/// What the variables of an exploration carry (see [`crate::keys`]), by the pattern of their names: who pokes one that
/// nobody has written yet must not fix it to another type.
const CARRIED: &[(&str, &str)] = &[
    ("POSE_COMMAND", PoseCommand::NAME),
    ("SCAN", Scan::NAME),
    ("SCAN_*", Scan::NAME),
    ("MAP_UPDATE", MapUpdate::NAME),
    ("MAP", MapUpdate::NAME),
    ("MAP_KNOWN", MapStatus::NAME),
    ("PLAN_REQUEST", PlanRequest::NAME),
    ("PLAN", Plan::NAME),
    ("PROGRESS", Progress::NAME),
    ("MOTION_REPORT", MotionReport::NAME),
    (CAMERA_POSE, CameraPose::NAME),
    ("EXPLORATION_REPORT", ExplorationReport::NAME),
    ("SENSOR_REPORT", SensorReport::NAME),
    ("ACCURACY_REPORT", AccuracyReport::NAME),
    ("MAP_MEMORY", MapMemory::NAME),
    ("MOTION_MEMORY", MotionMemory::NAME),
    ("EXPLORER_MEMORY", ExplorerMemory::NAME),
];

/// A payload type, and how its bytes become JSON and JSON its bytes.
#[derive(Debug, Clone, Copy)]
pub struct PayloadType {
    /// The type's name (see [`Payload::NAME`]).
    pub name: &'static str,
    /// The hash of its fields (see [`Payload::LAYOUT`]).
    pub layout: u64,
    /// A value of the type as JSON, to show what is right.
    pub example: &'static str,
    check: fn(&[u8]) -> Result<(), DecodeError>,
    read: fn(&[u8], usize) -> Result<Value, DecodeError>,
    write: fn(&Value) -> Result<Vec<u8>, String>,
}

/// Why a typed value cannot be shown as JSON.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The type is none of elk's.
    #[error("{type_name} (layout {layout:016x}) is none of elk's own types")]
    UnknownType {
        /// The type's name.
        type_name: String,
        /// The hash of its fields.
        layout: u64,
    },
    /// The type has a known name and other fields.
    #[error(
        "this {type_name} is of another layout ({found:016x}, here {expected:016x}): its writer is of another version"
    )]
    OtherLayout {
        /// The type's name.
        type_name: &'static str,
        /// The layout that the catalogue knows.
        expected: u64,
        /// The layout that the value has.
        found: u64,
    },
    /// The bytes are not what the type's name promises.
    #[error(transparent)]
    Decode(#[from] DecodeError),
}

/// Why a JSON value is no value of a type.
#[derive(Debug, thiserror::Error)]
#[error("this is no {type_name}: {reason}; right is, for example, {example}")]
pub struct WriteError {
    /// The type's name.
    pub type_name: &'static str,
    /// What is wrong.
    pub reason: String,
    /// What is right.
    pub example: &'static str,
}

/// The type of this name.
pub fn named(type_name: &str) -> Option<&'static PayloadType> {
    CATALOGUE.iter().find(|one| one.name == type_name)
}

/// The type that a variable of an exploration carries.
pub fn carried_by(key: &str) -> Option<&'static PayloadType> {
    CARRIED.iter().find(|(pattern, _)| pattern::matches(pattern, key)).and_then(|(_, type_name)| named(type_name))
}

/// A typed value as JSON. A list (of points, of bricks, of anything) with more than `longest` entries becomes a text
/// that says how many: `"7312 points"`.
///
/// # Errors
/// The type is unknown, or of another layout, or the bytes are damaged.
pub fn to_json(type_name: &str, layout: u64, bytes: &[u8], longest: usize) -> Result<Value, ReadError> {
    let unknown = || ReadError::UnknownType { type_name: type_name.to_owned(), layout };
    let payload = named(type_name).ok_or_else(unknown)?;
    if payload.layout != layout {
        let (type_name, expected) = (payload.name, payload.layout);
        return Err(ReadError::OtherLayout { type_name, expected, found: layout });
    }
    Ok(payload.to_json(bytes, longest)?)
}

/// Any value as JSON: a number, a text, or a typed value as [`to_json`] has it.
///
/// # Errors
/// As [`to_json`].
pub fn value_to_json(value: ValueRef<'_>, longest: usize) -> Result<Value, ReadError> {
    match value {
        ValueRef::Double(number) => Ok(number.into()),
        ValueRef::Text(text) => Ok(text.into()),
        ValueRef::Binary { type_name, layout, bytes } => to_json(type_name, layout, bytes, longest),
    }
}

impl PayloadType {
    /// Whether a reader would believe the value in `bytes` (see [`Payload::check`]). What is only shown is not checked.
    ///
    /// # Errors
    /// The bytes are no value of the type, or one that cannot be true.
    pub fn check(&self, bytes: &[u8]) -> Result<(), DecodeError> {
        (self.check)(bytes)
    }

    /// The value in `bytes` as JSON; lists with more than `longest` entries are counted instead (see [`to_json`]).
    ///
    /// # Errors
    /// The bytes are no value of the type.
    pub fn to_json(&self, bytes: &[u8], longest: usize) -> Result<Value, DecodeError> {
        (self.read)(bytes, longest)
    }

    /// The bytes of a value that is given as JSON. Nothing in it is ignored: a field that the type does not have is an
    /// error, too.
    ///
    /// # Errors
    /// The JSON is no value of the type; the error says where it is wrong, and what is right.
    #[allow(clippy::wrong_self_convention, reason = "the bytes are made from JSON by the type that this describes")]
    pub fn from_json(&self, json: &Value) -> Result<Vec<u8>, WriteError> {
        let wrong = |reason| WriteError { type_name: self.name, reason, example: self.example };
        let bytes = (self.write)(json).map_err(wrong)?;
        let understood = self.to_json(&bytes, usize::MAX).map_err(|error| wrong(error.to_string()))?;
        match surplus(json, &understood) {
            None => Ok(bytes),
            Some(field) => Err(wrong(format!("unknown field `{field}`"))),
        }
    }
}

/// A type whose JSON is what serde makes of it.
const fn plain<T: Payload + Serialize + DeserializeOwned>(example: &'static str) -> PayloadType {
    let (check, read, write) = (check::<T>, read_plain::<T>, write_plain::<T>);
    PayloadType { name: T::NAME, layout: T::LAYOUT, example, check, read, write }
}

fn check<T: Payload>(bytes: &[u8]) -> Result<(), DecodeError> {
    let value = ValueRef::Binary { type_name: T::NAME, layout: T::LAYOUT, bytes };
    value.decode(&Key::<T>::new(T::NAME)).map(|_| ())
}

fn read_plain<T: Payload + Serialize + DeserializeOwned>(bytes: &[u8], longest: usize) -> Result<Value, DecodeError> {
    let value: T = codec::decode(bytes, T::NAME)?;
    let mut json = as_json(&value, T::NAME)?;
    shorten(&mut json, "entries", longest);
    Ok(json)
}

fn write_plain<T: Serialize + DeserializeOwned>(json: &Value) -> Result<Vec<u8>, String> {
    encoded(&T::deserialize(json).map_err(|error| error.to_string())?)
}

fn as_json(value: &impl Serialize, type_name: &'static str) -> Result<Value, DecodeError> {
    serde_json::to_value(value).map_err(|error| DecodeError::Bytes { type_name, reason: error.to_string() })
}

fn encoded(value: &impl Serialize) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    codec::encode_onto(value, &mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// Replaces lists with more than `longest` entries by their count of `what`.
fn shorten(json: &mut Value, what: &str, longest: usize) {
    match json {
        Value::Array(entries) if entries.len() > longest => *json = counted(entries.len(), what),
        Value::Array(entries) => entries.iter_mut().for_each(|entry| shorten(entry, what, longest)),
        Value::Object(fields) => fields.iter_mut().for_each(|(name, field)| shorten(field, name, longest)),
        _ => {}
    }
}

fn counted(count: usize, what: &str) -> Value {
    format!("{count} {what}").into()
}

/// The first field in `said` that has no place in `understood`.
fn surplus(said: &Value, understood: &Value) -> Option<String> {
    match (said, understood) {
        (Value::Object(said), Value::Object(understood)) => said.iter().find_map(|(name, field)| {
            let Some(known) = understood.get(name) else {
                return Some(name.clone());
            };
            surplus(field, known).map(|inner| format!("{name}.{inner}"))
        }),
        (Value::Array(said), Value::Array(understood)) => {
            said.iter().zip(understood).find_map(|(one, other)| surplus(one, other))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests;
