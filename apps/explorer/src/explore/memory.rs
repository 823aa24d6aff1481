//! What an explorer remembers from plan to plan.

use std::collections::{BTreeMap, BTreeSet};

use elk_geometry::mask::Mask;
use elk_geometry::ray::Traversal;
use elk_geometry::{FrontierSet, Polyline, Pose, State, Voxel, VoxelSet};
use elk_spatial::checks::{MAX_CORNERS, MAX_COUNT, MAX_REMEMBERED, MAX_TRIES, path_in};
use elk_spatial::messages::{
    Decision, ExplorerMemory, ExplorerPast, Outcome, Path, PlanRequest, Standing, TargetRecord,
};
use nalgebra::Point3;

use super::nearest::nearest;
use crate::policy::LOOK_RANGE_M;
use crate::target::{Known, is_untried};
use elk_geometry::visibility::in_sight;

/// Paths to a target that may be cut in a row before that counts as an attempt in vain.
const CUTS: u32 = 3;

/// Plans for a target, for each place that it may be looked at from, after which it is given up: a voxel that flickers
/// between free and occupied is never looked at in vain, and never done.
const RETURNS: u64 = 3;

/// Places from which a target is looked at where rays go without a return: to look again there is mostly in vain.
const SILENT_ATTEMPTS: usize = 2;

/// Where the robot has been, and what it looked at in vain.
#[derive(Debug, Default)]
pub struct Memory {
    /// The last path, and the position that it was to end in.
    path: Option<Path>,
    targets: BTreeMap<Voxel, TargetRecord>,
    /// The voxels of these.
    remembered: VoxelSet,
    /// Those of which something was learned that nobody was told.
    learned: BTreeSet<Voxel>,
    trail: BTreeSet<Voxel>,
    /// What came to it when the last plan was made (`true`), or left it.
    trail_turned: Vec<(Voxel, bool)>,
    hidden: BTreeSet<Voxel>,
    /// Voxels of ways on which the sensor refused to go: each refused step's, without those where the robot has been.
    barred: BTreeSet<Voxel>,
    /// Those that came to them when the last plan was made.
    newly_barred: Vec<Voxel>,
    /// What has come to trail, targets, hidden and barred since they were said whole; `None`: they have to be, something was forgotten.
    since: Option<Since>,
    /// How things stood when they last changed, and the revision then.
    standing: Standing,
    progress_at: u64,
    refused: u64,
    /// Rays of all scans that had gone without a return when the last plan was made.
    no_return: u64,
}

/// What is other than in the past that was said last.
#[derive(Debug, Default)]
struct Since {
    trail: Vec<Voxel>,
    targets: BTreeSet<Voxel>,
    hidden: Vec<Voxel>,
    barred: Vec<Voxel>,
    /// Entries of that past.
    said: usize,
}

impl Since {
    /// Whether to say all anew costs less than to go on: with each plan this is said again, and the past only with some of them.
    /// What is said with a plan then grows with the square root of what is known.
    fn is_long(&self) -> bool {
        let entries = self.trail.len() + self.targets.len() + self.hidden.len() + self.barred.len();
        entries * entries > PLAN_ENTRIES * (self.said + PLAN_ENTRIES)
    }
}

/// So many entries come with a plan, about.
const PLAN_ENTRIES: usize = 16;

impl Memory {
    /// What a predecessor left, and the past that it went on from.
    pub fn recall(left: &ExplorerMemory, past: &ExplorerPast) -> Self {
        let nothing = ExplorerPast::default();
        let past = if left.goes_on { past } else { &nothing };
        let records = || past.targets.iter().chain(&left.lists.targets);
        let path = match &left.plan.decision {
            Decision::Go(path) => Some(path.clone()),
            Decision::Done => None,
        };
        Self {
            path,
            targets: records().map(|record| (record.target, record.clone())).collect(),
            remembered: records().map(|record| record.target).collect(),
            learned: BTreeSet::new(),
            trail: past.trail.iter().chain(&left.lists.trail).copied().collect(),
            trail_turned: Vec::new(),
            hidden: past.hidden.iter().chain(&left.lists.hidden).copied().collect(),
            barred: past.barred.iter().chain(&left.lists.barred).copied().collect(),
            newly_barred: Vec::new(),
            since: None,
            standing: left.standing,
            progress_at: left.progress_at,
            refused: left.refused,
            no_return: left.no_return,
        }
    }

