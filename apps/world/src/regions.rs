//! What hangs together in a world, cell by cell: what is free where surfaces do not say it.
//!
//! In many a model of a room its walls are single faces side by side, floors are planes, and chairs have no undersides. Of such
//! surfaces none encloses anything by itself, and what a ray to infinity crosses depends on its direction. What they enclose
//! together does not depend on how they are turned: the cells that no surface passes through, and that cannot be come to from
//! outside. The largest such room is the world's free space; others, closed off from it, are rooms or the insides of things.

use std::collections::VecDeque;

use elk_geometry::Bounds;
use nalgebra::{Point3, Vector3};

use crate::bvh::Bvh;
use crate::ray::Ray;
use crate::triangle::Triangle;

/// Cells along the longest side of a world. A world with gaps, as between the slats of a blind, is closed for coarser ones.
const CELLS: [f64; 3] = [256.0, 128.0, 64.0];
/// The largest room has to come to this share of the world along each axis: else what is outside has come in by a gap.
const SPANNED: f64 = 0.5;
/// A room smaller than this share of the largest is the inside of something.
const LEAST_ROOM: f64 = 0.02;
/// Places of a room that are asked whether it is one.
const PLACES: usize = 32;
/// Cells, in all, that surfaces' boxes may reach into: a million of triangles across a whole world would take hours to draw.
const MOST_DRAWN: i64 = 1 << 27;
/// Whoever is not farther from a surface (m) is on it, and nowhere free.
const ON_IT_M: f64 = 1e-9;
/// How far cells with a surface in them look for one without (cells).
const NEAR: i32 = 3;

/// What a cell belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cell {
    /// A surface passes through it.
    Surface,
    Outside,
    Free,
    /// The inside of something.
    Solid,
    /// Nobody has come to it yet.
    New,
}

/// The cells of a world that is closed as far as they tell.
#[derive(Debug, Clone)]
pub(crate) struct Regions {
    /// The lowest corner (m, world).
    origin: Point3<f64>,
    /// Edge of a cell (m).
    edge: f64,
    /// How many there are along each axis, with one more on each side than the world has.
    counts: [i32; 3],
    /// x fastest.
    cells: Vec<Cell>,
    /// Offsets of the cells near one, nearest first.
    near: Vec<[i32; 3]>,
}

impl Regions {
    /// Those of a world with these surfaces, in the finest cells for which it is closed; `is_room` is asked of places in what is
    /// closed off from the largest room whether they are free. `None`: the world is open, or cannot be drawn in reasonable time.
    pub fn of(surfaces: &Bvh, extents: &Bounds, is_room: impl Fn(Point3<f64>) -> bool) -> Option<Self> {
        let longest = extents.dim().max();
        let edges = CELLS.iter().map(|cells| longest / cells).filter(|edge| *edge > 0.0);
        edges.into_iter().find_map(|edge| Self::in_cells(edge, surfaces, extents, &is_room))
    }

    /// The same in cells of this edge (m).
    fn in_cells(edge: f64, surfaces: &Bvh, extents: &Bounds, is_room: &impl Fn(Point3<f64>) -> bool) -> Option<Self> {
        let dim = extents.dim();
        let counts = [0, 1, 2].map(|axis| (dim[axis] / edge).ceil().max(1.0) as i32 + 2);
        let margin = Vector3::from(counts.map(|count| f64::from(count) * edge)) - dim;
        let cells = vec![Cell::New; counts.iter().map(|count| *count as usize).product()];
        let mut regions = Self { origin: extents.min - margin / 2.0, edge, counts, cells, near: near() };
        if regions.cells_around(surfaces) > MOST_DRAWN {
            return None;
        }
        regions.draw(surfaces);
        regions.flood([0; 3], Cell::Outside);
        let mut rooms = regions.rooms();
        let largest = (0..rooms.len()).rev().max_by_key(|&room| rooms[room].len())?;
        let own = rooms.swap_remove(largest);
        if !regions.spans(&own) {
            return None;
        }
        let least = own.len() as f64 * LEAST_ROOM;
        own.iter().for_each(|&index| regions.cells[index] = Cell::Free);
        for room in rooms.into_iter().filter(|room| room.len() as f64 >= least) {
            let asked = room.iter().step_by(room.len().div_ceil(PLACES)).map(|&index| is_room(regions.center(index)));
            let (free, solid): (Vec<bool>, Vec<bool>) = asked.partition(|is_room| *is_room);
            if free.len() > solid.len() {
                room.iter().for_each(|&index| regions.cells[index] = Cell::Free);
            }
        }
        Some(regions)
    }

