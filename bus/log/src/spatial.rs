//! Which values of the bus viewers can show, and as what.
//!
//! | value | message | what a viewer sees |
//! |---|---|---|
//! | `Scan` | `foxglove.PointCloud` | the points, at the camera's pose |
//! | `MapUpdate` | `foxglove.PointCloud` | the centres of the occupied voxels in the bricks that changed |
//! | `CameraPose`, `PoseCommand`, `PlanRequest` | `foxglove.PoseInFrame` | the pose |
//! | `Plan` | `foxglove.PosesInFrame` | the path, then the poses to look from |
//!
//! Each message carries the value as it was sent in a field that the schema does not name ([`ORIGINAL`]): protobuf
//! readers pass over it, and [`original`] gives the value back to the bit, whatever the conversion rounds or leaves out.
//! A second copy costs little where values are small. A scan is not, and its points are packed just as a point cloud
//! wants them: they are stored once, in the cloud's `data`, and the unnamed field holds only what stood before them.

use elk_bus::{Payload, codec};
use elk_spatial::Scan;
use elk_spatial::bricks::voxel_at;
use elk_spatial::map::{BrickStates, MapUpdate, State};
use elk_spatial::messages::{CameraPose, Decision, Path, Plan, PlanRequest, PoseCommand};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};

use crate::foxglove::{self, DATA, MessageType};
use crate::protobuf::{Fields, find_bytes};

/// The field that holds envelope and value. Foxglove's own numbers end near 100; protobuf's end at 2²⁹ − 1.
const ORIGINAL: u32 = 20_000;

/// A value that viewers can show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    /// A depth scan.
    Scan,
    /// A map, or what changed in one.
    Map,
    /// Where the camera is.
    CameraPose,
    /// Where it is to go.
    PoseCommand,
    /// Where a plan is asked for.
    PlanRequest,
    /// A path.
    Plan,
}

/// Every shape with the type of value that has it.
const SHAPES: [(Shape, &str, u64); 6] = [
    (Shape::Scan, <Scan<'_> as Payload>::NAME, <Scan<'_> as Payload>::LAYOUT),
    (Shape::Map, MapUpdate::NAME, MapUpdate::LAYOUT),
    (Shape::CameraPose, CameraPose::NAME, CameraPose::LAYOUT),
    (Shape::PoseCommand, PoseCommand::NAME, PoseCommand::LAYOUT),
    (Shape::PlanRequest, PlanRequest::NAME, PlanRequest::LAYOUT),
    (Shape::Plan, Plan::NAME, Plan::LAYOUT),
];

impl Shape {
    /// The shape of values of this type; none: viewers do not know it.
    pub fn of(type_name: &str, layout: u64) -> Option<Self> {
        let found = SHAPES.iter().find(|(_, name, hash)| (*name, *hash) == (type_name, layout));
        found.map(|(shape, ..)| *shape)
    }

    /// The message that it is stored as.
    pub fn message_type(self) -> &'static MessageType {
        match self {
            Shape::Scan | Shape::Map => &foxglove::POINT_CLOUD,
            Shape::CameraPose | Shape::PoseCommand | Shape::PlanRequest => &foxglove::POSE_IN_FRAME,
            Shape::Plan => &foxglove::POSES_IN_FRAME,
        }
    }
}

