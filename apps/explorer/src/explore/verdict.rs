//! What a run came to: whether it is complete, and why it ended, for people.

use elk_geometry::voxel::{INDEX_RANGE, reach_m};
use elk_geometry::{Bounds, OccupancyGrid, State, Voxel};
use elk_spatial::messages::FrontiersLeft;
use nalgebra::Point3;

use super::scene::Scene;
use super::settings::Settings;

/// Why no further plan is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// There is no goal left.
    Explored,
    /// It took more scans than it may.
    TooManyScans,
    /// Nothing new is learned.
    NoProgress,
    /// There are goals, and no way to any.
    NoWay,
    /// The sensor refused to go where the map calls everything free, too often for a map that is a little wrong.
    Refused,
}

impl StopReason {
    /// Why a run that ended so has failed; `None`: it may be complete.
    fn failure(self, left: &FrontiersLeft, settings: &Settings) -> Option<String> {
        let Settings { max_scans, patience, .. } = settings;
        Some(match self {
            Self::Explored => return None,
            Self::TooManyScans => format!("more than {max_scans} scans (MaxScans)"),
            Self::NoProgress => format!("{patience} scans taught nothing new (Patience)"),
            Self::NoWay => format!(
                "no way was found to any place from which one of the {} frontier voxels that are left can be seen",
                left.open
            ),
            Self::Refused => format!(
                "{patience} motions were refused by the sensor (Patience): the map calls free what cannot be entered; if the \
                 world is open there, limit the volume to explore (Explorer.Mid, Dim)"
            ),
        })
    }
}

/// What that means.
pub struct Verdict {
    /// Whether every frontier that can be reached and seen is resolved, in a map that holds something.
    pub complete: bool,
    /// Why it ended.
    pub reason: String,
}

impl Verdict {
    /// Judges a run by how it ended, by the frontier that is left, and by the map.
    pub fn of(why: StopReason, left: &FrontiersLeft, scene: &Scene, grid: &OccupancyGrid, settings: &Settings) -> Self {
        let missed = || left_over(left, grid.resolution(), settings);
        let short = why.failure(left, settings).or_else(|| walled_in(scene, grid, left));
        let short = short.or_else(|| nothing_to_explore(scene.robot(), grid, settings.bounds)).or_else(missed);
        let short = short.or_else(|| not_closed(&given_up(left, settings), grid));
        short.map_or_else(|| Self::explored(left, settings), |reason| Self { complete: false, reason })
    }

    fn explored(left: &FrontiersLeft, settings: &Settings) -> Self {
        let mut reason = "every frontier that can be reached and seen is resolved".to_owned();
        if left.too_small > 0 {
            let (small, least) = (left.too_small, settings.min_frontier);
            reason += &format!(", but for {small} voxels in clusters of fewer than {least} (MinFrontier)");
        }
        Self { complete: true, reason }
    }
}

/// What is missing where the robot could go on, or the world does.
fn left_over(left: &FrontiersLeft, resolution: f64, settings: &Settings) -> Option<String> {
    let missed = left.unresolved + left.open;
    if left.no_return > 0 {
        return Some(format!(
            "behind {} frontier voxels the sensor sees nothing: the world is open there, or goes on beyond its range; limit the \
             volume to explore (Explorer.Mid, Dim), or let rays without a return free what they pass (Map.FreeNoReturn)",
            left.no_return
        ));
    }
    if missed > 0 {
        let places = settings.attempts;
        return Some(format!("{missed} frontier voxels were looked at from {places} places each, in vain"));
    }
    if left.no_room > 0 {
        let behind = left.no_room;
        return Some(format!(
            "the rest is explored, but the world goes on behind {behind} voxels where the map is full"
        ));
    }
    (left.map_edge > 0).then(|| {
        format!(
            "the rest is explored, but the world goes on behind {} voxels where the map ends, {}: move the world nearer to \
             the origin, or set a coarser Res",
            left.map_edge,
            reach(resolution)
        )
    })
}

/// Why a robot gets nowhere: it stands where the map has an obstacle, or more of the frontier is out of its reach than there are
/// voxels that it can be in.
fn walled_in(scene: &Scene, grid: &OccupancyGrid, left: &FrontiersLeft) -> Option<String> {
    let (robot, room) = (scene.robot(), scene.space.component.len());
    let place = shown(robot.center(grid.resolution()));
    let unreachable = left.unreachable;
    if grid.state(robot) == State::Occupied && unreachable > 0 {
        return Some(format!(
            "the robot at {place} m stands in what the map calls occupied, and {unreachable} frontier voxels are out of its \
             reach: is its start right for the map that it began with (Map.From)?"
        ));
    }
    (unreachable > room as u64).then(|| {
        format!(
            "the robot at {place} m is shut in: the map has {room} free voxels around it, and {unreachable} frontier voxels \
             beyond; is its start right, and the map that it began with (Map.From)?"
        )
    })
}

/// Why there was nothing to explore, if there was not: no frontier is left then, either.
fn nothing_to_explore(robot: Voxel, grid: &OccupancyGrid, bounds: Option<Bounds>) -> Option<String> {
    let resolution = grid.resolution();
    if grid.free() == 0 && !robot.is_mappable() {
        return Some(format!("the robot at {} m is outside the map", shown(robot.center(resolution))));
    }
    if grid.free() == 0 {
        return Some("nothing is known of the world".into());
    }
    let bounds = bounds.filter(|bounds| !free_in(grid, bounds))?;
    let (mid, dim) = (shown(bounds.mid()), shown(bounds.dim().into()));
    let known = grid.free() + grid.occupied();
    Some(format!(
        "of the volume to explore (Mid {mid}, Dim {dim} m) nothing was seen: none of the {known} voxels that are known is free \
         and lies in it; set Explorer.Mid and Explorer.Dim so that it is seen from the start, or Dim to 0; 0; 0 for everything"
    ))
}

