//! Poses drawn by lot where the robot can stand, and the one of them that is worth most for what its camera would see of the
//! frontier (thesis 6.5.1.3).
//!
//! There are thousands of poses and thousands of frontier voxels. What a pose can see at most costs little to say, so the most
//! promising is looked at first, and when no other promises as much as one has shown the rest is not looked at (lazy evaluation
//! of greedy choices, Minoux, *Accelerated Greedy Algorithms for Maximizing Submodular Set Functions*, 1978). The choice is the
//! one that is made by looking from all of them.

mod outlook;

use std::cmp::Ordering;

use elk_geometry::Voxel;
use elk_geometry::random::Random;
use elk_mission::{Kind, ParamSpec};
use nalgebra::Vector3;

use crate::app::param;
use crate::strategy::View;
use outlook::{Candidate, Outlook, Pose};

/// One pose is drawn for so many voxels in which the robot can be: 5 % (thesis 6.5.1.3).
const VOXELS_A_POSE: usize = 20;

/// What whoever draws by lot begins with.
pub const SEED: ParamSpec = param(
    "Seed",
    Kind::Integer { min: 0, max: 1_000_000_000 },
    "0",
    "What is drawn by lot follows from it and from the number of the plan.",
);

/// What a pose is worth, its gain times its weight; of equals the first that was drawn is better.
#[derive(Debug, Clone, Copy)]
struct Worth {
    worth: f64,
    drawn: usize,
}

impl Worth {
    /// The better one first.
    fn compare(&self, other: &Self) -> Ordering {
        other.worth.total_cmp(&self.worth).then(self.drawn.cmp(&other.drawn))
    }

    fn is_better(&self, other: &Self) -> bool {
        self.compare(other) == Ordering::Less
    }
}

/// Of the poses drawn under `seed` that see any of the frontier the one whose gain times `weight` is largest, of equals the first;
/// a place without a weight is none to go to.
pub fn best<'a>(view: &View<'a>, seed: u64, weight: impl Fn(Voxel) -> Option<f64>) -> Option<Candidate<'a>> {
    let outlook = Outlook::new(view);
    let promise = |(drawn, pose): (usize, Pose)| {
        let most = outlook.most(&pose);
        let weight = weight(pose.place).filter(|_| most > 0)?;
        Some((Worth { worth: most as f64 * weight, drawn }, weight, pose))
    };
    let mut promising: Vec<(Worth, f64, Pose)> = draw(view, seed).enumerate().filter_map(promise).collect();
    promising.sort_unstable_by(|(one, ..), (other, ..)| one.compare(other));
    let mut best: Option<(Worth, Candidate<'a>)> = None;
    for (promise, weight, pose) in promising {
        let is_best = |worth: Worth| best.is_none_or(|(shown, _)| worth.is_better(&shown));
        if !is_best(promise) {
            break;
        }
        let worth = |gain: usize| Worth { worth: gain as f64 * weight, ..promise };
        if let Some(candidate) = outlook.look(&pose, |gain| is_best(worth(gain))) {
            best = Some((worth(candidate.gain), candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// Poses drawn under `seed`, of every [`VOXELS_A_POSE`] voxels in which the robot can be one, in directions evenly over the
/// sphere.
fn draw(view: &View<'_>, seed: u64) -> impl Iterator<Item = Pose> {
    let mut random = Random::new(seed, view.plan);
    let count = view.space.reach.len();
    let lots = (0..count).step_by(VOXELS_A_POSE).map(|first| {
        let place = first + random.below(VOXELS_A_POSE.min(count - first));
        (place, direction(random.unit(), random.unit()))
    });
    let (places, axes): (Vec<usize>, Vec<Vector3<f64>>) = lots.unzip();
    view.space.reach.select(places).into_iter().zip(axes).map(|(place, axis)| Pose { place, axis })
}

/// A direction; evenly over the sphere if both numbers are evenly in [0, 1).
fn direction(height: f64, turn: f64) -> Vector3<f64> {
    let (z, angle) = (2.0 * height - 1.0, std::f64::consts::TAU * turn);
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vector3::new(radius * angle.cos(), radius * angle.sin(), z)
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub use tests::every;
