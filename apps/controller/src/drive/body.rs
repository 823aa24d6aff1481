//! The body of a robot that moves at limited speeds with limited accelerations: each axis by itself, in the robot's own frame.

use elk_geometry::Pose;
use nalgebra::{Point3, Rotation3, Vector3};

/// The axes of motion: along the robot, across it (to its left), up, about the vertical, and of the head that tilts the camera.
pub const AXES: usize = 5;
/// Those along which it moves.
pub const LINEAR: usize = 3;
/// About the vertical.
pub const YAW: usize = 3;
/// Of the head that tilts the camera.
pub const TILT: usize = 4;

/// Speeds along the axes: ahead, to the left and up (m/s), about the vertical and of the tilting head (rad/s).
pub type Rates = [f64; AXES];

/// What an axis can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Largest speed, either way (m/s or rad/s); 0: it does not move so.
    pub speed: f64,
    /// Largest acceleration, either way (m/s² or rad/s²).
    pub acceleration: f64,
}

/// What a robot can do. One without lateral speed is a differential drive, one without vertical speed stays in its plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Along the robot, as the camera looks.
    pub forward: Axis,
    /// Across it.
    pub lateral: Axis,
    /// Up and down.
    pub vertical: Axis,
    /// About the vertical; the camera's head tilts as fast.
    pub yaw: Axis,
}

/// Limits with which a robot gets nowhere.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{what} is {value}; right is more than 0, and finite: {why}")]
pub struct Unusable {
    what: &'static str,
    value: f64,
    why: &'static str,
}

impl Limits {
    /// The limits, if a robot with them can get anywhere.
    ///
    /// # Errors
    /// Forward or yaw speed is 0, or the acceleration of an axis that moves, or one of them is no finite number.
    pub fn checked(self) -> Result<Self, Unusable> {
        let Self { forward, lateral, vertical, yaw } = self;
        let is_usable = |value: f64| value.is_finite() && value > 0.0;
        let speeds = [
            ("forward speed", forward, "it is how the robot gets anywhere"),
            ("yaw speed", yaw, "a robot that cannot turn cannot look around"),
        ];
        if let Some((what, axis, why)) = speeds.into_iter().find(|(_, axis, _)| !is_usable(axis.speed)) {
            return Err(Unusable { what, value: axis.speed, why });
        }
        let speeds = [("lateral speed", lateral), ("vertical speed", vertical)];
        let is_odd = |speed: f64| !speed.is_finite() || speed < 0.0;
        if let Some((what, axis)) = speeds.into_iter().find(|(_, axis)| is_odd(axis.speed)) {
            return Err(Unusable { what, value: axis.speed, why: "or 0 for a robot that does not move so" });
        }
        let accelerations = [
            ("forward acceleration", forward),
            ("lateral acceleration", lateral),
            ("vertical acceleration", vertical),
            ("yaw acceleration", yaw),
        ];
        let needed = accelerations.into_iter().filter(|(_, axis)| axis.speed > 0.0);
        match needed.into_iter().find(|(_, axis)| !is_usable(axis.acceleration)) {
            Some((what, axis)) => {
                Err(Unusable { what, value: axis.acceleration, why: "no speed is ever reached without" })
            }
            None => Ok(self),
        }
    }

    /// By axis.
    pub fn axes(&self) -> [Axis; AXES] {
        [self.forward, self.lateral, self.vertical, self.yaw, self.yaw]
    }

    /// Whether it has to face where it goes.
    pub fn is_differential(&self) -> bool {
        self.lateral.speed == 0.0
    }

    /// The largest speed (m/s) and acceleration (m/s²) along a direction (unit vector, the robot's frame).
    pub fn along(&self, direction: &Vector3<f64>) -> Axis {
        let axes = self.axes();
        let most = |limit: fn(&Axis) -> f64| {
            let parts = axes[..LINEAR].iter().zip(direction.iter()).filter(|(_, part)| **part != 0.0);
            parts.map(|(axis, part)| limit(axis) / part.abs()).fold(f64::INFINITY, f64::min)
        };
        Axis { speed: most(|axis| axis.speed), acceleration: most(|axis| axis.acceleration) }
    }
}

/// Where a robot is, and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Of the camera (m, world).
    pub position: Point3<f64>,
    /// Heading (rad, anticlockwise from world x).
    pub yaw: f64,
    /// Elevation of the camera (rad, up positive).
    pub pitch: f64,
    /// Its speeds.
    pub rates: Rates,
}

impl Body {
    /// One that stands.
    pub fn at_rest(pose: &Pose) -> Self {
        Self { position: pose.position(), yaw: pose.yaw(), pitch: pose.pitch(), rates: [0.0; AXES] }
    }

    /// The camera's pose (world).
    pub fn pose(&self) -> Pose {
        Pose::from_yaw_pitch(self.position, self.yaw, self.pitch)
    }

    /// Whether it moves from its place.
    pub fn moves(&self) -> bool {
        self.rates[..LINEAR].iter().any(|rate| *rate != 0.0)
    }

    /// A direction of the world in the robot's frame (forward, left, up).
    pub fn inward(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        Rotation3::from_axis_angle(&Vector3::z_axis(), -self.yaw) * direction
    }

