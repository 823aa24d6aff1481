//! Depths of PNG files.

use std::io::Cursor;

use elk_spatial::checks::MAX_POINTS;
use png::{BitDepth, ColorType, Decoder, DecodingError, Limits, Transformations};

/// Why the bytes of a file are no image of depths.
#[derive(Debug, thiserror::Error)]
pub enum DepthImageError {
    /// They are no PNG, or it ends early or is damaged.
    #[error("it cannot be read as a PNG ({0}): a whole PNG of 16 bits grey would be right")]
    Png(#[from] DecodingError),
    /// Its pixels are no depths.
    #[error("it is {found}: 16 bits grey would be right, the depths and not the colours")]
    Kind {
        /// What it has in place of depths.
        found: String,
    },
    /// It has more pixels than a scan has points.
    #[error("it is of {width} × {height} pixels: at most {MAX_POINTS} would be right")]
    Size {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
}

/// Counts of depth, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DepthImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// A count a pixel.
    pub depths: Vec<u16>,
}

/// The image in the bytes of a PNG file of 16 bits grey.
pub(super) fn depth_image(bytes: &[u8]) -> Result<DepthImage, DepthImageError> {
    // Two bytes a pixel.
    let limits = Limits { bytes: 2 * MAX_POINTS };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(Transformations::IDENTITY);
    let info = decoder.read_header_info()?;
    let (width, height) = (info.width, info.height);
    if (info.color_type, info.bit_depth) != (ColorType::Grayscale, BitDepth::Sixteen) {
        let colour = match info.color_type {
            ColorType::Grayscale => "grey",
            ColorType::GrayscaleAlpha => "grey with a transparency",
            ColorType::Indexed => "of a palette's colours",
            ColorType::Rgb | ColorType::Rgba => "in colour",
        };
        return Err(DepthImageError::Kind { found: format!("{colour}, {} bits", info.bit_depth as u8) });
    }
    if u64::from(width) * u64::from(height) > MAX_POINTS as u64 {
        return Err(DepthImageError::Size { width, height });
    }
    let mut reader = decoder.read_info()?;
    let mut buffer = vec![0; reader.output_buffer_size()];
    reader.next_frame(&mut buffer)?;
    let depths = buffer.as_chunks::<2>().0.iter().map(|&bytes| u16::from_be_bytes(bytes)).collect();
    Ok(DepthImage { width: width as usize, height: height as usize, depths })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_png::png;

    #[test]
    fn depths_are_read_and_other_pictures_said_to_be_what_they_are() {
        let bytes: Vec<u8> = (0..8u16).flat_map(|count| (count * 1000).to_be_bytes()).collect();
        let file = png(ColorType::Grayscale, BitDepth::Sixteen, &bytes);
        let image = depth_image(&file).unwrap();
        assert_eq!((image.width, image.height, image.depths[7]), (4, 2, 7000));
        let said = |bytes: &[u8]| depth_image(bytes).unwrap_err().to_string();
        assert!(said(&png(ColorType::Rgb, BitDepth::Eight, &[0; 24])).starts_with("it is in colour, 8 bits: 16 bits"));
        assert!(said(&png(ColorType::Grayscale, BitDepth::Eight, &[0; 8])).starts_with("it is grey, 8 bits: 16 bits"));
        for length in 0..file.len() - 12 {
            assert!(said(&file[..length]).contains("a whole PNG of 16 bits grey would be right"), "{length}");
        }
        let mut vast = file.clone();
        vast[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
        assert!(depth_image(&vast).is_err(), "a header is not believed");
    }
}
