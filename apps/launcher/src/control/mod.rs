//! Orders to a running mission: one question and its answers over an abstract Unix socket named after the community.
//!
//! Binding the socket's name is what makes a launcher the only one of its community; the kernel frees it with the process.
//! Question and answers are lines of JSON.

mod client;
mod server;
mod words;

use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixStream};

use elk_bus::{Community, Owner};

pub use client::{AskError, ask};
pub(crate) use server::Server;
pub use words::{Answer, AppRow, Request};

/// The longest question (bytes).
const MAX_QUESTION: usize = 64 << 10;
/// The longest answer (bytes).
const MAX_ANSWER: u64 = 16 << 20;

fn name(community: &Community) -> String {
    format!("elk-launcher/{community}")
}

fn address(community: &Community) -> std::io::Result<SocketAddr> {
    SocketAddr::from_abstract_name(name(community))
}

/// Who is at the other end, as the kernel knows it.
fn peer(stream: &UnixStream) -> std::io::Result<Owner> {
    let found = rustix::net::sockopt::socket_peercred(stream)?;
    Ok(Owner { process: found.pid.as_raw_nonzero().get().cast_unsigned(), user: found.uid.as_raw() })
}

fn own_user() -> u32 {
    rustix::process::geteuid().as_raw()
}
