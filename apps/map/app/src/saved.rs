//! The files that a map begins with and ends in.

use std::path::Path;

use elk_bus::AppError;
use elk_map::{Format, MapConfig, OccupancyMap, RestoreError, Saved, SavedError};
use elk_mission::Kind;
use elk_outside::file;
use elk_spatial::checks::MAX_BRICKS;

/// What a brick takes at most in any file (bytes): in an `.ot` 585 nodes of at most 8 bytes (a ColorOcTree's), and the 13 above
/// them.
const MOST_BYTES_A_BRICK: u64 = 8 * (585 + 13);

/// A file that has to be there.
const THERE: Kind = Kind::File { builtin: &[], at_once: true };

/// The map that goes on from a saved one.
pub fn read(path: &Path, config: MapConfig) -> Result<OccupancyMap, AppError> {
    // In the words in which a mission is told of any file.
    THERE.parse(&path.to_string_lossy(), Path::new("")).map_err(|e| format!("From: {e}"))?;
    let (name, most) = (path.display(), MOST_BYTES_A_BRICK * (config.max_bricks as u64 + 1));
    let bytes = file::read(path, most).map_err(|e| format!("From: cannot read {name}: {e}"))?;
    let saved = Saved::read(&bytes).map_err(|e| format!("From: cannot read {name}: {e}{}", instead(&e, path)))?;
    OccupancyMap::from_saved(config, &saved).map_err(|e| format!("From: {name}: {e}{}", remedy(&e)).into())
}

/// What makes a map of a file that is none.
fn instead(error: &SavedError, path: &Path) -> String {
    match error {
        SavedError::Graph => format!(" (elk mapfile convert {} -o MAP.elkmap --res METRES)", path.display()),
        _ => String::new(),
    }
}

/// What a mission can do about it.
fn remedy(error: &RestoreError) -> String {
    match error {
        RestoreError::Resolution { saved, .. } => format!("; right is Res {saved} m, of the explorer as well"),
        RestoreError::TooMany { bricks, .. } if *bricks <= MAX_BRICKS => {
            format!("; set MaxBricks to {bricks} or more, of the explorer as well")
        }
        RestoreError::TooMany { .. } => format!("; the largest MaxBricks is {MAX_BRICKS}"),
        _ => String::new(),
    }
}

/// Writes a map in the format that the file's name asks for.
pub fn write(path: &Path, map: &OccupancyMap) -> Result<(), AppError> {
    let bytes = Format::of(path).unwrap_or(Format::Bt).write(map);
    let name = path.display();
    file::replace(path, &bytes).map_err(|e| format!("cannot write the map to {name}: {e}; choose another File").into())
}
