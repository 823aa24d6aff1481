//! A pinhole camera: which way each pixel looks.

use elk_spatial::CameraInfo;
use nalgebra::{Point3, Vector3};

/// A pinhole camera with square pixels. Pixel coordinates: u to the right, v down, the image from (0, 0) to
/// (width, height), so that the centre of the first pixel is (0.5, 0.5).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length (px).
    pub focal_px: f64,
}

impl Camera {
    /// A camera of `width` × `height` pixels that sees `fov_x` (rad, below π) from the left to the right edge of its image.
    pub fn new(width: u32, height: u32, fov_x: f64) -> Self {
        Self { width, height, focal_px: f64::from(width) / 2.0 / (fov_x / 2.0).tan() }
    }

    /// What whoever reads its scans is to know of it; it sees `range_m` far, 0: as far as there is anything.
    pub fn info(&self, range_m: f64) -> CameraInfo {
        let angle = |pixels: u32| 2.0 * (f64::from(pixels) / 2.0 / self.focal_px).atan();
        let (fov_x, fov_y) = (angle(self.width), angle(self.height));
        CameraInfo { columns: self.width, rows: self.height, fov_x, fov_y, range_m, inverse_depth_sigma: 0.0 }
    }

    /// The pixels' centres (px), row by row.
    pub fn pixels(&self) -> impl Iterator<Item = (f64, f64)> + use<> {
        let (width, height) = (self.width, self.height);
        (0..height).flat_map(move |v| (0..width).map(move |u| (f64::from(u) + 0.5, f64::from(v) + 0.5)))
    }

    /// The viewing direction at (u, v) in the camera frame (x right, y down, z forward), of depth 1: its multiples are
    /// the points that project there.
    pub fn direction(&self, u: f64, v: f64) -> Vector3<f64> {
        Vector3::new(
            (u - f64::from(self.width) / 2.0) / self.focal_px,
            (v - f64::from(self.height) / 2.0) / self.focal_px,
            1.0,
        )
    }

    /// The point (m, camera frame) seen at (u, v) at `depth` (m along the optical axis).
    pub fn point(&self, u: f64, v: f64, depth: f64) -> Point3<f64> {
        Point3::from(self.direction(u, v) * depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_spans_the_field_of_view_with_square_pixels() {
        let camera = Camera::new(100, 50, 75_f64.to_radians());
        let left = camera.direction(0.0, 25.0);
        let top = camera.direction(50.0, 0.0);
        assert!((left.x.atan2(left.z).to_degrees() + 37.5).abs() < 1e-9 && left.y == 0.0);
        assert!((top.y * 2.0 - left.x).abs() < 1e-12 && top.x == 0.0, "half as high as wide");
        assert_eq!(camera.direction(50.0, 25.0), Vector3::z());
        let info = camera.info(5.0);
        assert!((info.fov_x.to_degrees() - 75.0).abs() < 1e-9 && info.fov_y < info.fov_x, "{info:?}");
        assert_eq!((info.columns, info.rows, info.range_m), (100, 50, 5.0));
    }

    #[test]
    fn pixels_come_row_by_row_from_the_top_left() {
        let pixels: Vec<_> = Camera::new(2, 2, 1.0).pixels().collect();
        assert_eq!(pixels, [(0.5, 0.5), (1.5, 0.5), (0.5, 1.5), (1.5, 1.5)]);
    }
}
