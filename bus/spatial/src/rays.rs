//! What became of the rays of scans.

use elk_bus::payload;

use crate::pixels::PixelTally;

/// What became of the rays of all scans, on their way from the sensor into the map.
#[payload]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayTally {
    /// Rays that saw nothing up to the sensor's range.
    #[describe(count)]
    pub no_return: u64,
    /// Points that the sensor measured.
    #[describe(count)]
    pub measured: u64,
    /// Of these, points that came to the map: the others were left out by filters.
    #[describe(count)]
    pub received: u64,
    /// Of those received, points that are not finite, or at the camera itself.
    #[describe(count)]
    pub invalid: u64,
    /// Of those received, points outside the map's 65,536 voxels an axis.
    #[describe(count)]
    pub outside: u64,
    /// Of those received, points farther than the map's `MaxRange`.
    #[describe(count)]
    pub too_far: u64,
    /// Of those received, points for which the map had no more bricks (`MaxBricks`).
    #[describe(count)]
    pub no_room: u64,
    /// What became of the pixels of a camera that matches images: what was not matched is a ray of which nothing is known.
    #[describe(default)]
    pub pixels: PixelTally,
}

impl RayTally {
    /// Points that the map took, as hits or as free ways up to its `MaxRange`.
    pub fn taken(&self) -> u64 {
        self.received.saturating_sub(self.invalid).saturating_sub(self.outside).saturating_sub(self.no_room)
    }
}
