//! What of a world a robot can come to know, and how much of it a map has.

use std::collections::VecDeque;

use elk_geometry::bricks::voxel_at;
use elk_geometry::delta::Changes;
use elk_geometry::mask;
use elk_geometry::random::Random;
use elk_geometry::set::VoxelSet;
use elk_geometry::{Bounds, OccupancyGrid, Pose, Voxel};
use elk_world::truth::{Meeting, meeting};
use elk_world::{START_CLEARANCE_M, World};
use nalgebra::Point3;

/// Places that are drawn in search of the largest part of a world in which a robot can go about.
const PLACES: usize = 64;
/// Places that are drawn for each start before a world counts as too narrow.
const TRIES: usize = 2_000;
/// From how far away a voxel is looked at before it is looked at from everywhere (voxels).
const NEAR: i32 = 3;
/// Places that stand for everywhere: more would take minutes.
const MOST_VIEWS: usize = 4_000;

/// What decides of what can be known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Terms {
    /// Edge of a voxel (m).
    pub resolution: f64,
    /// The ball around the robot that is kept clear of obstacles (m).
    pub radius_m: f64,
    /// The volume to explore (m, world); `None`: all.
    pub bounds: Option<Bounds>,
}

/// Why nothing of a world can be known.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TruthError {
    /// There is no room for a robot.
    #[error(
        "found no place for a start: free, {clearance} m from every surface, in the volume to explore and in the largest part of \
         it in which the robot can go about; is the world closed, and in metres (Sensor.Scale)?"
    )]
    NoPlace {
        /// The clearance asked for (m).
        clearance: f64,
    },
}

/// What of a world a robot can come to know.
#[derive(Debug, Clone)]
pub struct Truth {
    terms: Terms,
    /// Where the robot can be: the largest part of the world that hangs together.
    stands: VoxelSet,
    /// Free voxels that can be seen from there.
    visible: VoxelSet,
    /// Voxels with a surface in them, beside such a free one.
    surface: VoxelSet,
    /// Free voxels of the same space that no place sees.
    hidden: usize,
}

/// Whether nothing lies between two points (m, world).
pub fn sees(world: &World, from: Point3<f64>, to: Point3<f64>) -> bool {
    world.cast(from, to - from).is_none_or(|t| t >= 1.0)
}

impl Terms {
    fn center(&self, voxel: Voxel) -> Point3<f64> {
        voxel.center(self.resolution)
    }

    /// Radius of the ball around a robot in the centre of a voxel that no surface may touch (m).
    fn ball_m(&self) -> f64 {
        self.radius_m.max(0.5 * self.resolution)
    }

    fn holds(&self, voxel: Voxel) -> bool {
        voxel.is_mappable() && self.bounds.is_none_or(|bounds| bounds.contains(self.center(voxel)))
    }

    /// Whether a robot can be there, as far as surfaces go. The ball reaches the faces of the voxel, so that no surface lies
    /// between two such neighbours.
    fn is_clear(&self, world: &World, voxel: Voxel) -> bool {
        let center = self.center(voxel);
        self.holds(voxel) && world.extents().contains(center) && !world.touches(center, center, self.ball_m())
    }
}

impl Truth {
    /// Looks for all that a robot can know of `world`.
    ///
    /// # Errors
    /// There is no place for a robot.
    pub fn of(world: &World, terms: Terms) -> Result<Self, TruthError> {
        let stands = largest_part(world, &terms)?;
        let (free, surface) = space_around(world, &terms, &stands);
        let views = views(&stands);
        let visible: VoxelSet =
            free.iter().filter(|voxel| is_visible(world, &terms, (&stands, &views), *voxel)).collect();
        let surface =
            surface.iter().filter(|voxel| voxel.face_neighbours().iter().any(|next| visible.contains(*next))).collect();
        let hidden = free.len() - visible.len();
        Ok(Self { terms, stands, visible, surface, hidden })
    }