    /// After `secs` in which it is to move at the speeds `wanted`: it comes as near to them as its limits allow, at an even
    /// acceleration; those along which it moves all by the same share, so that it accelerates in the direction that is wanted.
    pub fn step(&self, wanted: &Rates, axes: &[Axis; AXES], secs: f64) -> Self {
        let wanted: Rates = std::array::from_fn(|axis| wanted[axis].clamp(-axes[axis].speed, axes[axis].speed));
        let share = |axis: usize| {
            let (change, most) = ((wanted[axis] - self.rates[axis]).abs(), axes[axis].acceleration * secs);
            if change <= most { 1.0 } else { most / change }
        };
        let linear = (0..LINEAR).map(share).fold(1.0, f64::min);
        let next = |axis: usize| match if axis < LINEAR { linear } else { share(axis) } {
            // Not by a sum of differences: who wants to stand comes to stand, without a rest of rounding.
            1.0 => wanted[axis],
            share => self.rates[axis] + share * (wanted[axis] - self.rates[axis]),
        };
        let rates: Rates = std::array::from_fn(next);
        let gone: Rates = std::array::from_fn(|axis| 0.5 * (self.rates[axis] + rates[axis]) * secs);
        let heading = Rotation3::from_axis_angle(&Vector3::z_axis(), self.yaw + 0.5 * gone[YAW]);
        let pitch = self.pitch + gone[TILT];
        Self {
            position: self.position + heading * Vector3::new(gone[0], gone[1], gone[2]),
            yaw: wrapped(self.yaw + gone[YAW]),
            pitch: pitch.clamp(-std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_2),
            rates,
        }
    }
}

/// The same angle between -π and π.
pub fn wrapped(angle: f64) -> f64 {
    let turns = (angle / std::f64::consts::TAU).round();
    angle - turns * std::f64::consts::TAU
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;

    use super::*;

    pub(crate) const TICK: f64 = 0.05;

    /// A robot that goes any way: 0.5 m/s, 90 deg/s.
    pub(crate) fn any_way() -> Limits {
        let linear = Axis { speed: 0.5, acceleration: 0.5 };
        Limits {
            forward: linear,
            lateral: linear,
            vertical: Axis { speed: 0.3, acceleration: 0.4 },
            yaw: Axis { speed: 1.57, acceleration: 3.0 },
        }
    }

    /// The same on two wheels.
    pub(crate) fn differential() -> Limits {
        Limits { lateral: Axis { speed: 0.0, acceleration: 0.0 }, ..any_way() }
    }

    #[test]
    fn limits_of_0_are_refused_with_a_word() {
        assert_eq!(any_way().checked(), Ok(any_way()));
        assert_eq!(differential().checked(), Ok(differential()), "what does not move needs no acceleration");
        let with = |change: fn(&mut Limits)| {
            let mut limits = any_way();
            change(&mut limits);
            limits.checked().unwrap_err().to_string()
        };
        assert!(with(|limits| limits.forward.speed = 0.0).starts_with("forward speed is 0; right is more than 0"));
        assert!(with(|limits| limits.yaw.speed = f64::NAN).starts_with("yaw speed is NaN"));
        assert!(with(|limits| limits.lateral.speed = -1.0).starts_with("lateral speed is -1"));
        assert!(with(|limits| limits.yaw.acceleration = 0.0).starts_with("yaw acceleration is 0"));
    }

    #[test]
    fn it_comes_to_stand_after_the_way_that_a_constant_deceleration_takes() {
        let mut body = Body::at_rest(&Pose::from_yaw_pitch(Point3::origin(), 0.0, 0.0));
        body.rates[0] = 0.5;
        let mut ticks = 0;
        while body.moves() {
            body = body.step(&[0.0; AXES], &any_way().axes(), TICK);
            ticks += 1;
        }
        // v²/2a and v/a.
        assert!((body.position.x - 0.25).abs() < 1e-9 && ticks == 20, "{body:?} {ticks}");
    }

    #[test]
    fn angles_are_wrapped() {
        for (angle, same) in [(0.0, 0.0), (3.5, 3.5 - std::f64::consts::TAU), (-7.0, -7.0 + std::f64::consts::TAU)] {
            assert!((wrapped(angle) - same).abs() < 1e-12);
        }
    }

    proptest! {
        /// Whatever is asked of it, speeds and accelerations stay within the limits.
        #[test]
        fn limits_are_never_exceeded(asked in prop::collection::vec(prop::array::uniform5(-4.0..4.0f64), 1..60)) {
            let axes = differential().axes();
            let mut body = Body::at_rest(&Pose::from_yaw_pitch(Point3::origin(), 0.3, 0.0));
            for wanted in asked {
                let next = body.step(&wanted, &axes, TICK);
                for (n, axis) in axes.iter().enumerate() {
                    prop_assert!(next.rates[n].abs() <= axis.speed + 1e-12);
                    prop_assert!((next.rates[n] - body.rates[n]).abs() <= axis.acceleration * TICK + 1e-12);
                }
                let fastest = (axes[0].speed.powi(2) + axes[2].speed.powi(2)).sqrt();
                prop_assert!((next.position - body.position).norm() <= fastest * TICK + 1e-9);
                body = next;
            }
        }
    }
}
