//! Shortest ways over voxels: A* to one voxel, Dijkstra to the closest of many.
//!
//! The 26 neighbours, no corner cut. Ties go to the first in raster order, so that equal maps give equal ways. A search costs by
//! what it gets to, however large the map is.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashMap};
use std::f64::consts::SQRT_2;
use std::hash::BuildHasherDefault;

use crate::bricks::{BRICK, BRICK_CELLS, BrickHasher, brick_of, cell_of, voxel_at};
use crate::mask::{self, Mask};
use crate::set::VoxelSet;
use crate::voxel::Voxel;

/// The shortest way from `from` to `to` over voxels of `passable`, both ends included.
pub fn shortest(passable: &VoxelSet, from: Voxel, to: Voxel) -> Option<Vec<Voxel>> {
    toward(passable, from, to).way_to(to)
}

/// What a search for the shortest way from `from` to `to` gets to: the length of that way is known, and the way.
pub fn toward(passable: &VoxelSet, from: Voxel, to: Voxel) -> Reached {
    search(passable, from, |voxel| voxel == to, &Bound { boxes: vec![[to; 2]] }, usize::MAX).0
}

/// No way between two voxels is shorter than this (in voxels), whatever is passable.
pub fn at_least(from: Voxel, to: Voxel) -> f64 {
    (octile(aside([from; 2], [to; 2])) - ROUNDING).max(0.0)
}

/// The shortest way from `from` to the closest voxel that is a goal; of equals the first in raster order, and to it the way on
/// which each voxel is come to from the one that is nearer to `from`, of equals the first in raster order.
pub fn closest(passable: &VoxelSet, from: Voxel, is_goal: impl Fn(Voxel) -> bool) -> Option<Vec<Voxel>> {
    let (reached, end) = search(passable, from, is_goal, &Bound::default(), usize::MAX);
    reached.way_to(end??)
}

/// The same way, found sooner by who can say in which boxes all goals are: corners, both in it, of one a brick at best. That is
/// asked only if none is near.
pub fn closest_of<I: IntoIterator<Item = [Voxel; 2]>>(
    passable: &VoxelSet,
    from: Voxel,
    is_goal: impl Fn(Voxel) -> bool,
    goals: impl FnOnce() -> I,
) -> Option<Vec<Voxel>> {
    let (mut reached, mut end) = search(passable, from, &is_goal, &Bound::default(), NEAR);
    if end.is_none() {
        (reached, end) = search(passable, from, is_goal, &Bound::to(goals(), from, BOXES), usize::MAX);
    }
    reached.way_to(end??)
}

/// A search over no more bricks than this stays near.
const NEAR: usize = 32;

/// The shortest ways from `from` to all voxels that can be got to.
pub fn all(passable: &VoxelSet, from: Voxel) -> Reached {
    search(passable, from, |_| false, &Bound::default(), usize::MAX).0
}

/// What a search has got to: shortest ways from one voxel to others.
#[derive(Debug, Clone)]
pub struct Reached {
    from: Voxel,
    index: HashMap<Voxel, u32, BuildHasherDefault<BrickHasher>>,
    pages: Vec<Box<Page>>,
}

/// What a search knows of a brick.
#[derive(Debug, Clone)]
struct Page {
    /// Lengths of ways, in voxels; infinite where the search has not got to.
    cost: [f64; BRICK_CELLS],
    /// From where the search has gone on, with that length of way.
    gone_on: Mask,
    /// Of what is left of the way.
    bound: Bound,
    /// What is passable in it and around it, as rows by z and y from one before the brick's own, a bit a voxel along x.
    rows: [[u16; EDGE]; EDGE],
    /// One more than the places of the pages of the bricks around it, by move; 0 where that was not looked up yet.
    beside: [u32; MOVES],
}

/// Edge of a brick with one voxel around it.
const EDGE: usize = BRICK as usize + 2;
/// Number of moves; the one in their middle is none.
const MOVES: usize = 27;
/// The move that stays where it is.
const STAY: usize = MOVES / 2;

/// The offset of a move: x fastest.
const fn offset(by: usize) -> Voxel {
    Voxel::new(by as i32 % 3 - 1, by as i32 / 3 % 3 - 1, by as i32 / 9 - 1)
}

