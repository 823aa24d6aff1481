//! Pixels: shapes and text on an opaque sheet. Pixel coordinates, y down.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, PathBuilder, Pixmap, PremultipliedColorU8, Rect, Stroke, Transform,
};

use crate::palette::{PAPER, Rgb, mix};

/// A point of the sheet (px).
pub(crate) type At = (f64, f64);

/// How a text is set.
#[derive(Clone, Copy)]
pub(crate) struct Type {
    pub size: RasterHeight,
    pub weight: FontWeight,
    pub color: Rgb,
}

/// Where a text stands to the point that it is set at.
#[derive(Clone, Copy)]
pub(crate) enum Align {
    Left,
    Center,
    Right,
}

/// The sheet.
pub(crate) struct Canvas {
    pixels: Pixmap,
}

impl Canvas {
    /// An empty sheet; nothing for sizes that no picture has.
    pub fn new(width: u32, height: u32) -> Option<Self> {
        let mut pixels = Pixmap::new(width, height)?;
        pixels.fill(Color::from_rgba8(PAPER[0], PAPER[1], PAPER[2], 255));
        Some(Self { pixels })
    }

    /// The sheet as a PNG file.
    pub fn encode(&self) -> Result<Vec<u8>, String> {
        self.pixels.encode_png().map_err(|error| error.to_string())
    }

    /// Fills a rectangle given by its corners; whole pixels give sharp edges.
    pub fn rect(&mut self, (x0, y0): At, (x1, y1): At, color: Rgb, alpha: f64) {
        if let Some(rect) = Rect::from_ltrb(x0 as f32, y0 as f32, x1 as f32, y1 as f32) {
            self.pixels.fill_rect(rect, &paint(color, alpha), Transform::identity(), None);
        }
    }

    /// Strokes a line through `points` with round ends and joins.
    pub fn line(&mut self, points: &[At], width: f64, color: Rgb, alpha: f64) {
        let mut path = PathBuilder::new();
        for (i, &(x, y)) in points.iter().enumerate() {
            match i {
                0 => path.move_to(x as f32, y as f32),
                _ => path.line_to(x as f32, y as f32),
            }
        }
        let stroke =
            Stroke { width: width as f32, line_cap: LineCap::Round, line_join: LineJoin::Round, ..Stroke::default() };
        if let Some(path) = path.finish() {
            self.pixels.stroke_path(&path, &paint(color, alpha), &stroke, Transform::identity(), None);
        }
    }

    /// Fills a disc.
    pub fn disc(&mut self, (x, y): At, radius: f64, color: Rgb) {
        if let Some(path) = PathBuilder::from_circle(x as f32, y as f32, radius as f32) {
            self.pixels.fill_path(&path, &paint(color, 1.0), FillRule::Winding, Transform::identity(), None);
        }
    }

    /// Sets a text with its middle at height `y`; answers the width that it takes. Characters that the font lacks
    /// become question marks.
    pub fn text(&mut self, (x, y): At, text: &str, set: Type, align: Align) -> f64 {
        let advance = get_raster_width(set.weight, set.size);
        let width = (text.chars().count() * advance) as f64;
        let left = match align {
            Align::Left => x,
            Align::Center => x - width / 2.0,
            Align::Right => x - width,
        };
        let top = (y - set.size.val() as f64 / 2.0).round() as i64;
        for (i, c) in text.chars().enumerate() {
            let glyph = get_raster(c, set.weight, set.size).or_else(|| get_raster('?', set.weight, set.size));
            let left = left.round() as i64 + (i * advance) as i64;
            for (dy, row) in glyph.iter().flat_map(|g| g.raster().iter().enumerate()) {
                for (dx, &coverage) in row.iter().enumerate() {
                    self.blend(left + dx as i64, top + dy as i64, set.color, coverage);
                }
            }
        }
        width
    }

    fn blend(&mut self, x: i64, y: i64, color: Rgb, coverage: u8) {
        let inside =
            (0..i64::from(self.pixels.width())).contains(&x) && (0..i64::from(self.pixels.height())).contains(&y);
        if coverage == 0 || !inside {
            return;
        }
        let at = (y * i64::from(self.pixels.width()) + x) as usize;
        if let Some(pixel) = self.pixels.pixels_mut().get_mut(at) {
            let below = [pixel.red(), pixel.green(), pixel.blue()];
            let [r, g, b] = mix(below, color, f64::from(coverage) / 255.0);
            *pixel = PremultipliedColorU8::from_rgba(r, g, b, 255).unwrap_or(*pixel);
        }
    }
}

fn paint(color: Rgb, alpha: f64) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(color[0], color[1], color[2], (alpha * 255.0).round() as u8);
    paint
}
