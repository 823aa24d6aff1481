//! How finely points are told apart, and what a setting may be.

/// Voxels of one size, and coarser ones, each twice as large as those before. The coarse ones find far motions, the fine ones small ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    voxel: f64,
    levels: usize,
}

impl Resolution {
    /// The most sizes of voxels.
    pub const MAX_LEVELS: usize = 10;
    /// The least and the largest edge of the finest voxels, metres.
    pub const VOXELS: [f64; 2] = [0.005, 10.0];

    /// Finest voxels with an edge of `voxel` metres, a few times the noise of a point, and `levels` sizes of voxels. The coarsest, with an
    /// edge of voxel · 2^(levels − 1), are about as large as a guess may be off.
    ///
    /// # Errors
    /// Numbers out of range.
    pub fn new(voxel: f64, levels: usize) -> Result<Self, ConfigError> {
        let [least, most] = Self::VOXELS;
        range("voxel", voxel, least, most)?;
        range("levels", levels as f64, 1.0, Self::MAX_LEVELS as f64)?;
        Ok(Self { voxel, levels })
    }

    /// How many sizes of voxels.
    pub fn levels(&self) -> usize {
        self.levels
    }

    /// The edge of a level's voxels, metres; level 0 is the finest.
    pub fn voxel(&self, level: usize) -> f64 {
        self.voxel * (1u64 << level) as f64
    }
}

/// A setting that cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} of {found}: {least} to {most} would be right")]
pub struct ConfigError {
    /// Which setting.
    pub name: &'static str,
    /// Its value.
    pub found: f64,
    /// The least that is right.
    pub least: f64,
    /// The largest that is right.
    pub most: f64,
}

pub(crate) fn range(name: &'static str, found: f64, least: f64, most: f64) -> Result<(), ConfigError> {
    match (least..=most).contains(&found) {
        true => Ok(()),
        false => Err(ConfigError { name, found, least, most }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_told_apart_is_said() {
        let said = |voxel, levels| Resolution::new(voxel, levels).map_err(|error| error.to_string());
        assert_eq!(said(f64::NAN, 3), Err("voxel of NaN: 0.005 to 10 would be right".into()));
        assert_eq!(said(0.1, 0), Err("levels of 0: 1 to 10 would be right".into()));
        assert_eq!(said(0.1, 4).unwrap().voxel(3), 0.8);
    }
}
