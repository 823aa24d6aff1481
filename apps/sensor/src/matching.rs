//! How a pair of images is matched, as a mission file or a command says it.

use elk_bus::AppError;
use elk_mission::{Kind, ParamSpec, Params};
use elk_stereo::{Checks, ConfigError, Matcher, Sad5, Sad5Config, SemiGlobal, SemiGlobalConfig};

use crate::parameters::param;

/// Neighbours of a blank wall differ by 1.13 times the noise's standard deviation in the mean; windows in which it is less than
/// this many times it are such.
const BLANK: f32 = 1.5;

/// What can be said of it.
pub const PARAMS: &[ParamSpec] = &[
    param(
        "Disparities",
        Kind::Integer { min: 16, max: Checks::MAX_LEVELS as i64 },
        "64",
        "Disparities that are searched, a multiple of 16: what is nearer than focal length * baseline / (Disparities - 2) is not seen.",
    ),
    param(
        "Matcher",
        Kind::Choice(&["SAD5", "SemiGlobal"]),
        "SAD5",
        "How the images are matched: by sums of absolute differences over five windows (thesis 3.2.5), or semi-global (slower, right more often).",
    ),
    param(
        "ImageNoise",
        Kind::Number { unit: "", min: 0.0, max: 100.0 },
        "1",
        "Standard deviation of each pixel's noise, in grey levels of 0 to 255: where it alone is seen nothing is matched.",
    ),
];

/// The matcher that the parameters say.
///
/// # Errors
/// Disparities that cannot be searched: of what a matcher is made of, all else has its range in the table.
pub fn matcher(params: &Params) -> Result<Box<dyn Matcher + Send>, AppError> {
    made(params).map_err(|error| format!("Disparities: {error}").into())
}

fn made(params: &Params) -> Result<Box<dyn Matcher + Send>, ConfigError> {
    let asked = |checks: &Checks| Checks {
        levels: params.integer("Disparities") as usize,
        texture: checks.texture.max(BLANK * params.number("ImageNoise") as f32),
        ..checks.clone()
    };
    Ok(match params.text("Matcher") {
        "SAD5" => {
            let config = Sad5Config::default();
            Box::new(Sad5::new(Sad5Config { checks: asked(&config.checks), ..config })?)
        }
        _ => {
            let config = SemiGlobalConfig::default();
            Box::new(SemiGlobal::new(SemiGlobalConfig { checks: asked(&config.checks), ..config })?)
        }
    })
}
