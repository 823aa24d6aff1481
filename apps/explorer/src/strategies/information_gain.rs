//! To the pose from which most of the frontier is seen (thesis 6.5.1.3).

use elk_geometry::Voxel;
use elk_mission::{AppType, joined};

use super::candidates::{Candidates, SEED, Weight};
use crate::app::{COMMON, app};
use crate::journal::Journal;
use crate::strategy::{Route, Strategy, View};

/// Its row in the table of explorers.
pub const TYPE: AppType = AppType {
    element: "Explorer",
    name: "InformationGain",
    summary: "Of poses drawn by lot goes to the one that sees most frontier voxels, by A*.",
    params: &joined::<{ COMMON.len() + 1 }>(COMMON, &[SEED]),
    // The table keeps it from being negative.
    build: |params| app(params, Box::new(InformationGain::new(params.integer("Seed") as u64))),
    preflight: None,
};

/// Goes to the candidate pose of the largest gain A(q), the frontier voxels that it sees (thesis 2.5.5.3, 6.5.1.3), however far that
/// is; of equals to the first by the order of its voxel. Where none sees anything it has no answer.
#[derive(Debug, Clone)]
pub struct InformationGain {
    candidates: Candidates,
}

impl InformationGain {
    /// What is drawn by lot follows from `seed`.
    pub fn new(seed: u64) -> Self {
        Self { candidates: Candidates::new(seed) }
    }
}

/// No place is worth less than another.
struct Alike;

impl Weight for Alike {
    fn at_most(&self, _: Voxel) -> f64 {
        1.0
    }

    fn of(&mut self, _: Voxel) -> Option<f64> {
        Some(1.0)
    }
}

impl Strategy for InformationGain {
    fn name(&self) -> &'static str {
        "InformationGain"
    }

    fn describe(&self) -> String {
        format!("seed {}", self.candidates.seed())
    }

    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        let (candidates, mut looks) = (&mut self.candidates, 0);
        let best = journal.time("gain", || candidates.best(view, &mut looks, &mut Alike));
        journal.count("looks", looks);
        let best = best?;
        journal.time("search", || view.route_by(best.place, best.goal))
    }
}

#[cfg(test)]
mod tests {
    use super::super::candidates::every;
    use super::*;
    use crate::Room;

    /// One frontier voxel at the robot, twenty at the far end of the room: whatever sees all of those is better than any pose by
    /// the near one that does not.
    #[test]
    fn it_goes_where_most_is_seen_however_far() {
        let row = (0..20).map(|k| [7.55, 0.55 + 0.1 * f64::from(k), 1.25]);
        let goals: Vec<[f64; 3]> = std::iter::once([0.5, 1.5, 1.25]).chain(row).collect();
        let room = Room::new([8.0, 3.0, 2.5], [0.55, 1.05, 1.25], &goals);
        for seed in 0..5 {
            let drawn = every(&room.view(), seed);
            let most = drawn.iter().map(|looked| looked.gain).max();
            assert!(most >= Some(20), "{most:?}");
            let first = drawn.iter().find(|looked| Some(looked.gain) == most).unwrap();
            let route = InformationGain::new(seed).plan(&room.view(), &mut Journal::new(|| 0.0)).unwrap();
            assert_eq!(route.points.last(), Some(&room.view().space.center(first.place)));
        }
    }
}
