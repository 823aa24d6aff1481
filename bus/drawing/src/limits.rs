//! What a drawing and a table of keys have to keep to before anybody believes them.

use std::ops::RangeInclusive;

use elk_describe::Invalid;

/// What a check comes to.
pub(crate) type Checked = Result<(), Invalid>;

/// Bytes of a drawing's name.
pub const MAX_NAME: usize = 64;
/// Primitives of a drawing.
pub const MAX_PRIMITIVES: usize = 1024;
/// Vertices of a drawing, of all its primitives together (16 bytes each with their colours: 4 MB).
pub const MAX_VERTICES: usize = 1 << 18;
/// Pixels of a drawing, of all its images together (4 bytes each: 4 MB).
pub const MAX_PIXELS: usize = 1 << 20;
/// Pixels of an image's side: what every card can hold.
pub const MAX_SIDE: usize = 4096;
/// Bytes of a text that is drawn, and of what a key means.
pub const MAX_TEXT: usize = 1024;
/// Keys that an app declares.
pub const MAX_KEYS: usize = 64;
/// How long a drawing is shown (s): up to a day.
pub const LIFETIMES_S: RangeInclusive<f64> = 1e-3..=86_400.0;
/// Sizes of points and texts, and widths of lines (pixels).
pub const SIZES_PX: RangeInclusive<f32> = 0.5..=256.0;
/// Edges of voxels (m).
pub const EDGES_M: RangeInclusive<f32> = 1e-3..=1e3;
/// The largest coordinate either way (m).
pub const FARTHEST_M: f32 = 1e5;

pub(crate) fn holds(field: &str, is: bool, found: impl std::fmt::Display, wanted: &str) -> Checked {
    if is { Ok(()) } else { Err(Invalid::new(field, found, wanted)) }
}

/// A name: one step of a variable's name, no pattern, printable.
pub(crate) fn name(name: &str) -> Checked {
    let good = |c: char| !c.is_control() && !c.is_whitespace() && !['/', '*', '?', ','].contains(&c);
    let is_name = (1..=MAX_NAME).contains(&name.len()) && name.chars().all(good);
    holds("", is_name, format!("{name:?}"), "1 to 64 printable bytes without space, '/', '*', '?' or ','")
}

/// A text for people: not long, and without what would steer a terminal.
pub(crate) fn text(text: &str) -> Checked {
    holds("", text.len() <= MAX_TEXT, format!("{} bytes long", text.len()), "at most 1024 bytes")?;
    let control = text.chars().find(|c| c.is_control());
    control.map_or(Ok(()), |control| {
        Err(Invalid::new("", format!("a text with {control:?}"), "without control characters"))
    })
}

/// A place, or a vector (m).
pub(crate) fn place(place: &[f32; 3]) -> Checked {
    let far = place.iter().find(|c| !(-FARTHEST_M..=FARTHEST_M).contains(*c));
    far.map_or(Ok(()), |far| Err(Invalid::new("", far, "a coordinate within 1e5 m")))
}

/// Places (m).
pub(crate) fn places(places: &[[f32; 3]]) -> Checked {
    let mut places = places.iter().enumerate();
    places.try_for_each(|(i, one)| place(one).map_err(|inner| inner.within(&format!("[{i}]"))))
}
