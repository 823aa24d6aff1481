//! What was seen in a pair, and its files.

use elk_spatial::pixels::PixelTally;
use elk_stereo::{Disparity, Image, Noise, Rectification, Rig, Unmatched};
use nalgebra::UnitQuaternion;
use png::{BitDepth, ColorType, Encoder, EncodingError};

use super::seen::pixel_runs;

/// Parts of a pixel that a disparity of 1 has in a file, as in KITTI's.
const PARTS: f32 = 256.0;
/// Columns and rows of the plan.
const PLAN: usize = 480;
/// Columns between the two halves of the picture.
const GAP: usize = 4;

/// What was seen in a pair.
#[derive(Debug, Clone)]
pub struct Outcome {
    rig: Rig,
    left_from_rectified: UnitQuaternion<f64>,
    /// The left and the right image, rectified.
    images: [Image; 2],
    disparity: Disparity,
}

impl Outcome {
    pub(super) fn new(rectification: &Rectification, images: [Image; 2], disparity: Disparity) -> Self {
        Self { rig: *rectification.rig(), left_from_rectified: rectification.left_from_rectified(), images, disparity }
    }

    /// The left and the right image, rectified.
    pub fn into_images(self) -> [Image; 2] {
        self.images
    }

    /// The disparities of the rectified left image.
    pub fn disparity(&self) -> &Disparity {
        &self.disparity
    }

    /// How many pixels were matched, how near and far (m), and why the others were not.
    pub fn summary(&self) -> String {
        let mut depths: Vec<f64> = self.rig.cloud(&self.disparity).map(|(_, _, point)| point.z).collect();
        depths.sort_by(f64::total_cmp);
        let reasons = PixelTally::of(&pixel_runs(&self.disparity));
        let matched = format!(
            "{} of {} pixels matched ({:.1} %); {reasons}",
            depths.len(),
            self.images[0].pixels().len(),
            self.disparity.density() * 100.0
        );
        match depths[..] {
            [nearest, .., farthest] => {
                let median = depths[depths.len() / 2];
                format!("{matched}\n{nearest:.2} to {farthest:.2} m ahead, half of it nearer than {median:.2} m")
            }
            _ => matched,
        }
    }

    /// The disparities as a PNG of 16 bits grey: 256 times the disparity in pixels, 0 where there is none (as KITTI has it).
    ///
    /// # Errors
    /// It cannot be encoded.
    pub fn disparity_png(&self) -> Result<Vec<u8>, EncodingError> {
        // Disparities are below 256, so that all fit.
        let part = |said: Result<f32, Unmatched>| said.map_or(0, |disparity| (disparity * PARTS).round() as u16);
        let bytes: Vec<u8> = self.disparity.iter().flat_map(|said| part(said).to_be_bytes()).collect();
        encoded([self.images[0].width(), self.images[0].height()], ColorType::Grayscale, BitDepth::Sixteen, &bytes)
    }

    /// A picture as a PNG: the rectified left image, and beside it the disparities, red near and blue far. What was not matched is
    /// dark, by why not.
    ///
    /// # Errors
    /// It cannot be encoded.
    pub fn picture_png(&self) -> Result<Vec<u8>, EncodingError> {
        let (width, height) = (self.images[0].width(), self.images[0].height());
        let nearest = self.disparity.iter().flatten().fold(1.0, f32::max);
        let mut bytes = Vec::with_capacity(3 * (2 * width + GAP) * height);
        for row in 0..height {
            bytes.extend(self.images[0].row(row).iter().flat_map(|&grey| [grey; 3]));
            bytes.extend([255; 3 * GAP]);
            bytes.extend((0..width).flat_map(|column| match self.disparity.get(row, column) {
                Ok(disparity) => colour(disparity / nearest),
                Err(reason) => dark(reason),
            }));
        }
        encoded([2 * width + GAP, height], ColorType::Rgb, BitDepth::Eight, &bytes)
    }

