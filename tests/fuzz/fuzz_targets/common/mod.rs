//! What the targets that speak the bus' own language have in common.

use elk_bus::wire::{FrameKind, Header, ValueKind};
use libfuzzer_sys::arbitrary::{Arbitrary, Result, Unstructured};

/// A frame's header that is right in itself, of names with numbers from 0 to `most`, which somebody has defined or not.
pub fn header(from: &mut Unstructured<'_>, flags: u16, most: u32) -> Result<Header> {
    use FrameKind::{Attached, Clock, Define, Dropped, Notify, Ready, Refused, Register, Unregister};
    let kinds = [Notify, Notify, Notify, Register, Unregister, Define, Refused, Dropped, Attached, Ready, Clock];
    Ok(Header {
        kind: kinds[from.choose_index(kinds.len())?],
        value_kind: [ValueKind::Double, ValueKind::Text, ValueKind::Binary][from.int_in_range(0..=2)?],
        flags,
        key: from.int_in_range(0..=most)?,
        source: from.int_in_range(0..=most)?,
        type_: from.int_in_range(0..=most)?,
        community: from.int_in_range(0..=3)?,
        sequence: u64::arbitrary(from)?,
        time: f64::arbitrary(from)?,
    })
}
