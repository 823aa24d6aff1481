//! The pose at which points are where they were seen.

use elk_registration::Pose as _;
use elk_stereo::Rig;
use nalgebra::{Isometry3, Matrix6, Vector6};

use crate::reprojection::Match;

/// Steps until a pose is there; from a guess that is nearly right it takes three.
const ITERATIONS: usize = 10;
/// A pose is there when a step is smaller than this, metres and radians.
const TOLERANCE: f64 = 1e-7;

/// JᵀWJ and JᵀWr.
struct Equations {
    hessian: Matrix6<f64>,
    gradient: Vector6<f64>,
}

impl Equations {
    fn of<'a>(
        rig: &Rig,
        pose: &Isometry3<f64>,
        matches: impl Iterator<Item = &'a Match>,
        weight: impl Fn(&crate::reprojection::Linear) -> f64,
    ) -> Self {
        let mut equations = Self { hessian: Matrix6::zeros(), gradient: Vector6::zeros() };
        for linear in matches.filter_map(|one| one.linear(rig, pose)) {
            let weighted = linear.by_pose.transpose() * weight(&linear);
            equations.hessian += weighted * linear.by_pose;
            equations.gradient += weighted * linear.residual;
        }
        equations
    }
}

/// The pose near `guess` that makes Σ ρ(r) least, r the reprojection errors of three columns each (left column, row, right column; pixels), by
/// Gauss–Newton steps. ρ is Cauchy's, of a scale in pixels. None where the points say too little, or lead away from all of them.
pub(crate) fn pose<'a>(
    rig: &Rig,
    guess: &Isometry3<f64>,
    matches: impl Iterator<Item = &'a Match> + Clone,
    scale: f64,
) -> Option<Isometry3<f64>> {
    let mut pose = *guess;
    for _ in 0..ITERATIONS {
        let equations = Equations::of(rig, &pose, matches.clone(), |linear| linear.weight(scale));
        let step = -equations.hessian.cholesky()?.solve(&equations.gradient);
        pose = pose.moved(&step);
        pose.check().ok()?;
        if step.amax() < TOLERANCE {
            break;
        }
    }
    Some(pose)
}

/// The covariance of a pose at which points were seen with a standard deviation of `sigma` pixels: (JᵀJ)⁻¹ σ², of steps as
/// [`elk_registration::Pose::moved`] takes them (m², m rad, rad²).
pub(crate) fn covariance<'a>(
    rig: &Rig,
    pose: &Isometry3<f64>,
    matches: impl Iterator<Item = &'a Match>,
    sigma: f64,
) -> Option<Matrix6<f64>> {
    let equations = Equations::of(rig, pose, matches, |_| 1.0);
    Some(equations.hessian.cholesky()?.inverse() * sigma.powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reprojection::{Observation, project};
    use elk_geometry::random::Random;
    use nalgebra::{Point3, Vector3};

    fn rig() -> Rig {
        Rig::new(450.0, [240.0, 375.0], 0.11).unwrap()
    }

    /// What cameras at a pose see, each column and row with an error of `noise` pixels; every `wrong`th is somewhere else.
    fn matches(pose: &Isometry3<f64>, noise: f64, wrong: usize, seed: u64) -> Vec<Match> {
        let mut random = Random::new(seed, 0);
        let mut one = |i: usize| {
            let at = Point3::new(random.between(-1.5, 1.5), random.between(-1.0, 1.0), random.between(2.0, 5.0));
            let point = pose * at;
            let ([a, b], [c, d]) = (random.normal_pair().into(), random.normal_pair().into());
            let (mut seen, _): (Vector3<f64>, f64) =
                (project(&rig(), pose, &point).unwrap() + Vector3::new(a, b, c) * noise, d);
            if wrong > 0 && i.is_multiple_of(wrong) {
                seen += Vector3::new(random.between(5.0, 40.0), random.between(5.0, 40.0), 0.0);
            }
            Match {
                point,
                seen: Observation { left: [seen.x, seen.y], right: (!i.is_multiple_of(4)).then_some(seen.z) },
            }
        };
        (0..100).map(&mut one).collect()
    }

    #[test]
    fn the_pose_is_found_from_afar_and_in_spite_of_some() {
        let truth = Isometry3::new(Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.4, -0.2, 1.0));
        let guess = truth * Isometry3::new(Vector3::new(0.1, -0.05, 0.1), Vector3::new(0.05, 0.05, -0.1));
        let exact = matches(&truth, 0.0, 0, 1);
        let found = pose(&rig(), &guess, exact.iter(), 2.0).unwrap();
        assert!(truth.step_to(&found).norm() < 1e-7);
        let some_wrong = matches(&truth, 0.0, 10, 1);
        let found = pose(&rig(), &truth, some_wrong.iter(), 0.5).unwrap();
        assert!(truth.step_to(&found).norm() < 2e-3, "{}", truth.step_to(&found));
        assert_eq!(pose(&rig(), &truth, exact[..1].iter(), 2.0), None, "three numbers do not say six");
    }

    #[test]
    fn the_covariance_is_that_of_what_is_found() {
        let truth = Isometry3::new(Vector3::new(0.5, 0.0, 1.0), Vector3::new(0.1, -0.2, 0.3));
        let mut squared = 0.0;
        for seed in 0..200 {
            let seen = matches(&truth, 0.3, 0, seed);
            let found = pose(&rig(), &truth, seen.iter(), 1e3).unwrap();
            let covariance = covariance(&rig(), &found, seen.iter(), 0.3).unwrap();
            let off = found.step_to(&truth);
            squared += off.dot(&covariance.cholesky().unwrap().solve(&off)) / 200.0;
        }
        // The mean of 200 χ² of six degrees of freedom: 6 ± 0.25.
        assert!((squared - 6.0).abs() < 1.0, "{squared}");
    }
}