    /// Whether a place (m, world) is free: as its cell is, or the nearest without a surface in it that is to be seen from there.
    /// `None`: there is none near by.
    pub fn is_free(&self, surfaces: &Bvh, place: Point3<f64>) -> Option<bool> {
        let at = ((place - self.origin) / self.edge).map(|c| c.floor() as i32);
        let is_clear = |cell: Cell| cell != Cell::Surface;
        let own = self.index([at.x, at.y, at.z]).map(|index| self.cells[index]);
        let cell = own.filter(|cell| is_clear(*cell)).or_else(|| {
            if surfaces.distance(place) <= ON_IT_M {
                return Some(Cell::Surface);
            }
            let seen = |index: &usize| {
                let way = self.center(*index) - place;
                is_clear(self.cells[*index])
                    && surfaces.nearest(&Ray::new(place, way)).is_none_or(|(length, _)| length >= 1.0)
            };
            let near = self.near.iter().filter_map(|[x, y, z]| self.index([at.x + x, at.y + y, at.z + z]));
            near.into_iter().find(seen).map(|index| self.cells[index])
        });
        cell.map(|cell| cell == Cell::Free)
    }

    fn index(&self, at: [i32; 3]) -> Option<usize> {
        let [width, depth, _] = self.counts;
        let inside = at.iter().zip(self.counts).all(|(c, count)| (0..count).contains(c));
        inside.then_some(((at[2] * depth + at[1]) * width + at[0]) as usize)
    }

    fn cell(&self, index: usize) -> [i32; 3] {
        let [width, depth, _] = self.counts.map(|count| count as usize);
        [index % width, index / width % depth, index / width / depth].map(|c| c as i32)
    }

    fn center(&self, index: usize) -> Point3<f64> {
        self.origin + Vector3::from(self.cell(index).map(|c| f64::from(c) + 0.5)) * self.edge
    }

    /// The lowest and the highest cell that a triangle reaches into.
    fn cells_of(&self, triangle: &Triangle) -> [[i32; 3]; 2] {
        let around = triangle.bounds();
        let corner = |p: Point3<f64>, round: f64| {
            let at = ((p - self.origin) / self.edge).map(|c| (c + round).floor() as i32);
            [at.x, at.y, at.z]
        };
        [corner(around.min, -1e-9), corner(around.max, 1e-9)]
    }

    /// How many cells the boxes of all triangles have.
    fn cells_around(&self, surfaces: &Bvh) -> i64 {
        let cells = |triangle: &Triangle| {
            let [low, high] = self.cells_of(triangle);
            (0..3).map(|axis| i64::from(high[axis] - low[axis]) + 1).product::<i64>()
        };
        surfaces.triangles().iter().map(cells).sum()
    }

    /// Marks the cells that surfaces pass through.
    fn draw(&mut self, surfaces: &Bvh) {
        for triangle in surfaces.triangles() {
            let [low, high] = self.cells_of(triangle);
            let rows = (low[2]..=high[2]).flat_map(|z| (low[1]..=high[1]).map(move |y| (y, z)));
            for at in rows.flat_map(|(y, z)| (low[0]..=high[0]).map(move |x| [x, y, z])) {
                let Some(index) = self.index(at) else { continue };
                let cube = Bounds::from_mid_dim(self.center(index), Vector3::repeat(self.edge));
                if self.cells[index] == Cell::New && triangle.overlaps(&cube) {
                    self.cells[index] = Cell::Surface;
                }
            }
        }
    }

    /// All cells that hang together with this one, over faces, and that nobody has come to yet, become `kind`.
    fn flood(&mut self, from: [i32; 3], kind: Cell) -> Vec<usize> {
        let mut found = Vec::new();
        let mut open = VecDeque::from_iter(self.index(from));
        open.iter().for_each(|&index| self.cells[index] = kind);
        while let Some(index) = open.pop_front() {
            found.push(index);
            let at = self.cell(index);
            for side in 0..6 {
                let mut next = at;
                next[side / 2] += if side % 2 == 0 { 1 } else { -1 };
                if let Some(next) = self.index(next).filter(|&next| self.cells[next] == Cell::New) {
                    self.cells[next] = kind;
                    open.push_back(next);
                }
            }
        }
        found
    }

