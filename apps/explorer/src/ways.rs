//! The shortest ways from where the robot is: to all goals at once, or to those places that are asked for.

use elk_geometry::Voxel;
use elk_geometry::astar::{self, Reached};

use crate::goals::Goal;
use crate::journal::Journal;
use crate::strategy::{Route, View};

/// The shortest ways to all goals of a [`View`], over voxels that the robot can be in.
pub struct Ways<'a> {
    view: View<'a>,
    reached: Reached,
}

impl<'a> View<'a> {
    /// The shortest ways to all goals: one search, whatever is then asked of it.
    pub fn ways(&self) -> Ways<'a> {
        Ways { view: *self, reached: astar::all(&self.space.reach, self.space.start()) }
    }

    /// The shortest way to `place`, from where the target of `goal` is seen; `None`: there is none.
    pub fn route_by(&self, place: Voxel, goal: &Goal) -> Option<Route> {
        self.way_by(place, goal.voxel)
    }

    /// The same where the goal, or the target of [`View::open`], is in voxel `goal`.
    pub fn way_by(&self, place: Voxel, goal: Voxel) -> Option<Route> {
        let way = astar::shortest(&self.space.reach, self.space.start(), place)?;
        Some(Route::to_look(self, &way, goal))
    }

    /// The lengths of the shortest ways to places, each searched for when it is asked.
    pub fn lengths(&self) -> Lengths<'a> {
        Lengths { view: *self, last: None, all: None, searches: 0 }
    }

    /// The way to the closest goal; `None`: there is a way to none.
    pub fn closest(&self, journal: &mut Journal) -> Option<Route> {
        let way = journal.time("search", || {
            let is_goal = |voxel| self.goals.contains(voxel);
            astar::closest_of(&self.space.reach, self.space.start(), is_goal, || self.goals.boxes())
        })?;
        Route::over_voxels(self, &way)
    }

    /// The shortest way to the goal that costs least, the first of equals; `cost` is asked for each goal with the length
    /// of the shortest way there (m), and what it says goes into the journal. `None`: there is a way to no goal.
    pub fn cheapest(&self, journal: &mut Journal, cost: impl Fn(&Goal, f64) -> f64) -> Option<Route> {
        let ways = self.ways();
        let priced = self.goals.iter().filter_map(|goal| Some((goal, cost(goal, ways.length_m(goal)?))));
        let weighed = priced.inspect(|(goal, cost)| journal.weigh(goal, *cost));
        let (goal, _) = weighed.min_by(|(_, one), (_, other)| one.total_cmp(other))?;
        ways.route(goal)
    }
}

impl Ways<'_> {
    /// Length of the shortest way to a goal (m), from centre to centre of the voxels; `None`: there is none.
    pub fn length_m(&self, goal: &Goal) -> Option<f64> {
        self.length_to_m(goal.voxel)
    }

    /// The same to any place.
    pub fn length_to_m(&self, place: Voxel) -> Option<f64> {
        Some(self.reached.cost(place)? * self.view.space.resolution())
    }

    /// The shortest way to a goal; `None`: there is none.
    pub fn route(&self, goal: &Goal) -> Option<Route> {
        self.route_by(goal.voxel, goal)
    }

    /// The shortest way to `place`, from where the target of `goal` is seen; `None`: there is none.
    pub fn route_by(&self, place: Voxel, goal: &Goal) -> Option<Route> {
        Some(Route::to_look(&self.view, &self.reached.way_to(place)?, goal.voxel))
    }
}

/// The lengths of the shortest ways to a few of many places.
pub struct Lengths<'a> {
    view: View<'a>,
    /// The way to the place that was asked for last.
    last: Option<(Voxel, Reached)>,
    /// The ways to all places.
    all: Option<Ways<'a>>,
    searches: u64,
}

/// After so many searches for one way all are searched for at once.
const SEARCHES: u64 = 12;

impl Lengths<'_> {
    /// The way to `place` is at least so long (m).
    pub fn at_least_m(&self, place: Voxel) -> f64 {
        let View { space, .. } = self.view;
        astar::at_least(space.start(), place) * space.resolution()
    }

    /// Length of the shortest way to `place` (m), from centre to centre of the voxels; `None`: there is none.
    pub fn to_m(&mut self, place: Voxel) -> Option<f64> {
        if self.last.as_ref().is_none_or(|(of, _)| *of != place) && self.searches < SEARCHES {
            let View { space, .. } = self.view;
            self.searches += 1;
            self.last = Some((place, astar::toward(&space.reach, space.start(), place)));
        }
        if let Some((_, reached)) = self.last.as_ref().filter(|(of, _)| *of == place) {
            return Some(reached.cost(place)? * self.view.space.resolution());
        }
        let (all, view) = (&mut self.all, &self.view);
        all.get_or_insert_with(|| view.ways()).length_to_m(place)
    }

    /// The shortest way to `place`, from where the target of `goal` is seen; `None`: there is none.
    pub fn route_by(&self, place: Voxel, goal: &Goal) -> Option<Route> {
        match (&self.last, &self.all) {
            (Some((of, reached)), _) if *of == place => {
                Some(Route::to_look(&self.view, &reached.way_to(place)?, goal.voxel))
            }
            (_, Some(all)) => all.route_by(place, goal),
            _ => self.view.route_by(place, goal),
        }
    }

    /// How many single ways were searched for.
    pub fn searches(&self) -> u64 {
        self.searches
    }
}
