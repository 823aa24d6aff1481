//! The sheet: title, plan, section, and the key to both.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight};

use crate::axes::{self, NAME, NOTE};
use crate::canvas::{Align, At, Canvas, Type};
use crate::palette::{self, mix};
use crate::panel::{Panel, ring};
use crate::scene::Scene;
use crate::view::{Axis, Frame, Ranges, shown};

const WIDTH: f64 = 1800.0;
const SIDE: f64 = 90.0;
const HEADER: f64 = 190.0;
const GAP: f64 = 130.0;
/// Room below the panels, with the key in it and without (px).
const FOOTER: f64 = 160.0;
const FOOTER_BARE: f64 = 100.0;
/// The tallest that a plan becomes (px).
const PLAN_MAX: f64 = 1100.0;
/// A plan less elongated than this has its section beside it, else below.
const SQUARISH: f64 = 1.5;
/// Distance between the key's lines where they stand below each other (px).
const KEY_LINE: f64 = 35.0;
/// Room between the section and a key below it (px).
const KEY_GAP: f64 = 108.0;
/// Lines of the key.
const KEY_LINES: f64 = 6.0;
/// Unknown voxels shown around what is known.
const MARGIN: i32 = 2;

const TITLE: Type = Type { size: RasterHeight::Size32, weight: FontWeight::Bold, color: palette::INK };
const SUBTITLE: Type = Type { size: RasterHeight::Size24, weight: FontWeight::Regular, color: palette::SOFT_INK };

/// Why a scene could not be drawn.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// The map has no extent that fits a picture.
    #[error("a map of {0} by {1} m cannot be drawn")]
    Extent(f64, f64),
    /// The picture could not be encoded.
    #[error("the picture cannot be encoded: {0}")]
    Encode(String),
}

/// Draws a scene; answers the bytes of a PNG file, 1800 px wide.
pub fn draw(scene: &Scene) -> Result<Vec<u8>, DrawError> {
    let (plan, section) = panels(scene)?;
    let lowest = [&plan, &section].map(Panel::bottom).into_iter().fold(0.0, f64::max);
    // There is room for the key below a section that ends well above the plan.
    let stacked = section.bottom() + KEY_GAP + KEY_LINES * KEY_LINE <= plan.bottom();
    let height = lowest + if stacked { FOOTER_BARE } else { FOOTER };
    let extent = DrawError::Extent(plan.size().0 / plan.scale, plan.size().1 / plan.scale);
    let mut canvas = Canvas::new(WIDTH as u32, height as u32).ok_or(extent)?;
    draw_title(&mut canvas, scene);
    for panel in [&plan, &section] {
        panel.draw(&mut canvas, scene);
        axes::draw(&mut canvas, panel);
    }
    draw_cut(&mut canvas, &plan, &section);
    draw_names(&mut canvas, &plan, &section);
    let (key, bar) = match stacked {
        true => ((section.corner.0, section.bottom() + GAP), plan.bottom() - 8.0),
        false => ((SIDE, height - 52.0), height - 52.0),
    };
    draw_key(&mut canvas, key, stacked, !scene.truth.is_empty());
    axes::scale_bar(&mut canvas, plan.scale, section.corner.0 + section.size().0, bar);
    canvas.encode().map_err(DrawError::Encode)
}

/// Plan and section at one scale, the world's longer side across; the section stands below a long plan and beside one
/// that is almost square.
fn panels(scene: &Scene) -> Result<(Panel, Panel), DrawError> {
    let grid = &scene.grid;
    let ranges = shown(grid);
    let (right, up) = directions(&ranges);
    let plan = Frame::around(&ranges, right, up, Axis::against(2), MARGIN);
    let section = Frame::around(&ranges, right, Axis::along(2), up, MARGIN);
    let [across, deep] = [plan.size[0], plan.size[1]].map(|cells| f64::from(cells) * grid.resolution());
    if !(across > 0.0 && deep > 0.0 && across.max(deep) < 1e5) {
        return Err(DrawError::Extent(across, deep));
    }
    let beside = across / deep < SQUARISH;
    let room = if beside { (WIDTH - 3.0 * SIDE) / 2.0 } else { WIDTH - 2.0 * SIDE };
    let scale = (room / across).min(PLAN_MAX / deep);
    let place = |frame: Frame, cut, corner| Panel { frame, cut, resolution: grid.resolution(), scale, corner };
    let mut plan = place(plan, robot_level(scene, &plan), (SIDE, HEADER));
    let mut section = place(section, section.most_open_cut(grid), (SIDE, HEADER));
    if beside {
        section.corner.0 = WIDTH - SIDE - section.size().0;
    } else {
        plan.corner.0 = ((WIDTH - plan.size().0) / 2.0).round();
        section.corner = (plan.corner.0, HEADER + plan.size().1 + GAP);
    }
    Ok((plan, section))
}

/// Which way is right and which is up on the plan: a turn, never a mirror image.
fn directions(ranges: &Ranges) -> (Axis, Axis) {
    let [wide, deep, _] = ranges.map(|[first, last]| last - first);
    match wide >= deep {
        true => (Axis::along(0), Axis::along(1)),
        false => (Axis::along(1), Axis::against(0)),
    }
}

/// The plan's cut: the median height of the camera, or the middle of the map where there was none.
fn robot_level(scene: &Scene, plan: &Frame) -> i32 {
    let mut heights: Vec<f64> = scene.path.iter().map(|p| plan.away.of(*p)).collect();
    heights.sort_by(f64::total_cmp);
    let middle = plan.min[2] + plan.size[2] / 2;
    heights.get(heights.len() / 2).map_or(middle, |height| (height / scene.grid.resolution()).floor() as i32)
}

