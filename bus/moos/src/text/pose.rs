//! Poses in the plane as the thesis writes them (4.3.2.2): x and y (m), and the heading (rad, anticlockwise from x).
//!
//! In space a pose is a rotation and a translation after it, that of a camera: x right, y down, z forward, in a world whose z is
//! up. In the plane it lies at z = 0 and looks level, where its heading says.

use elk_describe::{Kind, Struct};
use serde_json::{Map, Value};

use super::keys::width;

/// How poses in space are told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Poses {
    /// As a rotation and a translation.
    InSpace,
    /// As three numbers, x and y (m) and the heading (rad); what else they have is left out.
    InPlane,
}

/// The numbers of a pose in the plane.
pub const NUMBERS: usize = 3;
/// Digits of a heading behind the point: more are rounding.
const DIGITS: f64 = 1e12;

/// The names of a struct's rotation and translation, if it is a pose in space.
pub fn names(one: &Struct) -> Option<[&str; 2]> {
    let [a, b] = one.fields.as_slice() else { return None };
    let is_rotation = |kind: &Kind| matches!(kind.plain(), Kind::Rotation);
    let is_place = |kind: &Kind| matches!(kind.plain(), Kind::Array { .. }) && width(kind) == Some(NUMBERS);
    match (is_rotation(&a.kind), is_rotation(&b.kind)) {
        (true, false) if is_place(&b.kind) => Some([&a.name, &b.name]),
        (false, true) if is_place(&a.kind) => Some([&b.name, &a.name]),
        _ => None,
    }
}

/// What of a pose is in the plane; `None`: it is no pose, or has numbers that are none.
pub fn in_plane(one: &Struct, pose: &Value) -> Option<[f64; NUMBERS]> {
    let [rotation, translation] = names(one)?;
    let number = |of: &str, n: usize| pose.get(of)?.get(n)?.as_f64();
    let [i, j, k, w] = [0, 1, 2, 3].map(|n| number(rotation, n));
    let (i, j, k, w) = (i?, j?, k?, w?);
    // Where its z axis points.
    let heading = (j * k - w * i).atan2(i * k + w * j);
    Some([number(translation, 0)?, number(translation, 1)?, (heading * DIGITS).round() / DIGITS])
}

/// The pose in space that is one in the plane; `None`: the struct is none.
pub fn in_space(one: &Struct, [x, y, heading]: [f64; NUMBERS]) -> Option<Value> {
    let [rotation, translation] = names(one)?;
    let (sin, cos) = (heading / 2.0).sin_cos();
    // The turn by the heading after that from the camera's axes to one that looks along x.
    let turned = [-(cos + sin), cos - sin, sin - cos, cos + sin].map(|number| number / 2.0);
    let pose = [(rotation.to_owned(), Value::from(turned.to_vec())), (translation.to_owned(), vec![x, y, 0.0].into())];
    Some(Map::from_iter(pose).into())
}
