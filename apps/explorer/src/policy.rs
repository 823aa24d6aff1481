//! What is made of a strategy's route: how far it is followed, and where scans are taken. One for all strategies.
//!
//! The rules decide path lengths more than the strategies do, so they are named, the same for all, and printed with
//! every result. `thesis` is its letter (6.5.1): follow the path to its end, looking along it. `elk` stops where the
//! target's unknown side is in sight, cuts bends that nothing asks for, and looks at the target on the way.

use elk_geometry::ray::Traversal;
use elk_geometry::{Polyline, Pose, Voxel};
use elk_spatial::messages::MotionPolicy;
use nalgebra::{Point3, Vector3};

use crate::space::Space;
use crate::target::{Known, Target};

/// Length of way between two checks for line of sight (m).
const SIGHT_STEP_M: f64 = 0.05;
/// Frontier voxels this near the target share its first look (m).
const LOOK_RADIUS_M: f64 = 0.35;
/// Frontier this near counts when a look chooses its direction (m).
pub(crate) const LOOK_RANGE_M: f64 = 3.0;
/// How far the optical axis may turn away from the target to have more in view (rad), if that is in view still.
const TILTS: [f64; 2] = [15.0 * std::f64::consts::PI / 180.0, 28.0 * std::f64::consts::PI / 180.0];
/// Looks straight at single unknown voxels, after the first look.
const EXACT_LOOKS: usize = 4;

/// The rules of moving and scanning.
#[derive(Debug, Clone, PartialEq)]
pub struct Policy {
    /// `thesis` or `elk`.
    pub name: &'static str,
    /// Length of way between two scans (m).
    pub scan_spacing_m: f64,
    /// Ask for a new plan as soon as the target is resolved.
    pub early_stop: bool,
    /// Look at the target while travelling; otherwise along the motion.
    pub look_at_target: bool,
    /// Cut the path at the first point that sees the target's unknown side from at most so far (m).
    pub stop_at_sight_m: Option<f64>,
    /// Replace bends by straight lines where these keep the robot's clearance.
    pub straighten: bool,
}

impl Policy {
    /// The thesis' letter.
    pub fn thesis(scan_spacing_m: f64) -> Self {
        Self {
            name: "thesis",
            scan_spacing_m,
            early_stop: false,
            look_at_target: false,
            stop_at_sight_m: None,
            straighten: false,
        }
    }

    /// The best that we found.
    pub fn elk(scan_spacing_m: f64) -> Self {
        Self {
            name: "elk",
            scan_spacing_m,
            early_stop: true,
            look_at_target: true,
            stop_at_sight_m: Some(5.0),
            straighten: true,
        }
    }

    /// One line for people and for the record.
    pub fn describe(&self) -> String {
        let end = match self.stop_at_sight_m {
            Some(range) => format!("the path is cut at line of sight within {range} m"),
            None => "the path is followed to its end".into(),
        };
        let choose = |on: bool, yes: &'static str, no: &'static str| if on { yes } else { no };
        format!(
            "policy {}: a scan every {} m and on arrival; {end}; {}; {}, {} on the way",
            self.name,
            self.scan_spacing_m,
            choose(self.early_stop, "a new plan once the target is resolved", "no early stop"),
            choose(self.straighten, "paths straightened", "paths as planned"),
            choose(self.look_at_target, "looking at the target", "looking along the motion"),
        )
    }

    /// What the controller has to know of it, and whether the sensor is held `level`.
    pub fn motion(&self, clearance_m: f64, level: bool) -> MotionPolicy {
        MotionPolicy {
            name: self.name.into(),
            scan_spacing_m: self.scan_spacing_m,
            early_stop: self.early_stop,
            look_at_target: self.look_at_target,
            clearance_m,
            level,
        }
    }

