//! `Oracle`: a short way on which a world that is known is seen, as a reference length for those who have to find out.
//!
//! Such a way is feasible, and no bound: a shorter one may exist. There are places on a lattice in which the robot can be, and for
//! each all that a look around shows there of the visible free voxels and of the surfaces about them: the sensor's rays in the true
//! world, inserted into a map. Stops are chosen greedily for what they show for the detour that they cost, until all is seen that
//! any place shows, as a run ends when nothing is left to be seen. The tour past them is shortened by local moves
//! ([`elk_geometry::tour`]), stops that are no longer needed are left out, and others moved to where they cost less. A look costs no
//! way, so the robot looks around wherever its way bends. What it would see between these places is not counted.

mod cover;

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use elk_geometry::bricks::voxel_at;
use elk_geometry::tour::shorten;
use elk_geometry::{Voxel, VoxelSet, mask};
use elk_map::{MapConfig, OccupancyMap};
use elk_world::World;
use nalgebra::{Point3, Vector3};

use crate::pool::Grounds;
use crate::site::Around;
use crate::truth::Truth;
use cover::Cover;

/// Places of the lattice; more would take minutes.
const MOST_PLACES: usize = 600;
/// Places that are put in beside the lattice at most, for what is not seen from it.
const MOST_MORE: usize = 200;
/// What a detour is thought to cost besides its length (m), in several attempts, of which the shortest way counts: little makes many
/// stops by the way, much makes as few as possible.
const RELUCTANCES_M: [f64; 4] = [0.3, 1.0, 3.0, 30.0];
/// How often a tour is gone through.
const ROUNDS: usize = 20;
/// Less than this is no shorter (m).
const LEAST_M: f64 = 1e-6;

/// A way on which a world is seen.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// The corners of the way (m, world), from the start on: at each the robot looks around.
    pub corners: Vec<Point3<f64>>,
    /// Its length (m).
    pub way_m: f64,
    /// Share of the visible free voxels that is seen from its corners (0 to 1).
    pub seen: f64,
}

/// What a way comes to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Length {
    /// Its length (m).
    pub way_m: f64,
    /// Share of the visible free voxels that is seen on it (0 to 1).
    pub seen: f64,
}

/// What came of each world and start, each by its place in the suite; `None`: no way was found.
pub type Lengths = BTreeMap<(usize, usize), Option<Length>>;

/// Looks for ways in these worlds from these starts, `jobs` worlds at a time, until all are found or `stop` is set.
pub fn lengths(grounds: &Grounds, wanted: &BTreeSet<(usize, usize)>, (jobs, stop): (usize, &AtomicBool)) -> Lengths {
    let worlds: BTreeSet<usize> = wanted.iter().map(|(world, _)| *world).collect();
    let worlds: Vec<usize> = worlds.into_iter().collect();
    let (next, found) = (AtomicUsize::new(0), Mutex::new(Lengths::new()));
    let search = || {
        while let Some(&world) = worlds.get(next.fetch_add(1, Ordering::Relaxed)) {
            let of_world = in_world(grounds, world, wanted, stop);
            found.lock().unwrap_or_else(PoisonError::into_inner).extend(of_world);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..jobs {
            scope.spawn(search);
        }
        search();
    });
    found.into_inner().unwrap_or_else(PoisonError::into_inner)
}

fn in_world(grounds: &Grounds, world: usize, wanted: &BTreeSet<(usize, usize)>, stop: &AtomicBool) -> Lengths {
    let Ok(site) = grounds.site(world) else { return Lengths::new() };
    let Some(around) = site.around.filter(|_| !stop.load(Ordering::Relaxed)) else { return Lengths::new() };
    let oracle = Oracle::new(&site.world, &site.truth, around);
    let starts = wanted.range((world, 0)..(world + 1, 0)).take_while(|_| !stop.load(Ordering::Relaxed));
    let length = |start: usize| {
        let way = oracle.way(site.starts[start].position)?;
        Some(Length { way_m: way.way_m, seen: way.seen })
    };
    starts.map(|&(world, start)| ((world, start), length(start))).collect()
}

/// A world that is known, ready for ways from any start.
pub struct Oracle<'a> {
    world: &'a World,
    truth: &'a Truth,
    around: Around,
    directions: Vec<Vector3<f64>>,
    /// What is to be seen.
    wanted: VoxelSet,
    places: Vec<Voxel>,
    /// What each place shows.
    shown: Vec<Cover>,
    graph: Graph,
    /// What all places together show.
    all: Cover,
}

