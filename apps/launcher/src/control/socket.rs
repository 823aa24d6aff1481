//! The socket of a community's launcher: its name, and how much is said through it.

use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::SocketAddr;

use elk_bus::Community;

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
