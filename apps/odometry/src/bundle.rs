//! Poses and points together: the ones at which all points are where they were seen (bundle adjustment; Triggs, McLauchlan, Hartley and
//! Fitzgibbon, 1999).

use elk_registration::Pose as _;
use elk_stereo::Rig;
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, SMatrix, Vector3, Vector6};

use crate::reprojection::{Match, Observation, cost};

/// Steps, of which each makes the cost less or the next one more careful.
const ITERATIONS: usize = 6;
/// It is done when a step makes the cost less by less than this part.
const TOLERANCE: f64 = 1e-4;
/// By which part of itself the diagonal is raised at first, at least and at most (Marquardt 1963).
const DAMPING: [f64; 3] = [1e-4, 1e-8, 1e4];

/// What one pair saw of a point: both by their number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight {
    pub pose: usize,
    pub point: usize,
    pub seen: Observation,
}

/// Poses, points, and which see which.
#[derive(Clone, Debug)]
pub(crate) struct Bundle {
    pub poses: Vec<Isometry3<f64>>,
    pub points: Vec<Point3<f64>>,
    /// In the order of their points.
    pub sights: Vec<Sight>,
}

/// A sight's part of the equations.
struct Block {
    pose: Option<usize>,
    /// J_poseᵀ W J_point.
    coupling: SMatrix<f64, 6, 3>,
}

impl Bundle {
    /// Makes Σ ρ(r) less, ρ as in [`crate::least_squares`] with a scale in pixels, by steps of Levenberg and Marquardt over all points and all
    /// poses but the first `fixed`, which say where all is.
    pub fn adjust(&mut self, rig: &Rig, fixed: usize, scale: f64) {
        debug_assert!(self.sights.is_sorted_by_key(|sight| sight.point));
        if fixed == 0 || fixed >= self.poses.len() {
            return;
        }
        let mut damping = DAMPING[0];
        let mut best = self.cost(rig, scale);
        for _ in 0..ITERATIONS {
            let Some(next) = self.step(rig, fixed, scale, damping) else { return };
            let cost = next.cost(rig, scale);
            if cost < best {
                let is_done = best - cost < TOLERANCE * best;
                (*self, best) = (next, cost);
                damping = (damping / 10.0).max(DAMPING[1]);
                if is_done {
                    return;
                }
            } else {
                damping *= 10.0;
                if damping > DAMPING[2] {
                    return;
                }
            }
        }
    }

    fn matched(&self, sight: &Sight) -> (Match, &Isometry3<f64>) {
        (Match { point: self.points[sight.point], seen: sight.seen }, &self.poses[sight.pose])
    }

    /// Σ ρ(r), pixels²; a point behind a camera that has seen it costs more than any step is worth.
    fn cost(&self, rig: &Rig, scale: f64) -> f64 {
        let of = |sight: &Sight| {
            let (one, pose) = self.matched(sight);
            one.residual(rig, pose).map_or(f64::INFINITY, |residual| cost(&residual, scale))
        };
        self.sights.iter().map(of).sum()
    }

    /// All poses and points after one step: the equations of the poses are solved first, in which each point is what the poses make of it (the
    /// Schur complement), then those of the points.
    fn step(&self, rig: &Rig, fixed: usize, scale: f64, damping: f64) -> Option<Self> {
        let size = 6 * (self.poses.len() - fixed);
        let mut hessian = DMatrix::<f64>::zeros(size, size);
        let mut gradient = DVector::<f64>::zeros(size);
        let mut points: Vec<(Matrix3<f64>, Vector3<f64>, Vec<Block>)> = Vec::with_capacity(self.points.len());
        let mut sights = self.sights.iter().peekable();
        for number in 0..self.points.len() {
            let (mut by_point, mut gradient_point, mut blocks) = (Matrix3::zeros(), Vector3::zeros(), Vec::new());
            while let Some(sight) = sights.next_if(|sight| sight.point == number) {
                let (one, pose) = self.matched(sight);
                let linear = one.linear(rig, pose)?;
                let weight = linear.weight(scale);
                let weighted = linear.by_point.transpose() * weight;
                by_point += weighted * linear.by_point;
                gradient_point += weighted * linear.residual;
                let pose = sight.pose.checked_sub(fixed).map(|i| 6 * i);
                if let Some(i) = pose {
                    let weighted = linear.by_pose.transpose() * weight;
                    let mut block = hessian.fixed_view_mut::<6, 6>(i, i);
                    block += weighted * linear.by_pose;
                    let mut part = gradient.fixed_rows_mut::<6>(i);
                    part += weighted * linear.residual;
                }
                blocks.push(Block { pose, coupling: linear.by_pose.transpose() * linear.by_point * weight });
            }
            let raised = by_point + Matrix3::from_diagonal(&(by_point.diagonal() * damping));
            points.push((raised.try_inverse()?, gradient_point, blocks));
        }
        for i in 0..size {
            hessian[(i, i)] *= 1.0 + damping;
        }
        for (inverse, gradient_point, blocks) in &points {
            let moving = || blocks.iter().filter_map(|block| Some((block.pose?, &block.coupling)));
            for (i, coupling) in moving() {
                let coupled = coupling * inverse;
                let mut part = gradient.fixed_rows_mut::<6>(i);
                part -= coupled * gradient_point;
                for (j, other) in moving() {
                    let mut block = hessian.fixed_view_mut::<6, 6>(i, j);
                    block -= coupled * other.transpose();
                }
            }
        }
        let step = -hessian.cholesky()?.solve(&gradient);
        self.stepped(fixed, &step, &points)
    }

