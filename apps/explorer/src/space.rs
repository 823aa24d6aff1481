//! Where the robot can be, and where it can get to.

use std::borrow::Cow;
use std::collections::VecDeque;

use elk_geometry::clearance::{Clearance, Obstacles};
use elk_geometry::{Component, State, Volume, Voxel};

/// How far a robot that stands too close to an obstacle may have to back off (voxels of way).
const ESCAPE_VOXELS: u32 = 8;

/// Where a robot can be among the voxels of a [`Volume`], kept up to date with it.
#[derive(Debug, Clone)]
pub struct Space {
    /// The robot's component of the free voxels (connected over faces), by index of the [`Volume`].
    pub component: Component,
    /// The voxels that the robot can get to with its clearance kept, from what is occupied and from what is unknown.
    pub reach: Component,
    /// From the robot's own voxel to the first in `reach`; only that voxel if the robot stands in `reach`.
    pub escape: Vec<usize>,
    obstacles: Obstacles,
    /// Where the robot has been.
    trail: Vec<Voxel>,
    on_trail: Vec<bool>,
    passable: Vec<bool>,
}

impl Space {
    /// The space around a robot in voxel `robot` (an index of `volume`). Voxels of `trail`, where the robot has been, stay
    /// passable as long as they are free.
    pub fn around(volume: &Volume, robot: usize, clearance: &Clearance, trail: &[Voxel]) -> Self {
        let nothing = |_: usize| false;
        let mut space = Self {
            component: Component::of(volume, &nothing, robot),
            reach: Component::of(volume, &nothing, robot),
            escape: vec![robot],
            obstacles: Obstacles::new(volume, clearance),
            trail: Vec::new(),
            on_trail: vec![false; volume.len()],
            passable: vec![false; volume.len()],
        };
        let free: Vec<usize> = (0..volume.len()).filter(|i| volume.states()[*i] == State::Free).collect();
        space.follow(volume, robot, &free, trail, &mut |_| {});
        space
    }

    /// Takes note that the robot is in voxel `robot`, has left a longer `trail` (in order), and that the states of the voxels
    /// `turned` have changed. The index of each voxel that it can get to now, or no longer, is told to `changed`.
    pub fn follow(
        &mut self,
        volume: &Volume,
        robot: usize,
        turned: &[usize],
        trail: &[Voxel],
        changed: &mut impl FnMut(usize),
    ) {
        let free = |i: usize| volume.states()[i] == State::Free;
        let mut near = turned.to_vec();
        self.obstacles.update(volume, &free, turned, &mut |i| near.push(i));
        self.follow_trail(volume, trail, &mut |i| near.push(i));
        near.retain(|i| {
            let now = free(*i) && (self.obstacles.allow(*i) || self.on_trail[*i]);
            std::mem::replace(&mut self.passable[*i], now) != now
        });
        self.component.update(volume, &free, robot, turned, &mut |_| {});
        self.reach.update(volume, &|i: usize| self.passable[i], robot, &near, changed);
        self.escape = vec![robot];
    }

    /// Takes over where the robot has been; both trails are in order.
    fn follow_trail(&mut self, volume: &Volume, trail: &[Voxel], changed: &mut impl FnMut(usize)) {
        let before = std::mem::replace(&mut self.trail, trail.to_vec());
        let left = before.iter().filter(|voxel| trail.binary_search(voxel).is_err()).map(|voxel| (voxel, false));
        let come = trail.iter().filter(|voxel| before.binary_search(voxel).is_err()).map(|voxel| (voxel, true));
        for (voxel, on) in left.chain(come) {
            if let Some(i) = volume.index(*voxel) {
                self.on_trail[i] = on;
                changed(i);
            }
        }
    }

    /// The robot first gets out of a tight corner, to where most can be reached from; answers whether there is such a place.
    /// The index of each voxel that it can get to from there, and could not, or no longer, is told to `changed`.
    pub fn back_off(&mut self, volume: &Volume, changed: &mut impl FnMut(usize)) -> bool {
        self.escape = self.way_out(volume);
        let start = self.start();
        self.reach.update(volume, &|i: usize| self.passable[i], start, &[], changed);
        self.escape.len() > 1
    }

    /// Where the way through `reach` starts.
    pub fn start(&self) -> usize {
        self.escape.last().copied().unwrap_or_default()
    }

