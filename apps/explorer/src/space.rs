//! Where the robot can be, and where it can get to.

use std::collections::VecDeque;

use elk_geometry::clearance::Clearance;
use elk_geometry::{State, Voxel};

use elk_geometry::Volume;

/// How far a robot that stands too close to an obstacle may have to back off (voxels of way).
const ESCAPE_VOXELS: u32 = 8;

/// The space of one plan.
#[derive(Debug, Clone)]
pub struct Space {
    /// The robot's component of the free voxels (connected over faces), by index of the [`Volume`].
    pub component: Vec<bool>,
    /// The voxels that the robot can get to with its clearance kept, from what is occupied and from what is unknown.
    pub reach: Vec<bool>,
    /// From the robot's own voxel to the first in `reach`; only that voxel if the robot stands in `reach`.
    pub escape: Vec<usize>,
}

impl Space {
    /// The space around a robot in voxel `robot` (an index of `volume`). Voxels of `trail`, where the robot has been, stay
    /// passable as long as they are free. A robot that is to `back_off` from where it is first gets out of tight corners,
    /// to where most can be reached from.
    pub fn around(volume: &Volume, robot: usize, clearance: &Clearance, trail: &[Voxel], back_off: bool) -> Self {
        let free: Vec<bool> = volume.states().iter().map(|s| *s == State::Free).collect();
        let component = flood(volume, robot, &free);
        let mut passable = clear_of_obstacles(volume, clearance, free);
        for i in trail.iter().filter_map(|v| volume.index(*v)) {
            passable[i] = volume.states()[i] == State::Free;
        }
        let escape = if back_off { escape(volume, robot, &component, &passable) } else { vec![robot] };
        let start = escape.last().copied().unwrap_or(robot);
        let reach = flood(volume, start, &passable);
        Self { component, reach, escape }
    }

    /// Where the way through `reach` starts.
    pub fn start(&self) -> usize {
        self.escape.last().copied().unwrap_or_default()
    }
}

/// All voxels connected with `start` over the faces of voxels in `mask`; `start` itself always is.
pub fn flood(volume: &Volume, start: usize, mask: &[bool]) -> Vec<bool> {
    let faces = volume.faces();
    let mut found = vec![false; mask.len()];
    found[start] = true;
    let mut open = vec![start];
    while let Some(i) = open.pop() {
        for d in faces {
            let n = i.wrapping_add_signed(d);
            if mask[n] && !found[n] {
                found[n] = true;
                open.push(n);
            }
        }
    }
    found
}

/// Takes from `free` what is too close to something that is not free: occupied, or unknown, where an obstacle may be.
///
/// Only obstacles beside what is free matter: those behind them are no nearer along any axis. A robot of 2 m among voxels of
/// 0.1 m has 40,000 neighbours, and the box millions of voxels that are not free.
fn clear_of_obstacles(volume: &Volume, clearance: &Clearance, free: Vec<bool>) -> Vec<bool> {
    let rows = rows(volume, clearance);
    let faces = volume.faces();
    let is_beside_free = |i: &usize| faces.iter().any(|d| free.get(i.wrapping_add_signed(*d)) == Some(&true));
    let mut clear = free.clone();
    for obstacle in (0..free.len()).filter(|i| !free[*i]).filter(is_beside_free) {
        for (first, length) in &rows {
            let first = obstacle.wrapping_add_signed(*first);
            // Past the ends of the box there is only margin.
            if let Some(row) = clear.get_mut(first..first.saturating_add(*length)) {
                row.fill(false);
            }
        }
    }
    clear
}

/// The neighbours that count, and the voxel between them, as rows along x: the offset of the first, and how many.
fn rows(volume: &Volume, clearance: &Clearance) -> Vec<(isize, usize)> {
    let own = Voxel::new(0, 0, 0);
    let mut offsets: Vec<isize> = clearance.offsets().iter().chain([&own]).map(|d| volume.offset(*d)).collect();
    offsets.sort_unstable();
    let rows = offsets.chunk_by(|one, next| *next == one + 1);
    rows.map(|row| (row[0], row.len())).collect()
}

/// The way out for a robot that stands where it should not: over free voxels to the passable voxel near by from which
/// most can be reached, the nearest of equals.
fn escape(volume: &Volume, robot: usize, free: &[bool], passable: &[bool]) -> Vec<usize> {
    let (found, came_from) = walk(volume, robot, free);
    let mut best = (robot, 0);
    let mut seen = vec![false; passable.len()];
    for &i in found.iter().filter(|i| passable[**i]) {
        if seen[i] {
            continue;
        }
        let part = flood(volume, i, passable);
        let size = part.iter().filter(|b| **b).count();
        seen.iter_mut().zip(&part).for_each(|(s, p)| *s |= p);
        if size > best.1 {
            best = (i, size);
        }
    }
    let mut way = vec![best.0];
    while let Some(&i) = way.last().filter(|i| **i != robot) {
        way.push(came_from(i));
    }
    way.reverse();
    way
}

