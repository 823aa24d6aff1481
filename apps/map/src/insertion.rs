//! How a scan gets into the map: as a set.
//!
//! All rays are walked first, and only mark voxels as hit or passed; then every marked voxel gets one update, and a hit
//! wins over any number of passing rays. The order of the points therefore does not matter, and a voxel near the sensor
//! that a thousand rays pass is not a thousand times as free (`exploration-prototype`: without this no exploration ends).

use elk_geometry::Voxel;
use elk_geometry::bricks::{brick_of, voxel_at};
use elk_geometry::mask::{self, Mask};
use elk_geometry::voxel::INDEX_RANGE;
use nalgebra::{Point3, Vector3};

use crate::growth::grown;
use crate::occupancy::{Brick, Grazing, MapConfig, Marks, OccupancyMap};
use crate::walk::Walk;

/// How far a point is moved along its ray (m): one that lies on the border of two voxels, as those on walls that follow
/// the lattice do, falls into the voxel behind the surface, whatever rounding did to it.
const ADVANCE: f64 = 1e-4;
/// What a miss counts against a voxel that was ever hit, under a grazing rule: a surface that fills a part of it is passed
/// by more rays than hit it. At a half floors still dissolve; below a quarter nothing is gained, and noise goes slower.
const GRAZED_SHARE: f32 = 0.25;

/// Points of a scan that could not be inserted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dropped {
    /// Points that are not finite, or at the sensor's very position.
    pub invalid: usize,
    /// Points outside the 16-bit indices of OctoMap's files; their rays free what is inside.
    pub out_of_range: usize,
    /// Points whose rays came to where the map has no room for more bricks.
    pub no_room: usize,
}

/// What inserting a scan did.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Insertion {
    /// The voxels whose state changed, by brick in lexicographic order.
    pub changed: Vec<Voxel>,
    /// Points left out.
    pub dropped: Dropped,
    /// Points beyond the largest range, whose rays were cut there.
    pub cut: usize,
}

/// What is at the end of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tip {
    /// A surface: the last voxel is hit.
    Hit,
    /// Nothing that is known of: the ray passes the voxels before the last.
    Open,
    /// The last voxel that a map can have, and the ray goes on behind it.
    Edge,
}

/// A ray as the map takes it: from the sensor to its end, in units of voxels.
struct Ray {
    end: Point3<f64>,
    tip: Tip,
}

impl OccupancyMap {
    /// Inserts what was seen from `origin`: one ray to each of `points` (both m, world). The voxel of a point is hit,
    /// those from the sensor's own up to it are passed.
    pub fn insert(&mut self, origin: Point3<f64>, points: impl IntoIterator<Item = Point3<f64>>) -> Insertion {
        self.insert_with(origin, points, [], 0.0)
    }

    /// The same, with the directions (world) in which nothing was seen up to `range` (m; 0: as far as there is anything):
    /// there the voxels are passed as far as the map is told to believe that ([`MapConfig::free_no_return`]).
    pub fn insert_with(
        &mut self,
        origin: Point3<f64>,
        points: impl IntoIterator<Item = Point3<f64>>,
        no_return: impl IntoIterator<Item = Vector3<f64>>,
        range: f64,
    ) -> Insertion {
        let (mut dropped, mut cut) = (Dropped::default(), 0);
        let start = origin / self.config.resolution;
        if !within_map(start) {
            dropped.out_of_range = points.into_iter().count();
            return Insertion { dropped, ..Insertion::default() };
        }
        let Some(home) = self.table.find_or_add(brick_of(Voxel::containing(start, 1.0))) else {
            dropped.no_room = points.into_iter().count();
            return Insertion { dropped, ..Insertion::default() };
        };
        self.grow();
        for point in points {
            let Some(ray) = ray_to(origin, point, &self.config) else {
                dropped.invalid += 1;
                continue;
            };
            cut += usize::from(ray.tip == Tip::Open);
            let came_to_its_end = self.mark(Walk::new(start, ray.end), home, ray.tip);
            match ray.tip {
                Tip::Edge => dropped.out_of_range += 1,
                _ => dropped.no_room += usize::from(!came_to_its_end),
            }
        }
        let (reach, resolution) = (self.config.reach_without_return(range), self.config.resolution);
        let empty = no_return.into_iter().filter(|_| reach > 0.0);
        for ray in empty.filter_map(|direction| empty_ray(origin, direction, reach, resolution)) {
            // What there is no room for is not missed: there was nothing.
            self.mark(Walk::new(start, ray.end), home, ray.tip);
        }
        Insertion { changed: self.update_marked(), dropped, cut }
    }

