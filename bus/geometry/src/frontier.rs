//! The frontier: free voxels with an unknown face neighbour (thesis 6.3.1.1), kept up to date as voxels change.

use std::borrow::Borrow;
use std::collections::{BTreeMap, HashMap};
use std::hash::BuildHasherDefault;

use crate::bricks::{BrickHasher, brick_of, cell_of, voxel_at};
use crate::grid::OccupancyGrid;
use crate::mask::{self, Mask};
use crate::set::VoxelSet;
use crate::state::State;
use crate::voxel::{Bounds, FACES, Voxel};

/// Whether `voxel` is free and has an unknown face neighbour.
pub fn is_frontier(grid: &OccupancyGrid, voxel: Voxel) -> bool {
    grid.state(voxel) == State::Free && unknown_neighbours(grid, voxel).next().is_some()
}

/// The face neighbours of `voxel` that are unknown, in the order of [`crate::voxel::FACES`].
pub fn unknown_neighbours(grid: &OccupancyGrid, voxel: Voxel) -> impl Iterator<Item = Voxel> + '_ {
    voxel.face_neighbours().into_iter().filter(|n| grid.state(*n) == State::Unknown)
}

/// Whether what is unknown in `voxel` counts: it lies in the volume to explore (`None`: everywhere), and a map has a place
/// for it.
pub fn counts(voxel: Voxel, bounds: Option<Bounds>, resolution: f64) -> bool {
    voxel.is_mappable() && bounds.is_none_or(|b| b.contains(voxel.center(resolution)))
}

/// Free voxels that would be frontier voxels if the map, or the volume to explore, went on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Edges {
    /// Where the map ends: it has no indices for what is beyond.
    pub map: u64,
    /// Where the volume to explore ends.
    pub volume: u64,
    /// Where a map that is full has no brick: what is there it cannot come to know.
    pub no_room: u64,
}

impl Edges {
    /// Those of a map whose frontier this is; no frontier voxel is among them.
    pub fn of(grid: &OccupancyGrid, frontier: &FrontierSet) -> Self {
        let mut edges = Self::default();
        let inside = |voxel: Voxel| counts(voxel, frontier.bounds, grid.resolution());
        let by_brick = grid.bricks().iter().map(|(brick, cells)| {
            let beside = known_beside(grid, brick);
            let all_known = beside.iter().fold(mask::ALL, |all, known| mask::and(&all, known));
            let ends = mask::without(&mask::without(&cells.free(), &all_known), frontier.brick(brick));
            (brick, ends, beside)
        });
        for (brick, ends, beside) in by_brick {
            for (cell, voxel) in mask::cells(&ends).map(|cell| (cell, voxel_at(brick, cell))) {
                if !inside(voxel) {
                    continue;
                }
                let mut beyond = Faces::of(voxel, |n, _| !mask::has(&beside[n], cell)).beside(voxel);
                if beyond.clone().any(|beyond| !beyond.is_mappable()) {
                    edges.map += 1;
                } else if beyond.any(inside) {
                    edges.no_room += 1;
                } else {
                    edges.volume += 1;
                }
            }
        }
        edges
    }
}

/// By face, in the order of [`FACES`], the cells of a brick beside which something is known there.
fn known_beside(grid: &OccupancyGrid, brick: Voxel) -> [Mask; 6] {
    let known = |brick: Voxel| grid.bricks().brick(brick).map_or(mask::NONE, |cells| *cells.known());
    let own = known(brick);
    std::array::from_fn(|n| {
        let opposite = n ^ 1;
        mask::or(&mask::stepped(&own, opposite), &mask::beyond(&known(brick + FACES[n]), opposite))
    })
}

/// Some of the six face neighbours of a voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faces(u8);

impl Faces {
    /// All of them.
    pub const ALL: Self = Self(0b11_1111);
    /// Those of `voxel` of which `which` is true, by their number in [`FACES`].
    pub fn of(voxel: Voxel, mut which: impl FnMut(usize, Voxel) -> bool) -> Self {
        let bit = |(n, face): (usize, &Voxel)| u8::from(which(n, voxel + *face)) << n;
        Self(FACES.iter().enumerate().map(bit).sum())
    }

    /// Of each of them the one on the other side.
    pub fn opposite(self) -> Self {
        Self((self.0 & 0b01_0101) << 1 | (self.0 & 0b10_1010) >> 1)
    }

