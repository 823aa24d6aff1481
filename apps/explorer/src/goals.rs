//! From where the frontier can be resolved.
//!
//! A frontier voxel that the robot can be in is its own goal. One that it cannot enter (an obstacle is too near) is
//! resolved from a standoff: a voxel close by that looks into what is unknown behind it. Only when no such goal is left,
//! every place that sees the unknown at all counts.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::hash::BuildHasherDefault;

use elk_geometry::Voxel;
use elk_geometry::bricks::{BrickHasher, brick_of, cell_of};
use elk_geometry::mask::{self, Mask};
use elk_geometry::set::Near;
use elk_geometry::visibility::in_sight;
use nalgebra::Point3;

use crate::space::Space;
use crate::target::Target;
use crate::verdicts::Verdicts;

/// Greatest distance of a standoff from its frontier voxel (m).
const STANDOFF_M: f64 = 0.5;
/// Greatest distance from which a look into a voxel is trusted, as a last resort (m).
const LAST_RESORT_M: f64 = 6.0;
/// A search for places that see from afar ends with this many targets seen: the next plan is made from a better map.
const ENOUGH_TARGETS: usize = 16;

/// A place from which a target can be resolved.
#[derive(Debug, Clone, PartialEq)]
pub struct Goal {
    /// The voxel that it lies in.
    pub voxel: Voxel,
    /// Where to look from (m, world).
    pub position: Point3<f64>,
    /// What to look at.
    pub target: Target,
}

/// Targets that no goal from afar resolves.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Far {
    /// No place sees the unknown beside them.
    pub invisible: Vec<Voxel>,
    /// Every place that does was tried.
    pub exhausted: Vec<Voxel>,
}

/// The goals of one plan, at most one a voxel: each target's own, of which in each voxel the first one counts.
///
/// They have an order: first those in the frontier itself, then those at a standoff, both in the order of their targets; then
/// those from afar as they were found.
#[derive(Debug, Clone, Default)]
pub struct Goals {
    /// The goal near each target that has one.
    near: ByVoxel<Goal>,
    /// Those from afar.
    far: Vec<Goal>,
    /// What leads to each voxel.
    at: ByVoxel<Here>,
    /// By brick, these voxels.
    bricks: ByVoxel<Mask>,
}

/// Never gone through in its order.
type ByVoxel<T> = HashMap<Voxel, T, BuildHasherDefault<BrickHasher>>;

/// The goals in one voxel: mostly one.
#[derive(Debug, Clone)]
struct Here {
    first: Rank,
    others: Vec<Rank>,
}

/// The order of goals: the target's voxel, or a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    Own(Voxel),
    Standoff(Voxel),
    Far(usize),
}

impl Goals {
    /// This is the goal near a target now.
    pub(crate) fn set(&mut self, goal: Goal) {
        let (voxel, rank) = (goal.voxel, rank(&goal));
        let before = self.near.insert(goal.target.voxel, goal);
        if before.as_ref().is_none_or(|before| before.voxel != voxel) {
            before.iter().for_each(|before| self.leave(before));
            self.enter(voxel, rank);
        }
    }

    /// There is no goal near target `of`, or no longer.
    pub(crate) fn remove(&mut self, of: Voxel) {
        self.near.remove(&of).iter().for_each(|goal| self.leave(goal));
    }

    fn leave(&mut self, goal: &Goal) {
        let (own, Entry::Occupied(mut entry)) = (rank(goal), self.at.entry(goal.voxel)) else { return };
        let Here { first, others } = entry.get_mut();
        let gone = if own == *first { others.iter().min().copied() } else { Some(own) };
        match gone {
            None => {
                drop(entry.remove());
                let Entry::Occupied(mut brick) = self.bricks.entry(brick_of(goal.voxel)) else { return };
                mask::clear(brick.get_mut(), cell_of(goal.voxel));
                if *brick.get() == mask::NONE {
                    brick.remove();
                }
            }
            Some(gone) => {
                *first = if own == *first { gone } else { *first };
                others.retain(|rank| *rank != gone);
            }
        }
    }

