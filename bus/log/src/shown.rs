//! Messages as a log holds them, for whoever shows a run while it goes on: viewers are told the same of both.

use crate::encoding;
pub use crate::encoding::{Announcement, nanoseconds};
use crate::error::LogError;
use crate::record::RecordRef;

/// Appends a message to `buffer`, as it lies in the channel that [`Announcement::of`] its value announces.
///
/// # Errors
/// The record does not fit into the format.
pub fn encode(record: &RecordRef<'_>, buffer: &mut Vec<u8>) -> Result<(), LogError> {
    let refused =
        |reason: String| LogError::Record { key: record.key.into(), source_name: record.source.into(), reason };
    encoding::encode(record, buffer).map_err(refused)
}