impl Page {
    fn of(passable: &VoxelSet, bound: Bound, brick: Voxel) -> Box<Self> {
        let mut page = Box::new(Self {
            cost: [f64::INFINITY; BRICK_CELLS],
            gone_on: mask::NONE,
            bound,
            rows: [[0; EDGE]; EDGE],
            beside: [0; MOVES],
        });
        for d in (0..MOVES).map(offset) {
            let cells = passable.brick(brick + d);
            let range = |c: i32| match c {
                -1 => 7..8,
                0 => 0..8,
                _ => 0..1,
            };
            for (z, y) in range(d.z).flat_map(|z| range(d.y).map(move |y| (z, y))) {
                let bits = (cells[z] >> (8 * y) & 0xff) as u16;
                let place = |c: usize, d: i32| (c as i32 + 1 + BRICK * d) as usize;
                let row = &mut page.rows[place(z, d.z)][place(y, d.y)];
                *row |= match d.x {
                    -1 => bits >> 7,
                    0 => bits << 1,
                    _ => (bits & 1) << 9,
                };
            }
        }
        page
    }

    /// What is passable of a cell and the voxels around it, by move.
    #[inline]
    fn near(&self, cell: usize) -> u32 {
        let (x, y, z) = (cell & 7, cell >> 3 & 7, cell >> 6);
        let mut near = 0;
        for k in 0..9 {
            near |= u32::from(self.rows[z + k / 3][y + k % 3] >> x & 7) << (3 * k);
        }
        near
    }
}

impl Reached {
    fn begin(passable: &VoxelSet, bound: &Bound, from: Voxel) -> Self {
        let mut reached = Self { from, index: HashMap::default(), pages: Vec::new() };
        let page = reached.page((passable, bound), brick_of(from));
        reached.pages[page].cost[cell_of(from)] = 0.0;
        reached
    }

    #[inline]
    fn page(&mut self, (passable, bound): (&VoxelSet, &Bound), brick: Voxel) -> usize {
        let next = self.pages.len() as u32;
        let page = *self.index.entry(brick).or_insert(next);
        if page == next {
            self.pages.push(Page::of(passable, bound.near(brick), brick));
        }
        page as usize
    }

    /// The page of a brick beside that of page `own`, which is at `brick`.
    #[inline]
    fn page_beside(&mut self, within: (&VoxelSet, &Bound), (own, brick): (usize, Voxel), beside: Voxel) -> usize {
        let d = beside - brick;
        let by = ((d.z + 1) * 9 + (d.y + 1) * 3 + d.x + 1) as usize;
        if self.pages[own].beside[by] == 0 {
            self.pages[own].beside[by] = self.page(within, beside) as u32 + 1;
        }
        self.pages[own].beside[by] as usize - 1
    }

    fn at(&self, voxel: Voxel) -> Option<(&Page, usize)> {
        Some((&self.pages[*self.index.get(&brick_of(voxel))? as usize], cell_of(voxel)))
    }

    /// Length of the shortest way to a voxel (in voxels), from centre to centre; `None`: there is none.
    pub fn cost(&self, to: Voxel) -> Option<f64> {
        self.at(to).map(|(page, cell)| page.cost[cell]).filter(|cost| cost.is_finite())
    }

    /// The shortest way to a voxel, both ends included; `None`: there is none.
    pub fn way_to(&self, to: Voxel) -> Option<Vec<Voxel>> {
        self.cost(to)?;
        let moves = moves();
        let mut way = vec![to];
        let mut at = to;
        while at != self.from {
            at = self.before(at, &moves)?;
            way.push(at);
        }
        way.reverse();
        Some(way)
    }

    /// From where the shortest way comes to a voxel: of several the nearest, of equals the first in raster order.
    fn before(&self, voxel: Voxel, moves: &[Move]) -> Option<Voxel> {
        let (page, cell) = self.at(voxel)?;
        let near = page.near(cell);
        let comes_from = |back: &Move| {
            let from = voxel + back.offset;
            // Where it begins need not be passable.
            let passes = back.needs & !(1 << back.by);
            let cost =
                self.cost(from).filter(|cost| near & passes == passes && cost + back.length == page.cost[cell])?;
            Some((cost.to_bits(), packed(from), from))
        };
        moves.iter().filter_map(comes_from).min().map(|(_, _, from)| from)
    }
}

