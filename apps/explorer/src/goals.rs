//! From where the frontier can be resolved.
//!
//! A frontier voxel that the robot can be in is its own goal. One that it cannot enter (an obstacle is too near) is
//! resolved from a standoff: a voxel close by that looks into what is unknown behind it. Only when no such goal is left,
//! every place that sees the unknown at all counts.

use elk_geometry::Voxel;
use nalgebra::Point3;

use crate::target::Target;
use crate::verdicts::Verdicts;
use elk_geometry::Volume;
use elk_geometry::visibility::Lookout;

/// Greatest distance of a standoff from its frontier voxel (m).
const STANDOFF_M: f64 = 0.5;
/// Greatest distance from which a look into a voxel is trusted, as a last resort (m).
const LAST_RESORT_M: f64 = 6.0;
/// A search for places that see from afar ends with this many targets seen: the next plan is made from a better map.
const ENOUGH_TARGETS: usize = 16;

/// A place from which a target can be resolved.
#[derive(Debug, Clone, PartialEq)]
pub struct Goal {
    /// The voxel that it lies in, by index of the [`Volume`].
    pub index: usize,
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

/// The goals of one plan, at most one a voxel.
#[derive(Debug, Clone)]
pub struct Goals {
    /// By index of the [`Volume`]: one more than the place in `list`, or 0.
    at: Vec<u32>,
    list: Vec<Goal>,
}

impl Goals {
    /// No goal.
    pub fn none(volume: &Volume) -> Self {
        Self { at: vec![0; volume.len()], list: Vec::new() }
    }

    fn add(&mut self, index: usize, goal: impl FnOnce() -> Goal) {
        if self.at[index] == 0 {
            self.list.push(goal());
            self.at[index] = self.list.len() as u32;
        }
    }

    /// Goals in the frontier itself, or at a standoff from which a camera that sees `range_m` far sees it.
    pub fn near<'a>(
        volume: &Volume,
        reach: &[bool],
        range_m: f64,
        targets: impl IntoIterator<Item = &'a Target, IntoIter: Clone>,
        verdicts: &mut Verdicts,
    ) -> Self {
        let targets = targets.into_iter();
        let mut goals = Self::none(volume);
        let enterable = |t: &Target| {
            let i = volume.index(t.voxel)?;
            (reach[i] && t.tried.is_empty()).then_some(i)
        };
        for (i, target) in targets.clone().filter_map(|t| Some((enterable(t)?, t))) {
            let position = volume.center(i);
            goals.add(i, || Goal { index: i, position, target: target.clone() });
        }
        let radius = STANDOFF_M.min(range_m) / volume.resolution();
        let ball: Vec<(Voxel, isize)> = ball(radius).into_iter().map(|d| (d, volume.offset(d))).collect();
        for target in targets.filter(|t| enterable(t).is_none()) {
            let look = || standoff(volume, reach, target, &ball);
            // What is unknown there lies one voxel farther.
            if let Some(i) = verdicts.standoff(volume, target, radius.ceil() as i32 + 1, look) {
                let position = volume.center(i);
                goals.add(i, || Goal { index: i, position, target: target.clone() });
            }
        }
        goals
    }

    /// Places that look into the unknown beside a target, from afar if need be, as far as the camera sees, for the first
    /// targets that any sees; and what became of the targets before those ran out.
    pub fn far<'a>(
        volume: &Volume,
        reach: &[bool],
        range_m: f64,
        targets: impl IntoIterator<Item = &'a Target>,
        verdicts: &mut Verdicts,
    ) -> (Self, Far) {
        let lookout = Lookout::new(LAST_RESORT_M.min(range_m), volume.resolution()).from_within(volume, reach);
        let (mut goals, mut far) = (Self::none(volume), Far::default());
        let mut seen = 0;
        for target in targets {
            let places = verdicts.views(volume, reach, target, &lookout);
            let mut untried = places.iter().filter(|(i, _)| target.untried(volume.voxel(*i))).peekable();
            if places.is_empty() {
                far.invisible.push(target.voxel);
            } else if untried.peek().is_none() {
                far.exhausted.push(target.voxel);
            } else {
                seen += 1;
            }
            for (i, position) in untried {
                goals.add(*i, || Goal { index: *i, position: *position, target: target.clone() });
            }
            if seen >= ENOUGH_TARGETS {
                break;
            }
        }
        (goals, far)
    }

    /// The goal in the voxel at an index.
    pub fn at(&self, index: usize) -> Option<&Goal> {
        self.list.get((*self.at.get(index)? as usize).wrapping_sub(1))
    }

    /// Whether there is a goal in the voxel at an index.
    pub fn contains(&self, index: usize) -> bool {
        self.at(index).is_some()
    }

    /// All goals, always in the same order for the same map.
    pub fn iter(&self) -> impl Iterator<Item = &Goal> {
        self.list.iter()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Number of goals.
    pub fn len(&self) -> usize {
        self.list.len()
    }
}

