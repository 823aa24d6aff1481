//! Triangles, and their overlap with a box.

use elk_geometry::Bounds;
use nalgebra::{Point3, Vector3};

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
    pub fn normal(&self) -> Vector3<f64> {
        let [a, b, c] = self.0;
        (b - a).cross(&(c - a))
    }

    /// The mean of its corners.
    pub(crate) fn middle(&self) -> Point3<f64> {
        let [a, b, c] = self.0;
        a + ((b - a) + (c - a)) / 3.0
    }

    /// Its edges as pairs of corners.
    pub(crate) fn edges(&self) -> [(Point3<f64>, Point3<f64>); 3] {
        let [a, b, c] = self.0;
        [(a, b), (b, c), (c, a)]
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

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Triangle =
        Triangle([Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)]);

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
