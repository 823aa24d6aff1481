//! A recorded laser scanner that stays level: a log as CARMEN writes it, plain or compressed by gzip.

mod source;

pub use source::{Laser2d, LogError, Settings};

use elk_bus::AppError;
use elk_mission::{AppType, Kind, ParamSpec, Params, joined};

use crate::app::recorded;
use crate::parameters::{ICP_VOXEL, RECORDED, SCAN_MATCHING, frames, level_icp, matches_scans, param};
use crate::pose_estimator::{LevelMatching, PoseEstimator, Recorded};
use crate::recording::Player;

const PARAMS: &[ParamSpec] = &[
    ParamSpec {
        name: "Recording",
        kind: Kind::File { builtin: &[], at_once: false },
        default: None,
        doc: "The log, of CARMEN: its FLASER or ROBOTLASER1 lines are frames, its ODOM lines odometry, from whose motion ICP begins; .gz or not.",
    },
    param(
        "Range",
        Kind::Number { unit: "m", min: 0.1, max: 1000.0 },
        "30",
        "How far the laser sees: a beam that reads as much or more has no return; ROBOTLASER1 lines may say less.",
    ),
    param(
        "Fov",
        Kind::Number { unit: "deg", min: 1.0, max: 360.0 },
        "180",
        "The laser's field of view, half of it to the left; ROBOTLASER1 lines say their own.",
    ),
    param(
        "Height",
        Kind::Number { unit: "m", min: -1000.0, max: 1000.0 },
        "0",
        "Where the laser's plane is, along world z.",
    ),
    ICP_VOXEL,
    SCAN_MATCHING,
];

/// Its row in the table of sensors.
pub const TYPE: AppType = AppType {
    element: "Sensor",
    name: "Laser2D",
    summary: "A recorded 2-D laser: a CARMEN log with the poses that it says, or with poses estimated from its scans.",
    params: &joined::<{ PARAMS.len() + RECORDED.len() }>(PARAMS, RECORDED),
    build: |params| Ok(recorded(params, player(params)?)),
    preflight: None,
};

fn player(params: &Params) -> Result<Player, AppError> {
    let settings = Settings {
        range: params.number("Range") as f32,
        field_of_view: params.number("Fov").to_radians(),
        height: params.number("Height"),
        frame_rate: params.number("FrameRate"),
    };
    let estimator: Box<dyn PoseEstimator> = match matches_scans(params) {
        true => Box::new(LevelMatching::new(&level_icp(params), settings.height)?),
        false => Box::new(Recorded),
    };
    let log = Laser2d::open(params.text("Recording").as_ref(), settings)?;
    Ok(Player::new(Box::new(log), estimator, frames(params)))
}
