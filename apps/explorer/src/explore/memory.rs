//! What an explorer remembers from plan to plan.

use std::collections::{BTreeMap, BTreeSet};

use elk_spatial::messages::{Outcome, Path, PlanRequest};
use elk_spatial::ray::Traversal;
use elk_spatial::{FrontierSet, OccupancyGrid, Voxel};

/// Paths to a target that may be cut in a row before that counts as an attempt in vain.
const CUTS: u32 = 3;

/// Plans for a target, for each place that it may be looked at from, after which it is given up: a voxel that flickers
/// between free and occupied is never looked at in vain, and never done.
const RETURNS: usize = 3;

/// Where the robot has been, and what it looked at in vain.
#[derive(Debug, Default)]
pub struct Memory {
    /// The last path, and the position that it was to end in.
    path: Option<Path>,
    tried: BTreeMap<Voxel, Vec<Voxel>>,
    cuts: BTreeMap<Voxel, u32>,
    trail: Vec<Voxel>,
    hidden: BTreeSet<Voxel>,
    /// How often each target was planned for.
    planned: BTreeMap<Voxel, usize>,
    /// How things stood when they last changed, and the revision then.
    standing: Standing,
    progress_at: u64,
}

/// What changes as long as there is progress. A voxel that flickers changes it too, but is given up in time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Standing {
    free: usize,
    occupied: usize,
    frontier: usize,
    attempts: usize,
}

impl Memory {
    /// Takes note of how the last path went.
    pub fn learn(&mut self, request: &PlanRequest, grid: &OccupancyGrid, frontier: &FrontierSet) {
        let resolution = grid.resolution();
        let robot = Voxel::containing(request.pose.position(), resolution);
        self.trail.push(robot);
        if let Some(path) = self.path.take() {
            self.extend_trail(&path, robot, resolution);
            if frontier.contains(path.target) {
                self.judge(&path, request.outcome, robot, resolution);
            }
        }
        let now = Standing {
            free: grid.free(),
            occupied: grid.occupied(),
            frontier: frontier.len(),
            attempts: self.tried.values().map(Vec::len).sum(),
        };
        if now != self.standing {
            self.standing = now;
            self.progress_at = request.revision;
        }
    }

    fn judge(&mut self, path: &Path, outcome: Outcome, robot: Voxel, resolution: f64) {
        let end = path.points.last().copied();
        match outcome {
            Outcome::Unresolved => self.tried.entry(path.target).or_default().push(robot),
            Outcome::Cut => {
                let cuts = self.cuts.entry(path.target).or_default();
                *cuts += 1;
                if *cuts >= CUTS {
                    *cuts = 0;
                    let goal = end.map_or(robot, |p| Voxel::containing(p, resolution));
                    self.tried.entry(path.target).or_default().push(goal);
                }
            }
            Outcome::First | Outcome::Resolved => {}
        }
    }

    /// The robot went along `path` until it was in `robot`.
    fn extend_trail(&mut self, path: &Path, robot: Voxel, resolution: f64) {
        let pairs = path.points.windows(2);
        let way = pairs.flat_map(|p| Traversal::new(p[0], p[1], resolution));
        let mut gone: Vec<Voxel> = way.collect();
        let arrived = gone.iter().rposition(|v| *v == robot);
        gone.truncate(arrived.map_or(0, |n| n + 1));
        gone.push(robot);
        self.trail.extend(gone);
        self.trail.sort_unstable();
        self.trail.dedup();
    }

    /// No new place sees these targets in the map as it is.
    pub fn hide(&mut self, targets: impl Iterator<Item = Voxel>) {
        self.hidden.extend(targets);
    }

    /// Whether no new place saw `target` when it was looked for.
    pub fn is_hidden(&self, target: Voxel) -> bool {
        self.hidden.contains(&target)
    }

    /// Has the explorer's last decision.
    pub fn remember(&mut self, path: &Path) {
        *self.planned.entry(path.target).or_default() += 1;
        self.path = Some(path.clone());
    }

    /// The voxels that the robot went through.
    pub fn trail(&self) -> &[Voxel] {
        &self.trail
    }

    /// The voxels from which `target` was looked at in vain.
    pub fn tried(&self, target: Voxel) -> &[Voxel] {
        self.tried.get(&target).map_or(&[], Vec::as_slice)
    }

    /// Whether `target` was looked at in vain from `attempts` places, or came back each time that it was resolved.
    pub fn gave_up(&self, target: Voxel, attempts: usize) -> bool {
        let planned = self.planned.get(&target).copied().unwrap_or_default();
        self.tried(target).len() >= attempts || planned >= RETURNS * attempts
    }

    /// Scans since anything was learned.
    pub fn scans_without_progress(&self, revision: u64) -> u64 {
        revision.saturating_sub(self.progress_at)
    }
}
