//! Images of files.

use std::path::Path;

use elk_outside::file;
use elk_stereo::Image;

use crate::stereo_pair::grey;

/// The longest file of an image that is read (bytes).
const LONGEST_IMAGE: u64 = 1 << 26;

/// The grey image in a file, or what it is and what would be right.
pub(super) fn read(path: &Path) -> Result<Image, String> {
    let named = |why: String| format!("{}: {why}", path.display());
    let bytes = file::read(path, LONGEST_IMAGE).map_err(|error| named(error.to_string()))?;
    grey(&bytes).map_err(|error| named(error.to_string()))
}
