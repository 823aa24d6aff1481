//! Shortest ways over voxels: A* to one voxel, Dijkstra to the closest of many.
//!
//! What is `passable` is said by index of a [`Region`], of one voxel each, and of none on the region's own faces: with offsets
//! from there a search would leave the box. The 26 neighbours, no corner cut. Ties go to the smaller index, so that equal maps give equal ways.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::region::{Move, Region};

/// The shortest way from `from` to `to` over voxels in `passable` (indices, both ends included).
pub fn shortest(region: &Region, passable: &[bool], from: usize, to: usize) -> Option<Vec<usize>> {
    let target = region.voxel(to);
    let (reached, end) = search(region, passable, from, |i| i == to, |i| region.voxel(i).distance(target));
    reached.way_to(end?)
}

/// The shortest way from `from` to the closest voxel that is a goal.
pub fn closest(region: &Region, passable: &[bool], from: usize, is_goal: impl Fn(usize) -> bool) -> Option<Vec<usize>> {
    let (reached, end) = search(region, passable, from, is_goal, |_| 0.0);
    reached.way_to(end?)
}

/// The shortest ways from `from` to all voxels that can be got to.
pub fn all(region: &Region, passable: &[bool], from: usize) -> Reached {
    search(region, passable, from, |_| false, |_| 0.0).0
}

/// What a search has got to: shortest ways from one voxel to others, by index of the [`Region`].
#[derive(Debug, Clone)]
pub struct Reached {
    from: usize,
    /// In voxels. Of memory that is all zeros only what is written to is ever there, so that a short search costs little.
    cost: Vec<f64>,
    /// One more than the index of the voxel before; 0 where the search has not got to.
    parent: Vec<u32>,
}

impl Reached {
    fn from(from: usize, voxels: usize) -> Self {
        let (mut cost, mut parent) = (vec![0.0; voxels], vec![0; voxels]);
        (cost[from], parent[from]) = (0.0, from as u32 + 1);
        Self { from, cost, parent }
    }

    /// Takes a way to a voxel if it is shorter than the one that is known.
    #[inline]
    fn improve(&mut self, to: usize, cost: f64, by: usize) -> bool {
        let better = self.parent[to] == 0 || cost < self.cost[to];
        if better {
            (self.cost[to], self.parent[to]) = (cost, by as u32 + 1);
        }
        better
    }

    /// Length of the shortest way to a voxel (in voxels), from centre to centre; `None`: there is none.
    pub fn cost(&self, to: usize) -> Option<f64> {
        self.parent.get(to).filter(|parent| **parent != 0).map(|_| self.cost[to])
    }

    /// The shortest way to a voxel, both ends included; `None`: there is none.
    pub fn way_to(&self, to: usize) -> Option<Vec<usize>> {
        self.cost(to)?;
        let mut way = vec![to];
        let mut at = to;
        while at != self.from {
            at = self.parent[at] as usize - 1;
            way.push(at);
        }
        way.reverse();
        Some(way)
    }
}

/// Searches until a goal is reached, and answers which; `bound` is a lower bound of what is left of the way, which from a voxel
/// to its neighbour falls by no more than the way between them.
fn search(
    region: &Region,
    passable: &[bool],
    from: usize,
    is_goal: impl Fn(usize) -> bool,
    bound: impl Fn(usize) -> f64,
) -> (Reached, Option<usize>) {
    let moves = Moves::of(region);
    let mut reached = Reached::from(from, region.len());
    let mut open = Open::new(bound(from), from);
    while let Some((estimate, i)) = open.pop() {
        if is_goal(i) {
            return (reached, Some(i));
        }
        let cost = reached.cost[i];
        if estimate > cost + bound(i) {
            continue;
        }
        for (n, length) in moves.from(passable, i) {
            if reached.improve(n, cost + length, i) {
                open.push(cost + length + bound(n), n);
            }
        }
    }
    (reached, None)
}

/// The moves of a region, with what each of them needs as bits: one for each of the 26 neighbours, in their order.
struct Moves {
    /// Index offset, length, and the neighbours that have to be passable.
    all: Vec<(isize, f64, u32)>,
}

impl Moves {
    fn of(region: &Region) -> Self {
        let bit = |offset: isize| region.moves().iter().position(|m| m.offset == offset).map_or(0, |k| 1 << k);
        let needs = |m: &Move| m.between.iter().map(|d| bit(*d)).fold(bit(m.offset), |bits, one: u32| bits | one);
        Self { all: region.moves().iter().map(|m| (m.offset, m.length, needs(m))).collect() }
    }

