//! Plays a log back: onto the bus as it was recorded, or into live apps, to see whether they do the same again.
//!
//! | module | one idea |
//! |---|---|
//! | [`schedule`] | when to say what was said; no clock, no sleep |
//! | [`tape`] | what is played: elk's logs, and MOOS' |
//! | [`player`] | a tape onto a community, with pauses and jumps |
//! | [`keyboard`], [`lateness`] | what a person presses; how late messages were |
//! | [`mod@reproduce`], `live` | recorded input through live apps; these apps as threads |

pub mod error;
pub mod keyboard;
pub mod lateness;
mod live;
pub mod player;
pub mod reproduce;
pub mod schedule;
mod table;
pub mod tape;

pub use error::ReplayError;
pub use player::{Console, PlayOptions, Played, Player, Press, Progress};
pub use reproduce::{ReproduceOptions, Reproduced, StreamCount, reproduce};
pub use schedule::Rate;
pub use tape::Tape;
