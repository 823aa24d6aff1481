//! The frontier voxels that poses look at, and from where each may be seen.

use std::collections::{BTreeMap, BTreeSet};

use elk_geometry::Voxel;
use elk_geometry::frontier::Faces;
use elk_geometry::set::Near;
use elk_geometry::visibility::{Line, entered, in_sight, line};

use super::lots::Lots;
use crate::strategies::groups::ALIKE_M;
use crate::strategy::View;
use crate::target::{Target, is_untried};

/// Of more frontier voxels than this so many are counted, an even sample: what a pose sees of them says to a few hundredths what it
/// sees of all.
pub const MOST: usize = 1024;

/// A frontier voxel, and what there is to see beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Sighting {
    pub target: Voxel,
    /// Voxels from which it, or what lies near it, was looked at in vain.
    tried: Vec<Voxel>,
    /// What is unknown beside it, each with its faces behind which something is free.
    unknown: Vec<(Voxel, Faces)>,
}

/// Those of the frontier voxels that there are goals for, in order; of more than [`MOST`] a bottom-k sample (Cohen and Kaplan,
/// *Summarizing Data using Bottom-k Sketches*, 2007): those whose lots are smallest, so that it changes by as much as they do.
pub fn sample(view: &View<'_>, lots: Lots) -> Vec<Sighting> {
    let mut targets: Vec<(u64, &Target)> =
        view.goals.targets().map(|target| (lots.number(target.voxel), target)).collect();
    let key = |(number, target): &(u64, &Target)| (*number, target.voxel);
    if targets.len() > MOST {
        targets.select_nth_unstable_by_key(MOST, key);
        targets.truncate(MOST);
    }
    targets.sort_unstable_by_key(|(_, target)| target.voxel);
    let (mut free, vain) = (view.space.free.near(), Vain::of(view));
    targets.into_iter().map(|(_, target)| Sighting::of(&mut free, target, vain.tried(target))).collect()
}

/// What was looked at in vain, by cells as large as what is near it reaches.
struct Vain<'a> {
    cells: BTreeMap<Voxel, Vec<&'a Target>>,
    /// How near what is no better lies (voxels).
    alike: f64,
}

impl<'a> Vain<'a> {
    fn of(view: &View<'a>) -> Self {
        let mut vain = Self { cells: BTreeMap::new(), alike: ALIKE_M / view.space.resolution() };
        for target in view.goals.targets().filter(|target| !target.tried.is_empty()) {
            vain.cells.entry(vain.cell(target.voxel)).or_default().push(target);
        }
        vain
    }

    fn cell(&self, voxel: Voxel) -> Voxel {
        voxel.to_array().map(|c| c.div_euclid(self.alike.ceil() as i32)).into()
    }

    /// From where a target, or any near it, was looked at in vain, in order: from there it would be again.
    fn tried(&self, target: &Target) -> Vec<Voxel> {
        let cell = self.cell(target.voxel);
        let side = -1..=1;
        let cells =
            side.clone().flat_map(|x| side.clone().flat_map(move |y| (-1..=1).map(move |z| Voxel::new(x, y, z))));
        let near = cells.filter_map(|step| self.cells.get(&(cell + step))).flatten();
        let alike = near.filter(|other| other.voxel.distance(target.voxel) <= self.alike);
        let tried: BTreeSet<Voxel> = alike.flat_map(|other| other.tried.iter().copied()).collect();
        tried.into_iter().collect()
    }
}

impl Sighting {
    /// A frontier voxel of a space whose free voxels are these; from those of `tried` a look would be in vain.
    pub fn of(free: &mut Near<'_>, target: &Target, tried: Vec<Voxel>) -> Self {
        let mut open = |unknown: Voxel| Faces::of(unknown, |_, beside| free.contains(beside));
        let unknown = target.unknown().map(|voxel| (voxel, open(voxel))).filter(|(_, open)| !open.is_empty());
        Self { target: target.voxel, tried, unknown: unknown.collect() }
    }

    /// Whether lines from the middle of any voxel of a box (corners, both in it) come to any of the unknown through a face behind
    /// which something is free.
    pub fn may_be_seen_from(&self, places: [Voxel; 2]) -> bool {
        self.unknown.iter().any(|(unknown, open)| open.meets(entered(*unknown, places).opposite()))
    }

    /// The same for the middle of voxel `place`, if it was not looked at from there in vain.
    pub fn may_be_seen(&self, place: Voxel) -> bool {
        let mut unknown = self.unknown.iter();
        unknown.any(|(unknown, open)| open.meets(entered(place, [*unknown; 2]))) && is_untried(&self.tried, place)
    }

    /// Whether a camera in the middle of voxel `place` sees any of the unknown, and was not there in vain: as
    /// [`Target::seen_from`] says, which walks all lines to their ends.
    pub fn is_seen(&self, resolution: f64, free: &mut Near<'_>, place: Voxel) -> bool {
        let mut is_clear = |unknown: Voxel| match line(free, place, unknown) {
            Line::Hidden => false,
            Line::Clear => true,
            Line::Unsure => in_sight(resolution, |voxel| free.contains(voxel), place.center(resolution), unknown),
        };
        let faces = |(unknown, open): &&(Voxel, Faces)| open.meets(entered(place, [*unknown; 2]));
        is_untried(&self.tried, place) && self.unknown.iter().filter(faces).any(|(unknown, _)| is_clear(*unknown))
    }
}
