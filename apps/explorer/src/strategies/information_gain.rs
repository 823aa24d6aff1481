//! To the pose from which most of the frontier is seen (thesis 6.5.1.3).

use elk_mission::{AppType, joined};

use super::candidates::{SEED, best};
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
    build: |params| app(params, Box::new(InformationGain { seed: params.integer("Seed") as u64 })),
    preflight: None,
};

/// Goes to the candidate of the largest gain, however far that is; of equals to the first. Where none sees anything it has no
/// answer.
#[derive(Debug, Clone, Copy, Default)]
pub struct InformationGain {
    /// What is drawn follows from it and from the number of the plan.
    pub seed: u64,
}

impl Strategy for InformationGain {
    fn name(&self) -> &'static str {
        "InformationGain"
    }

    fn describe(&self) -> String {
        format!("seed {}", self.seed)
    }

    fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
        let best = journal.time("gain", || best(view, self.seed, |_| Some(1.0)))?;
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
            let most = drawn.iter().map(|candidate| candidate.gain).max();
            assert!(most >= Some(20), "{most:?}");
            let first = drawn.iter().find(|candidate| Some(candidate.gain) == most).unwrap();
            let route = InformationGain { seed }.plan(&room.view(), &mut Journal::new(|| 0.0)).unwrap();
            assert_eq!(route.points.last(), Some(&room.view().space.center(first.place)));
        }
    }
}
