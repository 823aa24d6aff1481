//! `elk mapfile`: looks into the files of maps, makes one of another, and holds one against the true world.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::{Args, Subcommand};
use elk_geometry::Voxel;
use elk_map::comparison::compare;
use elk_map::octomap::graph::read_graph;
use elk_map::{Format, MapConfig, OccupancyMap, Saved};
use elk_outside::file;
use elk_spatial::checks::MAX_BRICKS;
use elk_world::surface::{SurfaceScore, surface_score};

use crate::target::Target;
use crate::terminal::say;
use crate::world::{WorldArgs, length, resolution};

/// More than the files of the largest maps have (bytes).
const LONGEST: u64 = 2 << 30;
/// How sure a map may be that is made here: as sure as any that a mission may make.
const CLAMP: f32 = 100.0;

/// What to do with files of maps.
#[derive(Debug, Subcommand)]
pub enum MapFileCommand {
    /// Say what is in a file: its kind, voxels, and where they are
    #[command(after_help = "Example: elk mapfile info logs/apartment-20261123-224512/map.bt")]
    Info {
        /// The file: .elkmap, .ot, .bt, or .graph
        file: PathBuf,
    },
    /// Write a map in another format, or several as one, or the map of the scans of a .graph
    #[command(
        after_help = "Example: elk mapfile convert logs/apartment-20261123-224512/map.bt -o apartment.elkmap\n\n\
        Of several files, all of voxels of one size, the log-odds add up. A .graph is inserted scan by scan."
    )]
    Convert(ConvertArgs),
    /// Say how much of a world's surfaces a map has, and how much of what the map has for surfaces is there
    #[command(after_help = "Example: elk mapfile score logs/apartment-20261123-224512/map.bt apartment")]
    Score(ScoreArgs),
    /// Say how much of what one map knows another one has
    #[command(after_help = "Example: elk mapfile diff logs/apartment-20261123-224512/map.bt apartment.elkmap")]
    Diff(DiffArgs),
}

/// Which maps.
#[derive(Debug, Args)]
pub struct DiffArgs {
    /// The one: .elkmap, .ot or .bt
    one: PathBuf,
    /// The other, of voxels of the same size
    other: PathBuf,
    /// How many voxels away, along each axis, what is known may lie in the other
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(0..=10))]
    within: u32,
}

/// What is held against what.
#[derive(Debug, Args)]
pub struct ScoreArgs {
    /// The map: .elkmap, .ot or .bt
    map: PathBuf,
    /// Which world.
    #[command(flatten)]
    world: WorldArgs,
    /// How far from a surface a voxel may be, along each axis (m); half a voxel if not said
    #[arg(long, value_parser = length)]
    tolerance: Option<f64>,
}

/// What is made of what.
#[derive(Debug, Args)]
pub struct ConvertArgs {
    /// The files: .elkmap, .ot, .bt, or .graph
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// The new file, whose ending says its format: .elkmap, .ot or .bt
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Edge of the voxels that scans of a .graph are inserted into (m)
    #[arg(long, default_value_t = 0.1, value_parser = resolution)]
    res: f64,
}

