//! A sensor of somebody else's: a depth camera in a hall with balls in it, worked out ray by ray, and the true world besides.

use elk_geometry::State;
use elk_sensor::nalgebra::{Point3, Vector3};
use elk_sensor::{
    Accuracy, AppError, Camera, CameraInfo, Capture, DepthSource, Kind, Obstruction, OccupancyGrid, ParamSpec, Pose,
    Seen, Travel, Truth,
};

const PARAMS: &[ParamSpec] = &[
    ParamSpec {
        name: "Balls",
        kind: Kind::Integer { min: 0, max: BALLS.len() as i64 },
        default: Some("3"),
        doc: "Balls that lie in the hall.",
    },
    ParamSpec {
        name: "View",
        kind: Kind::Number { unit: "deg", min: 10.0, max: 120.0 },
        default: Some("75"),
        doc: "Field of view.",
    },
];

/// The hall, from the origin (m).
const SIZE: Vector3<f64> = Vector3::new(4.0, 3.0, 2.5);
/// Centres and radii of the balls (m).
const BALLS: [([f64; 3], f64); 3] = [([3.0, 2.0, 0.3], 0.3), ([2.2, 0.7, 1.5], 0.25), ([1.0, 2.3, 0.5], 0.4)];
/// Radius of the robot (m).
const BODY_M: f64 = 0.05;

struct Hall {
    balls: &'static [([f64; 3], f64)],
    camera: Camera,
}

impl Hall {
    /// How far along a ray the next surface is, in lengths of `ray`.
    fn cast(&self, from: Point3<f64>, ray: Vector3<f64>) -> Option<f64> {
        let walls = (0..3).flat_map(|axis| [0.0, SIZE[axis]].map(|wall| (wall - from[axis]) / ray[axis]));
        let balls = self.balls.iter().filter_map(|(center, radius)| {
            let to = Point3::from(*center) - from;
            let (a, half_b, c) = (ray.norm_squared(), ray.dot(&to), to.norm_squared() - radius * radius);
            let root = half_b * half_b - a * c;
            (root >= 0.0).then(|| (half_b - root.sqrt()) / a)
        });
        walls.chain(balls).filter(|length| *length > 0.0 && length.is_finite()).min_by(f64::total_cmp)
    }

    /// Distance to the next surface (m), below 0 in a solid.
    fn distance(&self, place: Point3<f64>) -> f64 {
        let walls = (0..3).flat_map(|axis| [place[axis], SIZE[axis] - place[axis]]);
        let balls = self.balls.iter().map(|(center, radius)| (place - Point3::from(*center)).norm() - radius);
        walls.chain(balls).fold(f64::INFINITY, f64::min)
    }
}

impl DepthSource for Hall {
    fn camera(&self) -> CameraInfo {
        self.camera.info(0.0)
    }

    fn start(&self) -> Pose {
        Pose::from_yaw_pitch(Point3::new(0.6, 0.6, 1.2), 0.5, 0.0)
    }

    fn scan(&mut self, capture: &Capture) -> Result<Seen, AppError> {
        let from = capture.pose.position();
        let seen = self.camera.pixels().filter_map(|(u, v)| {
            let ray = capture.pose.0.rotation * self.camera.direction(u, v);
            self.cast(from, ray).map(|depth| self.camera.point(u, v, depth).cast())
        });
        Ok(Seen { points: seen.collect(), ..Seen::default() })
    }

    fn truth(&self) -> Option<&dyn Truth> {
        Some(self)
    }
}

impl Truth for Hall {
    fn free(&self, pose: &Pose) -> Result<(), Obstruction> {
        if self.distance(pose.position()) > 0.0 { Ok(()) } else { Err(Obstruction::NotFree(pose.position())) }
    }

    fn travel(&self, way: &[Point3<f64>], end: &Pose) -> Travel {
        let pierced = |step: &&[Point3<f64>]| self.cast(step[0], step[1] - step[0]).is_some_and(|length| length <= 1.0);
        let blocked = || way.windows(2).find(pierced).map(|step| Obstruction::Blocked(step[0], step[1]));
        let refused = self.free(end).err().or_else(blocked);
        let places =
            way.windows(2).flat_map(|step| (0..=100).map(|n| step[0] + (step[1] - step[0]) * (f64::from(n) / 100.0)));
        let touched = places.into_iter().any(|place| self.distance(place) < BODY_M);
        Travel { contact: refused.is_some() || touched, refused }
    }

    /// A voxel is right that is free and not far inside a solid, or occupied and not far from a surface.
    fn evaluate(&self, map: &OccupancyGrid) -> Result<Option<Accuracy>, AppError> {
        let resolution = map.resolution();
        let right = |(voxel, state): &(_, State)| {
            let voxel: &elk_geometry::Voxel = voxel;
            let distance = self.distance(voxel.center(resolution));
            match state {
                State::Occupied => distance.abs() <= resolution,
                State::Free => distance >= -resolution,
                State::Unknown => false,
            }
        };
        let voxels = map.free() + map.occupied();
        let share = map.bricks().voxels().filter(right).count() as f64 / voxels.max(1) as f64;
        Ok(Some(Accuracy { share, voxels: voxels as u64 }))
    }
}

fn main() -> std::process::ExitCode {
    elk_sensor::main(PARAMS, |params| {
        let balls = &BALLS[..params.integer("Balls") as usize];
        Ok(Hall { balls, camera: Camera::new(100, 100, params.number("View").to_radians()) })
    })
}
