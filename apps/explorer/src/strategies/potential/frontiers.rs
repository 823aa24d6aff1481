//! Goals that lie together, and how much flows into them: the share of all that comes from the robot is the probability that a
//! random walk from there ends at them, which is the larger the nearer and the wider they are.

use std::collections::{BTreeMap, BTreeSet};

use elk_field::{Cell, Field};
use elk_geometry::Voxel;

use crate::goals::Goals;

/// The goals, in groups that touch by face, edge or corner.
pub struct Frontiers {
    /// Of each goal's voxel its group.
    of: BTreeMap<Voxel, usize>,
    /// What flows into each group (in ψ and faces).
    pub flows: Vec<f64>,
}

impl Frontiers {
    /// Those of a field that is solved.
    pub fn of(goals: &Goals, field: &Field<'_>) -> Self {
        let mut left: BTreeSet<Voxel> = goals.iter().map(|goal| goal.voxel).filter(|v| field.cell(*v) == Cell::Sink).collect();
        let (mut of, mut flows) = (BTreeMap::new(), Vec::new());
        while let Some(first) = left.pop_first() {
            let mut flow = 0.0;
            let mut under_way = vec![first];
            while let Some(voxel) = under_way.pop() {
                of.insert(voxel, flows.len());
                flow += inflow(field, voxel);
                under_way.extend(voxel.neighbours().filter(|beside| left.remove(beside)));
            }
            flows.push(flow);
        }
        Self { of, flows }
    }

    /// The group of a goal.
    pub fn group(&self, goal: Voxel) -> Option<usize> {
        self.of.get(&goal).copied()
    }

    /// The group into which most flows, the first of equals.
    pub fn largest(&self) -> Option<usize> {
        let flows = self.flows.iter().enumerate().rev();
        flows.max_by(|(_, one), (_, other)| one.total_cmp(other)).map(|(group, _)| group)
    }
}

/// What flows into a goal, where ψ is 0, from the voxels beside it that are none.
fn inflow(field: &Field<'_>, goal: Voxel) -> f64 {
    let beside = goal.face_neighbours().into_iter().filter(|n| !matches!(field.cell(*n), Cell::Outside | Cell::Sink));
    beside.map(|n| f64::from(field.psi(n))).sum()
}
