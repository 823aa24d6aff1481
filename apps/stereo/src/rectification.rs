//! Rectification: both images as two cameras would have seen them that are alike, side by side and look the same way, so that a row
//! of the one is a row of the other (thesis 3.2.1.1, fig. 3.4).

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::camera::{Camera, StereoCalibration};
use crate::image::Image;
use crate::triangulation::{Rig, RigError};

/// How a calibrated pair is rectified: a table for each camera that says where each pixel comes from.
#[derive(Clone, Debug)]
pub struct Rectification {
    rig: Rig,
    left_from_rectified: UnitQuaternion<f64>,
    size: [usize; 2],
    left: Vec<Source>,
    right: Vec<Source>,
}

/// Where a pixel comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Source {
    /// The upper left one of the four pixels that it lies between; [`OUTSIDE`] where the camera does not see it.
    pixel: u32,
    /// How far it lies from that one to the right and downwards, in parts of 256.
    right: u8,
    down: u8,
}

const OUTSIDE: u32 = u32::MAX;

/// The least share of a rectified image that its camera sees. Lenses as they are leave out corners at most.
const LEAST_SEEN: f64 = 0.1;

/// Why a pair cannot be rectified.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RectificationError {
    /// The cameras' images differ in size.
    #[error(
        "a left camera of {left:?} pixels and a right one of {right:?}: both have to have one size, of 2 × 2 at least"
    )]
    Cameras {
        /// Columns and rows of the left camera.
        left: [usize; 2],
        /// Columns and rows of the right camera.
        right: [usize; 2],
    },
    /// The right camera does not stand on the right of the left one.
    #[error(
        "the right camera is {right:.3} m right, {down:.3} m below and {ahead:.3} m ahead of the left one: it has to be on its \
         right; are the cameras swapped?"
    )]
    Sides {
        /// Metres along x of the left camera.
        right: f64,
        /// Metres along y.
        down: f64,
        /// Metres along z.
        ahead: f64,
    },
    /// The cameras look apart, so that nothing is seen by both.
    #[error("the cameras' axes are {degrees:.0}° apart: less than 90 would be right")]
    Axes {
        /// The angle between them.
        degrees: f64,
    },
    /// No ray is seen in the middle of an image: the lens' polynomial has no inverse there.
    #[error(
        "the {side} lens shows no ray in the middle of its image: are its distortion and its principal point what was calibrated?"
    )]
    Lens {
        /// `left` or `right`.
        side: &'static str,
    },
    /// Next to nothing of a rectified image lies in what its camera sees.
    #[error(
        "of the rectified {side} image {:.1} % lie in what its camera sees: at least {:.0} % would be right; are its distortion, its principal \
         point and its turn to the other one what was calibrated?", share * 100.0, LEAST_SEEN * 100.0
    )]
    Coverage {
        /// `left` or `right`.
        side: &'static str,
        /// The share (0 to 1).
        share: f64,
    },
    /// There is no baseline, or a number is none.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// An image is not of its camera's size.
    #[error("a {side} image of {found:?} pixels: {right:?}, as its camera was calibrated, would be right")]
    Image {
        /// `left` or `right`.
        side: &'static str,
        /// Columns and rows of the image.
        found: [usize; 2],
        /// Columns and rows of the camera.
        right: [usize; 2],
    },
}

impl Rectification {
    /// How the images of two calibrated cameras are rectified. The common x axis is the baseline, z is as near to both cameras' axes as
    /// that allows, the focal length is the mean of all four, and the middle of the images is what the middle of both shows.
    ///
    /// # Errors
    /// Cameras that are no stereo pair.
    pub fn new(calibration: &StereoCalibration) -> Result<Self, RectificationError> {
        let StereoCalibration { left, right, .. } = calibration;
        if left.size != right.size || left.size.into_iter().min() < Some(2) {
            return Err(RectificationError::Cameras { left: left.size, right: right.size });
        }
        let baseline = calibration.right_center().coords;
        let left_from_right = calibration.right_from_left.rotation.inverse();
        let axes = common_axes(baseline, left_from_right * Vector3::z())?;
        let left_from_rectified = UnitQuaternion::from_rotation_matrix(&axes);
        let right_from_rectified = calibration.right_from_left.rotation * left_from_rectified;
        let focal = (left.focal.iter().sum::<f64>() + right.focal.iter().sum::<f64>()) / 4.0;
        let middle_of = |side, camera, turn| middle(camera, turn).ok_or(RectificationError::Lens { side });
        let middles = [middle_of("left", left, left_from_rectified)?, middle_of("right", right, right_from_rectified)?];
        let mean = |axis: usize| (middles[0][axis] + middles[1][axis]) / 2.0;
        let center = |axis: usize| (left.size[axis] - 1) as f64 / 2.0 - focal * mean(axis);
        let rig = Rig::new(focal, [center(1), center(0)], baseline.norm())?;
        Ok(Self {
            rig,
            left_from_rectified,
            size: left.size,
            left: seen("left", sources(left, left_from_rectified, &rig))?,
            right: seen("right", sources(right, right_from_rectified, &rig))?,
        })
    }