/// How long the way to the closest of several goals is at least (Hart, Nilsson and Raphael, *A Formal Basis for the Heuristic
/// Determination of Minimum Cost Paths*, 1968).
#[derive(Debug, Clone, Default)]
struct Bound {
    /// Corners of a few boxes, both in it, that all goals lie in; none: nobody knows where they are.
    boxes: Vec<[Voxel; 2]>,
}

/// Boxes by the cube of some edge that they began in.
type Cubes = BTreeMap<Voxel, [Voxel; 2]>;

/// Adds a box to what is in a cube.
fn put(cubes: &mut Cubes, cube: Voxel, corners: [Voxel; 2]) {
    let all = cubes.entry(cube).or_insert(corners);
    *all = around(*all, corners);
}

/// What is in cubes put together to larger ones, as long as these are no nearer to `from` than so many of their edges.
fn merged(by_brick: &Cubes, from: Voxel, edges: i32) -> Vec<[Voxel; 2]> {
    let (mut near, mut cubes) = (Vec::new(), by_brick.clone());
    // In the end they are as large as a map's indices reach either way.
    for edge in (4..16).map(|power| 1 << power) {
        let mut larger = Cubes::new();
        for (cube, corners) in cubes {
            let parent = Voxel::from(cube.to_array().map(|c| c >> 1));
            let low = Voxel::from(parent.to_array().map(|c| c * edge));
            let away = aside([from; 2], [low, low + Voxel::new(edge - 1, edge - 1, edge - 1)]);
            match away.into_iter().max() < Some(edges * edge) {
                true => near.push(corners),
                false => put(&mut larger, parent, corners),
            }
        }
        cubes = larger;
    }
    near.extend(cubes.into_values());
    near
}

/// So many edges away cubes may be put together, tried in turn.
const NEAR_EDGES: [i32; 4] = [8, 4, 2, 0];

/// √3.
const SQRT_3: f64 = 1.732_050_807_568_877_2;
/// The most boxes: each is asked for of each brick that a search comes to.
const BOXES: usize = 256;

impl Bound {
    /// That of goals in these boxes, by at most about so many boxes: what is far from `from` is put together to larger ones first.
    fn to(goals: impl IntoIterator<Item = [Voxel; 2]>, from: Voxel, most: usize) -> Self {
        let mut by_brick = Cubes::new();
        goals.into_iter().for_each(|corners| put(&mut by_brick, brick_of(corners[0]), corners));
        let mut boxes = Vec::new();
        for edges in NEAR_EDGES {
            boxes = merged(&by_brick, from, edges);
            if boxes.len() <= most {
                break;
            }
        }
        Self { boxes }
    }

    /// The same for voxels of a brick: of boxes that none of them is nearest to nothing is asked.
    fn near(&self, brick: Voxel) -> Self {
        let (low, high) = (voxel_at(brick, 0), voxel_at(brick, BRICK_CELLS - 1));
        let least = |corners: &[Voxel; 2]| octile(aside([low, high], *corners));
        let most = |corners: &[Voxel; 2]| {
            let [a, b] = [low, high].map(|voxel| aside([voxel; 2], *corners));
            octile(std::array::from_fn(|axis| a[axis].max(b[axis])))
        };
        let nearest = self.boxes.iter().map(most).reduce(f64::min).unwrap_or(0.0);
        Self { boxes: self.boxes.iter().filter(|corners| least(corners) <= nearest).copied().collect() }
    }

    /// What it is from a voxel, if nothing is in the way (in voxels). From a voxel to its neighbour it falls by no more than the
    /// way between them.
    #[inline]
    fn of(&self, voxel: Voxel) -> f64 {
        let ways = self.boxes.iter().map(|corners| octile(aside([voxel; 2], *corners)));
        ways.reduce(f64::min).unwrap_or(0.0)
    }
}

/// How far apart two boxes are along each axis (voxels).
#[inline]
fn aside([low, high]: [Voxel; 2], [min, max]: [Voxel; 2]) -> [i32; 3] {
    let along = |low: i32, high: i32, min: i32, max: i32| (min - high).max(low - max).max(0);
    [along(low.x, high.x, min.x, max.x), along(low.y, high.y, min.y, max.y), along(low.z, high.z, min.z, max.z)]
}

/// The shortest way to a voxel so far away along each axis (in voxels): over corners, then over edges, then over faces.
#[inline]
fn octile([x, y, z]: [i32; 3]) -> f64 {
    let (least, most) = (x.min(y).min(z), x.max(y).max(z));
    let middle = x + y + z - least - most;
    SQRT_3 * f64::from(least) + SQRT_2 * f64::from(middle - least) + f64::from(most - middle)
}