impl<'a> Oracle<'a> {
    /// Looks around at all places from which a way is made. Takes a minute in a large world.
    pub fn new(world: &'a World, truth: &'a Truth, around: Around) -> Self {
        let mut wanted = truth.visible().clone();
        for voxel in truth.surface().iter() {
            wanted.insert(voxel);
        }
        let (directions, all) = (directions(around.spacing), Cover::none(&wanted));
        let (places, shown, graph) = (Vec::new(), Vec::new(), Graph::default());
        let mut oracle = Self { world, truth, around, directions, wanted, places, shown, graph, all };
        lattice(truth).into_iter().for_each(|voxel| oracle.add(voxel));
        oracle.add_what_is_missing();
        oracle.connect();
        oracle
    }

    /// A short way from `start` (m, world) on which all is seen that any of the places shows; `None`: the robot cannot get from there
    /// to all of them.
    pub fn way(&self, start: Point3<f64>) -> Option<Reference> {
        let ways = Ways::new(self, start);
        let attempts = RELUCTANCES_M.iter().filter_map(|reluctance_m| {
            let stops = ways.shortened(ways.chosen(*reluctance_m)?);
            Some((ways.length_m(&stops), stops))
        });
        let (way_m, stops) = attempts.min_by(|one, other| one.0.total_cmp(&other.0))?;
        let passed = ways.passed(&stops);
        let seen = ways.seen(&passed).share_of(&self.wanted, self.truth.visible());
        Some(Reference { corners: passed.iter().map(|place| ways.position(*place)).collect(), way_m, seen })
    }

    /// Makes the centre of a voxel one of the places.
    fn add(&mut self, voxel: Voxel) {
        let shown = self.look(self.center(voxel));
        self.places.push(voxel);
        self.all.add(&shown);
        self.shown.push(shown);
    }

    fn center(&self, voxel: Voxel) -> Point3<f64> {
        voxel.center(self.truth.resolution())
    }

    /// What a look around shows.
    fn look(&self, place: Point3<f64>) -> Cover {
        let config = MapConfig { resolution: self.truth.resolution(), ..MapConfig::default() };
        let Ok(mut map) = OccupancyMap::new(config) else { return Cover::none(&self.wanted) };
        let hits = self.directions.iter().filter_map(|direction| {
            let away = self.world.cast(place, *direction).filter(|away| *away <= self.around.range_m)?;
            Some(place + direction * away)
        });
        map.insert(place, hits);
        Cover::of(&self.wanted, map.grid())
    }

    /// Places near what the lattice does not see, as [`Truth`] has them.
    fn add_what_is_missing(&mut self) {
        let bricks: Vec<Voxel> = self.wanted.bricks().map(|(brick, _)| brick).collect();
        for (at, brick) in bricks.into_iter().enumerate() {
            for cell in mask::cells(self.truth.visible().brick(brick)) {
                if self.all.has(at, cell) || self.places.len() >= MOST_PLACES + MOST_MORE {
                    continue;
                }
                if let Some(place) = self.truth.near_view(self.world, voxel_at(brick, cell)) {
                    self.add(place);
                }
            }
        }
    }

    /// Works out the ways between all places; where there is none over straight lines, the voxels of one are put in, step by step.
    fn connect(&mut self) {
        loop {
            let centers: Vec<Point3<f64>> = self.places.iter().map(|voxel| self.center(*voxel)).collect();
            self.graph = Graph::of(&centers, |a, b| self.is_clear(a, b));
            let cut_off = (0..self.places.len()).find(|place| self.graph.length_m(0, *place).is_infinite());
            let Some(cut_off) = cut_off else { return };
            let way = self.steps(self.places[0], self.places[cut_off]);
            let new: Vec<Voxel> = way.into_iter().filter(|voxel| !self.places.contains(voxel)).collect();
            if new.is_empty() {
                return;
            }
            new.into_iter().for_each(|voxel| self.add(voxel));
        }
    }

    /// The fewest steps through faces from one place to another: between such neighbours there is no surface.
    fn steps(&self, from: Voxel, to: Voxel) -> Vec<Voxel> {
        let mut before = BTreeMap::from([(from, from)]);
        let mut open = VecDeque::from([from]);
        while let Some(voxel) = open.pop_front().filter(|_| !before.contains_key(&to)) {
            for next in voxel.face_neighbours().into_iter().filter(|next| self.truth.stands().contains(*next)) {
                if let Entry::Vacant(new) = before.entry(next) {
                    new.insert(voxel);
                    open.push_back(next);
                }
            }
        }
        std::iter::successors(before.get(&to).copied(), |voxel| before.get(voxel).copied().filter(|_| *voxel != from))
            .collect()
    }

