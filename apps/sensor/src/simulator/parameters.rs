//! The simulator as a mission file says it.

use elk_bus::AppError;
use elk_geometry::Pose;
use elk_geometry::limits::check_point;
use elk_mission::{Kind, ParamSpec, Params};
use elk_spatial::checks::MAX_POINTS;
use elk_world::placement::{SCALES, UP};
use elk_world::{BUILT_IN, CAR_INTERIOR, Placement, World};
use nalgebra::Point3;

use super::noise::StereoNoise;
use super::source::{Settings, Simulator, random_start};
use crate::app::param;
use crate::camera::Camera;
use crate::source::Truth;

const PIXELS: Kind = Kind::Integer { min: 1, max: 10_000 };

/// What a mission file can say of it.
pub(super) const PARAMS: &[ParamSpec] = &[
    param(
        "World",
        Kind::File { builtin: &BUILT_IN, at_once: true },
        CAR_INTERIOR,
        "The world: an OBJ, STL, PLY or glTF file; `elk world info FILE` says what is in it.",
    ),
    param(
        "Scale",
        Kind::Number { unit: "", min: *SCALES.start(), max: *SCALES.end() },
        "1",
        "Metres that the world's unit is long: 0.001 for millimetres.",
    ),
    param(
        "Up",
        Kind::Choice(UP),
        "format",
        "The world file's axis that points up; format: y for glTF, z for the others.",
    ),
    param("Width", PIXELS, "100", "Pixels in a row of the depth image."),
    param("Height", PIXELS, "100", "Rows of the depth image."),
    param(
        "Fov",
        Kind::Number { unit: "deg", min: 1.0, max: 170.0 },
        "75",
        "Horizontal field of view; pixels are square, so Width and Height give the vertical one.",
    ),
    param(
        "Range",
        Kind::Number { unit: "m", min: 0.0, max: 1e4 },
        "0",
        "How far the camera sees: what is farther gives no return; 0: as far as there is anything.",
    ),
    param(
        "NoiseSigma",
        Kind::Number { unit: "px", min: 0.0, max: 100.0 },
        "0",
        "Standard deviation of the matched pixel position before triangulation; 0: exact depth.",
    ),
    param(
        "NoiseBaseline",
        Kind::Number { unit: "m", min: 0.001, max: 10.0 },
        "0.12",
        "Distance of the two cameras whose triangulation NoiseSigma disturbs (the thesis' stereo camera: 0.12).",
    ),
    param("Seed", Kind::Integer { min: 0, max: i64::MAX }, "1", "Seed of noise and of RandomStart."),
    param(
        "Start",
        Kind::Point { unit: "m" },
        "0; 0; 0.8",
        "Position at the start, in free space (the default is in the car interior).",
    ),
    param(
        "StartYaw",
        Kind::Number { unit: "deg", min: -360.0, max: 360.0 },
        "0",
        "Heading at the start, anticlockwise from world x.",
    ),
    param(
        "StartPitch",
        Kind::Number { unit: "deg", min: -90.0, max: 90.0 },
        "0",
        "Elevation of the view at the start, up positive.",
    ),
    param(
        "RandomStart",
        Kind::Flag,
        "false",
        "Start anywhere free, 0.3 m off every surface, looking anywhere, drawn from Seed; Start, StartYaw and StartPitch then do not count.",
    ),
    param(
        "BodyRadius",
        Kind::Number { unit: "m", min: 0.0, max: 10.0 },
        "0.05",
        "Radius of the robot's body, a ball around the camera, for counting contacts.",
    ),
];

/// The simulator that the parameters say.
pub(super) fn simulator(params: &Params) -> Result<Simulator, AppError> {
    pixels(params)?;
    let world = world(params)?;
    let remarks = remarks(params.text("World"), &world);
    let start = start(params, &world)?;
    check_point(&start.position()).map_err(|invalid| {
        format!("Start: {invalid}, as no map reaches farther; move the world nearer to the origin")
    })?;
    let simulator = Simulator::new(world, settings(params), start).with_remarks(remarks);
    simulator.free(&start).map_err(|refusal| format!("Start: {refusal}; choose a free place, or RandomStart true"))?;
    Ok(simulator)
}

/// Sees that a scan is not too large.
pub(super) fn pixels(params: &Params) -> Result<(), AppError> {
    let pixels = params.integer("Width") * params.integer("Height");
    match pixels > MAX_POINTS as i64 {
        true => Err(format!("Width times Height is {pixels}; a scan has at most {MAX_POINTS} points").into()),
        false => Ok(()),
    }
}

pub(super) fn world(params: &Params) -> Result<World, AppError> {
    Ok(World::load(params.text("World"), &Placement::new(params.number("Scale"), params.text("Up"))?)?)
}

/// What whoever looks at the scans should know of the world.
fn remarks(name: &str, world: &World) -> Vec<String> {
    let open = world.openness().words().map(|words| format!("it is open: {words}"));
    let all = world.reading().remarks().into_iter().chain(open);
    all.map(|remark| format!("World {name}: {remark}")).collect()
}

pub(super) fn start(params: &Params, world: &World) -> Result<Pose, AppError> {
    if params.flag("RandomStart") {
        return Ok(random_start(world, seed(params))?);
    }
    let angle = |name| params.number(name).to_radians();
    let place = Point3::from(params.point("Start"));
    Ok(Pose::from_yaw_pitch(place, angle("StartYaw"), angle("StartPitch")))
}

fn settings(params: &Params) -> Settings {
    // The table keeps the numbers of pixels within 32 bits and the seed positive.
    let pixels = |name| params.integer(name) as u32;
    let noise = StereoNoise { sigma_px: params.number("NoiseSigma"), baseline_m: params.number("NoiseBaseline") };
    Settings {
        camera: Camera::new(pixels("Width"), pixels("Height"), params.number("Fov").to_radians()),
        noise: (noise.sigma_px > 0.0).then_some(noise),
        seed: seed(params),
        body_radius: params.number("BodyRadius"),
        range: Some(params.number("Range")).filter(|range| *range > 0.0),
    }
}

fn seed(params: &Params) -> u64 {
    params.integer("Seed") as u64
}
