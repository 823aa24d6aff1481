//! Walking a segment voxel by voxel (Amanatides and Woo, *A Fast Voxel Traversal Algorithm for Ray Tracing*, 1987).

use nalgebra::Point3;

use crate::voxel::Voxel;

/// The voxels that a segment passes through, in order, the first and the last included.
#[derive(Debug, Clone)]
pub struct Traversal {
    voxel: Voxel,
    step: [i32; 3],
    t_next: [f64; 3],
    t_delta: [f64; 3],
    /// Steps still to take along each axis: rounding may put a boundary too early, never one too many.
    left: [u32; 3],
    arrived: bool,
}

impl Traversal {
    /// The voxels of edge `resolution` from `from` to `to` (m, world).
    ///
    /// Along each axis it takes as many steps as lie between the two end voxels, so the walk always ends in the voxel
    /// of `to`, whatever rounding does on the way.
    pub fn new(from: Point3<f64>, to: Point3<f64>, resolution: f64) -> Self {
        let (first, last) = (Voxel::containing(from, resolution), Voxel::containing(to, resolution));
        let direction = to - from;
        let (mut step, mut t_next, mut t_delta) = ([0; 3], [f64::INFINITY; 3], [f64::INFINITY; 3]);
        let (first_a, last_a) = (first.to_array(), last.to_array());
        for axis in 0..3 {
            // Along an axis on which the ends share a voxel there is no step to take, whatever the direction says.
            let sign = last_a[axis].cmp(&first_a[axis]) as i32;
            if sign != 0 {
                let boundary = (f64::from(first_a[axis]) + f64::from(sign.max(0))) * resolution;
                step[axis] = sign;
                t_next[axis] = (boundary - from[axis]) / direction[axis];
                t_delta[axis] = resolution / direction[axis].abs();
            }
        }
        let left = std::array::from_fn(|axis| last_a[axis].abs_diff(first_a[axis]));
        Self { voxel: first, step, t_next, t_delta, left, arrived: false }
    }
}

impl Iterator for Traversal {
    type Item = Voxel;

    fn next(&mut self) -> Option<Voxel> {
        if self.arrived {
            return None;
        }
        let current = self.voxel;
        if self.left == [0; 3] {
            self.arrived = true;
            return Some(current);
        }
        let [x, y, z] = self.t_next;
        let axis = if x <= y && x <= z {
            0
        } else if y <= z {
            1
        } else {
            2
        };
        match axis {
            0 => self.voxel.x += self.step[0],
            1 => self.voxel.y += self.step[1],
            _ => self.voxel.z += self.step[2],
        }
        self.left[axis] -= 1;
        self.t_next[axis] = if self.left[axis] == 0 { f64::INFINITY } else { self.t_next[axis] + self.t_delta[axis] };
        Some(current)
    }
}

/// How far (as a share of its edge) a segment has to be inside a voxel to lead through it.
const THROUGH: f64 = 0.1;

/// The voxels of edge `resolution` (m) that the segment from `from` to `to` (m, world) leads through, by more than a tenth of their edge
/// inside all their faces: rounding decides of none of them, and it cuts no corner.
pub fn led_through(from: Point3<f64>, to: Point3<f64>, resolution: f64) -> impl Iterator<Item = Voxel> {
    Traversal::new(from, to, resolution).filter(move |voxel| leads_through(from, to, *voxel, resolution))
}

/// Whether it leads through this one.
pub(crate) fn leads_through(from: Point3<f64>, to: Point3<f64>, voxel: Voxel, resolution: f64) -> bool {
    let half = (0.5 - THROUGH) * resolution;
    let (center, way) = (voxel.center(resolution), to - from);
    let mut part = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        let ends = [center[axis] - half - from[axis], center[axis] + half - from[axis]];
        part = match way[axis] == 0.0 {
            true if ends[0] <= 0.0 && ends[1] >= 0.0 => part,
            true => return false,
            false => {
                let [one, other] = ends.map(|end| end / way[axis]);
                (part.0.max(one.min(other)), part.1.min(one.max(other)))
            }
        };
    }
    part.0 <= part.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_led_through_is_no_corner() {
        let at = |x: f64, y: f64| Point3::new(x, y, 0.05);
        let through = |from, to| led_through(from, to, 0.1).map(|voxel| [voxel.x, voxel.y]).collect::<Vec<_>>();
        assert_eq!(through(at(0.05, 0.05), at(0.35, 0.05)), [[0, 0], [1, 0], [2, 0], [3, 0]]);
        assert_eq!(through(at(0.05, 0.05), at(0.251, 0.25)), [[0, 0], [1, 1], [2, 2]], "no neighbour of a diagonal");
        assert_eq!(through(at(0.05, 0.005), at(0.25, 0.005)), [[0i32; 2]; 0], "along their faces");
        assert_eq!(through(at(0.05, 0.05), at(0.05, 0.05)), [[0, 0]]);
    }

    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![-3.0..3.0f64, (-30..30i32).prop_map(|i| f64::from(i) * 0.1)]
    }

    #[test]
    fn a_segment_to_far_away_begins_like_any_other() {
        for far in [1e300, f64::INFINITY] {
            let walk = Traversal::new(Point3::new(-0.05, 0.05, 0.05), Point3::new(far, 0.05, 0.05), 0.1);
            assert!(walk.take(3).map(|voxel| voxel.x).eq(-1..2));
        }
    }

    proptest! {
        #[test]
        fn a_walk_goes_face_to_face_and_arrives(a in prop::array::uniform3(coordinate()), b in prop::array::uniform3(coordinate())) {
            let (a, b) = (Point3::from(a), Point3::from(b));
            let cells: Vec<Voxel> = Traversal::new(a, b, 0.1).collect();
            prop_assert_eq!(cells[0], Voxel::containing(a, 0.1));
            prop_assert_eq!(*cells.last().unwrap(), Voxel::containing(b, 0.1));
            for pair in cells.windows(2) {
                let d = pair[1] - pair[0];
                prop_assert_eq!(d.x.abs() + d.y.abs() + d.z.abs(), 1);
            }
            // Every voxel on the way lies within half a diagonal of the segment.
            for v in &cells {
                let t = ((v.center(0.1) - a).dot(&(b - a)) / (b - a).norm_squared().max(1e-12)).clamp(0.0, 1.0);
                prop_assert!((v.center(0.1) - (a + (b - a) * t)).norm() < 0.0867);
            }
        }
    }
}
