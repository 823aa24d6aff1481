//! The controller of a robot that takes its time, as a mission file says it.

use elk_bus::AppError;
use elk_mission::{AppSpec, AppType, Kind, Mission, ParamSpec, Params, PreflightReport, Program, element};

use crate::app::{ControllerApp, MANUAL, POSE_VARIABLE, param};
use crate::drive::{Axis, Limits, Noise, Robot};

/// Its row in the table of controllers.
pub(crate) const TYPE: AppType = AppType {
    element: "Controller",
    name: "Velocity",
    summary: "Drives a simulated robot along the explorer's paths, within limits on speed and acceleration, and says how long that takes.",
    params: PARAMS,
    build: |params| Ok(Box::new(ControllerApp::driving(params, robot(params)?).on_the_bus())),
    preflight: Some(preflight),
};

const fn speed(min: f64) -> Kind {
    Kind::Number { unit: "m/s", min, max: 10.0 }
}

const ACCELERATION: Kind = Kind::Number { unit: "m/s²", min: 0.05, max: 100.0 };

const PARAMS: &[ParamSpec] = &[
    POSE_VARIABLE,
    param("ForwardSpeed", speed(0.02), "0.5", "Largest speed along the robot, which looks ahead."),
    param("ForwardAcceleration", ACCELERATION, "0.5", "Largest acceleration along the robot."),
    param(
        "LateralSpeed",
        speed(0.0),
        "0.5",
        "Largest speed across the robot; 0: a differential drive, which faces where it goes.",
    ),
    param("LateralAcceleration", ACCELERATION, "0.5", "Largest acceleration across the robot."),
    param(
        "VerticalSpeed",
        speed(0.0),
        "0.5",
        "Largest speed up and down; 0: it stays at its height, and the explorer has to (Explorer.Planar).",
    ),
    param("VerticalAcceleration", ACCELERATION, "0.5", "Largest acceleration up and down."),
    param(
        "YawSpeed",
        Kind::Number { unit: "deg/s", min: 1.0, max: 3600.0 },
        "90",
        "How fast the robot turns at most; its head tilts the camera as fast.",
    ),
    param(
        "YawAcceleration",
        Kind::Number { unit: "deg/s²", min: 5.0, max: 36_000.0 },
        "180",
        "Largest acceleration of turning and tilting.",
    ),
    param(
        "Noise",
        Kind::Number { unit: "", min: 0.0, max: 0.3 },
        "0.02",
        "Standard deviation of the speeds that its motors strive for, as a share of those they are told; cut off at three times that.",
    ),
    param("Seed", Kind::Integer { min: 0, max: i64::MAX }, "1", "Seed of the noise."),
    MANUAL,
];

/// Looks whether the robot can get anywhere, and go where the explorer sends it.
fn preflight(params: &Params, mission: &Mission) -> PreflightReport {
    if let Err(error) = robot(params) {
        return PreflightReport::fault(error);
    }
    // What a program of somebody else's does nobody knows.
    let climbs = |explorer: &&AppSpec| match &explorer.program {
        Program::Builtin(app_type, params) => app_type.param("Planar").is_some() && !params.flag("Planar"),
        Program::Foreign { .. } => false,
    };
    match mission.of_element(element::EXPLORER).find(climbs).filter(|_| params.number("VerticalSpeed") == 0.0) {
        Some(explorer) => PreflightReport::fault(format!(
            "VerticalSpeed is 0, and {} sends the robot up and down; right is {}.Planar true, or a robot that climbs",
            explorer.name, explorer.name
        )),
        None => PreflightReport::default(),
    }
}

fn robot(params: &Params) -> Result<Robot, AppError> {
    let linear = |speed: &str, acceleration: &str| Axis {
        speed: params.number(speed),
        acceleration: params.number(acceleration),
    };
    let limits = Limits {
        forward: linear("ForwardSpeed", "ForwardAcceleration"),
        lateral: linear("LateralSpeed", "LateralAcceleration"),
        vertical: linear("VerticalSpeed", "VerticalAcceleration"),
        yaw: Axis {
            speed: params.number("YawSpeed").to_radians(),
            acceleration: params.number("YawAcceleration").to_radians(),
        },
    };
    // The table keeps the seed from being negative.
    let noise = Noise { sigma: params.number("Noise"), seed: params.integer("Seed") as u64 };
    Ok(Robot::new(&elk_geometry::Pose(nalgebra::Isometry3::identity()), limits.checked()?, noise))
}
