//! What makes a view measurable: its frame, metre ticks with figures, and a scale bar.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight};

use crate::canvas::{Align, Canvas, Type};
use crate::palette;
use crate::panel::Panel;
use crate::view::Axis;

/// Small figures and notes.
pub(crate) const NOTE: Type =
    Type { size: RasterHeight::Size20, weight: FontWeight::Regular, color: palette::SOFT_INK };
/// Names of panels.
pub(crate) const NAME: Type = Type { size: RasterHeight::Size24, weight: FontWeight::Bold, color: palette::INK };

/// Frame, ticks every metre (or every two, five, … where they would crowd), figures, and the axes' names.
pub(crate) fn draw(canvas: &mut Canvas, panel: &Panel) {
    let (left, top) = panel.corner;
    let (width, height) = panel.size();
    let corners = [(left, top), (left + width, top), (left + width, top + height), (left, top + height), (left, top)];
    canvas.line(&corners, 1.5, palette::LINE, 1.0);
    let step = step(panel.scale);
    for (cells, axis, upright) in [(0, panel.frame.right, false), (1, panel.frame.up, true)] {
        let first = f64::from(panel.frame.min[cells]) * panel.resolution;
        let last = f64::from(panel.frame.min[cells] + panel.frame.size[cells]) * panel.resolution;
        let mut tick = (first / step).ceil() * step;
        while tick <= last {
            draw_tick(canvas, panel, axis, tick, upright);
            tick += step;
        }
    }
    canvas.text((left + width, top + height + 52.0), &name(panel.frame.right), NOTE, Align::Right);
    canvas.text((left - 12.0, top - 14.0), &name(panel.frame.up), NOTE, Align::Right);
}

fn draw_tick(canvas: &mut Canvas, panel: &Panel, axis: Axis, tick: f64, upright: bool) {
    let (left, top) = panel.corner;
    let bottom = top + panel.size().1;
    let world = if axis.reversed { -tick } else { tick } + 0.0;
    let (x, y) = panel.at(tick, tick);
    if upright {
        canvas.line(&[(left - 6.0, y), (left, y)], 1.5, palette::LINE, 1.0);
        canvas.text((left - 12.0, y), &format!("{world:.0}"), NOTE, Align::Right);
    } else {
        canvas.line(&[(x, bottom), (x, bottom + 6.0)], 1.5, palette::LINE, 1.0);
        canvas.text((x, bottom + 22.0), &format!("{world:.0}"), NOTE, Align::Center);
    }
}

fn name(axis: Axis) -> String {
    format!("{} [m]", ["x", "y", "z"][axis.world])
}

/// Metres between two ticks: at least 36 px apart.
fn step(scale: f64) -> f64 {
    [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0].into_iter().find(|step| step * scale >= 36.0).unwrap_or(500.0)
}

/// A bar of whole metres that ends at `right`, with its length above it.
pub(crate) fn scale_bar(canvas: &mut Canvas, scale: f64, right: f64, y: f64) {
    let length = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0].into_iter().find(|m| m * scale >= 120.0).unwrap_or(500.0);
    let left = right - length * scale;
    canvas.line(&[(left, y), (right, y)], 3.0, palette::INK, 1.0);
    for x in [left, right] {
        canvas.line(&[(x, y - 6.0), (x, y + 6.0)], 3.0, palette::INK, 1.0);
    }
    canvas.text(((left + right) / 2.0, y - 18.0), &format!("{length:.0} m"), NOTE, Align::Center);
}
