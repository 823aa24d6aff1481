//! The goals that a strategy weighed, for whoever looks on.

use elk_bus::payload;
use elk_geometry::{Pose, Voxel};
use nalgebra::Point3;

/// The most goals of a plan that are kept: the others are counted.
pub const MOST: usize = 1024;

/// The goals that a strategy weighed for a plan.
#[payload]
#[describe(drawn = "poses")]
#[derive(Debug, Clone, PartialEq)]
pub struct Candidates {
    /// The request that the plan answers.
    #[describe(count)]
    pub request: u64,
    /// The revision of the map.
    #[describe(count)]
    pub revision: u64,
    /// Where the robot is (world).
    pub from: Pose,
    /// Goals that were weighed.
    #[describe(count)]
    pub weighed: u64,
    /// The first of them, in the strategy's order.
    #[describe(longest = MOST)]
    pub goals: Vec<Candidate>,
}

/// A goal, and what it is worth.
#[payload]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Where to look from (m, world).
    #[describe(unit = "m")]
    pub position: Point3<f64>,
    /// The frontier voxel to look at.
    pub target: Voxel,
    /// What the strategy gives it, in the strategy's own unit.
    pub score: f64,
    /// Whether it is the one that the strategy goes to.
    pub chosen: bool,
}