    /// The points from above as a PNG, each with the grey level of its pixel, the cameras below in the middle, and a line every metre.
    /// Of the points, the farthest hundredth is outside.
    ///
    /// # Errors
    /// It cannot be encoded.
    pub fn plan_png(&self) -> Result<Vec<u8>, EncodingError> {
        let mut points: Vec<_> = self.rig.cloud(&self.disparity).collect();
        points.sort_by(|one, other| one.2.z.total_cmp(&other.2.z));
        let farthest = points.get(points.len() * 99 / 100).map_or(1.0, |(_, _, point)| point.z);
        let per_metre = (PLAN - 1) as f64 / farthest;
        let pixel = |x: f64, z: f64| {
            let (column, row) = (PLAN as f64 / 2.0 + x * per_metre, (PLAN - 1) as f64 - z * per_metre);
            let is_inside = (0.0..PLAN as f64).contains(&column) && (0.0..PLAN as f64).contains(&row);
            is_inside.then(|| 3 * (row as usize * PLAN + column as usize))
        };
        let mut bytes = vec![255; 3 * PLAN * PLAN];
        let middle = PLAN as f64 / 2.0 / per_metre;
        for metre in 0..=(farthest as usize).min(PLAN) {
            let steps = (0..PLAN).map(|i| i as f64 / per_metre);
            let lines = steps.flat_map(|step| {
                let (metre, across) = (metre as f64, step - middle);
                [(across, metre), (metre, step), (-metre, step)]
            });
            lines.filter_map(|(x, z)| pixel(x, z)).for_each(|at| bytes[at..at + 3].copy_from_slice(&[200, 215, 235]));
        }
        // The nearest last, before the others.
        for (row, column, point) in points.iter().rev() {
            let grey = self.images[0].row(*row)[*column] / 2;
            if let Some(at) = pixel(point.x, point.z) {
                bytes[at..at + 3].copy_from_slice(&[grey, grey, grey + 40]);
            }
        }
        encoded([PLAN, PLAN], ColorType::Rgb, BitDepth::Eight, &bytes)
    }

    /// The points as a PLY (binary, little endian), in the frame of the calibrated left camera (x right, y down, z forward; m), each
    /// with the grey level of its pixel and the standard deviation of its depth (m; thesis 6.5.3).
    pub fn cloud_ply(&self) -> Vec<u8> {
        let cloud: Vec<_> = self.rig.cloud(&self.disparity).collect();
        let mut bytes = format!(
            "ply\nformat binary_little_endian 1.0\ncomment x right, y down, z forward, metres\nelement vertex {}\n\
             property float x\nproperty float y\nproperty float z\nproperty float deviation\nproperty uchar red\n\
             property uchar green\nproperty uchar blue\nend_header\n",
            cloud.len()
        )
        .into_bytes();
        let scale = self.rig.focal() * self.rig.baseline();
        for (row, column, point) in cloud {
            let deviation = point.z * point.z / scale * Noise::default().disparity;
            let point = self.left_from_rectified * point;
            let numbers = [point.x, point.y, point.z, deviation];
            bytes.extend(numbers.into_iter().flat_map(|number| (number as f32).to_le_bytes()));
            bytes.extend([self.images[0].row(row)[column]; 3]);
        }
        bytes
    }
}

/// The colour of a pixel that was not matched: grey without texture, black out of range, purple if ambiguous, brown if the right image
/// sees it otherwise, and dark green in too small a component.
const fn dark(reason: Unmatched) -> [u8; 3] {
    match reason {
        Unmatched::Textureless => [110; 3],
        Unmatched::OutOfRange => [0; 3],
        Unmatched::Ambiguous => [90, 0, 90],
        Unmatched::Inconsistent => [95, 50, 10],
        Unmatched::SmallComponent => [0, 70, 50],
    }
}

/// A colour from blue (0) over green to red (1).
fn colour(share: f32) -> [u8; 3] {
    let hump = |middle: f32| ((1.5 - (4.0 * share - middle).abs()).clamp(0.0, 1.0) * 255.0).round() as u8;
    [hump(3.0), hump(2.0), hump(1.0)]
}

fn encoded(
    [width, height]: [usize; 2],
    colour: ColorType,
    depth: BitDepth,
    bytes: &[u8],
) -> Result<Vec<u8>, EncodingError> {
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()?;
    Ok(file)
}
