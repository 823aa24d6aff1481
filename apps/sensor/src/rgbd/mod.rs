//! A recorded depth camera: images of depths, each with where it was taken.
//!
//! Two layouts of folders are read: that of 7-Scenes (`frame-000000.depth.png` beside `frame-000000.pose.txt`, 4 × 4 numbers
//! that take the camera's frame to the world's; Shotton et al., CVPR 2013), and that of the TUM benchmark (`depth.txt` with times and
//! files, `groundtruth.txt` with times, positions and quaternions; Sturm et al., IROS 2012). Images are PNGs of 16 bits grey.

mod depth_image;
mod layout;
mod source;

pub use depth_image::DepthImageError;
pub use source::{Rgbd, Settings};

use elk_bus::AppError;
use elk_mission::{AppType, Kind, ParamSpec, Params, joined};
use elk_registration::DepthCamera;

use crate::app::recorded;
use crate::parameters::{RECORDED, SCAN_MATCHING, frames, matches_scans, param};
use crate::pose_estimator::{IcpSettings, PoseEstimator, Recorded, ScanMatching};
use crate::recording::Player;

const PIXELS: Kind = Kind::Number { unit: "px", min: 0.0, max: 100_000.0 };
const FOCAL: Kind = Kind::Number { unit: "px", min: 1.0, max: 100_000.0 };

const PARAMS: &[ParamSpec] = &[
    ParamSpec {
        name: "Recording",
        kind: Kind::File { builtin: &[], at_once: false },
        default: None,
        doc: "The folder of the recording: frame-000000.depth.png and frame-000000.pose.txt (7-Scenes), or depth.txt and groundtruth.txt (TUM).",
    },
    param("FocalX", FOCAL, "585", "Focal length along rows."),
    param("FocalY", FOCAL, "585", "Focal length along columns."),
    param("CentreX", PIXELS, "320", "Column of the optical axis."),
    param("CentreY", PIXELS, "240", "Row of the optical axis."),
    param(
        "DepthUnit",
        Kind::Number { unit: "m", min: 1e-6, max: 1.0 },
        "0.001",
        "What a count of depth is worth; of TUM's recordings 0.0002.",
    ),
    param(
        "MinRange",
        Kind::Number { unit: "m", min: 0.0, max: 100.0 },
        "0.3",
        "Depths below it are not believed: nothing is known there.",
    ),
    param(
        "Range",
        Kind::Number { unit: "m", min: 0.1, max: 100.0 },
        "4.5",
        "Depths above it are not believed: nothing is known there.",
    ),
    param("Stride", Kind::Integer { min: 1, max: 100 }, "2", "Of so many columns and rows one is taken."),
    param(
        "IcpVoxel",
        Kind::Number { unit: "m", min: 0.005, max: 10.0 },
        "0.05",
        "Edge of the voxels by which ICP puts points together.",
    ),
    SCAN_MATCHING,
];

/// Its row in the table of sensors.
pub const TYPE: AppType = AppType {
    element: "Sensor",
    name: "RGBD",
    summary: "A recorded depth camera: a folder of depth images with their poses, or with poses estimated from the images.",
    params: &joined::<{ PARAMS.len() + RECORDED.len() }>(PARAMS, RECORDED),
    build: |params| Ok(recorded(params, player(params)?)),
    preflight: None,
};

fn player(params: &Params) -> Result<Player, AppError> {
    let number = |name| params.number(name) as f32;
    let settings = Settings {
        camera: DepthCamera {
            focal: [number("FocalX"), number("FocalY")],
            centre: [number("CentreX"), number("CentreY")],
            unit: number("DepthUnit"),
            range: [number("MinRange"), number("Range")],
        },
        // The table keeps it between 1 and 100.
        stride: params.integer("Stride") as usize,
        frame_rate: params.number("FrameRate"),
    };
    let icp = IcpSettings { voxel: params.number("IcpVoxel"), step: 0.05, turn: 0.05, window: 100 };
    let estimator: Box<dyn PoseEstimator> = match matches_scans(params) {
        true => Box::new(ScanMatching::new(&icp)?),
        false => Box::new(Recorded),
    };
    let recording = Rgbd::open(params.text("Recording").as_ref(), settings)?;
    Ok(Player::new(Box::new(recording), estimator, frames(params)))
}
