//! OctoMap's files.

pub mod bt;
