//! What a measured depth says of the voxels along its ray, if the sensor errs along it: an inverse sensor model (Thrun, Burgard
//! and Fox, *Probabilistic Robotics*, 2005, section 9.3) of stereo, whose error is Gaussian in inverse depth.
//!
//! Before the measured depth a voxel is free, up to what is certain. About it each voxel is asked whether the surface lies behind
//! its far end, or before: of each surface the rays that err by too little and those that err by too much balance where it is,
//! however large their error, so that many of them find it more precisely than one. That is what a truncated signed distance is
//! fused for (Curless and Levoy, *A Volumetric Method for Building Complex Models from Range Images*, 1996), as log-odds.

use nalgebra::{Point3, Vector3};

/// How a depth camera errs along its rays. Of stereo: `σ_d / (f·B)` for matching errors of σ_d (px), a focal length f (px) and a
/// baseline B (m); so that depth z has the error `σ_z = z² · σ_d / (f·B)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthError {
    /// Standard deviation of inverse depth (1/m), above 0.
    pub inverse_depth_sigma: f64,
    /// The optical axis, along which depth is measured (unit vector, world).
    pub axis: Vector3<f64>,
}

/// So many standard deviations before the measured depth a voxel is free for certain: of 30,000 rays one errs by more.
const CERTAIN: f64 = 4.0;
/// So many behind it nothing is known.
const LIKELY: f64 = 2.5;
/// Before a surface so many voxels at least are asked, however exact the depth: more than a voxel's diagonal, so that the voxel
/// before the surface's is one of them.
const LEAST_VOXELS: f64 = 1.8;
/// Half a voxel's edge over the standard deviation, squared: if it is less, the depth says nothing of where its surface is.
const LEAST_FINENESS: f64 = 1.0 / 32.0;
/// From there on a hit is as sure as it can be.
const MOST_FINENESS: f64 = 100.0;
/// What a ray that has passed counts beside one that has not: a surface that fills a part of a voxel is passed by some.
const PASSED: f64 = 0.5;
/// The log-odds of a normal distribution's share below `a` are nearly this times `a` (Bowling et al., 2009, to first order).
const SLOPE: f64 = 1.6;

/// A measured depth, as far as a ray goes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measured {
    origin: Point3<f64>,
    /// Direction of the ray (unit vector).
    direction: Vector3<f64>,
    /// Inverse of the measured range, and its standard deviation (1/m).
    inverse: f64,
    sigma: f64,
    /// Half a voxel's edge over the standard deviation of the range, squared.
    fineness: f64,
    resolution: f64,
}

impl DepthError {
    /// The measurement of `point`, seen from `origin` (both m, world), for voxels of an edge of `resolution` (m). `None`: it does
    /// not lie before the camera.
    pub(crate) fn of(&self, origin: Point3<f64>, point: Point3<f64>, resolution: f64) -> Option<Measured> {
        let offset = point - origin;
        let range = offset.norm();
        let direction = offset / range;
        let sigma = self.inverse_depth_sigma * direction.dot(&self.axis);
        let is_before = range.is_finite() && sigma > 0.0;
        let fineness = (0.5 * resolution / (range * range * sigma)).powi(2);
        is_before.then(|| Measured { origin, direction, inverse: 1.0 / range, sigma, fineness, resolution })
    }
}

impl Measured {
    /// Up to where it is free for certain (m, world).
    pub fn certain_end(&self) -> Point3<f64> {
        let certain = 1.0 / (self.inverse + CERTAIN * self.sigma);
        let range = certain.min(1.0 / self.inverse - LEAST_VOXELS * self.resolution);
        self.at(range.max(0.0))
    }

    /// Up to where the surface may be (m, world); `None`: it may be nearly anywhere.
    pub fn likely_end(&self) -> Option<Point3<f64>> {
        let least = self.inverse - LIKELY * self.sigma;
        // As fine as that, it lies behind the measured point; the other holds where rounding would not have it so.
        (self.fineness >= LEAST_FINENESS && least > 0.0).then(|| self.at(1.0 / least))
    }

