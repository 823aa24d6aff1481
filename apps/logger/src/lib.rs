//! Records every message of the community into a log.
//!
//! [`Recorder`] keeps a log going over a disk that is full or a folder that is not writable; [`Logger`] is the app that
//! feeds it.

mod app;
mod recorder;

pub use app::{Logger, TYPES};
pub use recorder::Recorder;
