//! An odometry whose drift is taken out by where its scans lie on those before, as the front ends of laser SLAM do.

use elk_geometry::Pose;
use elk_registration::{Cloud, ConfigError, Icp, IcpConfig, Map, Pose as _, Resolution};
use nalgebra::{Isometry3, Matrix6, Vector6};

use super::drift::Drift;
use super::estimate::{Located, PoseEstimator};
use crate::frame::Frame;

/// How scans are laid on those before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapMatchingSettings {
    /// Edge of the finest voxels of the map (m).
    pub voxel: f64,
    /// By how much the odometry errs that is made better.
    pub drift: Drift,
}

/// Sizes of voxels: the coarsest has eight times the edge, so that what is seen at some distance is found though the guess is turned by a few degrees.
const LEVELS: usize = 4;
/// A scan is added to the map after so much way (m), or such a turn (rad).
const STEP: f64 = 0.1;
const TURN: f64 = 0.1;
/// Nothing is forgotten.
const WINDOW: u64 = u64::MAX;
/// What points of one scan have in common, and do not average away: standard deviations of where it lies (m) and how it is turned (rad).
const COMMON: [f64; 2] = [0.01, 0.004];
/// A motion is not known better than this, however short (m and rad).
const LEAST: f64 = 1e-4;
/// A pose that is farther from the guess than it can be by chance is another one that looks alike (χ² of six degrees of freedom, 99.9 %).
const GATE: f64 = 22.46;

/// An odometry, corrected by scans: the one's motions and the others' poses in a map, each in as far as it is the surer (a Kalman filter whose
/// state is the pose, as a small change that [`elk_registration::Pose::moved`] takes; Thrun, Burgard and Fox, *Probabilistic Robotics*, 3.3 and 7.4). Along
/// directions of which a scan says nothing the odometry's word stands. The map is that of all scans at the poses that were said.
pub struct MapMatching {
    odometry: Box<dyn PoseEstimator>,
    drift: Drift,
    icp: Icp,
    map: Map<3>,
    /// The covariance of the pose in the map, as of a small change.
    covariance: Matrix6<f64>,
    /// Where the last frame was taken, as the odometry says and as corrected.
    last: Option<(Isometry3<f64>, Isometry3<f64>)>,
    /// Where a scan was last added to the map.
    added: Option<Isometry3<f64>>,
}

impl MapMatching {
    /// Of an odometry that has seen nothing.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn new(odometry: Box<dyn PoseEstimator>, settings: &MapMatchingSettings) -> Result<Self, ConfigError> {
        let map = Map::new(Resolution::new(settings.voxel, LEVELS)?);
        let icp = Icp::new(IcpConfig::default())?;
        Ok(Self { odometry, drift: settings.drift, icp, map, covariance: Matrix6::zeros(), last: None, added: None })
    }

    /// Where the odometry's motion leads from the last pose, by which the pose becomes less sure.
    fn predict(&mut self, said: &Isometry3<f64>) -> Isometry3<f64> {
        let Some((last, corrected)) = self.last else { return *said };
        let motion = last.inverse() * said;
        let way = self.drift.way * motion.translation.vector.norm() + LEAST;
        let turn = self.drift.turn * motion.rotation.angle() + LEAST;
        self.covariance += diagonal(way, turn);
        let mut guess = corrected * motion;
        guess.rotation.renormalize();
        guess
    }

    /// The pose in the map that a cloud says near a guess, and how much of the cloud lies on surfaces; none where it says none.
    fn update(&mut self, guess: &Isometry3<f64>, cloud: &Cloud<3>) -> Option<(Isometry3<f64>, f64)> {
        let found = self.icp.register(&self.map, cloud, guess).ok()?;
        let off = guess.step_to(&found.pose);
        // (Λ⁻¹ + F)⁻¹ for the information Λ, which need not have an inverse, and what points have in common, F.
        let common = diagonal(COMMON[0], COMMON[1]);
        let information = found.information * (Matrix6::identity() + common * found.information).try_inverse()?;
        let prior = self.covariance.try_inverse()?;
        let posterior = (prior + information).try_inverse()?;
        // offᵀ (P + R)⁻¹ off, by P⁻¹ − P⁻¹ (P⁻¹ + R⁻¹)⁻¹ P⁻¹.
        let unlikely = off.dot(&((prior - prior * posterior * prior) * off));
        if unlikely > GATE || unlikely.is_nan() {
            return None;
        }
        self.covariance = (posterior + posterior.transpose()) / 2.0;
        let step: Vector6<f64> = posterior * information * off;
        Some((guess.moved(&step), found.health.overlap()))
    }

    /// Adds a cloud to the map where that has gone far enough.
    fn add(&mut self, cloud: &Cloud<3>, pose: &Isometry3<f64>) {
        let is_far = self.added.is_none_or(|added| {
            let since = added.inverse() * pose;
            since.translation.vector.norm() >= STEP || since.rotation.angle() >= TURN
        });
        // A pose that cannot be one was said by the odometry, and is refused by whoever reads it.
        if is_far && self.map.insert(cloud, pose, WINDOW).is_ok() {
            self.added = Some(*pose);
        }
    }
}

impl PoseEstimator for MapMatching {
    fn locate(&mut self, frame: &Frame) -> Located {
        let (said, covariance, share) = match self.odometry.locate(frame) {
            Located::At(said, covariance, share) => (said.0, covariance, share),
            other => return other,
        };
        let guess = self.predict(&said);
        let Ok(cloud) = Cloud::new(&frame.points, self.map.resolution()) else {
            self.last = Some((said, guess));
            return Located::At(Pose(guess), covariance, share);
        };
        let (pose, share) = self.update(&guess, &cloud).unwrap_or((guess, share));
        self.add(&cloud, &pose);
        self.last = Some((said, pose));
        Located::At(Pose(pose), self.covariance.transpose().iter().copied().collect(), share)
    }

    fn goes_by_points(&self) -> bool {
        true
    }
}

/// The covariance of a small change of a pose: standard deviations along each axis (m) and about it (rad).
fn diagonal(way: f64, turn: f64) -> Matrix6<f64> {
    let [way, turn] = [way, turn].map(|sigma| sigma * sigma);
    Matrix6::from_diagonal(&Vector6::new(way, way, way, turn, turn, turn))
}