/// The largest share of the boundary of what is free that a complete run may give up. Worlds without noise come to 0 to 3.5 %,
/// maps that take noise for surfaces to 7 % and more.
const MOST_GIVEN_UP: f64 = 0.05;

/// Why a map is not closed in which much of the boundary of what is free is no surface, but frontier that nobody can get to or
/// see.
fn not_closed(left: &FrontiersLeft, grid: &OccupancyGrid) -> Option<String> {
    let FrontiersLeft { unreachable, invisible, .. } = *left;
    let boundary = unreachable + invisible + grid.occupied() as u64;
    let share = (unreachable + invisible) as f64 / boundary.max(1) as f64;
    (share > MOST_GIVEN_UP).then(|| {
        format!(
            "the map is not closed: {unreachable} frontier voxels are out of reach and {invisible} cannot be seen into, {:.0} % of the \
             boundary of what is free; does the sensor say how much its depth errs (Map.DepthError), or is much of the world shut off \
             from where the robot can go (Explorer.Radius)?",
            100.0 * share
        )
    })
}

fn free_in(grid: &OccupancyGrid, bounds: &Bounds) -> bool {
    let free =
        |(voxel, state): (Voxel, State)| state == State::Free && bounds.contains(voxel.center(grid.resolution()));
    grid.bricks().voxels().any(free)
}

/// What of the frontier is given up: for a robot that stays in a slice of the map, what is within its reach there. Over a table
/// that it cannot pass it sees much.
fn given_up(left: &FrontiersLeft, settings: &Settings) -> FrontiersLeft {
    FrontiersLeft { unreachable: if settings.planar { 0 } else { left.unreachable }, ..*left }
}

/// Where a map of voxels of `resolution` (m) ends.
fn reach(resolution: f64) -> String {
    let voxels = INDEX_RANGE.end() + 1;
    format!("{voxels} voxels of {resolution} m ({} m) from the origin along each axis", shortest(reach_m(resolution)))
}

fn shown(p: Point3<f64>) -> String {
    format!("{}; {}; {}", shortest(p.x), shortest(p.y), shortest(p.z))
}

/// To the centimetre, and no more digits than that takes.
fn shortest(metres: f64) -> f64 {
    (metres * 100.0).round() / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(state: State) -> OccupancyGrid {
        let mut grid = OccupancyGrid::new(0.1);
        grid.set(Voxel::new(0, 0, 0), state);
        grid
    }

    /// Regression: a run that found no way to any goal was said to have lost its patience.
    #[test]
    fn each_stop_reason_is_said() {
        let settings = super::super::tests::settings(crate::Policy::elk(0.4));
        let left = FrontiersLeft { open: 7, ..FrontiersLeft::default() };
        let said = |why: StopReason| why.failure(&left, &settings).unwrap();
        assert_eq!(StopReason::Explored.failure(&left, &settings), None);
        assert!(
            said(StopReason::TooManyScans).contains("500 scans (MaxScans)")
                && said(StopReason::NoProgress).contains("50 scans")
        );
        assert!(said(StopReason::Refused).contains("50 motions"));
        let no_way = said(StopReason::NoWay);
        assert!(no_way.contains("no way") && no_way.contains("7 frontier voxels") && !no_way.contains("Patience"));
    }

    /// Regression: a run under noise ended as complete with 378 voxels out of reach and 7,939 that nobody could see into.
    #[test]
    fn a_map_whose_boundary_is_mostly_frontier_is_not_closed() {
        let mut grid = OccupancyGrid::new(0.1);
        for x in 0..100 {
            grid.set(Voxel::new(x, 0, 0), State::Occupied);
        }
        let left = |unreachable: u64, invisible: u64| {
            not_closed(&FrontiersLeft { unreachable, invisible, ..FrontiersLeft::default() }, &grid)
        };
        assert_eq!((left(0, 0), left(2, 3)), (None, None), "5 of 105");
        let said = left(2, 4).unwrap();
        assert!(said.contains("2 frontier voxels are out of reach and 4 cannot") && said.contains("6 % of"), "{said}");
        let nothing = FrontiersLeft::default();
        assert_eq!(not_closed(&nothing, &OccupancyGrid::new(0.1)), None);
    }

    #[test]
    fn a_volume_in_which_nothing_free_was_seen_was_not_explored() {
        let here = Voxel::new(0, 0, 0);
        let bounds = |x: f64| Some(Bounds { min: [x, -1.0, -1.0].into(), max: [x + 2.0, 1.0, 1.0].into() });
        assert_eq!(nothing_to_explore(here, &map(State::Free), None), None);
        assert_eq!(nothing_to_explore(here, &map(State::Free), bounds(-1.0)), None);
        let apart = nothing_to_explore(here, &map(State::Free), bounds(99.0)).unwrap();
        assert!(apart.contains("Mid 100; 0; 0, Dim 2; 2; 2 m") && apart.contains("none of the 1 voxels"), "{apart}");
        let walled = nothing_to_explore(here, &map(State::Occupied), None).unwrap();
        assert!(walled.starts_with("nothing is known"), "{walled}");
        let outside = nothing_to_explore(Voxel::new(40_000, 0, 0), &OccupancyGrid::new(0.1), None).unwrap();
        assert!(outside.contains("4000.05; 0.05; 0.05 m is outside the map"), "{outside}");
    }
}
