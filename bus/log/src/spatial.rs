//! Which values of the bus viewers can show, and as what.
//!
//! | drawn as (see [`elk_bus::Describe`]) | message | what a viewer sees |
//! |---|---|---|
//! | `points`: a scan | `foxglove.PointCloud` | the points, at the camera's pose |
//! | `voxels`: a map | `foxglove.PointCloud` | the centres of the occupied voxels in the bricks that changed |
//! | `pose`: a camera's, a command's | `foxglove.PoseInFrame` | the pose |
//! | `scene`: a drawing | `foxglove.SceneUpdate` | its primitives, but for images |
//! | `poses`: a plan | `foxglove.PosesInFrame` | the path, then the poses to look from |
//!
//! Each message carries the value as it was sent in a field that the schema does not name ([`ORIGINAL`]): protobuf
//! readers pass over it, and [`original`] gives the value back to the bit, whatever the conversion rounds or leaves out.
//! A second copy costs little where values are small. A scan is not, and its points are packed just as a point cloud
//! wants them: they are stored once, in the cloud's `data`, and the unnamed field holds only what stood before them.

use elk_bus::TypeRef;
use elk_bus::describe::Kind;
use elk_geometry::bricks::{BRICK_CELLS, voxel_at};
use elk_geometry::mask;
use elk_geometry::state::BrickStates;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::foxglove::{self, DATA, MessageType};
use crate::protobuf::{Fields, find_bytes};
use crate::scene;

/// The field that holds envelope and value. Foxglove's own numbers end near 100; protobuf's end at 2²⁹ − 1.
const ORIGINAL: u32 = 20_000;

/// As what viewers show a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    /// Points, at a pose.
    Points,
    /// The occupied voxels of a map, or of what changed in one.
    Map,
    /// A pose.
    Pose,
    /// A way, and where to look from.
    Poses,
    /// What an app draws.
    Scene,
}

impl Shape {
    /// As what values of this type are shown; none: viewers cannot.
    pub fn of(type_: TypeRef<'_>) -> Option<Self> {
        match type_.drawn() {
            "points" => Some(Shape::Points),
            "pose" => Some(Shape::Pose),
            "poses" => Some(Shape::Poses),
            "voxels" => Some(Shape::Map),
            "scene" => Some(Shape::Scene),
            _ => None,
        }
    }

    /// The message that it is stored as.
    pub fn message_type(self) -> &'static MessageType {
        match self {
            Shape::Points | Shape::Map => &foxglove::POINT_CLOUD,
            Shape::Pose => &foxglove::POSE_IN_FRAME,
            Shape::Poses => &foxglove::POSES_IN_FRAME,
            Shape::Scene => &foxglove::SCENE_UPDATE,
        }
    }
}

/// Appends the message to `out`: what viewers show of `value`, and with it `envelope` and the value itself. A value that
/// is not what its type says is stored all the same; viewers then see an empty message.
pub(crate) fn put(
    (shape, type_): (Shape, TypeRef<'_>),
    nanoseconds: u64,
    envelope: &[u8],
    value: &[u8],
    out: &mut Vec<u8>,
) {
    let mut out = Fields(out);
    if shape != Shape::Scene {
        foxglove::put_head(&mut out, nanoseconds);
    }
    let stored_in_data = match shape {
        Shape::Points => put_points(&mut out, type_, value),
        Shape::Map => put_map(&mut out, type_, value),
        Shape::Pose => put_pose(&mut out, type_, value),
        Shape::Poses => put_poses(&mut out, type_, value),
        Shape::Scene => {
            scene::put(&mut out, nanoseconds, type_, value);
            None
        }
    };
    let rest = &value[..value.len() - stored_in_data.unwrap_or(0)];
    out.parts(ORIGINAL, &[&[u8::from(stored_in_data.is_some())], envelope, rest]);
}

/// Appends a message of a value that no viewer knows: its bytes are the message's `data`.
pub(crate) fn put_other(envelope: &[u8], value: &[u8], out: &mut Vec<u8>) {
    let mut out = Fields(out);
    out.bytes(DATA, value);
    out.parts(ORIGINAL, &[&[1], envelope]);
}

/// Envelope and value, as [`put`] took them: the second part of the value is empty, or stored in the message's `data`.
pub(crate) fn original(message: &[u8]) -> Option<(&[u8], &[u8])> {
    let [original, data] = find_bytes(message, [ORIGINAL, DATA])?;
    let (stored_in_data, head) = original?.split_first()?;
    Some((head, if *stored_in_data == 1 { data? } else { &[] }))
}

/// What of a value viewers draw.
struct Drawn<'a> {
    /// Points in the order of their bytes as poses that only stand somewhere, and poses.
    all: Vec<Isometry3<f64>>,
    /// The first pose.
    pose: Option<Isometry3<f64>>,
    /// The last list of packed points.
    points: Option<&'a [u8]>,
}

