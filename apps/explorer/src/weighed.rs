//! The goals that a strategy weighs, as it weighs them: what they come to is a message, [`elk_spatial::candidates`].

use elk_geometry::Voxel;
use elk_spatial::candidates::{Candidate, MOST};

use crate::goals::Goal;

/// Goals as they are weighed.
#[derive(Debug, Clone, Default)]
pub struct Weighed {
    /// How many.
    pub count: u64,
    /// The first of them, none chosen yet, each with its own voxel.
    pub first: Vec<(Voxel, Candidate)>,
}

impl Weighed {
    /// One more. A score that is no finite number is left out of the list: nobody could read it.
    pub fn add(&mut self, goal: &Goal, score: f64) {
        self.count += 1;
        if self.first.len() < MOST && score.is_finite() {
            let Goal { voxel, position, target } = goal;
            let candidate = Candidate { position: *position, target: target.voxel, score, chosen: false };
            self.first.push((*voxel, candidate));
        }
    }

    /// Marks the goals in the voxel that the strategy goes to.
    pub fn choose(&mut self, voxel: Voxel) {
        self.first.iter_mut().for_each(|(of, candidate)| candidate.chosen = *of == voxel);
    }

    /// The goals alone.
    pub fn into_goals(self) -> Vec<Candidate> {
        self.first.into_iter().map(|(_, candidate)| candidate).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Journal, Room};

    #[test]
    fn what_is_weighed_is_listed_with_what_it_is_worth_and_what_is_chosen() {
        let room = Room::new([4.0, 3.0, 2.5], [1.0, 1.0, 1.0], &[[1.0, 1.0, 2.0], [3.0, 1.0, 1.0]]);
        let mut journal = Journal::new(|| 0.0);
        let route = room.view().cheapest(&mut journal, |_, way_m| way_m).unwrap();
        let mut weighed = journal.take_weighed();
        weighed.choose(route.goal);
        assert_eq!(weighed.count, 2);
        let goals = weighed.into_goals();
        assert!(goals[0].score < goals[1].score && goals[0].chosen && !goals[1].chosen, "{goals:?}");
        assert_eq!(journal.take_weighed().count, 0, "each plan has its own");
    }

    #[test]
    fn no_more_is_kept_than_a_message_holds() {
        let room = Room::new([4.0, 3.0, 2.5], [1.0, 1.0, 1.0], &[[1.0, 1.0, 2.0]]);
        let (view, mut weighed) = (room.view(), Weighed::default());
        let goal = view.goals.iter().next().unwrap();
        (0..MOST + 7).for_each(|n| weighed.add(goal, if n == 0 { f64::NAN } else { 1.0 }));
        assert_eq!((weighed.count, weighed.into_goals().len()), (MOST as u64 + 7, MOST));
    }
}
