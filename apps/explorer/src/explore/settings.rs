//! What an explorer is told.

use elk_geometry::Bounds;
use elk_geometry::clearance::Clearance;

use crate::policy::Policy;

/// What an explorer is told besides its strategy.
#[derive(Debug, Clone)]
pub struct Settings {
    /// How paths are followed and where scans are taken.
    pub policy: Policy,
    /// The volume to explore; `None`: all there is.
    pub bounds: Option<Bounds>,
    /// Probability below which an occupied voxel is looked at again, as the map is told; `None`: none is.
    pub confidence: Option<f64>,
    /// Whether the robot stays at the height at which it is, and explores the slice of the map there.
    pub planar: bool,
    /// Radius of a sphere around the robot's body (m).
    pub radius_m: f64,
    /// The same among the voxels of the map.
    pub clearance: Clearance,
    /// Clusters of fewer frontier voxels than this do not count.
    pub min_frontier: usize,
    /// Distinct places from which a frontier voxel is looked at before it is given up.
    pub attempts: usize,
    /// A run of more scans than this has failed.
    pub max_scans: u64,
    /// A run that learns nothing new in this many scans has failed, and so has one with as many refused paths.
    pub patience: u64,
    /// Seconds of CPU that the thread has used.
    pub clock: fn() -> f64,
    /// Whether the process is asked to stop: a plan that is being made is then given up, and means nothing.
    pub is_to_stop: fn() -> bool,
}
