//! Depth scans as they travel: points where they were written, never copied on the way.

use std::borrow::Cow;

use elk_bus::describe::Shape;
use elk_bus::{Describe, payload};
use elk_geometry::Pose;
use nalgebra::{Point3, Vector3};
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::camera::CameraInfo;
use crate::checks;
use crate::pixels::{PixelRun, PixelTally};

/// Bytes of a point on the wire: three little-endian f32.
const POINT_BYTES: usize = 12;

/// A list of points (m, f32), kept as the bytes that travel. A receiver borrows them in place.
#[derive(Clone, PartialEq, Default)]
pub struct Points<'a>(Cow<'a, [u8]>);

impl<'a> Points<'a> {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.0.len() / POINT_BYTES
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The points in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Point3<f32>> + '_ {
        self.0.chunks_exact(POINT_BYTES).map(|c| {
            let at = |i: usize| f32::from_le_bytes([c[i], c[i + 1], c[i + 2], c[i + 3]]);
            Point3::new(at(0), at(4), at(8))
        })
    }

    /// The packed bytes: x, y, z as little-endian f32, 12 bytes a point, as viewers' point clouds want them.
    pub fn as_bytes(&self) -> &[u8] {
        &self.0
    }

    /// The same points, owned.
    pub fn into_owned(self) -> Points<'static> {
        Points(Cow::Owned(self.0.into_owned()))
    }
}

impl FromIterator<Point3<f32>> for Points<'static> {
    fn from_iter<I: IntoIterator<Item = Point3<f32>>>(points: I) -> Self {
        let points = points.into_iter();
        let mut bytes = Vec::with_capacity(POINT_BYTES * points.size_hint().0);
        for point in points {
            let mut own = [0; POINT_BYTES];
            own.chunks_exact_mut(4).zip(point.iter()).for_each(|(bytes, c)| bytes.copy_from_slice(&c.to_le_bytes()));
            bytes.extend_from_slice(&own);
        }
        Points(Cow::Owned(bytes))
    }
}

impl std::fmt::Debug for Points<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} points", self.len())
    }
}

impl Serialize for Points<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(&self.0)
    }
}

impl<'de: 'a, 'a> Deserialize<'de> for Points<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct InPlace;
        impl<'de> Visitor<'de> for InPlace {
            type Value = Points<'de>;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "packed points, {POINT_BYTES} bytes each")
            }
            fn visit_borrowed_bytes<E: Error>(self, bytes: &'de [u8]) -> Result<Points<'de>, E> {
                match bytes.len() % POINT_BYTES {
                    0 => Ok(Points(Cow::Borrowed(bytes))),
                    _ => Err(E::invalid_length(bytes.len(), &self)),
                }
            }
            fn visit_byte_buf<E: Error>(self, bytes: Vec<u8>) -> Result<Points<'de>, E> {
                match bytes.len() % POINT_BYTES {
                    0 => Ok(Points(Cow::Owned(bytes))),
                    _ => Err(E::invalid_length(bytes.len(), &self)),
                }
            }
        }
        deserializer.deserialize_bytes(InPlace)
    }
}

/// Points and directions that are not finite the map leaves out one by one; to look for them here would cost a walk over all.
impl Describe for Points<'_> {
    const SHAPE: Shape = Shape::Packed(&Shape::Array(&Shape::Float(4), 3));
}

/// What a depth camera saw from one pose.
#[payload]
#[describe(check = check, drawn = "points")]
#[derive(Debug, Clone, PartialEq)]
pub struct Scan<'a> {
    /// Number of the scan, from 1, unbroken: filters and the map hand it on.
    #[describe(count)]
    pub id: u64,
    /// The pose command that it answers (see [`crate::messages::PoseCommand::id`]); 0: none.
    #[describe(count)]
    pub command: u64,
    /// Pose of the camera at capture (world).
    pub pose: Pose,
    /// What the camera can see.
    pub camera: CameraInfo,
    /// Points that the sensor measured. Filters hand the number on, so that it can be told what they left out.
    pub measured: u64,
    /// What became of each pixel, of a camera that matches images: which of them saw nothing because nothing could be matched, and
    /// why. Filters hand it on. Empty: the sensor does not say.
    #[describe(longest = checks::MAX_POINTS, default)]
    pub pixel_runs: Vec<PixelRun>,
    /// Directions in the camera frame (unit vectors) in which the sensor saw that there is nothing up to its range. A pixel
    /// that measured nothing for any other reason is not among them: of its ray nothing is known.
    #[serde(borrow)]
    #[describe(longest = checks::MAX_POINTS)]
    pub no_return: Points<'a>,
    /// Points in the camera frame (x right, y down, z forward; m).
    #[serde(borrow)]
    #[describe(unit = "m", longest = checks::MAX_POINTS)]
    pub points: Points<'a>,
}