    /// Leaves it to a successor; the path is in the plan there.
    pub fn leave(&self, to: &mut ExplorerMemory) {
        to.goes_on = self.since.is_some();
        to.lists = match &self.since {
            None => self.whole(),
            Some(since) => ExplorerPast {
                trail: since.trail.clone(),
                targets: since.targets.iter().filter_map(|target| self.targets.get(target)).cloned().collect(),
                hidden: since.hidden.clone(),
                barred: since.barred.clone(),
            },
        };
        to.standing = self.standing;
        to.progress_at = self.progress_at;
        to.refused = self.refused;
        to.no_return = self.no_return;
    }

    fn whole(&self) -> ExplorerPast {
        ExplorerPast {
            trail: self.trail.iter().copied().collect(),
            targets: self.targets.values().cloned().collect(),
            hidden: self.hidden.iter().copied().collect(),
            barred: self.barred.iter().copied().collect(),
        }
    }

    /// What was left to a successor, as something that memories go on from from now on; `None`: they still go on from the last.
    pub fn take_past(&mut self) -> Option<ExplorerPast> {
        if self.since.as_ref().is_some_and(|since| !since.is_long()) {
            return None;
        }
        let past = self.whole();
        let said = past.entries();
        self.since = Some(Since { said, ..Since::default() });
        Some(past)
    }

    fn record(&mut self, target: Voxel) -> &mut TargetRecord {
        if let Some(since) = &mut self.since {
            since.targets.insert(target);
        }
        self.learned.insert(target);
        self.remembered.insert(target);
        let new = || TargetRecord { target, tried: Vec::new(), cuts: 0, planned: 0, no_return: false };
        self.targets.entry(target).or_insert_with(new)
    }

    /// Takes note of how the last path went, on which there was a scan every `step_m` (m); of the rays of all scans so far,
    /// `no_return` went without a return.
    pub fn learn(&mut self, request: &PlanRequest, known: Known, step_m: f64, no_return: u64) {
        let Known { grid, frontier, .. } = known;
        let resolution = grid.resolution();
        let robot = Voxel::containing(request.pose.position(), resolution);
        // A predecessor's may be anything; nobody has followed one that is no path of this map.
        let followed = self.path.take().filter(|path| path_in(grid, &path.points, 0.0).is_ok());
        if let Some(path) = &followed {
            // What cuts a path is seen on the way. Where it began the map was the plan's, and free.
            let begun = path.points.first() != Some(&request.pose.position());
            let refused = request.outcome == Outcome::Refused || (request.outcome == Outcome::Cut && !begun);
            self.refused = (self.refused + u64::from(refused)).min(MAX_COUNT);
            if path.again || frontier.contains(path.target) {
                self.judge(path, request.outcome, robot, resolution);
            }
        }
        let in_vain = request.outcome == Outcome::Unresolved && no_return > self.no_return;
        if let Some(path) = followed.as_ref().filter(|path| in_vain && !path.again) {
            self.judge_view(&path.looks, request.pose.position(), known);
        }
        self.no_return = no_return;
        self.newly_barred.clear();
        if let Some(path) = followed.as_ref().filter(|_| request.outcome == Outcome::Refused) {
            self.bar(path, request.pose.position(), (step_m, resolution));
        }
        self.extend_trail(followed.as_ref(), robot, resolution);
        self.forget(robot, frontier);
        let now = Standing {
            free: grid.free() as u64,
            occupied: grid.occupied() as u64,
            frontier: frontier.len() as u64,
            attempts: self.targets.values().map(|record| record.tried.len() as u64).sum(),
        };
        if now != self.standing {
            self.standing = now;
            self.progress_at = request.revision;
        }
        self.progress_at = self.progress_at.min(request.revision);
    }

    /// Makes room for one more target, so that a successor believes them all: what is no frontier any more goes first, then
    /// what is farthest from the robot.
    fn forget(&mut self, robot: Voxel, frontier: &FrontierSet) {
        if self.targets.len() >= MAX_REMEMBERED {
            self.targets.retain(|target, _| frontier.contains(*target));
        }
        if self.targets.len() >= MAX_REMEMBERED {
            let (kept, _) = nearest(self.targets.keys().copied().collect(), robot, MAX_REMEMBERED - 1);
            self.learned.extend(self.targets.keys().filter(|target| kept.binary_search(target).is_err()));
            self.targets.retain(|target, _| kept.binary_search(target).is_ok());
        }
        if self.targets.len() < self.remembered.len() {
            self.since = None;
            self.remembered = self.targets.keys().copied().collect();
        }
    }

