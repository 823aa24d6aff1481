//! What the mission says of itself on the bus, and the thread that hears it.

pub(crate) mod listener;
pub(crate) mod observer;
pub(crate) mod steps;

/// The launcher's own name on the bus.
pub(crate) const NAME: &str = "launcher";