    /// Walks a ray from brick `home` on, marks what it passes, and its end as it is; whether it came to its end.
    fn mark(&mut self, mut walk: Walk, home: usize, tip: Tip) -> bool {
        let mut i = home;
        self.touch(i);
        loop {
            let key = walk.brick_key();
            let passed = &mut self.marks[i].passed;
            while walk.left() > 0 && walk.brick_key() == key {
                let (layer, bit) = walk.cell();
                passed[layer] |= bit;
                walk.advance();
            }
            if walk.brick_key() == key {
                break;
            }
            let Some(next) = self.table.beyond(i, walk.face_from(key)) else {
                return false;
            };
            i = next;
            self.touch(i);
        }
        let (layer, bit) = walk.cell();
        match tip {
            Tip::Hit => self.marks[i].hit[layer] |= bit,
            Tip::Edge => self.marks[i].passed[layer] |= bit,
            Tip::Open => {}
        }
        true
    }

    #[inline]
    fn touch(&mut self, i: usize) {
        if i >= self.marks.len() {
            self.grow();
        }
        if !self.marks[i].touched {
            self.marks[i].touched = true;
            self.touched.push(i);
        }
    }

    /// Gives every marked voxel its update, clears the marks and answers the voxels whose state changed.
    fn update_marked(&mut self) -> Vec<Voxel> {
        let mut touched = std::mem::take(&mut self.touched);
        // By position, not in the order in which rays came by: the answer does not depend on the order of the points.
        touched.sort_unstable_by_key(|&i| self.table.position(i));
        let spared: Vec<Mask> = touched.iter().map(|&i| self.spared(i)).collect();
        let mut changed = Vec::new();
        // A map that has become full has another frontier everywhere.
        let became_full = self.table.is_full() && !std::mem::replace(&mut self.full, self.table.is_full());
        let mut changed_bricks: Vec<usize> = if became_full { (0..self.bricks.len()).collect() } else { Vec::new() };
        for (&i, spared) in touched.iter().zip(&spared) {
            let marks = std::mem::take(&mut self.marks[i]);
            let cells = self.bricks[i].update(&marks, spared, &self.config);
            if cells != mask::NONE {
                changed_bricks.push(i);
                self.tell_grid(i, &cells, &mut changed);
            }
        }
        self.update_frontier(&changed_bricks);
        touched.clear();
        self.touched = touched;
        changed
    }

    fn tell_grid(&mut self, i: usize, cells: &Mask, changed: &mut Vec<Voxel>) {
        let (brick, position) = (&self.bricks[i], self.table.position(i));
        for cell in mask::cells(cells) {
            let voxel = voxel_at(position, cell);
            self.grid.set(voxel, Self::state_of(brick.log_odds[cell]));
            changed.push(voxel);
        }
    }

    /// The cells of brick `i` that passing rays do not count against (see [`Grazing`]).
    fn spared(&self, i: usize) -> Mask {
        let ever_hit = self.bricks[i].ever_hit;
        let passed = self.marks[i].passed;
        match self.config.grazing {
            Grazing::None => mask::NONE,
            Grazing::Sticky => ever_hit,
            Grazing::Guard if (0..8).all(|z| ever_hit[z] & passed[z] == 0) => mask::NONE,
            Grazing::Guard => {
                let near_hit = grown(|offset| self.hits(self.table.position(i) + offset));
                std::array::from_fn(|z| ever_hit[z] & near_hit[z])
            }
        }
    }

    /// The cells of the brick at `position` that this scan hit.
    fn hits(&self, position: Voxel) -> Mask {
        self.table.find(position).map_or(mask::NONE, |i| self.marks[i].hit)
    }
}

