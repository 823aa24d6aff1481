//! Filters over scans: what to leave out before the map sees it.
//!
//! [`filters`] are plain functions over points, [`app`] the process around them.

pub mod app;
pub mod filters;

pub use app::TYPES;