/// Finds what can be drawn in a value; `None`: it is not what its type says.
fn drawn<'a>(type_: TypeRef<'_>, value: &'a [u8]) -> Option<Drawn<'a>> {
    let mut drawn = Drawn { all: Vec::new(), pose: None, points: None };
    type_
        .description()?
        .visit(value, &mut |kind, bytes| {
            if is_pose(kind) {
                let pose = pose_of(bytes);
                drawn.pose.get_or_insert(pose);
                drawn.all.push(pose);
            } else if is_vector(kind, Kind::Float(8)) {
                drawn.all.push(Isometry3::translation(f64_at(bytes, 0), f64_at(bytes, 1), f64_at(bytes, 2)));
            } else if let Kind::Packed(of) = kind
                && is_vector(of, Kind::Float(4))
            {
                drawn.points = Some(bytes);
            } else {
                return false;
            }
            true
        })
        .ok()?;
    Some(drawn)
}

/// Whether values are nalgebra's `Isometry3<f64>`: a rotation, and a translation after it.
pub(crate) fn is_pose(kind: &Kind) -> bool {
    let Kind::Struct(one) = kind else { return false };
    match one.fields.as_slice() {
        [rotation, translation] => rotation.kind == Kind::Rotation && is_vector(&translation.kind, Kind::Float(8)),
        _ => false,
    }
}

fn is_vector(kind: &Kind, number: Kind) -> bool {
    matches!(kind, Kind::Array { of, count: 3 } if **of == number)
}

fn f64_at(bytes: &[u8], index: usize) -> f64 {
    let number = bytes.get(8 * index..).and_then(|rest| rest.first_chunk());
    number.map_or(f64::NAN, |number| f64::from_le_bytes(*number))
}

fn pose_of(bytes: &[u8]) -> Isometry3<f64> {
    let [x, y, z, w, right, ahead, up] = std::array::from_fn(|i| f64_at(bytes, i));
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::new(right, ahead, up), rotation)
}

/// Answers how many bytes at the end of the value are in the message's `data`.
fn put_points(out: &mut Fields<'_>, type_: TypeRef<'_>, value: &[u8]) -> Option<usize> {
    let Drawn { pose, points, .. } = drawn(type_, value)?;
    let points = points?;
    foxglove::put_pose(out, &pose.unwrap_or_default());
    foxglove::put_point_fields(out);
    out.bytes(DATA, points);
    // A scan's are the last thing in it; what has them elsewhere is stored whole besides.
    value.ends_with(points).then_some(points.len())
}

fn put_map(out: &mut Fields<'_>, type_: TypeRef<'_>, value: &[u8]) -> Option<usize> {
    let (resolution, bricks) = bricks(type_, value)?;
    foxglove::put_pose(out, &Isometry3::identity());
    foxglove::put_point_fields(out);
    let centers = bricks.iter().flat_map(|brick| occupied_centers(brick, resolution));
    out.bytes(DATA, &centers.take(MOST_SHOWN).flatten().collect::<Vec<u8>>());
    None
}

