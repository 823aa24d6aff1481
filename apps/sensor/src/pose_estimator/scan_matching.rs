//! Scan matching: where a scan lies on those before it (thesis 2.2.2).

use elk_geometry::Pose;
use elk_registration::{IcpConfig, Resolution, Tracked, Tracker, TrackerConfig, TrackerError, pose::Pose as Rigid};
use nalgebra::{Isometry2, Isometry3, Point2, Point3, Vector2};

use super::estimate::{AGREED, Located, PoseEstimator};
use crate::frame::Frame;

/// How scans are matched (see [`TrackerConfig`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IcpSettings {
    /// Edge of the finest voxel, of which there are three sizes (m).
    pub voxel: f64,
    /// A scan is added to the local map after so much way (m).
    pub step: f64,
    /// … or such a turn (rad).
    pub turn: f64,
    /// What the last so many added scans have not seen is forgotten.
    pub window: u64,
}

/// Where a scan lies on those before it, in space. The first is where the recording says, or at the origin.
pub struct ScanMatching(Matching<Isometry3<f64>, 3, 6>);

/// The same in the plane, of a sensor that stays level; beginning from the motion that wheels say.
pub struct LevelMatching {
    matching: Matching<Isometry2<f64>, 2, 3>,
    /// Where the sensor's plane is (m, world z).
    height: f64,
    /// The odometry of the last frame that the tracker has had.
    odometry: Option<Isometry2<f64>>,
}

/// A tracker that begins with the first frame.
struct Matching<P, const D: usize, const N: usize> {
    config: TrackerConfig,
    tracker: Option<Tracker<P, D, N>>,
}

impl ScanMatching {
    /// Of no scan yet.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn new(settings: &IcpSettings) -> Result<Self, TrackerError> {
        Ok(Self(Matching::new(settings)?))
    }
}

impl PoseEstimator for ScanMatching {
    fn locate(&mut self, frame: &Frame) -> Located {
        let start = frame.pose.as_ref().map_or(Isometry3::identity(), |pose| pose.0);
        self.0.locate(&frame.points, start, None, Pose)
    }
}

impl LevelMatching {
    /// Of no scan yet, of a sensor at this height (m, world z).
    ///
    /// # Errors
    /// Settings out of range.
    pub fn new(settings: &IcpSettings, height: f64) -> Result<Self, TrackerError> {
        Ok(Self { matching: Matching::new(settings)?, height, odometry: None })
    }
}

impl PoseEstimator for LevelMatching {
    fn locate(&mut self, frame: &Frame) -> Located {
        let points: Vec<_> = frame.points.iter().map(level).collect();
        let start = frame.pose.as_ref().map_or(Isometry2::identity(), in_plane);
        let motion = self.odometry.zip(frame.odometry).map(|(last, now)| last.inverse() * now);
        let height = self.height;
        let located = self.matching.locate(&points, start, motion, |pose| in_space(&pose, height));
        if !matches!(located, Located::Bad(_)) {
            self.odometry = frame.odometry;
        }
        located
    }
}

/// A point of the camera frame in the plane: x ahead, y to the left.
fn level(point: &Point3<f32>) -> Point2<f32> {
    Point2::new(point.z, -point.x)
}

fn in_plane(pose: &Pose) -> Isometry2<f64> {
    let position = pose.position();
    Isometry2::new(Vector2::new(position.x, position.y), pose.yaw())
}

/// The pose of a sensor that stays level at `height` (m).
pub(crate) fn in_space(pose: &Isometry2<f64>, height: f64) -> Pose {
    let place = pose.translation.vector;
    Pose::from_yaw_pitch(Point3::new(place.x, place.y, height), pose.rotation.angle(), 0.0)
}

impl<P: Rigid<D, N>, const D: usize, const N: usize> Matching<P, D, N> {
    fn new(settings: &IcpSettings) -> Result<Self, TrackerError> {
        let IcpSettings { voxel, step, turn, window } = *settings;
        let resolution = Resolution::new(voxel, 3)?;
        // A map that begins anew is somewhere that nobody knows.
        let patience = None;
        let config = TrackerConfig { resolution, icp: IcpConfig::default(), step, turn, window, patience };
        // What is wrong with settings is said before there is a frame.
        Tracker::new(config.clone(), P::identity())?;
        Ok(Self { config, tracker: None })
    }

    fn locate(
        &mut self,
        points: &[nalgebra::Point<f32, D>],
        start: P,
        motion: Option<P>,
        world: impl Fn(P) -> Pose,
    ) -> Located {
        let tracker = match &mut self.tracker {
            Some(tracker) => tracker,
            None => match Tracker::new(self.config.clone(), start) {
                Ok(tracker) => self.tracker.insert(tracker),
                Err(error) => return Located::Bad(error.to_string()),
            },
        };
        match tracker.track(points, motion) {
            Ok(Tracked::Started) => Located::At(world(*tracker.supposed()), Vec::new(), AGREED),
            Ok(Tracked::Found(estimate)) => {
                let covariance = estimate.covariance().map(|all| all.transpose().iter().copied().collect());
                Located::At(world(estimate.pose), covariance.unwrap_or_default(), estimate.health.overlap())
            }
            Ok(Tracked::Lost(why)) => Located::Lost(why.to_string()),
            Err(error) => Located::Bad(error.to_string()),
        }
    }
}
