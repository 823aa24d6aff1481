//! Where a world is open: where rays from free places meet nothing, and where its surfaces end.

use std::collections::BTreeMap;

use elk_geometry::Bounds;
use nalgebra::{Point3, Vector3};

use crate::openness::{Hole, Openness};
use crate::topology::Rim;
use crate::triangle::bounds_of;
use crate::world::World;
use elk_geometry::random::Random;

/// Places that are looked from, and directions that are looked in from each.
const PLACES: usize = 64;
const DIRECTIONS: usize = 128;
/// Holes that are looked through from each place: the largest.
const HOLES: usize = 64;
/// Corners of its rim towards which a hole is looked through, and how far towards them.
const AIMS: usize = 8;
const TOWARDS_RIM: f64 = 0.9;
/// How far apart exits lie that are told, as a share of the world's diagonal.
const APART: f64 = 0.1;
/// Stream of random places.
const STREAM: u64 = 1;
/// A rim along which other surfaces come so near (share of the world's diagonal) is no end: the next surface goes on
/// there.
const SEAM: f64 = 1e-6;

impl World {
    /// How open it is; it is looked at once.
    pub fn openness(&self) -> &Openness {
        self.openness.get_or_init(|| openness(self))
    }
}

/// How open a world is, seen from places drawn from all that are free, always the same ones.
fn openness(world: &World) -> Openness {
    let mut random = Random::new(0, STREAM);
    let places: Vec<Point3<f64>> = world.free_places(0.0, &mut random).take(PLACES).collect();
    let mut openness =
        Openness { places: places.len(), holes: holes(world), digits: world.digits(), ..Openness::default() };
    let apart = world.extents().dim().norm() * APART;
    let directions: Vec<Vector3<f64>> = (0..DIRECTIONS).map(|i| direction(i, DIRECTIONS)).collect();
    let mut escaped = 0_usize;
    for &place in &places {
        for &direction in directions.iter().filter(|&&direction| world.cast(place, direction).is_none()) {
            escaped += 1;
            openness.remember(exit(place, direction, &world.extents()), apart);
        }
    }
    openness.escaping = escaped as f64 / (places.len() * DIRECTIONS).max(1) as f64;
    openness
        .holes
        .iter_mut()
        .filter(|hole| !is_line(hole))
        .take(HOLES)
        .for_each(|hole| hole.leads_out = leads_out(world, hole, &places));
    openness.holes.sort_by_key(|hole| !hole.leads_out);
    openness
}

/// Whether a hole's rim lies in one line: a wall's edge, with nothing to look through.
fn is_line(hole: &Hole) -> bool {
    let mut sizes = [hole.size.x, hole.size.y, hole.size.z];
    sizes.sort_by(f64::total_cmp);
    sizes[1] <= SEAM * sizes[2]
}

/// Whether a ray from one of the places gets out through a hole.
fn leads_out(world: &World, hole: &Hole, places: &[Point3<f64>]) -> bool {
    let gets_out = |from: Point3<f64>, aim: Point3<f64>| from != aim && world.cast(from, aim - from).is_none();
    hole.aims.iter().any(|&aim| places.iter().any(|&place| gets_out(place, aim)))
}

/// The `i`-th of `count` directions that are spread evenly (a Fibonacci lattice), of length 1.
pub(crate) fn direction(i: usize, count: usize) -> Vector3<f64> {
    const GOLDEN: f64 = 2.399_963_229_728_653;
    let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
    let (level, heading) = ((1.0 - z * z).sqrt(), GOLDEN * i as f64);
    Vector3::new(level * heading.cos(), level * heading.sin(), z)
}

/// Where a ray from within a box leaves it.
fn exit(origin: Point3<f64>, direction: Vector3<f64>, bounds: &Bounds) -> Point3<f64> {
    let along = |axis: usize| {
        let face = if direction[axis] > 0.0 { bounds.max[axis] } else { bounds.min[axis] };
        (face - origin[axis]) / direction[axis]
    };
    let t = (0..3).map(along).filter(|t| t.is_finite()).fold(f64::INFINITY, f64::min);
    if t.is_finite() { origin + direction * t } else { origin }
}

/// Where surfaces end, the largest first.
fn holes(world: &World) -> Vec<Hole> {
    let ends: Vec<&Rim> = world.rims().iter().filter(|rim| !is_seam(world, rim)).collect();
    let mut holes: Vec<Hole> = connected(&ends).iter().map(|rims| hole(rims)).collect();
    holes.sort_by(|a, b| b.size.norm().total_cmp(&a.size.norm()));
    holes
}

/// Whether another surface goes on all along a rim.
fn is_seam(world: &World, rim: &Rim) -> bool {
    let [from, to] = rim.ends;
    let reach = world.extents().dim().norm() * SEAM;
    let met = |share: f64| world.surfaces().is_met_by_another(from + (to - from) * share, reach, rim.triangle);
    [0.07, 0.31, 0.5, 0.73, 0.93].into_iter().all(met)
}

/// The rims that hang together over their ends.
fn connected<'a>(rims: &[&'a Rim]) -> Vec<Vec<&'a Rim>> {
    let mut at: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (i, rim) in rims.iter().enumerate() {
        rim.corners.iter().for_each(|corner| at.entry(*corner).or_default().push(i));
    }
    let mut seen = vec![false; rims.len()];
    let mut groups = Vec::new();
    for first in 0..rims.len() {
        let mut open = vec![first];
        let mut group = Vec::new();
        while let Some(i) = open.pop() {
            if !std::mem::replace(&mut seen[i], true) {
                group.push(rims[i]);
                open.extend(rims[i].corners.iter().flat_map(|corner| &at[corner]).filter(|&&next| !seen[next]));
            }
        }
        if !group.is_empty() {
            groups.push(group);
        }
    }
    groups
}

fn hole(rims: &[&Rim]) -> Hole {
    let around = bounds_of(rims.iter().flat_map(|rim| &rim.ends));
    let length = |rim: &Rim| (rim.ends[1] - rim.ends[0]).norm();
    let whole: f64 = rims.iter().map(|rim| length(rim)).sum();
    let moment = |rim: &Rim| (rim.ends[0] - around.min + (rim.ends[1] - around.min)) * (length(rim) / 2.0);
    let sum = rims.iter().map(|rim| moment(rim)).fold(Vector3::zeros(), |sum, one| sum + one);
    let middle = if whole > 0.0 { around.min + sum / whole } else { around.mid() };
    let ends = rims.iter().step_by(rims.len().div_ceil(AIMS)).map(|rim| rim.ends[0]);
    let aims = std::iter::once(middle).chain(ends.map(|end| middle + (end - middle) * TOWARDS_RIM)).collect();
    Hole { middle, size: around.dim(), edges: rims.len(), leads_out: false, aims }
}
