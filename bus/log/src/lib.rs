//! A recorded run: what crossed the bus, as MCAP, written and read.
//!
//! [MCAP](https://mcap.dev/spec) is the container that robotics tools open as it is. A log holds one channel for each
//! key, source, community, epoch and type of value; numbers and texts are JSON with a schema, so that viewers plot and
//! show them, spatial values are Foxglove's protobuf messages, which viewers draw, and what only its writer knows lies as
//! it is in a message of its own (the modules `encoding` and `spatial` give the layouts). Every message decodes to exactly what was sent.
//!
//! The file grows chunk by chunk: what a [`LogWriter`] has flushed stays readable whatever happens to the writer, and a
//! [`LogReader`] gives all of it, then says whether the file has an end.
//!
//! | module | one idea |
//! |---|---|
//! | `writer`, `staging`, `again` | a log that grows, over a disk that may be full; its channels said again |
//! | `reader`, `segment` | a run's records; one file's messages |
//! | `container`, `chunk` | one file's bytes, whole or not, honest or not; what is packed |
//! | `salvage`, `resync`, `flip` | what can be had of a damaged file; what is a record in it; a flipped bit found |
//! | `summary`, `footer`, `head` | what a file's end says; its last record; what stands before each record |
//! | [`segments()`] | which files are one run's log |
//! | [`index`], `extras` | what is in a log, and where, without reading it; what stands beside the messages |
//! | [`selection`], [`mod@copy`], [`mod@check`], [`mod@diff`] | a part of a log; a log mended or shortened; is it whole; two logs compared |
//! | [`alog`], [`csv`] | MOOS' own text logs, out and in; numbers for spreadsheets |
//! | `foreign`, `plain` | what other tools have written into a log; JSON that is a number or a text |
//! | [`shown`] | the same messages for viewers of a run that goes on |
//! | `encoding`, `channel`, `schema`, `spatial`, `foxglove`, `protobuf` | how a message lies in a file |

mod again;
pub mod alog;
mod channel;
pub mod check;
mod chunk;
mod container;
pub mod copy;
pub mod csv;
mod damage;
pub mod diff;
mod encoding;
mod error;
mod extras;
mod flip;
mod footer;
mod foreign;
mod foxglove;
#[doc(hidden)]
pub mod fuzzing;
mod head;
pub mod index;
mod plain;
mod protobuf;
mod reader;
mod record;
mod resync;
mod said;
mod salvage;
mod scene;
mod schema;
mod segment;
mod segments;
pub mod selection;
pub mod shown;
mod spatial;
mod staging;
mod summary;
mod writer;

pub use error::LogError;
pub use index::{Index, Topic};
pub use reader::LogReader;
pub use record::{Metadata, Reception, Record, RecordRef};
pub use segments::{is_written, segments};
pub use selection::Selection;
pub use writer::{Compression, LogOptions, LogWriter, MAX_STAGED_BYTES};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
