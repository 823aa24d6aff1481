//! A ray's walk over the voxels in OctoMap's own arithmetic (`computeRayKeys` in OcTreeBaseImpl.hxx, after Amanatides and Woo,
//! *A Fast Voxel Traversal Algorithm for Ray Tracing*, 1987): points and directions in single precision, distances along the
//! ray in double precision and added up step by step. Which voxels a ray passes depends on its rounding, so a map that is to
//! equal OctoMap's has to round as it does.

use elk_geometry::Voxel;
use elk_geometry::voxel::INDEX_RANGE;

/// A point or direction as OctoMap has it (m, world).
pub type Point = [f32; 3];

/// Where the voxels are.
#[derive(Debug, Clone, Copy)]
pub struct Lattice {
    /// Edge of a voxel (m).
    pub resolution: f64,
    per_metre: f64,
}

impl Lattice {
    /// Voxels of `resolution` (m).
    pub fn new(resolution: f64) -> Self {
        Self { resolution, per_metre: 1.0 / resolution }
    }

    /// Voxels a metre.
    pub fn per_metre(&self) -> f64 {
        self.per_metre
    }

    /// The voxel that holds a point (`coordToKey`); of one too far away for an index, none that a map has.
    #[inline]
    pub fn voxel(&self, point: Point) -> Voxel {
        let index = |c: f32| floor(self.per_metre * f64::from(c));
        Voxel::new(index(point[0]), index(point[1]), index(point[2]))
    }

    /// The middle of a voxel (`keyToCoord`).
    pub fn center(&self, voxel: Voxel) -> Point {
        voxel.to_array().map(|k| self.middle(k) as f32)
    }

    /// Whether OctoMap has a key for the voxel of a point, and it is one.
    pub fn has(&self, point: Point) -> bool {
        let end = f64::from(*INDEX_RANGE.end()) + 1.0;
        point.iter().all(|c| (-end..end).contains(&(self.per_metre * f64::from(*c))))
    }

    /// How far `from` is from the border of its voxel (of index `k`) against which a ray runs that goes up, or down, along this
    /// axis (m; as OctoMap rounds it).
    pub fn border_ahead(&self, from: f32, k: i32, step: i32) -> f64 {
        let border = self.middle(k) + f64::from((f64::from(step) * self.resolution * 0.5) as f32);
        border - f64::from(from)
    }

    fn middle(&self, k: i32) -> f64 {
        (f64::from(k) + 0.5) * self.resolution
    }
}

/// The whole number at or below `x`, without the call that it takes where the processor may be an old one.
#[inline]
fn floor(x: f64) -> i32 {
    let towards_zero = x as i32;
    towards_zero.saturating_sub(i32::from(f64::from(towards_zero) > x))
}

/// The direction of a ray, of length 1, and its length (m).
#[inline]
pub fn direction_and_length(from: Point, to: Point) -> (Point, f32) {
    let [x, y, z] = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
    let length = f64::from(x * x + y * y + z * z).sqrt() as f32;
    ([x / length, y / length, z / length], length)
}

/// The voxels that a ray passes, one after the other: from that of its start on, without that of its end.
#[derive(Debug, Clone)]
pub struct Walk {
    at: [i32; 3],
    end: [i32; 3],
    step: [i32; 3],
    /// How far along the ray the next border is on each axis, and how far apart they are (m).
    next: [f64; 3],
    apart: [f64; 3],
    length: f64,
    /// Voxels that it passes at most, whatever rounding does.
    left: u32,
}

impl Walk {
    /// The walk from `from` to `to`, both in the map.
    pub fn new(lattice: &Lattice, from: Point, to: Point) -> Self {
        let (direction, length) = direction_and_length(from, to);
        let (at, end) = (lattice.voxel(from).to_array(), lattice.voxel(to).to_array());
        let steps: u32 = (0..3).map(|axis| at[axis].abs_diff(end[axis])).sum();
        let mut walk = Self {
            at,
            end,
            step: [0; 3],
            next: [f64::MAX; 3],
            apart: [f64::MAX; 3],
            length: f64::from(length),
            // So near that its length is 0, a ray has no direction.
            left: if steps == 0 || length == 0.0 { steps.min(1) } else { steps + 3 },
        };
        for axis in 0..3 {
            let along = f64::from(direction[axis]);
            if along != 0.0 && !along.is_nan() {
                walk.step[axis] = if along > 0.0 { 1 } else { -1 };
                walk.next[axis] = lattice.border_ahead(from[axis], at[axis], walk.step[axis]) / along;
                walk.apart[axis] = lattice.resolution / along.abs();
            }
        }
        walk
    }
}

impl Iterator for Walk {
    type Item = Voxel;

    fn next(&mut self) -> Option<Voxel> {
        self.left = self.left.checked_sub(1)?;
        let passed = Voxel::from(self.at);
        let [x, y, z] = self.next;
        let axis = match (x < y, x < z, y < z) {
            (true, true, _) => 0,
            (false, _, true) => 1,
            _ => 2,
        };
        self.at[axis] += self.step[axis];
        self.next[axis] += self.apart[axis];
        let [x, y, z] = self.next;
        if self.at == self.end || x.min(y).min(z) > self.length {
            self.left = 0;
        }
        Some(passed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_geometry::voxel::FACES;
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            -3.0..3.0f32,
            (-30..30i32).prop_map(|k| k as f32 * 0.1),
            (-30..30i32).prop_map(|k| k as f32 * 0.25),
            -3276.0..3276.0f32,
            Just(1e-30),
            Just(-1e-30),
        ]
    }

    proptest! {
        #[test]
        fn it_goes_face_to_face_along_the_ray(a in prop::array::uniform3(coordinate()), b in prop::array::uniform3(coordinate())) {
            let lattice = Lattice::new(0.1);
            let passed: Vec<Voxel> = Walk::new(&lattice, a, b).collect();
            prop_assert_eq!(passed.is_empty(), lattice.voxel(a) == lattice.voxel(b));
            prop_assert!(passed.first().is_none_or(|first| *first == lattice.voxel(a)));
            prop_assert!(!passed.contains(&lattice.voxel(b)));
            prop_assert!(passed.windows(2).all(|pair| FACES.contains(&(pair[1] - pair[0]))));
            let [a, b] = [a, b].map(|p| nalgebra::Point3::from(p.map(f64::from)));
            for voxel in passed {
                let v = voxel.center(0.1);
                let t = ((v - a).dot(&(b - a)) / (b - a).norm_squared().max(1e-12)).clamp(0.0, 1.0);
                // Half a diagonal, and what single precision leaves out.
                prop_assert!((v - (a + (b - a) * t)).norm() < 0.0867 + 1e-6 * (b - a).norm());
            }
        }

        #[test]
        fn a_point_is_in_its_voxel(x in -3276.0..3276.0f64) {
            prop_assert_eq!(floor(x), x.floor() as i32);
            let lattice = Lattice::new(0.1);
            let center = lattice.center(Voxel::new(x as i32, 0, -1));
            prop_assert_eq!(lattice.voxel(center), Voxel::new(x as i32, 0, -1));
        }
    }
}
