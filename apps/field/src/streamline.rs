//! Streamlines of −∇ψ (thesis 6.4.2): the ways on which a drop of water would flow from the source to a sink.

use std::collections::HashMap;
use std::hash::BuildHasherDefault;

use elk_geometry::bricks::BrickHasher;
use elk_geometry::ray::Traversal;
use elk_geometry::{Region, Voxel};
use nalgebra::{Point3, Vector3};

use crate::domain::Domain;
use crate::patch::{EDGE, FACES, Patch, place};
use crate::problem::Cell;

/// Length of an integration step (m).
const STEP_M: f64 = 0.05;
/// A streamline stalls that moves less than [`STALL_M`] in this many steps.
const STALL_STEPS: usize = 16;
const STALL_M: f64 = 0.12;
/// A gradient (1/m) below which there is no direction.
const FLAT: f64 = 1e-13;

/// The field of a domain that is solved, for streamlines. What it has looked at of the domain it keeps at hand.
#[derive(Debug, Clone)]
pub struct Field<'a> {
    domain: &'a Domain,
    resolution: f64,
    patches: HashMap<Voxel, Box<Patch>, BuildHasherDefault<BrickHasher>>,
}

/// How a streamline ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Termination {
    /// In this goal voxel.
    Goal(Voxel),
    /// In this voxel: the field is flat, it went round in circles, or it left the domain.
    Stalled(Voxel),
    /// It was longer than was asked for, or than another one that had arrived.
    TooLong,
}

/// A streamline, as far as it was traced.
#[derive(Debug, Clone, PartialEq)]
pub struct Streamline {
    /// Its points (m, world).
    pub points: Vec<Point3<f64>>,
    /// Their way (m).
    pub length: f64,
    /// How it ended.
    pub end: Termination,
}

impl<'a> Field<'a> {
    /// The field of a domain with voxels of `resolution` (m), as its last solution has it.
    pub fn of(domain: &'a Domain, resolution: f64) -> Self {
        Self { domain, resolution, patches: HashMap::default() }
    }

    /// What a voxel is.
    pub fn cell(&self, voxel: Voxel) -> Cell {
        self.domain.cell(voxel)
    }

    /// ψ of a voxel; 0 outside.
    pub fn psi(&self, voxel: Voxel) -> f32 {
        self.domain.psi(voxel)
    }

    /// The patch that a voxel is in, and its index there.
    fn patch(&mut self, voxel: Voxel) -> (&Patch, usize) {
        let (position, index) = place(voxel);
        (self.patches.entry(position).or_insert_with(|| Patch::of(self.domain, position).into()), index)
    }

    fn voxel(&self, point: Point3<f64>) -> Voxel {
        Voxel::containing(point, self.resolution)
    }

    /// ∇ψ at a point (m, world; 1/m), interpolated linearly along each axis (6.31 in three dimensions) between the nodes
    /// where differences of ψ live: the faces between voxels. Through a face to the outside the gradient is zero, as the
    /// field has it, so that streamlines run along walls and not into them. `None` where the point is not in the domain.
    pub fn gradient(&mut self, point: Point3<f64>) -> Option<Vector3<f64>> {
        let resolution = self.resolution;
        let (patch, own) = self.patch(self.voxel(point));
        if patch.cell(own) == Cell::Outside {
            return None;
        }
        let local = point.coords / resolution;
        let within = local - local.map(f64::floor);
        let slope = |axis| slope(patch, own, within, axis) / resolution;
        Some(Vector3::new(slope(0), slope(1), slope(2)))
    }

    /// The direction of flow at a point: down the gradient, of length one, so that a step is a length of way.
    fn flow(&mut self, point: Point3<f64>) -> Option<Vector3<f64>> {
        (-self.gradient(point)?).try_normalize(FLAT)
    }