    /// Free voxels that can be seen.
    pub fn visible(&self) -> &VoxelSet {
        &self.visible
    }

    /// Voxels with a surface in them that can be seen.
    pub fn surface(&self) -> &VoxelSet {
        &self.surface
    }

    /// Where the robot can be.
    pub fn stands(&self) -> &VoxelSet {
        &self.stands
    }

    /// Free voxels that no place sees.
    pub fn hidden(&self) -> usize {
        self.hidden
    }

    /// The volume to explore (m, world); `None`: all.
    pub fn bounds(&self) -> Option<Bounds> {
        self.terms.bounds
    }

    /// Whether a voxel lies in the volume to explore.
    pub fn holds(&self, voxel: Voxel) -> bool {
        self.terms.holds(voxel)
    }

    /// Edge of a voxel (m).
    pub fn resolution(&self) -> f64 {
        self.terms.resolution
    }

    /// What is free around a robot on its way through the face between two voxels in which it stands (m): the balls around both
    /// have that much in common there.
    pub fn passage_m(&self) -> f64 {
        let [ball, half] = [self.terms.ball_m(), 0.5 * self.terms.resolution];
        (ball * ball - half * half).max(0.0).sqrt()
    }

    /// A voxel near by from which a visible one is seen, or that one itself, if the robot can stand there.
    pub fn near_view(&self, world: &World, voxel: Voxel) -> Option<Voxel> {
        near_view(world, &self.terms, &self.stands, voxel)
    }

    /// So many starts, drawn from `random`: anywhere where the robot can be, with [`START_CLEARANCE_M`] around, looking
    /// anywhere (thesis 6.5.2).
    ///
    /// # Errors
    /// There is no such place.
    pub fn starts(&self, world: &World, count: usize, random: &mut Random) -> Result<Vec<Start>, TruthError> {
        (0..count).map(|_| self.start(world, random)).collect()
    }

    fn start(&self, world: &World, random: &mut Random) -> Result<Start, TruthError> {
        let no_place = TruthError::NoPlace { clearance: START_CLEARANCE_M };
        for _ in 0..TRIES {
            let place = world.draw_place(START_CLEARANCE_M, random).map_err(|_| no_place.clone())?;
            let (rise, heading) = (random.between(-1.0, 1.0), random.between(0.0, 360.0));
            let start = Start {
                position: place.map(|coordinate| (coordinate * 1e3).round() / 1e3),
                yaw_deg: (heading * 10.0).round() / 10.0,
                pitch_deg: (rise.asin().to_degrees() * 10.0).round() / 10.0,
            };
            if self.is_start(world, start.position) {
                return Ok(start);
            }
        }
        Err(no_place)
    }

    /// Whether a run can begin there: in free space, with room for the robot, where it can go about.
    pub fn is_start(&self, world: &World, place: Point3<f64>) -> bool {
        let voxel = Voxel::containing(place, self.terms.resolution);
        self.stands.contains(voxel) && world.is_free(place) && !world.touches(place, place, self.terms.radius_m)
    }