    fn enter(&mut self, voxel: Voxel, rank: Rank) {
        match self.at.entry(voxel) {
            Entry::Vacant(here) => {
                here.insert(Here { first: rank, others: Vec::new() });
                mask::set(self.bricks.entry(brick_of(voxel)).or_insert(mask::NONE), cell_of(voxel));
            }
            Entry::Occupied(mut here) => {
                let Here { first, others } = here.get_mut();
                others.push(rank.max(*first));
                *first = rank.min(*first);
            }
        }
    }

    fn put_far(&mut self, goal: Goal) {
        self.enter(goal.voxel, Rank::Far(self.far.len()));
        self.far.push(goal);
    }

    /// Goals in the frontier itself, or at a standoff from which a camera that sees `range_m` far sees it.
    pub fn near<'a>(space: &Space, range_m: f64, targets: impl IntoIterator<Item = &'a Target>) -> Self {
        let (mut goals, mut near) = (Self::default(), NearGoals::new(space, range_m));
        targets.into_iter().filter_map(|target| near.of(target.clone())).for_each(|goal| goals.set(goal));
        goals
    }

    /// Places that look into the unknown beside a target, from afar if need be, as far as the camera sees, for the first
    /// targets that any sees; and what became of the targets before those ran out.
    pub fn far<'a>(
        space: &Space,
        range_m: f64,
        targets: impl IntoIterator<Item = &'a Target>,
        verdicts: &mut Verdicts,
    ) -> (Self, Far) {
        let mut looks = verdicts.looks(space, LAST_RESORT_M.min(range_m));
        let (mut goals, mut far) = (Self::default(), Far::default());
        let mut seen = 0;
        for target in targets {
            let places = looks.places(target);
            let mut untried = places.iter().filter(|(voxel, _)| target.untried(*voxel)).peekable();
            if places.is_empty() {
                far.invisible.push(target.voxel);
            } else if untried.peek().is_none() {
                far.exhausted.push(target.voxel);
            } else {
                seen += 1;
            }
            for (voxel, position) in untried {
                goals.put_far(Goal { voxel: *voxel, position: *position, target: target.clone() });
            }
            if seen >= ENOUGH_TARGETS {
                break;
            }
        }
        (goals, far)
    }

    fn ranked(&self, rank: Rank) -> Option<&Goal> {
        match rank {
            Rank::Own(target) | Rank::Standoff(target) => self.near.get(&target),
            Rank::Far(number) => self.far.get(number),
        }
    }

    /// The goal in a voxel.
    pub fn at(&self, voxel: Voxel) -> Option<&Goal> {
        self.ranked(self.at.get(&voxel)?.first)
    }

    /// Whether there is a goal in a voxel.
    pub fn contains(&self, voxel: Voxel) -> bool {
        self.bricks.get(&brick_of(voxel)).is_some_and(|cells| mask::has(cells, cell_of(voxel)))
    }

    /// The voxels that have a goal, by brick, in no order.
    pub(crate) fn bricks(&self) -> impl Iterator<Item = (Voxel, &Mask)> {
        self.bricks.iter().map(|(brick, cells)| (*brick, cells))
    }

    /// Corners of boxes, both in it, that all of them are in, in no order.
    pub(crate) fn boxes(&self) -> impl Iterator<Item = [Voxel; 2]> + '_ {
        self.bricks().filter_map(|(brick, cells)| mask::corners(brick, cells))
    }

    /// All goals, always in the same order for the same map.
    pub fn iter(&self) -> impl Iterator<Item = &Goal> {
        let mut ranks: Vec<Rank> = self.at.values().map(|here| here.first).collect();
        ranks.sort_unstable();
        ranks.into_iter().filter_map(|rank| self.ranked(rank))
    }

    /// What there are goals for, each once, in no order.
    pub(crate) fn targets(&self) -> impl Iterator<Item = &Target> {
        // Those from afar come target by target.
        let far =
            self.far.chunk_by(|one, other| one.target.voxel == other.target.voxel).filter_map(|goals| goals.first());
        self.near.values().chain(far).map(|goal| &goal.target)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.at.is_empty()
    }

    /// Number of goals.
    pub fn len(&self) -> usize {
        self.at.len()
    }
}

/// Of a goal near its target.
fn rank(goal: &Goal) -> Rank {
    let of = goal.target.voxel;
    if goal.voxel == of { Rank::Own(of) } else { Rank::Standoff(of) }
}

