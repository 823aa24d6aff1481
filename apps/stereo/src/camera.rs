//! A camera: a pinhole behind a lens (thesis 3.2.1).

use nalgebra::{Isometry3, Point3};

/// What a camera is inside (thesis 3.6), and what its lens does (3.2.1.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Columns and rows.
    pub size: [usize; 2],
    /// α_x and α_y, in pixels.
    pub focal: [f64; 2],
    /// The principal point x₀, y₀ (column and row), in pixels.
    pub center: [f64; 2],
    /// The lens.
    pub distortion: Distortion,
}

/// Radial and tangential distortion (Brown 1966; the coefficients k₁, k₂, p₁, p₂, k₃ are in the order of OpenCV).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// k₁, k₂ and k₃, of r², r⁴ and r⁶.
    pub radial: [f64; 3],
    /// p₁ and p₂.
    pub tangential: [f64; 2],
}

impl Distortion {
    /// Where the lens puts a ray that without it would pass (x, y) at unit distance.
    pub fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let ([k1, k2, k3], [p1, p2]) = (self.radial, self.tangential);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    }

    /// The square of the distance from the axis up to which the lens keeps rays in their order: beyond, the polynomial turns back and
    /// is no lens any more. At most 16, a view of 152°.
    pub fn limit(&self) -> f64 {
        let [k1, k2, k3] = self.radial;
        let grows = |r2: f64| 1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3)) > 0.0;
        (1..=16_000).map(|i| f64::from(i) * 1e-3).take_while(|&r2| grows(r2)).last().unwrap_or(0.0)
    }

    /// The inverse, by the fixed point of what the lens adds; lenses that fold the image over have none, and rays outside of what a
    /// lens images come out somewhere.
    pub fn undistort(&self, distorted: [f64; 2]) -> [f64; 2] {
        (0..50).fold(distorted, |[x, y], _| {
            let there = self.distort([x, y]);
            [x + distorted[0] - there[0], y + distorted[1] - there[1]]
        })
    }
}

impl Camera {
    /// The column and row at which the camera sees a ray that passes (x, y) at unit distance.
    pub fn pixel(&self, ray: [f64; 2]) -> [f64; 2] {
        let [x, y] = self.distortion.distort(ray);
        [self.focal[0] * x + self.center[0], self.focal[1] * y + self.center[1]]
    }

    /// The ray that it sees at a column and row, as it passes unit distance.
    pub fn ray(&self, [column, row]: [f64; 2]) -> [f64; 2] {
        self.distortion.undistort([(column - self.center[0]) / self.focal[0], (row - self.center[1]) / self.focal[1]])
    }
}

/// Two calibrated cameras.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoCalibration {
    /// The left camera.
    pub left: Camera,
    /// The right camera.
    pub right: Camera,
    /// Where the right camera sees what the left one sees at a place: x right, y down, z forward, metres.
    pub right_from_left: Isometry3<f64>,
}

impl StereoCalibration {
    /// Where the right camera stands, in the frame of the left one.
    pub fn right_center(&self) -> Point3<f64> {
        self.right_from_left.inverse_transform_point(&Point3::origin())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_ray_is_seen_where_it_comes_from(column in 0.0..752.0f64, row in 0.0..480.0f64) {
            let distortion = Distortion { radial: [-0.28340811, 0.07395907, 0.0], tangential: [0.00019359, 1.76187114e-05] };
            let camera = Camera { size: [752, 480], focal: [458.654, 457.296], center: [367.215, 248.375], distortion };
            let [c, r] = camera.pixel(camera.ray([column, row]));
            prop_assert!((c - column).abs() < 1e-6 && (r - row).abs() < 1e-6, "{c}, {r}");
        }
    }

    #[test]
    fn a_lens_ends_where_it_turns_back() {
        assert_eq!(Distortion::default().limit(), 16.0);
        // 1 + 3 k₁ r² = 0 at r² = 1.
        let barrel = Distortion { radial: [-1.0 / 3.0, 0.0, 0.0], tangential: [0.0; 2] };
        assert!((barrel.limit() - 1.0).abs() < 2e-3, "{}", barrel.limit());
    }

    #[test]
    fn coefficients_do_what_they_are_for() {
        let radial = Distortion { radial: [0.1, 0.01, 0.001], tangential: [0.0; 2] };
        assert_eq!(radial.distort([1.0, 0.0]), [1.111, 0.0]);
        let tangential = Distortion { radial: [0.0; 3], tangential: [0.1, 0.01] };
        // x + 2 p₁ x y + p₂ (r² + 2 x²), y + p₁ (r² + 2 y²) + 2 p₂ x y
        let [x, y] = tangential.distort([1.0, 2.0]);
        assert!((x - (1.0 + 0.4 + 0.07)).abs() < 1e-12 && (y - (2.0 + 1.3 + 0.04)).abs() < 1e-12, "{x}, {y}");
    }
}