    /// How much a map has of the free voxels that can be seen.
    pub fn coverage(&self) -> Coverage<'_> {
        Coverage { of: &self.visible, known: VoxelSet::new() }
    }

    /// How much a map has of the surface voxels that can be seen.
    pub fn surface_coverage(&self) -> Coverage<'_> {
        Coverage { of: &self.surface, known: VoxelSet::new() }
    }

    /// Whether a robot that is at `from` can go straight to `to` (m, world) and be there.
    pub fn can_go(&self, world: &World, from: Point3<f64>, to: Point3<f64>) -> bool {
        let stands = self.stands.contains(Voxel::containing(to, self.terms.resolution));
        stands && !world.touches(from, to, self.terms.radius_m)
    }

    /// Surface recall and precision of a map: of the surface voxels that can be seen the share that it calls occupied, and of
    /// the voxels that it calls occupied, in the volume to explore, the share that a surface meets; `None`: of nothing.
    pub fn surfaces(&self, world: &World, map: &OccupancyGrid) -> [Option<f64>; 2] {
        let found: usize = self
            .surface
            .bricks()
            .map(|(brick, cells)| {
                let known = map.bricks().brick(brick);
                known.map_or(0, |states| mask::count(&mask::and(states.occupied(), cells)))
            })
            .sum();
        let (mut occupied, mut right) = (0_usize, 0_usize);
        for (brick, cells) in map.bricks().iter() {
            let voxels = mask::cells(cells.occupied()).map(|cell| voxel_at(brick, cell));
            for voxel in voxels.filter(|voxel| self.terms.holds(*voxel)) {
                occupied += 1;
                let is_right =
                    self.surface.contains(voxel) || meeting(world, voxel, self.terms.resolution) != Meeting::None;
                right += usize::from(is_right);
            }
        }
        let share = |part: usize, all: usize| (all > 0).then(|| part as f64 / all as f64);
        [share(found, self.surface.len()), share(right, occupied)]
    }
}

/// A pose at which a run begins. Its numbers are short, and said as they are wherever the run is had again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Where (m, world).
    pub position: Point3<f64>,
    /// Heading, anticlockwise from world x (degrees).
    pub yaw_deg: f64,
    /// Elevation, up positive (degrees).
    pub pitch_deg: f64,
}

impl Start {
    /// As a pose (world).
    pub fn pose(&self) -> Pose {
        Pose::from_yaw_pitch(self.position, self.yaw_deg.to_radians(), self.pitch_deg.to_radians())
    }
}

/// The largest part of the world in which a robot can go about: of those that randomly drawn places lie in.
fn largest_part(world: &World, terms: &Terms) -> Result<VoxelSet, TruthError> {
    let no_place = TruthError::NoPlace { clearance: START_CLEARANCE_M };
    // Always the same places: what a world is does not depend on a suite's seed.
    let mut random = Random::new(0, 0);
    let mut parts: Vec<VoxelSet> = Vec::new();
    for _ in 0..PLACES {
        let place = world.draw_place(START_CLEARANCE_M, &mut random).map_err(|_| no_place.clone())?;
        let voxel = Voxel::containing(place, terms.resolution);
        let is_new = !parts.iter().any(|part| part.contains(voxel));
        if is_new && terms.is_clear(world, voxel) && world.is_free(terms.center(voxel)) {
            parts.push(part_around(world, terms, voxel));
        }
    }
    // The first of equals.
    parts.into_iter().rev().max_by_key(VoxelSet::len).ok_or(no_place)
}

fn part_around(world: &World, terms: &Terms, start: Voxel) -> VoxelSet {
    let mut part = VoxelSet::new();
    let mut refused = VoxelSet::new();
    part.insert(start);
    let mut open = VecDeque::from([start]);
    while let Some(voxel) = open.pop_front() {
        for next in voxel.face_neighbours() {
            if part.contains(next) || refused.contains(next) {
                continue;
            }
            if terms.is_clear(world, next) {
                part.insert(next);
                open.push_back(next);
            } else {
                refused.insert(next);
            }
        }
    }
    part
}

/// The free voxels of the space that the robot is in, and the voxels with surfaces that bound it.
fn space_around(world: &World, terms: &Terms, stands: &VoxelSet) -> (VoxelSet, VoxelSet) {
    let (mut free, mut surface) = (stands.clone(), VoxelSet::new());
    let mut open: VecDeque<Voxel> = stands.iter().collect();
    while let Some(voxel) = open.pop_front() {
        for next in voxel.face_neighbours() {
            if free.contains(next) || surface.contains(next) || !terms.holds(next) {
                continue;
            }
            let center = terms.center(next);
            match meeting(world, next, terms.resolution) {
                Meeting::Through => {
                    surface.insert(next);
                    continue;
                }
                // A wall may lie on the face between the two.
                Meeting::Touch if !sees(world, terms.center(voxel), center) => continue,
                Meeting::Touch | Meeting::None => {}
            }
            // An open world has no end.
            if world.extents().contains(center) {
                free.insert(next);
                open.push_back(next);
            }
        }
    }
    (free, surface)
}