impl Brick {
    /// One update for every cell that was hit, or passed and not spared; answers the cells whose state changed.
    fn update(&mut self, marks: &Marks, spared: &Mask, config: &MapConfig) -> Mask {
        std::array::from_fn(|z| {
            let hit = marks.hit[z];
            let missed = marks.passed[z] & !hit & !spared[z];
            let clamp = |log_odds: f32| log_odds.clamp(config.clamp_min, config.clamp_max);
            // What passed before the first hit grazed the surface that was hit now, unless misses always count.
            let guarded = config.grazing != Grazing::None;
            let first_hit = if guarded { hit & !self.ever_hit[z] } else { 0 };
            let grazed = if guarded { missed & self.ever_hit[z] } else { 0 };
            let mut occupied = self.occupied[z];
            for bit in mask::bits(hit | missed) {
                let is_in = |cells: u64| cells >> bit & 1 == 1;
                let step = match (is_in(hit), is_in(grazed)) {
                    (true, _) => config.hit,
                    (false, true) => config.miss * GRAZED_SHARE,
                    (false, false) => config.miss,
                };
                let log_odds = &mut self.log_odds[z << 6 | bit];
                let forgets = is_in(first_hit) && *log_odds < 0.0;
                *log_odds = clamp(if forgets { step } else { *log_odds + step });
                occupied = occupied & !(1 << bit) | u64::from(*log_odds > 0.0) << bit;
            }
            let changed = (occupied ^ self.occupied[z]) | ((hit | missed) & !self.known[z]);
            self.occupied[z] = occupied;
            self.known[z] |= hit | missed;
            self.ever_hit[z] |= hit;
            changed
        })
    }
}

/// The ray to a point: cut at the largest range, or advanced into the surface. `None`: the point is not one.
fn ray_to(origin: Point3<f64>, point: Point3<f64>, config: &MapConfig) -> Option<Ray> {
    let offset = point - origin;
    let range = offset.norm();
    if !range.is_finite() || range == 0.0 {
        return None;
    }
    let cut = config.max_range > 0.0 && range > config.max_range;
    let length = if cut { config.max_range } else { range + ADVANCE };
    let end = origin + offset * (length / range);
    Some(Ray::between(origin, end, if cut { Tip::Open } else { Tip::Hit }, config.resolution))
}

/// The ray in a direction in which there is nothing up to `reach` (m). `None`: it is no direction.
fn empty_ray(origin: Point3<f64>, direction: Vector3<f64>, reach: f64, resolution: f64) -> Option<Ray> {
    let direction = direction.try_normalize(0.0).filter(|d| d.iter().all(|c| c.is_finite()))?;
    Some(Ray::between(origin, origin + direction * reach, Tip::Open, resolution))
}

impl Ray {
    /// The ray between two points (m), the first of which lies in the map; cut where the map ends.
    fn between(origin: Point3<f64>, end: Point3<f64>, tip: Tip, resolution: f64) -> Self {
        let end_of_ray = end / resolution;
        match within_map(end_of_ray) {
            true => Self { end: end_of_ray, tip },
            false => Self { end: cut_to_map(origin / resolution, end_of_ray), tip: Tip::Edge },
        }
    }
}

/// Smallest coordinate of a map, and the one behind its largest (voxels).
const LOW: f64 = *INDEX_RANGE.start() as f64;
const HIGH: f64 = *INDEX_RANGE.end() as f64 + 1.0;
/// How far inside the map a ray ends that leaves it (voxels): far enough that rounding does not carry it out again.
const INSIDE: f64 = 1e-6;

/// Whether a point (voxels) lies where OctoMap's keys reach.
fn within_map(point: Point3<f64>) -> bool {
    point.iter().all(|c| (LOW..HIGH).contains(c))
}

/// Where the way from `start`, inside the map, to `end`, outside, leaves it (all in voxels).
fn cut_to_map(start: Point3<f64>, end: Point3<f64>) -> Point3<f64> {
    let way = end - start;
    let share = |axis: usize| match end[axis] {
        c if c < LOW => (LOW - start[axis]) / way[axis],
        c if c >= HIGH => (HIGH - start[axis]) / way[axis],
        _ => 1.0,
    };
    let share = (0..3).map(share).fold(1.0, f64::min);
    (start + way * share).map(|c| c.clamp(LOW, HIGH - INSIDE))
}

#[cfg(test)]
mod tests;
