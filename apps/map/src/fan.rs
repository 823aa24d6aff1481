//! The rays of a scan, each from the sensor: which voxels they pass, without going from voxel to voxel.
//!
//! A ray is cut into slabs, the layers of voxels across the axis along which it goes fastest. On its way through a slab it
//! crosses at most one border of either other axis, so that its place in whole voxels at the end of slab `s` is the whole part
//! of `first + s · slope`, and eight slabs are worked out at once. What comes out is compared with what the last ray there left
//! that went the same way: where it is the same it is marked already, and near the sensor, where neighbouring rays of an image
//! share most of their ways, that is nearly always so.
//!
//! Where a number is so near to a whole one that rounding might decide, the ray is in doubt and walked voxel by voxel as OctoMap
//! does it ([`Walk`]); so what is marked is, to the voxel, what OctoMap passes.

use elk_geometry::Voxel;

use crate::marks::Scratch;
use crate::table::BrickTable;
use crate::walk::{Lattice, Point, Walk, direction_and_length};

/// Slabs of the longest ray that is not walked voxel by voxel: what 32 bits hold with [`ONE`] for one.
const MOST_SLABS: i32 = 480;
/// One voxel in fixed point.
const ONE: i32 = 1 << FRACTION_BITS;
const FRACTION_BITS: u32 = 22;
/// Slabs that are worked out at once.
const LANES: usize = 8;
/// What double precision leaves in doubt (voxels): OctoMap adds up a few hundred numbers, each rounded to one part in 10¹⁶.
const DOUBT: f64 = 1e-9;
/// A way through a slab that no ray has gone.
const NO_WAY: u32 = u32::MAX;

/// What is at the end of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tip {
    /// A surface: the last voxel is hit.
    Hit,
    /// Nothing that is known of: the ray passes the voxels before the last.
    Open,
    /// The last voxel that a map can have, and the ray goes on behind it.
    Edge,
}

/// A ray as the map takes it: to its end (m, world), which lies in the map.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    pub end: Point,
    pub tip: Tip,
}

/// The rays from one place.
pub struct Fan<'a> {
    lattice: Lattice,
    origin: Point,
    start: Voxel,
    /// How far it is to the border of the sensor's voxel, by axis, upwards and downwards (voxels).
    ahead: [[f64; 2]; 3],
    scratch: &'a mut Scratch,
    map: &'a BrickTable,
    /// Where the sensor's voxel is in the window, and what a step to the next block there adds to an address.
    home: [i32; 3],
    strides: [i32; 3],
    /// By main axis and signs, the way through each slab that was marked last.
    marked: Vec<[u32; MOST_SLABS as usize + LANES]>,
}

/// A ray that has slabs.
struct Slabs {
    /// Its way along its main axis, and along the others.
    along: [Along; 3],
    /// Borders that it crosses along them.
    crossed: [i32; 3],
    /// Voxels along the other axes in a slab; and at the end of the first, counted from the sensor's.
    slope: [i32; 2],
    first: [i32; 2],
    /// How far from a whole number leaves no doubt.
    margin: i32,
    /// Which along the other axes is crossed first in the last slab, where both are.
    is_second_first: bool,
    /// Main axis and signs as one number.
    class: usize,
}

/// A ray's way along an axis in the window.
#[derive(Clone, Copy)]
struct Along {
    /// Where it starts, and which way it goes.
    home: i32,
    step: i32,
    /// What a block, and the bits for what a voxel, adds to an address.
    stride: i32,
    shift: u32,
}

impl Along {
    /// What the coordinate behind `n` borders gives to an address.
    #[inline(always)]
    fn part(&self, n: i32) -> i32 {
        let at = self.home + self.step * n;
        (at >> 3) * self.stride + ((at & 7) << self.shift)
    }
}

/// The ways through some slabs: for each `LANES` of them a word, see [`ways`].
type Ways = [u32; LANES];

impl<'a> Fan<'a> {
    /// No rays yet, from `origin` (m, world) in a map that has these bricks.
    pub fn new(lattice: Lattice, origin: Point, scratch: &'a mut Scratch, map: &'a BrickTable) -> Self {
        let start = lattice.voxel(origin);
        let at = start.to_array();
        let ahead = std::array::from_fn(|axis| {
            [1, -1]
                .map(|step| lattice.border_ahead(origin[axis], at[axis], step) * f64::from(step) / lattice.resolution)
        });
        let (home, strides) = (scratch.in_window(start), scratch.strides());
        let marked = vec![[NO_WAY; MOST_SLABS as usize + LANES]; 24];
        Self { lattice, origin, start, ahead, scratch, map, home, strides, marked }
    }

