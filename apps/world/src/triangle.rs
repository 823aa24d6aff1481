//! Triangles: their distance from a segment and their overlap with a box.

use elk_geometry::Bounds;
use nalgebra::{Point3, Vector3};

use crate::ray::Ray;

/// A triangle of a surface (m, world), anticlockwise as seen from the free side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle(pub [Point3<f64>; 3]);

/// A point's or a voxel's own box, or the one around a triangle.
pub(crate) fn bounds_of<'a>(points: impl IntoIterator<Item = &'a Point3<f64>>) -> Bounds {
    let empty = Bounds { min: Point3::from([f64::INFINITY; 3]), max: Point3::from([f64::NEG_INFINITY; 3]) };
    points.into_iter().fold(empty, |b, p| Bounds { min: b.min.inf(p), max: b.max.sup(p) })
}

impl Triangle {
    /// The smallest axis-aligned box around it.
    pub fn bounds(&self) -> Bounds {
        bounds_of(&self.0)
    }

    /// Its normal, twice its area long (m²).
    pub(crate) fn normal(&self) -> Vector3<f64> {
        let [a, b, c] = self.0;
        (b - a).cross(&(c - a))
    }

    /// The mean of its corners.
    pub(crate) fn middle(&self) -> Point3<f64> {
        let [a, b, c] = self.0;
        a + ((b - a) + (c - a)) / 3.0
    }

    /// Its edges as pairs of corners.
    fn edges(&self) -> [(Point3<f64>, Point3<f64>); 3] {
        let [a, b, c] = self.0;
        [(a, b), (b, c), (c, a)]
    }

    /// Distance between the triangle and the segment `from`–`to` (m): 0 if the segment pierces it; otherwise it is
    /// attained at an end of the segment or on an edge of the triangle (Ericson, *Real-Time Collision Detection*,
    /// 5.1.10).
    pub fn distance_to_segment(&self, from: Point3<f64>, to: Point3<f64>) -> f64 {
        if from != to
            && let Some(hit) = Ray::new(from, to - from).hit(self)
            && hit.t <= 1.0
        {
            return 0.0;
        }
        let corners = [from, to].map(|p| self.distance_to_point(p));
        let edges = self.edges().map(|(a, b)| distance_of_segments(from, to, a, b));
        // `f64::min` passes over the NaN that a degenerate triangle's plane gives; its edges still count.
        corners.into_iter().chain(edges).fold(f64::INFINITY, f64::min)
    }

    /// Distance between the triangle and `point` (m): to its plane where the foot of the perpendicular lies inside,
    /// else to the nearest edge.
    pub fn distance_to_point(&self, point: Point3<f64>) -> f64 {
        let [a, b, c] = self.0;
        let normal = (b - a).cross(&(c - a));
        let inside = self.edges().iter().all(|(p, q)| (q - p).cross(&(point - p)).dot(&normal) >= 0.0);
        if inside && normal != Vector3::zeros() {
            return (point - a).dot(&normal).abs() / normal.norm();
        }
        self.edges().into_iter().map(|(p, q)| distance_of_segments(point, point, p, q)).fold(f64::INFINITY, f64::min)
    }

    /// Whether it shares a point with the box, faces included: no axis among the box's three, the triangle's normal and
    /// the nine cross products of their edges separates them (Akenine-Möller, *Fast 3D Triangle-Box Overlap Testing*,
    /// 2001).
    pub fn overlaps(&self, bounds: &Bounds) -> bool {
        let center = bounds.mid();
        let half = bounds.dim() / 2.0;
        let corners = self.0.map(|p| p - center);
        let apart_along = |axis: Vector3<f64>| {
            let reach = half.dot(&axis.abs());
            let [p, q, r] = corners.map(|c| c.dot(&axis));
            p.min(q).min(r) > reach || p.max(q).max(r) < -reach
        };
        let edges = self.edges().map(|(p, q)| q - p);
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let crosses = || axes.iter().flat_map(|a| edges.iter().map(|e| a.cross(e))).any(apart_along);
        !(axes.into_iter().any(apart_along) || apart_along(edges[0].cross(&edges[1])) || crosses())
    }
}

/// Distance between the segments `p`–`q` and `a`–`b` (m), either of which may be a point (Ericson, 5.1.9).
fn distance_of_segments(p: Point3<f64>, q: Point3<f64>, a: Point3<f64>, b: Point3<f64>) -> f64 {
    let (u, v, r) = (q - p, b - a, p - a);
    let (uu, uv, vv) = (u.norm_squared(), u.dot(&v), v.norm_squared());
    let (ur, vr) = (u.dot(&r), v.dot(&r));
    let ratio = |n: f64, d: f64| if d > 0.0 { (n / d).clamp(0.0, 1.0) } else { 0.0 };
    // Nearest on the line of `p`–`q`, then on `a`–`b` to that, then once more on `p`–`q` where `a`–`b` was left.
    let s = ratio(uv * vr - ur * vv, uu * vv - uv * uv);
    let t = ratio(uv * s + vr, vv);
    let s = ratio(uv * t - ur, uu);
    ((p + u * s) - (a + v * t)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Triangle =
        Triangle([Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)]);

    fn near(actual: f64, expected: f64) {
        assert!((actual - expected).abs() < 1e-12, "{actual} {expected}");
    }

    #[test]
    fn distance_is_to_face_edge_or_corner() {
        let at = |x, y, z| UNIT.distance_to_point(Point3::new(x, y, z));
        near(at(0.2, 0.2, -0.3), 0.3);
        near(at(0.5, -0.4, 0.3), 0.5);
        near(at(1.0, 1.0, 0.0), 0.5_f64.sqrt());
        near(at(-3.0, 0.0, 4.0), 5.0);
    }

    #[test]
    fn distance_of_a_segment_that_pierces_passes_or_ends() {
        let between = |p: [f64; 3], q: [f64; 3]| UNIT.distance_to_segment(p.into(), q.into());
        near(between([0.2, 0.2, -1.0], [0.2, 0.2, 1.0]), 0.0);
        near(between([0.2, 0.2, 2.0], [0.2, 0.2, 1.0]), 1.0);
        near(between([0.5, -0.2, -1.0], [0.5, -0.2, 1.0]), 0.2);
        near(between([-1.0, -0.3, 0.4], [2.0, -0.3, 0.4]), 0.5);
        near(between([0.3, 0.3, 0.1], [0.3, 0.3, 0.1]), 0.1);
    }

    #[test]
    fn overlap_is_of_the_triangle_and_not_of_its_box() {
        let cube =
            |x: f64, y: f64, z: f64| Bounds { min: Point3::new(x, y, z), max: Point3::new(x + 0.1, y + 0.1, z + 0.1) };
        assert!(UNIT.overlaps(&cube(0.2, 0.2, -0.05)));
        assert!(UNIT.overlaps(&cube(0.2, 0.2, 0.0)), "faces count");
        assert!(!UNIT.overlaps(&cube(0.2, 0.2, 0.001)));
        assert!(!UNIT.overlaps(&cube(0.8, 0.8, -0.05)), "beyond the long edge");
        let slanted = Triangle([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Point3::from));
        assert!(slanted.overlaps(&cube(0.3, 0.3, 0.3)));
        assert!(!slanted.overlaps(&cube(0.2, 0.2, 0.2)));
    }
}