    /// What is left, each part by itself; all are solid at first.
    fn rooms(&mut self) -> Vec<Vec<usize>> {
        let mut rooms = Vec::new();
        for index in 0..self.cells.len() {
            if self.cells[index] == Cell::New {
                rooms.push(self.flood(self.cell(index), Cell::Solid));
            }
        }
        rooms
    }

    /// Whether a room comes to much of the world along each axis.
    fn spans(&self, room: &[usize]) -> bool {
        let cells = || room.iter().map(|&index| self.cell(index));
        (0..3).all(|axis| {
            let (low, high) = (cells().map(|at| at[axis]).min(), cells().map(|at| at[axis]).max());
            low.zip(high)
                .is_some_and(|(low, high)| f64::from(high - low + 1) >= SPANNED * f64::from(self.counts[axis] - 2))
        })
    }
}

/// The offsets of cells near one, nearest first.
fn near() -> Vec<[i32; 3]> {
    let side = || -NEAR..=NEAR;
    let mut near: Vec<[i32; 3]> = side()
        .flat_map(|z| side().flat_map(move |y| side().map(move |x| [x, y, z])))
        .filter(|at| *at != [0; 3])
        .collect();
    near.sort_by_key(|at| at.iter().map(|c| c * c).sum::<i32>());
    near
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangle::bounds_of;

    /// A face across axis `axis` at `at`, between `low` and `high` along the other two.
    fn face(axis: usize, at: f64, [low, high]: [f64; 2]) -> [Triangle; 2] {
        let corner = |u: f64, v: f64| {
            let mut corner = [at; 3];
            (corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (u, v);
            Point3::from(corner)
        };
        let [a, b, c, d] = [corner(low, low), corner(high, low), corner(high, high), corner(low, high)];
        [Triangle([a, b, c]), Triangle([a, c, d])]
    }

    /// A room of 4 m in which stands a box of 1 m, of six faces each that do not touch.
    fn room() -> Vec<Triangle> {
        let faces = |low: f64, high: f64| {
            let gap = 0.004;
            (0..3).flat_map(move |axis| {
                [low, high].into_iter().flat_map(move |at| face(axis, at, [low + gap, high - gap]))
            })
        };
        faces(0.0, 4.0).chain(faces(1.5, 2.5)).collect()
    }

    #[test]
    fn what_faces_enclose_together_is_free_and_what_is_in_things_is_not() {
        let triangles = room();
        let extents = bounds_of(triangles.iter().flat_map(|t| &t.0));
        let surfaces = Bvh::new(triangles.clone());
        let regions = Regions::of(&surfaces, &extents, |_| true).unwrap();
        let is_free = |place: [f64; 3]| regions.is_free(&surfaces, place.into());
        assert_eq!([[0.5; 3], [3.9, 0.1, 2.0], [0.005, 1.0, 1.0], [2.6, 2.0, 2.0]].map(is_free), [Some(true); 4]);
        assert_eq!(is_free([2.0; 3]), Some(false), "in the box");
        assert_eq!(is_free([1.0, 0.0, 0.8]), Some(false), "on a wall");
        let open = Bvh::new(triangles[2..].to_vec());
        assert!(Regions::of(&open, &extents, |_| true).is_none(), "a wall is missing");
    }

    #[test]
    fn a_second_room_is_free_if_it_is_one() {
        let both = room().into_iter().take(12).chain(face(0, 3.0, [0.0, 4.0]));
        let triangles: Vec<Triangle> = both.collect();
        let extents = bounds_of(triangles.iter().flat_map(|t| &t.0));
        let surfaces = Bvh::new(triangles);
        for is_room in [true, false] {
            let regions = Regions::of(&surfaces, &extents, |_| is_room).unwrap();
            assert_eq!(regions.is_free(&surfaces, [3.5, 1.0, 1.0].into()), Some(is_room));
            assert_eq!(regions.is_free(&surfaces, [2.5, 1.0, 1.0].into()), Some(true));
        }
    }
    /// In a closed room, so that it is for their number alone that nothing is said.
    #[test]
    fn what_cannot_be_drawn_is_not_begun() {
        let across = Triangle([[0.0; 3], [4.0, 4.0, 0.0], [4.0; 3]].map(Point3::from));
        let around = |count: usize| {
            let triangles: Vec<Triangle> = room().into_iter().chain(std::iter::repeat_n(across, count)).collect();
            let extents = bounds_of(triangles.iter().flat_map(|t| &t.0));
            Regions::of(&Bvh::new(triangles), &extents, |_| true)
        };
        assert!(around(1).is_some());
        assert!(around(2_000).is_none(), "64 × 64 × 64 cells each");
    }
}
