//! Scan by scan: each registered to the local map of those before.

use nalgebra::Point;

use crate::cloud::{Cloud, CloudError};
use crate::estimate::{Estimate, Lost};
use crate::icp::{Icp, IcpConfig};
use crate::map::Map;
use crate::pose::{Pose, PoseError};
use crate::resolution::{ConfigError, Resolution, range};

/// What a [`Tracker`] goes by.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackerConfig {
    /// Voxels of scans and map.
    pub resolution: Resolution,
    /// How a scan is registered.
    pub icp: IcpConfig,
    /// A scan is added to the map when the sensor has gone so far since the last that was, metres.
    pub step: f64,
    /// … or has turned so far, radians.
    pub turn: f64,
    /// What the last so many scans that were added have not seen is forgotten.
    pub window: u64,
    /// After so many lost scans in a row the map begins anew where the sensor is supposed to be; `None`: never, all scans to come are looked for
    /// in the map that there is.
    pub patience: Option<u64>,
}

/// What became of a scan.
#[derive(Clone, Debug, PartialEq)]
pub enum Tracked<P, const N: usize> {
    /// The map begins with it: it is the first, taken where the tracker was told to start, or those before were lost, and it is where the sensor is
    /// supposed to be. Then nobody knows where all poses from here on are to those before.
    Started,
    /// It was registered.
    Found(Estimate<P, N>),
    /// Nobody knows where it was taken. The map stays as it is, and the next scans are looked for in it.
    Lost(Lost),
}

/// Estimates a sensor's pose from its scans alone, or beginning from an odometry's motion (thesis 2.2.2). It drifts as any odometry does: the map
/// goes as far back as its window, and nothing recognises a place.
#[derive(Clone, Debug)]
pub struct Tracker<P, const D: usize, const N: usize> {
    config: TrackerConfig,
    icp: Icp,
    map: Map<D>,
    /// The last pose that was found, moved on by what has been guessed since.
    pose: P,
    /// The last motion that was found.
    motion: P,
    /// Where the last scan was added to the map.
    added: P,
    /// How many scans were lost since one was found.
    lost: u64,
}

impl<P: Pose<D, N>, const D: usize, const N: usize> Tracker<P, D, N> {
    /// One that has seen nothing, whose first scan is taken at `start`.
    ///
    /// # Errors
    /// Numbers out of range.
    pub fn new(config: TrackerConfig, start: P) -> Result<Self, TrackerError> {
        range("step", config.step, 0.0, 1000.0)?;
        range("turn", config.turn, 0.0, 4.0)?;
        range("window", config.window as f64, 1.0, 1e9)?;
        config.patience.map_or(Ok(()), |patience| range("patience", patience as f64, 1.0, 1e9))?;
        start.check()?;
        let icp = Icp::new(config.icp.clone())?;
        let map = Map::new(config.resolution);
        Ok(Self { config, icp, map, pose: start, motion: P::identity(), added: start, lost: 0 })
    }

    /// What it registers against.
    pub fn map(&self) -> &Map<D> {
        &self.map
    }

    /// Where the sensor is supposed to be: the last pose that was found, moved on by what was guessed since.
    pub fn supposed(&self) -> &P {
        &self.pose
    }

    /// Takes the next scan: points in the sensor's frame, metres. `motion` is how the sensor has moved since the last scan, as it saw itself (pose_last⁻¹
    /// · pose_now), of an odometry; without it, it is supposed to move as it did before.
    ///
    /// # Errors
    /// Points that are no scan. It is as if there had been none.
    pub fn track(&mut self, points: &[Point<f32, D>], motion: Option<P>) -> Result<Tracked<P, N>, CloudError> {
        let cloud = Cloud::new(points, self.config.resolution)?;
        let guess = self.pose * motion.unwrap_or(self.motion);
        if self.map.is_empty() {
            return Ok(self.start(&cloud));
        }
        match self.icp.register(&self.map, &cloud, &guess) {
            Ok(estimate) => Ok(self.found(&cloud, estimate)),
            Err(lost) => {
                // A motion that an odometry says goes on; one that was supposed does not.
                self.pose = if motion.is_some() && guess.check().is_ok() { guess } else { self.pose };
                self.motion = P::identity();
                self.lost += 1;
                if self.config.patience.is_some_and(|patience| self.lost > patience) {
                    self.map = Map::new(self.config.resolution);
                    return Ok(self.start(&cloud));
                }
                Ok(Tracked::Lost(lost))
            }
        }
    }

    fn start(&mut self, cloud: &Cloud<D>) -> Tracked<P, N> {
        self.lost = 0;
        match self.add(cloud) {
            Ok(()) => Tracked::Started,
            Err(error) => Tracked::Lost(error.into()),
        }
    }

    fn found(&mut self, cloud: &Cloud<D>, estimate: Estimate<P, N>) -> Tracked<P, N> {
        self.lost = 0;
        self.motion = self.pose.inverse() * estimate.pose;
        self.pose = estimate.pose;
        let since = self.added.inverse() * self.pose;
        if since.position().norm() >= self.config.step || since.angle() >= self.config.turn {
            // A pose that was found is one.
            if let Err(error) = self.add(cloud) {
                return Tracked::Lost(error.into());
            }
        }
        Tracked::Found(estimate)
    }

    fn add(&mut self, cloud: &Cloud<D>) -> Result<(), PoseError> {
        self.map.insert(cloud, &self.pose, self.config.window)?;
        self.added = self.pose;
        Ok(())
    }
}

/// Why there is no tracker.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TrackerError {
    /// A setting that cannot be.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A start that is no pose.
    #[error(transparent)]
    Start(#[from] PoseError),
}
