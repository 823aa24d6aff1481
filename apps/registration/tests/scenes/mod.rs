//! Scans whose poses are known, since they are rendered here: a room with boxes in it, by rays.

use nalgebra::{Isometry2, Isometry3, Point2, Point3, SVector, Vector2, Vector3};

/// Numbers as drawn by lot, the same each time (SplitMix64, Steele et al., OOPSLA 2014).
pub struct Dice(pub u64);

impl Dice {
    /// From 0 to 1.
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Of a normal distribution with this standard deviation, nearly: a sum of twelve.
    pub fn normal(&mut self, sigma: f64) -> f64 {
        sigma * ((0..12).map(|_| self.next()).sum::<f64>() - 6.0)
    }
}

/// A box with sides along the axes: its least and its largest corner, metres.
type Block<const D: usize> = [[f64; D]; 2];

/// A room and what stands in it.
pub struct Room<const D: usize> {
    pub walls: Block<D>,
    pub blocks: Vec<Block<D>>,
}

/// A room of 6 × 5 × 2.6 m with a cupboard, a table and a beam.
pub fn room() -> Room<3> {
    let blocks = vec![
        [[2.2, -2.5, 0.0], [3.0, -1.0, 1.9]],
        [[-1.5, 1.0, 0.6], [0.3, 2.0, 0.75]],
        [[-3.0, -2.5, 2.2], [-2.7, 2.5, 2.6]],
        [[-2.4, -2.2, 0.0], [-1.9, -1.7, 1.1]],
    ];
    Room { walls: [[-3.0, -2.5, 0.0], [3.0, 2.5, 2.6]], blocks }
}

/// The plan of such a room.
pub fn plan() -> Room<2> {
    let blocks = vec![[[2.2, -2.5], [3.0, -1.0]], [[-1.5, 1.0], [0.3, 2.0]], [[-2.4, -2.2], [-1.9, -1.7]]];
    Room { walls: [[-3.0, -2.5], [3.0, 2.5]], blocks }
}

impl<const D: usize> Room<D> {
    /// How far a ray goes from a place inside.
    fn range(&self, from: SVector<f64, D>, along: SVector<f64, D>) -> f64 {
        let crossings = |block: &Block<D>| {
            (0..D).fold((f64::NEG_INFINITY, f64::INFINITY), |(enters, leaves), axis| {
                let [a, b] = [0, 1].map(|side| (block[side][axis] - from[axis]) / along[axis]);
                (enters.max(a.min(b)), leaves.min(a.max(b)))
            })
        };
        let blocks = self.blocks.iter().map(crossings).filter(|(enters, leaves)| enters < leaves && *enters > 0.0);
        blocks.map(|(enters, _)| enters).fold(crossings(&self.walls).1, f64::min)
    }
}

/// What a depth camera of 100° × 80° sees, x forward, with noise along its rays; in its frame.
pub fn camera(room: &Room<3>, pose: &Isometry3<f64>, sigma: f64, dice: &mut Dice) -> Vec<Point3<f32>> {
    let mut points = Vec::new();
    for row in 0..80 {
        for column in 0..100 {
            let [y, z] = [(f64::from(column) - 49.5) / 42.0, (f64::from(row) - 39.5) / 48.0];
            let ray = Vector3::new(1.0, y, z).normalize();
            let range = room.range(pose.translation.vector, pose.rotation * ray) + dice.normal(sigma);
            points.push((ray * range).cast::<f32>().into());
        }
    }
    points
}

/// What a laser with 360 beams all around sees, with noise; in its frame.
pub fn laser(room: &Room<2>, pose: &Isometry2<f64>, sigma: f64, dice: &mut Dice) -> Vec<Point2<f32>> {
    let beam = |i: i32| {
        let (sin, cos) = (f64::from(i) + 0.5).to_radians().sin_cos();
        let ray = Vector2::new(cos, sin);
        let range = room.range(pose.translation.vector, pose.rotation * ray) + dice.normal(sigma);
        (ray * range).cast::<f32>().into()
    };
    (0..360).map(beam).collect()
}