    /// Marks what the rays pass and hit. `once`: of rays that hit the same voxel all but the first are left out.
    pub fn mark(&mut self, rays: &[Ray], once: bool) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi2") {
            // SAFETY: the processor has what the function is compiled for.
            return unsafe { self.mark_eight_at_a_time(rays, once) };
        }
        self.mark_each(rays, once)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn mark_eight_at_a_time(&mut self, rays: &[Ray], once: bool) {
        self.mark_each(rays, once)
    }

    #[inline(always)]
    fn mark_each(&mut self, rays: &[Ray], once: bool) {
        for ray in rays {
            let end = self.lattice.voxel(ray.end);
            if once && ray.tip == Tip::Hit && self.scratch.is_hit(end) {
                continue;
            }
            let is_marked = self.scratch.is_near(end) && self.mark_slabs(ray, end);
            if !is_marked {
                self.walk(ray);
            }
            match ray.tip {
                Tip::Hit => self.scratch.hit(end, self.map),
                Tip::Edge => self.scratch.pass_all(std::iter::once(end), self.map),
                Tip::Open => {}
            }
        }
    }

    /// Marks a ray voxel by voxel.
    #[cold]
    fn walk(&mut self, ray: &Ray) {
        self.scratch.pass_all(Walk::new(&self.lattice, self.origin, ray.end), self.map);
    }

    /// Marks a ray slab by slab; whether there was no doubt.
    #[inline(always)]
    fn mark_slabs(&mut self, ray: &Ray, end: Voxel) -> bool {
        if end == self.start {
            return true;
        }
        let Some(slabs) = self.slabs(ray, end) else {
            return false;
        };
        let mut last = 0;
        let mut at = 0;
        while at < slabs.crossed[0] {
            let Some(ways) = ways(&slabs, at) else {
                return false;
            };
            let count = (slabs.crossed[0] - at).min(LANES as i32);
            let marked = &mut self.marked[slabs.class][at as usize..at as usize + LANES];
            let mut new = (0..LANES).fold(0u32, |new, lane| new | u32::from(marked[lane] != ways[lane]) << lane);
            new &= (1 << count) - 1;
            if count as usize == LANES {
                marked.copy_from_slice(&ways);
            } else {
                marked[..count as usize].copy_from_slice(&ways[..count as usize]);
            }
            if new != 0 {
                let addresses = addresses(&slabs, at, &ways);
                while new != 0 {
                    let lane = new.trailing_zeros() as usize & (LANES - 1);
                    new &= new - 1;
                    addresses.iter().for_each(|passed| self.scratch.pass(passed[lane]));
                }
            }
            last = ways[(count - 1) as usize & (LANES - 1)];
            at += LANES as i32;
        }
        self.mark_last(&slabs, last)
    }

    /// The slabs of a ray; `None` if there is doubt.
    #[inline(always)]
    fn slabs(&self, ray: &Ray, end: Voxel) -> Option<Slabs> {
        let (direction, length) = direction_and_length(self.origin, ray.end);
        let speed = direction.map(|c| f64::from(c.abs()));
        let is_down: [usize; 3] = std::array::from_fn(|axis| usize::from(direction[axis] < 0.0));
        let axes = match (speed[0] >= speed[1], speed[0] >= speed[2], speed[1] >= speed[2]) {
            (true, true, _) => [0, 1, 2],
            (false, _, true) => [1, 0, 2],
            _ => [2, 0, 1],
        };
        // Along an axis along which it does not go it stays in the middle.
        let ahead = axes.map(|axis| if speed[axis] == 0.0 { 0.5 } else { self.ahead[axis][is_down[axis]] });
        let speed = axes.map(|axis| speed[axis]);
        let steps = axes.map(|axis| 1 - 2 * is_down[axis] as i32);
        let voxels = f64::from(length) * self.lattice.per_metre();
        let mut crossed = [0; 3];
        let mut is_doubtful = false;
        for i in 0..3 {
            let borders = voxels * speed[i] - ahead[i] + 1.0;
            crossed[i] = borders as i32;
            let rest = borders - f64::from(crossed[i]);
            is_doubtful |= !(DOUBT..1.0 - DOUBT).contains(&rest);
        }
        // Single precision may have it end short of its last voxel or in the one behind; only if that is hit it does not matter.
        let (from, to) = (self.start.to_array(), end.to_array());
        let beyond: i32 = (0..3).map(|i| (crossed[i] - (to[axes[i]] - from[axes[i]]) * steps[i]).max(0)).sum();
        is_doubtful |= beyond > i32::from(ray.tip != Tip::Open);
        is_doubtful |= crossed[0] > MOST_SLABS || crossed == [0; 3];
        let when = [1, 2].map(|i| (f64::from(crossed[i] - 1) + ahead[i]) * speed[3 - i]);
        is_doubtful |=
            (when[0] - when[1]).abs() < DOUBT * (when[0] + when[1]).abs() && crossed[1] > 0 && crossed[2] > 0;
        if is_doubtful {
            return None;
        }
        let inverse = 1.0 / speed[0];
        let slope = [1, 2].map(|i| speed[i] * inverse);
        let first = [0, 1].map(|i| ahead[0] * slope[i] - ahead[i + 1] + 1.0);
        let fixed = |x: f64| (x * f64::from(ONE) + 0.5) as i32;
        Some(Slabs {
            along: std::array::from_fn(|i| {
                let axis = axes[i];
                let (home, stride, shift) = (self.home[axis], self.strides[axis], 3 * axis as u32);
                Along { home, step: steps[i], stride, shift }
            }),
            crossed,
            slope: slope.map(fixed),
            first: first.map(fixed),
            margin: crossed[0] / 2 + 4,
            is_second_first: when[1] < when[0],
            class: axes[0] << 3 | is_down[0] << 2 | is_down[1] << 1 | is_down[2],
        })
    }

    /// Marks what a ray passes in its last slab before its last voxel; `before`: its way through the slab before.
    #[inline(always)]
    fn mark_last(&mut self, slabs: &Slabs, before: u32) -> bool {
        let y = ((before & 511) + (before >> 18 & 1)) as i32;
        let z = ((before >> 9 & 511) + (before >> 19 & 1)) as i32;
        let (dy, dz) = (slabs.crossed[1] - y, slabs.crossed[2] - z);
        if dy | dz | 1 != 1 {
            return false;
        }
        if dy | dz == 0 {
            return true;
        }
        let [layer, y0, z0] = [slabs.crossed[0], y, z];
        let [along_x, along_y, along_z] = &slabs.along;
        let address = |y: i32, z: i32| (along_x.part(layer) + along_y.part(y) + along_z.part(z)) as u32;
        self.scratch.pass(address(y0, z0));
        if dy & dz == 1 {
            self.scratch.pass(if slabs.is_second_first { address(y0, z0 + 1) } else { address(y0 + 1, z0) });
        }
        true
    }
}

