//! The bus.
mod key;

pub use key::{Key, Payload, fnv1a};
