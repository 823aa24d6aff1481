//! Who is to run, who does, and what to do about the difference: a state machine without processes, bus or clock.
//!
//! It is told what happened and when ([`Supervisor::ended`], [`Supervisor::arrived`], …), and answers with what is to be
//! done ([`Action`]). Every broker and app is a [`Unit`]. The process that holds a unit's name on the bus is its *holder*;
//! during a swap there is a *successor*, too, until it has become the holder.

mod machine;
mod order;
mod unit;
mod words;

pub(crate) use machine::{BROKER, STOP_PATIENCE, Supervisor};
pub(crate) use order::stop_order;
pub(crate) use unit::{State, UnitSpec};
pub(crate) use words::{Action, Exit, Role, Ticket, Word};