    fn judge(&mut self, path: &Path, outcome: Outcome, robot: Voxel, resolution: f64) {
        let end = path.points.last().copied();
        let record = self.record(path.target);
        match outcome {
            Outcome::Unresolved if path.again && !is_untried(&record.tried, robot) => {}
            Outcome::Unresolved => tried_from(record, robot),
            Outcome::Cut | Outcome::Refused => {
                record.cuts += 1;
                if record.cuts >= CUTS {
                    record.cuts = 0;
                    tried_from(record, end.map_or(robot, |p| Voxel::containing(p, resolution)));
                }
            }
            Outcome::First | Outcome::Resolved => {}
        }
    }

    /// Looks from `from` (m, world) found nothing where rays went without a return: what was in view of them was looked at in
    /// vain, too. Under an open sky each voxel below it would be looked at for itself, thousands of them.
    fn judge_view(&mut self, looks: &[Pose], from: Point3<f64>, known: Known) {
        let Known { grid, sight, .. } = known;
        let resolution = grid.resolution();
        let robot = Voxel::containing(from, resolution);
        // A ray without a return has passed all that is unknown on its way: it is no cover.
        let passed = |voxel: Voxel| grid.state(voxel) != State::Occupied;
        let in_view = |unknown: Voxel| {
            let toward = (unknown.center(resolution) - from).try_normalize(1e-9);
            let in_cone = |look: &Pose| toward.is_some_and(|toward| sight.covers(&look.forward(), &toward));
            looks.iter().any(in_cone) && in_sight(resolution, passed, from, unknown)
        };
        let seen = |voxel: &Voxel| known.unknown_beside(*voxel).any(in_view);
        for voxel in known.frontier_near(from, LOOK_RANGE_M.min(sight.range_m)).filter(seen) {
            let record = self.record(voxel);
            record.no_return = true;
            if is_untried(&record.tried, robot) {
                tried_from(record, robot);
            }
        }
    }

    /// The sensor refused to go on along `path` from `from` (m, world), a step of `step_m` (m) or what is left: what is in the way is
    /// somewhere on it, other than where the robot has been, and no plan leads through there any more.
    fn bar(&mut self, path: &Path, from: Point3<f64>, (step_m, resolution): (f64, f64)) {
        let Some(way) = Polyline::new(path.points.iter().copied()) else {
            return;
        };
        let robot = Voxel::containing(from, resolution);
        let begun = way.nearest(from);
        let step = way.part(begun, (begun + step_m).min(way.length()));
        let entered = step.windows(2).flat_map(|p| Traversal::new(p[0], p[1], resolution)).filter(|v| *v != robot);
        let entered: BTreeSet<Voxel> = entered.filter(|voxel| voxel.is_mappable()).collect();
        let new: BTreeSet<Voxel> = entered.difference(&self.trail).copied().collect();
        let new = if new.is_empty() { entered } else { new };
        let room = MAX_REMEMBERED - self.barred.len().min(MAX_REMEMBERED);
        let come = new.into_iter().filter(|voxel| !self.barred.contains(voxel)).take(room);
        self.newly_barred = come.collect();
        self.barred.extend(&self.newly_barred);
        self.since.iter_mut().for_each(|since| since.barred.extend(&self.newly_barred));
    }

    /// The robot went along `path`, if there was one, until it was in `robot`. Where the map has no voxels it leaves no trail.
    fn extend_trail(&mut self, path: Option<&Path>, robot: Voxel, resolution: f64) {
        let corners = path.map_or(&[][..], |path| &path.points);
        let way = corners.windows(2).flat_map(|p| Traversal::new(p[0], p[1], resolution));
        let mut gone: Vec<Voxel> = way.collect();
        let arrived = gone.iter().rposition(|v| *v == robot);
        gone.truncate(arrived.map_or(0, |n| n + 1));
        gone.push(robot);
        let come = gone.into_iter().filter(|voxel| voxel.is_mappable() && self.trail.insert(*voxel));
        self.trail_turned = come.map(|voxel| (voxel, true)).collect();
        let come = self.trail_turned.iter().map(|(voxel, _)| *voxel);
        self.since.iter_mut().for_each(|since| since.trail.extend(come.clone()));
        if self.trail.len() > MAX_REMEMBERED {
            self.forget_trail(robot);
        }
    }

