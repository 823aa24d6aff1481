//! Pairs of images of scenes whose distances are known, rendered as two cameras side by side would see them.

use elk_stereo::{Image, triangulation::Rig};
use nalgebra::{Point3, Vector3};

pub const WIDTH: usize = 200;
pub const HEIGHT: usize = 120;

/// How far from a place along a direction something is met.
pub type Scene = fn(&Point3<f64>, &Vector3<f64>) -> f64;

/// Two cameras 0.1 m apart that see the scenes' depth of 1.5 to 3 m at disparities of 5 to 10.
pub fn rig() -> Rig {
    Rig::new(150.0, [59.5, 99.5], 0.1).unwrap()
}

/// A wall straight ahead.
pub fn wall(origin: &Point3<f64>, direction: &Vector3<f64>) -> f64 {
    (2.0 - origin.z) / direction.z
}

/// A wall that comes nearer to the right and upwards.
pub fn slanted_wall(origin: &Point3<f64>, direction: &Vector3<f64>) -> f64 {
    let normal = Vector3::new(-0.3, 0.2, -1.0);
    (Point3::new(0.0, 0.0, 2.0) - origin).dot(&normal) / direction.dot(&normal)
}

/// A ball of 0.5 m before a wall.
pub fn ball(origin: &Point3<f64>, direction: &Vector3<f64>) -> f64 {
    let from = origin - Point3::new(0.1, 0.0, 2.0);
    let (a, b, c) = (direction.norm_squared(), direction.dot(&from), from.norm_squared() - 0.25);
    let within = b * b - a * c;
    if within > 0.0 { (-b - within.sqrt()) / a } else { (3.0 - origin.z) / direction.z }
}

/// A number from 0 to 1 for each corner of a lattice, the same each time.
fn random(corner: [i64; 3]) -> f64 {
    let mixed = corner.iter().fold(0x9e37_79b9_7f4a_7c15u64, |state, &x| {
        let state = (state ^ x as u64).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        state ^ state >> 29
    });
    (mixed.wrapping_mul(0x94d0_49bb_1331_11eb) >> 40) as f64 / (1u64 << 24) as f64
}

/// A texture in space whose spots are of a size: random numbers at the corners of a lattice, and between them what lies between.
fn texture(point: &Point3<f64>, size: f64) -> f64 {
    let scaled = point / size;
    let base = scaled.map(f64::floor);
    let part = scaled - base;
    let corners = (0..8).map(|corner| {
        let at = [0, 1, 2].map(|axis| corner >> axis & 1);
        let weight: f64 = (0..3).map(|axis| if at[axis] == 1 { part[axis] } else { 1.0 - part[axis] }).product();
        weight * random([0, 1, 2].map(|axis| base[axis] as i64 + at[axis]))
    });
    corners.sum()
}

/// What a camera of the rig sees, `right` of the left one by so many metres.
fn view(rig: &Rig, scene: Scene, right: f64) -> Image {
    let origin = Point3::new(right, 0.0, 0.0);
    Image::from_fn(WIDTH, HEIGHT, |row, column| {
        let [center_row, center_column] = rig.center();
        // Four rays a pixel, as a sensor's pixel gathers light.
        let grey: f64 = [(-0.25, -0.25), (-0.25, 0.25), (0.25, -0.25), (0.25, 0.25)]
            .iter()
            .map(|(dy, dx)| {
                let (x, y) = (column as f64 + dx - center_column, row as f64 + dy - center_row);
                let direction = Vector3::new(x / rig.focal(), y / rig.focal(), 1.0);
                let point = origin + direction * scene(&origin, &direction);
                (texture(&point, 0.04) + texture(&point, 0.1)) * 31.0
            })
            .sum();
        grey as u8
    })
    .unwrap()
}

/// What both cameras see.
pub fn pair(scene: Scene) -> [Image; 2] {
    [0.0, rig().baseline()].map(|right| view(&rig(), scene, right))
}

/// The true disparity of a pixel of the left image (thesis 3.9).
pub fn truth(scene: Scene, row: usize, column: usize) -> f64 {
    let rig = rig();
    let [center_row, center_column] = rig.center();
    let (x, y) = (column as f64 - center_column, row as f64 - center_row);
    let direction = Vector3::new(x / rig.focal(), y / rig.focal(), 1.0);
    rig.focal() * rig.baseline() / scene(&Point3::origin(), &direction)
}
