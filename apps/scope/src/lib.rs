//! Looks into a running community: what is said, by whom, how often; and lets a person say something.
//!
//! Every command is a client like any other: it has a bounded mailbox, nobody waits for it, and what it misses it
//! counts and says. Most of them hear no mail at all, they ask the broker for its table
//! ([`elk_bus::broker::table`]).
//!
//! | module | one idea |
//! |---|---|
//! | [`session`] | a client that asks for the table |
//! | [`list`], [`info`], [`mod@graph`], [`mod@communities`] | what the tables say, once |
//! | [`top`] | what changes from one table to the next |
//! | [`echo`] | every message |
//! | [`rates`], [`meter`], [`spread`] | messages counted, not decoded: how often, how much |
//! | [`poke`] | a variable written by a person, checked before |
//! | `quit` | when a command that goes on is to end |
//! | [`show`], [`output`] | values and figures for people and programs; lines, and pages in place |
//! | [`pattern`] | names with wildcards |

pub mod communities;
mod definition;
pub mod echo;
mod error;
pub mod graph;
pub mod info;
pub mod list;
pub mod meter;
pub mod output;
pub mod pattern;
pub mod poke;
mod quit;
pub mod rates;
pub mod session;
pub mod show;
pub mod spread;
pub mod top;

pub use communities::communities;
pub use echo::Echo;
pub use error::{PokeError, ScopeError};
pub use graph::{Drawing, graph};
pub use info::Info;
pub use list::List;
pub use output::{Line, Output, Screen, Table};
pub use pattern::{Pattern, PatternError};
pub use poke::{Poke, Said};
pub use rates::{Quantity, Rates};
pub use session::Scope;
pub use top::Top;

/// Lets everybody else have the processor first: a look into a community must not slow it down.
pub fn yield_to_others() {
    const NICENESS: i32 = 10;
    // Where that is not allowed, the scope is a process like the others.
    let _ = rustix::process::nice(NICENESS);
}

#[cfg(test)]
mod tests;
