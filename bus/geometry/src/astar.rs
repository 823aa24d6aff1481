//! Shortest ways over voxels: A* to one voxel, Dijkstra to the closest of many.
//!
//! What is `passable` is said by index of a [`Region`], of one voxel each, and of none on the region's own faces: with offsets
//! from there a search would leave the box. The 26 neighbours, no corner cut. Ties go to the smaller index, so that equal maps give equal ways.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::region::Region;

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
    /// In voxels; infinite where it has not got to.
    cost: Vec<f64>,
    parent: Vec<u32>,
}

impl Reached {
    /// Length of the shortest way to a voxel (in voxels), from centre to centre; `None`: there is none.
    pub fn cost(&self, to: usize) -> Option<f64> {
        self.cost.get(to).copied().filter(|cost| cost.is_finite())
    }

    /// The shortest way to a voxel, both ends included; `None`: there is none.
    pub fn way_to(&self, to: usize) -> Option<Vec<usize>> {
        self.cost(to)?;
        let mut way = vec![to];
        let mut at = to;
        while at != self.from {
            at = self.parent[at] as usize;
            way.push(at);
        }
        way.reverse();
        Some(way)
    }
}

/// Searches until a goal is reached, and answers which; `bound` is a lower bound of what is left of the way.
fn search(
    region: &Region,
    passable: &[bool],
    from: usize,
    is_goal: impl Fn(usize) -> bool,
    bound: impl Fn(usize) -> f64,
) -> (Reached, Option<usize>) {
    let mut cost = vec![f64::INFINITY; region.len()];
    let mut parent = vec![u32::MAX; region.len()];
    cost[from] = 0.0;
    // Costs are not negative, so their bits sort as they do.
    let mut open = BinaryHeap::from([Reverse((bound(from).to_bits(), from))]);
    while let Some(Reverse((estimate, i))) = open.pop() {
        if is_goal(i) {
            return (Reached { from, cost, parent }, Some(i));
        }
        if f64::from_bits(estimate) > cost[i] + bound(i) {
            continue;
        }
        for m in region.moves() {
            let n = i.wrapping_add_signed(m.offset);
            let cut = |d: &isize| !passable[i.wrapping_add_signed(*d)];
            if !passable[n] || m.between.iter().any(cut) {
                continue;
            }
            let new = cost[i] + m.length;
            if new < cost[n] {
                cost[n] = new;
                parent[n] = i as u32;
                open.push(Reverse(((new + bound(n)).to_bits(), n)));
            }
        }
    }
    (Reached { from, cost, parent }, None)
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
