//! By how much the cameras turned, from all that a small image shows (2.2.3, image alignment; after Mei, Sibley, Cummins, Newman and Reid, IJCV
//! 2011).

use elk_stereo::{Image, Rig};
use nalgebra::{Matrix4, UnitQuaternion, Vector3, Vector4};

use crate::pyramid::{LEVELS, Pyramid, to_level};

/// The levels of the images that are aligned: one for turns that are nearly known, and one for others.
const FINE: usize = LEVELS - 2;
const COARSE: usize = LEVELS - 1;
/// Turns that are tried where nothing is known: so many steps to each side and up and down, of so many pixels of the coarse image.
const TRIED: [i32; 2] = [4, 3];
const APART: f64 = 2.0;
const ITERATIONS: usize = 15;
/// It is turned as far as need be when a step is smaller than this, radians: a tenth of a pixel of the finest level.
const TOLERANCE: f64 = 2e-4;
/// A difference of grey values at which a pixel counts for half: what moved otherwise is not to be followed.
const SCALE: f64 = 12.0;
/// The least share of pixels that both images show.
const LEAST_SHARE: f64 = 0.3;

/// How the cameras turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Turn {
    /// Where the second image shows what the first one shows in a direction, were it infinitely far.
    pub second_from_first: UnitQuaternion<f64>,
    /// The mean of Geman and McClure's ρ of what is different still, 0 to 1.
    pub difference: f64,
}

/// The smallest images of a left image.
#[derive(Clone, Debug)]
pub(crate) struct Thumbnail {
    fine: Image,
    coarse: Image,
}

impl Thumbnail {
    pub fn new(left: &Pyramid) -> Self {
        Self { fine: left.level(FINE).clone(), coarse: left.level(COARSE).clone() }
    }
}

/// The turn near `guess` by which two small images are most alike. None where they do not show the same part of the world to a third.
pub(crate) fn turn(rig: &Rig, first: &Thumbnail, second: &Thumbnail, guess: UnitQuaternion<f64>) -> Option<Turn> {
    Small::new(rig, FINE).align(&first.fine, &second.fine, guess)
}

/// The turn by which two small images are nearly most alike, of all that are not too far from none. It wants to be made better.
pub(crate) fn search(rig: &Rig, first: &Thumbnail, second: &Thumbnail) -> Option<Turn> {
    let camera = Small::new(rig, COARSE);
    let brighter = mean(&second.coarse) - mean(&first.coarse);
    let [aside, up] = TRIED.map(|steps| (-steps..=steps).map(|i| f64::from(i) * APART / camera.focal));
    let tried =
        up.flat_map(|pitch| aside.clone().map(move |yaw| UnitQuaternion::from_scaled_axis([pitch, yaw, 0.0].into())));
    let alike = tried
        .filter_map(|turn| Some((camera.equations(&first.coarse, &second.coarse, turn, brighter)?.difference, turn)));
    let (_, best) = alike.min_by(|a, b| a.0.total_cmp(&b.0))?;
    camera.align(&first.coarse, &second.coarse, best)
}

fn mean(image: &Image) -> f64 {
    image.pixels().iter().map(|&grey| f64::from(grey)).sum::<f64>() / image.pixels().len() as f64
}

/// The left camera of small images.
struct Small {
    focal: f64,
    /// Column and row.
    center: [f64; 2],
}

struct Equations {
    hessian: Matrix4<f64>,
    gradient: Vector4<f64>,
    difference: f64,
}

impl Small {
    fn new(rig: &Rig, level: usize) -> Self {
        let [row, column] = rig.center();
        Self { focal: rig.focal() / f64::from(1u32 << level), center: to_level([column, row], level) }
    }

    /// By Gauss–Newton steps over three angles and brightness; of all that were passed, the best.
    fn align(&self, first: &Image, second: &Image, guess: UnitQuaternion<f64>) -> Option<Turn> {
        let mut best: Option<Turn> = None;
        let mut turn = guess;
        let mut brighter = mean(second) - mean(first);
        for _ in 0..ITERATIONS {
            let Some(equations) = self.equations(first, second, turn, brighter) else { break };
            if best.is_none_or(|best| equations.difference < best.difference) {
                best = Some(Turn { second_from_first: turn, difference: equations.difference });
            }
            let Some(inverse) = equations.hessian.cholesky() else { break };
            let step = -inverse.solve(&equations.gradient);
            turn = UnitQuaternion::new_normalize((UnitQuaternion::from_scaled_axis(step.xyz()) * turn).into_inner());
            brighter += step.w;
            if step.xyz().norm() < TOLERANCE {
                break;
            }
        }
        best
    }

