//! What was found of targets in earlier plans: it holds as long as nothing has changed where it was looked.

use std::collections::HashMap;
use std::hash::BuildHasherDefault;

use elk_geometry::bricks::BrickHasher;
use elk_geometry::visibility::Lookout;
use elk_geometry::{Region, Volume, Voxel};
use nalgebra::Point3;

use crate::target::Target;

/// Edge of the blocks of which it is known when something in them changed (voxels).
const BLOCK: usize = 8;
/// Verdicts that are kept of targets that there are no longer, beside as many as there are.
const SPARE: usize = 256;

/// A place to look from: the voxel, by index of the [`Volume`], and the point in it (m, world).
pub type Place = (usize, Point3<f64>);

/// Verdicts on targets in one [`Volume`], and when what they depend on changed.
#[derive(Debug, Clone)]
pub struct Verdicts {
    /// Blocks along x, y and z.
    blocks: [usize; 3],
    /// When anything in a block last changed: the state of a voxel, or whether the robot can get to it.
    changed: Vec<u64>,
    /// The same of a block and the 26 beside it.
    changed_near: Vec<u64>,
    /// Counts the occasions on which something changed.
    now: u64,
    standoffs: ByTarget<Option<usize>>,
    views: ByTarget<Vec<Place>>,
    /// Where the robot could be, at most, when the views were looked for.
    places: Option<[Point3<f64>; 2]>,
}

/// What was found of each target; what there is of them is never gone through in their order.
type ByTarget<T> = HashMap<Voxel, Verdict<T>, BuildHasherDefault<BrickHasher>>;

/// What was found of a target.
#[derive(Debug, Clone)]
struct Verdict<T> {
    target: Target,
    /// When it was found.
    at: u64,
    /// Corners of the box that was looked at, both in it.
    within: [Voxel; 2],
    found: T,
}

impl Verdicts {
    /// None yet.
    pub fn new(region: &Region) -> Self {
        let blocks = region.dim().map(|n| n.div_ceil(BLOCK));
        let (standoffs, views) = (ByTarget::default(), ByTarget::default());
        let never = vec![0; blocks.iter().product()];
        Self { blocks, changed: never.clone(), changed_near: never, now: 0, standoffs, views, places: None }
    }

    /// Takes note that the state of these voxels has changed, or whether the robot can get to them.
    pub fn hear_of(&mut self, region: &Region, changed: impl IntoIterator<Item = usize>) {
        self.now += 1;
        let [nx, ny, _] = region.dim();
        for i in changed {
            let block = [i % nx, i / nx % ny, i / (nx * ny)].map(|c| c / BLOCK);
            let at = self.number(block);
            if std::mem::replace(&mut self.changed[at], self.now) != self.now {
                self.mark_near(block);
            }
        }
    }

