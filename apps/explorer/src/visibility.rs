//! What can be looked into from where, over free voxels.

use elk_spatial::ray::Traversal;
use elk_spatial::{State, Voxel};
use nalgebra::{Point3, Vector3};

use crate::volume::Volume;

/// Whether a camera at `from` (m, world) can look into voxel `target`: every voxel before it, on the straight line to
/// its centre, is free.
pub fn sees(volume: &Volume, from: Point3<f64>, target: Voxel) -> bool {
    let to = target.center(volume.resolution());
    Traversal::new(from, to, volume.resolution())
        .take_while(|v| *v != target)
        .all(|v| volume.state(v) == State::Free)
}

/// Every place in `reach` that looks into voxel `target` from at most `range` (m), one a ray: the first reachable voxel
/// on it, with the point there.
///
/// The rays run backwards, from points in the target to all voxels of the surface of a cube around it; nearly all of
/// them die at once, since what hides a voxel is next to it. So the search is exhaustive at the map's resolution, at a
/// small part of the price of trying every place.
pub fn viewpoints(
    volume: &Volume,
    reach: &[bool],
    target: Voxel,
    range: f64,
) -> Vec<(usize, Point3<f64>)> {
    let resolution = volume.resolution();
    let cells = (range / resolution).ceil() as i32;
    let mut found = std::collections::BTreeMap::new();
    for aim in aims(target, resolution) {
        for end in cube_surface(cells) {
            let direction = Vector3::new(end.x.into(), end.y.into(), end.z.into()).normalize();
            let first = first_on_ray(volume, reach, target, aim, direction * range);
            if let Some((i, voxel)) = first {
                let point = nearest_on_line(aim, direction, voxel.center(resolution));
                if Voxel::containing(point, resolution) == voxel {
                    found.entry(i).or_insert(point);
                }
            }
        }
    }
    found.into_iter().collect()
}

/// The first voxel on the ray from `aim` in `target` along `way` that the robot can be in, if all before it are free.
fn first_on_ray(
    volume: &Volume,
    reach: &[bool],
    target: Voxel,
    aim: Point3<f64>,
    way: Vector3<f64>,
) -> Option<(usize, Voxel)> {
    Traversal::new(aim, aim + way, volume.resolution())
        .skip_while(|v| *v == target)
        .map_while(|v| {
            let i = volume.index(v)?;
            (volume.states()[i] == State::Free).then_some((i, v))
        })
        .find(|(i, _)| reach[*i])
}

/// The centre of a voxel and eight points towards its corners.
fn aims(voxel: Voxel, resolution: f64) -> impl Iterator<Item = Point3<f64>> {
    let center = voxel.center(resolution);
    let corner = move |n: i32| {
        let side = |bit: i32| if n & bit != 0 { 0.3 } else { -0.3 } * resolution;
        Vector3::new(side(1), side(2), side(4))
    };
    std::iter::once(center).chain((0..8).map(move |n| center + corner(n)))
}

/// The voxels of the surface of the cube of half edge `n`, relative to its centre.
fn cube_surface(n: i32) -> impl Iterator<Item = Voxel> {
    let side = move || -n..=n;
    side().flat_map(move |z| {
        side().flat_map(move |y| {
            let inside = z.abs() < n && y.abs() < n;
            let step = if inside { 2 * n } else { 1 };
            side()
                .step_by(step.max(1) as usize)
                .map(move |x| Voxel::new(x, y, z))
        })
    })
}

fn nearest_on_line(from: Point3<f64>, direction: Vector3<f64>, to: Point3<f64>) -> Point3<f64> {
    from + direction * direction.dot(&(to - from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_spatial::OccupancyGrid;

    #[test]
    fn a_cube_has_a_surface() {
        assert_eq!(cube_surface(1).count(), 26);
        assert_eq!(cube_surface(3).count(), 7 * 7 * 7 - 5 * 5 * 5);
    }

    /// A free room of 9 × 9 × 1 voxels with an occupied wall at x = 4 that leaves a gap of one voxel at y = 0.
    fn room() -> Volume {
        let mut grid = OccupancyGrid::new(0.1);
        for x in 0..9 {
            for y in 0..9 {
                let wall = x == 4 && y != 0;
                let state = if wall { State::Occupied } else { State::Free };
                grid.set(Voxel::new(x, y, 0), state);
            }
        }
        Volume::of(&grid, Voxel::new(0, 0, 0), 2)
    }

    #[test]
    fn a_wall_hides_what_is_behind() {
        let volume = room();
        let at = |x, y| Voxel::new(x, y, 0).center(0.1);
        assert!(sees(&volume, at(1, 5), Voxel::new(-1, 5, 0)));
        assert!(!sees(&volume, at(1, 5), Voxel::new(9, 5, 0)));
        assert!(sees(&volume, at(1, 0), Voxel::new(9, 0, 0)));
    }

    #[test]
    fn viewpoints_are_all_that_see_and_none_that_does_not() {
        let volume = room();
        let left: Vec<bool> = (0..volume.len())
            .map(|i| volume.states()[i] == State::Free && volume.voxel(i).x < 3)
            .collect();
        let target = Voxel::new(9, 1, 0);
        let found = viewpoints(&volume, &left, target, 2.0);
        assert!(!found.is_empty());
        for (i, point) in &found {
            assert!(left[*i]);
            assert_eq!(volume.index_at(*point), Some(*i));
            let looks_in = aims(target, 0.1).any(|aim| {
                Traversal::new(*point, aim, 0.1)
                    .take_while(|v| *v != target)
                    .all(|v| volume.state(v) == State::Free)
            });
            assert!(looks_in, "{point:?}");
        }
        assert!(viewpoints(&volume, &left, Voxel::new(9, 7, 0), 2.0).is_empty());
    }
}
