//! MOOS' own TCP clients: what they say, what that means to the broker, and the sockets that they say it over.
//!
//! A client that is linked against core-moos connects here as to a MOOSDB. The protocol is MOOS' of version 10, from a
//! specification; nothing of MOOS' code is in it.
//!
//! | module | one idea |
//! |---|---|
//! | [`message`], [`packet`], [`hello`] | the protocol: a message, a stream of packets, the handshake; bytes in, bytes out |
//! | [`outgoing`] | packets on their way to a client, whose long values stay where they lie |
//! | [`text`] | typed values as MOOS writes them, `Key=Value`, and back |
//! | [`session`] | a client that was let in: what it says becomes frames for the broker, and its mail packets |
//! | [`gateway`] | the sockets, beside the broker's other transport and in its process |
//! | [`client`] | a small client of our own, for tests and benchmarks |

pub mod client;
pub mod gateway;
pub mod hello;
pub mod message;
pub mod outgoing;
pub mod packet;
pub mod session;
pub mod text;

#[cfg(test)]
mod tests;
