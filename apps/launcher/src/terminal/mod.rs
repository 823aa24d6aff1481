//! The person in front of the launcher: what they press, what they are shown, and the terminal that they get back.

pub(crate) mod detach;
pub(crate) mod person;
pub(crate) mod progress;
