//! How a scan gets into the map: as a set.
//!
//! All rays are walked first, and only mark voxels as hit or passed; then every marked voxel gets one update, and a hit
//! wins over any number of passing rays. The order of the points therefore does not matter, and a voxel near the sensor
//! that a thousand rays pass is not a thousand times as free (`exploration-prototype`: without this no exploration ends).
//!
//! Of a sensor that errs along its rays, [`OccupancyMap::insert_uncertain`] in `uncertain.rs` takes scans.

use elk_geometry::Voxel;
use elk_geometry::bricks::brick_of;
use elk_geometry::delta::Changes;
use elk_geometry::mask::{self, Mask};
use elk_geometry::voxel::INDEX_RANGE;
use nalgebra::{Point3, Vector3};

use crate::fan::{Fan, Ray, Tip};
use crate::growth::grown;
use crate::log_odds::Codes;
use crate::marks::Marks;
use crate::occupancy::{Brick, Changed, Grazing, Integration, MapConfig, OccupancyMap};
use crate::walk::{Lattice, Point};

/// What a miss counts against a voxel that was ever hit, under a grazing rule: a surface that fills a part of it is passed
/// by more rays than hit it. At a half floors still dissolve; below a quarter nothing is gained, and noise goes slower.
pub(crate) const GRAZED_SHARE: f32 = 0.25;
/// Rays for which memory is kept from scan to scan.
const MOST_KEPT: usize = 1 << 18;

/// Points of a scan that could not be inserted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dropped {
    /// Points that are not finite, beyond single precision, or at the sensor's very position.
    pub invalid: usize,
    /// Points outside the 16-bit indices of OctoMap's files; their rays free what is inside.
    pub out_of_range: usize,
    /// Points in bricks for which the map has no room; their rays free what it has.
    pub no_room: usize,
}

