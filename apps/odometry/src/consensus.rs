//! Which of the points were found, and which are something else.

use elk_geometry::random::Random;
use elk_stereo::Rig;
use nalgebra::{Isometry3, Vector3};

use crate::least_squares;
use crate::reprojection::Match;

/// Poses of three points that are tried at most.
const TRIALS: usize = 200;
/// How sure it has to be that three were tried of which none is wrong.
const SURE: f64 = 0.9999;

/// What most agree on.
#[derive(Clone, Debug)]
pub(crate) struct Consensus {
    pub pose: Isometry3<f64>,
    /// Which of the matches agree, in their order.
    pub inliers: Vec<bool>,
    /// The residuals of those that agree, pixels.
    pub residuals: Vec<Vector3<f64>>,
}

impl Consensus {
    /// The standard deviation of where points are seen, pixels: 1.4826 times the median of amounts, as the tails are no part of it.
    pub fn sigma(&self) -> f64 {
        // The right column of a point that only the left image shows has a residual of 0, and says nothing.
        let amounts = self.residuals.iter().flat_map(|residual| residual.iter().map(|x| x.abs()).collect::<Vec<_>>());
        let mut amounts: Vec<f64> = amounts.filter(|&amount| amount > 0.0).collect();
        amounts.sort_unstable_by(f64::total_cmp);
        1.4826 * amounts.get(amounts.len() / 2).copied().unwrap_or(0.0)
    }

    /// The root mean square of distances in the left image, pixels.
    pub fn rms(&self) -> f64 {
        let squares: f64 = self.residuals.iter().map(|r| r.xy().norm_squared()).sum();
        (squares / self.residuals.len() as f64).sqrt()
    }
}

/// What is to be made of matches near a guess: of poses by all and by three of them each, the one with the least sum of squared residuals, where
/// none counts for more than `tolerance` pixels (Fischler and Bolles, CACM 1981; Torr and Zisserman, CVIU 2000), made better by all that agree
/// with it.
pub(crate) fn consensus(
    rig: &Rig,
    guess: &Isometry3<f64>,
    matches: &[Match],
    tolerance: f64,
    random: &mut Random,
) -> Option<Consensus> {
    let squared =
        |pose: &Isometry3<f64>, one: &Match| one.residual(rig, pose).map_or(f64::INFINITY, |r| r.norm_squared());
    let limit = tolerance.powi(2);
    let score = |pose: &Isometry3<f64>| matches.iter().map(|one| squared(pose, one).min(limit)).sum::<f64>();
    let agreeing = |pose: &Isometry3<f64>| matches.iter().filter(|one| squared(pose, one) < limit).collect::<Vec<_>>();

    let of_all = least_squares::pose(rig, guess, matches.iter(), tolerance);
    let mut best =
        of_all.into_iter().chain([*guess]).map(|pose| (score(&pose), pose)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let mut trials = trials(agreeing(&best.1).len(), matches.len());
    let mut trial = 0;
    while trial < trials {
        trial += 1;
        let three = three(matches, random)?;
        // Nothing is wrong among three that are right: a kernel so wide is none.
        let Some(pose) = least_squares::pose(rig, guess, three.iter(), 1e3 * tolerance) else { continue };
        let score = score(&pose);
        if score < best.0 {
            best = (score, pose);
            trials = self::trials(agreeing(&pose).len(), matches.len());
        }
    }
    let mut pose = best.1;
    for _ in 0..2 {
        let inliers = agreeing(&pose);
        pose = least_squares::pose(rig, &pose, inliers.iter().copied(), tolerance / 3.0)?;
    }
    let inliers: Vec<bool> = matches.iter().map(|one| squared(&pose, one) < limit).collect();
    let residuals: Vec<_> = agreeing(&pose).iter().filter_map(|one| one.residual(rig, &pose)).collect();
    (!residuals.is_empty()).then_some(Consensus { pose, inliers, residuals })
}

/// How many have to be tried when so many of all agree.
fn trials(agree: usize, of: usize) -> usize {
    let all_right = (agree as f64 / of.max(1) as f64).powi(3);
    // Infinitely many where none agree: ln(1 + x) of −0 is −0.
    let trials = (1.0 - SURE).ln() / (-all_right).ln_1p();
    (trials.ceil() as usize).min(TRIALS)
}

/// Three of the matches, drawn by lot; none of fewer.
fn three(matches: &[Match], random: &mut Random) -> Option<[Match; 3]> {
    let count = matches.len();
    if count < 3 {
        return None;
    }
    let first = random.below(count);
    // Each next one is drawn from those that are left.
    let second = (first + 1 + random.below(count - 1)) % count;
    let mut third = random.below(count - 2);
    for taken in [first.min(second), first.max(second)] {
        third += usize::from(third >= taken);
    }
    Some([first, second, third].map(|i| matches[i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reprojection::{Observation, project};
    use elk_registration::Pose as _;
    use nalgebra::Point3;

    #[test]
    fn most_agree_though_many_are_wrong_together() {
        let rig = Rig::new(450.0, [240.0, 375.0], 0.11).unwrap();
        let truth = Isometry3::new(Vector3::new(0.2, 0.0, 0.1), Vector3::new(0.02, -0.03, 0.05));
        let other = Isometry3::new(Vector3::new(-0.3, 0.1, 0.0), Vector3::new(-0.05, 0.03, 0.0));
        let mut random = Random::new(3, 0);
        let matches: Vec<Match> = (0..200)
            .map(|i| {
                let point = Point3::new(random.between(-1.5, 1.5), random.between(-1.0, 1.0), random.between(2.0, 5.0));
                // Two of five move with something else.
                let seen = project(&rig, if i % 5 < 2 { &other } else { &truth }, &point).unwrap();
                Match { point, seen: Observation { left: [seen.x, seen.y], right: Some(seen.z) } }
            })
            .collect();
        let found = consensus(&rig, &Isometry3::identity(), &matches, 1.5, &mut random).unwrap();
        assert!(truth.step_to(&found.pose).norm() < 1e-6, "{}", found.pose);
        assert!((0..200).all(|i| found.inliers[i] == (i % 5 >= 2)));
        assert!(found.sigma() < 1e-6 && found.rms() < 1e-6);
    }

    #[test]
    fn three_are_three() {
        let seen = Observation { left: [0.0, 0.0], right: None };
        let matches: Vec<_> = (0..5).map(|i| Match { point: Point3::new(f64::from(i), 0.0, 0.0), seen }).collect();
        let mut random = Random::new(1, 0);
        let mut drawn = [0; 5];
        for _ in 0..5000 {
            let numbers = three(&matches, &mut random).unwrap().map(|one| one.point.x as usize);
            assert!(numbers[0] != numbers[1] && numbers[1] != numbers[2] && numbers[0] != numbers[2]);
            numbers.iter().for_each(|&i| drawn[i] += 1);
        }
        assert!(drawn.iter().all(|&count| (2800..3200).contains(&count)), "{drawn:?}");
        assert_eq!(three(&matches[..2], &mut random), None);
    }

    #[test]
    fn fewer_are_tried_where_more_agree() {
        assert_eq!([trials(100, 100), trials(50, 100), trials(0, 100), trials(0, 0)], [0, 69, TRIALS, TRIALS]);
    }
}
