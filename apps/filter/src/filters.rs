//! The filters: points of a scan in, fewer points out, in an order that depends on nothing but theirs.
//!
//! Points are in the camera frame (m), as in [`elk_spatial::Scan`].

use std::collections::HashMap;

use elk_geometry::Voxel;
use elk_spatial::Points;
use nalgebra::{Point3, Vector3};

/// The points at most `threshold` (m) from the camera, in their order. A point that is not finite is left out.
pub fn distance<'a>(points: &'a Points<'_>, threshold: f64) -> impl Iterator<Item = Point3<f32>> + 'a {
    points.iter().filter(move |p| p.coords.cast::<f64>().norm() <= threshold)
}

/// One point for each cell of edge `leaf` (m) that holds any: their centroid. Cells come in the order of their first
/// points; points that are not finite, or beyond 2³⁰ cells, are left out.
pub fn voxel_grid(points: &Points<'_>, leaf: f64) -> Vec<Point3<f32>> {
    // It is looked into only, never walked through, so that the order of its hashes does not matter.
    let mut places: HashMap<Voxel, usize> = HashMap::new();
    let mut sums: Vec<(Vector3<f64>, f64)> = Vec::new();
    // Neighbours in an image are mostly of one cell.
    let mut latest = None;
    let reach = leaf * f64::from(1 << 30);
    for point in points.iter().map(|p| p.cast::<f64>()) {
        if !point.iter().all(|c| c.abs() < reach) {
            continue;
        }
        let cell = Voxel::containing(point, leaf);
        let place = match latest {
            Some((known, place)) if known == cell => place,
            _ => *places.entry(cell).or_insert(sums.len()),
        };
        latest = Some((cell, place));
        if place == sums.len() {
            sums.push((Vector3::zeros(), 0.0));
        }
        sums[place].0 += point.coords;
        sums[place].1 += 1.0;
    }
    sums.into_iter().map(|(sum, count)| Point3::from((sum / count).cast())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn points(list: &[[f32; 3]]) -> Points<'static> {
        list.iter().map(|p| Point3::from(*p)).collect()
    }

    #[test]
    fn distance_keeps_what_is_near() {
        let scan = points(&[[0.0, 0.0, 2.0], [0.0, 3.0, 4.0], [3.0, 3.0, 4.0], [f32::NAN, 0.0, 1.0]]);
        let kept: Vec<_> = distance(&scan, 5.0).collect();
        assert_eq!(kept, vec![Point3::new(0.0, 0.0, 2.0), Point3::new(0.0, 3.0, 4.0)]);
    }

    #[test]
    fn a_cell_becomes_its_centroid() {
        let scan = points(&[[0.25, 0.0, 0.0], [5.5, 0.0, 0.0], [0.75, 0.5, 0.0], [f32::INFINITY, 0.0, 0.0]]);
        assert_eq!(voxel_grid(&scan, 1.0), vec![Point3::new(0.5, 0.25, 0.0), Point3::new(5.5, 0.0, 0.0)]);
    }

    proptest! {
        #[test]
        fn one_point_a_cell_and_no_cell_lost(list in prop::collection::vec(prop::array::uniform3(-2.0..2.0f32), 0..100), leaf in 0.05..1.0f64) {
            let scan = points(&list);
            let cells: BTreeSet<Voxel> = scan.iter().map(|p| Voxel::containing(p.cast(), leaf)).collect();
            let kept = voxel_grid(&scan, leaf);
            prop_assert_eq!(kept.len(), cells.len());
            // Rounding to f32 may carry a centroid over its cell's border by a hair.
            for p in kept {
                let near = |c: &Voxel| (c.center(leaf) - p.cast::<f64>()).amax() <= leaf / 2.0 + 1e-6;
                prop_assert!(cells.iter().any(near));
            }
        }
    }
}