    /// Whether the robot can go straight from one place to the other.
    fn is_clear(&self, one: Point3<f64>, other: Point3<f64>) -> bool {
        !self.world.touches(one, other, self.truth.passage_m())
    }
}

/// Places all over where the robot can be: as many as can be afforded.
fn lattice(truth: &Truth) -> Vec<Voxel> {
    let on_lattice = |stride: i32| {
        let is_on = move |voxel: &Voxel| voxel.to_array().iter().all(|index| index.rem_euclid(stride) == 0);
        truth.stands().iter().filter(is_on).collect::<Vec<_>>()
    };
    (1..).map(on_lattice).find(|places| places.len() <= MOST_PLACES).unwrap_or_default()
}

/// Directions all around, `spacing` (rad) apart.
fn directions(spacing: f64) -> Vec<Vector3<f64>> {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};
    let rings = (PI / spacing).ceil() as usize;
    let ring = |k: usize| {
        let elevation = (k as f64 + 0.5) * PI / rings as f64 - FRAC_PI_2;
        let count = (TAU * elevation.cos() / spacing).ceil().max(1.0) as usize;
        (0..count).map(move |n| {
            let heading = TAU * n as f64 / count as f64;
            let level = elevation.cos();
            Vector3::new(level * heading.cos(), level * heading.sin(), elevation.sin())
        })
    };
    (0..rings).flat_map(ring).collect()
}

/// The shortest ways between places over straight lines from place to place.
#[derive(Default)]
struct Graph {
    /// Length of the way from place to place (m), infinite where there is none.
    lengths: Vec<f64>,
    /// The place to go to first.
    next: Vec<usize>,
    count: usize,
}

impl Graph {
    /// Floyd and Warshall's.
    fn of(places: &[Point3<f64>], is_clear: impl Fn(Point3<f64>, Point3<f64>) -> bool) -> Self {
        let count = places.len();
        let mut graph = Self { lengths: vec![f64::INFINITY; count * count], next: vec![0; count * count], count };
        for a in 0..count {
            graph.set(a, a, 0.0, a);
            for b in 0..a {
                if is_clear(places[a], places[b]) {
                    let length = (places[a] - places[b]).norm();
                    graph.set(a, b, length, b);
                    graph.set(b, a, length, a);
                }
            }
        }
        for by in 0..count {
            for a in 0..count {
                let there = graph.length_m(a, by);
                for b in 0..if there.is_finite() { count } else { 0 } {
                    let length = there + graph.length_m(by, b);
                    if length < graph.length_m(a, b) - LEAST_M {
                        let next = graph.next[a * count + by];
                        graph.set(a, b, length, next);
                    }
                }
            }
        }
        graph
    }

    fn set(&mut self, a: usize, b: usize, length: f64, next: usize) {
        (self.lengths[a * self.count + b], self.next[a * self.count + b]) = (length, next);
    }

    fn length_m(&self, a: usize, b: usize) -> f64 {
        self.lengths[a * self.count + b]
    }
}

/// Ways from one start: it is a place, too, after all others.
struct Ways<'a> {
    oracle: &'a Oracle<'a>,
    start: Point3<f64>,
    shown: Cover,
    /// Length of the way from the start to each place (m), and the place to go to first.
    from_start: Vec<(f64, usize)>,
}

impl<'a> Ways<'a> {
    fn new(oracle: &'a Oracle<'a>, start: Point3<f64>) -> Self {
        let places: Vec<Point3<f64>> = oracle.places.iter().map(|voxel| oracle.center(*voxel)).collect();
        let first: Vec<usize> = (0..places.len()).filter(|place| oracle.is_clear(start, places[*place])).collect();
        let to = |place: usize| {
            let by = first
                .iter()
                .map(|first| ((places[*first] - start).norm() + oracle.graph.length_m(*first, place), *first));
            by.min_by(|one, other| one.0.total_cmp(&other.0)).unwrap_or((f64::INFINITY, place))
        };
        Self { oracle, start, shown: oracle.look(start), from_start: (0..places.len()).map(to).collect() }
    }

    /// The number that the start has as a place.
    fn home(&self) -> usize {
        self.oracle.places.len()
    }

    fn position(&self, place: usize) -> Point3<f64> {
        self.oracle.places.get(place).map_or(self.start, |voxel| self.oracle.center(*voxel))
    }

    fn shown(&self, place: usize) -> &Cover {
        self.oracle.shown.get(place).unwrap_or(&self.shown)
    }