/// The edge of a voxel (m), which is the first double, and the bricks of a value; `None`: it is not what its type says.
fn bricks(type_: TypeRef<'_>, value: &[u8]) -> Option<(f64, Vec<BrickStates>)> {
    let (mut resolution, mut position, mut bricks) = (None, None, Vec::new());
    type_
        .description()?
        .visit(value, &mut |kind, bytes| {
            match kind {
                Kind::Float(8) => {
                    resolution.get_or_insert(f64_at(bytes, 0));
                }
                Kind::Array { of, count: 3 } if **of == Kind::Signed(2) => position = position_of(bytes),
                Kind::Symbols { bits: 2, .. } => {
                    bricks.extend(position.take().map(|brick| BrickStates { brick, cells: bytes.to_vec() }));
                }
                _ => return false,
            }
            true
        })
        .ok()?;
    Some((resolution?, bricks))
}

fn position_of(bytes: &[u8]) -> Option<[i16; 3]> {
    let mut axes = bytes.chunks_exact(2).map(|axis| axis.first_chunk().map(|axis| i16::from_le_bytes(*axis)));
    Some([axes.next()??, axes.next()??, axes.next()??])
}

/// Voxels or poses of one value that a viewer is shown; the value itself is stored whole.
const MOST_SHOWN: usize = 1 << 20;

fn occupied_centers(brick: &BrickStates, resolution: f64) -> impl Iterator<Item = [u8; 12]> {
    let (position, occupied) = (brick.position(), *brick.unpack().occupied());
    let cells = (0..BRICK_CELLS).filter(move |cell| mask::has(&occupied, *cell));
    cells.map(move |cell| foxglove::packed(voxel_at(position, cell).center(resolution)))
}

fn put_pose(out: &mut Fields<'_>, type_: TypeRef<'_>, value: &[u8]) -> Option<usize> {
    foxglove::put_pose(out, &drawn(type_, value)?.pose?);
    None
}