/// Breadth first from `robot`, no further than [`ESCAPE_VOXELS`]: the voxels in order, and where each was come from.
fn walk(volume: &Volume, robot: usize, free: &[bool]) -> (Vec<usize>, impl Fn(usize) -> usize) {
    let mut order = Vec::new();
    let mut parent = std::collections::BTreeMap::from([(robot, robot)]);
    let mut open = VecDeque::from([(robot, 0)]);
    while let Some((i, steps)) = open.pop_front() {
        order.push(i);
        for d in volume.faces() {
            let n = i.wrapping_add_signed(d);
            if steps < ESCAPE_VOXELS && free[n] && !parent.contains_key(&n) {
                parent.insert(n, i);
                open.push_back((n, steps + 1));
            }
        }
    }
    (order, move |i| parent.get(&i).copied().unwrap_or(robot))
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_geometry::OccupancyGrid;

    /// A corridor of 20 × 5 × 5 free voxels between occupied walls, cut in two by a wall at x = 10 with a hole of
    /// `hole` × `hole` voxels.
    fn corridor(hole: i32) -> OccupancyGrid {
        let mut grid = OccupancyGrid::new(0.1);
        for x in -1..21 {
            for y in -1..6 {
                for z in -1..6 {
                    let shell = [x == -1, x == 20, y == -1, y == 5, z == -1, z == 5];
                    let wall = x == 10 && !(y < hole && z < hole);
                    let state = if wall || shell.contains(&true) { State::Occupied } else { State::Free };
                    grid.set(Voxel::new(x, y, z), state);
                }
            }
        }
        grid
    }

    fn space(grid: &OccupancyGrid, robot: Voxel, trail: &[Voxel]) -> (Volume, Space) {
        let volume = Volume::of(grid, robot, 2);
        let robot = volume.index(robot).unwrap();
        let space = Space::around(&volume, robot, &Clearance::new(0.1, 0.1).unwrap(), trail, true);
        (volume, space)
    }

    #[test]
    fn the_body_decides_what_is_reached() {
        let robot = Voxel::new(3, 2, 2);
        let reached = |hole: i32| {
            let (volume, space) = space(&corridor(hole), robot, &[]);
            let beyond = volume.index(Voxel::new(15, 2, 2)).unwrap();
            (space.component[beyond], space.reach[beyond])
        };
        assert_eq!(reached(5), (true, true));
        assert_eq!(reached(1), (true, false), "free, but too narrow");
        assert_eq!(reached(0), (false, false));
    }

    /// Regression: every voxel that is not free was held against all neighbours, 32 s a plan for a robot of 2 m.
    #[test]
    fn what_is_near_an_obstacle_is_what_counting_all_obstacles_finds() {
        let mut grid = OccupancyGrid::new(0.1);
        for voxel in (0..30).flat_map(|x| (0..26).flat_map(move |y| (0..24).map(move |z| Voxel::new(x, y, z)))) {
            // As scattered as a hash.
            let hash = (voxel.x * 73 + voxel.y * 179 + voxel.z * 283) % 4001;
            grid.set(voxel, if hash == 0 { State::Occupied } else { State::Free });
        }
        for radius in [0.0, 0.1, 0.25, 0.4] {
            let clearance = Clearance::new(radius, 0.1).unwrap();
            let volume = Volume::of(&grid, Voxel::new(0, 0, 0), clearance.reach());
            let free: Vec<bool> = volume.states().iter().map(|state| *state == State::Free).collect();
            let is_free = |voxel: Voxel| volume.state(voxel) == State::Free;
            let is_clear = |voxel: Voxel| is_free(voxel) && clearance.offsets().iter().all(|d| is_free(voxel + *d));
            let expected: Vec<bool> = (0..volume.len()).map(|i| is_clear(volume.voxel(i))).collect();
            assert!(expected.contains(&true), "{radius}");
            assert_eq!(clear_of_obstacles(&volume, &clearance, free), expected, "{radius}");
        }
    }

    #[test]
    fn where_it_has_been_it_can_go_again() {
        let robot = Voxel::new(3, 2, 2);
        let through: Vec<Voxel> = (3..18).map(|x| Voxel::new(x, 0, 0)).chain([Voxel::new(3, 1, 0)]).collect();
        let reached = |trail: &[Voxel]| {
            let (volume, space) = space(&corridor(1), robot, trail);
            space.reach[volume.index(Voxel::new(17, 0, 0)).unwrap()]
        };
        assert!(!reached(&[]));
        assert!(reached(&through));
    }

    #[test]
    fn what_is_unknown_is_kept_clear_of_too() {
        let mut grid = corridor(5);
        grid.set(Voxel::new(15, 2, 2), State::Unknown);
        let (volume, space) = space(&grid, Voxel::new(3, 2, 2), &[]);
        let reached = |x: i32| space.reach[volume.index(Voxel::new(x, 2, 2)).unwrap()];
        assert!(reached(13) && !reached(14), "the corridor is closed by one unknown voxel");
        assert!(!reached(18));
    }

    #[test]
    fn too_close_to_a_wall_it_backs_off() {
        let (volume, space) = space(&corridor(5), Voxel::new(3, 0, 0), &[]);
        let way: Vec<Voxel> = space.escape.iter().map(|i| volume.voxel(*i)).collect();
        assert_eq!(way[0], Voxel::new(3, 0, 0));
        assert_eq!(way.len(), 3, "{way:?}");
        assert!(space.reach[space.start()]);
    }
}
