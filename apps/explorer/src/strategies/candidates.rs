//! Poses drawn by lot where the robot can stand, and the one of them that is worth most for what its camera would see of the
//! frontier (thesis 6.5.1.3).
//!
//! There are thousands of poses and thousands of frontier voxels, and most of both are as they were in the last plan. So the lots
//! are drawn once: whether a voxel has a pose, and where that looks, follows from a hash of its indices, and who has been
//! there before need not draw again. What a pose has in view is counted on and off as the frontier changes, and what it sees
//! is kept until something changes that it has in view ([`kept`]). No more can be seen than is in view, and no way is shorter than
//! it would be if nothing were in it, so the most promising pose is looked at first, and when no other promises as much as
//! one has shown the rest is not looked at (lazy evaluation of greedy choices, Minoux, *Accelerated Greedy Algorithms for Maximizing
//! Submodular Set Functions*, 1978). The choice is the one that is made by looking from all of them.

mod kept;
mod lots;
pub mod sightings;

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use elk_geometry::Voxel;
use elk_mission::{Kind, ParamSpec};

use crate::app::param;
use crate::goals::Goal;
use crate::strategies::groups::InVain;
use crate::strategy::View;
use crate::target::Target;
use kept::{Kept, Number};
use lots::{Lots, Pose};

/// What whoever draws by lot begins with.
pub const SEED: ParamSpec =
    param("Seed", Kind::Integer { min: 0, max: 1_000_000_000 }, "0", "What is drawn by lot follows from it.");

/// As many times lots are drawn: other poses count where none of those drawn before sees anything.
const DRAWS: u64 = 4;

/// Poses drawn by lot under a seed, kept from plan to plan. A plan's choice follows from the seed and what the plan is made over,
/// whatever was kept.
#[derive(Debug, Clone)]
pub struct Candidates {
    seed: u64,
    /// By draw, as far as they were asked for.
    draws: Vec<Kept>,
}

/// A pose from which something of the frontier is seen.
#[derive(Debug, Clone, Copy)]
pub struct Candidate<'a> {
    /// Where the camera is: in the middle of it.
    pub place: Voxel,
    /// Of the goals that are seen, the one nearest to the middle of the image.
    pub goal: &'a Goal,
}

/// What a view from a place is worth as against one from here.
pub trait Weight {
    /// It is worth no more than this.
    fn at_most(&self, place: Voxel) -> f64;

    /// It is worth this; `None`: it is no place to go to.
    fn of(&mut self, place: Voxel) -> Option<f64>;
}

/// What a pose is worth, its gain times its weight, as far as that is known.
#[derive(Debug, Clone, Copy)]
struct Promise {
    /// At most.
    worth: f64,
    pose: Pose,
    number: Number,
    known: Known,
}

/// What is known of a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Known {
    /// How many frontier voxels it sees at most.
    Bound,
    /// How many it sees.
    Gain(u32),
    /// And what those are worth.
    Worth,
}

/// What is better is greater: what promises more, of equals what is first by the order of its voxel.
impl Ord for Promise {
    fn cmp(&self, other: &Self) -> Ordering {
        self.worth.total_cmp(&other.worth).then_with(|| other.pose.place.cmp(&self.pose.place))
    }
}

impl PartialOrd for Promise {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Promise {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Promise {}

impl Candidates {
    /// Those drawn under `seed`.
    pub fn new(seed: u64) -> Self {
        Self { seed, draws: Vec::new() }
    }

    /// The seed.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Of the poses that see any of the frontier the one whose gain times weight is largest, of equals the first by the order of its
    /// voxel. Where no pose sees anything others are drawn, [`DRAWS`] times in all. Adds to `looks` the poses that it looked from.
    pub fn best<'a>(&mut self, view: &View<'a>, looks: &mut u64, weight: &mut impl Weight) -> Option<Candidate<'a>> {
        self.draws.iter_mut().for_each(|kept| kept.follow(view));
        (0..DRAWS).find_map(|draw| {
            if self.draws.len() as u64 == draw {
                let mut kept = Kept::new(Lots::new(self.seed, draw));
                kept.follow(&View { changed: None, ..*view });
                self.draws.push(kept);
            }
            best_of(self.draws.get_mut(draw as usize)?, view, looks, weight)
        })
    }
}

fn best_of<'a>(kept: &mut Kept, view: &View<'a>, looks: &mut u64, weight: &mut impl Weight) -> Option<Candidate<'a>> {
    let promise = |pose: Pose, number: Number, known: Known, worth: f64| Promise { worth, pose, number, known };
    let all = kept.all().filter_map(|(number, drawn)| {
        let most = Some(drawn.seen.unwrap_or(drawn.in_view)).filter(|most| *most > 0)?;
        let worth = f64::from(most) * weight.at_most(drawn.pose.place);
        Some(promise(drawn.pose, number, drawn.seen.map_or(Known::Bound, Known::Gain), worth))
    });
    let mut promising: BinaryHeap<Promise> = all.collect::<Vec<_>>().into();
    let here = Voxel::containing(view.from, view.space.resolution());
    let (from_here, mut found) = (InVain::from(here, view.space.resolution(), view.goals.targets()), None);
    while let Some(Promise { pose, number, known, .. }) = promising.pop() {
        match known {
            Known::Bound => {
                let gain = kept.look(view, number);
                *looks += 1;
                if gain > 0 {
                    let most = f64::from(gain) * weight.at_most(pose.place);
                    promising.push(promise(pose, number, Known::Gain(gain), most));
                }
            }
            Known::Gain(gain) => {
                let worth = weight.of(pose.place).map(|weight| f64::from(gain) * weight);
                promising.extend(worth.map(|worth| promise(pose, number, Known::Worth, worth)));
            }
            Known::Worth => found = aim(view, &from_here, &pose).map(|goal| Candidate { place: pose.place, goal }),
        }
        if found.is_some() {
            break;
        }
    }
    found
}

/// Of the goals that a pose sees the one nearest to the middle of its image, the first of equals; none of those that share their
/// voxel with one before them. And none at which a look would be in vain: from there, or `from_here`, where the robot is, if it is in
/// sight from here, since no way leads farther than to where its goal is in sight.
fn aim<'a>(view: &View<'a>, from_here: &InVain, pose: &Pose) -> Option<&'a Goal> {
    let (from, resolution) = (view.space.center(pose.place), view.space.resolution());
    let along = |goal: &Goal| {
        let toward = (goal.target.voxel - pose.place).to_array().map(|c| f64::from(c) * resolution).into();
        let is_in_view = view.sight.has_in_view(&pose.axis, &toward);
        is_in_view.then(|| toward.dot(&pose.axis) / toward.norm().max(f64::MIN_POSITIVE))
    };
    let mut goals: Vec<(f64, &Goal)> = view.goals.iter().filter_map(|goal| Some((along(goal)?, goal))).collect();
    goals.sort_by(|(one, _), (other, _)| other.total_cmp(one));
    let from_there = InVain::from(pose.place, resolution, view.goals.targets());
    let is_in_vain = |target: &Target| {
        from_there.is_like(target) || from_here.is_like(target) && target.seen_from(view.space, view.from)
    };
    let mut goals = goals.into_iter().map(|(_, goal)| goal);
    goals.find(|goal| goal.target.seen_from(view.space, from) && !is_in_vain(&goal.target))
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub use tests::every;
