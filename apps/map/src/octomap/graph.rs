//! `.graph` files: scans, each with the pose that it was taken from, and how poses hang together.
//!
//! Little-endian: the number of scans; each its number of points, the points in the sensor's frame, its pose (a vector and a
//! quaternion, real part first) and its number; then the number of edges, and the edges. A vector says before its numbers
//! that they are 3, a quaternion that they are 4.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::bytes::{Bytes, CutOff};
use crate::occupancy::{ConfigError, MapConfig, OccupancyMap};

/// Bytes of a vector.
const VECTOR: usize = 28;
/// Bytes of an edge: the numbers of two scans, the pose of the one as the other sees it, and a weight.
const EDGE: usize = 80;

/// The scans of a `.graph` file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ScanGraph {
    /// In the order of the file.
    pub scans: Vec<GraphScan>,
}

/// A scan of a graph.
#[derive(Debug, Clone, PartialEq)]
pub struct GraphScan {
    /// Its number in the graph.
    pub id: u32,
    /// The sensor's pose: takes points of its frame to the world's (m).
    pub pose: Isometry3<f64>,
    /// What was seen (m, the sensor's frame). Not looked at: a point may be infinite, or no number.
    pub points: Vec<Point3<f64>>,
}

impl GraphScan {
    /// Where the sensor was (m, world).
    pub fn origin(&self) -> Point3<f64> {
        self.pose.translation.vector.into()
    }

    /// What was seen (m, world).
    pub fn world_points(&self) -> impl Iterator<Item = Point3<f64>> + '_ {
        self.points.iter().map(|point| self.pose * point)
    }
}

/// Why bytes are no `.graph` file.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GraphError {
    /// The file ends where there should be more.
    #[error("the file ends at byte {end} in the middle of {what}: it is cut off, or no .graph file")]
    Truncated {
        /// Its length.
        end: usize,
        /// What should be there.
        what: &'static str,
    },
    /// A vector or a quaternion does not say how many numbers it has.
    #[error(
        "byte {at}: {found} where {expected} should be, the length of {what}: the file is damaged, or no .graph file"
    )]
    Length {
        /// Where it stands in the file.
        at: usize,
        /// What stands there.
        found: u32,
        /// What should stand there.
        expected: u32,
        /// Whose length it is.
        what: &'static str,
    },
    /// A pose is not one.
    #[error(
        "byte {at}: the pose of scan {scan} is not finite, or turns by a quaternion of length 0: the file is damaged"
    )]
    Pose {
        /// Where it stands in the file.
        at: usize,
        /// Which scan of the file, from 0.
        scan: usize,
    },
    /// Something follows the edges.
    #[error("{0} bytes follow the last edge: the file is damaged")]
    Trailing(usize),
}

/// Whether bytes begin as a `.graph` does that has scans: behind two numbers the 3 of a vector. No other file of OctoMap's has that
/// there; in a `.bt` of before 2011 it would be the edge of its voxels, and less than 10⁻³⁰⁰ m.
pub(crate) fn is_graph(bytes: &[u8]) -> bool {
    bytes.get(8..12) == Some(&[3, 0, 0, 0])
}

/// Reads a `.graph` file; the edges are passed over. Never allocates more than a fixed multiple of the bytes that are there.
///
/// # Errors
/// It is no such file, is cut off or damaged.
pub fn read_graph(bytes: &[u8]) -> Result<ScanGraph, GraphError> {
    let mut bytes = Bytes::new(bytes, 0);
    let count = bytes.u32().map_err(|cut| within(cut, "the number of scans"))?;
    let scans = (0..count as usize).map(|scan| read_scan(&mut bytes, scan)).collect::<Result<_, _>>()?;
    let edges = bytes.u32().map_err(|cut| within(cut, "the number of edges"))? as usize;
    bytes.skip(edges.saturating_mul(EDGE)).map_err(|cut| within(cut, "the edges"))?;
    match bytes.left() {
        0 => Ok(ScanGraph { scans }),
        more => Err(GraphError::Trailing(more)),
    }
}

fn within(CutOff { end }: CutOff, what: &'static str) -> GraphError {
    GraphError::Truncated { end, what }
}

fn read_scan(bytes: &mut Bytes<'_>, scan: usize) -> Result<GraphScan, GraphError> {
    let count = bytes.u32().map_err(|cut| within(cut, "the number of points of a scan"))? as usize;
    if count.saturating_mul(VECTOR) > bytes.left() {
        return Err(within(CutOff { end: bytes.at() + bytes.left() }, "the points of a scan"));
    }
    let points = (0..count).map(|_| Ok(Point3::from(numbers(bytes, "a point")?))).collect::<Result<_, _>>()?;
    let at = bytes.at();
    let place = Vector3::from(numbers(bytes, "the place of a pose")?);
    let [u, x, y, z] = numbers(bytes, "the quaternion of a pose")?;
    let id = bytes.u32().map_err(|cut| within(cut, "the number of a scan"))?;
    let rotation = UnitQuaternion::try_new(Quaternion::new(u, x, y, z), f64::MIN_POSITIVE);
    let rotation = rotation.filter(|q| q.coords.iter().all(|c| c.is_finite()));
    match rotation.filter(|_| place.iter().all(|c| c.is_finite())) {
        Some(rotation) => {
            Ok(GraphScan { id, pose: Isometry3::from_parts(Translation3::from(place), rotation), points })
        }
        None => Err(GraphError::Pose { at, scan }),
    }
}

