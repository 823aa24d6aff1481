//! The second phase, once no frontier is left to be resolved: what is occupied with little confidence, and so unsure, is looked at
//! again (thesis 6.5.3 and 7.2, 1).
//!
//! Unsure voxels lie side by side, and one look serves many. So they are taken brick by brick, the nearest first: of the places that
//! see most of a brick, the one is gone to that sees most unsure voxels for its way, whatever brick these are in, and as many looks are
//! taken there as have those in view. What was in view, and is unsure still, was looked at from that place in vain. After so many places
//! (`Attempts`) it is given up, and so is what no place sees. Only what exploration left unsure is inspected, not what comes to it
//! meanwhile: a sensor that errs makes voxels unsure as fast as looks make others sure, and the phase would not end.

use std::collections::BTreeMap;

use elk_geometry::astar::{self, Reached};
use elk_geometry::bricks::{BRICK, brick_of, voxel_at};
use elk_geometry::visibility::in_sight;
use elk_geometry::{State, Voxel, VoxelSet, mask};
use elk_spatial::checks::MAX_REMEMBERED;
use elk_spatial::messages::{Outcome, PlanRequest};
use nalgebra::{Point3, Vector3};

use super::memory::Memory;
use super::settings::Settings;
use crate::sight::Sight;
use crate::space::Space;
use crate::target::{Known, is_untried};

/// How far a look is from what it is for, at most (m): so far several rays of a scan hit a voxel.
const VIEW_M: f64 = 3.0;
/// Places are tried that are so many voxels apart along each axis;
const STRIDE: i32 = 4;
/// where none of those sees anything, all that are so near to the middle of the brick (m).
const NEAR_M: f64 = 1.0;
/// Of so many places that see most of a brick all that they see is counted.
const LIKELY: usize = 8;
/// What going to a place costs besides its way (m).
const LOOK_M: f64 = 0.5;
/// Looks from one place, at most.
const MOST_LOOKS: usize = 6;
/// So many voxels are inspected at most: a memory has room for them, and for the frontier.
const MOST: usize = MAX_REMEMBERED / 2;

/// What is occupied with little confidence, as the map says.
#[derive(Debug, Default)]
pub struct Inspection {
    unsure: VoxelSet,
}

/// A place from which unsure voxels are seen.
#[derive(Debug, Clone, PartialEq)]
pub struct Vantage {
    /// One of these voxels.
    pub target: Voxel,
    /// The voxels of the way there, from [`Space::start`].
    pub way: Vec<Voxel>,
    /// Directions to look in (unit vectors), which have all of them in view.
    pub axes: Vec<Vector3<f64>>,
}

/// Unsure voxels, by what becomes of them.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct UnsureLeft {
    /// They are to be looked at.
    pub open: u64,
    /// They were looked at, from as many places as they may be or from all that there are.
    pub in_vain: u64,
    /// No place that the robot can be in sees them.
    pub unseen: u64,
    /// They came to be unsure while others were looked at.
    pub come: u64,
}

impl Inspection {
    /// These voxels are unsure now, and no others.
    pub fn hear_of(&mut self, unsure: VoxelSet) {
        self.unsure = unsure;
    }

    /// What is unsure now is what is to be looked at; answers how much that is. The memory has it from then on.
    pub fn begin(&self, space: &Space, memory: &mut Memory, settings: &Settings) -> u64 {
        let all: Vec<Voxel> = self.in_volume(space, settings).take(MOST).collect();
        all.iter().for_each(|voxel| memory.keep_in_mind(*voxel));
        all.len() as u64
    }

    /// If the last path was one of this phase: what was in view from its end, and is unsure still, was looked at in vain.
    pub fn learn(&self, known: Known, request: &PlanRequest, memory: &mut Memory) {
        let looked = memory.path().filter(|path| path.again && request.outcome == Outcome::Unresolved);
        let axes: Vec<Vector3<f64>> = looked.iter().flat_map(|path| &path.looks).map(|look| look.forward()).collect();
        if axes.is_empty() {
            return;
        }
        let (from, resolution) = (request.pose.position(), known.grid.resolution());
        let is_free = |voxel: Voxel| known.grid.state(voxel) == State::Free;
        let in_view = |voxel: &Voxel| {
            let toward = toward(from, *voxel, resolution);
            in_range(&toward, known.sight) && axes.iter().any(|axis| known.sight.has_in_view(axis, &toward))
        };
        let kept = self.unsure.iter().filter(|voxel| memory.has_in_mind(*voxel)).collect::<Vec<_>>();
        for voxel in kept.into_iter().filter(in_view).filter(|voxel| in_sight(resolution, is_free, from, *voxel)) {
            memory.look_in_vain(voxel, Voxel::containing(from, resolution));
        }
    }

