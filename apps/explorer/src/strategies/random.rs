//! To a frontier drawn by lot (thesis 6.5.1.1).

use elk_geometry::random::Random as Numbers;
use elk_mission::{AppType, joined};

use super::candidates::SEED;
use crate::app::{COMMON, app};
use crate::goals::Goal;
use crate::journal::Journal;
use crate::strategy::{Route, Strategy, View};

/// Its row in the table of explorers.
pub const TYPE: AppType = AppType {
    element: "Explorer",
    name: "Random",
    summary: "Goes to a frontier drawn by lot, by A*.",
    params: &joined::<{ COMMON.len() + 1 }>(COMMON, &[SEED]),
    // The table keeps it from being negative.
    build: |params| app(params, Box::new(Random { seed: params.integer("Seed") as u64 })),
    preflight: None,
};

/// Goes to a goal that is drawn by lot, each as likely as the others.
#[derive(Debug, Clone, Copy, Default)]
pub struct Random {
    /// What is drawn follows from it and from the number of the plan.
    pub seed: u64,
}

impl Strategy for Random {
    fn name(&self) -> &'static str {
        "Random"
    }

    fn describe(&self) -> String {
        format!("seed {}", self.seed)
    }

    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        let goals: Vec<&Goal> = view.goals.iter().collect();
        let drawn = goals.get(Numbers::new(self.seed, view.plan).below(goals.len()))?;
        journal.time("search", || view.route_by(drawn.voxel, drawn))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::Room;

    #[test]
    fn all_goals_are_drawn_and_the_same_seed_draws_the_same() {
        let goals = [[3.0, 2.0, 1.0], [1.5, 1.0, 1.0], [0.5, 2.5, 2.0]];
        let room = Room::new([4.0, 3.0, 2.5], [1.0, 1.0, 1.0], &goals);
        let drawn = |seed: u64| room.choice(&mut Random { seed });
        assert_eq!((0..40).map(drawn).collect::<BTreeSet<_>>(), (0..3).map(Some).collect());
        assert_eq!(drawn(5), drawn(5));
        let plans: Vec<_> = (1..40).map(|plan| room.at_plan(plan, &mut Random { seed: 1 })).collect();
        assert!(plans.iter().any(|choice| *choice != plans[0]), "each plan draws anew");
    }
}
