//! How much of a world's surfaces a map has, and how much of what a map has for surfaces is there.

use elk_geometry::bricks::voxel_at;
use elk_geometry::mask;
use elk_geometry::{Bounds, OccupancyGrid, State, Voxel};
use nalgebra::{Point3, Vector3};

use crate::triangle::Triangle;
use crate::world::World;

/// How far before a surface it is looked whether that side of it is free (m).
const BEFORE_M: f64 = 1e-3;

/// A map's surfaces against the world's.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SurfaceScore {
    /// Area of the surfaces that free space is before, whether or not a robot comes to see them (m²).
    pub area_m2: f64,
    /// Share of it that has an occupied voxel within the tolerance (0 to 1).
    pub recall: f64,
    /// Occupied voxels.
    pub occupied: u64,
    /// Share of them that have a surface within the tolerance (0 to 1).
    pub precision: f64,
}

/// Holds the occupied voxels of `map` against the surfaces of `world`; what is no farther away than `tolerance` (m) along any axis is
/// there. Surfaces are looked at in places at most a voxel's edge apart.
pub fn surface_score(world: &World, map: &OccupancyGrid, tolerance: f64) -> SurfaceScore {
    let (mut area, mut found) = (0.0, 0.0);
    for triangle in world.surfaces().triangles() {
        let before = triangle.normal().normalize() * BEFORE_M;
        for (place, share) in places(triangle, map.resolution()) {
            if world.is_free(place + before) || world.is_free(place - before) {
                area += share;
                found += if has_occupied(map, place, tolerance) { share } else { 0.0 };
            }
        }
    }
    let (mut occupied, mut right) = (0, 0);
    for (brick, cells) in map.bricks().iter() {
        for cell in mask::cells(cells.known()).filter(|&cell| cells.state(cell) == State::Occupied) {
            let around = Vector3::repeat(map.resolution() + 2.0 * tolerance);
            let voxel = voxel_at(brick, cell).center(map.resolution());
            occupied += 1;
            right += u64::from(world.surfaces().overlaps(&Bounds::from_mid_dim(voxel, around)));
        }
    }
    let share = |part: f64, all: f64| if all > 0.0 { part / all } else { 0.0 };
    SurfaceScore {
        area_m2: area,
        recall: share(found, area),
        occupied,
        precision: share(right as f64, occupied as f64),
    }
}

/// The middles of the parts that a triangle is cut into along lines parallel to its edges, so that none is longer than `step` (m), and
/// the area of a part (m²).
fn places(triangle: &Triangle, step: f64) -> impl Iterator<Item = (Point3<f64>, f64)> {
    let [a, b, c] = triangle.0;
    let longest = triangle.edges().map(|(p, q)| (q - p).norm()).into_iter().fold(0.0, f64::max);
    let parts = ((longest / step).ceil() as u32).max(1);
    let (along, across) = ((b - a) / f64::from(parts), (c - a) / f64::from(parts));
    let area = triangle.normal().norm() / 2.0 / f64::from(parts).powi(2);
    let upright = move |i: u32, j: u32| (i, j, 1.0 / 3.0);
    let turned = move |i: u32, j: u32| (i + j + 2 <= parts).then_some((i, j, 2.0 / 3.0));
    (0..parts)
        .flat_map(move |i| (0..parts - i).flat_map(move |j| [Some(upright(i, j)), turned(i, j)]))
        .flatten()
        .map(move |(i, j, third)| (a + along * (f64::from(i) + third) + across * (f64::from(j) + third), area))
}

/// Whether an occupied voxel is as near to a place as `tolerance` (m) along each axis.
fn has_occupied(map: &OccupancyGrid, place: Point3<f64>, tolerance: f64) -> bool {
    let reach = Vector3::repeat(tolerance);
    let [low, high] = [place - reach, place + reach].map(|p| Voxel::containing(p, map.resolution()).to_array());
    (low[0]..=high[0]).any(|x| {
        (low[1]..=high[1]).any(|y| (low[2]..=high[2]).any(|z| map.state(Voxel::new(x, y, z)) == State::Occupied))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenery::{Scenery, Solid};

    /// 2×1×1 m, its walls in the midst of voxels.
    fn world() -> World {
        let room = Scenery::within(Solid::block("room", [0.05; 3], [2.05, 1.05, 1.05]));
        World::from_triangles("room", room.triangles_at(Vector3::zeros())).unwrap()
    }

    /// A map in which those voxels are occupied that `is_occupied` says of all around and in the room.
    fn map(is_occupied: impl Fn([i32; 3]) -> bool) -> OccupancyGrid {
        let mut map = OccupancyGrid::new(0.1);
        for x in -3..24 {
            for y in -3..14 {
                for z in -3..14 {
                    let state = if is_occupied([x, y, z]) { State::Occupied } else { State::Free };
                    map.set(Voxel::new(x, y, z), state);
                }
            }
        }
        map
    }

    fn is_wall([x, y, z]: [i32; 3]) -> bool {
        let within = (0..=20).contains(&x) && (0..=10).contains(&y) && (0..=10).contains(&z);
        within && (x == 0 || x == 20 || y == 0 || y == 10 || z == 0 || z == 10)
    }

    #[test]
    fn the_map_of_all_walls_has_all_and_nothing_else() {
        let score = surface_score(&world(), &map(is_wall), 0.0);
        assert!((score.area_m2 - 10.0).abs() < 1e-9, "{score:?}");
        assert_eq!((score.recall, score.precision), (1.0, 1.0), "{score:?}");
    }

    #[test]
    fn a_wall_that_is_missing_is_area_and_voxels_in_the_air_are_not_precise() {
        let without_floor = surface_score(&world(), &map(|v| is_wall(v) && v[2] > 0), 0.02);
        // But for the strips along the walls.
        assert!((without_floor.recall - 0.8).abs() < 0.03 && without_floor.precision == 1.0, "{without_floor:?}");
        let with_more = surface_score(&world(), &map(|v| is_wall(v) || v[0] == 9 && v[1] == 5), 0.02);
        let all = with_more.occupied as f64;
        assert_eq!(with_more.recall, 1.0);
        // 9 in the room, 3 above and 3 below it.
        assert!((with_more.precision - (all - 15.0) / all).abs() < 1e-9, "{with_more:?}");
    }

    #[test]
    fn what_is_off_by_the_tolerance_is_there() {
        let shifted = map(|[x, y, z]| is_wall([x - 1, y, z]));
        let of = |tolerance: f64| surface_score(&world(), &shifted, tolerance);
        assert!(of(0.02).recall < 0.95 && of(0.02).precision < 0.95, "{:?}", of(0.02));
        assert_eq!((of(0.06).recall, of(0.06).precision), (1.0, 1.0));
    }

    #[test]
    fn an_empty_map_has_nothing() {
        assert_eq!(surface_score(&world(), &OccupancyGrid::new(0.1), 0.05).recall, 0.0);
    }

    #[test]
    fn the_parts_of_a_triangle_are_the_triangle() {
        let triangle = Triangle([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0]].map(Point3::from));
        let parts: Vec<_> = places(&triangle, 0.3).collect();
        let area: f64 = parts.iter().map(|(_, area)| area).sum();
        assert!((area - 3.0).abs() < 1e-9);
        let middle = parts.iter().fold(Vector3::zeros(), |sum, (place, area)| sum + place.coords * *area) / area;
        assert!((middle - Vector3::new(1.0, 2.0 / 3.0, 0.0)).norm() < 1e-9, "{middle}");
    }
}