/// The reachable voxel nearest to a target that sees its unknown neighbours; the ball is that of the offsets, with those of the
/// indices.
fn standoff(volume: &Volume, reach: &[bool], target: &Target, ball: &[(Voxel, isize)]) -> Option<usize> {
    let own = volume.index(target.voxel)?;
    let outermost = ball.last().map_or(0, |(d, _)| d.distance(Voxel::new(0, 0, 0)).ceil() as i32);
    let around = Voxel::new(outermost, outermost, outermost);
    let all_inside = [target.voxel - around, target.voxel + around].iter().all(|v| volume.index(*v).is_some());
    let index = |(voxel, offset): &(Voxel, isize)| match all_inside {
        true => Some(own.wrapping_add_signed(*offset)),
        false => volume.index(target.voxel + *voxel),
    };
    let reached = ball.iter().filter_map(index).filter(|i| reach[*i]);
    reached.into_iter().find(|i| target.seen_from(volume, volume.center(*i)))
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
    use elk_geometry::{Bounds, FrontierSet, OccupancyGrid, State};

    /// As far as a camera sees that has no limit (m).
    const FAR: f64 = f64::INFINITY;

    /// A free box of 10³ voxels, its floor occupied but for what `unknown` leaves open.
    fn room(unknown: &[Voxel]) -> (OccupancyGrid, Volume) {
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
        let volume = Volume::of(&grid, Voxel::new(0, 0, 0), 2);
        (grid, volume)
    }

    fn target(grid: &OccupancyGrid, bounds: Option<Bounds>, tried: Vec<Voxel>) -> Target {
        let mut frontier = FrontierSet::new(bounds);
        frontier.update(grid, grid.bricks().voxels().map(|(voxel, _)| voxel));
        Target::new(Known { grid, frontier: &frontier, sight: Sight::default() }, Voxel::new(5, 5, 0), tried)
    }

    fn reach(volume: &Volume, margin: i32) -> Vec<bool> {
        let within = |c: i32| (margin..10 - margin).contains(&c);
        (0..volume.len()).map(|i| volume.voxel(i).to_array().into_iter().all(within)).collect()
    }

    #[test]
    fn what_cannot_be_entered_is_looked_at_from_near() {
        let hole = Voxel::new(5, 5, -1);
        let (grid, volume) = room(&[hole]);
        let frontier = Voxel::new(5, 5, 0);
        let target = target(&grid, None, vec![]);
        assert!(target.unknown().eq([hole]));

        let entered = Goals::near(&volume, &reach(&volume, 0), FAR, [&target], &mut Verdicts::new(&volume));
        assert!(entered.contains(volume.index(frontier).unwrap()));

        let kept_off = Goals::near(&volume, &reach(&volume, 2), FAR, [&target], &mut Verdicts::new(&volume));
        let above = volume.index(Voxel::new(5, 5, 2)).unwrap();
        assert_eq!(kept_off.len(), 1);
        assert_eq!(kept_off.at(above).map(|g| g.target.voxel), Some(frontier));
    }

    #[test]
    fn a_place_tried_in_vain_is_not_tried_again() {
        let hole = Voxel::new(5, 5, -1);
        let (grid, volume) = room(&[hole]);
        let tried = vec![Voxel::new(5, 5, 0), Voxel::new(5, 5, 2)];
        let target = target(&grid, None, tried.clone());
        let goals = Goals::near(&volume, &reach(&volume, 1), FAR, [&target], &mut Verdicts::new(&volume));
        assert_eq!(goals.len(), 1);
        for t in tried {
            assert!(!goals.contains(volume.index(t).unwrap()));
        }
    }

    #[test]
    fn outside_the_bounds_nothing_is_unknown() {
        let (grid, _) = room(&[Voxel::new(5, 5, -1)]);
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
        let (grid, volume) = room(&[hole]);
        let target = target(&grid, None, vec![]);
        let nowhere = vec![false; volume.len()];
        let (goals, far) = Goals::far(&volume, &nowhere, FAR, [&target], &mut Verdicts::new(&volume));
        assert!(goals.is_empty() && far.invisible == vec![target.voxel]);
        let (goals, far) = Goals::far(&volume, &reach(&volume, 3), FAR, [&target], &mut Verdicts::new(&volume));
        assert!(!goals.is_empty() && far == Far::default());
        let (goals, far) = Goals::far(&volume, &reach(&volume, 3), 0.25, [&target], &mut Verdicts::new(&volume));
        assert!(goals.is_empty() && far.invisible == vec![target.voxel], "the camera does not see so far");
    }
}
