//! Poses and what they see, kept from plan to plan: what is said of a pose is looked at again where something has changed that it
//! depends on.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::hash::BuildHasherDefault;

use elk_geometry::Voxel;
use elk_geometry::bricks::{BRICK, BRICK_CELLS, BrickHasher, voxel_at};
use elk_geometry::mask;
use nalgebra::Vector3;

use super::lots::{Lots, Pose};
use super::sightings::{Sighting, sample};
use crate::sight::Sight;
use crate::strategy::View;

/// The poses of one draw.
#[derive(Debug, Clone)]
pub struct Kept {
    lots: Lots,
    sight: Sight,
    /// Where there are poses, or were.
    cells: Vec<Cell>,
    /// Their places by brick.
    index: HashMap<Voxel, usize, BuildHasherDefault<BrickHasher>>,
    /// What they look at, by frontier voxel.
    sightings: BTreeMap<Voxel, Sighting>,
}

/// Those in the voxels of a brick.
#[derive(Debug, Clone)]
struct Cell {
    brick: Voxel,
    /// In order of their places in it.
    poses: Vec<Drawn>,
}

/// A pose, and what is known of its view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawn {
    pub pose: Pose,
    /// How many frontier voxels it has in view that may be seen from its side.
    pub in_view: u32,
    /// How many it sees; `None`: it has not looked since something has changed there.
    pub seen: Option<u32>,
}

/// Where a pose stands among all that are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Number {
    cell: usize,
    pose: usize,
}

/// Edge of the cubes of bricks (in bricks, as a power of two) in which changes are held against views.
const CUBE_POWER: i32 = 1;

impl Kept {
    /// The poses of these lots, before anything is known.
    pub fn new(lots: Lots) -> Self {
        let (cells, index, sightings) = (Vec::new(), HashMap::default(), BTreeMap::new());
        Self { lots, sight: Sight::default(), cells, index, sightings }
    }

    /// Brings it up to date with a plan's view, at the cost of what has changed since the last one's.
    pub fn follow(&mut self, view: &View<'_>) {
        let sightings = sample(view, self.lots);
        match view.changed.filter(|_| self.sight == view.sight) {
            Some(bricks) => {
                self.look_at(sightings, view.space.resolution());
                bricks.iter().for_each(|brick| self.draw(view, *brick));
                self.forget(bricks, view.space.resolution());
            }
            None => {
                *self = Self { sight: view.sight, ..Self::new(self.lots) };
                self.sightings = sightings.into_iter().map(|sighting| (sighting.target, sighting)).collect();
                view.space.reach.bricks().for_each(|(brick, _)| self.draw(view, brick));
            }
        }
    }

    /// There are these frontier voxels now, in order.
    fn look_at(&mut self, now: Vec<Sighting>, resolution: f64) {
        let is_kept = |one: &Sighting| now.binary_search_by_key(&one.target, |other| other.target);
        let stays = |one: &Sighting| is_kept(one).is_ok_and(|at| now[at] == *one);
        let gone: Vec<Voxel> = self.sightings.values().filter(|one| !stays(one)).map(|one| one.target).collect();
        for target in gone {
            if let Some(sighting) = self.sightings.remove(&target) {
                self.count(&sighting, resolution, |in_view| *in_view -= 1);
            }
        }
        for sighting in now {
            if !self.sightings.contains_key(&sighting.target) {
                self.count(&sighting, resolution, |in_view| *in_view += 1);
                self.sightings.insert(sighting.target, sighting);
            }
        }
    }

    /// Counts a frontier voxel in all poses that have it in view; what they see is another number then.
    fn count(&mut self, sighting: &Sighting, resolution: f64, counted: impl Fn(&mut u32)) {
        let sight = self.sight;
        let cells = self.cells.iter_mut().filter(|cell| !cell.poses.is_empty());
        for cell in cells.filter(|cell| sighting.may_be_seen_from(corners(cell.brick))) {
            for drawn in cell.poses.iter_mut().filter(|drawn| has_in_view(&sight, resolution, &drawn.pose, sighting)) {
                counted(&mut drawn.in_view);
                drawn.seen = None;
            }
        }
    }

