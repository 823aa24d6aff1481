//! What an odometry goes by.

use elk_registration::ConfigError;

/// Settings of an [`crate::Odometry`]. Where nothing else is said, the defaults were chosen on the recording and the rendered room of this
/// crate's benches.
#[derive(Clone, Debug, PartialEq)]
pub struct OdometryConfig {
    /// The image is divided into square cells with a side of so many pixels, and each has at most one new point.
    pub cell: usize,
    /// How much a window of 7 × 7 pixels has to change along the direction in which it changes least, to be a corner: mean squared slope, grey²
    /// per pixel².
    pub texture: f64,
    /// How far along a row a corner is looked for, pixels: what is nearer than f b / disparities is no point of the map.
    pub disparities: usize,
    /// How alike windows of one point have to be: normalised correlation, 0 to 1.
    pub similarity: f64,
    /// How far from where the pose puts it a point may be seen, pixels over left column, row and right column together.
    pub tolerance: f64,
    /// The fewest points that have to agree on a pose.
    pub inliers: usize,
    /// … and the least share of those that were found somewhere.
    pub share: f64,
    /// The largest standard deviation of the position in its worst direction at which a pose is said, metres.
    pub deviation: f64,
    /// A pair becomes a keyframe when the cameras have gone so far since the last one, in parts of the median distance of what they see.
    pub step: f64,
    /// … or when the points that were found lie in less than this share of the cells in which they lay then.
    pub cover: f64,
    /// So many keyframes are adjusted together, and what none of them has seen is forgotten, but for the memory.
    pub window: usize,
    /// So many keyframes before those are kept with what they saw, about 0.1 MB each, and taken up again where the cameras have their view again;
    /// 0: none, as of an odometry that recognises nothing.
    pub memory: usize,
    /// After so many lost pairs in a row the map begins anew where the cameras are supposed to be, with the first pair of which one can be made;
    /// `None`: never, all pairs to come are looked for in the map that there is.
    pub patience: Option<u64>,
    /// Of the random numbers by which a consensus is looked for.
    pub seed: u64,
}

impl Default for OdometryConfig {
    fn default() -> Self {
        Self {
            cell: 32,
            texture: 8.0,
            disparities: 128,
            similarity: 0.87,
            tolerance: 1.5,
            inliers: 15,
            share: 0.4,
            deviation: 0.1,
            step: 0.1,
            cover: 0.7,
            window: 10,
            memory: 0,
            patience: Some(20),
            seed: 1,
        }
    }
}

/// The least side of a cell, pixels.
const LEAST_CELL: usize = 8;
/// Cells of an image for which the other settings were chosen: those of 752 × 480 pixels with a side of 32.
const CELLS: f64 = 360.0;

impl OdometryConfig {
    /// The defaults with as many cells as they were chosen for, of images of so many columns and rows: small images have as many points then as
    /// large ones.
    pub fn for_images([width, height]: [usize; 2]) -> Self {
        let side = (width as f64 * height as f64 / CELLS).sqrt().round() as usize;
        Self { cell: side.max(LEAST_CELL), ..Self::default() }
    }

    /// # Errors
    /// Numbers out of range.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        range("cell", self.cell as f64, LEAST_CELL as f64, 1000.0)?;
        range("texture", self.texture, 0.1, 16256.25)?;
        range("disparities", self.disparities as f64, 8.0, 16384.0)?;
        range("similarity", self.similarity, 0.1, 1.0)?;
        range("tolerance", self.tolerance, 0.1, 100.0)?;
        range("inliers", self.inliers as f64, 6.0, 1e6)?;
        range("share", self.share, 0.0, 1.0)?;
        range("deviation", self.deviation, 1e-6, 1e3)?;
        range("step", self.step, 1e-3, 10.0)?;
        range("cover", self.cover, 0.0, 1.0)?;
        range("window", self.window as f64, 2.0, 100.0)?;
        range("memory", self.memory as f64, 0.0, 1e6)?;
        self.patience.map_or(Ok(()), |patience| range("patience", patience as f64, 1.0, 1e9))
    }
}

fn range(name: &'static str, found: f64, least: f64, most: f64) -> Result<(), ConfigError> {
    match (least..=most).contains(&found) {
        true => Ok(()),
        false => Err(ConfigError { name, found, least, most }),
    }
}