fn put_poses(out: &mut Fields<'_>, type_: TypeRef<'_>, value: &[u8]) -> Option<usize> {
    drawn(type_, value)?.all.iter().take(MOST_SHOWN).for_each(|pose| foxglove::put_pose(out, pose));
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_bus::codec;
    use elk_geometry::{OccupancyGrid, Pose, State, Voxel};
    use elk_spatial::Scan;
    use elk_spatial::map::MapUpdate;
    use elk_spatial::messages::{Plan, PoseCommand};
    use nalgebra::Point3;
    use proptest::prelude::*;

    const SCAN: TypeRef<'static> = TypeRef::of::<Scan<'static>>();
    const MAP: TypeRef<'static> = TypeRef::of::<MapUpdate>();
    const DRAWN: [TypeRef<'static>; 5] =
        [SCAN, MAP, TypeRef::of::<PoseCommand>(), TypeRef::of::<Plan>(), TypeRef::of::<elk_bus::drawing::Drawing>()];

    fn encoded<T: serde::Serialize>(value: &T) -> Vec<u8> {
        let mut bytes = Vec::new();
        codec::encode_onto(value, &mut bytes).unwrap();
        bytes
    }

    fn back(type_: TypeRef<'_>, value: &[u8]) -> Vec<u8> {
        let mut message = Vec::new();
        put((Shape::of(type_).unwrap(), type_), 1, b"envelope", value, &mut message);
        let (head, tail) = original(&message).unwrap();
        [head.strip_prefix(b"envelope").unwrap(), tail].concat()
    }

    #[test]
    fn a_scan_is_stored_once_and_comes_back() {
        let points = (0..1000).map(|i| Point3::new(i as f32, 0.5, -1.5)).collect();
        let scan = Scan::new(7, 6, Pose(Isometry3::identity()), points);
        let value = encoded(&scan);
        let mut message = Vec::new();
        put((Shape::Points, SCAN), 1, b"", &value, &mut message);
        assert!(message.len() < value.len() + 300, "{} bytes for {}", message.len(), value.len());
        assert_eq!(back(SCAN, &value), value);
    }

    /// What a laser of somebody else's saw, with its points in the midst.
    #[elk_bus::payload]
    #[describe(drawn = "points")]
    struct Sweep<'a> {
        #[serde(borrow)]
        points: elk_spatial::Points<'a>,
        laser: Option<Pose>,
        power: f64,
    }

    #[test]
    fn what_strangers_mark_is_drawn_and_comes_back() {
        let points: elk_spatial::Points<'_> = [Point3::new(1.0, 2.0, 3.0)].into_iter().collect();
        let drawn = points.as_bytes().to_vec();
        let pose = Pose(Isometry3::translation(4.0, 5.0, 6.0));
        let value = encoded(&Sweep { points, laser: Some(pose), power: 0.5 });
        let mut message = Vec::new();
        let type_ = TypeRef::of::<Sweep<'static>>();
        put((Shape::of(type_).unwrap(), type_), 1, b"", &value, &mut message);
        assert_eq!(find_bytes(&message, [DATA]).unwrap(), [Some(drawn.as_slice())]);
        assert_eq!(super::drawn(type_, &value).unwrap().pose, Some(pose.0));
        assert_eq!(back(type_, &value), value);
    }

    #[test]
    fn a_plans_way_is_drawn_before_the_looks_at_its_end() {
        let plan = elk_spatial::samples::named("Plan").unwrap();
        let mut json = plan.value();
        let look = serde_json::json!({"rotation": [0.0, 0.0, 1.0, 0.0], "translation": [7.0, 8.0, 9.0]});
        json["decision"]["Go"]["points"] = serde_json::json!([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        json["decision"]["Go"]["looks"] = serde_json::json!([look]);
        let bytes = plan.bytes_of(&json).unwrap();
        let way: Vec<[f64; 3]> =
            super::drawn(plan.type_, &bytes).unwrap().all.iter().map(|pose| pose.translation.vector.into()).collect();
        assert_eq!(way, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]);
    }

    #[test]
    fn a_map_shows_its_occupied_voxels_and_comes_back() {
        let mut map = OccupancyGrid::new(0.1);
        let voxels = [(Voxel::new(3, -4, 5), State::Occupied), (Voxel::new(3, -4, 6), State::Free)];
        for (voxel, state) in voxels {
            map.set(voxel, state);
        }
        let value = encoded(&MapUpdate::new(map.whole(), 1));
        let mut message = Vec::new();
        put((Shape::Map, MAP), 1, b"", &value, &mut message);
        let [data] = find_bytes(&message, [DATA]).unwrap();
        assert_eq!(data.unwrap(), foxglove::packed(Voxel::new(3, -4, 5).center(0.1)));
        assert_eq!(back(MAP, &value), value);
    }

    /// What another version of the map, or somebody else, says of voxels.
    #[elk_bus::payload]
    #[describe(drawn = "voxels")]
    struct Room {
        name: String,
        #[describe(unit = "m")]
        edge: f64,
        height: f64,
        walls: Option<Vec<BrickStates>>,
    }

    #[test]
    fn voxels_of_anybody_are_drawn() {
        let mut map = OccupancyGrid::new(0.2);
        map.set(Voxel::new(3, -4, 5), State::Occupied);
        let walls = Some(map.whole().bricks.into_owned());
        let value = encoded(&Room { name: "hall".into(), edge: 0.2, height: 3.0, walls });
        let mut message = Vec::new();
        let room = TypeRef::of::<Room>();
        put((Shape::of(room).unwrap(), room), 1, b"", &value, &mut message);
        let [data] = find_bytes(&message, [DATA]).unwrap();
        assert_eq!(data.unwrap(), foxglove::packed(Voxel::new(3, -4, 5).center(0.2)));
        assert_eq!(back(room, &value), value);
    }

    proptest! {
        /// What claims to be a scan, and is anything else, comes back as well.
        #[test]
        fn anything_comes_back(value in prop::collection::vec(any::<u8>(), 0..300), type_ in 0..DRAWN.len()) {
            prop_assert_eq!(back(DRAWN[type_], &value), value);
        }
    }
}
