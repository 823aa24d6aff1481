//! Clients of MOOS' over real sockets, beside clients of elk's over shared memory, before one broker.

#[path = "../common/mod.rs"]
mod common;
mod conformance;
mod conformance_table;
mod death;
mod handshake;
mod hostile;
mod mail;
mod server;
mod text;
mod warp;

/// Serves a community, if this process was started for that: see [`common::broker_with_moos`].
#[test]
fn broker_process() {
    common::serve_if_asked_to();
}
mod wire;