    /// Where to go to look; `None`: nothing unsure is left that is not given up. What no new place sees is remembered as hidden.
    pub fn next(&self, known: Known, space: &Space, memory: &mut Memory, settings: &Settings) -> Option<Vantage> {
        let open = |voxel: &Voxel| is_open(*voxel, memory, settings);
        let open: Vec<Voxel> = self.in_volume(space, settings).filter(open).collect();
        let mut by_brick: BTreeMap<Voxel, Vec<Voxel>> = BTreeMap::new();
        open.iter().for_each(|voxel| by_brick.entry(brick_of(*voxel)).or_default().push(*voxel));
        let mut groups: Vec<(f64, Voxel, Vec<Voxel>)> =
            by_brick.into_iter().map(|(brick, group)| (middle(brick).distance(space.start()), brick, group)).collect();
        groups.sort_by(|one, other| one.0.total_cmp(&other.0));
        let search = Search { space, sight: known.sight, open: &open };
        for (_, brick, group) in groups.into_iter().take_while(|_| !(settings.is_to_stop)()) {
            let vantage = search.vantage(brick, &group, memory);
            if vantage.is_some() {
                return vantage;
            }
            memory.hide(group.into_iter(), known.frontier);
        }
        None
    }

    /// What is unsure still.
    pub fn left(&self, space: &Space, memory: &Memory, settings: &Settings) -> UnsureLeft {
        let mut left = UnsureLeft::default();
        for voxel in self.in_volume(space, settings) {
            let count = if !memory.has_in_mind(voxel) {
                &mut left.come
            } else if is_open(voxel, memory, settings) {
                &mut left.open
            } else if memory.tried(voxel).is_empty() {
                &mut left.unseen
            } else {
                &mut left.in_vain
            };
            *count += 1;
        }
        left
    }

    /// Those unsure voxels that lie in the volume to explore.
    fn in_volume(&self, space: &Space, settings: &Settings) -> impl Iterator<Item = Voxel> {
        let is_in = |voxel: &Voxel| settings.bounds.is_none_or(|bounds| bounds.contains(space.center(*voxel)));
        let level = |(brick, cells)| (brick, mask::and(cells, &space.layer(brick)));
        let voxels = self.unsure.bricks().map(level);
        let voxels = voxels
            .flat_map(|(brick, cells)| mask::cells(&cells).map(move |cell| voxel_at(brick, cell)).collect::<Vec<_>>());
        voxels.filter(is_in)
    }
}

impl UnsureLeft {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.open + self.in_vain + self.unseen + self.come
    }
}

/// Whether an unsure voxel is to be looked at.
fn is_open(voxel: Voxel, memory: &Memory, settings: &Settings) -> bool {
    memory.has_in_mind(voxel) && !memory.is_hidden(voxel) && !memory.gave_up(voxel, settings.attempts)
}

/// For the place to go to next.
struct Search<'a> {
    space: &'a Space,
    sight: Sight,
    /// All voxels that are to be looked at.
    open: &'a [Voxel],
}