    /// The way out for a robot that stands where it should not: over free voxels to the passable voxel near by from which
    /// most can be reached, the nearest of equals.
    fn way_out(&self, volume: &Volume) -> Vec<usize> {
        let robot = self.component.start();
        let (found, came_from) = walk(volume, robot, &self.component);
        let mut best = (robot, 0);
        let mut parts: Vec<Cow<'_, Component>> = Vec::new();
        if self.passable[robot] {
            best = (robot, self.reach.count());
            parts.push(Cow::Borrowed(&self.reach));
        }
        for &i in found.iter().filter(|i| self.passable[**i]) {
            if parts.iter().any(|part| part.contains(i)) {
                continue;
            }
            let part = Component::of(volume, &|i: usize| self.passable[i], i);
            if part.count() > best.1 {
                best = (i, part.count());
            }
            parts.push(Cow::Owned(part));
        }
        let mut way = vec![best.0];
        while let Some(&i) = way.last().filter(|i| **i != robot) {
            way.push(came_from(i));
        }
        way.reverse();
        way
    }
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
    use std::collections::BTreeSet;

    use elk_geometry::OccupancyGrid;
    use elk_geometry::bricks::brick_of;
    use proptest::prelude::*;

    use super::*;

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
        let mut space = Space::around(&volume, robot, &Clearance::new(0.1, 0.1).unwrap(), trail);
        space.back_off(&volume, &mut |_| {});
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

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// Kept up to date edit by edit, it is the space that is worked out anew, and what it says has changed is what has.
        #[test]
        fn incremental_equals_worked_out_anew(
            radius in prop_oneof![Just(0.0), Just(0.1), Just(0.25)],
            edits in prop::collection::vec((voxel(), prop::collection::vec((voxel(), 0..8u8), 0..40), any::<bool>()), 1..8),
        ) {
            let mut grid = corridor(5);
            let clearance = Clearance::new(radius, 0.1).unwrap();
            let corners = (Voxel::new(-8, -8, -8), Voxel::new(24, 16, 16));
            let mut volume = Volume::between(&grid, corners, clearance.reach().max(2));
            let at = |volume: &Volume, voxel| volume.index(voxel).unwrap();
            let mut trail: BTreeSet<Voxel> = BTreeSet::new();
            let mut space = Space::around(&volume, at(&volume, Voxel::new(3, 2, 2)), &clearance, &[]);
            for (robot, cells, back_off) in edits {
                let mut turned = Vec::new();
                for (voxel, state) in cells {
                    // Mostly free, as a map is.
                    grid.set(voxel, [State::Unknown, State::Occupied, State::Free][usize::from(state.min(2))]);
                    volume.follow(&grid, brick_of(voxel), |i| turned.push(i));
                }
                trail.insert(robot);
                if trail.len() > 3 {
                    trail.pop_first();
                }
                let trail: Vec<Voxel> = trail.iter().copied().collect();
                let before = space.reach.clone();
                let mut changed = BTreeSet::new();
                space.follow(&volume, at(&volume, robot), &turned, &trail, &mut |i| changed.extend([i]));
                let mut anew = Space::around(&volume, at(&volume, robot), &clearance, &trail);
                if back_off {
                    let moved = space.back_off(&volume, &mut |i| changed.extend([i]));
                    prop_assert_eq!(anew.back_off(&volume, &mut |_| {}), moved);
                }
                prop_assert_eq!(&space.escape, &anew.escape);
                prop_assert_eq!(&*space.component, &*anew.component);
                prop_assert_eq!(&*space.reach, &*anew.reach);
                prop_assert!((0..volume.len()).all(|i| before[i] == space.reach[i] || changed.contains(&i)));
            }
        }
    }

    /// A voxel of the corridor or of its walls.
    fn voxel() -> impl Strategy<Value = Voxel> {
        (-1..21, -1..6, -1..6).prop_map(|(x, y, z)| Voxel::new(x, y, z))
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
            let volume = Volume::of(&grid, Voxel::new(0, 0, 0), clearance.reach().max(2));
            let is_free = |voxel: Voxel| volume.state(voxel) == State::Free;
            let is_clear = |voxel: Voxel| is_free(voxel) && clearance.offsets().iter().all(|d| is_free(voxel + *d));
            let expected: Vec<bool> = (0..volume.len()).map(|i| is_clear(volume.voxel(i))).collect();
            assert!(expected.contains(&true), "{radius}");
            let space = Space::around(&volume, volume.len() / 2, &clearance, &[]);
            assert_eq!(space.passable, expected, "{radius}");
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
