//! How a pair of images is matched, as a mission file or a command says it.

use elk_bus::AppError;
use elk_mission::{Kind, ParamSpec, Params};
use elk_stereo::{Checks, ConfigError, Matcher, Preprocessing, Sad5, Sad5Config, SemiGlobal, SemiGlobalConfig};

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
        "Preprocessing",
        Kind::Choice(&["default", "none", "Sobel", "DoG", "Bilateral"]),
        "default",
        "What is done to both images before they are matched (thesis 3.2.4); default: as the Matcher is best, Sobel for SAD5 and none for \
         SemiGlobal; Sobel: their change along rows; DoG: a difference of Gaussians; Bilateral: what a bilateral filter takes away (slow).",
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
    let filter = preprocessing(params);
    Ok(match params.text("Matcher") {
        "SAD5" => {
            let config = Sad5Config::default();
            let preprocessing = filter.unwrap_or(config.preprocessing);
            Box::new(Sad5::new(Sad5Config { preprocessing, checks: asked(&config.checks), ..config })?)
        }
        _ => {
            let config = SemiGlobalConfig::default();
            let preprocessing = filter.unwrap_or(config.preprocessing);
            Box::new(SemiGlobal::new(SemiGlobalConfig { preprocessing, checks: asked(&config.checks), ..config })?)
        }
    })
}

/// The filter of both images; none: the matcher's own.
fn preprocessing(params: &Params) -> Option<Preprocessing> {
    match params.text("Preprocessing") {
        "none" => Some(Preprocessing::None),
        "Sobel" => Some(Preprocessing::default()),
        "DoG" => Some(Preprocessing::DIFFERENCE_OF_GAUSSIANS),
        "Bilateral" => Some(Preprocessing::BILATERAL),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use elk_stereo::{Disparity, Image};

    use super::*;

    fn said(settings: &[(&str, &str)]) -> Params {
        let settings: Vec<_> = settings.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect();
        Params::check("Stereo", PARAMS, &settings, Path::new("")).unwrap()
    }

    /// What is matched of a wall of stripes and spots, 8 pixels from the left image to the right one, which is brighter.
    fn matched(settings: &[(&str, &str)]) -> Disparity {
        let grey = |row: usize, column: usize| ((row * 7 + column * 13) ^ (column * column / 5 + row * 3)) % 97;
        let left = Image::from_fn(128, 64, |row, column| 60 + grey(row, column) as u8).unwrap();
        let right = Image::from_fn(128, 64, |row, column| 80 + grey(row, column + 8) as u8).unwrap();
        matcher(&said(settings)).unwrap().disparity(&left, &right).unwrap()
    }

    #[test]
    fn each_filter_is_another_and_the_default_is_the_matchers_own() {
        for (matcher, own) in [("SAD5", "Sobel"), ("SemiGlobal", "none")] {
            let with = |filter| matched(&[("Matcher", matcher), ("Disparities", "16"), ("Preprocessing", filter)]);
            let all = ["none", "Sobel", "DoG", "Bilateral"].map(with);
            assert_eq!(matched(&[("Matcher", matcher), ("Disparities", "16")]), with(own), "{matcher}");
            for (i, one) in all.iter().enumerate() {
                assert!(all[..i].iter().all(|other| other != one), "{matcher}: filter {i} is another one as well");
            }
            // What is 20 grey levels brighter is the same to all that look at changes.
            for (disparity, filter) in all[1..].iter().zip(["Sobel", "DoG", "Bilateral"]) {
                assert!(disparity.density() > 0.5, "{matcher}, {filter}: {}", disparity.density());
                let right = disparity.iter().flatten().filter(|found| (found - 8.0).abs() < 0.5).count();
                assert!(
                    right as f64 > 0.95 * disparity.iter().flatten().count() as f64,
                    "{matcher}, {filter}: {right}"
                );
            }
        }
        let settings = [("Preprocessing".to_owned(), "Gauss".to_owned())];
        let wrong = Params::check("Stereo", PARAMS, &settings, Path::new("")).unwrap_err().to_string();
        assert!(wrong.contains("Gauss") && wrong.contains("Bilateral"), "{wrong}");
    }
}