    /// Leaves out what of the trail is farthest away, an eighth of it, so that there is room for a while.
    fn forget_trail(&mut self, robot: Voxel) {
        let (kept, _) = nearest(self.trail.iter().copied().collect(), robot, MAX_REMEMBERED / 8 * 7);
        let before = std::mem::replace(&mut self.trail, kept.into_iter().collect());
        self.trail_turned.extend(before.difference(&self.trail).map(|voxel| (*voxel, false)));
        self.since = None;
    }

    /// No new place sees these targets in the map as it is. What is too much for a successor to be told is looked for again:
    /// first what is no frontier any more, then what was hidden before.
    pub fn hide(&mut self, targets: impl Iterator<Item = Voxel> + Clone, frontier: &FrontierSet) {
        let come: Vec<Voxel> = targets.clone().filter(|target| self.hidden.insert(*target)).collect();
        self.since.iter_mut().for_each(|since| since.hidden.extend(&come));
        if self.hidden.len() > MAX_REMEMBERED {
            self.hidden.retain(|target| frontier.contains(*target));
            self.since = None;
        }
        if self.hidden.len() > MAX_REMEMBERED {
            self.hidden = targets.take(MAX_REMEMBERED).collect();
        }
    }

    /// Whether no new place saw `target` when it was looked for.
    pub fn is_hidden(&self, target: Voxel) -> bool {
        self.hidden.contains(&target)
    }

    /// The last path, until something is learned of it.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_ref()
    }

    /// `target` is to be looked at, and was not yet.
    pub fn keep_in_mind(&mut self, target: Voxel) {
        self.record(target);
    }

    /// Whether anything is remembered of `target`.
    pub fn has_in_mind(&self, target: Voxel) -> bool {
        self.remembered.contains(target)
    }

    /// `target` was looked at from voxel `place`, too, in vain.
    pub fn look_in_vain(&mut self, target: Voxel, place: Voxel) {
        let record = self.record(target);
        if is_untried(&record.tried, place) {
            tried_from(record, place);
        }
    }

    /// Has the explorer's last decision.
    pub fn remember(&mut self, path: &Path) {
        let record = self.record(path.target);
        record.planned = (record.planned + 1).min(MAX_TRIES);
        self.path = Some(path.clone());
    }

    /// Takes the targets of which something was learned since it was last asked.
    pub fn take_learned(&mut self) -> BTreeSet<Voxel> {
        std::mem::take(&mut self.learned)
    }

    /// The voxels that the robot went through.
    pub fn trail(&self) -> &BTreeSet<Voxel> {
        &self.trail
    }

    /// The voxels that came to the trail when the last plan was made (`true`), or left it, in the order in which they did.
    pub fn trail_turned(&self) -> impl Iterator<Item = (Voxel, bool)> + '_ {
        self.trail_turned.iter().copied()
    }

    /// Voxels of ways on which the sensor refused to go.
    pub fn barred(&self) -> &BTreeSet<Voxel> {
        &self.barred
    }

    /// Those of them that came when the last plan was made.
    pub fn newly_barred(&self) -> &[Voxel] {
        &self.newly_barred
    }

    /// The targets of a brick (in bricks) of which anything is remembered.
    pub fn remembered(&self, brick: Voxel) -> &Mask {
        self.remembered.brick(brick)
    }

    /// The voxels from which `target` was looked at in vain.
    pub fn tried(&self, target: Voxel) -> &[Voxel] {
        let record = self.remembered.contains(target).then(|| self.targets.get(&target)).flatten();
        record.map_or(&[], |record| &record.tried)
    }

    /// Whether `target` was looked at in vain from `attempts` places, fewer where nothing is to be seen, or came back each time that it was resolved.
    pub fn gave_up(&self, target: Voxel, attempts: usize) -> bool {
        self.targets.get(&target).is_some_and(|record| {
            let attempts = if record.no_return { attempts.min(SILENT_ATTEMPTS) } else { attempts };
            record.tried.len() >= attempts || u64::from(record.planned) >= RETURNS * attempts as u64
        })
    }

    /// Whether rays went without a return when `target` was looked at in vain.
    pub fn saw_nothing(&self, target: Voxel) -> bool {
        self.targets.get(&target).is_some_and(|record| record.no_return)
    }

    /// Steps that the sensor refused, and paths that were cut before the first step.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Scans since anything was learned.
    pub fn scans_without_progress(&self, revision: u64) -> u64 {
        revision.saturating_sub(self.progress_at)
    }
}

