//! A world's surfaces as a mesh of no more triangles than somebody can show.

use std::collections::{HashMap, HashSet};

use nalgebra::{Point3, Vector3};

use crate::triangle::{Triangle, bounds_of};

/// How much longer the edges of cells become where those before left too many triangles.
const GROWTH: f64 = 1.3;
/// The shortest edge of a cell, as a share of the longest edge of the box around everything.
const FINEST: f64 = 1e-6;

/// Triangles that share their corners.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// Corners (m, world).
    pub corners: Vec<[f32; 3]>,
    /// Three corners each, by their place in the list, anticlockwise as seen from the free side.
    pub triangles: Vec<[u32; 3]>,
    /// Edge of the cells in which all corners became one (m); `None`: all triangles are as they were.
    pub cell_m: Option<f64>,
}

impl Mesh {
    /// The mesh of these triangles, simplified until there are at most `most`: in each cell of a grid all corners become one,
    /// their mean, and triangles with two corners in one cell are left out (vertex clustering: Rossignac and Borrel,
    /// *Multi-resolution 3D approximations for rendering complex scenes*, 1993).
    pub fn of(triangles: &[Triangle], most: usize) -> Self {
        if triangles.len() <= most {
            return Self::clustered(triangles, |point| point.coords.map(|c| i64::from((c as f32 + 0.0).to_bits())));
        }
        let bounds = bounds_of(triangles.iter().flat_map(|triangle| &triangle.0));
        let area: f64 = triangles.iter().map(|triangle| triangle.normal().norm() / 2.0).sum();
        // A plane is cut into two triangles a cell.
        let mut cell = (2.0 * area / most.max(1) as f64).sqrt().max(FINEST * bounds.dim().max());
        loop {
            // In the end all lie in one cell, and none is left.
            let mesh = Self::clustered(triangles, |point| (point - bounds.min).map(|c| (c / cell) as i64));
            if mesh.triangles.len() <= most {
                return Self { cell_m: Some(cell), ..mesh };
            }
            cell *= GROWTH;
        }
    }

    /// The triangles with one corner, the mean, in place of all in a cell.
    fn clustered(triangles: &[Triangle], cell_of: impl Fn(&Point3<f64>) -> Vector3<i64>) -> Self {
        let mut cells: HashMap<Vector3<i64>, u32> = HashMap::new();
        let mut sums: Vec<(Vector3<f64>, f64)> = Vec::new();
        let mut number = |point: &Point3<f64>| {
            let number = *cells.entry(cell_of(point)).or_insert(sums.len() as u32);
            if number as usize == sums.len() {
                sums.push((Vector3::zeros(), 0.0));
            }
            let (sum, count) = &mut sums[number as usize];
            (*sum, *count) = (*sum + point.coords, *count + 1.0);
            number
        };
        let numbered: Vec<[u32; 3]> = triangles.iter().map(|triangle| triangle.0.each_ref().map(&mut number)).collect();
        let mut seen = HashSet::new();
        let is_left = |&[a, b, c]: &[u32; 3]| a != b && b != c && c != a && seen.insert(from_least([a, b, c]));
        let triangles = numbered.into_iter().filter(is_left).collect();
        let corners = sums.into_iter().map(|(sum, count)| (sum / count).map(|c| c as f32).into()).collect();
        Self { corners, triangles, cell_m: None }
    }
}

/// The same triangle, turned the same way, from its corner of the lowest number on.
fn from_least([a, b, c]: [u32; 3]) -> [u32; 3] {
    match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CAR_INTERIOR, Placement, World};

    /// A sphere of this radius (m), seen from within, of `2 × rings × 2 rings` triangles but for the poles.
    fn sphere(radius: f64, rings: usize) -> Vec<Triangle> {
        let point = |ring: usize, step: usize| {
            let (polar, round) =
                (std::f64::consts::PI * ring as f64 / rings as f64, std::f64::consts::PI * step as f64 / rings as f64);
            Point3::new(polar.sin() * round.cos(), polar.sin() * round.sin(), polar.cos()) * radius
        };
        let quads = (0..rings).flat_map(|ring| (0..2 * rings).map(move |step| (ring, step)));
        quads
            .flat_map(|(ring, step)| {
                let [a, b] = [point(ring, step), point(ring, step + 1)];
                let [c, d] = [point(ring + 1, step), point(ring + 1, step + 1)];
                [Triangle([a, b, c]), Triangle([c, b, d])]
            })
            .filter(|triangle| triangle.normal().norm() > 1e-12)
            .collect()
    }

    fn corner(mesh: &Mesh, number: u32) -> Vector3<f64> {
        Vector3::from(mesh.corners[number as usize]).cast()
    }

    #[test]
    fn what_is_small_stays_as_it_is() {
        let world = World::load(CAR_INTERIOR, &Placement::default()).unwrap();
        let triangles = world.surfaces().triangles();
        let mesh = Mesh::of(triangles, 50_000);
        assert_eq!((mesh.triangles.len(), mesh.cell_m), (triangles.len(), None));
        assert!(mesh.corners.len() < triangles.len(), "{} corners", mesh.corners.len());
        for (made, triangle) in mesh.triangles.iter().zip(triangles) {
            for (number, point) in made.iter().zip(&triangle.0) {
                assert!((corner(&mesh, *number) - point.coords).norm() < 1e-5);
            }
        }
    }

    #[test]
    fn what_is_large_keeps_its_shape_and_its_sides_within_a_cell_of_where_it_was() {
        let triangles = sphere(3.0, 150);
        for most in [200, 2_000, 20_000] {
            let mesh = Mesh::of(&triangles, most);
            let cell = mesh.cell_m.unwrap();
            assert!(
                mesh.triangles.len() <= most && mesh.triangles.len() > most / 8,
                "{most}: {}",
                mesh.triangles.len()
            );
            let corners = mesh.triangles.iter().flatten().map(|number| corner(&mesh, *number));
            corners.for_each(|at| assert!((at.norm() - 3.0).abs() < cell, "{at} in cells of {cell} m"));
            let inwards = mesh.triangles.iter().filter(|made| {
                let [a, b, c] = made.map(|number| corner(&mesh, number));
                (b - a).cross(&(c - a)).dot(&a) < 0.0
            });
            // Where a cell's mean lies askew, a triangle of its border may turn over.
            let (inwards, all) = (inwards.count(), mesh.triangles.len());
            assert!(20 * inwards > 19 * all, "{inwards} of {all} look to where the free side was");
            assert_eq!(Mesh::of(&triangles, most), mesh, "the same twice");
        }
    }

    #[test]
    fn what_has_no_size_comes_to_an_end() {
        let point = Triangle([Point3::new(1.0, 2.0, 3.0); 3]);
        assert_eq!(Mesh::of(&[point; 10], 4).triangles, [[0; 3]; 0]);
        assert_eq!(Mesh::of(&[], 4).corners, [[0.0; 3]; 0]);
    }
}
