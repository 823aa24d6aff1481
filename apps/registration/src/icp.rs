//! Iterative closest surface: where a cloud is in a map.

use nalgebra::{SMatrix, SVector};

use crate::cloud::Cloud;
use crate::eigen;
use crate::estimate::{Estimate, Health, Lost};
use crate::map::Map;
use crate::moments::Moments;
use crate::pose::Pose;
use crate::resolution::{ConfigError, range};

/// How a pose is looked for, and what is asked of it.
#[derive(Clone, Debug, PartialEq)]
pub struct IcpConfig {
    /// The most steps on a level.
    pub iterations: usize,
    /// A level is done when a step moves points by less than this, in edges of its voxels.
    pub tolerance: f64,
    /// The robust kernel's scale: the residual at which a point counts for a quarter, in standard deviations.
    pub kernel: f64,
    /// The share of the cloud's voxels that has to be on surfaces of the map.
    pub overlap: f64,
    /// How much the points have to say of a direction for it to be known ([`Health::observability`]).
    pub observability: f64,
}

impl Default for IcpConfig {
    fn default() -> Self {
        Self { iterations: 20, tolerance: 0.02, kernel: 6.0, overlap: 0.3, observability: 0.01 }
    }
}

/// Finds poses: iterative closest point, of points on surfaces.
#[derive(Clone, Debug)]
pub struct Icp {
    config: IcpConfig,
}

impl Icp {
    /// So many tolerances may the last step be longer than asked for: a pose that goes to and fro between two neighbours has settled.
    const SETTLED: f64 = 10.0;
    /// The least standard deviation of residuals, in edges of voxels: surfaces are not known better, as they are no planes.
    const LEAST_SIGMA: f64 = 0.05;

    /// One that is so configured.
    ///
    /// # Errors
    /// Numbers out of range.
    pub fn new(config: IcpConfig) -> Result<Self, ConfigError> {
        range("iterations", config.iterations as f64, 1.0, 1000.0)?;
        range("tolerance", config.tolerance, 1e-9, 1.0)?;
        range("kernel", config.kernel, 0.1, 100.0)?;
        range("overlap", config.overlap, 0.0, 1.0)?;
        range("observability", config.observability, 0.0, 1.0)?;
        Ok(Self { config })
    }

    /// The pose near `guess` at which a cloud's points lie on the surfaces of a map.
    ///
    /// Minimises Σ w ρ(n·(R p + t − q)) over the pose, where q is a point of the surface near R p + t and n its normal (Chen and Medioni, Image and
    /// Vision Computing 1992; the thesis, 2.2.2, has point to point, Besl and McKay 1992), by Gauss–Newton steps from the coarsest level
    /// to the finest. ρ is Geman and McClure's, scaled by the median of the residuals at each step; w is √k for a voxel of k points, as points of one
    /// voxel err partly alone and partly together. Along directions of which the points say nothing the step is the one back to the guess
    /// (after Zhang, Kaess and Singh, ICRA 2016).
    ///
    /// # Errors
    /// [`Lost`]: there is no pose that one could stand for.
    ///
    /// # Panics
    /// With a cloud of another resolution than the map's.
    pub fn register<P: Pose<D, N>, const D: usize, const N: usize>(
        &self,
        map: &Map<D>,
        cloud: &Cloud<D>,
        guess: &P,
    ) -> Result<Estimate<P, N>, Lost> {
        assert_eq!(map.resolution(), cloud.resolution(), "a cloud and its map have one resolution");
        guess.check()?;
        let mut pose = *guess;
        let mut iterations = 0;
        // How far the last step moved points, in tolerances.
        let mut moved = f64::INFINITY;
        for level in (0..map.resolution().levels()).rev() {
            let tolerance = self.config.tolerance * map.resolution().voxel(level);
            for _ in 0..self.config.iterations {
                let Some(equations) = self.equations(&matches(map, cloud, level, &pose), map.resolution().voxel(level))
                else {
                    break;
                };
                let (step, length) = equations.step(self.config.observability, &pose.step_to(guess));
                pose = pose.moved(&step);
                iterations += 1;
                moved = length / tolerance;
                if moved < 1.0 {
                    break;
                }
            }
        }
        let step = moved * self.config.tolerance * map.resolution().voxel(0);
        let estimate = self.conclude(map, cloud, pose, iterations)?;
        match moved <= Self::SETTLED {
            true => Ok(estimate),
            false => Err(Lost::Unsettled { iterations, step }),
        }
    }

    fn equations<const D: usize, const N: usize>(
        &self,
        matches: &[Match<D, N>],
        voxel: f64,
    ) -> Option<Equations<D, N>> {
        // With a scale that goes by what fits already, the few points that still could tell the way would be outliers.
        let sigma = deviation(matches)?.max(Self::LEAST_SIGMA * voxel);
        Equations::of(matches, sigma, self.config.kernel)
    }

    /// What is known of a pose that was found.
    fn conclude<P: Pose<D, N>, const D: usize, const N: usize>(
        &self,
        map: &Map<D>,
        cloud: &Cloud<D>,
        pose: P,
        iterations: usize,
    ) -> Result<Estimate<P, N>, Lost> {
        let of = cloud.level(0).len();
        let lost = |inliers| Lost::Overlap { inliers, of, overlap: self.config.overlap };
        let matches = matches(map, cloud, 0, &pose);
        let equations = self.equations(&matches, map.resolution().voxel(0)).ok_or(lost(0))?;
        let limit = (self.config.kernel * equations.sigma).min(map.resolution().voxel(0) / 2.0);
        let on_surface: Vec<f64> = matches.iter().map(|one| one.residual).filter(|r| r.abs() <= limit).collect();
        let inliers = on_surface.len();
        if inliers < N || (inliers as f64) < self.config.overlap * of as f64 {
            return Err(lost(inliers));
        }
        let (observability, directions) = equations.observability();
        let is_unknown = |i: &usize| observability[*i] <= self.config.observability;
        let unknown = (0..N).filter(is_unknown).map(|i| directions.column(i).into_owned()).collect();
        let rms = (on_surface.iter().map(|r| r * r).sum::<f64>() / inliers as f64).sqrt();
        let information = equations.information();
        let health = Health { of, matched: matches.len(), inliers, rms, observability, unknown, iterations };
        Ok(Estimate { pose, information, health })
    }
}