/// A target was looked at in vain from one more place, as far as a successor believes it.
fn tried_from(record: &mut TargetRecord, place: Voxel) {
    if record.tried.len() < MAX_CORNERS {
        record.tried.push(place);
    }
}

#[cfg(test)]
mod tests {
    use elk_geometry::{OccupancyGrid, State};
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    /// A metre along x.
    fn straight(from: Voxel) -> Path {
        let from_m = from.center(0.1);
        Path { points: vec![from_m, from_m + Vector3::x()], target: from, unknown: vec![], looks: vec![], again: false }
    }

    #[test]
    fn of_a_refused_step_what_the_robot_was_not_in_is_barred() {
        let at = |x: i32| Voxel::new(x, 0, 0);
        let mut memory = Memory::default();
        memory.extend_trail(Some(&straight(at(0))), at(4), 0.1);
        memory.bar(&straight(at(2)), at(3).center(0.1), (0.4, 0.1));
        assert_eq!(memory.barred().iter().copied().collect::<Vec<_>>(), [at(5), at(6), at(7)]);
        // Where it has been all the way it is somewhere all the same.
        memory.bar(&straight(at(0)), at(0).center(0.1), (0.2, 0.1));
        assert_eq!(memory.newly_barred(), [at(1), at(2)]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// Whether it dies before it has said what the next memories go on from, or after, a successor has all that it had; and what
        /// is said with a plan does not grow with it.
        #[test]
        fn a_successor_has_what_was_said_in_parts(
            learned in prop::collection::vec((0..40u8, prop::array::uniform3(-9..9i32)), 1..400),
        ) {
            let path = Path { points: vec![], target: Voxel::new(0, 0, 0), unknown: vec![], looks: vec![], again: false };
            let mut left = super::super::tests::fullest_memory(path);
            let (frontier, mut memory, mut past) = (FrontierSet::new(None), Memory::default(), ExplorerPast::default());
            for (what, voxel) in learned {
                let voxel = Voxel::from(voxel);
                match what {
                    0 => memory.forget_trail(voxel),
                    1..15 => memory.extend_trail(None, voxel, 0.1),
                    15..30 => memory.record(voxel).cuts += 1,
                    30..33 => memory.bar(&straight(voxel), voxel.center(0.1), (0.3, 0.1)),
                    _ => memory.hide([voxel].into_iter(), &frontier),
                }
                memory.leave(&mut left);
                prop_assert_eq!(Memory::recall(&left, &past).whole(), memory.whole());
                past = memory.take_past().unwrap_or(past);
                prop_assert_eq!(Memory::recall(&left, &past).whole(), memory.whole());
                let [said, all] = [&left.lists, &past].map(ExplorerPast::entries);
                let most = ((PLAN_ENTRIES * (all + PLAN_ENTRIES)) as f64).sqrt() as usize + 1;
                prop_assert!(!left.goes_on || said <= most, "{said} entries where {all} were said");
            }
        }
    }

    /// Regression: more was left to a successor than it believes, so it was refused all of it.
    #[test]
    fn no_more_is_hidden_than_a_successor_is_told() {
        let mut grid = OccupancyGrid::new(0.1);
        let floor: Vec<Voxel> = (0..400).flat_map(|x| (0..400).map(move |y| Voxel::new(x, y, 0))).collect();
        floor.iter().for_each(|voxel| assert!(grid.set(*voxel, State::Free)));
        let mut frontier = FrontierSet::new(None);
        frontier.update(&grid, &floor);
        let gone = (0..1000).map(|x| Voxel::new(x, 0, 9));
        let (first, second) = (&floor[..MAX_REMEMBERED - 500], &floor[MAX_REMEMBERED - 500..]);
        let mut memory = Memory::default();
        memory.hide(gone.clone(), &frontier);
        memory.hide(first.iter().copied(), &frontier);
        assert!(memory.is_hidden(first[0]) && !gone.clone().any(|voxel| memory.is_hidden(voxel)));
        memory.hide(second.iter().copied(), &frontier);
        assert!(second.iter().all(|voxel| memory.is_hidden(*voxel)) && !memory.is_hidden(first[0]));
    }
}
