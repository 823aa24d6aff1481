//! What a step costs in a building of which more and more is explored already, phase by phase, and what is kept of it.
//!
//! `cargo bench -p elk-explorer --bench building -- [ROOMS… [TYPE…] [seed=N] [steps=N]]`, all by default. A whole run over a thousand rooms takes
//! a day, so the early part is not run: the map begins with so many rooms known, voxel by voxel as they are but for places of
//! which nothing is known, as there are after every run, and the robot explores what lies behind them. Times are CPU times of
//! the thread. At the end stands what each process has allocated for what it knows.

mod run;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use elk_field::Solver;
use elk_geometry::random::Random;
use elk_geometry::{Bounds, OccupancyGrid, State, Voxel};
use elk_world::World;
use elk_world::scenery::Building;
use nalgebra::Vector3;
use run::{HEADER, RESOLUTION, Run, USUAL, strategies};

/// Counts the bytes that are allocated.
struct Counting;

static ALLOCATED: AtomicUsize = AtomicUsize::new(0);

// SAFETY: the system's allocator, and beside it a number.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATED.fetch_add(layout.size(), Relaxed);
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        ALLOCATED.fetch_add(layout.size(), Relaxed);
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATED.fetch_add(size, Relaxed);
        ALLOCATED.fetch_sub(layout.size(), Relaxed);
        unsafe { System.realloc(at, layout, size) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        ALLOCATED.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Rooms that the robot has still to explore.
const AHEAD: usize = 20;
/// Steps that are measured.
const STEPS: usize = 200;
/// Voxels a room of which nothing is known: what no scan saw.
const UNSEEN: usize = 6;

/// A box of voxels of which it is said what is solid.
struct Raster {
    origin: Voxel,
    dim: [usize; 3],
    solid: Vec<bool>,
}

impl Raster {
    /// What of a building is solid, and a shell of a voxel around it.
    fn of(building: &Building) -> Self {
        let Bounds { min, max } = building.extents();
        let around = Voxel::new(1, 1, 1);
        let (origin, end) = (Voxel::containing(min, RESOLUTION) - around, Voxel::containing(max, RESOLUTION) + around);
        let dim = (end - origin + around).to_array().map(|n| n as usize);
        let mut raster = Self { origin, dim, solid: vec![true; dim.iter().product()] };
        raster.fill(origin + around, end - around, false);
        for Bounds { min, max } in building.blocks() {
            raster.fill(Voxel::containing(min, RESOLUTION), Voxel::containing(max, RESOLUTION), true);
        }
        raster
    }

    fn index(&self, voxel: Voxel) -> Option<usize> {
        let [x, y, z] = (voxel - self.origin).to_array().map(|c| c as usize);
        let [nx, ny, nz] = self.dim;
        (x < nx && y < ny && z < nz).then(|| (z * ny + y) * nx + x)
    }

    fn voxels(from: Voxel, to: Voxel) -> impl Iterator<Item = Voxel> {
        let rows = (from.z..=to.z).flat_map(move |z| (from.y..=to.y).map(move |y| (y, z)));
        rows.flat_map(move |(y, z)| (from.x..=to.x).map(move |x| Voxel::new(x, y, z)))
    }

    fn fill(&mut self, from: Voxel, to: Voxel, solid: bool) {
        for i in Self::voxels(from, to).filter_map(|voxel| self.index(voxel)).collect::<Vec<_>>() {
            self.solid[i] = solid;
        }
    }

    fn is_solid(&self, voxel: Voxel) -> bool {
        self.index(voxel).is_none_or(|i| self.solid[i])
    }
}

/// What is known of a building of which the first rooms are explored.
fn explored(building: &Building, rooms: usize, seed: u64) -> OccupancyGrid {
    let raster = Raster::of(building);
    let mut grid = OccupancyGrid::new(RESOLUTION);
    let is_seen = |voxel: Voxel| !raster.is_solid(voxel) && building.room_at(voxel.center(RESOLUTION)) < rooms;
    let last = raster.origin + Voxel::from(raster.dim.map(|n| n as i32 - 1));
    let mut free = vec![Vec::new(); rooms];
    for voxel in Raster::voxels(raster.origin, last).filter(|voxel| is_seen(*voxel)) {
        grid.set(voxel, State::Free);
        for wall in voxel.face_neighbours().into_iter().filter(|beside| raster.is_solid(*beside)) {
            grid.set(wall, State::Occupied);
        }
        free[building.room_at(voxel.center(RESOLUTION))].push(voxel);
    }
    for (room, free) in free.iter().enumerate() {
        let mut random = Random::new(seed, room as u64);
        for _ in 0..UNSEEN {
            grid.set(free[random.below(free.len())], State::Unknown);
        }
    }
    // Of revision 0 there is nothing to go on from.
    grid.skip_to(1);
    grid
}

/// What is free when something is gone (bytes).
fn freed<T>(of: T) -> usize {
    let before = ALLOCATED.load(Relaxed);
    drop(of);
    before - ALLOCATED.load(Relaxed)
}

/// Says what each process that keeps something of the map has allocated for it: what is free when it is gone.
fn print_memory(run: Run) {
    let Run { map, grid, explorer, follower, .. } = run;
    let (known, bricks) = ((grid.free() + grid.occupied()) as f64, grid.bricks().len());
    let sizes = [freed(map), freed(grid), freed(explorer), freed(follower)];
    let [map, copy, explorer, controller] = sizes.map(|size| size as f64 / known);
    let all = map + copy + explorer + controller;
    println!(
        "    bytes a known voxel, {bricks} bricks: map {map:.2}, explorer {explorer:.2} and its copy {copy:.2}, controller {controller:.2}, \
         in all {all:.2}"
    );
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let mut wanted: Vec<usize> = words.iter().filter_map(|word| word.parse().ok()).collect();
    if wanted.is_empty() {
        wanted = vec![10, 30, 100, 300, 1000];
    }
    let number = |name: &str| words.iter().find_map(|word| word.strip_prefix(name)?.parse().ok());
    let (seed, steps) = (number("seed=").unwrap_or(1), number("steps=").map_or(STEPS, |steps| steps as usize));
    let is_named = |name: &str| words.iter().any(|word| word == name);
    let types = strategies(Solver::Cascade, None, 0.0).iter().any(|strategy| is_named(strategy.name()));
    println!("{HEADER}");
    for rooms in wanted {
        let building = Building::new(rooms + AHEAD, seed);
        let known = explored(&building, rooms, seed);
        let bounds = Bounds::from_mid_dim(building.extents().mid(), building.extents().dim() + Vector3::repeat(1.0));
        println!("{rooms} rooms, seed {seed}: {} voxels known", known.free() + known.occupied());
        let all = strategies(Solver::Cascade, None, 0.0).into_iter();
        for strategy in all.filter(|one| if types { is_named(one.name()) } else { USUAL.contains(&one.name()) }) {
            let world = World::from_triangles("building", building.scenery().triangles()).expect("it is a world");
            let mut run = Run::new(world, building.before(rooms - 1), bounds, strategy).knowing(&known);
            run.go(steps);
            run.print(&format!("{rooms} rooms"));
            print_memory(run);
        }
    }
}