/// One point near a surface.
struct Match<const D: usize, const N: usize> {
    /// How the residual changes with the pose.
    slope: SVector<f64, N>,
    /// The distance from the surface, metres, with a sign.
    residual: f64,
    /// What it counts for beside others, whatever its residual.
    weight: f64,
}

/// The points of a level that are near surfaces.
fn matches<P: Pose<D, N>, const D: usize, const N: usize>(
    map: &Map<D>,
    cloud: &Cloud<D>,
    level: usize,
    pose: &P,
) -> Vec<Match<D, N>> {
    let (rotation, position) = (pose.rotation(), pose.position());
    let moments = cloud.level(level);
    let mean = moments.iter().map(|one| one.count).sum::<f64>() / moments.len() as f64;
    let of = |one: &Moments<D>| {
        let arm = rotation * one.mean;
        let place = arm + position;
        let surface = map.near(&place, level)?;
        let residual = surface.normal.dot(&(place - surface.point));
        Some(Match { slope: P::slope(&surface.normal, &arm), residual, weight: (one.count / mean).sqrt() })
    };
    moments.iter().filter_map(of).collect()
}

/// The equations of a step, JᵀWJ δ = −JᵀWr, with rotations in units in which their slopes are as large as normals are.
struct Equations<const D: usize, const N: usize> {
    hessian: SMatrix<f64, N, N>,
    gradient: SVector<f64, N>,
    weight: f64,
    /// The unit of rotation: metres by which a radian moves points along normals.
    arm: f64,
    /// Standard deviation of the residuals, metres.
    sigma: f64,
}

impl<const D: usize, const N: usize> Equations<D, N> {
    /// The least unit of rotation, metres, where all points are in one place.
    const LEAST_ARM: f64 = 1e-3;

    /// None of fewer points than there are numbers to be found.
    fn of(matches: &[Match<D, N>], sigma: f64, kernel: f64) -> Option<Self> {
        if matches.len() < N {
            return None;
        }
        let mut hessian = SMatrix::<f64, N, N>::zeros();
        let mut gradient = SVector::<f64, N>::zeros();
        let mut weight = 0.0;
        for one in matches {
            // Geman and McClure's: ρ' / r of ρ(r) = r² / (1 + r²).
            let w = one.weight * (1.0 + (one.residual / (kernel * sigma)).powi(2)).powi(-2);
            let weighted = one.slope * w;
            hessian += weighted * one.slope.transpose();
            gradient += weighted * one.residual;
            weight += w;
        }
        // Normals' squared components sum up to 1; so do then those of slopes of rotation, over as many.
        let turning = (D..N).map(|i| hessian[(i, i)]).sum::<f64>() * D as f64 / ((N - D) as f64 * weight);
        let arm = turning.sqrt().max(Self::LEAST_ARM);
        let unit = |i: usize| if i < D { 1.0 } else { 1.0 / arm };
        let hessian = SMatrix::from_fn(|i, j| hessian[(i, j)] * unit(i) * unit(j));
        let gradient = SVector::from_fn(|i, _| gradient[i] * unit(i));
        Some(Self { hessian, gradient, weight, arm, sigma })
    }

    /// How much is said of each principal direction, and the directions.
    fn observability(&self) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        let (values, directions) = eigen::symmetric(&self.hessian);
        (values / self.weight, directions)
    }

    /// The step along all that is known, and `back` along what is not, with its length, metres.
    fn step(&self, least: f64, back: &SVector<f64, N>) -> (SVector<f64, N>, f64) {
        let (observability, directions) = self.observability();
        let back = SVector::<f64, N>::from_fn(|i, _| if i < D { back[i] } else { back[i] * self.arm });
        let mut step = SVector::<f64, N>::zeros();
        for i in 0..N {
            let direction = directions.column(i);
            step += match observability[i] > least {
                true => direction * (-direction.dot(&self.gradient) / (observability[i] * self.weight)),
                false => direction * direction.dot(&back),
            };
        }
        (SVector::from_fn(|i, _| if i < D { step[i] } else { step[i] / self.arm }), step.norm())
    }

    /// Per m², m rad and rad².
    fn information(&self) -> SMatrix<f64, N, N> {
        let unit = |i: usize| if i < D { 1.0 } else { self.arm };
        SMatrix::from_fn(|i, j| self.hessian[(i, j)] * unit(i) * unit(j) / self.sigma.powi(2))
    }
}

/// The standard deviation of residuals of which up to half may be anything: 1.4826 times the median of their amounts.
fn deviation<const D: usize, const N: usize>(matches: &[Match<D, N>]) -> Option<f64> {
    let mut amounts: Vec<f64> = matches.iter().map(|one| one.residual.abs()).collect();
    let middle = amounts.len() / 2;
    (!amounts.is_empty()).then(|| 1.4826 * *amounts.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_said() {
        let said = Icp::new(IcpConfig { kernel: 0.0, ..IcpConfig::default() }).unwrap_err().to_string();
        assert_eq!(said, "kernel of 0: 0.1 to 100 would be right");
    }
}