/// Appends the message to `out`: what viewers show of `value`, and with it `envelope` and the value itself. A value that
/// is not what its type says is stored all the same; viewers then see an empty message.
pub(crate) fn put(shape: Shape, nanoseconds: u64, envelope: &[u8], value: &[u8], out: &mut Vec<u8>) {
    let mut out = Fields(out);
    foxglove::put_head(&mut out, nanoseconds);
    let stored_in_data = match shape {
        Shape::Scan => put_scan(&mut out, value),
        Shape::Map => put_map(&mut out, value),
        _ => put_poses(shape, &mut out, value),
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

/// Answers how many bytes at the end of the value are in the message's `data`.
fn put_scan(out: &mut Fields<'_>, value: &[u8]) -> Option<usize> {
    let scan: Scan<'_> = codec::decode(value, <Scan<'_> as Payload>::NAME).ok()?;
    let points = scan.points.as_bytes();
    // The points are the last thing in a scan; should that ever change, the value is stored whole besides.
    let at_the_end = value.ends_with(points);
    foxglove::put_pose(out, &scan.pose.0);
    foxglove::put_point_fields(out);
    out.bytes(DATA, points);
    at_the_end.then_some(points.len())
}

fn put_map(out: &mut Fields<'_>, value: &[u8]) -> Option<usize> {
    let update: MapUpdate = codec::decode(value, MapUpdate::NAME).ok()?;
    foxglove::put_pose(out, &Isometry3::identity());
    foxglove::put_point_fields(out);
    let centers = update.bricks.iter().flat_map(|brick| occupied_centers(brick, update.resolution));
    out.bytes(DATA, &centers.take(MOST_SHOWN).flatten().collect::<Vec<u8>>());
    None
}

/// Occupied voxels of one update that a viewer is shown; the update itself is stored whole.
const MOST_SHOWN: usize = 1 << 20;

fn occupied_centers(brick: &BrickStates, resolution: f64) -> impl Iterator<Item = [u8; 12]> {
    let cells = (0..elk_spatial::bricks::BRICK_CELLS).filter(|cell| brick.state(*cell) == State::Occupied);
    cells.map(move |cell| foxglove::packed(voxel_at(brick.position(), cell).center(resolution)))
}

fn put_poses(shape: Shape, out: &mut Fields<'_>, value: &[u8]) -> Option<usize> {
    match shape {
        Shape::CameraPose => {
            foxglove::put_pose(out, &codec::decode::<CameraPose>(value, CameraPose::NAME).ok()?.pose.0);
        }
        Shape::PoseCommand => {
            foxglove::put_pose(out, &codec::decode::<PoseCommand>(value, PoseCommand::NAME).ok()?.pose.0);
        }
        Shape::PlanRequest => {
            foxglove::put_pose(out, &codec::decode::<PlanRequest>(value, PlanRequest::NAME).ok()?.pose.0);
        }
        _ => {
            if let Decision::Go(path) = codec::decode::<Plan>(value, Plan::NAME).ok()?.decision {
                put_path(out, &path);
            }
        }
    }
    None
}

fn put_path(out: &mut Fields<'_>, path: &Path) {
    for point in &path.points {
        foxglove::put_pose(out, &at(*point));
    }
    path.looks.iter().for_each(|look| foxglove::put_pose(out, &look.0));
}

/// A pose that only stands somewhere.
fn at(point: Point3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(point), UnitQuaternion::identity())
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_spatial::{OccupancyGrid, Pose, Voxel};
    use proptest::prelude::*;

    fn encoded<T: serde::Serialize>(value: &T) -> Vec<u8> {
        let mut bytes = Vec::new();
        codec::encode_onto(value, &mut bytes).unwrap();
        bytes
    }

    fn back(shape: Shape, value: &[u8]) -> Vec<u8> {
        let mut message = Vec::new();
        put(shape, 1, b"envelope", value, &mut message);
        let (head, tail) = original(&message).unwrap();
        [head.strip_prefix(b"envelope").unwrap(), tail].concat()
    }

    #[test]
    fn a_scan_is_stored_once_and_comes_back() {
        let points = (0..1000).map(|i| Point3::new(i as f32, 0.5, -1.5)).collect();
        let scan = Scan::new(7, 6, Pose(Isometry3::identity()), points);
        let value = encoded(&scan);
        let mut message = Vec::new();
        put(Shape::Scan, 1, b"", &value, &mut message);
        assert!(message.len() < value.len() + 300, "{} bytes for {}", message.len(), value.len());
        assert_eq!(back(Shape::Scan, &value), value);
    }

    #[test]
    fn a_map_shows_its_occupied_voxels_and_comes_back() {
        let mut map = OccupancyGrid::new(0.1);
        let voxels = [(Voxel::new(3, -4, 5), State::Occupied), (Voxel::new(3, -4, 6), State::Free)];
        for (voxel, state) in voxels {
            map.set(voxel, state);
        }
        let value = encoded(&map.whole(1));
        let mut message = Vec::new();
        put(Shape::Map, 1, b"", &value, &mut message);
        let [data] = find_bytes(&message, [DATA]).unwrap();
        assert_eq!(data.unwrap(), foxglove::packed(Voxel::new(3, -4, 5).center(0.1)));
        assert_eq!(back(Shape::Map, &value), value);
    }

    proptest! {
        /// What claims to be a scan, and is anything else, comes back as well.
        #[test]
        fn anything_comes_back(value in prop::collection::vec(any::<u8>(), 0..300), shape in 0..SHAPES.len()) {
            prop_assert_eq!(back(SHAPES[shape].0, &value), value);
        }
    }
}
