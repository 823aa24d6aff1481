//! The map as one plan sees it: where the robot can be, what is to be resolved, and what is not, by cause.

use std::collections::BTreeSet;

use elk_geometry::Voxel;
use elk_geometry::bricks::brick_of;
use elk_spatial::messages::FrontiersLeft;
use nalgebra::Point3;

use super::memory::Memory;
use super::nearest::nearest;
use super::settings::Settings;
use crate::extent::{Extent, Scope};
use crate::space::Space;
use crate::target::{Known, Target};
use crate::verdicts::Verdicts;
use elk_geometry::Volume;

/// The scene of one plan; the next plan's is made of it.
pub struct Scene {
    extent: Extent,
    pub volume: Volume,
    pub space: Space,
    pub verdicts: Verdicts,
    pub targets: Vec<Target>,
    /// Frontier voxels that are no targets, by cause.
    pub left: FrontiersLeft,
    /// Frontier voxels that the robot could get to and that no plan was made over.
    pub beyond: u64,
    /// Bricks in which the robot can get to other voxels than the strategy has seen; `None`: it has not seen this volume.
    pub unseen: Option<BTreeSet<Voxel>>,
}

impl Scene {
    /// What is around a robot at `position` (m, world), made of the scene `before` if there was one: since then the map has
    /// changed in the bricks `changed`, and nowhere else.
    pub fn around(
        known: Known,
        position: Point3<f64>,
        (before, changed): (Option<Self>, &BTreeSet<Voxel>),
        memory: &Memory,
        settings: &Settings,
    ) -> Self {
        let grid = known.grid;
        let robot = Voxel::containing(position, grid.resolution());
        let margin = settings.clearance.reach().max(2);
        let extent = Extent::of(grid, robot, margin, settings.max_voxels);
        let mut scene = match before.filter(|scene| scene.extent.is_box_of(&extent)) {
            Some(scene) => Self { extent, ..scene }.follow(known, robot, changed, memory),
            None => Self::anew(extent, known, robot, memory, settings),
        };
        scene.sort_out(known, memory, settings);
        scene
    }

    fn anew(extent: Extent, known: Known, robot: Voxel, memory: &Memory, settings: &Settings) -> Self {
        let margin = settings.clearance.reach().max(2);
        let volume = Volume::between(known.grid, (extent.min, extent.max), margin);
        let robot = volume.index(robot).unwrap_or_default();
        let space = Space::around(&volume, robot, &settings.clearance, memory.trail());
        let verdicts = Verdicts::new(&volume);
        let (targets, left) = (Vec::new(), FrontiersLeft::default());
        Self { extent, volume, space, verdicts, targets, left, beyond: 0, unseen: None }
    }

    fn follow(mut self, known: Known, robot: Voxel, changed: &BTreeSet<Voxel>, memory: &Memory) -> Self {
        let mut turned = Vec::new();
        changed.iter().for_each(|brick| self.volume.follow(known.grid, *brick, |i| turned.push(i)));
        let robot = self.volume.index(robot).unwrap_or_default();
        let mut reached = Vec::new();
        self.space.follow(&self.volume, robot, &turned, memory.trail(), &mut |i| reached.push(i));
        self.hear_of_reach(&reached);
        self.verdicts.hear_of(&self.volume, turned.into_iter().chain(reached));
        self
    }

    /// Takes note that the robot can get to these voxels now, or no longer.
    fn hear_of_reach(&mut self, changed: &[usize]) {
        if let Some(unseen) = &mut self.unseen {
            unseen.extend(changed.iter().map(|i| brick_of(self.volume.voxel(*i))));
        }
    }

    /// The same for a robot that first gets out of the corner that it stands in; answers whether it stands in one.
    pub fn back_off(&mut self, known: Known, memory: &Memory, settings: &Settings) -> bool {
        let mut changed = Vec::new();
        let moved = self.space.back_off(&self.volume, &mut |i| changed.push(i));
        if moved {
            self.hear_of_reach(&changed);
            self.verdicts.hear_of(&self.volume, changed);
            self.sort_out(known, memory, settings);
        }
        moved
    }

    /// The robot's own voxel.
    pub fn robot(&self) -> Voxel {
        self.volume.voxel(self.space.component.start())
    }

    /// What of the map it is made over.
    pub fn scope(&self) -> Scope {
        self.extent.scope
    }

    /// Sorts the frontier into targets and what is left out, by cause.
    fn sort_out(&mut self, known: Known, memory: &Memory, settings: &Settings) {
        let reached = |v: &Voxel| self.volume.index(*v).is_some_and(|i| self.space.component.contains(i));
        let (connected, apart): (Vec<Voxel>, Vec<Voxel>) = known.frontier.iter().partition(reached);
        let beyond = apart.iter().filter(|v| self.extent.leaves_out(**v)).count();
        let (large, small) = by_cluster_size(connected, settings.min_frontier);
        // Before the nearest are taken: those would hide the others behind them for good.
        let (given_up, open): (Vec<Voxel>, Vec<Voxel>) =
            large.into_iter().partition(|voxel| memory.gave_up(*voxel, settings.attempts));
        let (silent, given_up): (Vec<Voxel>, Vec<Voxel>) =
            given_up.into_iter().partition(|voxel| memory.saw_nothing(*voxel));
        let (near, far) = nearest(open, self.volume.voxel(self.space.start()), settings.max_targets);
        let target = |voxel| Target::new(known, voxel, memory.tried(voxel).to_vec());
        self.targets = near.into_iter().map(target).collect();
        self.verdicts.forget_all_but(&self.targets);
        self.beyond = (beyond + far) as u64;
        self.left = FrontiersLeft {
            unreachable: (apart.len() - beyond) as u64,
            unresolved: given_up.len() as u64,
            no_return: silent.len() as u64,
            too_small: small as u64,
            ..FrontiersLeft::default()
        };
    }
}

/// The voxels in clusters (connected over 26 neighbours) of at least `min`, in order, and the number of the others.
fn by_cluster_size(voxels: Vec<Voxel>, min: usize) -> (Vec<Voxel>, usize) {
    if min <= 1 {
        return (voxels, 0);
    }
    let mut open: BTreeSet<Voxel> = voxels.iter().copied().collect();
    let (mut large, mut small) = (Vec::new(), 0);
    while let Some(first) = open.pop_first() {
        let mut cluster = vec![first];
        let mut next = 0;
        while next < cluster.len() {
            for n in cluster[next].neighbours() {
                if open.remove(&n) {
                    cluster.push(n);
                }
            }
            next += 1;
        }
        if cluster.len() >= min {
            large.extend(cluster);
        } else {
            small += cluster.len();
        }
    }
    large.sort_unstable();
    (large, small)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cluster_hangs_together_over_corners() {
        let all = [[0, 0, 0], [1, 1, 1], [9, 9, 9]].map(Voxel::from).to_vec();
        assert_eq!(by_cluster_size(all.clone(), 1), (all.clone(), 0));
        assert_eq!(by_cluster_size(all.clone(), 2), (all[..2].to_vec(), 1));
        assert_eq!(by_cluster_size(all, 3), (vec![], 3));
    }
}
