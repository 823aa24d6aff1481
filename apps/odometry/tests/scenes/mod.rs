//! A furnished room whose surfaces are textured, and what two cameras see of it: the truth is known, since it is made by hand.

// Each test and bench uses a part of it.
#![allow(dead_code)]

use elk_geometry::random::Random;
use elk_stereo::{Camera, Image, StereoCalibration};
use nalgebra::{Isometry3, Point3, Vector3};

/// A box along the axes: its least and its largest corner, metres.
type Cuboid = [[f64; 3]; 2];

/// The room, seen from within: x right, y down, z forward.
const ROOM: Cuboid = [[-3.0, -1.5, -3.0], [3.0, 1.2, 4.0]];
/// What stands in it.
const FURNITURE: [Cuboid; 5] = [
    [[-2.6, -0.2, 2.2], [-1.4, 1.2, 3.2]],
    [[-0.4, 0.5, 2.6], [0.6, 1.2, 3.4]],
    [[1.5, -1.0, 1.8], [2.2, 1.2, 2.6]],
    [[-3.0, 0.2, -1.5], [-2.3, 1.2, 0.8]],
    [[2.4, -1.5, -1.2], [3.0, 1.2, -0.2]],
];

/// Where a ray enters a cuboid and where it leaves it, in lengths of its direction.
fn passage([least, most]: &Cuboid, origin: &Point3<f64>, direction: &Vector3<f64>) -> [f64; 2] {
    (0..3).fold([f64::MIN, f64::MAX], |[enters, leaves], axis| {
        let [a, b] = [least, most].map(|corner| (corner[axis] - origin[axis]) / direction[axis]);
        [enters.max(a.min(b)), leaves.min(a.max(b))]
    })
}

/// The first surface on a ray.
fn hit(origin: &Point3<f64>, direction: &Vector3<f64>) -> Point3<f64> {
    let [_, wall] = passage(&ROOM, origin, direction);
    let nearest = FURNITURE.iter().fold(wall, |nearest, cuboid| {
        let [enters, leaves] = passage(cuboid, origin, direction);
        if enters > 0.0 && enters < leaves { nearest.min(enters) } else { nearest }
    });
    origin + direction * nearest
}

/// A number from 0 to 1 for each corner of a lattice, the same each time.
fn at_corner([x, y, z]: [i64; 3]) -> f64 {
    let mixed = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ (y as u64).wrapping_mul(0xbf58_476d_1ce4_e5b9)
        ^ (z as u64).wrapping_mul(0x94d0_49bb_1331_11eb);
    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xd6e8_feb8_6659_fd93);
    ((mixed ^ mixed >> 32) >> 40 & 0xff_ffff) as f64 / (1u64 << 24) as f64
}

/// A texture in space whose spots are of a size: numbers at the corners of a lattice, and between them what lies between.
fn texture(point: &Point3<f64>, size: f64) -> f64 {
    let scaled = point.coords / size;
    let base = scaled.map(f64::floor);
    // A smooth step, since light that falls on a pixel comes from around it.
    let part = (scaled - base).map(|x| x * x * (3.0 - 2.0 * x));
    (0..8)
        .map(|corner| {
            let at = [0, 1, 2].map(|axis| corner >> axis & 1);
            let weight: f64 = (0..3).map(|axis| if at[axis] == 1 { part[axis] } else { 1.0 - part[axis] }).product();
            weight * at_corner([0, 1, 2].map(|axis| base[axis] as i64 + at[axis]))
        })
        .sum()
}

/// Two cameras, with the ray of each of their pixels.
pub struct Cameras {
    pub calibration: StereoCalibration,
    rays: [Vec<Vector3<f64>>; 2],
}

impl Cameras {
    pub fn new(calibration: StereoCalibration) -> Self {
        let rays = |camera: Camera| {
            let [width, height] = camera.size;
            let ray = |i: usize| {
                let [x, y] = camera.ray([(i % width) as f64, (i / width) as f64]);
                Vector3::new(x, y, 1.0)
            };
            (0..width * height).map(ray).collect()
        };
        Self { calibration, rays: [calibration.left, calibration.right].map(rays) }
    }

    /// Two of 320 × 240 pixels without lenses, 0.12 m apart.
    pub fn small() -> Self {
        let camera =
            Camera { size: [320, 240], focal: [200.0; 2], center: [159.5, 119.5], distortion: Default::default() };
        let right_from_left = Isometry3::translation(-0.12, 0.0, 0.0);
        Self::new(StereoCalibration { left: camera, right: camera, right_from_left })
    }

    /// What both see where the left one is at a pose in the room (its frame → the room's). The right one is a little darker, and each grey value
    /// has an error of 1.5 that `seed` draws.
    pub fn view(&self, pose: &Isometry3<f64>, seed: u64) -> [Image; 2] {
        let right = pose * self.calibration.right_from_left.inverse();
        [(0, *pose, 1.0), (1, right, 0.93)].map(|(side, pose, gain)| {
            let [width, height] = self.calibration.left.size;
            let mut random = Random::new(seed, side as u64);
            let rotation = pose.rotation.to_rotation_matrix();
            let origin = Point3::from(pose.translation.vector);
            Image::from_fn(width, height, |row, column| {
                let point = hit(&origin, &(rotation * self.rays[side][row * width + column]));
                let bits = random.next_u64();
                // The sum of four even numbers is nearly normal, of variance 1/3.
                let noise: f64 =
                    (0..4).map(|i| (bits >> (16 * i) & 0xffff) as f64 / 65536.0 - 0.5).sum::<f64>() * 3f64.sqrt();
                let grey =
                    25.0 + 60.0 * texture(&point, 0.06) + 70.0 * texture(&point, 0.2) + 60.0 * texture(&point, 0.9);
                (gain * grey + 1.5 * noise).round().clamp(0.0, 255.0) as u8
            })
            .unwrap()
        })
    }
}

/// A pair that shows nothing.
pub fn blank([width, height]: [usize; 2]) -> [Image; 2] {
    [0, 1].map(|_| Image::from_fn(width, height, |_, _| 90).unwrap())
}
