//! What disparities say of the space in front of the cameras.

use elk_spatial::pixels::{PixelOutcome, PixelRun};
use elk_stereo::{Disparity, Rig, Unmatched};
use nalgebra::Point3;

/// What disparities see, in the frame of the left camera (x right, y down, z forward; m): a point for each pixel that was matched, and, of
/// a pixel that was matched farther away than `range` (m), the direction (a unit vector) in which there is nothing up to there. Of a
/// pixel that was not matched nothing is known, whatever the reason: it is in neither list, and frees nothing.
pub fn seen(rig: &Rig, disparity: &Disparity, range: Option<f64>) -> (Vec<Point3<f32>>, Vec<Point3<f32>>) {
    let range = range.unwrap_or(f64::INFINITY);
    let (mut points, mut no_return) = (Vec::new(), Vec::new());
    for (_, _, point) in rig.cloud(disparity) {
        match point.coords.norm() <= range {
            true => points.push(point.cast()),
            false => no_return.push(Point3::from(point.coords.normalize()).cast()),
        }
    }
    (points, no_return)
}

/// What became of all pixels of the left image, as a scan says it.
pub fn pixel_runs(disparity: &Disparity) -> Vec<PixelRun> {
    PixelRun::all(disparity.iter().map(|said| match said {
        Ok(_) => PixelOutcome::Matched,
        Err(Unmatched::Textureless) => PixelOutcome::Textureless,
        Err(Unmatched::OutOfRange) => PixelOutcome::OutOfRange,
        Err(Unmatched::Ambiguous) => PixelOutcome::Ambiguous,
        Err(Unmatched::Inconsistent) => PixelOutcome::Inconsistent,
        Err(Unmatched::SmallComponent) => PixelOutcome::SmallComponent,
    }))
}