    /// The cameras that rectified images are seen by.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// How the frame of the rectified left camera, in which points are triangulated, is turned in that of the calibrated one; both
    /// have one origin.
    pub fn left_from_rectified(&self) -> UnitQuaternion<f64> {
        self.left_from_rectified
    }

    /// Both images, rectified. What a camera does not see is black.
    ///
    /// # Errors
    /// Images that are not of their cameras' size.
    pub fn rectify(&self, left: &Image, right: &Image) -> Result<[Image; 2], RectificationError> {
        let rectify = |side, image: &Image, sources: &[Source]| {
            let found = [image.width(), image.height()];
            match found == self.size {
                true => Ok(image.with_pixels(sources.iter().map(|source| source.grey(image)).collect())),
                false => Err(RectificationError::Image { side, found, right: self.size }),
            }
        };
        Ok([rectify("left", left, &self.left)?, rectify("right", right, &self.right)?])
    }
}

/// The axes of the rectified cameras in the frame of the left one, as columns.
fn common_axes(baseline: Vector3<f64>, right_axis: Vector3<f64>) -> Result<Rotation3<f64>, RectificationError> {
    let length = baseline.norm();
    if !(length.is_finite() && length > 1e-9) {
        return Err(RigError::Baseline { found: length }.into());
    }
    let x = baseline / length;
    if x.x < 0.5 {
        return Err(RectificationError::Sides { right: baseline.x, down: baseline.y, ahead: baseline.z });
    }
    if right_axis.z <= 0.0 {
        return Err(RectificationError::Axes { degrees: right_axis.z.clamp(-1.0, 1.0).acos().to_degrees() });
    }
    let y = (Vector3::z() + right_axis).cross(&x).normalize();
    Ok(Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)])))
}

/// The ray of the middle of a camera's image, in the rectified frame at unit distance, if there is one.
fn middle(camera: &Camera, camera_from_rectified: UnitQuaternion<f64>) -> Option<[f64; 2]> {
    let middle = camera.size.map(|side| (side - 1) as f64 / 2.0);
    let [x, y] = camera.ray(middle);
    let [column, row] = camera.pixel([x, y]);
    let ray = camera_from_rectified.inverse() * Vector3::new(x, y, 1.0);
    // A ray that is seen elsewhere, or nowhere, is not the one that was looked for.
    ((column - middle[0]).hypot(row - middle[1]) < 1.0 && ray.z > 0.0).then(|| [ray.x / ray.z, ray.y / ray.z])
}

/// Where all rectified pixels come from, row by row.
fn sources(camera: &Camera, camera_from_rectified: UnitQuaternion<f64>, rig: &Rig) -> Vec<Source> {
    let [width, height] = camera.size;
    let limit = camera.distortion.limit();
    let [center_row, center_column] = rig.center();
    let source = |row: usize, column: usize| {
        let ray = Vector3::new(column as f64 - center_column, row as f64 - center_row, rig.focal());
        let ray = camera_from_rectified * ray;
        let [x, y] = [ray.x / ray.z, ray.y / ray.z];
        let is_seen = ray.z > 0.0 && x * x + y * y <= limit;
        if is_seen { Source::at(camera.pixel([x, y]), camera.size) } else { Source::NOWHERE }
    };
    (0..height).flat_map(|row| (0..width).map(move |column| source(row, column))).collect()
}

/// The sources of an image of which enough is seen.
fn seen(side: &'static str, sources: Vec<Source>) -> Result<Vec<Source>, RectificationError> {
    let inside = sources.iter().filter(|source| source.pixel != OUTSIDE).count();
    let share = inside as f64 / sources.len() as f64;
    match share >= LEAST_SEEN {
        true => Ok(sources),
        false => Err(RectificationError::Coverage { side, share }),
    }
}

impl Source {
    const NOWHERE: Self = Self { pixel: OUTSIDE, right: 0, down: 0 };

    /// At a column and row of an image.
    fn at([column, row]: [f64; 2], [width, height]: [usize; 2]) -> Self {
        let is_inside = (0.0..(width - 1) as f64).contains(&column) && (0.0..(height - 1) as f64).contains(&row);
        let part = |x: f64| (x.fract() * 256.0) as u8;
        match is_inside {
            true => {
                Self { pixel: (row as usize * width + column as usize) as u32, right: part(column), down: part(row) }
            }
            false => Self::NOWHERE,
        }
    }

