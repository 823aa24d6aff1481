//! The map as one plan sees it: where the robot can be, what is to be resolved, and what is not, by cause.

use std::collections::BTreeSet;

use elk_geometry::{Voxel, VoxelSet};
use elk_spatial::messages::FrontiersLeft;
use nalgebra::Point3;

use super::agenda::Agenda;
use super::memory::Memory;
use super::settings::Settings;
use crate::space::Space;
use crate::target::Known;
use crate::verdicts::Verdicts;

/// The scene of one plan; the next plan's is made of it.
pub struct Scene {
    pub space: Space,
    pub verdicts: Verdicts,
    pub agenda: Agenda,
    /// Frontier voxels, by cause; what is open are targets.
    pub left: FrontiersLeft,
    /// Voxels of which something has changed that the agenda has not heard of.
    changed: VoxelSet,
    /// Bricks in which the robot can get to other voxels than the strategy has seen, and perhaps others; `None`: it has seen
    /// nothing of it.
    pub unseen: Option<BTreeSet<Voxel>>,
}

impl Scene {
    /// What is around a robot at `position` (m, world), made of the scene `before` if there was one: since then the map has
    /// changed in the voxels `changed`, and nowhere else.
    pub fn around(
        known: Known,
        position: Point3<f64>,
        (before, changed): (Option<Self>, VoxelSet),
        memory: &Memory,
        settings: &Settings,
    ) -> Self {
        let robot = Voxel::containing(position, known.grid.resolution());
        match before.filter(|scene| scene.space.is_level_with(robot)) {
            Some(scene) => scene.follow(known, robot, &changed, memory),
            None => Self::anew(known, robot, memory, settings),
        }
    }

    fn anew(known: Known, robot: Voxel, memory: &Memory, settings: &Settings) -> Self {
        let (grid, clearance, been) = (known.grid, &settings.clearance, (memory.trail(), memory.barred()));
        let space = match settings.planar {
            true => Space::in_layer(grid, robot, clearance, been),
            false => Space::around(grid, robot, clearance, been),
        };
        let (verdicts, agenda, changed) = (Verdicts::default(), Agenda::default(), VoxelSet::new());
        Self { space, verdicts, agenda, left: FrontiersLeft::default(), changed, unseen: None }
    }

    fn follow(mut self, known: Known, robot: Voxel, changed: &VoxelSet, memory: &Memory) -> Self {
        let bricks = changed.bricks().map(|(brick, _)| brick);
        let been = (memory.trail_turned(), memory.newly_barred());
        self.changed = self.space.follow(known.grid, robot, bricks, been);
        self.hear_of_space();
        // What was unknown and is occupied now is free neither way.
        changed.bricks().for_each(|(brick, cells)| self.changed.unite(brick, cells));
        self
    }

    /// The space has changed.
    fn hear_of_space(&mut self) {
        let bricks = || self.changed.bricks().map(|(brick, _)| brick);
        self.verdicts.hear_of(bricks());
        self.unseen.iter_mut().for_each(|unseen| unseen.extend(bricks()));
    }

    /// Sorts the frontier into targets and what is left out, by cause, and finds the goals near it; of the targets `learned`
    /// something was learned.
    pub fn sort_out(&mut self, known: Known, learned: BTreeSet<Voxel>, memory: &Memory, settings: &Settings) {
        let changed = std::mem::take(&mut self.changed);
        self.agenda.follow((known, &self.space), &changed, learned, (memory, settings), &mut self.verdicts);
        self.left = self.agenda.left();
    }

    /// The same for a robot that first gets out of the corner that it stands in; answers whether it stands in one.
    pub fn back_off(&mut self) -> bool {
        let changed = self.space.back_off();
        let moved = changed.is_some();
        self.changed = changed.unwrap_or_default();
        self.hear_of_space();
        moved
    }

    /// The robot's own voxel.
    pub fn robot(&self) -> Voxel {
        self.space.component.start()
    }
}