/// The ways of a ray through `LANES` slabs from slab `from` on: where it enters each along the other axes (9 bits each), whether
/// it crosses a border there along the first, and along the second, and whether along the second first. `None` if there is doubt.
#[inline(always)]
fn ways(slabs: &Slabs, from: i32) -> Option<Ways> {
    let [by, bz] = slabs.slope;
    let (ey, ez) = (slabs.first[0] + from * by, slabs.first[1] + from * bz);
    let (fy, fz) = (by as f32, bz as f32);
    let count = slabs.crossed[0] - from;
    let margin = slabs.margin;
    // What both may be off, as far as it goes into the comparison of their products.
    let margin_of_products = (margin + 1) as f32 * (2 * ONE) as f32;
    let mut ways = [0; LANES];
    let mut doubts = [0; LANES];
    for lane in 0..LANES {
        let (y1, z1) = (ey + lane as i32 * by, ez + lane as i32 * bz);
        let (y0, z0) = (y1 - by, z1 - bz);
        let (ny1, nz1) = (y1 >> FRACTION_BITS, z1 >> FRACTION_BITS);
        // Before the first slab there may be less than nothing, or, by rounding, a border on which the sensor is.
        let entered = |x: i32| (x >> FRACTION_BITS).clamp(0, from + lane as i32);
        let (ny0, nz0) = (entered(y0), entered(z0));
        let is_near_whole = |x: i32| i32::from((x + margin) & (ONE - 1) <= 2 * margin);
        let both = (ny1 - ny0) & (nz1 - nz0);
        let to_y = ((ny1 << FRACTION_BITS) - y0) as f32 * fz;
        let to_z = ((nz1 << FRACTION_BITS) - z0) as f32 * fy;
        let is_close = i32::from((to_y - to_z).abs() <= margin_of_products);
        let is_second_first = i32::from(to_z < to_y);
        doubts[lane] = (is_near_whole(y1) | is_near_whole(z1) | is_close & both) & i32::from((lane as i32) < count);
        ways[lane] = (ny0 | nz0 << 9 | (ny1 - ny0) << 18 | (nz1 - nz0) << 19 | (is_second_first & both) << 20) as u32;
    }
    let doubt = doubts.iter().fold(0, |any, doubt| any | doubt);
    (doubt == 0).then_some(ways)
}

/// The addresses that a ray passes in `LANES` slabs from slab `from` on: those of the voxels by which it enters and leaves each,
/// and of the one between; where there are fewer, some of them are the same.
#[inline(always)]
fn addresses(slabs: &Slabs, from: i32, ways: &Ways) -> [[u32; LANES]; 3] {
    let [along_x, along_y, along_z] = &slabs.along;
    let mut addresses = [[0; LANES]; 3];
    for lane in 0..LANES {
        let way = ways[lane] as i32;
        let (y, z) = (way & 511, way >> 9 & 511);
        let layer = along_x.part(from + lane as i32);
        let (y0, y1) = (along_y.part(y), along_y.part(y + (way >> 18 & 1)));
        let (z0, z1) = (along_z.part(z), along_z.part(z + (way >> 19 & 1)));
        let is_second_first = way >> 20 & 1 == 1;
        addresses[0][lane] = (layer + y0 + z0) as u32;
        addresses[1][lane] = (layer + y1 + z1) as u32;
        addresses[2][lane] = (layer + if is_second_first { y0 + z1 } else { y1 + z0 }) as u32;
    }
    addresses
}