    /// Whether there is none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether any is in both.
    pub fn meets(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Those that are in one of two sets, or in both.
    pub fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The neighbours of `voxel` there, in the order of [`FACES`].
    pub fn beside(self, voxel: Voxel) -> impl Iterator<Item = Voxel> + Clone {
        FACES.into_iter().enumerate().filter(move |(n, _)| self.0 >> n & 1 == 1).map(move |(_, face)| voxel + face)
    }
}

/// All frontier voxels inside a bounded volume, each with what is unknown beside it: kept by brick.
#[derive(Debug, Clone, Default)]
pub struct FrontierSet {
    /// Those that there are in a brick, and their faces in the order of their cells.
    bricks: HashMap<Voxel, (Mask, Box<[Faces]>), BuildHasherDefault<BrickHasher>>,
    len: usize,
    bounds: Option<Bounds>,
    /// The map is full: it comes to know nothing of bricks that it does not have.
    full: bool,
}

impl FrontierSet {
    /// No frontier yet; voxels whose unknown neighbours all lie outside `bounds`, or outside the map, will not count.
    pub fn new(bounds: Option<Bounds>) -> Self {
        Self { bounds, ..Self::default() }
    }

    /// Takes note that the map is full, or that it is not. Answers the bricks at the rim of those that there are: only of voxels
    /// in them it changes anything.
    pub fn set_full(&mut self, full: bool, grid: &OccupancyGrid) -> Vec<Voxel> {
        if std::mem::replace(&mut self.full, full) == full {
            return Vec::new();
        }
        let ends = |brick: &Voxel| FACES.iter().any(|face| grid.bricks().brick(*brick + *face).is_none());
        let rim: Vec<Voxel> = grid.bricks().iter().map(|(brick, _)| brick).filter(ends).collect();
        rim.iter().for_each(|brick| self.revise(grid, *brick, &mask::ALL));
        rim
    }

    /// Takes note that these voxels of `grid` changed.
    pub fn update(&mut self, grid: &OccupancyGrid, changed: impl IntoIterator<Item = impl Borrow<Voxel>>) {
        self.follow(grid, &changed.into_iter().map(|voxel| *voxel.borrow()).collect());
    }

    /// The same of a set of voxels.
    pub fn follow(&mut self, grid: &OccupancyGrid, changed: &VoxelSet) {
        // Each voxel is looked at once, however many of its neighbours changed.
        let mut touched = VoxelSet::new();
        for (brick, cells) in changed.bricks() {
            touched.unite(brick, &mask::or(cells, &mask::dilated(cells)));
            let beyond = FACES.iter().enumerate().map(|(n, face)| (brick + *face, mask::beyond(cells, n)));
            beyond.filter(|(_, cells)| *cells != mask::NONE).for_each(|(brick, cells)| touched.unite(brick, &cells));
        }
        touched.bricks().for_each(|(brick, cells)| self.revise(grid, brick, cells));
    }

    /// Looks at these cells of a brick again.
    fn revise(&mut self, grid: &OccupancyGrid, brick: Voxel, cells: &Mask) {
        let (free, beside) = (mask::and(&grid.free_cells(brick), cells), known_beside(grid, brick));
        let all_known = beside.iter().fold(mask::ALL, |all, known| mask::and(&all, known));
        let before = self.bricks.remove(&brick).unwrap_or_default();
        let mut now = (mask::without(&before.0, cells), Vec::new());
        let open = mask::without(&free, &all_known);
        for cell in mask::cells(&mask::or(&now.0, &open)) {
            let faces = match mask::has(cells, cell) {
                true => self.unknown(grid, voxel_at(brick, cell), |n| !mask::has(&beside[n], cell)),
                false => faces_at(&before, cell),
            };
            if !faces.is_empty() {
                mask::set(&mut now.0, cell);
                now.1.push(faces);
            }
        }
        self.len = self.len + now.1.len() - before.1.len();
        if !now.1.is_empty() {
            self.bricks.insert(brick, (now.0, now.1.into()));
        }
    }

    /// What makes a free voxel frontier, of its face neighbours that are unknown.
    fn unknown(&self, grid: &OccupancyGrid, voxel: Voxel, is_unknown: impl Fn(usize) -> bool) -> Faces {
        let inside = |v: Voxel| counts(v, self.bounds, grid.resolution());
        let knowable = |v: Voxel| !self.full || grid.bricks().brick(brick_of(v)).is_some();
        match inside(voxel) {
            true => Faces::of(voxel, |n, v| is_unknown(n) && inside(v) && knowable(v)),
            false => Faces::default(),
        }
    }

