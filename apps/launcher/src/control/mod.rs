//! Orders to a running mission: one question and its answers over an abstract Unix socket named after the community.
//!
//! Binding the socket's name is what makes a launcher the only one of its community; the kernel frees it with the process.
//! Question and answers are lines of JSON.

mod client;
mod server;
mod socket;
mod words;

pub use client::{AskError, ask};
pub(crate) use server::Server;
pub use words::{Answer, AppRow, Order};