/// Finds the goals near the frontier.
pub(crate) struct NearGoals<'a> {
    space: &'a Space,
    /// Voxels that a standoff may be away from its target, nearest first.
    ball: Vec<Voxel>,
    /// The largest offset along each axis.
    around: Voxel,
    reach: Near<'a>,
    free: Near<'a>,
}

/// How far from a target that which decides on its goal near by lies at most, for a camera that sees `range_m` far (voxels).
pub(crate) fn reach_of_goals(space: &Space, range_m: f64) -> i32 {
    // What is unknown beside a target lies one voxel farther than where it is looked at from.
    (STANDOFF_M.min(range_m) / space.resolution()).ceil() as i32 + 1
}

impl<'a> NearGoals<'a> {
    /// For a camera that sees `range_m` far.
    pub fn new(space: &'a Space, range_m: f64) -> Self {
        let radius = STANDOFF_M.min(range_m) / space.resolution();
        let (ball, most) = (ball(radius), radius.ceil() as i32);
        Self { space, ball, around: Voxel::new(most, most, most), reach: space.reach.near(), free: space.free.near() }
    }

    /// The goal of a target, if it has one: in its own voxel, or at a standoff, the reachable voxel nearest to it from which its
    /// unknown neighbours are seen.
    pub fn of(&mut self, target: Target) -> Option<Goal> {
        let enterable = target.tried.is_empty() && self.reach.contains(target.voxel);
        let voxel = if enterable { target.voxel } else { self.standoff(&target)? };
        Some(Goal { voxel, position: self.space.center(voxel), target })
    }

    fn standoff(&mut self, target: &Target) -> Option<Voxel> {
        let Self { space, ball, around, reach, free } = self;
        if !reach.meets([target.voxel - *around, target.voxel + *around]) {
            return None;
        }
        let (resolution, mut is_free) = (space.resolution(), |voxel| free.contains(voxel));
        let mut sees = |from: Voxel| {
            let from = from.center(resolution);
            target.unknown().any(|unknown| in_sight(resolution, &mut is_free, from, unknown))
        };
        let near = ball.iter().map(|d| target.voxel + *d);
        let mut reached = near.filter(|voxel| reach.contains(*voxel));
        reached.find(|voxel| target.untried(*voxel) && sees(*voxel))
    }
}