/// Corners of the box around two.
fn around([a, b]: [Voxel; 2], [c, d]: [Voxel; 2]) -> [Voxel; 2] {
    [a.inf(c), b.sup(d)]
}

/// So much longer (in voxels) a way may be by rounding alone.
const ROUNDING: f64 = 1e-6;

/// Searches until no goal can be closer than one that was got to, and answers which that is, of equals the first in raster order:
/// `Some(None)` if there is a way to none, and `None` if it came to more bricks than `most`, and to no goal.
fn search(
    passable: &VoxelSet,
    from: Voxel,
    is_goal: impl Fn(Voxel) -> bool,
    bound: &Bound,
    most: usize,
) -> (Reached, Option<Option<Voxel>>) {
    let moves = moves();
    let mut reached = Reached::begin(passable, bound, from);
    let mut open = Open::new(bound.of(from), from);
    let mut end: Option<(f64, Voxel)> = None;
    while let Some((estimate, voxel)) = open.pop() {
        if end.is_some_and(|(cost, _)| estimate > cost + ROUNDING) {
            break;
        }
        if end.is_none() && reached.pages.len() > most {
            return (reached, None);
        }
        let (brick, cell) = (brick_of(voxel), cell_of(voxel));
        let own = reached.page((passable, bound), brick);
        let page = &mut reached.pages[own];
        if mask::has(&page.gone_on, cell) {
            continue;
        }
        mask::set(&mut page.gone_on, cell);
        let (cost, near, place) = (page.cost[cell], page.near(cell), Place::of(cell));
        if is_goal(voxel) {
            let is_closer = |(least, other): &(f64, Voxel)| (cost, voxel.raster()) < (*least, other.raster());
            end = end.filter(|other| !is_closer(other)).or(Some((cost, voxel)));
            continue;
        }
        for Move { offset, step, length, .. } in moves.iter().filter(|one| near & one.needs == one.needs) {
            let n = voxel + *offset;
            let (page, cell) = match place.after(*step) {
                Some(cell) => (own, cell),
                None => (reached.page_beside((passable, bound), (own, brick), brick_of(n)), cell_of(n)),
            };
            let page = &mut reached.pages[page];
            if cost + length < page.cost[cell] {
                page.cost[cell] = cost + length;
                mask::clear(&mut page.gone_on, cell);
                open.push(cost + length + page.bound.of(n), n);
            }
        }
    }
    (reached, Some(end.map(|(_, voxel)| voxel)))
}

/// A step from a voxel to one of the 26 around it.
struct Move {
    by: usize,
    offset: Voxel,
    /// The same of a place in a brick.
    step: Place,
    /// Distance between the centres, in voxels: 1, √2 or √3.
    length: f64,
    /// What has to be passable, by move: where it leads, and what it passes between (no corner is cut).
    needs: u32,
}

fn moves() -> Vec<Move> {
    let zero = Voxel::new(0, 0, 0);
    let passes = |way: Voxel, d: Voxel| {
        let parts = way.to_array().into_iter().zip(d.to_array());
        d != zero && parts.into_iter().all(|(along, part)| part == 0 || part == along)
    };
    let needs = |way| (0..MOVES).filter(|by| passes(way, offset(*by))).map(|by| 1 << by).sum();
    let all = (0..MOVES).filter(|by| *by != STAY);
    let to = |by| Move {
        by,
        offset: offset(by),
        step: Place::by(offset(by)),
        length: offset(by).distance(zero),
        needs: needs(offset(by)),
    };
    all.map(to).collect()
}

/// Where a cell is in its brick: 8 more than its place along x, y and z, in a byte each, so that a sum says what has left the
/// brick.
#[derive(Clone, Copy)]
struct Place(u32);

impl Place {
    fn of(cell: usize) -> Self {
        let cell = cell as u32;
        Self(0x08_08_08 + (cell & 7 | (cell >> 3 & 7) << 8 | cell >> 6 << 16))
    }

    /// The step of a move.
    fn by(offset: Voxel) -> Self {
        Self(offset.x.wrapping_add(offset.y << 8).wrapping_add(offset.z << 16) as u32)
    }