    fn distance(&self, a: usize, b: usize) -> f64 {
        match (a == self.home(), b == self.home()) {
            (true, true) => 0.0,
            (true, false) => self.from_start[b].0,
            (false, true) => self.from_start[a].0,
            (false, false) => self.oracle.graph.length_m(a, b),
        }
    }

    fn length_m(&self, stops: &[usize]) -> f64 {
        let from = std::iter::once(self.home()).chain(stops.iter().copied());
        from.zip(stops).map(|(from, to)| self.distance(from, *to)).sum()
    }

    /// All places on the way past `stops`, the start first.
    fn passed(&self, stops: &[usize]) -> Vec<usize> {
        let mut passed = vec![self.home()];
        let mut here = self.home();
        for stop in stops {
            while here != *stop {
                here = match here == self.home() {
                    true => self.from_start[*stop].1,
                    false => self.oracle.graph.next[here * self.oracle.graph.count + stop],
                };
                passed.push(here);
            }
        }
        passed
    }

    fn seen(&self, places: &[usize]) -> Cover {
        let mut seen = Cover::none(&self.oracle.wanted);
        places.iter().for_each(|place| seen.add(self.shown(*place)));
        seen
    }

    /// How much longer the way past `stops` is with a place before stop `at` of it.
    fn detour_m(&self, stops: &[usize], at: usize, place: usize) -> f64 {
        let before = at.checked_sub(1).map_or(self.home(), |before| stops[before]);
        let after = |from: usize| stops.get(at).map_or(0.0, |after| self.distance(from, *after));
        self.distance(before, place) + after(place) - after(before)
    }

    /// Stops from which enough is seen: one after the other that which shows most for its detour. `None`: there are not enough.
    fn chosen(&self, reluctance_m: f64) -> Option<Vec<usize>> {
        let mut seen = self.shown.clone();
        let mut stops: Vec<usize> = Vec::new();
        let count = self.oracle.places.len();
        let mut gains: Vec<usize> = (0..count).map(|place| seen.gain(self.shown(place))).collect();
        while seen.gain(&self.oracle.all) > 0 {
            let cheapest = |place: usize| {
                let at = (0..=stops.len()).map(|at| (self.detour_m(&stops, at, place), at));
                at.min_by(|one, other| one.0.total_cmp(&other.0)).unwrap_or((f64::INFINITY, 0))
            };
            let insertions: Vec<(f64, usize)> = (0..count).map(cheapest).collect();
            let worth = |place: usize, gains: &[usize]| gains[place] as f64 / (reluctance_m + insertions[place].0);
            // What a place adds can only have become less since it was asked.
            let mut fresh = vec![false; count];
            let place = loop {
                let best = (0..count).rev().max_by(|a, b| worth(*a, &gains).total_cmp(&worth(*b, &gains)))?;
                if std::mem::replace(&mut fresh[best], true) {
                    break best;
                }
                gains[best] = seen.gain(self.shown(best));
            };
            if gains[place] == 0 || insertions[place].0.is_infinite() {
                return None;
            }
            stops.insert(insertions[place].1, place);
            seen.add(self.shown(place));
        }
        Some(stops)
    }

    /// The same tour, shorter.
    fn shortened(&self, mut stops: Vec<usize>) -> Vec<usize> {
        for _ in 0..ROUNDS {
            let before = self.length_m(&stops);
            while shorten(self.home(), &mut stops, |stop| *stop, |a, b| self.distance(a, b)) {}
            self.leave_out(&mut stops);
            if self.length_m(&stops) > before - LEAST_M {
                break;
            }
        }
        stops
    }

    /// Leaves out each stop that is not needed, and moves the others to where the way is shortest.
    fn leave_out(&self, stops: &mut Vec<usize>) {
        let mut k = 0;
        while k < stops.len() {
            let stop = stops.remove(k);
            let others = self.seen(&self.passed(stops));
            if others.gain(&self.oracle.all) == 0 {
                continue;
            }
            let now = self.detour_m(stops, k, stop);
            let mut places: Vec<(f64, usize)> =
                (0..self.home()).map(|place| (self.detour_m(stops, k, place), place)).collect();
            places.retain(|(detour, _)| *detour < now - LEAST_M);
            places.sort_by(|one, other| one.0.total_cmp(&other.0));
            let better = places.iter().find(|(_, place)| {
                let mut with = others.clone();
                with.add(self.shown(*place));
                with.gain(&self.oracle.all) == 0
            });
            stops.insert(k, better.map_or(stop, |(_, place)| *place));
            k += 1;
        }
    }
}