    /// What makes `voxel` frontier: its face neighbours that are unknown, in the volume to explore, and that the map can come
    /// to know; none if it is no frontier voxel.
    pub fn unknown_beside(&self, voxel: Voxel) -> Faces {
        self.bricks.get(&brick_of(voxel)).map_or(Faces::default(), |own| faces_at(own, cell_of(voxel)))
    }

    /// Whether `voxel` is a frontier voxel.
    pub fn contains(&self, voxel: Voxel) -> bool {
        mask::has(self.brick(brick_of(voxel)), cell_of(voxel))
    }

    /// The frontier voxels of a brick (in bricks).
    pub fn brick(&self, brick: Voxel) -> &Mask {
        self.bricks.get(&brick).map_or(&mask::NONE, |(cells, _)| cells)
    }

    /// The bricks that have frontier voxels, in lexicographic order, each with them.
    pub fn bricks(&self) -> BTreeMap<Voxel, Mask> {
        self.bricks.iter().map(|(brick, (cells, _))| (*brick, *cells)).collect()
    }

    /// The frontier voxels in the box between two corners, both in it, by brick.
    pub fn within(&self, min: Voxel, max: Voxel) -> impl Iterator<Item = Voxel> + '_ {
        let (low, high) = (brick_of(min), brick_of(max));
        let rows = (low.z..=high.z).flat_map(move |z| (low.y..=high.y).map(move |y| (y, z)));
        let bricks = rows.flat_map(move |(y, z)| (low.x..=high.x).map(move |x| Voxel::new(x, y, z)));
        let voxels = bricks.flat_map(|brick| mask::cells(self.brick(brick)).map(move |cell| voxel_at(brick, cell)));
        voxels.filter(move |voxel| *voxel == voxel.sup(min).inf(max))
    }

    /// The frontier voxels in lexicographic order.
    pub fn iter(&self) -> impl Iterator<Item = Voxel> {
        let all = self.bricks.iter();
        let voxels = all.flat_map(|(brick, (cells, _))| mask::cells(cells).map(|cell| voxel_at(*brick, cell)));
        let mut voxels: Vec<Voxel> = voxels.collect();
        voxels.sort_unstable();
        voxels.into_iter()
    }

    /// Number of frontier voxels.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether no frontier is left.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The volume that counts.
    pub fn bounds(&self) -> Option<Bounds> {
        self.bounds
    }
}