impl<'a> Scan<'a> {
    /// The scan of a camera of which nothing is known, and which saw these points and nothing else.
    pub fn new(id: u64, command: u64, pose: Pose, points: Points<'a>) -> Self {
        let (camera, measured) = (CameraInfo::default(), points.len() as u64);
        Self { id, command, pose, camera, measured, pixel_runs: Vec::new(), no_return: Points::default(), points }
    }

    /// The same scan with other points: what a filter makes of it.
    pub fn with_points(&self, points: impl IntoIterator<Item = Point3<f32>>) -> Scan<'static> {
        let (no_return, pixel_runs) = (self.no_return.clone().into_owned(), self.pixel_runs.clone());
        Scan { points: points.into_iter().collect(), no_return, pixel_runs, ..*self }
    }

    /// The same scan, owned.
    pub fn into_owned(self) -> Scan<'static> {
        let (points, no_return) = (self.points.into_owned(), self.no_return.into_owned());
        Scan { points, no_return, ..self }
    }

    /// The directions without a return in the world frame (unit vectors).
    pub fn world_no_return(&self) -> impl ExactSizeIterator<Item = Vector3<f64>> + '_ {
        self.no_return.iter().map(|p| self.pose.turn(p.coords.cast()))
    }

    /// The points in the world frame (m).
    pub fn world_points(&self) -> impl ExactSizeIterator<Item = Point3<f64>> + '_ {
        self.points.iter().map(|p| self.pose.to_world(p.cast()))
    }
}

/// Its count of points is one, and what is said of pixels is of all that the camera has, or of none.
fn check(scan: &Scan<'_>) -> checks::Checked {
    let measured = scan.points.len() as u64..=checks::MAX_POINTS as u64;
    let wanted = "at least the number of points, and below 2^22 + 1";
    checks::holds("measured", measured.contains(&scan.measured), scan.measured, wanted)?;
    let (said, all) =
        (PixelTally::of(&scan.pixel_runs).total(), u64::from(scan.camera.columns) * u64::from(scan.camera.rows));
    let wanted = "as many pixels as the camera's columns times rows, or none";
    checks::holds("pixel_runs", said == 0 || said == all, said, wanted)
}

#[cfg(test)]
mod tests {
    use elk_bus::describe::Description;
    use serde_json::json;

    use super::*;

    /// As scans were recorded before they said what became of pixels.
    mod old {
        use super::*;

        #[payload]
        #[derive(Debug, Clone, PartialEq)]
        pub struct Scan<'a> {
            #[describe(count)]
            pub id: u64,
            #[describe(count)]
            pub command: u64,
            pub pose: Pose,
            pub camera: CameraInfo,
            pub measured: u64,
            #[serde(borrow)]
            pub no_return: Points<'a>,
            #[serde(borrow)]
            #[describe(unit = "m")]
            pub points: Points<'a>,
        }
    }

    #[test]
    fn a_scan_of_an_older_log_says_nothing_of_pixels() {
        let [old, new] = [&old::Scan::SHAPE, &Scan::SHAPE].map(Description::of);
        let mut said = crate::samples::named("Scan").unwrap().value();
        said.as_object_mut().unwrap().remove("pixel_runs");
        let bytes = old.to_bytes(&said).unwrap();
        let converted = old.conversion_to(&new).unwrap().convert(&bytes).unwrap();
        let read = new.to_json(&converted, usize::MAX).unwrap();
        assert_eq!((&read["pixel_runs"], &read["points"]), (&json!([]), &said["points"]));
        assert_eq!(
            new.conversion_to(&old).unwrap().convert(&converted).unwrap(),
            bytes,
            "and whoever is older reads it"
        );
    }

    #[test]
    fn what_is_made_of_a_scan_says_the_same_of_its_pixels() {
        let scan = Scan::new(1, 1, Pose::from_yaw_pitch(Point3::origin(), 0.0, 0.0), Points::default());
        let pixel_runs = vec![PixelRun { outcome: 1, pixels: 6 }];
        let camera = CameraInfo { columns: 3, rows: 2, ..CameraInfo::default() };
        let scan = Scan { camera, pixel_runs: pixel_runs.clone(), ..scan };
        assert_eq!(scan.with_points([]).pixel_runs, pixel_runs);
        assert_eq!(scan.into_owned().pixel_runs, pixel_runs);
    }
}
