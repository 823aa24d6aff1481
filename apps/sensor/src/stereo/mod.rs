//! A recorded stereo camera: pairs of grey images, rectified, matched and triangulated.
//!
//! Two layouts of folders are read: EuRoC's (`cam0` and `cam1` with images by their time in nanoseconds and a YAML each, and the
//! poses of the body that carries them; Burri et al., IJRR 2016), with or without its `mav0` and `data` folders, and that of KITTI's
//! odometry benchmark (`image_0`, `image_1`, `calib.txt`, `times.txt`, and `poses.txt` of the left camera; Geiger et al., CVPR 2012).
//! KITTI's poses begin at the first camera, which is taken to be level: x is ahead there, and z up.

mod images;
mod layout;
mod source;

pub use source::{Settings, Stereo};

use elk_bus::AppError;
use elk_mission::{AppType, Kind, ParamSpec, Params, joined};

use crate::app::recorded;
use crate::matching::{self, matcher};
use crate::parameters::{BELIEVED_RANGE, MEMORY, PAIR_TRACKING, PATIENCE, RECORDED, frames, memory, param, patience};
use crate::pose_estimator::{PoseEstimator, Recorded, VisualOdometry, VisualOdometrySettings};
use crate::recording::Player;
use crate::surroundings::range;

const PARAMS: &[ParamSpec] = &[
    ParamSpec {
        name: "Recording",
        kind: Kind::File { builtin: &[], at_once: false },
        default: None,
        doc: "The folder of the recording: cam0 and cam1 with their YAMLs (EuRoC), or image_0 and image_1 with calib.txt (KITTI).",
    },
    BELIEVED_RANGE,
    param(
        "DisparitySigma",
        Kind::Number { unit: "px", min: 0.0, max: 100.0 },
        "0.25",
        "Standard deviation of a disparity, from which the map knows how depth errs; 0: depth is taken to be exact.",
    ),
    PAIR_TRACKING,
    PATIENCE,
    MEMORY,
];

const OWN: [ParamSpec; PARAMS.len() + matching::PARAMS.len()] = joined(PARAMS, matching::PARAMS);

/// Its row in the table of sensors.
pub const TYPE: AppType = AppType {
    element: "Sensor",
    name: "Stereo",
    summary: "A recorded stereo camera: pairs of grey images, matched, with their poses, or with poses estimated from the images.",
    params: &joined::<{ OWN.len() + RECORDED.len() }>(&OWN, RECORDED),
    build: |params| Ok(recorded(params, player(params)?)),
    preflight: None,
};

fn player(params: &Params) -> Result<Player, AppError> {
    let settings = Settings {
        range: range(params),
        disparity_sigma: params.number("DisparitySigma"),
        frame_rate: params.number("FrameRate"),
    };
    let recording = Stereo::open(params.text("Recording").as_ref(), settings, matcher(params)?)?;
    let estimator: Box<dyn PoseEstimator> = match params.text("PoseEstimator") {
        "VisualOdometry" => Box::new(VisualOdometry::new(VisualOdometrySettings {
            rig: *recording.rig(),
            size: recording.size(),
            patience: Some(patience(params)),
            memory: memory(params),
            seed: 1,
        })?),
        _ => Box::new(Recorded),
    };
    Ok(Player::new(Box::new(recording), estimator, frames(params)))
}
