//! One process that inherits nothing and ends for certain, and all that descends from it.
//!
//! | module | one idea |
//! |---|---|
//! | `child` | one app as a process, with its text log |
//! | `descendants` | all that a mission's processes have started: marked, watched, ended with them |
//! | `guard` | what ends the rest when the launcher dies |
//! | `escaped` | processes that apps have started outside of their process groups |
//! | `leftovers` | processes that were to end with a launcher and were not told |
//! | `usage` | what processes use |
//! | `handle` | a process that is meant whoever has its number later |

pub(crate) mod child;
pub(crate) mod descendants;
pub(crate) mod escaped;
pub(crate) mod guard;
pub mod handle;
pub(crate) mod leftovers;
pub(crate) mod usage;