    fn equations(&self, first: &Image, second: &Image, turn: UnitQuaternion<f64>, brighter: f64) -> Option<Equations> {
        let matrix = turn.to_rotation_matrix();
        let mut equations = Equations { hessian: Matrix4::zeros(), gradient: Vector4::zeros(), difference: 0.0 };
        let mut pixels = 0;
        for row in 1..first.height() - 1 {
            for (column, &grey) in first.row(row).iter().enumerate() {
                let ray = Vector3::new(column as f64 - self.center[0], row as f64 - self.center[1], self.focal);
                let ray = matrix * ray;
                let per = self.focal / ray.z;
                let at = [self.center[0] + ray.x * per, self.center[1] + ray.y * per];
                let Some((seen, [dx, dy])) = sample(second, at).filter(|_| ray.z > 0.0) else { continue };
                pixels += 1;
                let off = seen - f64::from(grey) - brighter;
                let weight = 1.0 / (1.0 + (off / SCALE).powi(2));
                equations.difference += 1.0 - weight;
                let by_ray = Vector3::new(dx, dy, -(dx * ray.x + dy * ray.y) / ray.z) * per;
                // A turn ω moves the ray by ω × ray.
                let by_turn = ray.cross(&by_ray);
                let slope = Vector4::new(by_turn.x, by_turn.y, by_turn.z, -1.0);
                equations.hessian += slope * slope.transpose() * weight.powi(2);
                equations.gradient += slope * (off * weight.powi(2));
            }
        }
        equations.difference /= f64::from(pixels.max(1));
        (f64::from(pixels) >= LEAST_SHARE * first.pixels().len() as f64).then_some(equations)
    }
}

/// What an image shows at a column and row, and how that changes along both.
fn sample(image: &Image, [column, row]: [f64; 2]) -> Option<(f64, [f64; 2])> {
    let is_inside =
        column >= 0.0 && row >= 0.0 && column < image.width() as f64 - 1.0 && row < image.height() as f64 - 1.0;
    if !is_inside {
        return None;
    }
    let (x, y) = (column as usize, row as usize);
    let (dx, dy) = (column - x as f64, row - y as f64);
    let [[a, b], [c, d]] = [y, y + 1].map(|y| [0, 1].map(|i| f64::from(image.row(y)[x + i])));
    let (above, below) = (a + (b - a) * dx, c + (d - c) * dx);
    Some((above + (below - above) * dy, [(b - a) * (1.0 - dy) + (d - c) * dy, below - above]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What a camera sees that is turned in a world infinitely far.
    fn view(turn: UnitQuaternion<f64>, brighter: f64) -> Thumbnail {
        let camera = Small::new(&rig(), 0);
        let image = Image::from_fn(752, 480, |row, column| {
            let ray = Vector3::new(column as f64 - camera.center[0], row as f64 - camera.center[1], camera.focal);
            let ray = (turn * ray).normalize();
            let waves = (9.0 * ray.x + 4.0 * ray.y).sin() + (11.0 * ray.y).cos() + (7.0 * ray.z + 8.0 * ray.x).sin();
            (110.0 + brighter + 30.0 * waves) as u8
        });
        Thumbnail::new(&Pyramid::new(&image.unwrap()))
    }

    fn rig() -> Rig {
        Rig::new(450.0, [240.0, 375.0], 0.11).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        #[test]
        fn a_turn_is_found(axis in prop::array::uniform3(-0.07..0.07f64), brighter in -20.0..20.0f64) {
            let truth = UnitQuaternion::from_scaled_axis(axis.into());
            let [first, second] = [view(UnitQuaternion::identity(), 0.0), view(truth.inverse(), brighter)];
            let found = turn(&rig(), &first, &second, UnitQuaternion::identity()).unwrap();
            prop_assert!(found.second_from_first.angle_to(&truth) < 4e-3, "{} {}", found.second_from_first, truth);
            prop_assert!(found.difference < 0.05, "{}", found.difference);
        }

        #[test]
        fn a_large_turn_is_searched_for(pitch in -0.2..0.2f64, yaw in -0.28..0.28f64, roll in -0.1..0.1f64) {
            let truth = UnitQuaternion::from_scaled_axis([pitch, yaw, roll].into());
            let [first, second] = [view(UnitQuaternion::identity(), 0.0), view(truth.inverse(), 5.0)];
            let nearly = search(&rig(), &first, &second).unwrap();
            let found = turn(&rig(), &first, &second, nearly.second_from_first).unwrap();
            prop_assert!(found.second_from_first.angle_to(&truth) < 6e-3, "{} {}", found.second_from_first, truth);
        }
    }

    #[test]
    fn a_guess_that_looks_elsewhere_has_no_turn() {
        let image = view(UnitQuaternion::identity(), 0.0);
        assert_eq!(turn(&rig(), &image, &image, UnitQuaternion::from_euler_angles(0.0, 2.5, 0.0)), None);
    }
}
