//! The map as a process: scans in, what they changed out. The map itself is [`elk_map`]'s and knows of no bus.
//!
//! [`app`] is the process, `keyframes` how it says the whole map in parts, `recovery` how it goes on from a predecessor, `memory`
//! what it leaves to a successor, `saved` the file that it begins with or ends in.

pub mod app;
mod keyframes;
mod memory;
mod recovery;
mod saved;

pub use app::TYPES;
