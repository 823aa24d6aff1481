//! The files that a map begins with and ends in.

use std::path::Path;

use elk_bus::AppError;
use elk_map::{Format, MapConfig, OccupancyMap, RestoreError, Saved};
use elk_mission::Kind;
use elk_outside::file;

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
    let saved = Saved::read(&bytes).map_err(|e| format!("From: cannot read {name}: {e}"))?;
    OccupancyMap::from_saved(config, &saved).map_err(|e| format!("From: {name}: {e}{}", remedy(&e)).into())
}

/// What a mission can do about it.
fn remedy(error: &RestoreError) -> String {
    match error {
        RestoreError::Resolution { saved, .. } => format!("; right is Res {saved} m, of the explorer as well"),
        RestoreError::TooMany { .. } => "; MaxBricks says how many, of the explorer as well".to_owned(),
        _ => String::new(),
    }
}

/// Writes a map in the format that the file's name asks for.
pub fn write(path: &Path, map: &OccupancyMap) -> Result<(), AppError> {
    let bytes = Format::of(path).unwrap_or(Format::Bt).write(map);
    let name = path.display();
    file::replace(path, &bytes).map_err(|e| format!("cannot write the map to {name}: {e}; choose another File").into())
}
