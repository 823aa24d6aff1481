//! Calibrations as EuRoC's recordings and OpenCV write them.

mod yaml;

use nalgebra::{DMatrix, Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::camera::{Camera, Distortion, StereoCalibration};
use yaml::Document;

pub use yaml::YamlError;

/// Why a text is no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// The text cannot be read.
    #[error(transparent)]
    Yaml(#[from] YamlError),
    /// An entry that a calibration needs is not there.
    #[error("there is no {name}: {right} would be right")]
    Missing {
        /// The entry.
        name: &'static str,
        /// What it should be.
        right: &'static str,
    },
    /// An entry is there that means something else.
    #[error("line {line}: {name} is {found}: {right} would be right")]
    Entry {
        /// Where it stands, counted from 1.
        line: usize,
        /// The entry.
        name: &'static str,
        /// What stands there.
        found: String,
        /// What should.
        right: &'static str,
    },
}

/// Reads the two files of EuRoC's recordings, `cam0/sensor.yaml` of the left and `cam1/sensor.yaml` of the right camera: `intrinsics`,
/// `resolution`, `distortion_coefficients` of a `radial-tangential` lens, and `T_BS`, the camera's pose in the body's frame, in metres.
///
/// # Errors
/// What cannot be read, is missing or means something else, with its line.
pub fn euroc(left: &str, right: &str) -> Result<StereoCalibration, CalibrationError> {
    let [(left, body_from_left), (right, body_from_right)] = [euroc_camera(left)?, euroc_camera(right)?];
    Ok(StereoCalibration { left, right, right_from_left: body_from_right.inverse() * body_from_left })
}

/// Where a camera is on the body that carries it: `T_BS` of EuRoC's file of a camera, which takes points (m) from its frame to the body's, in
/// which recorded poses are.
///
/// # Errors
/// As [`euroc`].
pub fn euroc_body_from_camera(text: &str) -> Result<Isometry3<f64>, CalibrationError> {
    Ok(euroc_camera(text)?.1)
}

fn euroc_camera(text: &str) -> Result<(Camera, Isometry3<f64>), CalibrationError> {
    let document = Document::read(text)?;
    let entries = Entries(&document);
    entries.word("camera_model", "pinhole")?;
    entries.word("distortion_model", "radial-tangential")?;
    let [width, height] = entries.numbers("resolution", "two whole numbers, columns and rows")?;
    let [fx, fy, cx, cy] = entries.numbers("intrinsics", "four numbers, fu, fv, cu and cv in pixels")?;
    let [k1, k2, p1, p2] = entries.numbers("distortion_coefficients", "four numbers, k1, k2, p1 and p2")?;
    let pose: [f64; 16] = entries.numbers("T_BS", "a 4 × 4 matrix, a rotation and metres")?;
    if pose[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(entries.wrong("T_BS", "a rotation and metres, and 0, 0, 0, 1 below"));
    }
    let pose = DMatrix::from_row_slice(4, 4, &pose);
    let rotation = entries.rotation("T_BS", pose.fixed_view::<3, 3>(0, 0).into_owned())?;
    let translation = Translation3::from(pose.fixed_view::<3, 1>(0, 3).into_owned());
    let camera = Camera {
        size: entries.size("resolution", [width, height])?,
        focal: entries.focal("intrinsics", [fx, fy])?,
        center: [cx, cy],
        distortion: Distortion { radial: [k1, k2, 0.0], tangential: [p1, p2] },
    };
    Ok((camera, Isometry3::from_parts(translation, rotation)))
}

/// Reads what OpenCV's `stereoCalibrate` gives, as its samples write it by `FileStorage`, of both cameras in one text: camera matrices
/// `M1`, `M2`, lenses `D1`, `D2`, and `R`, `T`, which take points from the left camera's frame to the right one's, in metres; `image_width`
/// and `image_height` in pixels.
///
/// # Errors
/// What cannot be read, is missing or means something else, with its line.
pub fn opencv(text: &str) -> Result<StereoCalibration, CalibrationError> {
    let document = Document::read(text)?;
    let entries = Entries(&document);
    let [width] = entries.numbers("image_width", "a whole number of columns")?;
    let [height] = entries.numbers("image_height", "a whole number of rows")?;
    let size = entries.size("image_width", [width, height])?;
    let rotation: [f64; 9] =
        entries.numbers("R", "a 3 × 3 rotation from the left camera's frame to the right one's")?;
    let translation: [f64; 3] =
        entries.numbers("T", "three numbers, where the left camera is in the right one's frame, in metres")?;
    let rotation = entries.rotation("R", Matrix3::from_row_slice(&rotation))?;
    let right_from_left = Isometry3::from_parts(Translation3::from(Vector3::from(translation)), rotation);
    Ok(StereoCalibration {
        left: opencv_camera(&entries, ["M1", "D1"], size)?,
        right: opencv_camera(&entries, ["M2", "D2"], size)?,
        right_from_left,
    })
}

fn opencv_camera(
    entries: &Entries,
    [matrix, lens]: [&'static str; 2],
    size: [usize; 2],
) -> Result<Camera, CalibrationError> {
    let right = "a 3 × 3 camera matrix without skew, fx 0 cx / 0 fy cy / 0 0 1";
    let m: [f64; 9] = entries.numbers(matrix, right)?;
    if [m[1], m[3], m[6], m[7], m[8]] != [0.0, 0.0, 0.0, 0.0, 1.0] {
        return Err(entries.wrong(matrix, right));
    }
    let right = "four or five numbers, k1, k2, p1, p2 and k3; further ones 0";
    let coefficients = entries.list(lens, right)?;
    let (&[k1, k2, p1, p2], rest) = coefficients.split_first_chunk().ok_or_else(|| entries.wrong(lens, right))?;
    if rest.iter().skip(1).any(|&coefficient| coefficient != 0.0) {
        return Err(entries.wrong(lens, right));
    }
    let distortion = Distortion { radial: [k1, k2, rest.first().copied().unwrap_or(0.0)], tangential: [p1, p2] };
    Ok(Camera { size, focal: entries.focal(matrix, [m[0], m[4]])?, center: [m[2], m[5]], distortion })
}

/// The entries of a calibration, each with what it should be.
struct Entries<'a>(&'a Document);

impl Entries<'_> {
    fn wrong(&self, name: &'static str, right: &'static str) -> CalibrationError {
        match self.0.get(name) {
            Some(entry) => CalibrationError::Entry { line: entry.line, name, found: entry.shown(), right },
            None => CalibrationError::Missing { name, right },
        }
    }

    /// That an entry, where there is one, is a word.
    fn word(&self, name: &'static str, right: &'static str) -> Result<(), CalibrationError> {
        match self.0.only(name)? {
            Some(entry) if entry.text != right => Err(self.wrong(name, right)),
            _ => Ok(()),
        }
    }

    /// Finite numbers.
    fn list(&self, name: &'static str, right: &'static str) -> Result<Vec<f64>, CalibrationError> {
        let numbers = self.0.only(name)?.and_then(|entry| entry.numbers());
        numbers.filter(|all| all.iter().all(|x| x.is_finite())).ok_or_else(|| self.wrong(name, right))
    }

    /// So many of them.
    fn numbers<const N: usize>(&self, name: &'static str, right: &'static str) -> Result<[f64; N], CalibrationError> {
        self.list(name, right)?.try_into().map_err(|_| self.wrong(name, right))
    }

    fn size(&self, name: &'static str, sides: [f64; 2]) -> Result<[usize; 2], CalibrationError> {
        let is_side = |side: f64| side.fract() == 0.0 && (1.0..=crate::Image::MAX_SIDE as f64).contains(&side);
        match sides.into_iter().all(is_side) {
            true => Ok(sides.map(|side| side as usize)),
            false => Err(self.wrong(name, "columns and rows of 1 to 16384 pixels")),
        }
    }

    fn focal(&self, name: &'static str, focal: [f64; 2]) -> Result<[f64; 2], CalibrationError> {
        match focal.into_iter().all(|f| f > 0.0) {
            true => Ok(focal),
            false => Err(self.wrong(name, "positive focal lengths, without which the camera is singular")),
        }
    }

    fn rotation(&self, name: &'static str, matrix: Matrix3<f64>) -> Result<UnitQuaternion<f64>, CalibrationError> {
        let off = (matrix * matrix.transpose() - Matrix3::identity()).norm();
        match off < 1e-3 && matrix.determinant() > 0.0 {
            // The nearest rotation, looked for from one that is near: of half a turn, some are not found from the identity.
            true => {
                let near = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
                Ok(UnitQuaternion::from_matrix_eps(&matrix, f64::EPSILON, 0, near))
            }
            false => Err(self.wrong(name, "a rotation, with columns of length 1 at right angles")),
        }
    }
}

#[cfg(test)]
mod tests;
