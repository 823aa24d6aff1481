//! Where the robot can be, and where it can get to.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

use elk_geometry::bricks::{brick_of, voxel_at};
use elk_geometry::clearance::Clearance;
use elk_geometry::mask::{self, Mask};
use elk_geometry::visibility::sees;
use elk_geometry::{Component, OccupancyGrid, Voxel, VoxelSet};
use nalgebra::Point3;

/// How far a robot that stands too close to an obstacle may have to back off (voxels of way).
const ESCAPE_VOXELS: u32 = 8;

/// Where a robot can be in a map, kept up to date with it: a bit a voxel for each question, where something is known.
#[derive(Debug, Clone)]
pub struct Space {
    /// The voxels that are free.
    pub free: VoxelSet,
    /// The robot's component of the free voxels (connected over faces), of those in its layer if it stays in that.
    pub component: Component,
    /// The voxels that the robot can get to with its clearance kept, from what is occupied and from what is unknown.
    pub reach: Component,
    /// From the robot's own voxel to the first in `reach`; only that voxel if the robot stands in `reach`.
    pub escape: Vec<Voxel>,
    resolution: f64,
    clearance: Clearance,
    /// Where the robot has been.
    trail: VoxelSet,
    /// Where it was refused to go.
    barred: VoxelSet,
    passable: VoxelSet,
    /// The layer of voxels that the robot stays in, by its index along z; `None`: it goes anywhere.
    layer: Option<i32>,
    /// What is free there; nothing, if it goes anywhere.
    ground: VoxelSet,
    /// Smallest and largest of the bricks that were heard of.
    known: Option<[Voxel; 2]>,
}