/// The offsets within `radius` (voxels), nearest first.
fn ball(radius: f64) -> Vec<Voxel> {
    let n = radius.ceil() as i32;
    let zero = Voxel::new(0, 0, 0);
    let mut offsets: Vec<Voxel> = (-n..=n)
        .flat_map(|x| (-n..=n).flat_map(move |y| (-n..=n).map(move |z| Voxel::new(x, y, z))))
        .filter(|d| d.distance(zero) <= radius)
        .collect();
    offsets.sort_by_key(|d| d.x * d.x + d.y * d.y + d.z * d.z);
    offsets
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sight::Sight;
    use crate::target::Known;
    use elk_geometry::{Bounds, Clearance, FrontierSet, OccupancyGrid, State};

    /// As far as a camera sees that has no limit (m).
    const RANGE: f64 = f64::INFINITY;

    /// A free box of 10³ voxels, its floor occupied but for what `unknown` leaves open.
    fn room(unknown: &[Voxel]) -> OccupancyGrid {
        let mut grid = OccupancyGrid::new(0.1);
        for x in -1..11 {
            for y in -1..11 {
                for z in -1..11 {
                    let voxel = Voxel::new(x, y, z);
                    let inside = [x, y, z].iter().all(|c| (0..10).contains(c));
                    let state = if inside { State::Free } else { State::Occupied };
                    if !unknown.contains(&voxel) {
                        grid.set(voxel, state);
                    }
                }
            }
        }
        grid
    }

    fn target(grid: &OccupancyGrid, bounds: Option<Bounds>, tried: Vec<Voxel>) -> Target {
        let mut frontier = FrontierSet::new(bounds);
        frontier.update(grid, grid.bricks().voxels().map(|(voxel, _)| voxel));
        Target::new(Known { grid, frontier: &frontier, sight: Sight::default() }, Voxel::new(5, 5, 0), tried)
    }

    /// A robot that can be so far from the walls.
    fn space(grid: &OccupancyGrid, margin: i32) -> Space {
        let within = |voxel: &Voxel| voxel.to_array().into_iter().all(|c| (margin..10 - margin).contains(&c));
        let gone: Vec<Voxel> = grid.bricks().voxels().map(|(voxel, _)| voxel).filter(within).collect();
        // Wide as it is, it can be only where it has been.
        Space::around(grid, Voxel::new(5, 5, 5), &Clearance::new(2.0, 0.1).unwrap(), (&gone, &[]))
    }

    #[test]
    fn what_cannot_be_entered_is_looked_at_from_near() {
        let hole = Voxel::new(5, 5, -1);
        let grid = room(&[hole]);
        let frontier = Voxel::new(5, 5, 0);
        let target = target(&grid, None, vec![]);
        assert!(target.unknown().eq([hole]));

        let entered = Goals::near(&space(&grid, 0), RANGE, [&target]);
        assert!(entered.contains(frontier));

        let kept_off = Goals::near(&space(&grid, 2), RANGE, [&target]);
        let above = Voxel::new(5, 5, 2);
        assert_eq!(kept_off.len(), 1);
        assert_eq!(kept_off.at(above).map(|g| g.target.voxel), Some(frontier));
    }

    #[test]
    fn a_place_tried_in_vain_is_not_tried_again() {
        let hole = Voxel::new(5, 5, -1);
        let grid = room(&[hole]);
        let tried = vec![Voxel::new(5, 5, 0), Voxel::new(5, 5, 2)];
        let target = target(&grid, None, tried.clone());
        let goals = Goals::near(&space(&grid, 1), RANGE, [&target]);
        assert_eq!(goals.len(), 1);
        for t in tried {
            assert!(!goals.contains(t));
        }
    }

    #[test]
    fn outside_the_bounds_nothing_is_unknown() {
        let grid = room(&[Voxel::new(5, 5, -1)]);
        let bounds = Bounds { min: [0.0; 3].into(), max: [1.0; 3].into() };
        let target = target(&grid, Some(bounds), vec![]);
        assert!(target.faces.is_empty());
    }

    /// Regression: what a full map cannot come to know was looked into all the same, when something else made its neighbour
    /// a target.
    #[test]
    fn what_a_full_map_has_no_brick_for_is_no_part_of_a_target() {
        let mut grid = OccupancyGrid::new(0.1);
        let (hole, rim) = (Voxel::new(6, 5, 5), Voxel::new(7, 5, 5));
        let brick = (0..8).flat_map(|x| (0..8).flat_map(move |y| (0..8).map(move |z| Voxel::new(x, y, z))));
        brick.filter(|voxel| *voxel != hole).for_each(|voxel| assert!(grid.set(voxel, State::Free)));
        let mut frontier = FrontierSet::new(None);
        frontier.update(&grid, grid.bricks().voxels().map(|(voxel, _)| voxel));
        let of = |frontier: &FrontierSet| -> Vec<Voxel> {
            Target::new(Known { grid: &grid, frontier, sight: Sight::default() }, rim, vec![]).unknown().collect()
        };
        assert_eq!(of(&frontier), [hole, rim + Voxel::new(1, 0, 0)]);
        frontier.set_full(true, &grid);
        assert_eq!(of(&frontier), [hole]);
    }

    #[test]
    fn what_nothing_sees_is_invisible() {
        let hole = Voxel::new(5, 5, -1);
        let grid = room(&[hole]);
        let target = target(&grid, None, vec![]);
        let nowhere = Space::around(&grid, Voxel::new(99, 0, 0), &Clearance::default(), (&[], &[]));
        let (goals, far) = Goals::far(&nowhere, RANGE, [&target], &mut Verdicts::default());
        assert!(goals.is_empty() && far.invisible == vec![target.voxel]);
        let (goals, far) = Goals::far(&space(&grid, 3), RANGE, [&target], &mut Verdicts::default());
        assert!(!goals.is_empty() && far == Far::default());
        let (goals, far) = Goals::far(&space(&grid, 3), 0.25, [&target], &mut Verdicts::default());
        assert!(goals.is_empty() && far.invisible == vec![target.voxel], "the camera does not see so far");
    }
}