/// What inserting a scan did.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Insertion {
    /// The voxels whose state changed, by brick in lexicographic order.
    pub changed: Changes,
    /// Points left out.
    pub dropped: Dropped,
    /// Points beyond the largest range, whose rays were cut there.
    pub cut: usize,
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
        let sensor = Sensor::new(self.config.resolution, origin);
        if !sensor.is_within_map() {
            dropped.out_of_range = points.into_iter().count();
            return Insertion { dropped, ..Insertion::default() };
        }
        let mut rays = std::mem::take(&mut self.rays);
        rays.clear();
        for point in points {
            let Some((ray, is_cut)) = sensor.ray_to(point, &self.config) else {
                dropped.invalid += 1;
                continue;
            };
            dropped.out_of_range += usize::from(ray.tip == Tip::Edge);
            cut += usize::from(is_cut);
            rays.push(ray);
        }
        let reach = self.config.reach_without_return(range);
        let empty = no_return.into_iter().filter(|_| reach > 0.0);
        rays.extend(empty.filter_map(|direction| sensor.empty_ray(direction, reach)));
        let mut touched = self.mark(&sensor, &rays);
        dropped.no_room = self.make_room(&sensor, &rays, &mut touched);
        if rays.len() < MOST_KEPT {
            self.rays = rays;
        }
        Insertion { changed: self.update(&touched), dropped, cut }
    }

    /// What rays pass and hit, by brick.
    fn mark(&mut self, sensor: &Sensor, rays: &[Ray]) -> Vec<(Voxel, Marks)> {
        self.mark_rays(sensor, rays, []);
        self.scratch.take()
    }

    /// Marks what rays pass and hit; beyond their ends there is room for marks up to those of `others`.
    pub(crate) fn mark_rays(&mut self, sensor: &Sensor, rays: &[Ray], others: impl IntoIterator<Item = Ray>) {
        let start = sensor.lattice.voxel(sensor.at);
        let (mut low, mut high) = (start.to_array(), start.to_array());
        for ray in rays.iter().copied().chain(others) {
            let end = sensor.lattice.voxel(ray.end).to_array();
            (low, high) = (std::array::from_fn(|i| low[i].min(end[i])), std::array::from_fn(|i| high[i].max(end[i])));
        }
        self.scratch.clear(start, low.into(), high.into(), self.table.room());
        Fan::new(sensor.lattice, sensor.at, &mut self.scratch, &self.table)
            .mark(rays, self.config.integration == Integration::EndVoxels);
    }

    /// Makes the bricks that there are not yet; where there is not room for all, the nearest to the sensor, and leaves the
    /// others out of what was touched. Answers how many rays hit in those.
    pub(crate) fn make_room(&mut self, sensor: &Sensor, rays: &[Ray], touched: &mut Vec<(Voxel, Marks)>) -> usize {
        let mut new: Vec<Voxel> =
            touched.iter().map(|(brick, _)| *brick).filter(|brick| self.table.find(*brick).is_none()).collect();
        let room = self.table.room();
        let is_short = new.len() > room;
        if is_short {
            let home = brick_of(sensor.lattice.voxel(sensor.at));
            new.sort_by(|a, b| a.distance(home).total_cmp(&b.distance(home)));
            new.truncate(room);
            // In the order in which the grid comes to have them.
            new.sort_unstable();
        }
        for brick in new {
            self.table.find_or_add(brick);
        }
        self.grow();
        if !is_short {
            return 0;
        }
        touched.retain(|(brick, _)| self.table.find(*brick).is_some());
        let is_lost = |ray: &&Ray| self.table.find(brick_of(sensor.lattice.voxel(ray.end))).is_none();
        rays.iter().filter(|ray| ray.tip == Tip::Hit).filter(is_lost).count()
    }

    /// Gives every marked voxel its update, and answers the voxels whose state changed.
    fn update(&mut self, touched: &[(Voxel, Marks)]) -> Changes {
        let (config, mut changed) = (self.config, Changed::default());
        for (position, marks) in touched {
            let Some(i) = self.table.find(*position) else { continue };
            let spared = self.spared(i, *position, marks);
            self.change_brick(i, &mut changed, |brick, codes| brick.update(marks, &spared, &config, codes));
        }
        self.conclude(changed)
    }

    /// The cells of brick `i` that passing rays do not count against (see [`Grazing`]).
    pub(crate) fn spared(&self, i: usize, position: Voxel, marks: &Marks) -> Mask {
        let ever_hit = self.bricks[i].ever_hit;
        match self.config.grazing {
            Grazing::None => mask::NONE,
            Grazing::Sticky => ever_hit,
            Grazing::Guard if (0..8).all(|z| ever_hit[z] & marks.passed[z] == 0) => mask::NONE,
            Grazing::Guard => {
                let near_hit = grown(|offset| *self.scratch.hits(position + offset));
                std::array::from_fn(|z| ever_hit[z] & near_hit[z])
            }
        }
    }
}

impl Brick {
    /// One update for every cell that was hit, or passed and not spared.
    fn update(&mut self, marks: &Marks, spared: &Mask, config: &MapConfig, codes: &mut Codes) {
        for (z, spared) in spared.iter().enumerate() {
            let hit = marks.hit[z];
            let missed = marks.passed[z] & !hit & !spared;
            let clamp = |log_odds: f32| log_odds.clamp(config.clamp_min, config.clamp_max);
            // What passed before the first hit grazed the surface that was hit now, unless misses always count.
            let guarded = config.grazing != Grazing::None;
            let first_hit = if guarded { hit & !self.ever_hit[z] } else { 0 };
            let grazed = if guarded { missed & self.ever_hit[z] } else { 0 };
            // Whatever is at its bound stays there.
            let moving = hit & !self.at_max[z] | missed & !self.at_min[z];
            self.ever_hit[z] |= hit;
            if moving == 0 {
                continue;
            }
            let (mut occupied, mut at_min, mut at_max) = (self.occupied[z], self.at_min[z], self.at_max[z]);
            for bit in mask::bits(moving) {
                let is_in = |cells: u64| cells >> bit & 1 == 1;
                let step = match (is_in(hit), is_in(grazed)) {
                    (true, _) => config.hit,
                    (false, true) => config.miss * GRAZED_SHARE,
                    (false, false) => config.miss,
                };
                let before = self.log_odds.get(z << 6 | bit, codes);
                let forgets = is_in(first_hit) && before < 0.0;
                let log_odds = clamp(if forgets { step } else { before + step });
                self.log_odds.set(z << 6 | bit, log_odds, codes);
                let set = |cells: u64, is_in: bool| cells & !(1 << bit) | u64::from(is_in) << bit;
                occupied = set(occupied, log_odds > 0.0);
                at_min = set(at_min, log_odds == config.clamp_min);
                at_max = set(at_max, log_odds == config.clamp_max);
            }
            (self.occupied[z], self.at_min[z], self.at_max[z]) = (occupied, at_min, at_max);
            self.known[z] |= moving;
        }
    }
}

