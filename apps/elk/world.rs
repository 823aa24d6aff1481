//! `elk world`: looks at a world before a robot is sent into it.

use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::{Args, Subcommand};
use elk_geometry::limits::RESOLUTIONS_M;
use elk_mission::Kind;
use elk_outside::text;
use elk_world::inspection::inspect;
use elk_world::placement::{SCALES, UP};
use elk_world::suitability::{Suitability, Wanted, suitability};
use elk_world::{Placement, World};
use nalgebra::Point3;

use crate::terminal::say;

/// What to do with a world.
#[derive(Debug, Subcommand)]
pub enum WorldCommand {
    /// Say what is in it: size, unit, whether it is closed, where a robot could start
    #[command(after_help = "Example: elk world info mission-files/worlds/car.obj --json")]
    Info {
        /// Which world.
        #[command(flatten)]
        world: WorldArgs,
        /// As JSON, for programs
        #[arg(long)]
        json: bool,
    },
    /// See whether a mission can be run in it; exit code 1 if not
    #[command(after_help = "Example: elk world check room.obj --res 0.05 --start '1; 1; 0.8'")]
    Check {
        /// Which world.
        #[command(flatten)]
        world: WorldArgs,
        /// Edge of the map's voxels (m)
        #[arg(long, default_value_t = 0.1, value_parser = resolution)]
        res: f64,
        /// Where the robot starts (m): "x; y; z"
        #[arg(long, value_name = "X;Y;Z", value_parser = point, allow_hyphen_values = true)]
        start: Option<Point3<f64>>,
    },
}

/// Which world, and how it is placed.
#[derive(Debug, Args)]
pub struct WorldArgs {
    /// The file: OBJ, STL, PLY or glTF; or a built-in world: `car`, `kitchen`, …
    pub world: PathBuf,
    /// Metres that the file's unit is long: 0.001 for millimetres
    #[arg(long, default_value_t = 1.0, value_parser = scale)]
    pub scale: f64,
    /// The file's axis that points up; format: y for glTF, z for the others
    #[arg(long, default_value = UP[0], value_parser = clap::builder::PossibleValuesParser::new(UP), allow_hyphen_values = true)]
    pub up: String,
}

/// Carries a command out.
pub fn run(command: WorldCommand) -> Result<ExitCode> {
    match command {
        WorldCommand::Info { world, json } => info(&world, json),
        WorldCommand::Check { world, res, start } => check(&world, res, start),
    }
}

impl WorldArgs {
    /// Its name, and the world.
    pub fn load(&self) -> Result<(String, World)> {
        let name = self.world.to_string_lossy().into_owned();
        let placement = Placement::new(self.scale, &self.up).map_err(anyhow::Error::msg)?;
        let world = World::load(&name, &placement)?;
        Ok((name, world))
    }
}

fn info(arguments: &WorldArgs, json: bool) -> Result<ExitCode> {
    let (name, world) = arguments.load()?;
    let found = inspect(&name, &world);
    match json {
        true => say(&format!("{}\n", text::printable_json(&serde_json::to_string_pretty(&found)?)))?,
        false => say(&found.to_string())?,
    }
    Ok(if found.starts.is_empty() { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn check(arguments: &WorldArgs, resolution: f64, start: Option<Point3<f64>>) -> Result<ExitCode> {
    let (name, world) = arguments.load()?;
    let wanted = Wanted { resolution, start, range_m: f64::INFINITY, volume: None };
    let Suitability { mut faults, warnings } = suitability(&world, &wanted);
    if start.is_none() && faults.is_empty() && elk_world::inspection::starts(&world).is_empty() {
        faults.push("nothing in it is free: a robot has nowhere to start".to_owned());
    }
    let right = faults.is_empty();
    let verdict = if right { "can be used" } else { "cannot be used" };
    let mut words = format!("{name}: {verdict}\n");
    faults.iter().for_each(|fault| words += &format!("  wrong: {fault}\n"));
    warnings.iter().for_each(|warning| words += &format!("  note: {warning}\n"));
    say(&words)?;
    Ok(if right { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn point(text: &str) -> Result<Point3<f64>, String> {
    match (Kind::Point { unit: "m" }).parse(text, "".as_ref()) {
        Ok(elk_mission::ParamValue::Point(point)) => Ok(point.into()),
        Ok(_) => Err("right is \"x; y; z\"".to_owned()),
        Err(error) => Err(error.to_string()),
    }
}

/// A length that may be 0, in metres.
pub fn length(text: &str) -> Result<f64, String> {
    number(text, "m", &(0.0..=*RESOLUTIONS_M.end()))
}

/// The edge of a voxel, in metres.
pub fn resolution(text: &str) -> Result<f64, String> {
    number(text, "m", &RESOLUTIONS_M)
}

fn scale(text: &str) -> Result<f64, String> {
    number(text, "", &SCALES)
}

fn number(text: &str, unit: &'static str, range: &RangeInclusive<f64>) -> Result<f64, String> {
    let kind = Kind::Number { unit, min: *range.start(), max: *range.end() };
    match kind.parse(text, "".as_ref()) {
        Ok(elk_mission::ParamValue::Number(number)) => Ok(number),
        Ok(_) => Err(format!("right is {}", kind.expected())),
        Err(error) => Err(error.to_string()),
    }
}
