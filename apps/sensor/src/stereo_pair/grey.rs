//! Grey images of PNG files.

use std::io::Cursor;

use elk_stereo::{Image, ImageError};
use png::{BitDepth, ColorType, Decoder, DecodingError, Limits, Transformations};

/// Bytes that reading a picture may take; all that an [`Image`] may be.
const MOST_BYTES: usize = Image::MAX_SIDE * Image::MAX_SIDE;

/// Why the bytes of a file are no grey image.
#[derive(Debug, thiserror::Error)]
pub enum GreyError {
    /// They are no PNG, or it ends early or is damaged.
    #[error("it cannot be read as a PNG ({0}): a whole PNG of 8 bits grey would be right")]
    Png(#[from] DecodingError),
    /// There is colour in it.
    #[error("it is {found}: grey would be right (ffmpeg -i FILE -pix_fmt gray GREY.png makes it so)")]
    Colour {
        /// What it has in place of grey.
        found: &'static str,
    },
    /// Its grey levels are finer or coarser.
    #[error("it has {bits} bits a pixel: 8 would be right (ffmpeg -i FILE -pix_fmt gray GREY.png makes it so)")]
    Depth {
        /// Bits a pixel.
        bits: u8,
    },
    /// It is too large, or empty.
    #[error(transparent)]
    Image(#[from] ImageError),
}

/// The image in the bytes of a PNG file of 8 bits grey.
///
/// # Errors
/// They are of something else.
pub fn grey(bytes: &[u8]) -> Result<Image, GreyError> {
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: MOST_BYTES });
    decoder.set_transformations(Transformations::IDENTITY);
    let info = decoder.read_header_info()?;
    let (width, height) = (info.width as usize, info.height as usize);
    let colour = |found| Err(GreyError::Colour { found });
    match (info.color_type, info.bit_depth) {
        (ColorType::Grayscale, BitDepth::Eight) => {}
        (ColorType::Grayscale, depth) => return Err(GreyError::Depth { bits: depth as u8 }),
        (ColorType::GrayscaleAlpha, _) => return colour("grey with a transparency"),
        (ColorType::Indexed, _) => return colour("of a palette's colours"),
        (ColorType::Rgb, _) => return colour("in colour (RGB)"),
        (ColorType::Rgba, _) => return colour("in colour (RGBA)"),
    }
    if width.max(height) > Image::MAX_SIDE {
        return Err(ImageError::Side { width, height }.into());
    }
    let mut reader = decoder.read_info()?;
    let mut pixels = vec![0; reader.output_buffer_size()];
    reader.next_frame(&mut pixels)?;
    Ok(Image::new(width, height, pixels)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_png::png;

    #[test]
    fn a_grey_picture_is_read_and_others_are_said_to_be_what_they_are() {
        let file = png(ColorType::Grayscale, BitDepth::Eight, &[1, 2, 3, 4, 5, 6, 7, 8]);
        let image = grey(&file).unwrap();
        assert_eq!((image.width(), image.height(), image.pixels()), (4, 2, &[1, 2, 3, 4, 5, 6, 7, 8][..]));
        let said = |bytes: &[u8]| grey(bytes).unwrap_err().to_string();
        assert!(
            said(&png(ColorType::Rgb, BitDepth::Eight, &[0; 24]))
                .starts_with("it is in colour (RGB): grey would be right")
        );
        assert!(
            said(&png(ColorType::Grayscale, BitDepth::Sixteen, &[0; 16]))
                .starts_with("it has 16 bits a pixel: 8 would")
        );
        assert!(said(&png(ColorType::GrayscaleAlpha, BitDepth::Eight, &[0; 16])).contains("a transparency"));
        for length in 0..file.len() - 12 {
            assert!(said(&file[..length]).contains("a whole PNG of 8 bits grey would be right"), "{length}");
        }
        assert!(said(b"P5 4 2 255 01234567").contains("cannot be read as a PNG"));
    }

    /// Regression of others: a header that says that it is as large as the world is not believed.
    #[test]
    fn a_picture_too_large_is_refused_before_there_is_room_for_it() {
        let mut file = png(ColorType::Grayscale, BitDepth::Eight, &[0; 8]);
        file[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
        let mut decoder = png::Decoder::new(Cursor::new(&file));
        decoder.ignore_checksums(true);
        assert_eq!(decoder.read_header_info().unwrap().width, 65536);
        assert!(grey(&file).is_err());
    }
}