    /// The part of `way` to follow to resolve `target` with a camera that sees `range_m` far. The
    /// first `fixed` (m) of the way, on which it backs off from an obstacle, are left as they are.
    pub fn shape(&self, space: &Space, (target, range_m): (&Target, f64), way: Polyline, fixed: f64) -> Polyline {
        let cut = self.cut(space, target, range_m, way);
        if !self.straighten {
            return cut;
        }
        let straight = straighten(space, &cut, fixed);
        self.cut(space, target, range_m, straight)
    }

    /// A way that is followed to its end, straightened if the policy does that; the first `fixed` of its points are left as they are.
    pub fn straightened(&self, space: &Space, way: Vec<Point3<f64>>, fixed: usize) -> Vec<Point3<f64>> {
        let whole = Polyline::new(way.iter().copied()).filter(|_| self.straighten);
        let fixed = Polyline::new(way.iter().copied().take(fixed)).map_or(0.0, |fixed| fixed.length());
        whole.map_or(way, |whole| straighten(space, &whole, fixed).points().to_vec())
    }

    /// Ends the way where the target is in sight.
    fn cut(&self, space: &Space, target: &Target, range_m: f64, way: Polyline) -> Polyline {
        let Some(range) = self.stop_at_sight_m.map(|range| range.min(range_m)) else {
            return way;
        };
        let center = target.voxel.center(space.resolution());
        let in_sight =
            way.samples(SIGHT_STEP_M).find(|(_, p)| (p - center).norm() <= range && target.seen_from(space, *p));
        let end = in_sight.map_or(way.length(), |(s, _)| s);
        Polyline::new(way.part(0.0, end)).unwrap_or(way)
    }
}

/// String pulling: from each point straight to the farthest one that can be reached so.
fn straighten(space: &Space, way: &Polyline, fixed: f64) -> Polyline {
    let points: Vec<Point3<f64>> = way.samples(SIGHT_STEP_M).map(|(_, p)| p).collect();
    let mut at = (fixed / SIGHT_STEP_M).ceil() as usize;
    let mut pulled = way.part(0.0, (at as f64 * SIGHT_STEP_M).min(way.length()));
    while at + 1 < points.len() {
        let straight = |to: &usize| free_line(space, points[at], points[*to]);
        let next = (at + 2..points.len()).rev().find(straight).unwrap_or(at + 1);
        // What lies between two neighbouring samples may bend at a corner of the original.
        let (from, to) = (at as f64 * SIGHT_STEP_M, next as f64 * SIGHT_STEP_M);
        if next == at + 1 {
            pulled.extend(way.bends(from, to));
        }
        pulled.push(points[next]);
        at = next;
    }
    Polyline::new(pulled).unwrap_or_else(|| way.clone())
}

/// Whether the robot can go straight from `from` to `to`.
fn free_line(space: &Space, from: Point3<f64>, to: Point3<f64>) -> bool {
    let mut reach = space.reach.near();
    Traversal::new(from, to, space.resolution()).all(|voxel| reach.contains(voxel))
}

/// The poses to scan from at `position`, in order: first the one that has most of the frontier in view beside the target,
/// then straight into each of its unknown neighbours, those in sight first.
pub fn looks(space: &Space, known: Known, position: Point3<f64>, target: &Target) -> Vec<Pose> {
    let toward = |v: &Voxel| v.center(space.resolution()) - position;
    let mut exact: Vec<Voxel> = target.unknown().collect();
    exact.sort_by_key(|u| !space.sees(position, *u));
    let first = widest(space, known, position, target);
    std::iter::once(first)
        .chain(exact.iter().take(EXACT_LOOKS).map(toward))
        .map(|direction| Pose::looking(position, known.sight.held(direction)))
        .collect()
}