/// `N` numbers behind the word that they are so many.
fn numbers<const N: usize>(bytes: &mut Bytes<'_>, what: &'static str) -> Result<[f64; N], GraphError> {
    let at = bytes.at();
    let found = bytes.u32().map_err(|cut| within(cut, what))?;
    if found as usize != N {
        return Err(GraphError::Length { at, found, expected: N as u32, what });
    }
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = bytes.f64().map_err(|cut| within(cut, what))?;
    }
    Ok(numbers)
}

impl OccupancyMap {
    /// The map of all scans of a graph, in their order.
    ///
    /// # Errors
    /// A setting makes no sense.
    pub fn from_graph(config: MapConfig, graph: &ScanGraph) -> Result<Self, ConfigError> {
        let mut map = Self::new(config)?;
        for scan in &graph.scans {
            let changed = map.insert(scan.origin(), scan.world_points()).changed;
            map.advance(&changed);
        }
        Ok(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn put<const N: usize>(bytes: &mut Vec<u8>, numbers: [f64; N]) {
        bytes.extend((N as u32).to_le_bytes());
        numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    }

    /// The file of these scans, each connected with the one before.
    fn file(scans: &[GraphScan]) -> Vec<u8> {
        let mut bytes = (scans.len() as u32).to_le_bytes().to_vec();
        let put_pose = |bytes: &mut Vec<u8>, pose: &Isometry3<f64>| {
            put(bytes, pose.translation.vector.into());
            let q = pose.rotation;
            put(bytes, [q.w, q.i, q.j, q.k]);
        };
        for scan in scans {
            bytes.extend((scan.points.len() as u32).to_le_bytes());
            scan.points.iter().for_each(|p| put(&mut bytes, [p.x, p.y, p.z]));
            put_pose(&mut bytes, &scan.pose);
            bytes.extend(scan.id.to_le_bytes());
        }
        bytes.extend((scans.len().saturating_sub(1) as u32).to_le_bytes());
        for pair in scans.windows(2) {
            bytes.extend([pair[0].id.to_le_bytes(), pair[1].id.to_le_bytes()].concat());
            put_pose(&mut bytes, &(pair[0].pose.inverse() * pair[1].pose));
            bytes.extend(1f64.to_le_bytes());
        }
        bytes
    }

    fn scans() -> impl Strategy<Value = Vec<GraphScan>> {
        let triple = || prop::array::uniform3(-3.0..3.0f64);
        let scan = (any::<u32>(), triple(), triple(), prop::collection::vec(triple().prop_map(Point3::from), 0..9));
        let scan = scan.prop_map(|(id, place, turn, points)| {
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
            GraphScan { id, pose: Isometry3::from_parts(Vector3::from(place).into(), rotation), points }
        });
        prop::collection::vec(scan, 0..5)
    }

    proptest! {
        #[test]
        fn what_was_written_is_read(scans in scans(), cut in any::<prop::sample::Index>()) {
            let bytes = file(&scans);
            let read = read_graph(&bytes).unwrap();
            prop_assert_eq!(read.scans.len(), scans.len());
            for (read, scan) in read.scans.iter().zip(&scans) {
                prop_assert_eq!((read.id, &read.points), (scan.id, &scan.points));
                prop_assert!(read.pose.rotation.angle_to(&scan.pose.rotation) < 1e-6);
                prop_assert_eq!(read.origin(), scan.origin());
            }
            let cut = &bytes[..cut.index(bytes.len())];
            let is_cut = matches!(read_graph(cut), Err(GraphError::Truncated { end, .. }) if end == cut.len());
            prop_assert!(is_cut);
        }

        #[test]
        fn any_bytes_are_a_graph_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = read_graph(&bytes);
            let _ = read_graph(&[&[1, 0, 0, 0, 255, 255, 255, 255], &bytes[..]].concat());
        }
    }

    #[test]
    fn a_map_is_made_of_what_was_seen_in_the_world() {
        let quarter = UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::FRAC_PI_2);
        let pose = Isometry3::from_parts(Vector3::new(0.05, 0.05, 0.05).into(), quarter);
        let scan = GraphScan { id: 0, pose, points: vec![Point3::new(1.0, 0.0, 0.0)] };
        let map = OccupancyMap::from_graph(MapConfig::default(), &read_graph(&file(&[scan])).unwrap()).unwrap();
        assert_eq!((map.grid().free(), map.grid().occupied(), map.grid().revision()), (10, 1, 1));
        assert!(map.log_odds(elk_geometry::Voxel::new(0, 10, 0)).unwrap() > 0.0);
    }

    #[test]
    fn every_kind_of_damage_has_its_error() {
        let pose = Isometry3::identity();
        let good = file(&[GraphScan { id: 0, pose, points: vec![Point3::origin()] }]);
        let spoilt = |at: usize, with: &[u8]| {
            let mut bytes = good.clone();
            bytes[at..at + with.len()].copy_from_slice(with);
            read_graph(&bytes)
        };
        assert_eq!(spoilt(8, &[9]), Err(GraphError::Length { at: 8, found: 9, expected: 3, what: "a point" }));
        let huge = Err(GraphError::Truncated { end: good.len(), what: "the points of a scan" });
        assert_eq!(spoilt(4, &u32::MAX.to_le_bytes()), huge, "nothing is made ready for what is only announced");
        for (at, number) in [(40, f64::NAN), (68, 0.0), (68, f64::INFINITY)] {
            assert_eq!(
                spoilt(at, &number.to_le_bytes()),
                Err(GraphError::Pose { at: 36, scan: 0 }),
                "{number} at {at}"
            );
        }
        assert_eq!(read_graph(&[&good[..], &[0]].concat()), Err(GraphError::Trailing(1)));
        assert_eq!(read_graph(&[0; 8]), Ok(ScanGraph::default()));
    }
}
