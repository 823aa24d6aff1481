//! Poses drawn by lot where the robot can stand, and what the camera would see of the frontier from each (thesis 6.5.1.3).

use elk_geometry::Voxel;
use elk_geometry::random::Random;
use elk_mission::{Kind, ParamSpec};
use nalgebra::Vector3;

use crate::app::param;
use crate::goals::Goal;
use crate::strategy::View;

/// One pose is drawn for so many voxels in which the robot can be: 5 % (thesis 6.5.1.3).
const VOXELS_A_POSE: usize = 20;

/// What whoever draws by lot begins with.
pub const SEED: ParamSpec = param(
    "Seed",
    Kind::Integer { min: 0, max: 1_000_000_000 },
    "0",
    "What is drawn by lot follows from it and from the number of the plan.",
);

/// A pose from which something of the frontier is seen.
#[derive(Debug, Clone, Copy)]
pub struct Candidate<'a> {
    /// Where the camera is: in the middle of it.
    pub place: Voxel,
    /// Number of frontier voxels in the camera's view whose unknown side it looks into.
    pub gain: usize,
    /// Of the goals that are seen, the one nearest to the middle of the image.
    pub goal: &'a Goal,
}

/// Poses drawn under `seed`, of every [`VOXELS_A_POSE`] voxels in which the robot can be one, in directions evenly over the
/// sphere: those that see any of the frontier.
pub fn candidates<'a>(view: &View<'a>, seed: u64) -> Vec<Candidate<'a>> {
    let mut random = Random::new(seed, view.plan);
    let mut voxels: Vec<Voxel> = view.space.reach.iter().collect();
    // What the set has first is a matter of its past.
    voxels.sort_unstable();
    let drawn =
        voxels.chunks(VOXELS_A_POSE).map(|run| (run[random.below(run.len())], direction(random.unit(), random.unit())));
    let targets: Vec<(&Goal, bool)> = view.goals.iter_all().collect();
    drawn.filter_map(|(place, axis)| candidate(view, &targets, place, axis)).collect()
}

/// A direction; evenly over the sphere if both numbers are evenly in [0, 1).
fn direction(height: f64, turn: f64) -> Vector3<f64> {
    let (z, angle) = (2.0 * height - 1.0, std::f64::consts::TAU * turn);
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vector3::new(radius * angle.cos(), radius * angle.sin(), z)
}

/// What is seen from `place` along `axis` of the goals, each with whether it is the one of its voxel.
fn candidate<'a>(
    view: &View<'_>,
    goals: &[(&'a Goal, bool)],
    place: Voxel,
    axis: Vector3<f64>,
) -> Option<Candidate<'a>> {
    let (from, sight) = (view.space.center(place), view.sight);
    let (mut gain, mut aim) = (0, None);
    for (goal, is_first) in goals {
        let toward = goal.target.voxel.center(view.space.resolution()) - from;
        let distance = toward.norm();
        let off_axis = toward.dot(&axis) / distance.max(1e-9);
        let in_view = distance <= sight.range_m && (distance < 1e-9 || sight.covers(&axis, &(toward / distance)));
        if in_view && goal.target.seen_from(view.space, from) {
            gain += 1;
            if *is_first && aim.is_none_or(|(best, _)| off_axis > best) {
                aim = Some((off_axis, *goal));
            }
        }
    }
    aim.map(|(_, goal)| Candidate { place, gain, goal })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_even_over_the_sphere() {
        let mut random = Random::new(1, 1);
        let sum: Vector3<f64> = (0..20_000).map(|_| direction(random.unit(), random.unit())).sum();
        // Five standard errors of each component's mean, whose variance is a third.
        assert!((sum / 20_000.0).amax() < 5.0 * (1.0 / 3.0f64 / 20_000.0).sqrt(), "{sum}");
    }
}