impl Search<'_> {
    /// Of the places that see most of the voxels `group` of a brick, that which sees most for its way; `None`: none sees any.
    fn vantage(&self, brick: Voxel, group: &[Voxel], memory: &Memory) -> Option<Vantage> {
        let is_bare =
            |voxel: &Voxel| voxel.face_neighbours().into_iter().any(|beside| self.space.free.contains(beside));
        let group: Vec<Voxel> = group.iter().copied().filter(is_bare).collect();
        if group.is_empty() {
            return None;
        }
        let all = [(STRIDE, VIEW_M.min(self.sight.range_m)), (1, NEAR_M.min(self.sight.range_m))];
        let likely =
            all.into_iter().map(|(stride, range_m)| self.likely(middle(brick), (stride, range_m), &group, memory));
        let likely = likely.into_iter().find(|places| !places.is_empty())?;
        let worth = |place: Voxel| {
            let way = astar::toward(&self.space.reach, self.space.start(), place);
            let gain = self.seen(place, self.open, memory).count() as f64;
            Some((gain / (way.cost(place)? * self.space.resolution() + LOOK_M), place, way))
        };
        // Of equals the first: it sees most of the brick.
        let best = likely.into_iter().filter_map(worth).reduce(|one, other| if other.0 > one.0 { other } else { one });
        let (_, place, way) = best?;
        self.look_from(place, &way, memory)
    }

    /// The places at most `range_m` from `middle`, and so many voxels apart, that see most of `group`, those first.
    fn likely(&self, middle: Voxel, (stride, range_m): (i32, f64), group: &[Voxel], memory: &Memory) -> Vec<Voxel> {
        let most = (range_m / self.space.resolution()).floor();
        let steps = || (-(most as i32)..=most as i32).filter(|step| step % stride == 0);
        let offsets = steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| Voxel::new(x, y, z))));
        let mut reach = self.space.reach.near();
        let places = offsets.map(|offset| middle + offset).filter(|place| reach.contains(*place));
        let seen = places.map(|place| (self.seen(place, group, memory).count(), place));
        let mut seen: Vec<(usize, Voxel)> = seen.filter(|(count, _)| *count > 0).collect();
        seen.sort_by_key(|(count, place)| (usize::MAX - count, *place));
        seen.into_iter().take(LIKELY).map(|(_, place)| place).collect()
    }

    /// Which of these voxels a camera sees from the middle of `place`, whatever way it looks, from which they were not looked at yet.
    fn seen<'a>(&'a self, place: Voxel, voxels: &'a [Voxel], memory: &'a Memory) -> impl Iterator<Item = Voxel> + 'a {
        let from = self.space.center(place);
        let near = move |voxel: &Voxel| in_range(&toward(from, *voxel, self.space.resolution()), self.sight);
        let is_new = move |voxel: &Voxel| is_untried(memory.tried(*voxel), place);
        voxels.iter().copied().filter(near).filter(is_new).filter(move |voxel| self.space.sees(from, *voxel))
    }

    fn look_from(&self, place: Voxel, way: &Reached, memory: &Memory) -> Option<Vantage> {
        let from = self.space.center(place);
        let voxels: Vec<Voxel> = self.seen(place, self.open, memory).collect();
        let target = *voxels.first()?;
        let rest = voxels.into_iter().map(|voxel| toward(from, voxel, self.space.resolution())).collect();
        Some(Vantage { target, way: way.way_to(place)?, axes: covering(rest, self.sight) })
    }
}

/// Directions that have all of this in view, or most of it: the one that has most, then of the rest, and so on.
fn covering(mut toward: Vec<Vector3<f64>>, sight: Sight) -> Vec<Vector3<f64>> {
    let mut axes = Vec::new();
    while axes.len() < MOST_LOOKS && !toward.is_empty() {
        let stride = toward.len().div_ceil(32);
        let middle: Vector3<f64> = toward.iter().sum();
        let tried = std::iter::once(&middle).chain(toward.iter().step_by(stride));
        let tried = tried.filter_map(|axis| axis.try_normalize(1e-9)).map(|axis| sight.held(axis));
        let count = |axis: &Vector3<f64>| toward.iter().filter(|toward| sight.has_in_view(axis, toward)).count();
        let most =
            tried.map(|axis| (count(&axis), axis)).reduce(|one, other| if other.0 > one.0 { other } else { one });
        let Some((_, axis)) = most.filter(|(count, _)| *count > 0) else { break };
        toward.retain(|toward| !sight.has_in_view(&axis, toward));
        axes.push(axis);
    }
    axes
}

fn toward(from: Point3<f64>, voxel: Voxel, resolution: f64) -> Vector3<f64> {
    voxel.center(resolution) - from
}

fn in_range(toward: &Vector3<f64>, sight: Sight) -> bool {
    toward.norm() <= VIEW_M.min(sight.range_m)
}

/// The voxel in the middle of a brick.
fn middle(brick: Voxel) -> Voxel {
    voxel_at(brick, 0) + Voxel::new(BRICK / 2, BRICK / 2, BRICK / 2)
}
