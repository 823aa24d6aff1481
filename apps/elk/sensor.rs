//! `elk sensor`: a sensor by itself, or one pair of a stereo camera without a mission.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use elk_mission::Params;
use elk_outside::file;
use elk_sensor::matching;
use elk_sensor::stereo_pair::{Pair, Rectified, grey};
use elk_stereo::{StereoCalibration, calibration};

use crate::arguments::{AppArgs, CommunityArgs, setting};
use crate::commands;
use crate::target::Target;

/// The type of which one pair of images can be looked at.
const STEREO: &str = "Stereo";
/// More than pictures of cameras have (bytes).
const LONGEST_IMAGE: u64 = 256 << 20;
/// More than calibrations have (bytes).
const LONGEST_CALIBRATION: u64 = 1 << 20;
/// The files of a pair.
const PICTURE: &str = "picture.png";
const DISPARITY: &str = "disparity.png";
const CLOUD: &str = "cloud.ply";
const PLAN: &str = "plan.png";

/// A sensor, or a pair of images.
#[derive(Debug, Args)]
pub struct SensorArgs {
    /// Its type; `elk types Sensor` lists them. Stereo with two images: one pair, without a mission
    #[arg(long = "type", value_name = "TYPE")]
    type_name: String,
    /// Its name on the bus; its element's if not said
    #[arg(long)]
    name: Option<String>,
    /// Which community.
    #[command(flatten)]
    community: CommunityArgs,
    /// Its parameters, Param=Value; of a pair the left and the right image first
    #[arg(value_name = "IMAGE|PARAM=VALUE")]
    said: Vec<String>,
    /// Of a pair: the calibration of its cameras, as OpenCV writes it; or twice: the left and the right camera's, as EuRoC does
    #[arg(long, value_name = "FILE")]
    calibration: Vec<PathBuf>,
    /// Of a pair: the folder for picture.png, disparity.png (16 bits, 256 a pixel), cloud.ply and plan.png
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

/// Runs a sensor, or looks at a pair.
pub fn run(arguments: SensorArgs) -> Result<ExitCode> {
    let SensorArgs { type_name, name, community, said, calibration, output } = arguments;
    let settings = |said: &[String]| said.iter().map(|one| setting(one)).collect::<Result<Vec<_>, _>>();
    // What names a parameter is no picture.
    let names_pictures = said.iter().any(|one| !one.contains('='));
    let is_pair = type_name == STEREO && (names_pictures || !calibration.is_empty() || output.is_some());
    if !is_pair {
        if !calibration.is_empty() || output.is_some() {
            bail!("--calibration and -o are of a pair of images; right is --type {STEREO}");
        }
        let settings = settings(&said).map_err(anyhow::Error::msg)?;
        return commands::app("Sensor", AppArgs { type_name, name, community, settings });
    }
    let [left, right, said @ ..] = &said[..] else {
        bail!(
            "a pair is two images; right is elk sensor --type {STEREO} LEFT.png RIGHT.png --calibration CAMERAS.yaml -o FOLDER"
        );
    };
    let output = output.context("there is no folder for what is seen; right is -o FOLDER")?;
    let settings = settings(said).map_err(anyhow::Error::msg)?;
    let params = Params::check(STEREO, matching::PARAMS, &settings, Path::new(""))?;
    pair([Path::new(left), Path::new(right)], &calibration, &params, &output)
}

fn pair(images: [&Path; 2], calibration: &[PathBuf], params: &Params, output: &Path) -> Result<ExitCode> {
    let mut matcher = matching::matcher(params).map_err(|error| anyhow!(error))?;
    let calibrated = read_calibration(calibration)?;
    let [left, right] = images.map(|path| {
        let bytes = file::read(path, LONGEST_IMAGE).with_context(|| format!("cannot read {}", path.display()))?;
        grey(&bytes).with_context(|| path.display().to_string())
    });
    let calibration_name = calibration.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
    let names = images.map(|path| path.display().to_string());
    let images = [left?, right?];
    let rectified = Rectified::new(&calibrated, calibration_name)?;
    let pair = Pair { images, names, rectified: &rectified };
    let outcome = pair.matched(&mut *matcher)?;
    std::fs::create_dir_all(output).with_context(|| format!("cannot make the folder {}", output.display()))?;
    // All are there when all are whole.
    let target = Target::new(&output.join(PICTURE), PICTURE)?;
    let files = [
        (target.draft().to_owned(), outcome.picture_png()?),
        (target.draft().with_file_name(DISPARITY), outcome.disparity_png()?),
        (target.draft().with_file_name(CLOUD), outcome.cloud_ply()),
        (target.draft().with_file_name(PLAN), outcome.plan_png()?),
    ];
    for (path, bytes) in files {
        file::write(&path, &bytes).with_context(|| format!("cannot write into {}", output.display()))?;
    }
    let shown = output.display();
    target.conclude(&format!("{shown}: {PICTURE}, {DISPARITY}, {CLOUD}, {PLAN}\n{}\n", outcome.summary()))?;
    Ok(ExitCode::SUCCESS)
}

/// The calibration in OpenCV's one file, or in EuRoC's two.
fn read_calibration(paths: &[PathBuf]) -> Result<StereoCalibration> {
    let read = |path: &PathBuf| {
        file::read_text(path, LONGEST_CALIBRATION).with_context(|| format!("cannot read {}", path.display()))
    };
    match paths {
        [one] => {
            let text = read(one)?;
            calibration::opencv(&text).with_context(|| match calibration::euroc_body_from_camera(&text) {
                Ok(_) => format!("{}: it is of one of EuRoC's cameras, of which two are given, or else", one.display()),
                Err(_) => one.display().to_string(),
            })
        }
        [left, right] => calibration::euroc(&read(left)?, &read(right)?)
            .with_context(|| format!("{}, {}", left.display(), right.display())),
        _ => bail!(
            "{} calibrations; right is --calibration CAMERAS.yaml (OpenCV), or --calibration LEFT.yaml \
             --calibration RIGHT.yaml (EuRoC)",
            match paths.len() {
                0 => "no".to_owned(),
                many => many.to_string(),
            }
        ),
    }
}
