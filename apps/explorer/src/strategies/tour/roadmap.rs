//! How far it is to places all over the space that the robot can be in, from a lattice instead of all its voxels.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::hash::BuildHasherDefault;

use elk_geometry::Voxel;
use elk_geometry::bricks::BrickHasher;
use elk_geometry::ray::Traversal;

use crate::space::Space;

/// Edge of the lattice (voxels).
pub const LATTICE: i32 = 4;
/// Lengths are counted in so many parts of a voxel, so that equal ways are equal.
const PARTS: f64 = 1024.0;

/// The voxels of a lattice in which the robot can be, and the length of the way to each.
#[derive(Debug)]
pub struct Roadmap<'a> {
    space: &'a Space,
    from: Voxel,
    nodes: Vec<Voxel>,
    index: HashMap<Voxel, usize, BuildHasherDefault<BrickHasher>>,
    /// In parts of a voxel; the largest number where no way is known.
    lengths: Vec<u64>,
}

impl<'a> Roadmap<'a> {
    /// Ways from voxel `from` over straight lines between neighbours in the lattice (Dijkstra). Where that is too coarse for a narrow
    /// passage, what lies behind it is as far as it is straight away.
    pub fn new(space: &'a Space, from: Voxel) -> Self {
        let in_lattice = |voxel: &Voxel| voxel.to_array().iter().all(|c| c.rem_euclid(LATTICE) == 0);
        let mut nodes: Vec<Voxel> = space.reach.iter().filter(in_lattice).collect();
        // What the set has first is a matter of its past.
        nodes.sort_unstable();
        let index = nodes.iter().enumerate().map(|(k, voxel)| (*voxel, k)).collect();
        let lengths = vec![u64::MAX; nodes.len()];
        let mut roadmap = Self { space, from, nodes, index, lengths };
        roadmap.search();
        roadmap
    }

    /// The places of the lattice, in order.
    pub fn nodes(&self) -> &[Voxel] {
        &self.nodes
    }

    /// About the length of the way to a place (m).
    pub fn length_m(&self, place: Voxel) -> f64 {
        let by_node = self.around(place).filter(|k| self.lengths[*k] < u64::MAX);
        let voxels =
            by_node.map(|k| self.lengths[k] as f64 / PARTS + self.nodes[k].distance(place)).min_by(f64::total_cmp);
        let straight = self.from.distance(place);
        voxels.map_or(straight, |voxels| voxels.max(straight)) * self.space.resolution()
    }

    /// The nodes at the corners of the lattice's cell around a voxel.
    fn around(&self, voxel: Voxel) -> impl Iterator<Item = usize> + '_ {
        let low = Voxel::from(voxel.to_array().map(|c| c.div_euclid(LATTICE) * LATTICE));
        let corners = (0..8).map(move |k| low + step(Voxel::new(k & 1, k >> 1 & 1, k >> 2)));
        corners.filter_map(|corner| self.index.get(&corner).copied())
    }

    fn search(&mut self) {
        let resolution = self.space.resolution();
        let mut reach = self.space.reach.near();
        let mut is_free = |from: Voxel, to: Voxel| {
            Traversal::new(from.center(resolution), to.center(resolution), resolution)
                .all(|voxel| reach.contains(voxel))
        };
        let mut open: BinaryHeap<Reverse<(u64, usize)>> = BinaryHeap::new();
        let begin: Vec<usize> = self.around(self.from).filter(|k| is_free(self.from, self.nodes[*k])).collect();
        for k in begin {
            self.lengths[k] = parts(self.from.distance(self.nodes[k]));
            open.push(Reverse((self.lengths[k], k)));
        }
        while let Some(Reverse((length, k))) = open.pop() {
            if length > self.lengths[k] {
                continue;
            }
            let here = self.nodes[k];
            for d in Voxel::new(0, 0, 0).neighbours() {
                let Some(&n) = self.index.get(&(here + step(d))) else { continue };
                let there = length + parts(here.distance(self.nodes[n]));
                if there < self.lengths[n] && is_free(here, self.nodes[n]) {
                    self.lengths[n] = there;
                    open.push(Reverse((there, n)));
                }
            }
        }
    }
}

/// So many cells of the lattice as `d` says along each axis.
fn step(d: Voxel) -> Voxel {
    d.to_array().map(|c| c * LATTICE).into()
}

fn parts(voxels: f64) -> u64 {
    (voxels * PARTS).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategies::rooms::rooms;
    use elk_geometry::astar;

    #[test]
    fn ways_are_about_as_long_as_the_shortest_and_lead_through_doors() {
        let space = rooms();
        let from = Voxel::new(35, 5, 5);
        let (roadmap, all) = (Roadmap::new(&space, from), astar::all(&space.reach, from));
        assert!(roadmap.nodes().len() > 100);
        for place in roadmap.nodes().iter().copied().chain([Voxel::new(33, 35, 3), from]) {
            let (about, exact) = (roadmap.length_m(place), 0.1 * all.cost(place).unwrap());
            assert!((about - exact).abs() < 0.5 + 0.1 * exact, "{about} for {exact} m to {place:?}");
        }
        let (straight, way) = (0.1 * from.distance(Voxel::new(33, 35, 3)), roadmap.length_m(Voxel::new(33, 35, 3)));
        assert!(way > 1.5 * straight, "{way} for {straight} m");
    }
}
