//! Depth images into points.

use nalgebra::Point3;

/// A depth camera without lens distortion: what its images' pixels look at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthCamera {
    /// Focal lengths along columns and rows, pixels.
    pub focal: [f32; 2],
    /// The column and the row of the optical axis, pixels.
    pub centre: [f32; 2],
    /// Metres of one count of depth.
    pub unit: f32,
    /// Depths that are believed, metres: from, and up to. Cameras say 0 or the largest count of what they do not see.
    pub range: [f32; 2],
}

/// A depth image that is none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DepthError {
    /// Pixels that fill no rows.
    #[error("{pixels} pixels in rows of {width}: a whole number of rows would be right")]
    Size {
        /// How many pixels.
        pixels: usize,
        /// Pixels of a row.
        width: usize,
    },
    /// A camera that looks nowhere.
    #[error("{name} of {found}: a finite number above 0 would be right")]
    Camera {
        /// Which number.
        name: &'static str,
        /// Its value.
        found: f32,
    },
}

impl DepthCamera {
    /// The points that an image shows, row by row of each `stride`-th row and column, as far as there is a depth. In the camera's frame, metres: x to the
    /// right, y down, z ahead.
    ///
    /// # Errors
    /// Pixels that fill no rows, and focal lengths or units that are none.
    pub fn points(&self, depths: &[u16], width: usize, stride: usize) -> Result<Vec<Point3<f32>>, DepthError> {
        let numbers = [("focal length", self.focal[0]), ("focal length", self.focal[1]), ("unit", self.unit)];
        if let Some((name, found)) = numbers.into_iter().find(|(_, found)| !(found.is_finite() && *found > 0.0)) {
            return Err(DepthError::Camera { name, found });
        }
        if width == 0 || !depths.len().is_multiple_of(width) {
            return Err(DepthError::Size { pixels: depths.len(), width });
        }
        let point = |row: usize, column: usize, depth: u16| {
            let z = f32::from(depth) * self.unit;
            let [x, y] =
                [(column as f32 - self.centre[0]) / self.focal[0], (row as f32 - self.centre[1]) / self.focal[1]];
            (self.range[0]..=self.range[1]).contains(&z).then(|| Point3::new(x * z, y * z, z))
        };
        let rows = depths.chunks_exact(width).enumerate().step_by(stride.max(1));
        let pixels = rows.flat_map(|(row, depths)| {
            depths.iter().enumerate().step_by(stride.max(1)).map(move |(column, &depth)| (row, column, depth))
        });
        Ok(pixels.filter_map(|(row, column, depth)| point(row, column, depth)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: DepthCamera =
        DepthCamera { focal: [500.0, 400.0], centre: [1.0, 1.0], unit: 0.001, range: [0.2, 5.0] };

    #[test]
    fn pixels_become_points() {
        let depths = [0, 2000, 65535, 1000, 1000, 4000];
        let points = CAMERA.points(&depths, 3, 1).unwrap();
        let wanted = [[0.0, -0.005, 2.0], [-0.002, 0.0, 1.0], [0.0, 0.0, 1.0], [0.008, 0.0, 4.0]];
        let near = |(point, wanted): (&Point3<f32>, &[f32; 3])| (point - Point3::from(*wanted)).norm() < 1e-6;
        assert!(points.len() == 4 && points.iter().zip(&wanted).all(near), "{points:?}");
        assert_eq!(
            CAMERA.points(&depths, 3, 2).unwrap(),
            [],
            "of the first row the first and the third, which see nothing"
        );
    }

    #[test]
    fn images_that_are_none_are_said() {
        let said = |camera: DepthCamera, width| camera.points(&[1; 10], width, 1).unwrap_err().to_string();
        assert_eq!(said(CAMERA, 3), "10 pixels in rows of 3: a whole number of rows would be right");
        assert_eq!(said(CAMERA, 0), "10 pixels in rows of 0: a whole number of rows would be right");
        let blind = DepthCamera { focal: [500.0, f32::NAN], ..CAMERA };
        assert_eq!(said(blind, 5), "focal length of NaN: a finite number above 0 would be right");
    }
}