    /// Draws the poses of a brick again: of those that were there what is known stays.
    fn draw(&mut self, view: &View<'_>, brick: Voxel) {
        let (lots, sight, resolution) = (self.lots, self.sight, view.space.resolution());
        let place = *self.index.entry(brick).or_insert(self.cells.len());
        if place == self.cells.len() {
            self.cells.push(Cell { brick, poses: Vec::new() });
        }
        let before = std::mem::take(&mut self.cells[place].poses);
        let mut before = before.into_iter().peekable();
        let order = |pose: &Pose| pose.place.raster();
        let poses = mask::cells(view.space.reach.brick(brick)).filter_map(|cell| lots.pose(voxel_at(brick, cell)));
        let drawn = poses.map(|pose| {
            while before.next_if(|other| order(&other.pose) < order(&pose)).is_some() {}
            let in_view = || self.sightings.values().filter(|one| has_in_view(&sight, resolution, &pose, one)).count();
            let known = before.next_if(|other| other.pose == pose);
            known.unwrap_or_else(|| Drawn { pose, in_view: in_view() as u32, seen: None })
        });
        self.cells[place].poses = drawn.collect();
    }

    /// Something has changed in these bricks: who has any of them in view has to look again.
    fn forget(&mut self, bricks: &BTreeSet<Voxel>, resolution: f64) {
        let cube = |brick: &Voxel| Voxel::from(brick.to_array().map(|c| c >> CUBE_POWER));
        let cubes: BTreeSet<Voxel> = bricks.iter().map(cube).collect();
        let edge = BRICK << CUBE_POWER;
        // A line to what is unknown beside a frontier voxel in view is no farther than a voxel from one that is in view.
        let radius = (f64::from(edge) * 3f64.sqrt() / 2.0 + 1.001) * resolution;
        let middle = |cube: Voxel| Vector3::from(cube.to_array().map(|c| f64::from(c * edge + edge / 2)));
        let middles: Vec<Vector3<f64>> = cubes.into_iter().map(middle).collect();
        let sight = self.sight;
        for drawn in self.cells.iter_mut().flat_map(|cell| &mut cell.poses).filter(|drawn| drawn.seen.is_some()) {
            let Pose { place, axis } = drawn.pose;
            let from = Vector3::from(place.to_array().map(|c| f64::from(c) + 0.5));
            let sees = |middle: &Vector3<f64>| sight.may_cover(&axis, &((middle - from) * resolution), radius);
            if middles.iter().any(sees) {
                drawn.seen = None;
            }
        }
    }

    /// All poses, in no order.
    pub fn all(&self) -> impl Iterator<Item = (Number, &Drawn)> {
        self.cells.iter().enumerate().flat_map(|(cell, own)| {
            own.poses.iter().enumerate().map(move |(pose, drawn)| (Number { cell, pose }, drawn))
        })
    }

    /// How many frontier voxels a pose sees: looked at, if that is not known.
    pub fn look(&mut self, view: &View<'_>, Number { cell, pose }: Number) -> u32 {
        let drawn = &mut self.cells[cell].poses[pose];
        let (pose, sight, resolution) = (drawn.pose, self.sight, view.space.resolution());
        let mut free = view.space.free.near();
        *drawn.seen.get_or_insert_with(|| {
            let in_view = self.sightings.values().filter(|one| has_in_view(&sight, resolution, &pose, one));
            in_view.filter(|one| one.is_seen(resolution, &mut free, pose.place)).count() as u32
        })
    }
}

/// Whether a pose has a frontier voxel in view that may be seen from its side.
fn has_in_view(sight: &Sight, resolution: f64, pose: &Pose, sighting: &Sighting) -> bool {
    let toward = (sighting.target - pose.place).to_array().map(|c| f64::from(c) * resolution);
    sight.has_in_view(&pose.axis, &toward.into()) && sighting.may_be_seen(pose.place)
}

/// Corners of the box of a brick's voxels, both in it.
fn corners(brick: Voxel) -> [Voxel; 2] {
    [voxel_at(brick, 0), voxel_at(brick, BRICK_CELLS - 1)]
}