    /// One step of the fourth-order Runge-Kutta method (6.35 to 6.40), `h` inside each `k`; `flow` is the direction at `p`.
    fn step(&mut self, p: Point3<f64>, flow: Vector3<f64>, h: f64) -> Option<Point3<f64>> {
        let k1 = h * flow;
        let k2 = h * self.flow(p + 0.5 * k1)?;
        let k3 = h * self.flow(p + 0.5 * k2)?;
        let k4 = h * self.flow(p + k3)?;
        Some(p + (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0)
    }

    /// The next point of a streamline: a step on, or where a whole one would leave the domain, a shorter one.
    fn advance(&mut self, at: Point3<f64>) -> Option<Point3<f64>> {
        let flow = self.flow(at)?;
        [1.0, 0.5, 0.25, 0.125].into_iter().find_map(|share| {
            let next = self.step(at, flow, STEP_M * share)?;
            self.connected(at, next).then_some(next)
        })
    }

    /// Whether the straight line between two points of the domain stays in it.
    pub fn connected(&mut self, from: Point3<f64>, to: Point3<f64>) -> bool {
        Traversal::new(from, to, self.resolution).all(|voxel| {
            let (patch, index) = self.patch(voxel);
            patch.cell(index) != Cell::Outside
        })
    }

    /// The streamlines that lead from `from` straight to each of `seeds` (m, world) and flow on from there, none longer than
    /// `longest` (m). They advance side by side, so that one is given up as soon as it is longer than another that has arrived;
    /// what is not given up is what it would be alone, to the bit.
    pub fn trace(&mut self, from: Point3<f64>, seeds: &[Point3<f64>], longest: f64) -> Vec<Streamline> {
        let begin = |seed: &Point3<f64>| {
            let (points, length) = (vec![from, *seed], (*seed - from).norm());
            Streamline { points, length, end: Termination::TooLong }
        };
        let mut lines: Vec<Streamline> = seeds.iter().map(begin).collect();
        let mut under_way: Vec<usize> = (0..lines.len()).collect();
        let mut limit = longest;
        while !under_way.is_empty() {
            under_way.retain(|n| {
                let line = &mut lines[*n];
                let too_long = line.length > limit;
                let end = if too_long { Some(Termination::TooLong) } else { self.advance_line(line) };
                line.end = end.unwrap_or(line.end);
                if let Some(Termination::Goal(_)) = end {
                    limit = limit.min(line.length);
                }
                end.is_none()
            });
        }
        lines
    }

    /// Adds the next point to a streamline, or says how it ends.
    fn advance_line(&mut self, line: &mut Streamline) -> Option<Termination> {
        let points = &mut line.points;
        let at = *points.last()?;
        let voxel = self.voxel(at);
        if self.cell(voxel) == Cell::Sink {
            return Some(Termination::Goal(voxel));
        }
        // The first point does not lie on the streamline.
        let before = points[1..].iter().rev().nth(STALL_STEPS);
        let is_circling = before.is_some_and(|before| (at - before).norm() < STALL_M);
        let Some(next) = self.advance(at).filter(|_| !is_circling) else {
            return Some(Termination::Stalled(voxel));
        };
        line.length += (next - at).norm();
        points.push(next);
        None
    }

    /// From voxel to voxel down ψ, steepest first and without cutting a corner, until a goal (`Ok`) or a voxel that has
    /// no lower neighbour (`Err`). On an exact solution there is none: ψ has no minimum inside (maximum principle).
    pub fn descend(&mut self, from: Voxel) -> Result<Vec<Voxel>, Vec<Voxel>> {
        let around = Region::new(Voxel::new(0, 0, 0), [EDGE; 3], self.resolution);
        let mut way = vec![from];
        let mut at = from;
        while self.cell(at) != Cell::Sink {
            match self.steepest(at, &around) {
                Some(next) => at = next,
                None => return Err(way),
            }
            way.push(at);
        }
        Ok(way)
    }

    /// The neighbour that ψ falls to most steeply; `around` numbers voxels as a patch does.
    fn steepest(&mut self, voxel: Voxel, around: &Region) -> Option<Voxel> {
        let (patch, at) = self.patch(voxel);
        let outside = |d: &isize| patch.cell(at.wrapping_add_signed(*d)) == Cell::Outside;
        let mut best = (0.0, None);
        for m in around.moves() {
            let slope = -patch.rise(at, m.offset) / m.length;
            if !outside(&m.offset) && slope > best.0 && !m.between.iter().any(outside) {
                best = (slope, Some(m.offset));
            }
        }
        let next = around.voxel(at.wrapping_add_signed(best.1?));
        Some(voxel + (next - around.voxel(at)))
    }
}

/// The component of ∇ψ (1/voxel) along `axis` at `within` (0 to 1) of voxel `own`: along the axis between the voxel's two
/// faces, across it between the columns of voxels nearest to the point that are in the domain.
fn slope(patch: &Patch, own: usize, within: Vector3<f64>, axis: usize) -> f64 {
    let nearest = |a: usize| {
        let off = within[a] - 0.5;
        (FACES[2 * a + usize::from(off > 0.0)], off.abs())
    };
    let ((b, share_b), (c, share_c)) = (nearest((axis + 1) % 3), nearest((axis + 2) % 3));
    let columns = [
        (0, (1.0 - share_b) * (1.0 - share_c)),
        (b, share_b * (1.0 - share_c)),
        (c, (1.0 - share_b) * share_c),
        (b + c, share_b * share_c),
    ];
    let (mut sum, mut total) = (0.0, 0.0);
    for (offset, weight) in columns {
        let column = own.wrapping_add_signed(offset);
        if patch.cell(column) != Cell::Outside {
            let (low, high) = (-patch.rise(column, FACES[2 * axis]), patch.rise(column, FACES[2 * axis + 1]));
            sum += weight * (low + (high - low) * within[axis]);
            total += weight;
        }
    }
    sum / total
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Edge of a voxel (m).
    const RESOLUTION: f64 = 0.1;

    /// A free box from the origin on, with a robot and goals, solved.
    fn solved(size: Voxel, robot: Voxel, goals: impl Fn(Voxel) -> bool, wall: impl Fn(Voxel) -> bool) -> Domain {
        let mut domain = Domain::new();
        let voxels = (0..size.z).flat_map(|z| (0..size.y).flat_map(move |y| (0..size.x).map(move |x| (x, y, z))));
        for v in voxels.map(|(x, y, z)| Voxel::new(x, y, z)).filter(|v| !wall(*v)) {
            let cell = if goals(v) { Cell::Sink } else { Cell::Inside };
            domain.set(v, if v == robot { Cell::Source } else { cell });
        }
        domain.solve(1e-6, || false);
        domain
    }

    #[test]
    fn around_a_corner_it_flows_to_the_goal_and_stays_inside() {
        let size = Voxel::new(30, 30, 5);
        let wall = |v: Voxel| v.x == 15 && v.y < 25;
        let goal = |v: Voxel| v.x == 29 && v.y < 3;
        let robot = Voxel::new(3, 3, 2);
        let domain = solved(size, robot, goal, wall);
        let mut field = Field::of(&domain, RESOLUTION);
        let (from, seed) = (robot.center(RESOLUTION), Voxel::new(4, 3, 2));
        let line = field.trace(from, &[seed.center(RESOLUTION)], 100.0).remove(0);
        assert!(matches!(line.end, Termination::Goal(voxel) if goal(voxel)), "{:?}", line.end);
        for pair in line.points.windows(2) {
            assert!(field.connected(pair[0], pair[1]));
        }
        assert!(line.points.windows(2).skip(1).all(|pair| (pair[1] - pair[0]).norm() <= STEP_M + 1e-9));
        // Never shorter than the way around the wall's end, and no detour worth the name.
        assert!((5.0..7.5).contains(&line.length), "{}", line.length);
        let way = field.descend(seed).unwrap();
        assert!(goal(way[way.len() - 1]));
        assert_eq!(field.trace(from, &[seed.center(RESOLUTION)], 1.0)[0].end, Termination::TooLong);
    }

    #[test]
    fn without_a_slope_it_stalls() {
        let robot = Voxel::new(4, 4, 4);
        let mut flat = solved(Voxel::new(9, 9, 9), robot, |v| v.x == 8, |_| false);
        let region = Region::new(Voxel::new(0, 0, 0), [9, 9, 9], RESOLUTION);
        flat.take_psi(&region, &vec![0.5; region.len()]);
        let mut field = Field::of(&flat, RESOLUTION);
        let start = Voxel::new(2, 4, 4);
        let ends = field.trace(robot.center(RESOLUTION), &[start.center(RESOLUTION)], 100.0);
        assert_eq!(ends[0].end, Termination::Stalled(start));
        assert_eq!(field.descend(start), Err(vec![start]));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        /// Side by side, streamlines are what each is alone; only longer ones than the shortest are given up.
        #[test]
        fn many_at_once_are_what_each_is_alone(
            walls in prop::collection::btree_set((0..20i32, 0..17i32, 0..12i32), 0..200),
            goals in prop::collection::btree_set((0..20i32, 0..17i32, 0..12i32), 1..9),
        ) {
            let is = |set: &std::collections::BTreeSet<(i32, i32, i32)>, v: Voxel| set.contains(&(v.x, v.y, v.z));
            let robot = Voxel::new(10, 8, 6);
            let domain = solved(Voxel::new(20, 17, 12), robot, |v| is(&goals, v), |v| is(&walls, v) && v != robot);
            let mut field = Field::of(&domain, RESOLUTION);
            let from = robot.center(RESOLUTION);
            let seeds: Vec<Point3<f64>> =
                robot.neighbours().filter(|v| domain.cell(*v) != Cell::Outside).map(|v| v.center(RESOLUTION)).collect();
            let together = field.trace(from, &seeds, 100.0);
            let alone: Vec<Streamline> =
                seeds.iter().flat_map(|seed| Field::of(&domain, RESOLUTION).trace(from, &[*seed], 100.0)).collect();
            let arrived = |line: &&Streamline| matches!(line.end, Termination::Goal(_));
            let shortest = alone.iter().filter(arrived).map(|line| line.length).fold(100.0, f64::min);
            for (one, other) in together.iter().zip(&alone) {
                if one.end == Termination::TooLong {
                    prop_assert!(one.length > shortest && other.points.starts_with(&one.points));
                } else {
                    prop_assert_eq!(one, other);
                }
            }
            prop_assert_eq!(together.iter().filter(arrived).any(|line| line.length == shortest), shortest < 100.0);
        }
    }
}
