//! What is to be resolved, and from where: each frontier voxel's standing and its goal near by, kept from plan to plan and looked
//! at again where something has changed.

use std::collections::{BTreeMap, BTreeSet};

use elk_geometry::bricks::voxel_at;
use elk_geometry::{Clusters, Voxel, VoxelSet, mask};
use elk_spatial::messages::FrontiersLeft;

use super::memory::Memory;
use super::settings::Settings;
use crate::goals::{Goals, NearGoals};
use crate::space::Space;
use crate::target::{Known, Target};
use crate::verdicts::Verdicts;

/// How a frontier voxel stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Standing {
    /// The robot cannot get to it.
    Unreachable,
    /// It is one of too few.
    TooSmall,
    /// It was looked at in vain.
    GivenUp,
    /// The same where rays went without a return.
    Silent,
    /// It is a target.
    Open,
}

/// The frontier as one plan sees it; the next plan's is made of it.
#[derive(Debug, Default)]
pub struct Agenda {
    standings: BTreeMap<Voxel, Standing>,
    /// The voxels that have one.
    voxels: VoxelSet,
    /// Those of them that the robot can get to, in clusters, if small ones are left alone.
    clusters: Clusters,
    /// How many stand so, in the order of [`Standing`].
    counts: [u64; 5],
    goals: Goals,
    /// How far the camera sees that the goals are for (m).
    range_m: Option<f64>,
}

impl Agenda {
    /// Takes note that something has changed in these bricks, or was learned of these targets.
    pub fn follow(
        &mut self,
        (known, space): (Known, &Space),
        bricks: &BTreeSet<Voxel>,
        targets: impl IntoIterator<Item = Voxel>,
        (memory, settings): (&Memory, &Settings),
        verdicts: &mut Verdicts,
    ) {
        let anew = self.range_m != Some(known.sight.range_m);
        if anew {
            *self = Self { range_m: Some(known.sight.range_m), ..Self::default() };
        }
        let mut stale: BTreeSet<Voxel> = match anew {
            true => known.frontier.iter().collect(),
            false => targets.into_iter().chain(self.in_bricks_near(known, bricks)).collect(),
        };
        if settings.min_frontier > 1 {
            let is_reached = |voxel| known.frontier.contains(voxel) && space.component.contains(voxel);
            self.clusters.update(stale.iter().copied(), is_reached);
            // How large a cluster is may have changed with a voxel far away.
            stale.extend(known.frontier.iter());
        }
        let near = NearGoals::new(space, known.sight.range_m);
        for voxel in stale.into_iter().take_while(|_| !(settings.is_to_stop)()) {
            let now = known.frontier.contains(voxel).then(|| match () {
                () if !space.component.contains(voxel) => Standing::Unreachable,
                () if self.clusters.of(voxel).is_some_and(|cluster| cluster.size() < settings.min_frontier) => {
                    Standing::TooSmall
                }
                () if !memory.gave_up(voxel, settings.attempts) => Standing::Open,
                () if memory.saw_nothing(voxel) => Standing::Silent,
                () => Standing::GivenUp,
            });
            self.set(voxel, now);
            let target = (now == Some(Standing::Open)).then(|| target(known, voxel, memory));
            match target.and_then(|target| near.of(target, verdicts)) {
                Some(goal) => self.goals.set(voxel, goal),
                None => self.goals.remove(voxel),
            }
            if now.is_none() {
                verdicts.forget(voxel);
            }
        }
    }

    /// What is, or was, frontier in these bricks and those beside them.
    fn in_bricks_near(&self, known: Known, bricks: &BTreeSet<Voxel>) -> impl Iterator<Item = Voxel> {
        let near: BTreeSet<Voxel> = bricks.iter().flat_map(|brick| brick.neighbours().chain([*brick])).collect();
        let cells = |brick: Voxel| mask::or(known.frontier.brick(brick), self.voxels.brick(brick));
        let cells = near.into_iter().map(move |brick| (brick, cells(brick))).filter(|(_, cells)| *cells != mask::NONE);
        let voxels = |(brick, cells)| mask::cells(&cells).map(|cell| voxel_at(brick, cell)).collect::<Vec<_>>();
        cells.flat_map(voxels)
    }

    fn set(&mut self, voxel: Voxel, now: Option<Standing>) {
        let before = match now {
            Some(now) => self.standings.insert(voxel, now),
            None => self.standings.remove(&voxel),
        };
        if before.is_some() != now.is_some() {
            let _ = if now.is_some() { self.voxels.insert(voxel) } else { self.voxels.remove(voxel) };
        }
        before.iter().for_each(|before| self.counts[*before as usize] -= 1);
        now.iter().for_each(|now| self.counts[*now as usize] += 1);
    }

    /// The goals near the frontier.
    pub fn goals(&self) -> &Goals {
        &self.goals
    }

    /// All targets, in order.
    pub fn targets(&self, known: Known, memory: &Memory) -> Vec<Target> {
        let open = self.standings.iter().filter(|(_, standing)| **standing == Standing::Open);
        open.map(|(voxel, _)| target(known, *voxel, memory)).collect()
    }

    /// Frontier voxels, by cause, with the targets as what is open.
    pub fn left(&self) -> FrontiersLeft {
        let [unreachable, too_small, unresolved, no_return, open] = self.counts;
        FrontiersLeft { unreachable, too_small, unresolved, no_return, open, ..FrontiersLeft::default() }
    }
}

fn target(known: Known, voxel: Voxel, memory: &Memory) -> Target {
    Target::new(known, voxel, memory.tried(voxel).to_vec())
}