    fn stepped(
        &self,
        fixed: usize,
        step: &DVector<f64>,
        points: &[(Matrix3<f64>, Vector3<f64>, Vec<Block>)],
    ) -> Option<Self> {
        let of_pose = |i: usize| -> Vector6<f64> { step.fixed_rows::<6>(i).into_owned() };
        let mut next = self.clone();
        for (number, pose) in next.poses.iter_mut().enumerate().skip(fixed) {
            *pose = pose.moved(&of_pose(6 * (number - fixed)));
            pose.check().ok()?;
        }
        for (point, (inverse, gradient, blocks)) in next.points.iter_mut().zip(points) {
            let led: Vector3<f64> =
                blocks.iter().filter_map(|block| Some(block.coupling.transpose() * of_pose(block.pose?))).sum();
            *point -= inverse * (gradient + led);
        }
        Some(next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reprojection::project;
    use elk_geometry::random::Random;

    fn rig() -> Rig {
        Rig::new(450.0, [240.0, 375.0], 0.11).unwrap()
    }

    /// Five pairs on a way of 0.6 m, and what they see of 80 points, with `noise` pixels of error.
    fn scene(noise: f64) -> Bundle {
        let mut random = Random::new(5, 0);
        let pose = |i: usize| {
            Isometry3::new(
                Vector3::new(0.15 * i as f64, 0.02 * i as f64, 0.05),
                Vector3::new(0.0, 0.04 * i as f64, 0.01),
            )
        };
        let poses: Vec<_> = (0..5).map(pose).collect();
        let points: Vec<_> = (0..80)
            .map(|_| Point3::new(random.between(-1.0, 1.6), random.between(-1.0, 1.0), random.between(2.0, 4.0)))
            .collect();
        let mut sights = Vec::new();
        for (number, point) in points.iter().enumerate() {
            for (pose, from) in poses.iter().enumerate() {
                let (a, b) = random.normal_pair();
                let seen = project(&rig(), from, point).unwrap() + Vector3::new(a, b, random.normal_pair().0) * noise;
                // One in three is not seen in the right image.
                let right = ((number + pose) % 3 > 0).then_some(seen.z);
                sights.push(Sight { pose, point: number, seen: Observation { left: [seen.x, seen.y], right } });
            }
        }
        Bundle { poses, points, sights }
    }

    fn off(bundle: &Bundle, truth: &Bundle) -> f64 {
        bundle.poses.iter().zip(&truth.poses).map(|(a, b)| a.step_to(b).norm()).fold(0.0, f64::max)
    }

    #[test]
    fn what_was_moved_goes_back() {
        let truth = scene(0.0);
        let mut moved = truth.clone();
        let mut random = Random::new(9, 0);
        for pose in &mut moved.poses[1..] {
            *pose = pose.moved(&Vector6::from_fn(|_, _| random.between(-0.02, 0.02)));
        }
        moved.points.iter_mut().for_each(|point| point.z += random.between(-0.1, 0.1));
        assert!(off(&moved, &truth) > 0.02);
        moved.adjust(&rig(), 1, 3.0);
        assert!(off(&moved, &truth) < 1e-4, "{}", off(&moved, &truth));
        assert!(moved.points.iter().zip(&truth.points).all(|(a, b)| (a - b).norm() < 1e-3));
        assert_eq!(moved.poses[0], truth.poses[0], "the first stays");
    }

    #[test]
    fn a_step_is_that_of_all_equations_at_once() {
        let mut bundle = scene(0.5);
        bundle.points.truncate(20);
        bundle.sights.retain(|sight| sight.point < 20);
        let (scale, damping, fixed) = (3.0, 0.01, 2);
        // Poses first, then points, in one matrix.
        let poses = bundle.poses.len() - fixed;
        let size = 6 * poses + 3 * bundle.points.len();
        let (mut hessian, mut gradient) = (DMatrix::<f64>::zeros(size, size), DVector::<f64>::zeros(size));
        for sight in &bundle.sights {
            let (one, pose) = bundle.matched(sight);
            let linear = one.linear(&rig(), pose).unwrap();
            let mut slopes = DMatrix::<f64>::zeros(3, size);
            if sight.pose >= fixed {
                slopes.fixed_view_mut::<3, 6>(0, 6 * (sight.pose - fixed)).copy_from(&linear.by_pose);
            }
            slopes.fixed_view_mut::<3, 3>(0, 6 * poses + 3 * sight.point).copy_from(&linear.by_point);
            hessian += slopes.transpose() * &slopes * linear.weight(scale);
            gradient += slopes.transpose() * linear.residual * linear.weight(scale);
        }
        for i in 0..size {
            hessian[(i, i)] *= 1.0 + damping;
        }
        let step = -hessian.cholesky().unwrap().solve(&gradient);
        let next = bundle.step(&rig(), fixed, scale, damping).unwrap();
        for (i, pose) in next.poses.iter().enumerate().skip(fixed) {
            let expected = step.fixed_rows::<6>(6 * (i - fixed)).into_owned();
            assert!((bundle.poses[i].step_to(pose) - expected).norm() < 1e-8, "pose {i}");
        }
        for (i, point) in next.points.iter().enumerate() {
            let expected = step.fixed_rows::<3>(6 * poses + 3 * i).into_owned();
            assert!((point - bundle.points[i] - expected).norm() < 1e-8, "point {i}");
        }
    }

    #[test]
    fn nothing_moves_where_all_or_nothing_is_fixed() {
        for fixed in [0, 5] {
            let mut bundle = scene(0.5);
            bundle.adjust(&rig(), fixed, 3.0);
            assert_eq!(bundle.points, scene(0.5).points);
        }
    }
}
