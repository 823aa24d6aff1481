//! Bytes that look like a type's, and cannot be true.

use elk_spatial::samples::Sample;

/// Numbers that hardly any field may take, of eight and of four bytes.
fn words() -> impl Iterator<Item = Vec<u8>> {
    let eight = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, -1.0, 0.0].map(f64::to_bits);
    let eight = eight.into_iter().chain([u64::MAX, 1 << 63, 1 << 48, (1 << 47) - 1, 1_000_000]);
    let four = [f32::NAN, f32::INFINITY, -1e30].map(f32::to_bits);
    let four = four.into_iter().chain([i32::MIN as u32, i32::MAX as u32, u32::MAX]);
    eight.map(|word| word.to_le_bytes().to_vec()).chain(four.map(|word| word.to_le_bytes().to_vec()))
}

/// The sample of a type with one of these words at a place of its bytes, and cut off there; at each place in turn.
pub fn spoilt(sample: &Sample) -> impl Iterator<Item = Vec<u8>> + use<> {
    let bytes = sample.bytes();
    (0..bytes.len()).flat_map(move |at| {
        let whole = bytes.clone();
        let written = words().filter_map(move |word| {
            let mut spoilt = whole.clone();
            spoilt.get_mut(at..at + word.len())?.copy_from_slice(&word);
            Some(spoilt)
        });
        std::iter::once(bytes[..at].to_vec()).chain(written)
    })
}
