//! Scans for tests and the benchmark, in single precision, as cameras give them and OctoMap takes them.
#![allow(dead_code, reason = "each takes what it needs")]

#[path = "../../../../tests/common/data.rs"]
pub mod data;

use std::io::Write;
use std::path::Path;

use nalgebra::{Point3, Vector3};

/// Where a scan was taken, and its points (m, world).
pub struct Scan {
    pub origin: [f32; 3],
    pub points: Vec<[f32; 3]>,
}

impl Scan {
    pub fn origin(&self) -> Point3<f64> {
        self.origin.map(f64::from).into()
    }

    pub fn points(&self) -> impl Iterator<Item = Point3<f64>> + '_ {
        self.points.iter().map(|point| point.map(f64::from).into())
    }
}

/// 60 scans, 75° wide, on a circle in a closed room of 10×10×3 m with two pillars.
pub fn room(columns: usize, rows: usize) -> Vec<Scan> {
    let single = |p: Point3<f64>| [p.x as f32, p.y as f32, p.z as f32];
    let scan = |i: i32| {
        let angle = f64::from(i) * 0.61;
        let origin = Point3::new(2.2 * angle.cos() + 0.037, 2.2 * angle.sin() + 0.031, 1.37);
        let pixels = (0..columns * rows).map(|p| [p % columns, p / columns]);
        let ray = |[column, row]: [usize; 2]| {
            let pixel =
                |i: usize, of: usize| (2.0 * i as f64 + 1.0 - of as f64) / columns as f64 * 37.5_f64.to_radians().tan();
            single(cast(origin, direction(angle * 2.3, pixel(column, columns), pixel(row, rows))))
        };
        Scan { origin: single(origin), points: pixels.map(ray).collect() }
    };
    (0..60).map(scan).collect()
}

/// Rooms in a row, 5 × 4 × 3 m each with a wall between, seen from the middle of each all around: a scan a room, without end.
pub fn building() -> impl Iterator<Item = Scan> {
    const RAYS: i32 = 160_000;
    let half = [2.5, 2.0, 1.5];
    (0..).map(move |room| {
        let middle = Point3::new(5.0 * f64::from(room) + 0.013, 0.021, 0.017);
        let points = (0..RAYS).map(|i| {
            // Evenly over the sphere, by Fibonacci's spiral.
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(RAYS);
            let (sin, cos) = (2.399_963_229_728_653 * f64::from(i)).sin_cos();
            let direction = Vector3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
            let range = (0..3).map(|axis| half[axis] / direction[axis].abs()).fold(f64::INFINITY, f64::min);
            (middle + direction * range).coords.map(|c| c as f32).into()
        });
        Scan { origin: middle.coords.map(|c| c as f32).into(), points: points.collect() }
    })
}

fn direction(yaw: f64, right: f64, down: f64) -> Vector3<f64> {
    Vector3::new(yaw.cos() + right * yaw.sin(), yaw.sin() - right * yaw.cos(), -down).normalize()
}

/// Where a ray ends: on the room's walls from inside, or on a pillar from outside.
fn cast(origin: Point3<f64>, direction: Vector3<f64>) -> Point3<f64> {
    let slab = |min: [f64; 3], max: [f64; 3]| {
        (0..3).fold((0.0_f64, f64::INFINITY), |(near, far), axis| {
            let to = |wall: f64| (wall - origin[axis]) / direction[axis];
            let (a, b) = (to(min[axis]), to(max[axis]));
            (near.max(a.min(b)), far.min(a.max(b)))
        })
    };
    let (_, wall) = slab([-5.0, -5.0, 0.0], [5.0, 5.0, 3.0]);
    let pillars = [[-0.6, -0.4], [3.1, 2.6]].map(|[x, y]| slab([x, y, 0.0], [x + 0.8, y + 0.8, 2.2]));
    let range = pillars
        .into_iter()
        .filter(|(near, far)| *near > 0.0 && near < far)
        .fold(wall, |range, (near, _)| range.min(near));
    origin + direction * range
}

/// Points of all kinds, by sums and products alone, so that they are the same on every machine: anywhere, on the borders of
/// voxels and in their middles, straight ahead, twice, near and far.
pub fn mixed(scans: usize, points: usize) -> Vec<Scan> {
    let mut state = 12u64;
    let mut next = move |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    let mut coordinate = move |kind: u64, from: f32| match kind {
        0 => next(6_000_000) as f32 * 1e-6 - 3.0,
        1 => next(60) as f32 * 0.1 - 3.0,
        2 => next(60) as f32 * 0.1 - 2.95,
        3 => next(48) as f32 * 0.125 - 3.0,
        4 => from,
        _ => next(40_000) as f32 * 1e-3 - 20.0,
    };
    let mut point = move |kind: usize, from: [f32; 3]| -> [f32; 3] {
        std::array::from_fn(|axis| coordinate((kind + kind / 6 * axis) as u64 % 6, from[axis]))
    };
    (0..scans)
        .map(|i| {
            let origin = point(i % 4, [0.0; 3]);
            let points = (0..points).map(|k| point(k % 36, origin));
            // What is at the sensor itself OctoMap takes for a hit.
            let mut points: Vec<[f32; 3]> = points.filter(|point| *point != origin).collect();
            points.extend_from_within(..points.len() / 10);
            Scan { origin, points }
        })
        .collect()
}

/// A `SCN1` file of the recorded data: per scan the origin and the points, all f32 in the world frame.
pub fn recorded(name: &str) -> Option<Vec<Scan>> {
    let bytes = std::fs::read(data::folder().join("scans").join(name)).ok()?;
    let mut words = bytes[4..].chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]);
    let scans = u32::from_le_bytes(words.next()?);
    let point = |words: &mut dyn Iterator<Item = [u8; 4]>| {
        let mut next = || Some(f32::from_le_bytes(words.next()?));
        Some([next()?, next()?, next()?])
    };
    (0..scans)
        .map(|_| {
            let origin = point(&mut words)?;
            let points = u32::from_le_bytes(words.next()?);
            Some(Scan { origin, points: (0..points).map(|_| point(&mut words)).collect::<Option<_>>()? })
        })
        .collect()
}

/// Writes such a file.
pub fn write(path: &Path, scans: &[Scan]) -> std::io::Result<()> {
    let mut out = std::io::BufWriter::new(std::fs::File::create(path)?);
    out.write_all(b"SCN1")?;
    out.write_all(&(scans.len() as u32).to_le_bytes())?;
    for scan in scans {
        let point = |point: &[f32; 3]| point.map(f32::to_le_bytes).concat();
        out.write_all(&point(&scan.origin))?;
        out.write_all(&(scan.points.len() as u32).to_le_bytes())?;
        scan.points.iter().try_for_each(|p| out.write_all(&point(p)))?;
    }
    out.flush()
}
