//! A sensor of one's own: a depth camera in an empty room, worked out instead of measured.
//! `elk launch mission.xml --set Sensor.exec=./target/release/hall --set Sensor.Size='6; 4; 3'` explores it.

use elk_sensor::nalgebra::Point3;
use elk_sensor::{AppError, Camera, CameraInfo, Capture, DepthSource, Kind, ParamSpec, Pose, Seen};

const PARAMS: &[ParamSpec] = &[ParamSpec {
    name: "Size",
    kind: Kind::Size { unit: "m" },
    default: Some("6; 4; 3"),
    doc: "Length, width and height of the room; one of its corners is the origin.",
}];

struct Hall {
    size: [f64; 3],
    camera: Camera,
}

impl DepthSource for Hall {
    fn camera(&self) -> CameraInfo {
        self.camera.info(0.0)
    }

    fn start(&self) -> Pose {
        Pose::from_yaw_pitch(Point3::from(self.size.map(|edge| edge / 2.0)), 0.0, 0.0)
    }

    fn scan(&mut self, capture: &Capture) -> Result<Seen, AppError> {
        let from = capture.pose.position();
        let points = self.camera.pixels().map(|(u, v)| {
            let ray = capture.pose.0.rotation * self.camera.direction(u, v);
            let walls = (0..3).flat_map(|axis| [0.0, self.size[axis]].map(|wall| (wall - from[axis]) / ray[axis]));
            let depth = walls.filter(|depth| *depth > 0.0).fold(f64::INFINITY, f64::min);
            self.camera.point(u, v, depth).cast()
        });
        Ok(Seen { points: points.collect(), ..Seen::default() })
    }
}

fn main() -> std::process::ExitCode {
    let camera = Camera::new(100, 100, 75_f64.to_radians());
    elk_sensor::main(PARAMS, |params| match params.point("Size") {
        [0.0, ..] => Err("Size is 0, and nothing is seen in such a room; right is its length, width and height".into()),
        size => Ok(Hall { size, camera }),
    })
}
