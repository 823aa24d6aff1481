//! What is to be resolved, and from where: how the frontier stands, brick by brick, and the goal near each target, kept from plan
//! to plan and looked at again where something has changed.

use std::collections::{BTreeMap, HashMap};
use std::hash::BuildHasherDefault;

use elk_geometry::bricks::{BrickHasher, brick_of, cell_of, voxel_at};
use elk_geometry::mask::{self, Mask};
use elk_geometry::{Clusters, Voxel, VoxelSet};
use elk_spatial::messages::FrontiersLeft;

use super::memory::Memory;
use super::settings::Settings;
use crate::goals::{Goals, NearGoals, reach_of_goals};
use crate::space::Space;
use crate::target::{Known, Target};
use crate::verdicts::Verdicts;

/// How the frontier voxels of a brick stand.
#[derive(Debug, Clone, Copy, Default)]
struct Standing {
    all: Mask,
    /// Those that are targets.
    open: Mask,
    /// How many there are, by cause.
    left: FrontiersLeft,
}

/// The frontier as one plan sees it; the next plan's is made of it.
#[derive(Debug, Default)]
pub struct Agenda {
    /// By brick, where there is any. Never gone through in its order.
    standings: HashMap<Voxel, Standing, BuildHasherDefault<BrickHasher>>,
    /// Those that the robot can get to, in clusters, if small ones are left alone.
    clusters: Clusters,
    left: FrontiersLeft,
    goals: Goals,
    /// How far the camera sees that the goals are for (m).
    range_m: Option<f64>,
}

impl Agenda {
    /// Takes note that something has changed in the voxels `changed`, or was learned of these targets.
    pub fn follow(
        &mut self,
        (known, space): (Known, &Space),
        changed: &VoxelSet,
        targets: impl IntoIterator<Item = Voxel>,
        (memory, settings): (&Memory, &Settings),
        verdicts: &mut Verdicts,
    ) {
        let anew = self.range_m != Some(known.sight.range_m);
        if anew {
            *self = Self { range_m: Some(known.sight.range_m), ..Self::default() };
        }
        let mut stale = match anew {
            true => known.frontier.bricks(),
            false => self.near(known, changed, reach_of_goals(space, known.sight.range_m)),
        };
        for target in targets {
            mask::set(stale.entry(brick_of(target)).or_insert(mask::NONE), cell_of(target));
        }
        if settings.min_frontier > 1 {
            let is_reached = |voxel| known.frontier.contains(voxel) && space.component.contains(voxel);
            let stale_voxels = stale.iter().flat_map(|(brick, cells)| voxels_of(*brick, *cells));
            let turned = self.clusters.update(stale_voxels, is_reached);
            // Who is in a small cluster now, or was, and in a large one before, or now, is at most its size from what has turned.
            for voxel in self.clusters.within(turned, settings.min_frontier - 1) {
                stale.entry(brick_of(voxel)).or_insert(mask::NONE);
            }
        }
        let mut near = NearGoals::new(space, known.sight.range_m);
        for (brick, cells) in stale.iter().take_while(|_| !(settings.is_to_stop)()) {
            let now = self.sort_out(*brick, (known, space), memory, settings);
            let before = self.stand(*brick, now);
            for voxel in voxels_of(*brick, mask::without(&before, &now.open)) {
                self.goals.remove(voxel);
                verdicts.forget(voxel);
            }
            let anew = mask::or(cells, &mask::without(&now.open, &before));
            for voxel in voxels_of(*brick, mask::and(&now.open, &anew)) {
                match near.of(target(known, voxel, memory)) {
                    Some(goal) => self.goals.set(goal),
                    None => self.goals.remove(voxel),
                }
            }
        }
    }

    /// How the frontier of a brick stood when it was last looked at.
    fn standing(&self, brick: Voxel) -> Standing {
        self.standings.get(&brick).copied().unwrap_or_default()
    }

