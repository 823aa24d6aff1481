//! Rays, and where they hit triangles and boxes without slipping between two triangles that share an edge.

use elk_geometry::Bounds;
use nalgebra::{Point3, Vector3};

use crate::triangle::Triangle;

/// A half-line, prepared for the watertight test: sheared and scaled so that it runs along the third axis.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    origin: Point3<f64>,
    inverse: Vector3<f64>,
    /// Whether it runs along none of the planes between the axes.
    is_oblique: bool,
    /// The axes in the order in which the test uses them, the ray's dominant one last.
    axes: [usize; 3],
    /// Its origin, in that order.
    from: [f64; 3],
    shear: [f64; 3],
}

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// How far along the ray, in lengths of its direction.
    pub t: f64,
    /// Whether the ray comes from the triangle's front, the side from which it is anticlockwise.
    pub front: bool,
}

impl Ray {
    /// The ray from `origin` (m, world) along `direction` (any length but zero: [`Hit::t`] is counted in it).
    pub fn new(origin: Point3<f64>, direction: Vector3<f64>) -> Self {
        let z = direction.iamax();
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if direction[z] < 0.0 {
            // Keeps the sense of rotation of the triangles.
            std::mem::swap(&mut x, &mut y);
        }
        let scale = 1.0 / direction[z];
        Self {
            origin,
            inverse: direction.map(|c| 1.0 / c),
            is_oblique: direction.iter().all(|c| (1.0 / c).is_finite()),
            axes: [x, y, z],
            from: [origin[x], origin[y], origin[z]],
            shear: [direction[x] * scale, direction[y] * scale, scale],
        }
    }

    /// Where the ray meets the triangle, beyond its origin: Woop, Benthin and Wald, *Watertight Ray/Triangle
    /// Intersection* (JCGT 2013), in double precision.
    ///
    /// The rounded difference of two rounded products has the sign of the exact one or is zero, and zero counts as
    /// inside: of the triangles around an edge or a corner at least one is hit, always.
    pub fn hit(&self, triangle: &Triangle) -> Option<Hit> {
        // One by one: `map` would call for each.
        let [a, b, c] = &triangle.0;
        let [a, b, c] = [self.sheared(a), self.sheared(b), self.sheared(c)];
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let t = (u * a.z + v * b.z + w * c.z) * self.shear[2] / determinant;
        let front = determinant > 0.0;
        (t > 0.0).then_some(Hit { t, front })
    }

    #[inline]
    fn sheared(&self, corner: &Point3<f64>) -> Vector3<f64> {
        let [x, y, z] = self.axes;
        let depth = corner[z] - self.from[2];
        let aside = |axis: usize, n: usize| corner[axis] - self.from[n] - self.shear[n] * depth;
        Vector3::new(aside(x, 0), aside(y, 1), depth)
    }

    /// Where the ray enters the box (0 if it starts inside), in lengths of its direction; infinite if it misses it.
    #[inline]
    pub fn enter(&self, bounds: &Bounds) -> f64 {
        let (mut near, mut far) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            if !self.is_oblique && self.inverse[axis].is_infinite() {
                // Within the slab for ever or never: the quotients below would be 0 times infinity on a face.
                match bounds.min[axis] <= self.origin[axis] && self.origin[axis] <= bounds.max[axis] {
                    true => continue,
                    false => return f64::INFINITY,
                }
            }
            let a = (bounds.min[axis] - self.origin[axis]) * self.inverse[axis];
            let b = (bounds.max[axis] - self.origin[axis]) * self.inverse[axis];
            // No NaN can come up here, so that plain comparisons do, at half the price of `f64::min` and `max`.
            let (enter, leave) = if a < b { (a, b) } else { (b, a) };
            near = if enter > near { enter } else { near };
            far = if leave < far { leave } else { far };
        }
        if near <= far { near } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hits_are_counted_in_lengths_of_the_direction_and_know_their_side() {
        let wall = Triangle([[2.0, -1.0, -1.0], [2.0, 3.0, -1.0], [2.0, -1.0, 3.0]].map(Point3::from));
        let from = |x: f64, direction: Vector3<f64>| Ray::new(Point3::new(x, 0.0, 0.0), direction).hit(&wall);
        let forward = from(0.0, Vector3::x() * 0.5).unwrap();
        assert_eq!(forward, Hit { t: 4.0, front: false }, "its normal is +x");
        let back = from(5.0, -Vector3::x()).unwrap();
        assert_eq!(back, Hit { t: 3.0, front: true });
        assert_eq!(from(0.0, -Vector3::x()), None);
        assert_eq!(from(0.0, Vector3::y()), None);
    }

    #[test]
    fn a_box_is_entered_where_its_face_is() {
        let unit = Bounds { min: Point3::origin(), max: Point3::new(1.0, 1.0, 1.0) };
        let enter = |o: [f64; 3], d: [f64; 3]| Ray::new(o.into(), d.into()).enter(&unit);
        assert_eq!(enter([-2.0, 0.5, 0.5], [1.0, 0.0, 0.0]), 2.0);
        assert_eq!(enter([0.5, 0.5, 0.5], [0.0, 0.0, 1.0]), 0.0);
        assert_eq!(enter([-2.0, 1.0, 0.5], [1.0, 0.0, 0.0]), 2.0, "along a face");
        assert!(enter([-2.0, 1.5, 0.5], [1.0, 0.0, 0.0]).is_infinite());
        assert!(enter([2.0, 0.5, 0.5], [1.0, 0.0, 0.0]).is_infinite());
    }
}
