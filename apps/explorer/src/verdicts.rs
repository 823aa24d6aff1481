//! What was found of targets in earlier plans: it holds as long as nothing has changed where it was looked.

use std::collections::HashMap;
use std::hash::BuildHasherDefault;

use elk_geometry::Voxel;
use elk_geometry::bricks::{BrickHasher, brick_of};
use elk_geometry::visibility::{Lookout, Place};

use crate::space::Space;
use crate::target::Target;

/// From where targets are seen from afar, and what that depends on.
#[derive(Debug, Clone, Default)]
pub struct Verdicts {
    changes: Changes,
    views: ByVoxel<Verdict>,
    /// From where the views were looked for: corners of a box, both in it, that the robot could not leave.
    places: Option<[Voxel; 2]>,
    /// Looks from there.
    lookout: Option<Lookout>,
}

/// When the state of a voxel last changed, or whether the robot can get to it.
#[derive(Debug, Clone, Default)]
struct Changes {
    in_brick: ByVoxel<u64>,
    /// Counts the occasions on which something changed.
    now: u64,
}

/// Never gone through in its order.
type ByVoxel<T> = HashMap<Voxel, T, BuildHasherDefault<BrickHasher>>;

/// What was found of a target.
#[derive(Debug, Clone)]
struct Verdict {
    target: Target,
    /// When it was found.
    at: u64,
    /// Corners of the box that was looked at, both in it.
    within: [Voxel; 2],
    places: Vec<Place>,
}

impl Changes {
    fn hear_of(&mut self, bricks: impl IntoIterator<Item = Voxel>) {
        self.now += 1;
        self.in_brick.extend(bricks.into_iter().map(|brick| (brick, self.now)));
    }

    /// Whether a verdict still is as it was found.
    fn leave(&self, verdict: &Verdict, target: &Target) -> bool {
        let [least, most] = verdict.within.map(brick_of);
        let rows = || (least.z..=most.z).flat_map(|z| (least.y..=most.y).map(move |y| (y, z)));
        let mut bricks = rows().flat_map(|(y, z)| (least.x..=most.x).map(move |x| Voxel::new(x, y, z)));
        let unchanged = |brick: Voxel| self.in_brick.get(&brick).is_none_or(|at| *at <= verdict.at);
        verdict.target == *target && (verdict.at == self.now || bricks.all(unchanged))
    }
}

impl Verdicts {
    /// Takes note that in these bricks the state of a voxel has changed, or whether the robot can get to it.
    pub fn hear_of(&mut self, bricks: impl IntoIterator<Item = Voxel>) {
        if self.views.is_empty() {
            // Nobody asks for what was before the next look.
            self.changes.in_brick.clear();
        }
        self.changes.hear_of(bricks);
    }

    /// For looks into targets from where the robot can be in `space`, at most `range_m` away.
    pub fn looks<'a>(&'a mut self, space: &'a Space, range_m: f64) -> Looks<'a> {
        let Self { changes, views, places, lookout, .. } = self;
        let start = [space.reach.start(); 2];
        let [min, max] = space.reach.corners().unwrap_or(start);
        let [least, most] = places.unwrap_or([min, max]);
        let wide = [least.inf(min), most.sup(max)];
        // What comes to it may be seen where nobody looked; what goes from it was looked at in vain.
        if *places != Some(wide) {
            views.clear();
            *places = Some(wide);
        }
        let kept = lookout.take().filter(|lookout| lookout.is_of(range_m));
        let new = kept.unwrap_or_else(|| {
            views.clear();
            Lookout::new(range_m, space.resolution())
        });
        Looks { space, changes, views, lookout: lookout.insert(new.from_within(wide)) }
    }

    /// Forgets a target that is none any more.
    pub fn forget(&mut self, target: Voxel) {
        self.views.remove(&target);
    }
}

/// Looks from afar.
pub struct Looks<'a> {
    space: &'a Space,
    changes: &'a Changes,
    views: &'a mut ByVoxel<Verdict>,
    lookout: &'a Lookout,
}

impl Looks<'_> {
    /// The places from which a target is seen.
    pub fn places(&mut self, target: &Target) -> &[Place] {
        let Self { space, changes, views, lookout } = self;
        let known = views.get(&target.voxel).is_some_and(|verdict| changes.leave(verdict, target));
        if !known {
            let mut within = [target.voxel; 2];
            let looks = target.unknown().flat_map(|unknown| {
                let (places, [least, most]) = lookout.viewpoints(&space.free, &space.reach, unknown);
                within = [within[0].inf(least), within[1].sup(most)];
                places
            });
            let places = looks.collect();
            views.insert(target.voxel, Verdict { target: target.clone(), at: changes.now, within, places });
        }
        views.get(&target.voxel).map_or(&[], |verdict| &verdict.places)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use elk_geometry::{Clearance, FrontierSet, OccupancyGrid, State};
    use nalgebra::Point3;
    use proptest::prelude::*;

    use super::*;
    use crate::goals::Goals;
    use crate::sight::Sight;
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
    fn goals(found: &Goals) -> Vec<(Voxel, Voxel, Point3<f64>)> {
        found.iter().map(|goal| (goal.voxel, goal.target.voxel, goal.position)).collect()
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
            let robot = Voxel::new(5, 5, 5);
            let mut space = Space::around(&grid, robot, &clearance, (&[], &[]));
            let (mut kept, mut tried) = (Verdicts::default(), BTreeSet::new());
            for (cells, look) in edits {
                let mut bricks = BTreeSet::new();
                for (voxel, state) in cells {
                    let state = [State::Occupied, State::Free, State::Unknown][usize::from(state.min(2))];
                    if grid.set(voxel, state) {
                        frontier.update(&grid, [voxel]);
                        bricks.insert(brick_of(voxel));
                    }
                }
                tried.extend(look);
                kept.hear_of(space.follow(&grid, robot, bricks, ([], [])).bricks().map(|(brick, _)| brick));
                let known = Known { grid: &grid, frontier: &frontier, sight: Sight::default() };
                let target = |voxel| Target::new(known, voxel, tried.iter().copied().collect());
                let targets: Vec<Target> = frontier.iter().map(target).collect();
                let far = |verdicts: &mut Verdicts| {
                    let (found, far) = Goals::far(&space, 1.5, &targets, verdicts);
                    (goals(&found), far)
                };
                prop_assert_eq!(far(&mut kept), far(&mut Verdicts::default()));
            }
        }
    }
}