    /// The cell that a step leads to; `None`: it is in another brick.
    #[inline]
    fn after(self, step: Self) -> Option<usize> {
        let there = self.0.wrapping_add(step.0);
        let cell = there & 7 | (there >> 8 & 7) << 3 | (there >> 16 & 7) << 6;
        (there & 0x18_18_18 == 0x08_08_08).then_some(cell as usize)
    }
}

/// Voxels to go on from, those with the smallest estimate first, of equals the first in raster order.
///
/// No estimate grows by more than two longest moves from one voxel to the next, so what is open fits into a ring of buckets
/// (Dial, *Algorithm 360*, 1969), and only the lowest bucket has to be in order.
struct Open {
    /// The lowest bucket. Estimates are not negative, so their bits sort as they do.
    now: BinaryHeap<Reverse<Entry>>,
    /// Its number.
    bucket: u64,
    later: [Vec<Reverse<Entry>>; RING],
}

/// An estimate, as bits, and a voxel, so that the first in raster order is the smallest.
type Entry = (u64, u64);

/// An index as a number that is not negative, and its bits: more than a map has.
const SHIFT: i32 = 1 << 20;
const BITS: u32 = 21;

#[inline]
fn packed(voxel: Voxel) -> u64 {
    let bits = |c: i32| u64::from((c + SHIFT) as u32 & (2 * SHIFT - 1) as u32);
    let [a, b, c] = voxel.raster().map(bits);
    (a << BITS | b) << BITS | c
}

#[inline]
fn unpacked(packed: u64) -> Voxel {
    let index = |place: u32| (packed >> (place * BITS)) as i32 & (2 * SHIFT - 1);
    Voxel::new(index(0) - SHIFT, index(1) - SHIFT, index(2) - SHIFT)
}

/// Buckets of the ring: four voxels, more than twice √3.
const RING: usize = 64;
/// Buckets of a voxel.
const BUCKETS: f64 = 16.0;

impl Open {
    fn new(estimate: f64, voxel: Voxel) -> Self {
        let now = BinaryHeap::from([Reverse((estimate.to_bits(), packed(voxel)))]);
        Self { now, bucket: (estimate * BUCKETS) as u64, later: std::array::from_fn(|_| Vec::new()) }
    }

    #[inline]
    fn push(&mut self, estimate: f64, voxel: Voxel) {
        let (bucket, entry) = ((estimate * BUCKETS) as u64, Reverse((estimate.to_bits(), packed(voxel))));
        match bucket <= self.bucket {
            true => self.now.push(entry),
            false => self.later[bucket as usize % RING].push(entry),
        }
    }

