//! What a process of a community asks of its operating system.
//!
//! | module | one idea |
//! |---|---|
//! | [`clock`] | the one clock |
//! | [`stop`] | signals that ask a process to stop |
//! | [`child`] | what a process inherits, and how it ended |
//! | [`process_id`], [`process_stat`] | which process is meant, and what the system says of it |
//! | [`owner`] | whose a process is |
//! | [`limits`] | limits that are low by habit |
//! | [`words`] | what processes say to people |

pub mod child;
pub mod clock;
pub mod limits;
pub mod owner;
pub mod process_id;
pub mod process_stat;
pub mod stop;
pub mod words;

pub use owner::{Owner, own_user};
pub use process_id::ProcessId;
pub use process_stat::ProcessStat;
pub use words::{Overheard, tell};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
