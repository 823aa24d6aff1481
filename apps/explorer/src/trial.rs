//! A made-up room to try a strategy in, without a bus, a world or a robot.

use elk_geometry::clearance::Clearance;
use elk_geometry::frontier::Faces;
use elk_geometry::{OccupancyGrid, State, Voxel};
use elk_spatial::CameraInfo;
use nalgebra::Point3;

use crate::goals::Goals;
use crate::journal::Journal;
use crate::sight::Sight;
use crate::space::Space;
use crate::strategy::{Strategy, View};
use crate::target::Target;

/// Edge of the room's voxels, and radius of its robot (m).
const EDGE_M: f64 = 0.1;

/// A room of free air between walls, with a robot and goals in it, around each of which something is to be seen.
///
/// ```
/// use elk_explorer::{ClosestFrontier, Room};
///
/// let room = Room::new([4.0, 3.0, 2.5], [1.0, 1.0, 1.0], &[[3.0, 2.0, 1.0], [1.5, 1.0, 1.0]]);
/// assert_eq!(room.choice(&mut ClosestFrontier), Some(1));
/// ```
pub struct Room {
    space: Space,
    goals: Goals,
    robot: Point3<f64>,
    places: Vec<Voxel>,
}

impl Room {
    /// A room from the origin to `size` along x, y and z, with a robot and goals in it (m, world). A goal is to be
    /// 0.2 m away from walls at least, as the robot is; one that is not is no goal.
    pub fn new(size: [f64; 3], robot: [f64; 3], goals: &[[f64; 3]]) -> Self {
        let grid = grid(size);
        let voxel = |place: &[f64; 3]| Voxel::containing(Point3::from(*place), EDGE_M);
        // A radius of one voxel is affordable.
        let clearance = Clearance::new(EDGE_M, EDGE_M).unwrap_or_default();
        let space = Space::around(&grid, voxel(&robot), &clearance, (&[], &[]));
        let places: Vec<Voxel> = goals.iter().map(voxel).collect();
        let target = |voxel: &Voxel| Target { voxel: *voxel, faces: Faces::ALL, tried: Vec::new() };
        let targets: Vec<Target> = places.iter().map(target).collect();
        let goals = Goals::near(&space, f64::INFINITY, &targets);
        Self { space, goals, robot: robot.into(), places }
    }

    /// What a strategy sees there.
    pub fn view(&self) -> View<'_> {
        self.view_at(1)
    }

    fn view_at(&self, plan: u64) -> View<'_> {
        let (space, goals, open) = (&self.space, &self.goals, &[]);
        View { space, from: self.robot, goals, open, changed: None, sight: sight(), plan }
    }

    /// Which of the goals, by their place in the list that the room was made with, a strategy goes to.
    pub fn choice(&self, strategy: &mut dyn Strategy) -> Option<usize> {
        self.at_plan(1, strategy)
    }

    /// The same at the plan of this number.
    pub fn at_plan(&self, plan: u64, strategy: &mut dyn Strategy) -> Option<usize> {
        let route = strategy.plan(&self.view_at(plan), &mut Journal::new(|| 0.0))?;
        self.places.iter().position(|place| *place == route.goal)
    }
}

/// What the camera of most missions sees.
fn sight() -> Sight {
    let fov = 75f64.to_radians();
    Sight::of(&CameraInfo { fov_x: fov, fov_y: fov, range_m: 30.0, ..CameraInfo::default() }, EDGE_M)
}

fn grid(size: [f64; 3]) -> OccupancyGrid {
    let [nx, ny, nz] = size.map(|edge| (edge / EDGE_M).round() as i32);
    let mut grid = OccupancyGrid::new(EDGE_M);
    for x in -1..=nx {
        for y in -1..=ny {
            for z in -1..=nz {
                let inside = (0..nx).contains(&x) && (0..ny).contains(&y) && (0..nz).contains(&z);
                grid.set(Voxel::new(x, y, z), if inside { State::Free } else { State::Occupied });
            }
        }
    }
    grid
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::Route;

    /// As `examples/level.rs` has it.
    struct Level {
        climb: f64,
    }

    impl Strategy for Level {
        fn plan(&mut self, view: &View<'_>, journal: &mut Journal) -> Option<Route> {
            view.cheapest(journal, |goal, way_m| way_m + self.climb * (goal.position.z - view.from.z).abs())
        }
    }

    #[test]
    fn goals_are_chosen_by_their_ways_and_whatever_else_counts() {
        let room = Room::new([4.0, 3.0, 2.5], [1.0, 1.0, 1.0], &[[1.0, 1.0, 2.0], [3.0, 1.0, 1.0], [9.0, 9.0, 9.0]]);
        assert_eq!(room.view().goals.len(), 2, "one lies outside");
        assert_eq!(room.choice(&mut Level { climb: 0.0 }), Some(0));
        assert_eq!(room.choice(&mut Level { climb: 3.0 }), Some(1));
        assert_eq!(Level { climb: 0.0 }.name(), "Level");
    }

    #[test]
    fn a_way_has_the_length_of_its_route() {
        let room = Room::new([4.0, 3.0, 2.5], [1.05, 1.05, 1.05], &[[3.05, 2.05, 1.05]]);
        let (view, ways) = (room.view(), room.view().ways());
        let goal = view.goals.iter().next().unwrap();
        // Ten diagonal steps and ten straight ones.
        let length = 0.1 * (10.0 * 2f64.sqrt() + 10.0);
        assert!((ways.length_m(goal).unwrap() - length).abs() < 1e-9);
        let route = ways.route(goal).unwrap();
        let points: f64 = route.points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        assert!((points - length).abs() < 1e-9 && route.goal == goal.voxel);
    }

    #[test]
    fn where_there_is_no_goal_there_is_no_way() {
        let room = Room::new([1.0, 1.0, 1.0], [0.5, 0.5, 0.5], &[]);
        assert_eq!(room.choice(&mut Level { climb: 1.0 }), None);
    }
}
