//! A bulk value.

use elk_bus::Key;

/// A payload of any size.
#[elk_bus::payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Blob {
    /// Which one it is.
    pub number: u64,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

pub const BLOB: Key<Blob> = Key::new("BLOB");

pub fn blob(number: u64, len: usize) -> Blob {
    Blob { number, bytes: (0..len).map(|i| (i as u64 * 31 + number) as u8).collect() }
}