    /// Whether the surface is behind a voxel of index `voxel` on the ray (below 0), or in it or before (above 0), as weight
    /// of evidence: near the surface in proportion to the distance, and the more, the finer the depth.
    pub fn evidence(&self, voxel: [i32; 3]) -> f64 {
        let deviations = (self.inverse - 1.0 / self.exit(voxel)) / self.sigma;
        let odds = (SLOPE * deviations).clamp(-1.0, 1.0);
        let weight = if odds > 0.0 { self.fineness.min(MOST_FINENESS) } else { PASSED * self.fineness.min(1.0) };
        odds * weight
    }

    /// Where the ray leaves a voxel (m from its origin).
    fn exit(&self, voxel: [i32; 3]) -> f64 {
        let ends = (0..3).filter(|axis| self.direction[*axis] != 0.0).map(|axis| {
            let far = voxel[axis] + i32::from(self.direction[axis] > 0.0);
            (f64::from(far) * self.resolution - self.origin[axis]) / self.direction[axis]
        });
        // By rounding the ray may have left it at its very origin.
        ends.fold(f64::INFINITY, f64::min).max(1e-6 * self.resolution)
    }

    fn at(&self, range: f64) -> Point3<f64> {
        self.origin + self.direction * range
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ERROR: DepthError = DepthError { inverse_depth_sigma: 0.02, axis: Vector3::new(1.0, 0.0, 0.0) };

    fn measured(range: f64) -> Measured {
        ERROR.of(Point3::origin(), Point3::new(range, 0.0, 0.0), 0.1).unwrap()
    }

    #[test]
    fn free_is_what_is_four_standard_deviations_before_and_a_voxel() {
        // 1 / (1/2 + 0.08) and 2.5 standard deviations behind: 1 / (1/2 - 0.05)
        let [near, far] = [measured(2.0).certain_end().x, measured(2.0).likely_end().unwrap().x];
        assert!((near - 1.0 / 0.58).abs() < 1e-12 && (far - 1.0 / 0.45).abs() < 1e-12);
        assert!((measured(0.5).certain_end().x - 0.32).abs() < 1e-12, "so near, a voxel's diagonal");
        assert_eq!(measured(0.1).certain_end(), Point3::origin());
    }

    #[test]
    fn it_is_an_error_of_depth_and_not_of_range() {
        // At 60° from the axis depth is half the range, and so is the error of its inverse.
        let aside = ERROR.of(Point3::origin(), Point3::new(1.0, 3f64.sqrt(), 0.0), 0.1).unwrap();
        assert!((aside.sigma - 0.01).abs() < 1e-12 && (aside.inverse - 0.5).abs() < 1e-12);
        assert!(ERROR.of(Point3::origin(), Point3::new(-1.0, 1.0, 0.0), 0.1).is_none(), "behind the camera");
    }

    #[test]
    fn evidence_turns_where_the_depth_was_measured() {
        let ray = measured(1.93);
        let evidence: Vec<f64> = (15..24).map(|x| ray.evidence([x, 0, 0])).collect();
        assert!(evidence.windows(2).all(|pair| pair[0] <= pair[1]), "{evidence:?}");
        assert!(evidence[3] < 0.0 && evidence[4] > 0.0, "it ended in voxel 19: {evidence:?}");
        // As log-odds, near the surface: 0.03 m behind the end of voxel 18, of an error of 0.0745 m.
        let deviations = (1.0 / 1.93 - 1.0 / 1.9) / 0.02;
        assert!((evidence[3] - PASSED * ray.fineness.min(1.0) * SLOPE * deviations).abs() < 1e-12);
    }

    #[test]
    fn the_farther_the_less_is_said() {
        let said = |range: f64| measured(range).evidence([(range * 10.0) as i32 + 5, 0, 0]);
        assert!(said(1.0) > said(1.5) && said(1.5) > said(2.5) && said(2.5) > 0.0);
        assert!((measured(2.0).fineness - (0.05f64 / 0.08).powi(2)).abs() < 1e-12);
        assert!(measured(4.0).likely_end().is_none(), "0.32 m of error");
    }
}