/// Of directions that keep the target in view, the one that has most of what is unknown around in view.
fn widest(space: &Space, known: Known, position: Point3<f64>, target: &Target) -> Vector3<f64> {
    let toward = |u: &Voxel| (u.center(space.resolution()) - position).try_normalize(1e-9);
    let in_sight = |u: &Voxel| space.sees(position, *u);
    let held = |direction: Vector3<f64>| known.sight.held(direction);
    let Some(axis) = target.unknown().find(in_sight).and_then(|u| toward(&u)).map(held) else {
        return outward(space, known, position, target);
    };
    let around: Vec<Vector3<f64>> =
        unknown_around(known, position).iter().filter(|u| in_sight(u)).filter_map(toward).collect();
    let sight = known.sight;
    let in_view = |d: &Vector3<f64>| around.iter().filter(|u| sight.covers(d, u)).count();
    let mut best = (0, axis);
    for direction in tilted(axis, sight.half_angle).map(held) {
        let count = in_view(&direction);
        if count > best.0 {
            best = (count, direction);
        }
    }
    best.1
}

/// A direction, and those that are tilted against it in eight ways by each of [`TILTS`] that is below `half_angle` (rad).
fn tilted(axis: Vector3<f64>, half_angle: f64) -> impl Iterator<Item = Vector3<f64>> {
    let side = axis.cross(&Vector3::z()).try_normalize(1e-6).unwrap_or_else(Vector3::x);
    let up = side.cross(&axis);
    let turn = move |k: i32| {
        let angle = f64::from(k) * std::f64::consts::FRAC_PI_4;
        side * angle.cos() + up * angle.sin()
    };
    let by = move |tilt: f64| (0..8).map(move |k| axis * tilt.cos() + turn(k) * tilt.sin());
    std::iter::once(axis).chain(TILTS.into_iter().filter(move |tilt| *tilt < half_angle).flat_map(by))
}

/// The unknown voxels beside the frontier within [`LOOK_RANGE_M`] of `position`, as far as the camera sees.
fn unknown_around(known: Known, position: Point3<f64>) -> Vec<Voxel> {
    let near = known.frontier_near(position, LOOK_RANGE_M.min(known.sight.range_m));
    let mut unknown: Vec<Voxel> = near.flat_map(|v| known.unknown_beside(v)).collect();
    unknown.sort_unstable();
    unknown.dedup();
    unknown
}

