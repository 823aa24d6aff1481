//! Clients of MOOS' over real sockets, beside clients of elk's over shared memory, before one broker.

#[path = "../common/mod.rs"]
mod common;
mod conformance;
mod conformance_table;
mod handshake;
mod hostile;
mod mail;
mod server;
mod text;
mod warp;
mod wire;