#[cfg(test)]
mod tests {
    use elk_geometry::{FrontierSet, OccupancyGrid, Pose, State};
    use elk_spatial::messages::{Outcome, Path, PlanRequest};
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;
    use crate::Policy;
    use crate::sight::Sight;

    /// Edge of a hall of free voxels.
    const EDGE: i32 = 14;

    fn hall() -> OccupancyGrid {
        let mut grid = OccupancyGrid::new(0.1);
        let side = || -1..=EDGE;
        for voxel in side().flat_map(|x| side().flat_map(move |y| side().map(move |z| Voxel::new(x, y, z)))) {
            let wall = voxel.to_array().iter().any(|c| [-1, EDGE].contains(c));
            grid.set(voxel, if wall { State::Occupied } else { State::Free });
        }
        grid
    }

    fn voxel() -> impl Strategy<Value = Voxel> {
        prop::array::uniform3(-1..=EDGE).prop_map(Voxel::from)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        /// Edit by edit, and target by target that is looked at in vain, the scene that is kept is the one that is made anew: what
        /// is to be resolved and what is left out, by cause, and the goals.
        #[test]
        fn what_is_kept_is_what_is_made_anew(
            min_frontier in prop_oneof![Just(1usize), Just(5)],
            edits in prop::collection::vec(
                (prop::collection::vec((voxel(), 0..6u8), 0..14), prop::option::of(0..200usize), prop::option::of(voxel()), any::<bool>()),
                2..8,
            ),
        ) {
            let settings = Settings { min_frontier, attempts: 2, ..super::super::tests::settings(Policy::elk(0.4)) };
            let (mut grid, mut frontier, mut memory) = (hall(), FrontierSet::new(None), Memory::default());
            let (mut kept, mut robot) = (None, Voxel::new(5, 5, 5));
            for (cells, target, moved, back_off) in edits {
                let mut changed = VoxelSet::new();
                for (voxel, state) in cells {
                    if grid.set(voxel, [State::Occupied, State::Free, State::Unknown][usize::from(state.min(2))]) {
                        frontier.update(&grid, [voxel]);
                        changed.insert(voxel);
                    }
                }
                robot = moved.filter(|voxel| grid.state(*voxel) == State::Free).unwrap_or(robot);
                let position = robot.center(0.1);
                let target = target.and_then(|n| frontier.iter().nth(n));
                if let Some(target) = target {
                    memory.remember(&Path { points: vec![position], target, unknown: vec![], looks: vec![], again: false });
                }
                let outcome = if target.is_some() { Outcome::Unresolved } else { Outcome::First };
                let request = PlanRequest { id: 1, pose: Pose::looking(position, Vector3::x()), revision: 1, outcome };
                let known = Known { grid: &grid, frontier: &frontier, sight: Sight::default() };
                memory.learn(&request, known, settings.policy.scan_spacing_m, 0);
                let learned = memory.take_learned();
                let scene = |before: (Option<Scene>, VoxelSet), learned: &BTreeSet<Voxel>| {
                    let mut scene = Scene::around(known, position, before, &memory, &settings);
                    scene.sort_out(known, learned.clone(), &memory, &settings);
                    if back_off && scene.back_off() {
                        scene.sort_out(known, BTreeSet::new(), &memory, &settings);
                    }
                    scene
                };
                let now = scene((kept.take(), changed), &learned);
                let anew = scene((None, VoxelSet::new()), &learned);
                prop_assert_eq!(now.left, anew.left);
                prop_assert_eq!(now.agenda.targets(known, &memory), anew.agenda.targets(known, &memory));
                prop_assert!(now.agenda.goals().iter().eq(anew.agenda.goals().iter()));
                prop_assert!(now.agenda.goals().iter().all(|goal| now.agenda.goals().at(goal.voxel) == Some(goal)));
                kept = Some(now);
            }
        }
    }
}
