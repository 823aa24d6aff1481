//! What the fuzz target of pages drives: a client's page with any bytes in it, as the broker reads it. Hidden from the
//! documentation; no program calls it.

use elk_proto::wire;

use super::lane::DEPTH;
use super::page::{ClientPage, Page};
use super::shared::SMALL;

/// Lays `bytes` over a client's page and reads what the broker reads there; answers how many bytes of frames it found.
///
/// # Panics
/// What it reads reaches beyond its place.
pub fn read_page(bytes: &[u8]) -> usize {
    let Ok(page) = Page::<ClientPage>::create("elk-fuzz") else { return 0 };
    let bytes = &bytes[..bytes.len().min(size_of::<ClientPage>())];
    if rustix::io::pwrite(page.file(), bytes, 0).is_err() {
        return 0;
    }
    if page.fault().is_none() {
        assert!(page.on_the_way_up() <= DEPTH && page.on_the_way_down() <= DEPTH);
    }
    let slots = [&page.up, &page.down];
    let batches = slots.into_iter().flat_map(|slots| (0..2 * DEPTH).filter_map(|number| slots.get(number)));
    batches
        .map(|batch| {
            assert!(batch.len() <= SMALL);
            wire::frames(batch).map_while(Result::ok).map(|frame| frame.bytes.len()).sum::<usize>()
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_of_any_bytes_is_read_within_its_bounds() {
        assert_eq!(read_page(&[]), 0);
        for byte in [0, 1, 127, 255] {
            read_page(&vec![byte; size_of::<ClientPage>() + 9]);
        }
    }
}
