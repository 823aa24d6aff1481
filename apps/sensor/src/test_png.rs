//! PNGs that tests read.

use png::{BitDepth, ColorType};

/// A PNG of 4 × 2 pixels, as bytes of a file.
pub(crate) fn png(colour: ColorType, depth: BitDepth, bytes: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, 4, 2);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
    file
}
