//! What flows into goals that lie together: its share of all that leaves the robot is the probability that a random walk from there ends
//! at them, so it is the larger the nearer and the wider they are.

use std::collections::{BTreeMap, BTreeSet};

use elk_field::{Cell, Field};
use elk_geometry::Voxel;

/// The flow into each of the groups in which goals touch by face, edge or corner.
pub struct Inflow {
    /// Of each goal's voxel its group.
    groups: BTreeMap<Voxel, usize>,
    /// Into each group (in ψ and faces).
    flows: Vec<f64>,
    /// Into all.
    whole: f64,
}

impl Inflow {
    /// That into the goals in these voxels, of a field that is solved, or nearly.
    pub fn of(goals: impl Iterator<Item = Voxel>, field: &Field<'_>) -> Self {
        let mut left: BTreeSet<Voxel> = goals.filter(|voxel| field.cell(*voxel) == Cell::Sink).collect();
        let (mut groups, mut flows) = (BTreeMap::new(), Vec::new());
        while let Some(first) = left.pop_first() {
            let (mut flow, mut to_do) = (0.0, vec![first]);
            while let Some(voxel) = to_do.pop() {
                groups.insert(voxel, flows.len());
                flow += into(field, voxel);
                to_do.extend(voxel.neighbours().filter(|beside| left.remove(beside)));
            }
            flows.push(flow);
        }
        let whole = flows.iter().sum();
        Self { groups, flows, whole }
    }

    /// The share of the flow that ends at the goals that lie together with this one (0 to 1).
    pub fn share(&self, goal: Voxel) -> f64 {
        self.groups.get(&goal).map_or(0.0, |group| self.flows[*group] / self.whole)
    }
}

/// What flows into a goal, where ψ is 0, from what is beside it and no goal.
fn into(field: &Field<'_>, goal: Voxel) -> f64 {
    let is_open = |voxel: &Voxel| !matches!(field.cell(*voxel), Cell::Outside | Cell::Sink);
    goal.face_neighbours().into_iter().filter(is_open).map(|voxel| f64::from(field.psi(voxel))).sum()
}

#[cfg(test)]
mod tests {
    use elk_field::Domain;

    use super::*;

    /// A channel with the source at 4, a goal at 0, and at 16 two that touch by an edge: of currents through 4 and 12 faces in a
    /// row three quarters go the short way.
    #[test]
    fn what_flows_into_goals_is_as_in_a_circuit() {
        let mut domain = Domain::new();
        (0..=16).for_each(|x| domain.set(Voxel::new(x, 0, 0), Cell::Inside));
        domain.set(Voxel::new(4, 0, 0), Cell::Source);
        let goals = [Voxel::new(0, 0, 0), Voxel::new(16, 0, 0), Voxel::new(17, 1, 0)];
        goals.iter().for_each(|goal| domain.set(*goal, Cell::Sink));
        domain.solve(1e-9, || false);
        let inflow = Inflow::of(goals.into_iter(), &Field::of(&domain, 0.1));
        let shares = goals.map(|goal| inflow.share(goal));
        assert!((shares[0] - 0.75).abs() < 1e-4 && (shares[1] - 0.25).abs() < 1e-4, "{shares:?}");
        assert_eq!((shares[1], inflow.share(Voxel::new(9, 0, 0))), (shares[2], 0.0), "they lie together");
    }
}
