//! The map as one plan sees it: where the robot can be, what is to be resolved, and what is not, by cause.

use std::collections::BTreeSet;

use elk_geometry::Voxel;
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
    /// Bricks in which something has changed that the agenda has not heard of.
    changed: BTreeSet<Voxel>,
    /// Bricks in which the robot can get to other voxels than the strategy has seen, and perhaps others; `None`: it has seen
    /// nothing of it.
    pub unseen: Option<BTreeSet<Voxel>>,
}

impl Scene {
    /// What is around a robot at `position` (m, world), made of the scene `before` if there was one: since then the map has
    /// changed in the bricks `changed`, and nowhere else.
    pub fn around(
        known: Known,
        position: Point3<f64>,
        (before, changed): (Option<Self>, BTreeSet<Voxel>),
        memory: &Memory,
        settings: &Settings,
    ) -> Self {
        let robot = Voxel::containing(position, known.grid.resolution());
        match before {
            Some(scene) => scene.follow(known, robot, changed, memory),
            None => Self::anew(known, robot, memory, settings),
        }
    }

    fn anew(known: Known, robot: Voxel, memory: &Memory, settings: &Settings) -> Self {
        let space = Space::around(known.grid, robot, &settings.clearance, memory.trail());
        let (verdicts, agenda, changed) = (Verdicts::default(), Agenda::default(), BTreeSet::new());
        Self { space, verdicts, agenda, left: FrontiersLeft::default(), changed, unseen: None }
    }

    fn follow(mut self, known: Known, robot: Voxel, bricks: BTreeSet<Voxel>, memory: &Memory) -> Self {
        self.changed = self.space.follow(known.grid, robot, bricks.iter().copied(), memory.trail_turned());
        self.hear_of_space();
        // What was unknown and is occupied now is free neither way.
        self.changed.extend(bricks);
        self
    }

    /// The space has changed.
    fn hear_of_space(&mut self) {
        self.verdicts.hear_of(self.changed.iter().copied());
        self.unseen.iter_mut().for_each(|unseen| unseen.extend(&self.changed));
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