impl Space {
    /// The space around a robot in voxel `robot`. Voxels of `trail`, where the robot has been, stay passable as long as they
    /// are free; those of `barred`, where it was refused to go, are not, whatever the map says.
    pub fn around<'a>(
        grid: &OccupancyGrid,
        robot: Voxel,
        clearance: &Clearance,
        been: (impl IntoIterator<Item = &'a Voxel>, impl IntoIterator<Item = &'a Voxel>),
    ) -> Self {
        Self::of(grid, robot, clearance, None, been)
    }

    /// The same of a robot that stays in the layer of voxels that it is in.
    pub fn in_layer<'a>(
        grid: &OccupancyGrid,
        robot: Voxel,
        clearance: &Clearance,
        been: (impl IntoIterator<Item = &'a Voxel>, impl IntoIterator<Item = &'a Voxel>),
    ) -> Self {
        Self::of(grid, robot, clearance, Some(robot.z), been)
    }

    fn of<'a>(
        grid: &OccupancyGrid,
        robot: Voxel,
        clearance: &Clearance,
        layer: Option<i32>,
        (trail, barred): (impl IntoIterator<Item = &'a Voxel>, impl IntoIterator<Item = &'a Voxel>),
    ) -> Self {
        let nothing = VoxelSet::new();
        let mut space = Self {
            free: VoxelSet::new(),
            component: Component::of(&nothing, robot),
            reach: Component::of(&nothing, robot),
            escape: vec![robot],
            resolution: grid.resolution(),
            clearance: clearance.clone(),
            trail: VoxelSet::new(),
            barred: VoxelSet::new(),
            passable: VoxelSet::new(),
            layer,
            ground: VoxelSet::new(),
            known: None,
        };
        let come = trail.into_iter().map(|voxel| (*voxel, true));
        space.follow(grid, robot, grid.bricks().iter().map(|(brick, _)| brick), (come, barred));
        space
    }

    /// Takes note that the robot is in voxel `robot`, that voxels have come to its trail (`true`) or left it, that more of them are
    /// barred, and that the map has changed in these bricks. Answers the voxels of which anything is other than it was.
    pub fn follow<'a>(
        &mut self,
        grid: &OccupancyGrid,
        robot: Voxel,
        bricks: impl IntoIterator<Item = Voxel>,
        (trail, barred): (impl IntoIterator<Item = (Voxel, bool)>, impl IntoIterator<Item = &'a Voxel>),
    ) -> VoxelSet {
        let heard = |brick: &Voxel| {
            self.known = Some(self.known.map_or([*brick; 2], |[min, max]| [min.inf(*brick), max.sup(*brick)]));
        };
        let turned =
            changes(bricks.into_iter().inspect(heard), |brick| self.free.replace(brick, &grid.free_cells(brick)));
        let mut near: BTreeSet<Voxel> = turned.iter().flat_map(|turned| self.near(turned)).collect();
        for (voxel, on) in trail {
            let changed = if on { self.trail.insert(voxel) } else { self.trail.remove(voxel) };
            near.extend(changed.then(|| brick_of(voxel)));
        }
        near.extend(barred.into_iter().filter(|voxel| self.barred.insert(**voxel)).map(|voxel| brick_of(*voxel)));
        let opened = changes(near, |brick| self.passable.replace(brick, &self.passable_cells(brick)));
        let mut changed = VoxelSet::new();
        let mut note = |brick: Voxel, cells: &Mask| changed.unite(brick, cells);
        turned.iter().for_each(|(brick, cells)| note(*brick, cells));
        match self.layer {
            None => self.component.update(&self.free, robot, &turned, &mut note),
            Some(_) => {
                let (bricks, layer) = (turned.iter().map(|(brick, _)| *brick), self.layer);
                let level = |brick: Voxel| mask::and(self.free.brick(brick), &cells_of(layer, brick));
                let turned = changes(bricks, |brick| self.ground.replace(brick, &level(brick)));
                self.component.update(&self.ground, robot, &turned, &mut note);
            }
        }
        self.reach.update(&self.passable, robot, &opened, &mut note);
        self.escape = vec![robot];
        changed
    }

    /// The bricks that cells of a brick are near enough to for the robot not to be in.
    fn near(&self, (brick, cells): &(Voxel, Mask)) -> impl Iterator<Item = Voxel> + use<> {
        let reach = self.clearance.reach();
        let around = Voxel::new(reach, reach, reach);
        let corners = mask::corners(*brick, cells);
        let bricks = corners.map(|[min, max]| [brick_of(min - around), brick_of(max + around)]);
        bricks.into_iter().flat_map(|[min, max]| {
            let rows = (min.z..=max.z).flat_map(move |z| (min.y..=max.y).map(move |y| (y, z)));
            rows.flat_map(move |(y, z)| (min.x..=max.x).map(move |x| Voxel::new(x, y, z)))
        })
    }

    fn passable_cells(&self, brick: Voxel) -> Mask {
        let (free, trail) = (self.free.brick(brick), self.trail.brick(brick));
        let clear = mask::or(&self.clearance.clear(&self.free, brick), &mask::and(free, trail));
        mask::and(&mask::without(&clear, self.barred.brick(brick)), &self.layer(brick))
    }

    /// The cells of a brick that are in the layer that the robot stays in; all of them, if it goes anywhere.
    pub fn layer(&self, brick: Voxel) -> Mask {
        cells_of(self.layer, brick)
    }

    /// Whether a robot in voxel `robot` is in the layer that it is to stay in.
    pub fn is_level_with(&self, robot: Voxel) -> bool {
        self.layer.is_none_or(|z| z == robot.z)
    }

    /// The robot first gets out of a tight corner, to where most can be reached from; answers the voxels that it can get to, or
    /// not, only by that, if there is such a place.
    pub fn back_off(&mut self) -> Option<VoxelSet> {
        self.escape = self.way_out();
        let (start, mut changed) = (self.start(), VoxelSet::new());
        self.reach.update(&self.passable, start, &[], &mut |brick, cells| changed.unite(brick, cells));
        (self.escape.len() > 1).then_some(changed)
    }

    /// Where the way through `reach` starts.
    pub fn start(&self) -> Voxel {
        self.escape.last().copied().unwrap_or(self.component.start())
    }

    /// Smallest and largest of the bricks (in bricks) in which anything is known, both in the box; `None`: nothing is.
    pub fn known(&self) -> Option<[Voxel; 2]> {
        self.known
    }

    /// The middles (m, world) of the voxels of a way behind the first; of that, too, if it is the only one: the robot may stand beside its
    /// middle, and see less from there.
    pub fn middles(&self, way: &[Voxel]) -> impl Iterator<Item = Point3<f64>> {
        way.iter().skip(usize::from(way.len() > 1)).map(|voxel| self.center(*voxel))
    }

    /// How far from the robot (voxels) what it keeps clear of decides where it can be, and at least 2.
    pub fn margin(&self) -> i32 {
        self.clearance.reach().max(2)
    }

    /// Edge of a voxel (m).
    pub fn resolution(&self) -> f64 {
        self.resolution
    }

    /// The centre of a voxel (m, world).
    pub fn center(&self, voxel: Voxel) -> Point3<f64> {
        voxel.center(self.resolution)
    }

    /// Whether a camera at `from` (m, world) can look into voxel `target`.
    pub fn sees(&self, from: Point3<f64>, target: Voxel) -> bool {
        sees(&self.free, self.resolution, from, target)
    }

    /// The way out for a robot that stands where it should not: over free voxels to the passable voxel near by from which
    /// most can be reached, the nearest of equals.
    fn way_out(&self) -> Vec<Voxel> {
        let robot = self.component.start();
        let (found, came_from) = walk(robot, &self.component);
        let mut best = (robot, 0);
        let mut parts: Vec<Cow<'_, Component>> = Vec::new();
        if self.passable.contains(robot) {
            best = (robot, self.reach.len());
            parts.push(Cow::Borrowed(&self.reach));
        }
        for &voxel in found.iter().filter(|voxel| self.passable.contains(**voxel)) {
            if parts.iter().any(|part| part.contains(voxel)) {
                continue;
            }
            let part = Component::of(&self.passable, voxel);
            if part.len() > best.1 {
                best = (voxel, part.len());
            }
            parts.push(Cow::Owned(part));
        }
        let mut way = vec![best.0];
        while let Some(&voxel) = way.last().filter(|voxel| **voxel != robot) {
            way.push(came_from(voxel));
        }
        way.reverse();
        way
    }
}

