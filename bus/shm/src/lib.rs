//! The shared-memory transport: iceoryx2 lanes for the data, one futex word a process for the wake-ups, and a socket
//! for who is there.
//!
//! | what | through | why |
//! |---|---|---|
//! | batches, up and down | an iceoryx2 publish-subscribe service each | lanes belong to clients, so cost grows with clients and not with keys |
//! | bulk values | one iceoryx2 service per client that publishes any | read in place by every receiver; only a reference passes the broker |
//! | wake-ups, flow control | a page of shared atomics (memfd) a client, one for the broker | one system call to wake, none while the other is awake |
//! | names, refusals, death | an abstract Unix socket | the kernel frees the name with its process and tells at once; no file can be left behind |

#[doc(hidden)]
pub mod abstract_socket;
#[cfg(test)]
mod alone;
mod bulk;
mod client;
mod folder;
mod forward;
mod full;
#[doc(hidden)]
pub mod fuzzing;
mod handshake;
mod home;
mod kept;
mod lane;
mod leftovers;
mod lifeline;
mod namespace;
mod page;
mod running;
mod scarce;
mod server;
mod service;
mod sessions;
mod shared;
#[cfg(test)]
#[path = "../../../tests/common/skip.rs"]
mod skip;
mod sync;

pub use client::{ConnectError, connect};
pub use folder::{Fault, FolderError};
pub use kept::{keep, kept};
pub use lifeline::let_go_of_parent;
pub use running::{Running, running};
pub use scarce::remedy;
pub use server::{ServeError, Server};
