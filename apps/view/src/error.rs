//! What can go wrong with a view.

use std::net::SocketAddr;

use elk_log::LogError;

/// Why there is no view.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// Nobody can come there.
    #[error("cannot listen at {address}: {source}; choose another --port or --listen")]
    Listen {
        /// Where.
        address: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
    /// No client of Foxglove's can come there.
    #[error("cannot listen at {address}: {source}; choose another address, for example --foxglove 127.0.0.1:8766")]
    ListenFoxglove {
        /// Where.
        address: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The operating system refused.
    #[error("the view cannot be served: {0}")]
    Io(std::io::Error),
}
