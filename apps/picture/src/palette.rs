//! The colours, and mixing them.

/// An opaque colour: red, green, blue.
pub(crate) type Rgb = [u8; 3];

/// The sheet, and open free space.
pub(crate) const PAPER: Rgb = [255, 255, 255];
/// Titles, and what the cutting plane cuts.
pub(crate) const INK: Rgb = [30, 41, 59];
/// Text of less weight.
pub(crate) const SOFT_INK: Rgb = [100, 112, 130];
/// Frames and ticks.
pub(crate) const LINE: Rgb = [176, 184, 196];
/// What is unknown.
pub(crate) const UNKNOWN: Rgb = [222, 226, 232];
/// A surface just behind the cutting plane.
pub(crate) const NEAR: Rgb = [128, 146, 172];
/// A surface far behind it.
pub(crate) const FAR: Rgb = [247, 248, 250];
/// A frontier voxel that is left.
pub(crate) const FRONTIER: Rgb = [225, 29, 72];

/// Where the way truly led.
pub(crate) const TRUTH: Rgb = [180, 83, 9];

/// The colours of the way from start (0) to end (1).
const PROGRESS: [Rgb; 4] = [[67, 56, 202], [2, 132, 199], [13, 148, 136], [77, 160, 20]];

/// The colour of the way after the share `t` (0 to 1) of it.
pub(crate) fn progress(t: f64) -> Rgb {
    let at = t.clamp(0.0, 1.0) * (PROGRESS.len() - 1) as f64;
    let i = (at as usize).min(PROGRESS.len() - 2);
    mix(PROGRESS[i], PROGRESS[i + 1], at - i as f64)
}

/// From `a` (t = 0) to `b` (t = 1).
pub(crate) fn mix(a: Rgb, b: Rgb, t: f64) -> Rgb {
    let t = t.clamp(0.0, 1.0);
    std::array::from_fn(|i| (f64::from(a[i]) * (1.0 - t) + f64::from(b[i]) * t).round() as u8)
}