fn draw_title(canvas: &mut Canvas, scene: &Scene) {
    canvas.text((SIDE, 62.0), &scene.mission, TITLE, Align::Left);
    let state = match scene.complete {
        Some(true) => "complete",
        Some(false) => "not complete",
        None => "",
    };
    let facts = [
        scene.explorer.clone(),
        format!("{} scans", scene.scans.len()),
        format!("{:.1} m of way", scene.path_length_m),
        format!("voxels of {:.2} m", scene.grid.resolution()),
        state.into(),
    ];
    let facts: Vec<String> = facts.into_iter().filter(|fact| !fact.is_empty()).collect();
    canvas.text((SIDE, 104.0), &facts.join("  ·  "), SUBTITLE, Align::Left);
}

fn draw_names(canvas: &mut Canvas, plan: &Panel, section: &Panel) {
    let height = -plan.cut_m();
    let at = |panel: &Panel| (panel.corner.0, panel.corner.1 - 24.0);
    let after = canvas.text(at(plan), "Plan", NAME, Align::Left);
    let (x, y) = at(plan);
    canvas.text((x + after + 14.0, y), &format!("cut at z = {height:.2} m"), NOTE, Align::Left);
    let after = canvas.text(at(section), "Section A-A", NAME, Align::Left);
    let (x, y) = at(section);
    canvas.text((x + after + 14.0, y), "along the line A-A", NOTE, Align::Left);
}

/// The line on the plan along which the section is cut.
fn draw_cut(canvas: &mut Canvas, plan: &Panel, section: &Panel) {
    let (left, _) = plan.corner;
    let (_, y) = plan.at(0.0, section.cut_m());
    let right = left + plan.size().0;
    let mut x = left;
    while x < right {
        canvas.line(&[(x, y), ((x + 14.0).min(right), y)], 1.2, palette::SOFT_INK, 0.55);
        x += 24.0;
    }
    let letter = Type { color: palette::SOFT_INK, ..NAME };
    canvas.text((right + 14.0, y), "A", letter, Align::Left);
    canvas.text((left - 44.0, y), "A", letter, Align::Center);
}

/// What the colours mean: in a row at `at`, or, `stacked`, one below the other; the true way beside the scans, where it is drawn.
fn draw_key(canvas: &mut Canvas, at: At, stacked: bool, with_truth: bool) {
    let (mut x, mut y) = at;
    let last = if with_truth { scan_and_truth_entry } else { scan_entry };
    for entry in [cut_entry, unknown_entry, frontier_entry, depth_entry, way_entry, last] {
        let end = entry(canvas, (x, y));
        if stacked {
            y += KEY_LINE;
        } else {
            x = end + 30.0;
        }
    }
}

fn cut_entry(canvas: &mut Canvas, at: At) -> f64 {
    swatch(canvas, at, "cut", palette::INK)
}

fn unknown_entry(canvas: &mut Canvas, at: At) -> f64 {
    swatch(canvas, at, "unknown", palette::UNKNOWN)
}

fn frontier_entry(canvas: &mut Canvas, at: At) -> f64 {
    swatch(canvas, at, "frontier left", palette::FRONTIER)
}

fn depth_entry(canvas: &mut Canvas, at: At) -> f64 {
    let x = ramp(canvas, at, 70.0, |t| mix(palette::NEAR, palette::FAR, t));
    entry(canvas, (x, at.1), "near to far behind the cut")
}

fn way_entry(canvas: &mut Canvas, (x, y): At) -> f64 {
    let end = ramp(canvas, (x + 20.0, y), 90.0, palette::progress);
    ring(canvas, (x + 10.0, y), palette::progress(0.0), palette::PAPER);
    ring(canvas, (end, y), palette::PAPER, palette::progress(1.0));
    entry(canvas, (end + 20.0, y), "way, start to end")
}

fn scan_entry(canvas: &mut Canvas, (x, y): At) -> f64 {
    canvas.line(&[(x + 3.0, y), (x + 20.0, y)], 1.8, palette::progress(0.4), 1.0);
    canvas.disc((x + 3.0, y), 3.2, palette::progress(0.4));
    entry(canvas, (x + 30.0, y), "scan")
}

fn scan_and_truth_entry(canvas: &mut Canvas, at: At) -> f64 {
    let (x, y) = (scan_entry(canvas, at) + 24.0, at.1);
    canvas.line(&[(x, y), (x + 24.0, y)], 1.2, palette::TRUTH, 0.9);
    entry(canvas, (x + 34.0, y), "truth")
}

fn swatch(canvas: &mut Canvas, (x, y): At, name: &str, color: palette::Rgb) -> f64 {
    canvas.rect((x, y - 9.0), (x + 18.0, y + 9.0), color, 1.0);
    entry(canvas, (x + 28.0, y), name)
}

/// Sets an entry's name; answers where it ends.
fn entry(canvas: &mut Canvas, at: At, name: &str) -> f64 {
    at.0 + canvas.text(at, name, NOTE, Align::Left)
}

/// A strip of colours from t = 0 to 1; answers where the next thing may stand.
fn ramp(canvas: &mut Canvas, (x, y): At, width: f64, color: impl Fn(f64) -> palette::Rgb) -> f64 {
    for i in 0..width as usize {
        let left = x.round() + i as f64;
        canvas.rect((left, y - 6.0), (left + 1.0, y + 6.0), color(i as f64 / width), 1.0);
    }
    x + width + 10.0
}