    /// What the image shows there, bilinearly between four pixels.
    fn grey(self, image: &Image) -> u8 {
        if self.pixel == OUTSIDE {
            return 0;
        }
        let pixel = |offset: usize| u32::from(image.pixels()[self.pixel as usize + offset]);
        let between = |a: u32, b: u32, part: u8| a * (256 - u32::from(part)) + b * u32::from(part);
        let width = image.width();
        let [above, below] = [0, width].map(|offset| between(pixel(offset), pixel(offset + 1), self.right));
        ((between(above, below, self.down) + (1 << 15)) >> 16) as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Distortion;
    use nalgebra::{Isometry3, Point3, Translation3};

    fn calibration() -> StereoCalibration {
        let distortion = Distortion { radial: [-0.28, 0.07, 0.0], tangential: [2e-4, 2e-5] };
        let left = Camera { size: [320, 240], focal: [195.0, 194.0], center: [156.0, 124.0], distortion };
        let right = Camera { focal: [194.0, 193.0], center: [161.0, 127.0], ..left };
        let turn = UnitQuaternion::from_euler_angles(0.02, -0.03, 0.015);
        let right_from_left = Isometry3::from_parts(Translation3::new(-0.11, 0.004, -0.003), turn);
        StereoCalibration { left, right, right_from_left }
    }

    /// A spot of light as a camera sees it, and the middle of a spot as an image shows it.
    fn spot([column, row]: [f64; 2]) -> Image {
        let grey = |r: usize, c: usize| 250.0 * (-((r as f64 - row).powi(2) + (c as f64 - column).powi(2)) / 6.0).exp();
        Image::from_fn(320, 240, |row, column| grey(row, column) as u8).unwrap()
    }

    fn middle_of(image: &Image) -> [f64; 2] {
        let mut sums = [0.0; 3];
        for row in 0..image.height() {
            for (column, &grey) in image.row(row).iter().enumerate() {
                let grey = f64::from(grey);
                sums = [sums[0] + grey, sums[1] + grey * row as f64, sums[2] + grey * column as f64];
            }
        }
        [sums[1] / sums[0], sums[2] / sums[0]]
    }

    #[test]
    fn a_point_is_seen_in_one_row_and_triangulated_where_it_is() {
        let calibration = calibration();
        let rectification = Rectification::new(&calibration).unwrap();
        for (x, y, z) in [(0.0, 0.0, 1.0), (0.4, 0.2, 1.2), (-0.5, -0.4, 1.5), (0.6, -0.3, 2.0), (-0.3, 0.5, 1.1)] {
            let point = Point3::new(x, y, z);
            let there = calibration.right_from_left * point;
            let left = calibration.left.pixel([x / z, y / z]);
            let right = calibration.right.pixel([there.x / there.z, there.y / there.z]);
            let [left, right] = rectification.rectify(&spot(left), &spot(right)).unwrap();
            let ([row, column], [right_row, right_column]) = (middle_of(&left), middle_of(&right));
            assert!((row - right_row).abs() < 0.1, "{point}: rows {row} and {right_row}");
            let seen = rectification.rig().point(row, column, column - right_column).unwrap();
            let seen = rectification.left_from_rectified() * seen;
            assert!((seen - point).norm() < 0.02 * z * z, "{point} is seen at {seen}");
        }
    }

    #[test]
    fn cameras_that_are_no_pair_are_said() {
        let good = calibration();
        let said = |calibration: StereoCalibration| Rectification::new(&calibration).unwrap_err().to_string();
        let moved = |x, y, z| {
            let right_from_left = Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity());
            StereoCalibration { right_from_left, ..good }
        };
        assert!(said(moved(0.0, 0.0, 0.0)).starts_with("a baseline of 0 m"), "{}", said(moved(0.0, 0.0, 0.0)));
        let swapped = "the right camera is -0.110 m right, 0.000 m below and 0.000 m ahead of the left one: it has to be on its \
                       right; are the cameras swapped?";
        assert_eq!(said(moved(0.11, 0.0, 0.0)), swapped);
        let back_to_back = UnitQuaternion::from_euler_angles(0.0, std::f64::consts::PI, 0.0);
        let back_to_back = Isometry3::from_parts(Translation3::new(0.11, 0.0, 0.0), back_to_back);
        assert!(said(StereoCalibration { right_from_left: back_to_back, ..good }).contains("axes are 180° apart"));
        let small = Camera { size: [100, 100], ..good.right };
        assert!(
            said(StereoCalibration { right: small, ..good })
                .contains("[320, 240] pixels and a right one of [100, 100]")
        );

        // Regression: rectified images of such lenses were black, and it was said that nothing matched.
        let folded = Distortion { radial: [-500.0, 0.0, 0.0], tangential: [0.0; 2] };
        let right = Camera { distortion: folded, center: [159.5, 119.5], ..good.right };
        let folded = said(StereoCalibration { right, ..good });
        assert!(folded.starts_with("of the rectified right image 0.") && folded.contains("at least 10 %"), "{folded}");
        let aside = said(StereoCalibration { left: Camera { center: [5000.0, 124.0], ..good.left }, ..good });
        assert!(aside.starts_with("the left lens shows no ray in the middle"), "{aside}");

        let image = |width| Image::from_fn(width, 240, |_, _| 0).unwrap();
        let error = Rectification::new(&good).unwrap().rectify(&image(320), &image(319)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "a right image of [319, 240] pixels: [320, 240], as its camera was calibrated, would be right"
        );
    }
}