/// Places that stand for all from which a robot can look: as many as can be afforded, on a lattice.
fn views(stands: &VoxelSet) -> Vec<Voxel> {
    let on_lattice = |stride: i32| {
        let is_on = move |voxel: &Voxel| voxel.to_array().iter().all(|index| index.rem_euclid(stride) == 0);
        stands.iter().filter(is_on).collect::<Vec<_>>()
    };
    (2..).map(on_lattice).find(|views| views.len() <= MOST_VIEWS).unwrap_or_default()
}

fn is_visible(world: &World, terms: &Terms, (stands, views): (&VoxelSet, &[Voxel]), voxel: Voxel) -> bool {
    let target = terms.center(voxel);
    near_view(world, terms, stands, voxel).is_some()
        || views.iter().any(|view| sees(world, terms.center(*view), target))
}

fn near_view(world: &World, terms: &Terms, stands: &VoxelSet, voxel: Voxel) -> Option<Voxel> {
    if stands.contains(voxel) {
        return Some(voxel);
    }
    let target = terms.center(voxel);
    let mut near = (1..=NEAR).flat_map(|reach| shell(reach).map(|step| voxel + step));
    near.find(|view| stands.contains(*view) && sees(world, terms.center(*view), target))
}

/// The steps that lead to the faces of a cube, half as long as `reach` voxels.
fn shell(reach: i32) -> impl Iterator<Item = Voxel> {
    let range = -reach..=reach;
    let all = range.clone().flat_map(move |x| {
        let range = -reach..=reach;
        range.flat_map(move |y| (-reach..=reach).map(move |z| [x, y, z]))
    });
    all.filter(move |step| step.iter().any(|along| along.abs() == reach)).map(Voxel::from)
}

/// How much of a set of voxels a map knows, kept while it grows.
#[derive(Debug, Clone)]
pub struct Coverage<'a> {
    of: &'a VoxelSet,
    known: VoxelSet,
}

impl Coverage<'_> {
    /// The map has changed so, and is `map` now.
    pub fn update(&mut self, map: &OccupancyGrid, changes: &Changes) {
        for (brick, _) in changes.bricks() {
            let known = map.bricks().brick(*brick).map_or(mask::NONE, |cells| *cells.known());
            self.known.replace(*brick, &mask::and(&known, self.of.brick(*brick)));
        }
    }

    /// The share that is known (0 to 1).
    pub fn share(&self) -> f64 {
        self.known.len() as f64 / self.of.len().max(1) as f64
    }

    /// What of it is known.
    pub fn known(&self) -> &VoxelSet {
        &self.known
    }
}

#[cfg(test)]
mod tests {
    use elk_geometry::State;
    use elk_world::scenery::{Scenery, Solid};

    use nalgebra::Vector3;

    use super::*;

    const TERMS: Terms = Terms { resolution: 0.1, radius_m: 0.1, bounds: None };

    /// A room from (0, 0, 0) to (2, 2, 2) m, half a voxel off the lattice, with a hollow in it that a wall of 0.2 m shuts off.
    fn world() -> World {
        let mut scenery = Scenery::within(Solid::block("room", [-0.05; 3], [2.05; 3]));
        scenery.block("wall", [1.45, -0.05, -0.05], [1.65, 2.05, 2.05]);
        World::from_triangles("room", scenery.triangles_at(Vector3::zeros())).unwrap()
    }

    fn truth() -> (World, Truth) {
        let world = world();
        let truth = Truth::of(&world, TERMS).unwrap();
        (world, truth)
    }

