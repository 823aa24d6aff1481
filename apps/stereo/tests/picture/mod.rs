//! Pictures of recorded data, as grey images.

use std::path::Path;

use elk_stereo::Image;

/// A grey image of a PNG or a binary PGM.
pub fn read(path: &Path) -> Image {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    if bytes.starts_with(b"P5") {
        return pgm(&bytes);
    }
    let mut reader = png::Decoder::new(bytes.as_slice()).read_info().unwrap();
    let mut buffer = vec![0; reader.output_buffer_size()];
    let info = reader.next_frame(&mut buffer).unwrap();
    assert_eq!(info.bit_depth, png::BitDepth::Eight, "{}", path.display());
    // Rec. 601 luma, as all that read colour as grey have it.
    let grey = |pixel: &[u8]| match *pixel {
        [r, g, b, ..] => (0.299 * f32::from(r) + 0.587 * f32::from(g) + 0.114 * f32::from(b)).round() as u8,
        _ => pixel[0],
    };
    let pixels = buffer[..info.buffer_size()].chunks_exact(info.color_type.samples()).map(grey).collect();
    Image::new(info.width as usize, info.height as usize, pixels).unwrap()
}

fn pgm(bytes: &[u8]) -> Image {
    let mut rest = bytes;
    let words: Vec<String> = (0..4)
        .map(|_| {
            let start = rest.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap();
            let end = start + rest[start..].iter().position(u8::is_ascii_whitespace).unwrap();
            let word = String::from_utf8_lossy(&rest[start..end]).into_owned();
            rest = &rest[end..];
            word
        })
        .collect();
    let [width, height] = [&words[1], &words[2]].map(|side| side.parse().unwrap());
    Image::new(width, height, rest[1..].to_vec()).unwrap()
}
