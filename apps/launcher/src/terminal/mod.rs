//! The launcher's terminal: keys that are pressed, what is shown, and giving the terminal back.

pub(crate) mod detach;
pub(crate) mod keyboard;
pub(crate) mod progress;