/// The cells of a brick in a layer of voxels; all of them, if there is none.
fn cells_of(layer: Option<i32>, brick: Voxel) -> Mask {
    let Some(z) = layer else { return mask::ALL };
    let within = z - voxel_at(brick, 0).z;
    std::array::from_fn(|layer| if layer as i32 == within { u64::MAX } else { 0 })
}

/// The bricks of which something turns by `turn`, and what does.
fn changes(bricks: impl IntoIterator<Item = Voxel>, mut turn: impl FnMut(Voxel) -> Mask) -> Vec<(Voxel, Mask)> {
    let turned = bricks.into_iter().map(|brick| (brick, turn(brick)));
    turned.filter(|(_, cells)| *cells != mask::NONE).collect()
}

/// Breadth first from `robot`, no further than [`ESCAPE_VOXELS`]: the voxels in order, and where each was come from.
fn walk(robot: Voxel, free: &VoxelSet) -> (Vec<Voxel>, impl Fn(Voxel) -> Voxel + use<>) {
    let mut order = Vec::new();
    let mut parent = BTreeMap::from([(robot, robot)]);
    let mut open = VecDeque::from([(robot, 0)]);
    while let Some((voxel, steps)) = open.pop_front() {
        order.push(voxel);
        for n in voxel.face_neighbours() {
            if steps < ESCAPE_VOXELS && free.contains(n) && !parent.contains_key(&n) {
                parent.insert(n, voxel);
                open.push_back((n, steps + 1));
            }
        }
    }
    (order, move |voxel| parent.get(&voxel).copied().unwrap_or(robot))
}

#[cfg(test)]
mod tests {
    use elk_geometry::State;
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

    fn space(grid: &OccupancyGrid, robot: Voxel, trail: &[Voxel]) -> Space {
        let mut space = Space::around(grid, robot, &Clearance::new(0.1, 0.1).unwrap(), (trail, &[]));
        space.back_off();
        space
    }