    #[test]
    fn what_can_be_seen_is_the_free_space_around_the_robot_and_the_surfaces_about_it() {
        let (_, truth) = truth();
        // Voxels 0 to 13 along x and 0 to 19 along y and z have no surface in them and lie before the wall.
        assert_eq!(truth.visible().len(), 14 * 20 * 20);
        assert!(truth.visible().contains([0, 19, 7].into()) && !truth.visible().contains([18, 5, 5].into()));
        assert_eq!(truth.surface().len(), 2 * 20 * 20 + 4 * 14 * 20);
        assert_eq!(truth.hidden(), 0);
        assert!(truth.stands().contains([7, 7, 7].into()) && truth.stands().len() < truth.visible().len());
    }

    #[test]
    fn a_volume_to_explore_bounds_it() {
        let half = Bounds { min: [0.0; 3].into(), max: [0.7, 2.0, 2.0].into() };
        let truth = Truth::of(&world(), Terms { bounds: Some(half), ..TERMS }).unwrap();
        assert_eq!(truth.visible().len(), 7 * 20 * 20);
    }

    #[test]
    fn a_start_is_free_and_the_same_for_the_same_seed() {
        let (world, truth) = truth();
        let starts = |seed| truth.starts(&world, 20, &mut Random::new(seed, 3)).unwrap();
        assert_eq!(starts(1), starts(1));
        assert_ne!(starts(1), starts(2));
        for start in starts(1) {
            assert!(world.is_free(start.position) && start.position.x < 1.45 - START_CLEARANCE_M + 1e-3, "{start:?}");
        }
        let is_start = |x: f64| truth.is_start(&world, Point3::new(x, 1.0, 1.0));
        assert_eq!([0.5, 1.55, 1.9, 1.43, 3.0].map(is_start), [true, false, false, false, false]);
    }

    #[test]
    fn a_world_without_room_is_refused_with_a_word() {
        let narrow = Scenery::within(Solid::block("room", [0.0; 3], [0.3; 3]));
        let world = World::from_triangles("narrow", narrow.triangles_at(Vector3::zeros())).unwrap();
        let error = Truth::of(&world, TERMS).unwrap_err().to_string();
        assert!(error.starts_with("found no place for a start"), "{error}");
    }

    /// A map of all that can be seen has all of it, whatever order it comes in; one with a hole or a ghost does not.
    #[test]
    fn coverage_recall_and_precision_are_shares_of_what_is_true() {
        let (world, truth) = truth();
        let mut map = OccupancyGrid::new(0.1);
        let mut coverage = truth.coverage();
        let mut known = Vec::new();
        for (voxels, state) in [(truth.visible(), State::Free), (truth.surface(), State::Occupied)] {
            known.extend(voxels.iter().map(|voxel| (voxel, state)));
        }
        for (count, (voxel, state)) in known.iter().enumerate() {
            map.set(*voxel, *state);
            if count % 1500 == 7 {
                let changes = changes_of(&map);
                coverage.update(&map, &changes);
                let again = truth.visible().iter().filter(|voxel| map.state(*voxel) != State::Unknown).count();
                assert_eq!(coverage.share(), again as f64 / truth.visible().len() as f64);
            }
        }
        coverage.update(&map, &changes_of(&map));
        assert_eq!(coverage.share(), 1.0);
        assert_eq!(truth.surfaces(&world, &map), [Some(1.0); 2]);
        let wall = truth.surface().iter().next().unwrap();
        map.set(wall, State::Free);
        map.set([5, 5, 5].into(), State::Occupied);
        let surface = truth.surface().len() as f64;
        assert_eq!(truth.surfaces(&world, &map), [Some((surface - 1.0) / surface); 2]);
        assert_eq!(truth.surfaces(&world, &OccupancyGrid::new(0.1)), [Some(0.0), None]);
    }

    fn changes_of(map: &OccupancyGrid) -> Changes {
        let mut changes = Changes::default();
        map.bricks().iter().for_each(|(brick, cells)| changes.add((brick, *cells.known())));
        changes
    }
}
