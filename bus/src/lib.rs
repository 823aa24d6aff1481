//! The bus.
mod app;
mod key;

pub use app::{App, AppError, Comms, Mail};
pub use key::{Key, Payload, fnv1a};