/// Carries a command out.
pub fn run(command: MapFileCommand) -> Result<ExitCode> {
    match command {
        MapFileCommand::Info { file } => info(&file)?,
        MapFileCommand::Convert(arguments) => convert(&arguments)?,
        MapFileCommand::Score(arguments) => score(&arguments)?,
        MapFileCommand::Diff(arguments) => diff(&arguments)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn info(path: &Path) -> Result<()> {
    let name = path.display();
    let bytes = read(path)?;
    if is_graph(path) {
        let scans = read_graph(&bytes).with_context(|| format!("cannot read {name}"))?.scans;
        let points: usize = scans.iter().map(|scan| scan.points.len()).sum();
        return say(&format!("{name}: a .graph of {} scans, {points} points\n", scans.len()));
    }
    let saved = Saved::read(&bytes).with_context(|| format!("cannot read {name}"))?;
    let kind = match &saved {
        Saved::Snapshot(_) => "an .elkmap: all that a map knows",
        Saved::LogOdds(_) => "OctoMap's .ot: log-odds",
        Saved::Occupancy(_) => "OctoMap's .bt: occupied, free or unknown",
    };
    let map = map_of(path, &saved)?;
    say(&format!("{name}: {kind}\n{}", contents(&map, bytes.len())))
}

/// What a map holds that takes so many bytes as a file.
fn contents(map: &OccupancyMap, bytes: usize) -> String {
    let (grid, resolution) = (map.grid(), map.config().resolution);
    let (free, occupied) = (grid.free(), grid.occupied());
    let nothing = [Voxel::from([i32::MAX; 3]), Voxel::from([i32::MIN; 3])];
    let ends =
        map.known().fold(nothing, |[low, high], (voxel, _)| [low.inf(voxel), high.sup(voxel + Voxel::new(1, 1, 1))]);
    let metres = |end: Voxel| {
        let [x, y, z] = end.to_array().map(|index| (f64::from(index) * resolution * 1000.0).round() / 1000.0);
        format!("({x}; {y}; {z})")
    };
    let known = free + occupied;
    let mut text = format!("  voxels   {known} of {resolution} m: {free} free, {occupied} occupied\n");
    if known > 0 {
        text += &format!("  extents  from {} to {} m\n", metres(ends[0]), metres(ends[1]));
        text += &format!("  frontier {} voxels\n", map.frontier_len());
        text += &format!("  size     {bytes} bytes, {:.2} a voxel\n", bytes as f64 / known as f64);
    }
    text
}

fn convert(arguments: &ConvertArgs) -> Result<()> {
    let ConvertArgs { files, output, res } = arguments;
    let Some(format) = Format::of(output) else {
        bail!("{}: a map is written as .elkmap, .ot or .bt; right is such an ending", output.display());
    };
    let target = Target::new(output, "map")?;
    let mut maps = files.iter().map(|path| load(path, *res));
    let Some(mut map) = maps.next().transpose()? else { bail!("there is no file to convert") };
    for (path, other) in files[1..].iter().zip(maps) {
        map.merge(&other?).with_context(|| format!("{} does not fit {}", path.display(), files[0].display()))?;
    }
    let bytes = format.write(&map);
    file::write(target.draft(), &bytes).with_context(|| format!("cannot write {}", target.shown()))?;
    let said = format!("{}\n{}", target.shown(), contents(&map, bytes.len()));
    target.conclude(&said)
}

fn score(arguments: &ScoreArgs) -> Result<()> {
    let path = &arguments.map;
    let bytes = read(path)?;
    let saved = Saved::read(&bytes).with_context(|| format!("cannot read {}", path.display()))?;
    let map = map_of(path, &saved)?;
    let (name, world) = arguments.world.load()?;
    let tolerance = arguments.tolerance.unwrap_or(map.config().resolution / 2.0);
    let SurfaceScore { area_m2, recall, occupied, precision } = surface_score(&world, map.grid(), tolerance);
    let [recall, precision] = [recall, precision].map(|share| share * 100.0);
    say(&format!(
        "{}: surfaces of {name}, to {tolerance} m\n  recall     {recall:.2} % of {area_m2:.1} m²\n  precision  {precision:.2} % of \
         {occupied} occupied voxels\n",
        path.display()
    ))
}

fn diff(arguments: &DiffArgs) -> Result<()> {
    let DiffArgs { one, other, within } = arguments;
    let maps = [one, other].map(|path| -> Result<OccupancyMap> {
        let bytes = read(path)?;
        map_of(path, &Saved::read(&bytes).with_context(|| format!("cannot read {}", path.display()))?)
    });
    let [of_one, of_other] = maps;
    let maps = [of_one?, of_other?];
    let [size, other_size] = [&maps[0], &maps[1]].map(|map| map.config().resolution);
    if size != other_size {
        bail!("{} has voxels of {size} m and {} of {other_size} m; right is the same", one.display(), other.display());
    }
    let mut text = String::new();
    for (path, [own, against]) in [(one, [0, 1]), (other, [1, 0])] {
        let comparison = compare(&maps[own], maps[against].grid(), *within);
        let [same, near] = comparison.shares().map(|share| share * 100.0);
        text += &format!(
            "{}: of {} known voxels {same:.2} % are the same in the other, {near:.2} % to {within} voxels\n",
            path.display(),
            comparison.known
        );
    }
    say(&text)
}

/// The map in a file, or the one of the scans in it.
fn load(path: &Path, resolution: f64) -> Result<OccupancyMap> {
    let (bytes, unreadable) = (read(path)?, || format!("cannot read {}", path.display()));
    if is_graph(path) {
        let graph = read_graph(&bytes).with_context(unreadable)?;
        return OccupancyMap::from_graph(config(resolution), &graph)
            .with_context(|| format!("cannot use {}", path.display()));
    }
    map_of(path, &Saved::read(&bytes).with_context(unreadable)?)
}

fn map_of(path: &Path, saved: &Saved<'_>) -> Result<OccupancyMap> {
    let map = OccupancyMap::from_saved(config(saved.resolution()), saved);
    map.with_context(|| format!("cannot use {}", path.display()))
}

fn config(resolution: f64) -> MapConfig {
    let [clamp_min, clamp_max] = [-CLAMP, CLAMP];
    MapConfig { resolution, clamp_min, clamp_max, max_bricks: MAX_BRICKS, ..MapConfig::default() }
}

fn read(path: &Path) -> Result<Vec<u8>> {
    file::read(path, LONGEST).with_context(|| format!("cannot read {}", path.display()))
}

fn is_graph(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "graph")
}
