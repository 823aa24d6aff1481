//! How far triangles are from points and segments.

use nalgebra::{Point3, Vector3};

use crate::ray::Ray;
use crate::triangle::Triangle;

impl Triangle {
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
}