    #[test]
    fn the_body_decides_what_is_reached() {
        let robot = Voxel::new(3, 2, 2);
        let reached = |hole: i32| {
            let space = space(&corridor(hole), robot, &[]);
            let beyond = Voxel::new(15, 2, 2);
            (space.component.contains(beyond), space.reach.contains(beyond))
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
            edits in prop::collection::vec((voxel(), prop::collection::vec((voxel(), 0..8u8), 0..40), prop::option::of(voxel()), any::<bool>()), 1..8),
        ) {
            let mut grid = corridor(5);
            let clearance = Clearance::new(radius, 0.1).unwrap();
            let (mut trail, mut all_barred): (BTreeSet<Voxel>, BTreeSet<Voxel>) = Default::default();
            let mut space = Space::around(&grid, Voxel::new(3, 2, 2), &clearance, (&trail, &[]));
            for (robot, cells, barred, back_off) in edits {
                let mut bricks = BTreeSet::new();
                for (voxel, state) in cells {
                    // Mostly free, as a map is.
                    grid.set(voxel, [State::Unknown, State::Occupied, State::Free][usize::from(state.min(2))]);
                    bricks.insert(brick_of(voxel));
                }
                let mut turned = vec![(robot, trail.insert(robot))];
                if trail.len() > 3 {
                    turned.extend(trail.pop_first().map(|voxel| (voxel, false)));
                }
                turned.retain(|(voxel, on)| trail.contains(voxel) == *on);
                let before = space.clone();
                let mut changed = space.follow(&grid, robot, bricks, (turned, &barred));
                all_barred.extend(&barred);
                let mut anew = Space::around(&grid, robot, &clearance, (&trail, &all_barred));
                if back_off {
                    let moved = space.back_off();
                    prop_assert_eq!(anew.back_off().is_some(), moved.is_some());
                    moved.iter().flat_map(VoxelSet::bricks).for_each(|(brick, cells)| changed.unite(brick, cells));
                }
                prop_assert_eq!(&space.escape, &anew.escape);
                prop_assert!(space.free == anew.free && space.passable == anew.passable);
                prop_assert!(*space.component == *anew.component && *space.reach == *anew.reach);
                let is_as_it_was = |brick: Voxel| {
                    let cells = |space: &Space| [*space.free.brick(brick), *space.component.brick(brick), *space.reach.brick(brick)];
                    let left = |cells: [Mask; 3]| cells.map(|cells| mask::without(&cells, changed.brick(brick)));
                    left(cells(&before)) == left(cells(&space))
                };
                prop_assert!(space.free.bricks().all(|(brick, _)| is_as_it_was(brick)));
            }
        }
    }

    /// A voxel of the corridor or of its walls.
    fn voxel() -> impl Strategy<Value = Voxel> {
        (-1..21, -1..6, -1..6).prop_map(|(x, y, z)| Voxel::new(x, y, z))
    }

    #[test]
    fn where_it_has_been_it_can_go_again() {
        let robot = Voxel::new(3, 2, 2);
        let through: Vec<Voxel> = (3..18).map(|x| Voxel::new(x, 0, 0)).chain([Voxel::new(3, 1, 0)]).collect();
        let reached = |trail: &[Voxel]| space(&corridor(1), robot, trail).reach.contains(Voxel::new(17, 0, 0));
        assert!(!reached(&[]));
        assert!(reached(&through));
    }

    #[test]
    fn who_stays_in_its_layer_gets_nowhere_else() {
        let robot = Voxel::new(3, 2, 2);
        let clearance = Clearance::new(0.1, 0.1).unwrap();
        let mut grid = corridor(5);
        let mut space = Space::in_layer(&grid, robot, &clearance, (&[], &[]));
        assert_eq!(
            (space.component.len(), space.reach.len()),
            (20 * 5, 18 * 3),
            "what is above and below is kept clear of"
        );
        // A step that somebody flies over shuts the way of who does not.
        for y in 0..5 {
            grid.set(Voxel::new(12, y, 2), State::Occupied);
        }
        let voxels: BTreeSet<Voxel> = (0..5).map(|y| brick_of(Voxel::new(12, y, 2))).collect();
        space.follow(&grid, robot, voxels, ([], &[]));
        assert!(space.component.len() == 12 * 5 && !space.reach.contains(Voxel::new(15, 2, 2)));
        assert!(Space::around(&grid, robot, &clearance, (&[], &[])).component.contains(Voxel::new(15, 2, 2)));
        assert!(space.is_level_with(robot) && !space.is_level_with(robot + Voxel::new(0, 0, 1)));
    }

    #[test]
    fn what_is_unknown_is_kept_clear_of_too() {
        let mut grid = corridor(5);
        grid.set(Voxel::new(15, 2, 2), State::Unknown);
        let space = space(&grid, Voxel::new(3, 2, 2), &[]);
        let reached = |x: i32| space.reach.contains(Voxel::new(x, 2, 2));
        assert!(reached(13) && !reached(14), "the corridor is closed by one unknown voxel");
        assert!(!reached(18));
    }

    #[test]
    fn too_close_to_a_wall_it_backs_off() {
        let space = space(&corridor(5), Voxel::new(3, 0, 0), &[]);
        assert_eq!(space.escape[0], Voxel::new(3, 0, 0));
        assert_eq!(space.escape.len(), 3, "{:?}", space.escape);
        assert!(space.reach.contains(space.start()));
    }
}
