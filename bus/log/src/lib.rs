//! A recorded run: what crossed the bus, as MCAP, written and read.
//!
//! [MCAP](https://mcap.dev/spec) is the container that robotics tools open as it is. A log holds one channel for each
//! key, source, community and type of value; numbers and texts are JSON with a schema, so that viewers plot and show
//! them, and binary values stay in the bus' own encoding (the module `encoding` gives the layouts). Every message
//! decodes to exactly what was sent.
//!
//! The file grows chunk by chunk: what a [`LogWriter`] has flushed stays readable whatever happens to the writer, and a
//! [`LogReader`] gives all of it, then says whether the file has an end.

mod encoding;
mod error;
mod reader;
mod record;
mod staging;
mod writer;

pub use error::LogError;
pub use reader::LogReader;
pub use record::{Metadata, Record, RecordRef};
pub use writer::{LogWriter, MAX_STAGED_BYTES};
