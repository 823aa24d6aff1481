//! What of the frontier is seen from a place, by a camera that turns there.

use elk_geometry::Voxel;
use elk_geometry::set::Near;
use nalgebra::Point3;

use super::super::candidates::sightings::Sighting;
use super::super::groups::{Group, VIEW_M};
use crate::strategy::View;
use crate::target::Target;

/// Some of the groups, by their number.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Sighted(Vec<u64>);

impl Sighted {
    fn insert(&mut self, group: usize) {
        let word = group / 64;
        if self.0.len() <= word {
            self.0.resize(word + 1, 0);
        }
        self.0[word] |= 1 << (group % 64);
    }

    /// Those that are not in the other one.
    pub fn without(&self, other: &Self) -> Self {
        let others = other.0.iter().chain(std::iter::repeat(&0));
        Self(self.0.iter().zip(others).map(|(own, other)| own & !other).collect())
    }

    /// Those that are in one of two, or in both.
    pub fn or(&self, other: &Self) -> Self {
        let (long, short) = if self.0.len() < other.0.len() { (other, self) } else { (self, other) };
        let shorts = short.0.iter().chain(std::iter::repeat(&0));
        Self(long.0.iter().zip(shorts).map(|(one, other)| one | other).collect())
    }

    /// Their numbers, ascending.
    pub fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        let bits = |(n, word): (usize, &u64)| {
            let word = *word;
            (0..64).filter(move |bit| word >> bit & 1 == 1).map(move |bit| 64 * n + bit)
        };
        self.0.iter().enumerate().flat_map(bits)
    }
}

/// What stands for a group.
struct Prospect<'a> {
    target: &'a Target,
    center: Point3<f64>,
    sighting: Sighting,
}

/// All groups of a plan, ready to be looked at.
pub struct Prospects<'a> {
    free: Near<'a>,
    resolution: f64,
    range_m: f64,
    prospects: Vec<Prospect<'a>>,
}

impl<'a> Prospects<'a> {
    /// What a plan's places look at.
    pub fn new(view: &View<'a>, groups: &[Group<'a>]) -> Self {
        let mut free = view.space.free.near();
        let prospects = groups.iter().map(|group| {
            let sighting = Sighting::of(&mut free, group.target, group.target.tried.clone());
            Prospect { target: group.target, center: view.space.center(group.target.voxel), sighting }
        });
        let prospects = prospects.collect();
        let range_m = VIEW_M.min(view.sight.range_m);
        Self { free: view.space.free.near(), resolution: view.space.resolution(), range_m, prospects }
    }

    /// The groups of which a camera in the middle of voxel `place` sees what stands for them, if it turns there: as
    /// [`Target::seen_from`] says, at most as far as a look is trusted.
    pub fn seen_from(&mut self, place: Voxel) -> Sighted {
        let Self { free, resolution, range_m, prospects } = self;
        let from = place.center(*resolution);
        let mut sighted = Sighted::default();
        for (group, prospect) in prospects.iter().enumerate() {
            let is_near = (prospect.center - from).norm_squared() <= *range_m * *range_m;
            if is_near && prospect.sighting.is_seen(*resolution, free, place) {
                sighted.insert(group);
            }
        }
        sighted
    }

    /// The same from where the route starts.
    pub fn seen_from_start(&self, view: &View<'_>) -> Sighted {
        let mut sighted = Sighted::default();
        for (group, Prospect { target, center, .. }) in self.prospects.iter().enumerate() {
            if (center - view.from).norm() <= self.range_m && target.seen_from(view.space, view.from) {
                sighted.insert(group);
            }
        }
        sighted
    }
}