    /// It stands so now; answers what was a target before.
    fn stand(&mut self, brick: Voxel, now: Standing) -> Mask {
        let before = match now.all == mask::NONE {
            true => self.standings.remove(&brick),
            false => self.standings.insert(brick, now),
        };
        let before = before.unwrap_or_default();
        let counts =
            |left: &FrontiersLeft| [left.unreachable, left.too_small, left.unresolved, left.no_return, left.open];
        let [all, now, gone] = [&self.left, &now.left, &before.left].map(counts);
        let [unreachable, too_small, unresolved, no_return, open] = std::array::from_fn(|n| all[n] + now[n] - gone[n]);
        self.left = FrontiersLeft { unreachable, too_small, unresolved, no_return, open, ..self.left };
        before.open
    }

    /// What is frontier, or was, at most so many voxels along each axis from what has changed: from the box around that, brick by
    /// brick.
    fn near(&self, known: Known, changed: &VoxelSet, reach: i32) -> BTreeMap<Voxel, Mask> {
        let around = Voxel::new(reach, reach, reach);
        let boxes = changed.bricks().filter_map(|(brick, cells)| mask::corners(brick, cells));
        let mut near = BTreeMap::new();
        for [min, max] in boxes.map(|[min, max]| [min - around, max + around]) {
            let [low, high] = [brick_of(min), brick_of(max)];
            let rows = (low.x..=high.x).flat_map(|x| (low.y..=high.y).map(move |y| (x, y)));
            for brick in rows.flat_map(|(x, y)| (low.z..=high.z).map(move |z| Voxel::new(x, y, z))) {
                let own = mask::or(known.frontier.brick(brick), &self.standing(brick).all);
                if own != mask::NONE {
                    let cells = near.entry(brick).or_insert(mask::NONE);
                    *cells = mask::or(cells, &mask::and(&own, &mask::within(brick, [min, max])));
                }
            }
        }
        near
    }

    /// How the frontier of a brick stands.
    fn sort_out(
        &self,
        brick: Voxel,
        (known, space): (Known, &Space),
        memory: &Memory,
        settings: &Settings,
    ) -> Standing {
        let all = mask::and(known.frontier.brick(brick), &space.layer(brick));
        let (mut open, mut left) = (mask::and(&all, space.component.brick(brick)), FrontiersLeft::default());
        left.unreachable = (mask::count(&all) - mask::count(&open)) as u64;
        if settings.min_frontier > 1 {
            let is_small = |voxel: &Voxel| self.clusters.of(*voxel).is_some_and(|c| c.size() < settings.min_frontier);
            for voxel in voxels_of(brick, open).filter(is_small) {
                mask::clear(&mut open, cell_of(voxel));
                left.too_small += 1;
            }
        }
        let remembered = voxels_of(brick, mask::and(&open, memory.remembered(brick)));
        for voxel in remembered.filter(|voxel| memory.gave_up(*voxel, settings.attempts)) {
            mask::clear(&mut open, cell_of(voxel));
            *if memory.saw_nothing(voxel) { &mut left.no_return } else { &mut left.unresolved } += 1;
        }
        left.open = mask::count(&open) as u64;
        Standing { all, open, left }
    }

    /// The goals near the frontier.
    pub fn goals(&self) -> &Goals {
        &self.goals
    }

    /// All targets, in order.
    pub fn targets(&self, known: Known, memory: &Memory) -> Vec<Target> {
        let open = self.standings.iter().flat_map(|(brick, standing)| voxels_of(*brick, standing.open));
        let mut open: Vec<Voxel> = open.collect();
        open.sort_unstable();
        open.into_iter().map(|voxel| target(known, voxel, memory)).collect()
    }

    /// Frontier voxels, by cause, with the targets as what is open.
    pub fn left(&self) -> FrontiersLeft {
        self.left
    }
}

fn voxels_of(brick: Voxel, cells: Mask) -> impl Iterator<Item = Voxel> {
    let cells = cells.into_iter().enumerate().flat_map(|(z, layer)| mask::bits(layer).map(move |bit| z << 6 | bit));
    cells.map(move |cell| voxel_at(brick, cell))
}

fn target(known: Known, voxel: Voxel, memory: &Memory) -> Target {
    Target::new(known, voxel, memory.tried(voxel).to_vec())
}
