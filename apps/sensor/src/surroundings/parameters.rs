//! World and body as a mission file says them.

use elk_bus::AppError;
use elk_geometry::Pose;
use elk_geometry::limits::check_point;
use elk_mission::{Kind, ParamSpec, Params};
use elk_spatial::checks::MAX_POINTS;
use elk_world::placement::{SCALES, UP};
use elk_world::{BUILT_IN, CAR_INTERIOR, Placement, World};
use nalgebra::Point3;

use super::body::{Body, random_start};
use crate::camera::Camera;
use crate::parameters::param;
use crate::source::Truth;

/// What a mission file can say of world and body.
pub(crate) const PARAMS: &[ParamSpec] = &[
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

/// What a mission file can say of a camera beside `Width`, `Height` and `Range`, which differ from camera to camera.
pub(crate) const FOV: ParamSpec = param(
    "Fov",
    Kind::Number { unit: "deg", min: 1.0, max: 170.0 },
    "75",
    "Horizontal field of view; pixels are square, so Width and Height give the vertical one.",
);

/// The body that the parameters say, in its world.
pub(crate) fn body(params: &Params) -> Result<Body, AppError> {
    let world = world(params)?;
    let remarks = remarks(params.text("World"), &world);
    let start = start(params, &world)?;
    check_point(&start.position()).map_err(|invalid| {
        format!("Start: {invalid}, as no map reaches farther; move the world nearer to the origin")
    })?;
    let body = Body::new(world, start, params.number("BodyRadius")).with_remarks(remarks);
    body.free(&start).map_err(|refusal| format!("Start: {refusal}; choose a free place, or RandomStart true"))?;
    Ok(body)
}

/// Sees that a scan of Width × Height pixels is not too large.
pub(crate) fn check_pixels(params: &Params) -> Result<(), AppError> {
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

/// The seed of everything random.
pub(crate) fn seed(params: &Params) -> u64 {
    // The table keeps it positive.
    params.integer("Seed") as u64
}

/// The camera of Width × Height pixels that sees Fov.
pub(crate) fn camera(params: &Params) -> Camera {
    // The tables keep the numbers of pixels within 32 bits.
    let pixels = |name| params.integer(name) as u32;
    Camera::new(pixels("Width"), pixels("Height"), params.number("Fov").to_radians())
}

/// How far a camera sees (m); `None`: as far as there is anything.
pub(crate) fn range(params: &Params) -> Option<f64> {
    Some(params.number("Range")).filter(|range| *range > 0.0)
}
