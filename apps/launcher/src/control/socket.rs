//! The socket of a community's launcher: its name, and how much is said through it.

use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixStream};

use elk_bus::{Community, Owner};

/// The longest question (bytes).
pub(super) const MAX_QUESTION: usize = 64 << 10;
/// The longest answer (bytes).
pub(super) const MAX_ANSWER: u64 = 16 << 20;

pub(super) fn name(community: &Community) -> String {
    format!("elk-launcher/{community}")
}

pub(super) fn address(community: &Community) -> std::io::Result<SocketAddr> {
    SocketAddr::from_abstract_name(name(community))
}

/// Who is at the other end, as the kernel knows it.
pub(super) fn peer(stream: &UnixStream) -> std::io::Result<Owner> {
    let found = rustix::net::sockopt::socket_peercred(stream)?;
    Ok(Owner { process: found.pid.as_raw_nonzero().get().cast_unsigned(), user: found.uid.as_raw() })
}

pub(super) fn own_user() -> u32 {
    rustix::process::geteuid().as_raw()
}