    /// Where the moves from a voxel lead that can be made, and their lengths.
    fn from(&self, passable: &[bool], i: usize) -> impl Iterator<Item = (usize, f64)> {
        let free = |near: u32, (k, (offset, ..)): (usize, &(isize, f64, u32))| {
            near | u32::from(passable[i.wrapping_add_signed(*offset)]) << k
        };
        let near = self.all.iter().enumerate().fold(0, free);
        let made = self.all.iter().filter(move |(.., needs)| near & needs == *needs);
        made.map(move |(offset, length, _)| (i.wrapping_add_signed(*offset), *length))
    }
}

/// Voxels to go on from, those with the smallest estimate first, of equals the one with the smallest index.
///
/// No estimate grows by more than two longest moves from one voxel to the next, so what is open fits into a ring of buckets
/// (Dial, *Algorithm 360*, 1969), and only the lowest bucket has to be in order.
struct Open {
    /// The lowest bucket. Estimates are not negative, so their bits sort as they do.
    now: BinaryHeap<Reverse<(u64, usize)>>,
    /// Its number.
    bucket: u64,
    later: [Vec<Reverse<(u64, usize)>>; RING],
}

/// Buckets of the ring: four voxels, more than twice √3.
const RING: usize = 64;
/// Buckets of a voxel.
const BUCKETS: f64 = 16.0;

impl Open {
    fn new(estimate: f64, index: usize) -> Self {
        let now = BinaryHeap::from([Reverse((estimate.to_bits(), index))]);
        Self { now, bucket: (estimate * BUCKETS) as u64, later: std::array::from_fn(|_| Vec::new()) }
    }

    #[inline]
    fn push(&mut self, estimate: f64, index: usize) {
        let (bucket, entry) = ((estimate * BUCKETS) as u64, Reverse((estimate.to_bits(), index)));
        match bucket <= self.bucket {
            true => self.now.push(entry),
            false => self.later[bucket as usize % RING].push(entry),
        }
    }

    fn pop(&mut self) -> Option<(f64, usize)> {
        if self.now.is_empty() {
            let next = (1..RING as u64).find(|k| !self.later[(self.bucket + k) as usize % RING].is_empty())?;
            self.bucket += next;
            self.now = std::mem::take(&mut self.later[self.bucket as usize % RING]).into();
        }
        self.now.pop().map(|Reverse((estimate, index))| (f64::from_bits(estimate), index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{OccupancyGrid, State, Volume, Voxel};

    /// Two rooms side by side behind a wall of one voxel at x = 6 with a door at y = 0.
    fn rooms() -> (Volume, Vec<bool>) {
        let mut grid = OccupancyGrid::new(0.1);
        for x in -2..15 {
            for y in -2..10 {
                for z in -2..5 {
                    let inside = (0..13).contains(&x) && (0..8).contains(&y) && (0..3).contains(&z);
                    let free = inside && (x != 6 || y == 0);
                    let state = if free { State::Free } else { State::Occupied };
                    grid.set(Voxel::new(x, y, z), state);
                }
            }
        }
        let volume = Volume::of(&grid, Voxel::new(0, 0, 0), 1);
        let passable = volume.states().iter().map(|s| *s == State::Free).collect();
        (volume, passable)
    }

    fn length(volume: &Volume, way: &[usize]) -> f64 {
        way.windows(2).map(|w| volume.voxel(w[0]).distance(volume.voxel(w[1]))).sum()
    }

    #[test]
    fn the_way_leads_through_the_door_and_cuts_no_corner() {
        let (volume, passable) = rooms();
        let at = |x, y| volume.index(Voxel::new(x, y, 1)).unwrap();
        let way = shortest(&volume, &passable, at(3, 4), at(9, 4)).unwrap();
        // Five diagonals would cut the door posts: two straight steps through, the rest diagonal.
        let expected = 2.0 + 2.0 * (2.0 * 2f64.sqrt() + 2.0);
        assert!((length(&volume, &way) - expected).abs() < 1e-9);
        assert!(way.contains(&at(6, 0)));
        let flood = closest(&volume, &passable, at(3, 4), |i| i == at(9, 4)).unwrap();
        assert!((length(&volume, &flood) - expected).abs() < 1e-9);
        let reached = all(&volume, &passable, at(3, 4));
        assert!((reached.cost(at(9, 4)).unwrap() - expected).abs() < 1e-9);
        assert_eq!(reached.way_to(at(9, 4)).unwrap(), flood);
    }

    #[test]
    fn no_way_is_none() {
        let (volume, mut passable) = rooms();
        for z in 0..3 {
            passable[volume.index(Voxel::new(6, 0, z)).unwrap()] = false;
        }
        let at = |x| volume.index(Voxel::new(x, 4, 1)).unwrap();
        assert_eq!(shortest(&volume, &passable, at(3), at(9)), None);
        assert_eq!(closest(&volume, &passable, at(3), |_| false), None);
    }
}