    fn number(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.blocks[1] + y) * self.blocks[0] + x
    }

    fn mark_near(&mut self, block: [usize; 3]) {
        let [xs, ys, zs] = std::array::from_fn(|a| block[a].saturating_sub(1)..=(block[a] + 1).min(self.blocks[a] - 1));
        for (z, y) in zs.flat_map(|z| ys.clone().map(move |y| (z, y))) {
            let row = self.number([*xs.start(), y, z])..=self.number([*xs.end(), y, z]);
            self.changed_near[row].fill(self.now);
        }
    }

    /// Whether nothing has changed less than a block away from a voxel since then.
    fn is_calm(&self, region: &Region, voxel: Voxel, since: u64) -> bool {
        let block = (voxel - region.origin()).to_array().map(|c| c.max(0) as usize / BLOCK);
        self.changed_near.get(self.number(block)).is_some_and(|at| *at <= since)
    }

    /// The place of a target that `look` finds within `radius` voxels, or what it found when it last looked there.
    pub fn standoff(
        &mut self,
        region: &Region,
        target: &Target,
        radius: i32,
        look: impl FnOnce() -> Option<usize>,
    ) -> Option<usize> {
        let holds = |verdict: &&Verdict<Option<usize>>| {
            let calm = radius <= BLOCK as i32 && self.is_calm(region, target.voxel, verdict.at);
            (calm && verdict.target == *target) || self.holds(region, verdict, target)
        };
        if let Some(verdict) = self.standoffs.get(&target.voxel).filter(holds) {
            return verdict.found;
        }
        let around = Voxel::new(radius, radius, radius);
        let within = [target.voxel - around, target.voxel + around];
        let found = look();
        self.standoffs.insert(target.voxel, Verdict { target: target.clone(), at: self.now, within, found });
        found
    }

    /// The places from which a target is seen.
    pub fn views(&mut self, volume: &Volume, reach: &[bool], target: &Target, lookout: &Lookout) -> &[Place] {
        if self.places != lookout.places() {
            self.views.clear();
            self.places = lookout.places();
        }
        let known = self.views.get(&target.voxel).is_some_and(|verdict| self.holds(volume, verdict, target));
        if !known {
            let mut within = [target.voxel; 2];
            let looks = target.unknown().flat_map(|unknown| {
                let (places, [least, most]) = lookout.viewpoints(volume, reach, unknown);
                within = [within[0].inf(least), within[1].sup(most)];
                places
            });
            let found = looks.collect();
            self.views.insert(target.voxel, Verdict { target: target.clone(), at: self.now, within, found });
        }
        self.views.get(&target.voxel).map_or(&[], |verdict| &verdict.found)
    }

    /// Whether it still is as it was found.
    fn holds<T>(&self, region: &Region, verdict: &Verdict<T>, target: &Target) -> bool {
        let [least, most] = verdict.within.map(|corner| (corner - region.origin()).to_array());
        let range = |axis: usize| {
            let block = |place: i32| (place.max(0) as usize / BLOCK).min(self.blocks[axis] - 1);
            block(least[axis])..=block(most[axis])
        };
        let row = |y: usize, z: usize| {
            &self.changed[self.number([*range(0).start(), y, z])..=self.number([*range(0).end(), y, z])]
        };
        let unchanged = |at: &u64| *at <= verdict.at;
        verdict.target == *target && range(2).all(|z| range(1).all(|y| row(y, z).iter().all(unchanged)))
    }

    /// Forgets targets that are none of those, if there are many.
    pub fn forget_all_but(&mut self, targets: &[Target]) {
        let most = 2 * targets.len() + SPARE;
        let is_left = |voxel: &Voxel| targets.binary_search_by_key(voxel, |target| target.voxel).is_ok();
        if self.standoffs.len() > most {
            self.standoffs.retain(|voxel, _| is_left(voxel));
        }
        if self.views.len() > most {
            self.views.retain(|voxel, _| is_left(voxel));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use elk_geometry::bricks::brick_of;
    use elk_geometry::{Clearance, FrontierSet, OccupancyGrid, State};
    use proptest::prelude::*;

    use super::*;
    use crate::goals::Goals;
    use crate::sight::Sight;
    use crate::space::Space;
    use crate::target::Known;

    /// Edge of a hall of free voxels.
    const EDGE: i32 = 12;

    fn hall() -> OccupancyGrid {
        let mut grid = OccupancyGrid::new(0.1);
        let side = || -1..=EDGE;
        let all = side().flat_map(|x| side().flat_map(move |y| side().map(move |z| Voxel::new(x, y, z))));
        for voxel in all {
            let wall = voxel.to_array().iter().any(|c| [-1, EDGE].contains(c));
            grid.set(voxel, if wall { State::Occupied } else { State::Free });
        }
        grid
    }

    fn voxel() -> impl Strategy<Value = Voxel> {
        prop::array::uniform3(-1..=EDGE).prop_map(Voxel::from)
    }

    /// What is gone for, and what is not, of the goals that there are.
    fn goals(found: &Goals) -> Vec<(usize, Voxel, Point3<f64>)> {
        found.iter().map(|goal| (goal.index, goal.target.voxel, goal.position)).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        /// Edit by edit, what is found with the verdicts that were kept is what is found without any.
        #[test]
        fn what_is_kept_is_what_is_found_anew(
            radius in prop_oneof![Just(0.1), Just(0.25)],
            edits in prop::collection::vec((prop::collection::vec((voxel(), 0..6u8), 0..12), prop::option::of(voxel())), 2..7),
        ) {
            let (mut grid, mut frontier, clearance) = (hall(), FrontierSet::new(None), Clearance::new(radius, 0.1).unwrap());
            let mut volume = Volume::of(&grid, Voxel::new(0, 0, 0), clearance.reach().max(2));
            let robot = volume.index(Voxel::new(5, 5, 5)).unwrap();
            let mut space = Space::around(&volume, robot, &clearance, &[]);
            let (mut kept, mut tried) = (Verdicts::new(&volume), BTreeSet::new());
            for (cells, look) in edits {
                let mut turned = Vec::new();
                for (voxel, state) in cells {
                    let state = [State::Occupied, State::Free, State::Unknown][usize::from(state.min(2))];
                    if grid.set(voxel, state) {
                        frontier.update(&grid, [voxel]);
                        volume.follow(&grid, brick_of(voxel), |i| turned.push(i));
                    }
                }
                tried.extend(look);
                let mut changed = turned.clone();
                space.follow(&volume, robot, &turned, &[], &mut |i| changed.push(i));
                kept.hear_of(&volume, changed);
                let known = Known { grid: &grid, frontier: &frontier, sight: Sight::default() };
                let target = |voxel| Target::new(known, voxel, tried.iter().copied().collect());
                let targets: Vec<Target> = frontier.iter().map(target).collect();
                let reach = &space.reach;
                let near = |verdicts: &mut Verdicts| goals(&Goals::near(&volume, reach, 0.4, &targets, verdicts));
                let far = |verdicts: &mut Verdicts| {
                    let (found, far) = Goals::far(&volume, reach, 1.5, &targets, verdicts);
                    (goals(&found), far)
                };
                prop_assert_eq!(near(&mut kept), near(&mut Verdicts::new(&volume)));
                prop_assert_eq!(far(&mut kept), far(&mut Verdicts::new(&volume)));
                kept.forget_all_but(&targets);
            }
        }
    }
}
