//! How a scan gets into the map whose sensor errs along its rays: as a set, too.
//!
//! Rays free what they have passed for certain. About its surface each ray gives evidence for and against each voxel
//! ([`DepthError`]); the evidence of all rays of the scan is added up, and counts at most as a sure hit or a sure miss does. So
//! exact depths come to what [`OccupancyMap::insert`] makes of them, nearly; and from far away, where nothing is certain, a
//! scan says little.

use std::collections::HashMap;
use std::hash::BuildHasherDefault;

use elk_geometry::Voxel;
use elk_geometry::bricks::{BRICK_CELLS, BrickHasher, brick_of, cell_of};
use elk_geometry::delta::Changes;
use elk_geometry::mask::{self, Mask};
use nalgebra::{Point3, Vector3};

use crate::depth_error::{DepthError, Measured};
use crate::fan::{Ray, Tip};
use crate::growth::grown;
use crate::insertion::{Dropped, GRAZED_SHARE, Insertion, Sensor, single};
use crate::log_odds::Codes;
use crate::marks::Marks;
use crate::occupancy::{Brick, Changed, Grazing, MapConfig, OccupancyMap};
use crate::walk::{Lattice, Point, Walk};

/// Evidence is added up in whole numbers, of which this is 1: so the order of rays does not matter.
const ONE: f64 = 1024.0;

/// Where along a ray its surface may be.
struct Band {
    measured: Measured,
    /// Its ends (m, world), both in the map.
    from: Point,
    to: Point,
}

impl Band {
    /// The voxels on the ray where its surface may be, from the sensor on.
    fn voxels(&self, lattice: &Lattice) -> impl Iterator<Item = Voxel> + use<> {
        Walk::new(lattice, self.from, self.to).chain(std::iter::once(lattice.voxel(self.to)))
    }
}

/// What the rays of a scan say of the cells of a brick about their surfaces.
struct Evidence {
    /// Sums, in parts of [`ONE`].
    sums: Box<[i64; BRICK_CELLS]>,
    /// The cells of which any ray says anything.
    heard: Mask,
}

impl Evidence {
    fn none() -> Self {
        Self { sums: Box::new([0; BRICK_CELLS]), heard: mask::NONE }
    }

    fn add(&mut self, cell: usize, evidence: f64) {
        self.sums[cell] += (evidence * ONE).round() as i64;
        mask::set(&mut self.heard, cell);
    }

    /// All evidence about a cell.
    fn of(&self, cell: usize) -> f64 {
        self.sums[cell] as f64 / ONE
    }
}

/// By brick. Never gone through in its order.
type AllEvidence = HashMap<Voxel, Evidence, BuildHasherDefault<BrickHasher>>;

/// The rays of a scan.
#[derive(Default)]
struct Rays {
    /// What they have passed for certain.
    passed: Vec<Ray>,
    /// Where their surfaces may be, and the points themselves.
    bands: Vec<Band>,
    hits: Vec<Ray>,
    dropped: Dropped,
    cut: usize,
}

impl Rays {
    fn add(&mut self, sensor: &Sensor, point: Point3<f64>, error: &DepthError, config: &MapConfig) {
        let measured = error.of(sensor.origin, point, config.resolution);
        let (Some((ray, is_cut)), Some(measured)) = (sensor.ray_to(point, config), measured) else {
            self.dropped.invalid += 1;
            return;
        };
        self.dropped.out_of_range += usize::from(ray.tip == Tip::Edge);
        self.cut += usize::from(is_cut);
        let certain = measured.certain_end();
        let from = sensor.within_map(single(certain), Tip::Open);
        let way = |to: Point3<f64>| (to - sensor.origin).norm_squared();
        let is_nearer = way(certain) < way(ray.end.map(f64::from).into());
        self.passed.push(if is_nearer || ray.tip == Tip::Hit { from } else { ray });
        if let Some(to) = measured.likely_end().filter(|_| ray.tip == Tip::Hit) {
            let to = sensor.within_map(single(to), Tip::Open).end;
            self.bands.push(Band { measured, from: from.end, to });
            self.hits.push(ray);
        }
    }
}

impl OccupancyMap {
    /// The same as [`OccupancyMap::insert_with`], of a sensor that errs along its rays; each of them is walked, whatever
    /// [`MapConfig::integration`] says. A point that does not lie before the camera is none.
    ///
    /// A voxel comes to be known by a scan that is as sure of it as of a voxel that it missed; what is known, any evidence
    /// changes. A ray says nothing of what is behind a surface of the map, if it ended there or behind; and an occupied voxel
    /// that no free one touches any more, as noise leaves them behind surfaces, is forgotten.
    pub fn insert_uncertain(
        &mut self,
        origin: Point3<f64>,
        points: impl IntoIterator<Item = Point3<f64>>,
        (no_return, range): (impl IntoIterator<Item = Vector3<f64>>, f64),
        error: &DepthError,
    ) -> Insertion {
        let sensor = Sensor::new(self.config.resolution, origin);
        if !sensor.is_within_map() {
            let dropped = Dropped { out_of_range: points.into_iter().count(), ..Dropped::default() };
            return Insertion { dropped, ..Insertion::default() };
        }
        let mut rays = Rays::default();
        points.into_iter().for_each(|point| rays.add(&sensor, point, error, &self.config));
        let reach = self.config.reach_without_return(range);
        let empty = no_return.into_iter().filter(|_| reach > 0.0);
        rays.passed.extend(empty.filter_map(|direction| sensor.empty_ray(direction, reach)));
        let mut touched = self.touch(&sensor, &rays);
        rays.dropped.no_room = self.make_room(&sensor, &rays.hits, &mut touched);
        let evidence = self.weigh(&sensor.lattice, &rays.bands);
        Insertion { changed: self.believe(&touched, &evidence), dropped: rays.dropped, cut: rays.cut }
    }

