//! Streamlines of −∇ψ (thesis 6.4.2): the ways on which a drop of water would flow from the source to a sink.

use elk_geometry::Region;
use elk_geometry::ray::Traversal;
use nalgebra::{Point3, Vector3};

use crate::problem::{Cell, Problem};

/// Length of an integration step (m).
const STEP_M: f64 = 0.05;
/// A streamline stalls that moves less than [`STALL_M`] in this many steps.
const STALL_STEPS: usize = 16;
const STALL_M: f64 = 0.12;
/// A gradient (1/m) below which there is no direction.
const FLAT: f64 = 1e-13;

/// ψ on the voxels of a problem.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// The voxels, and what each is.
    pub problem: &'a Problem,
    /// ψ of each, as the problem's solution has it.
    pub psi: &'a [f32],
}

/// How a streamline ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Termination {
    /// In the goal voxel with this index.
    Goal(usize),
    /// In this voxel: the field is flat, it went round in circles, or it left the domain.
    Stalled(usize),
    /// It was longer than was asked for.
    TooLong,
}

impl<'a> Field<'a> {
    /// The voxels.
    fn region(&self) -> &'a Region {
        self.problem.region()
    }

    fn cell(&self, index: usize) -> Cell {
        self.problem.cells()[index]
    }

    /// ∇ψ at a point (m, world; 1/m), interpolated linearly along each axis (6.31 in three dimensions) between the nodes
    /// where differences of ψ live: the faces between voxels. Through a face to the outside the gradient is zero, as the
    /// field has it, so that streamlines run along walls and not into them. `None` where the point is not in the domain.
    pub fn gradient(&self, point: Point3<f64>) -> Option<Vector3<f64>> {
        let own = self.region().index_at(point).filter(|i| self.cell(*i) != Cell::Outside)?;
        let local = point.coords / self.region().resolution();
        let within = local - local.map(f64::floor);
        let faces = self.region().faces();
        Some(Vector3::new(
            self.slope(own, within, &faces, 0),
            self.slope(own, within, &faces, 1),
            self.slope(own, within, &faces, 2),
        ))
    }

    /// The component of ∇ψ along `axis` at `within` (0 to 1) of voxel `own`: along the axis between the voxel's two
    /// faces, across it between the columns of voxels nearest to the point that are in the domain.
    fn slope(&self, own: usize, within: Vector3<f64>, faces: &[isize; 6], axis: usize) -> f64 {
        let nearest = |a: usize| {
            let off = within[a] - 0.5;
            (faces[2 * a + usize::from(off > 0.0)], off.abs())
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
            if self.cell(column) != Cell::Outside {
                let (low, high) = (-self.rise(column, faces[2 * axis]), self.rise(column, faces[2 * axis + 1]));
                sum += weight * (low + (high - low) * within[axis]);
                total += weight;
            }
        }
        sum / total / self.region().resolution()
    }

    /// How much higher ψ is in the neighbour at `offset`; 0 if that is outside.
    fn rise(&self, index: usize, offset: isize) -> f64 {
        let n = index.wrapping_add_signed(offset);
        if self.cell(n) == Cell::Outside { 0.0 } else { f64::from(self.psi[n] - self.psi[index]) }
    }

    /// The direction of flow at a point: down the gradient, of length one, so that a step is a length of way.
    fn flow(&self, point: Point3<f64>) -> Option<Vector3<f64>> {
        (-self.gradient(point)?).try_normalize(FLAT)
    }

    /// One step of the fourth-order Runge-Kutta method (6.35 to 6.40), `h` inside each `k`.
    fn step(&self, p: Point3<f64>, h: f64) -> Option<Point3<f64>> {
        let k1 = h * self.flow(p)?;
        let k2 = h * self.flow(p + 0.5 * k1)?;
        let k3 = h * self.flow(p + 0.5 * k2)?;
        let k4 = h * self.flow(p + k3)?;
        Some(p + (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0)
    }

    /// The next point of a streamline: a step on, or where a whole one would leave the domain, a shorter one.
    fn advance(&self, at: Point3<f64>) -> Option<Point3<f64>> {
        let step = |share: f64| self.step(at, STEP_M * share).filter(|p| self.connected(at, *p));
        [1.0, 0.5, 0.25, 0.125].into_iter().find_map(step)
    }

    /// Whether the straight line between two points of the domain stays in it.
    pub fn connected(&self, from: Point3<f64>, to: Point3<f64>) -> bool {
        Traversal::new(from, to, self.region().resolution()).all(|v| {
            let index = self.region().index(v);
            index.is_some_and(|i| self.cell(i) != Cell::Outside)
        })
    }

    /// The streamline through `seed` (m, world), `seed` first, no longer than `longest` (m).
    pub fn trace(&self, seed: Point3<f64>, longest: f64) -> (Vec<Point3<f64>>, Termination) {
        let mut points = vec![seed];
        let mut at = seed;
        while points.len() as f64 * STEP_M <= longest + STEP_M {
            let Some(index) = self.region().index_at(at) else {
                break;
            };
            if self.cell(index) == Cell::Sink {
                return (points, Termination::Goal(index));
            }
            let next = self.advance(at);
            let circling = points.len() > STALL_STEPS && (at - points[points.len() - 1 - STALL_STEPS]).norm() < STALL_M;
            match next {
                Some(p) if !circling => at = p,
                _ => return (points, Termination::Stalled(index)),
            }
            points.push(at);
        }
        (points, Termination::TooLong)
    }

    /// From voxel to voxel down ψ, steepest first and without cutting a corner, until a goal (`Ok`) or a voxel that has
    /// no lower neighbour (`Err`). On an exact solution there is none: ψ has no minimum inside (maximum principle).
    pub fn descend(&self, from: usize) -> Result<Vec<usize>, Vec<usize>> {
        let mut way = vec![from];
        let mut at = from;
        while self.cell(at) != Cell::Sink {
            match self.steepest(at) {
                Some(next) => at = next,
                None => return Err(way),
            }
            way.push(at);
        }
        Ok(way)
    }

    fn steepest(&self, at: usize) -> Option<usize> {
        let outside = |d: &isize| self.cell(at.wrapping_add_signed(*d)) == Cell::Outside;
        let mut best = (0.0, None);
        for m in self.region().moves() {
            let n = at.wrapping_add_signed(m.offset);
            let slope = f64::from(self.psi[at] - self.psi[n]) / m.length;
            if !outside(&m.offset) && slope > best.0 && !m.between.iter().any(outside) {
                best = (slope, Some(n));
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laplace::{Solver, solve};
    use elk_geometry::{OccupancyGrid, State, Volume, Voxel};

    /// A free box, its problem with the robot and the goals given, and the solution.
    fn field(
        size: Voxel,
        robot: Voxel,
        goals: impl Fn(Voxel) -> bool,
        wall: impl Fn(Voxel) -> bool,
    ) -> (Volume, Problem, Vec<f32>) {
        let mut grid = OccupancyGrid::new(0.1);
        for x in 0..size.x {
            for y in 0..size.y {
                for z in 0..size.z {
                    let v = Voxel::new(x, y, z);
                    grid.set(v, if wall(v) { State::Occupied } else { State::Free });
                }
            }
        }
        let volume = Volume::of(&grid, robot, 2);
        let cells = (0..volume.len())
            .map(|i| match volume.states()[i] {
                State::Free if volume.voxel(i) == robot => Cell::Source,
                State::Free if goals(volume.voxel(i)) => Cell::Sink,
                State::Free => Cell::Inside,
                _ => Cell::Outside,
            })
            .collect();
        let problem = Problem::new(volume.region().clone(), cells).unwrap();
        let psi = solve(&problem, Solver::Multigrid, 1e-6).psi;
        (volume, problem, psi)
    }

    #[test]
    fn around_a_corner_it_flows_to_the_goal_and_stays_inside() {
        let size = Voxel::new(30, 30, 5);
        let wall = |v: Voxel| v.x == 15 && v.y < 25;
        let goal = |v: Voxel| v.x == 29 && v.y < 3;
        let (volume, problem, psi) = field(size, Voxel::new(3, 3, 2), goal, wall);
        let field = Field { problem: &problem, psi: &psi };
        let seed = Voxel::new(4, 3, 2).center(0.1);
        let (points, termination) = field.trace(seed, 100.0);
        let Termination::Goal(goal_index) = termination else { panic!("{termination:?}") };
        assert!(goal(volume.voxel(goal_index)));
        for pair in points.windows(2) {
            assert!(field.connected(pair[0], pair[1]));
            assert!((pair[1] - pair[0]).norm() <= STEP_M + 1e-9);
        }
        // Never shorter than the way around the wall's end, and no detour worth the name.
        let length = (points.len() - 1) as f64 * STEP_M;
        assert!((5.0..7.5).contains(&length), "{length}");
        let way = field.descend(volume.index(Voxel::new(4, 3, 2)).unwrap()).unwrap();
        assert!(goal(volume.voxel(way[way.len() - 1])));
        assert_eq!(field.trace(seed, 1.0).1, Termination::TooLong);
    }

    #[test]
    fn without_a_slope_it_stalls() {
        let (volume, problem, psi) = field(Voxel::new(9, 9, 9), Voxel::new(4, 4, 4), |v| v.x == 8, |_| false);
        let flat = vec![0.5; psi.len()];
        let field = Field { problem: &problem, psi: &flat };
        let start = Voxel::new(2, 4, 4);
        let index = volume.index(start).unwrap();
        assert_eq!(field.trace(start.center(0.1), 100.0).1, Termination::Stalled(index));
        assert_eq!(field.descend(index), Err(vec![index]));
    }
}