    #[inline]
    fn pop(&mut self) -> Option<(f64, Voxel)> {
        if self.now.is_empty() {
            let next = (1..RING as u64).find(|k| !self.later[(self.bucket + k) as usize % RING].is_empty())?;
            self.bucket += next;
            self.now = std::mem::take(&mut self.later[self.bucket as usize % RING]).into();
        }
        self.now.pop().map(|Reverse((estimate, voxel))| (f64::from_bits(estimate), unpacked(voxel)))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    /// Two rooms side by side behind a wall of one voxel at x = 6 with a door at y = 0.
    fn rooms() -> VoxelSet {
        let all = (0..13).flat_map(|x| (0..8).flat_map(move |y| (0..3).map(move |z| Voxel::new(x, y, z))));
        all.filter(|v| v.x != 6 || v.y == 0).collect()
    }

    fn length(way: &[Voxel]) -> f64 {
        way.windows(2).map(|w| w[0].distance(w[1])).sum()
    }

    #[test]
    fn the_way_leads_through_the_door_and_cuts_no_corner() {
        let passable = rooms();
        let at = |x, y| Voxel::new(x, y, 1);
        let way = shortest(&passable, at(3, 4), at(9, 4)).unwrap();
        // Five diagonals would cut the door posts: two straight steps through, the rest diagonal.
        let expected = 2.0 + 2.0 * (2.0 * 2f64.sqrt() + 2.0);
        assert!((length(&way) - expected).abs() < 1e-9);
        assert!(way.contains(&at(6, 0)));
        let flood = closest(&passable, at(3, 4), |voxel| voxel == at(9, 4)).unwrap();
        assert!((length(&flood) - expected).abs() < 1e-9);
        let reached = all(&passable, at(3, 4));
        assert!((reached.cost(at(9, 4)).unwrap() - expected).abs() < 1e-9);
        assert_eq!(reached.way_to(at(9, 4)).unwrap(), flood);
    }

    #[test]
    fn packed_voxels_are_in_raster_order() {
        let all = [[-40_000, 3, -1], [40_000, -3, -1], [0, 0, 0], [-1, 1, 0], [5, 0, 7]].map(Voxel::from);
        assert!(all.iter().all(|voxel| unpacked(packed(*voxel)) == *voxel));
        let is_less = |pair: &[Voxel]| packed(pair[0]) < packed(pair[1]);
        assert!(all.windows(2).all(|pair| is_less(pair) == (pair[0].raster() < pair[1].raster())));
    }

    /// The same by nothing but the definition of what is first, from an order of all ways by their lengths.
    fn first_of_all(passable: &VoxelSet, from: Voxel, goals: &[Voxel]) -> Option<Vec<Voxel>> {
        let mut cost = BTreeMap::from([(from, (0.0f64, from))]);
        let mut open = BTreeSet::from([(0.0f64.to_bits(), from.raster(), from)]);
        let end = loop {
            let (_, _, voxel) = open.pop_first()?;
            if goals.contains(&voxel) {
                break voxel;
            }
            let far = cost[&voxel].0;
            let free =
                |one: &Move| (0..MOVES).all(|by| one.needs >> by & 1 == 0 || passable.contains(voxel + offset(by)));
            for one in moves().iter().filter(|one| free(one)) {
                let (n, way) = (voxel + one.offset, far + one.length);
                if cost.get(&n).is_none_or(|(before, _)| way < *before) {
                    cost.insert(n, (way, voxel));
                    open.retain(|(_, _, other)| *other != n);
                    open.insert((way.to_bits(), n.raster(), n));
                }
            }
        };
        let mut way = vec![end];
        while way[way.len() - 1] != from {
            way.push(cost[&way[way.len() - 1]].1);
        }
        way.reverse();
        Some(way)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]
        /// However the goals are spread, and whatever is in between, it is the way that Dijkstra's search finds first.
        #[test]
        fn bounds_change_no_way(
            density in 0.5..1.0f64,
            scattered in prop::collection::vec(0.0..1.0f64, 24 * 12 * 6),
            from in voxel(),
            goals in prop::collection::vec(voxel(), 0..30),
        ) {
            let voxels = (0..24 * 12 * 6).map(|i| Voxel::new(i % 24 - 5, i / 24 % 12, i / 288));
            let passable: VoxelSet = voxels.zip(scattered).filter(|(_, share)| *share < density).map(|(v, _)| v).collect();
            let is_goal = |voxel| goals.contains(&voxel);
            let boxes = || goals.iter().map(|goal| [*goal; 2]);
            let way = closest_of(&passable, from, is_goal, boxes);
            prop_assert_eq!(&way, &first_of_all(&passable, from, &goals));
            prop_assert_eq!(&way, &closest(&passable, from, is_goal));
            for most in [BOXES, 4, 0] {
                let bound = Bound::to(boxes(), from, most);
                prop_assert!(bound.boxes.len() <= most.max(8));
                let (bounded, end) = search(&passable, from, is_goal, &bound, usize::MAX);
                prop_assert_eq!(&way, &end.flatten().and_then(|end| bounded.way_to(end)));
            }
            if let Some(way) = way {
                let (to, all) = (way[way.len() - 1], all(&passable, from));
                let single = toward(&passable, from, to);
                prop_assert_eq!(single.cost(to), all.cost(to));
                prop_assert!(at_least(from, to) <= all.cost(to).unwrap());
                prop_assert_eq!(all.way_to(to), Some(way.clone()));
                prop_assert_eq!(single.way_to(to), Some(way));
            }
        }
    }

    fn voxel() -> impl Strategy<Value = Voxel> {
        (-5..19i32, 0..12i32, 0..6i32).prop_map(|(x, y, z)| Voxel::new(x, y, z))
    }

    #[test]
    fn no_way_is_none() {
        let mut passable = rooms();
        (0..3).for_each(|z| assert!(passable.remove(Voxel::new(6, 0, z))));
        let at = |x| Voxel::new(x, 4, 1);
        assert_eq!(shortest(&passable, at(3), at(9)), None);
        assert_eq!(closest(&passable, at(3), |_| false), None);
        assert_eq!(all(&passable, at(3)).cost(at(9)), None);
    }
}