/// The mean direction from `position` to what is unknown around the target: seen from afar that is the target, seen from
/// its own voxel it is the frontier's outward normal.
fn outward(space: &Space, known: Known, position: Point3<f64>, target: &Target) -> Vector3<f64> {
    let resolution = space.resolution();
    let n = (LOOK_RADIUS_M / resolution).floor() as i32;
    let side = || -n..=n;
    let offsets = side()
        .flat_map(|x| side().flat_map(move |y| side().map(move |z| Voxel::new(x, y, z))))
        .filter(|d| d.distance(Voxel::new(0, 0, 0)) * resolution <= LOOK_RADIUS_M);
    let sum: Vector3<f64> = offsets
        .map(|d| target.voxel + d)
        .filter(|v| known.frontier.contains(*v))
        .flat_map(|v| known.unknown_beside(v))
        .filter_map(|u| (u.center(resolution) - position).try_normalize(1e-9))
        .sum();
    let direct = target.voxel.center(resolution) - position;
    sum.try_normalize(1e-3)
        .or_else(|| direct.try_normalize(1e-9))
        .or_else(|| Some(target.unknown().next()?.center(resolution) - position))
        .unwrap_or_else(Vector3::x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sight::Sight;
    use elk_geometry::{Clearance, FrontierSet, OccupancyGrid, State};
    use elk_spatial::CameraInfo;

    /// An L-shaped corridor, 5 voxels wide and high: 30 along x, then 30 along y; its far end is open.
    fn corridor() -> (OccupancyGrid, FrontierSet, Space, Target) {
        let mut grid = OccupancyGrid::new(0.1);
        let mut frontier = FrontierSet::new(None);
        for x in -1..31 {
            for y in -1..30 {
                for z in -1..6 {
                    let inside = (0..5).contains(&z)
                        && ((0..30).contains(&x) && (0..5).contains(&y) || (25..30).contains(&x) && y >= 0);
                    let v = Voxel::new(x, y, z);
                    grid.set(v, if inside { State::Free } else { State::Occupied });
                }
            }
        }
        let all: Vec<Voxel> = grid.bricks().voxels().map(|(v, _)| v).collect();
        frontier.update(&grid, &all);
        let inside = |v: &&Voxel| grid.state(**v) == State::Free;
        // Wherever it is free, the robot has been.
        let space = Space::around(&grid, Voxel::new(2, 2, 2), &Clearance::default(), (all.iter().filter(inside), &[]));
        let known = Known { grid: &grid, frontier: &frontier, sight: Sight::default() };
        let target = Target::new(known, Voxel::new(27, 29, 2), vec![]);
        (grid, frontier, space, target)
    }

    fn way() -> Polyline {
        let at = |x, y| Voxel::new(x, y, 2).center(0.1);
        Polyline::new([at(2, 2), at(2, 4), at(20, 4), at(27, 4), at(27, 29)]).unwrap()
    }

    #[test]
    fn the_thesis_follows_to_the_end_and_elk_until_it_sees() {
        let (_, _, space, target) = corridor();
        let thesis = Policy::thesis(0.4).shape(&space, (&target, f64::INFINITY), way(), 0.0);
        assert_eq!(thesis, way());
        let elk = Policy::elk(0.4).shape(&space, (&target, f64::INFINITY), way(), 0.0);
        assert!(target.seen_from(&space, elk.end()));
        assert!(elk.length() < 2.7, "{}", elk.length());
        assert_eq!(elk.points()[0], way().points()[0]);
        for pair in elk.points().windows(2) {
            assert!(free_line(&space, pair[0], pair[1]));
        }
        let short_sighted = Policy::elk(0.4).shape(&space, (&target, 1.0), way(), 0.0);
        let left = (short_sighted.end() - target.voxel.center(0.1)).norm();
        assert!(target.seen_from(&space, short_sighted.end()) && left <= 1.0, "{left}");
    }

    #[test]
    fn a_straightened_way_is_shorter_and_stays_where_the_robot_can_be() {
        let (_, _, space, _) = corridor();
        let straight = straighten(&space, &way(), 0.0);
        assert!(straight.length() < way().length() - 0.1);
        assert_eq!((straight.points()[0], straight.end()), (way().points()[0], way().end()));
        for pair in straight.points().windows(2) {
            assert!(free_line(&space, pair[0], pair[1]));
        }
    }

    #[test]
    fn the_first_look_is_along_the_frontiers_normal_the_next_into_the_unknown() {
        let (grid, frontier, space, target) = corridor();
        let known = Known { grid: &grid, frontier: &frontier, sight: Sight::default() };
        let inside = target.voxel.center(0.1);
        let poses = looks(&space, known, inside, &target);
        assert_eq!(poses.len(), 2);
        for pose in &poses {
            assert!(pose.forward().y > 0.999, "{:?}", pose.forward());
        }
        let afar = Voxel::new(27, 2, 2).center(0.1);
        assert!(looks(&space, known, afar, &target)[0].forward().y > 0.99);
    }

    #[test]
    fn a_fan_is_held_level_wherever_it_looks() {
        let (grid, frontier, space, target) = corridor();
        let fan = CameraInfo { columns: 540, rows: 1, fov_x: 4.0, ..CameraInfo::default() };
        let at = Point3::new(2.75, 2.3, 0.21);
        let looks = |sight| looks(&space, Known { grid: &grid, frontier: &frontier, sight }, at, &target);
        let (level, any) = (looks(Sight::in_layer(&fan, 0.1)), looks(Sight::of(&fan, 0.1)));
        assert!(level.iter().all(|pose| pose.forward().z.abs() < 1e-12 && pose.forward().y > 0.9), "{level:?}");
        assert!(any.iter().any(|pose| pose.forward().z > 0.01), "{any:?}");
    }

    #[test]
    fn a_policy_says_what_it_does() {
        assert!(Policy::elk(0.4).describe().contains("line of sight within 5 m"));
        assert!(Policy::thesis(0.4).describe().contains("followed to its end"));
    }
}