/// Where a scan is taken from.
pub(crate) struct Sensor {
    pub lattice: Lattice,
    /// Its place (m, world), and the same in OctoMap's precision.
    pub origin: Point3<f64>,
    at: Point,
}

impl Sensor {
    /// A sensor at `origin` (m, world), over voxels of an edge of `resolution` (m).
    pub fn new(resolution: f64, origin: Point3<f64>) -> Self {
        Self { lattice: Lattice::new(resolution), origin, at: single(origin) }
    }

    /// Whether it is in the map.
    pub fn is_within_map(&self) -> bool {
        self.lattice.has(self.at)
    }

    /// The ray to a point, moved into its surface, or cut at the largest range; and whether it was cut. `None`: the point is
    /// not one.
    #[inline]
    pub fn ray_to(&self, point: Point3<f64>, config: &MapConfig) -> Option<(Ray, bool)> {
        let offset = point - self.origin;
        let range = offset.norm();
        let end = point + offset * (config.advance / range);
        let mut at = single(end);
        if config.integration == Integration::EndVoxels && self.lattice.has(at) {
            at = self.lattice.center(self.lattice.voxel(at));
        }
        let [x, y, z] = std::array::from_fn(|i| at[i] - self.at[i]);
        let range = f64::from(x * x + y * y + z * z).sqrt();
        if !range.is_finite() || range == 0.0 {
            return None;
        }
        if config.max_range > 0.0 && range > config.max_range {
            let (way, length) = (config.max_range as f32, range as f32);
            let end = std::array::from_fn(|i| self.at[i] + (at[i] - self.at[i]) / length * way);
            return Some((self.within_map(end, Tip::Open), true));
        }
        Some((self.within_map(at, Tip::Hit), false))
    }

    /// The ray in a direction in which there is nothing up to `reach` (m). `None`: it is no direction.
    pub fn empty_ray(&self, direction: Vector3<f64>, reach: f64) -> Option<Ray> {
        let direction = direction.try_normalize(0.0).filter(|d| d.iter().all(|c| c.is_finite()))?;
        Some(self.within_map(single(self.origin + direction * reach), Tip::Open))
    }

    /// A ray to a point; cut where the map ends.
    #[inline]
    pub fn within_map(&self, end: Point, tip: Tip) -> Ray {
        match self.lattice.has(end) {
            true => Ray { end, tip },
            false => Ray { end: self.cut_to_map(end), tip: Tip::Edge },
        }
    }

    /// Where the way to a point outside leaves the map.
    #[cold]
    fn cut_to_map(&self, end: Point) -> Point {
        let [start, end] = [self.at, end].map(|p| Point3::from(p.map(|c| f64::from(c) * self.lattice.per_metre())));
        single(cut_to_map(start, end) * self.lattice.resolution)
    }
}

/// A point in OctoMap's precision.
#[inline]
pub(crate) fn single(point: Point3<f64>) -> Point {
    [point.x as f32, point.y as f32, point.z as f32]
}

/// Smallest coordinate of a map, and the one behind its largest (voxels).
const LOW: f64 = *INDEX_RANGE.start() as f64;
const HIGH: f64 = *INDEX_RANGE.end() as f64 + 1.0;
/// How far inside the map a ray ends that leaves it (voxels): far enough that rounding does not carry it out again.
const INSIDE: f64 = 0.01;

/// Where the way from `start`, inside the map, to `end`, outside, leaves it (all in voxels).
fn cut_to_map(start: Point3<f64>, end: Point3<f64>) -> Point3<f64> {
    let way = end - start;
    let share = |axis: usize| match end[axis] {
        c if c < LOW => (LOW - start[axis]) / way[axis],
        c if c >= HIGH => (HIGH - start[axis]) / way[axis],
        _ => 1.0,
    };
    let share = (0..3).map(share).fold(1.0, f64::min);
    (start + way * share).map(|c| c.clamp(LOW + INSIDE, HIGH - INSIDE))
}

#[cfg(test)]
mod tests;