/// The faces of a cell among those of its brick.
fn faces_at((cells, faces): &(Mask, Box<[Faces]>), cell: usize) -> Faces {
    if !mask::has(cells, cell) {
        return Faces::default();
    }
    let before = cells[..cell >> 6].iter().map(|layer| layer.count_ones()).sum::<u32>();
    let row = cells[cell >> 6] & ((1 << (cell & 63)) - 1);
    faces[(before + row.count_ones()) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel::INDEX_RANGE;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        /// Kept up to date change by change, the set is what a look at every voxel would find.
        #[test]
        fn incremental_equals_exhaustive(changes in prop::collection::vec(((5..11i32, 0..6i32, 0..6i32), 0..3u8), 1..150)) {
            let mut grid = OccupancyGrid::new(0.1);
            let mut set = FrontierSet::new(None);
            for ((x, y, z), s) in changes {
                let state = [State::Unknown, State::Free, State::Occupied][s as usize];
                let voxel = Voxel::new(x, y, z);
                if grid.set(voxel, state) {
                    set.update(&grid, [voxel]);
                }
            }
            let all: BTreeSet<Voxel> = grid.bricks().voxels().map(|(v, _)| v).filter(|v| is_frontier(&grid, *v)).collect();
            prop_assert_eq!(set.iter().collect::<BTreeSet<_>>(), all.clone());
            let (min, max) = (Voxel::new(6, 1, 2), Voxel::new(9, 4, 9));
            let inside = all.iter().copied().filter(|v| v.x >= 6 && v.x <= 9 && v.y >= 1 && v.y <= 4 && v.z >= 2);
            prop_assert_eq!(set.within(min, max).collect::<BTreeSet<_>>(), inside.collect());
            prop_assert!(all.iter().all(|v| set.unknown_beside(*v).beside(*v).eq(unknown_neighbours(&grid, *v))));
            set.set_full(true, &grid);
            let has_brick = |v: Voxel| grid.bricks().brick(brick_of(v)).is_some();
            let in_its_bricks = |v: &Voxel| unknown_neighbours(&grid, *v).any(has_brick);
            prop_assert_eq!(set.iter().collect::<BTreeSet<_>>(), all.iter().copied().filter(in_its_bricks).collect());
            set.set_full(false, &grid);
            prop_assert_eq!(set.iter().collect::<BTreeSet<_>>(), all);
        }
    }

    #[test]
    fn outside_the_bounds_nothing_counts() {
        let mut grid = OccupancyGrid::new(1.0);
        let bounds = Bounds { min: [0.0; 3].into(), max: [2.0; 3].into() };
        let mut set = FrontierSet::new(Some(bounds));
        let inside = Voxel::new(1, 1, 1);
        grid.set(inside, State::Free);
        set.update(&grid, [inside]);
        assert!(set.contains(inside), "its neighbour (0, 1, 1) is unknown and inside");
        for n in [Voxel::new(0, 1, 1), Voxel::new(1, 0, 1), Voxel::new(1, 1, 0)] {
            grid.set(n, State::Occupied);
            set.update(&grid, [n]);
        }
        assert!(set.is_empty(), "what is left unknown lies outside");
    }

    /// Regression: what is beyond the map stays unknown, and was looked at for ever.
    #[test]
    fn where_the_map_or_the_volume_ends_is_no_frontier_but_an_edge() {
        let mut grid = OccupancyGrid::new(1.0);
        let last = Voxel::new(*INDEX_RANGE.end(), 0, 0);
        let all: Vec<Voxel> = std::iter::once(last).chain(last.face_neighbours()).collect();
        grid.set(last, State::Free);
        let mut set = FrontierSet::new(None);
        set.update(&grid, [last]);
        assert!(set.contains(last) && Edges::of(&grid, &set) == Edges::default());
        for voxel in all.iter().filter(|voxel| voxel.is_mappable() && **voxel != last) {
            grid.set(*voxel, State::Occupied);
            set.update(&grid, [voxel]);
        }
        assert!(set.is_empty());
        assert_eq!(Edges::of(&grid, &set), Edges { map: 1, ..Edges::default() });
        grid.set(last, State::Occupied);
        assert_eq!(Edges::of(&grid, &set), Edges::default(), "a wall there is where the world ends");

        let origin = Voxel::new(0, 0, 0);
        let mut bounded = FrontierSet::new(Some(Bounds { min: [0.0; 3].into(), max: [1.0; 3].into() }));
        grid.set(origin, State::Free);
        bounded.update(&grid, [origin]);
        assert_eq!(Edges::of(&grid, &bounded), Edges { volume: 1, ..Edges::default() });
        set.update(&grid, [origin]);
        assert!(set.contains(origin), "without a volume it is a frontier voxel");
        assert_eq!(Edges::of(&grid, &set), Edges::default());
    }

    /// Regression: what a full map has no room for was looked at for thousands of scans.
    #[test]
    fn what_a_full_map_has_no_brick_for_is_no_frontier() {
        let mut grid = OccupancyGrid::new(1.0);
        let all: Vec<Voxel> =
            (0..8).flat_map(|x| (0..8).flat_map(move |y| (0..8).map(move |z| Voxel::new(x, y, z)))).collect();
        all.iter().for_each(|voxel| assert!(grid.set(*voxel, State::Free)));
        let mut set = FrontierSet::new(None);
        set.update(&grid, &all);
        let surface = set.len();
        set.set_full(true, &grid);
        assert!(set.is_empty());
        assert_eq!(Edges::of(&grid, &set), Edges { no_room: surface as u64, ..Edges::default() });
        grid.set(all[0], State::Unknown);
        set.update(&grid, [all[0]]);
        assert_eq!(set.len(), 3, "in its own bricks it can come to know everything");
        assert!(
            set.unknown_beside(all[1]).beside(all[1]).eq([all[0]]),
            "and what is beyond is not to be resolved there, either"
        );
        set.set_full(false, &grid);
        assert_eq!(set.len(), surface - 1);
        assert!(set.unknown_beside(all[1]).beside(all[1]).count() == 3);
    }
}
