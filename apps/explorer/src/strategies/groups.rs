//! What is to be seen, in groups that are the larger the farther away they are, and what of it is seen from where the robot is.

use std::collections::BTreeMap;

use elk_geometry::Voxel;

use crate::strategy::View;
use crate::target::Target;

/// Cells have an edge of so many powers of two at most (voxels).
const COARSEST: u32 = 5;
/// How far from the robot cells are single voxels, at least and at most (voxels): at twice the distance their edge is twice as long.
const FINE: (f64, f64) = (0.5, 64.0);
/// How far a viewpoint is from what it is for, at most (m): as the policy `elk` trusts a look.
pub const VIEW_M: f64 = 5.0;
/// So near what was looked at in vain another look from the same place is in vain as well (m): a surface seen at a grazing angle has
/// many such voxels.
pub const ALIKE_M: f64 = 0.5;

/// Targets that lie in one cell of an octree, of which the first stands for all.
#[derive(Debug)]
pub struct Group<'a> {
    /// The first of them.
    pub target: &'a Target,
    /// Its goal's voxel, if there is one near.
    pub goal: Option<Voxel>,
    /// How many they are.
    pub size: usize,
}

/// The targets in groups: those in the cells of an octree, which are the larger the farther away they are, and as small as can be
/// afforded: of `most` groups at most, unless they are too far apart for that.
pub fn groups<'a>(view: &View<'a>, most: usize) -> Vec<Group<'a>> {
    let far = view.open.iter().map(|target| Group { target, goal: None, size: 1 });
    let near = view.goals.iter().map(|goal| Group { target: &goal.target, goal: Some(goal.voxel), size: 1 });
    // Of a target with a goal near by, that stands.
    let all: BTreeMap<Voxel, Group<'a>> = far.chain(near).map(|group| (group.target.voxel, group)).collect();
    if all.len() <= most {
        return all.into_values().collect();
    }
    let ranges = std::iter::successors(Some(FINE.1), |range| Some(range / std::f64::consts::SQRT_2));
    let mut cells: BTreeMap<_, (Voxel, usize)> = BTreeMap::new();
    for range in ranges.take_while(|range| *range >= FINE.0) {
        cells.clear();
        for target in all.keys() {
            let doubled = (target.distance(view.space.start()) / range).max(1.0).log2();
            let bits = (doubled as u32).min(COARSEST);
            cells.entry((bits, target.to_array().map(|c| c >> bits))).or_insert((*target, 0)).1 += 1;
        }
        if cells.len() <= most {
            break;
        }
    }
    let first: BTreeMap<Voxel, usize> = cells.into_values().collect();
    let sized = |(target, group): (Voxel, Group<'a>)| Some(Group { size: *first.get(&target)?, ..group });
    all.into_iter().filter_map(sized).collect()
}

/// Where looks from a place were in vain.
#[derive(Debug)]
pub struct InVain {
    targets: Vec<Voxel>,
    /// How near to them others are no better (voxels).
    alike: f64,
}

impl InVain {
    /// Those of these targets, from the middle of voxel `place`.
    pub fn from<'a>(place: Voxel, resolution: f64, targets: impl Iterator<Item = &'a Target>) -> Self {
        let targets = targets.filter(|target| !target.untried(place)).map(|target| target.voxel).collect();
        Self { targets, alike: ALIKE_M / resolution }
    }

    /// Whether a look from there at this target would be in vain as well.
    pub fn is_like(&self, target: &Target) -> bool {
        self.targets.iter().any(|voxel| voxel.distance(target.voxel) <= self.alike)
    }
}

/// What is seen from where the route starts, if anything is that does not lie near what was looked at from there in vain: the
/// nearest.
pub fn in_sight(view: &View<'_>) -> Option<Voxel> {
    let (resolution, range_m) = (view.space.resolution(), VIEW_M.min(view.sight.range_m));
    let in_vain = InVain::from(Voxel::containing(view.from, resolution), resolution, view.open.iter());
    let away = |target: &Target| (target.voxel.center(resolution) - view.from).norm();
    let near = view.open.iter().map(|target| (away(target), target)).filter(|(away, _)| *away <= range_m);
    let mut near: Vec<(f64, &Target)> = near.collect();
    near.sort_by(|one, other| one.0.total_cmp(&other.0));
    let mut near = near.into_iter().map(|(_, target)| target);
    near.find(|target| !in_vain.is_like(target) && target.seen_from(view.space, view.from)).map(|target| target.voxel)
}