    /// What rays pass for certain, and, as hit, where their surfaces may be; by brick.
    fn touch(&mut self, sensor: &Sensor, rays: &Rays) -> Vec<(Voxel, Marks)> {
        let ends = rays.bands.iter().map(|band| Ray { end: band.to, tip: Tip::Open });
        self.mark_rays(sensor, &rays.passed, ends);
        for band in &rays.bands {
            band.voxels(&sensor.lattice).for_each(|voxel| self.scratch.hit(voxel, &self.table));
        }
        self.scratch.take()
    }

    /// What the rays say of the voxels about their surfaces, in bricks that there are.
    fn weigh(&self, lattice: &Lattice, bands: &[Band]) -> AllEvidence {
        let mut all = AllEvidence::default();
        for band in bands {
            for voxel in band.voxels(lattice) {
                let Some(i) = self.table.find(brick_of(voxel)) else { continue };
                let evidence = band.measured.evidence(voxel.to_array());
                all.entry(brick_of(voxel)).or_insert_with(Evidence::none).add(cell_of(voxel), evidence);
                if evidence > 0.0 && mask::has(&self.bricks[i].occupied, cell_of(voxel)) {
                    break;
                }
            }
        }
        all
    }

    /// Gives every voxel its update, forgets what is hidden, and answers the voxels whose state changed.
    fn believe(&mut self, touched: &[(Voxel, Marks)], all: &AllEvidence) -> Changes {
        let (config, nothing) = (self.config, Evidence::none());
        let there: Vec<(usize, Voxel, &Marks)> = touched
            .iter()
            .filter_map(|(position, marks)| Some((self.table.find(*position)?, *position, marks)))
            .collect();
        let before: Vec<[Mask; 2]> = there.iter().map(|(i, ..)| self.bricks[*i].shown()).collect();
        for (i, position, marks) in &there {
            let spared = self.spared(*i, *position, marks);
            let passed = mask::without(&marks.passed, &spared);
            let evidence = all.get(position).unwrap_or(&nothing);
            self.bricks[*i].believe(&passed, evidence, &config, &mut self.codes);
        }
        // Only what is occupied is forgotten, so that none of it makes another one hidden.
        let hidden: Vec<Mask> = there.iter().map(|(i, position, _)| self.hidden(*i, *position)).collect();
        let mut changed = Changed::default();
        for (((i, ..), before), hidden) in there.iter().zip(before).zip(&hidden) {
            self.bricks[*i].forget(hidden, &mut self.codes);
            self.show_brick(*i, before, &mut changed);
        }
        self.conclude(changed)
    }

    /// The occupied cells of brick `i` that share no face, edge or corner with a free one: whatever is there, nobody has seen it.
    fn hidden(&self, i: usize, position: Voxel) -> Mask {
        let occupied = self.bricks[i].occupied;
        if occupied == mask::NONE {
            return mask::NONE;
        }
        let free = |offset: Voxel| self.table.find(position + offset).map_or(mask::NONE, |i| self.bricks[i].free());
        mask::without(&occupied, &grown(free))
    }
}

impl Brick {
    /// One update for every cell that was passed, or of which there is evidence.
    fn believe(&mut self, passed: &Mask, evidence: &Evidence, config: &MapConfig, codes: &mut Codes) {
        let sure = config.hit.min(-config.miss);
        for cell in mask::cells(&mask::or(passed, &evidence.heard)) {
            let is_grazed = config.grazing != Grazing::None && mask::has(&self.ever_hit, cell);
            let missed = match (mask::has(passed, cell), is_grazed) {
                (false, _) => 0.0,
                (true, true) => config.miss * GRAZED_SHARE,
                (true, false) => config.miss,
            };
            let sum = evidence.of(cell) as f32;
            // As in an exact scan, no ray that passes takes a hit back.
            let step = if sum > 0.0 { sum.min(config.hit) } else { sum.max(config.miss).min(missed) };
            if step == 0.0 || !mask::has(&self.known, cell) && step.abs() < sure {
                continue;
            }
            let log_odds = (self.log_odds.get(cell, codes) + step).clamp(config.clamp_min, config.clamp_max);
            self.know(cell, log_odds, config, codes);
        }
        // A hit that was refuted was none.
        self.ever_hit = self.occupied;
    }
}

#[cfg(test)]
mod tests;
