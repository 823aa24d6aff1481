//! Laplace's equation on the voxels of a map, and the streamlines of its solution: smooth ways from where a robot is to where
//! it wants to be that keep away from everything by themselves. Without a bus.
//!
//! [`problem`] says what each voxel of a region is, [`laplace`] solves for ψ, [`streamline`] follows −∇ψ; a [`domain`] is kept
//! while what it is of changes, and [`isovolume`] leaves out of it what nothing flows in. Sections and
//! equations are those of the thesis that this reproduces, where they are named so.
//!
//! ```
#![doc = include_str!("../examples/corner.rs")]
//! ```

pub mod domain;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod isovolume;
pub mod laplace;
mod patch;
pub mod problem;
pub mod streamline;

pub use domain::{Convergence, Domain};
pub use isovolume::{Bound, Isovolumes};
pub use laplace::{Solution, Solver, solve, solve_unless};
pub use problem::{Cell, Problem, ProblemError};
pub use streamline::{Field, Streamline, Termination};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
