//! What of the frontier is seen from a pose: at most, brick by brick, and in truth.

use elk_geometry::Voxel;
use elk_geometry::bricks::brick_of;
use elk_geometry::frontier::Faces;
use elk_geometry::set::Near;
use elk_geometry::visibility::{entered, hidden, in_sight};
use nalgebra::{Point3, Vector3};

use crate::goals::Goal;
use crate::strategy::View;
use crate::target::Target;

/// A pose from which something of the frontier is seen.
#[derive(Debug, Clone, Copy)]
pub struct Candidate<'a> {
    /// Where the camera is: in the middle of it.
    pub place: Voxel,
    /// Number of frontier voxels in the camera's view whose unknown side it looks into.
    pub gain: usize,
    /// Of the goals that are seen, the one nearest to the middle of the image.
    pub goal: &'a Goal,
}

/// Where the camera is, in the middle of that voxel, and the direction (unit vector) in which it looks.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    pub place: Voxel,
    pub axis: Vector3<f64>,
}

/// Nearer than this (m) a frontier voxel has no direction, and is in view.
const HERE_M: f64 = 1e-9;

/// The frontier voxels that there are goals for, by brick.
pub struct Outlook<'a> {
    view: View<'a>,
    blocks: Vec<Block<'a>>,
}

/// Those of a brick.
struct Block<'a> {
    /// Middle of the box around their centres (m, world), and how far it is to its corners (m).
    center: Point3<f64>,
    radius: f64,
    /// Corners of the box around what is unknown beside them, both in it.
    unknown: [Voxel; 2],
    /// By the faces through which lines may come to that, how many goals are seen at most.
    most: Box<[usize; Faces::SETS]>,
    sightings: Vec<Sighting<'a>>,
}

/// A frontier voxel, and what there is to see beside it.
struct Sighting<'a> {
    target: &'a Target,
    center: Point3<f64>,
    /// How many goals look at it.
    goals: usize,
    /// The first of them that is the one of its voxel, and its place among all goals.
    aim: Option<(usize, &'a Goal)>,
    /// What is unknown beside it, each with its faces behind which something is free.
    unknown: Vec<(Voxel, Faces)>,
    /// All these faces.
    open: Faces,
}

/// A goal, its place among all, and whether it is the one of its voxel.
type Placed<'a> = (usize, &'a Goal, bool);

impl<'a> Outlook<'a> {
    /// What a plan's poses look at.
    pub fn new(view: &View<'a>) -> Self {
        let placed = |(n, (goal, is_first))| (n, goal, is_first);
        let mut goals: Vec<Placed<'a>> = view.goals.iter_all().enumerate().map(placed).collect();
        let voxel = |(_, goal, _): &Placed| goal.target.voxel;
        goals.sort_unstable_by_key(|goal| (brick_of(voxel(goal)), voxel(goal), goal.0));
        let mut free = view.space.free.near();
        let by_brick = goals.chunk_by(|one, other| brick_of(voxel(one)) == brick_of(voxel(other)));
        let blocks = by_brick.filter_map(|goals| {
            let by_target = goals.chunk_by(|one, other| voxel(one) == voxel(other));
            let sightings = by_target.filter_map(|goals| Sighting::of(view, &mut free, goals)).collect();
            Block::of(view, sightings)
        });
        Self { view: *view, blocks: blocks.collect() }
    }

    /// No more goals than this are seen from a pose.
    pub fn most(&self, pose: &Pose) -> usize {
        self.ahead(pose).map(|(block, entered)| block.most[entered.number()]).sum()
    }

    /// The bricks of which anything may be in view, each with the faces through which it is looked into what is unknown there.
    fn ahead(&self, pose: &Pose) -> impl Iterator<Item = (&Block<'a>, Faces)> {
        let (from, sight, Pose { place, axis }) = (self.view.space.center(pose.place), self.view.sight, *pose);
        let may_be_seen = move |block: &&Block| sight.may_cover(&axis, &(block.center - from), block.radius);
        self.blocks.iter().filter(may_be_seen).map(move |block| (block, entered(place, block.unknown)))
    }

    /// What is seen from a pose if that is enough: `is_enough` says of which number of goals that is so, of more if it is of fewer.
    pub fn look(&self, pose: &Pose, is_enough: impl Fn(usize) -> bool) -> Option<Candidate<'a>> {
        let (mut gain, mut in_view) = (0, Vec::new());
        for (block, entered) in self.ahead(pose) {
            for sighting in block.sightings.iter().filter(|sighting| sighting.open.meets(entered)) {
                if let Some(along) = self.along_axis(pose, sighting).filter(|_| sighting.faces(pose.place)) {
                    gain += sighting.goals;
                    in_view.push((along, sighting));
                }
            }
        }
        let mut free = self.view.space.free.near();
        let mut aim: Option<(f64, usize, &Goal)> = None;
        for (along, sighting) in in_view {
            if !is_enough(gain) {
                return None;
            }
            if !sighting.is_seen(self.view.space.resolution(), &mut free, pose.place) {
                gain -= sighting.goals;
                continue;
            }
            let is_nearer = |n: usize| aim.is_none_or(|(best, first, _)| along > best || along == best && n < first);
            aim = sighting.aim.filter(|(n, _)| is_nearer(*n)).map(|(n, goal)| (along, n, goal)).or(aim);
        }
        let (_, _, goal) = aim.filter(|_| is_enough(gain))?;
        Some(Candidate { place: pose.place, gain, goal })
    }

    /// The cosine of the angle between the middle of the image and a frontier voxel; `None`: that is not in view.
    fn along_axis(&self, pose: &Pose, sighting: &Sighting) -> Option<f64> {
        let (toward, sight) = (sighting.center - self.view.space.center(pose.place), self.view.sight);
        let distance = toward.norm();
        let is_covered = || distance < HERE_M || sight.covers(&pose.axis, &(toward / distance));
        (distance <= sight.range_m && is_covered()).then(|| toward.dot(&pose.axis) / distance.max(HERE_M))
    }
}

impl<'a> Block<'a> {
    fn of(view: &View<'_>, sightings: Vec<Sighting<'a>>) -> Option<Self> {
        let corners = |voxels: &mut dyn Iterator<Item = Voxel>| {
            voxels.map(|voxel| [voxel; 2]).reduce(|[low, high], [min, max]| [low.inf(min), high.sup(max)])
        };
        let voxels = corners(&mut sightings.iter().map(|sighting| sighting.target.voxel))?;
        let unknown = sightings.iter().flat_map(|sighting| &sighting.unknown);
        let unknown = corners(&mut unknown.map(|(unknown, _)| *unknown))?;
        let [low, high] = voxels.map(|voxel| view.space.center(voxel));
        // And a little for rounding.
        let radius = (high - low).norm() / 2.0 + 1e-6 * view.space.resolution();
        let most = Faces::sets().map(|faces| {
            let open = sightings.iter().filter(|sighting| sighting.open.meets(faces));
            open.map(|sighting| sighting.goals).sum()
        });
        Some(Self { center: low + (high - low) / 2.0, radius, unknown, most: Box::new(most), sightings })
    }
}

impl<'a> Sighting<'a> {
    /// That of a target, by all goals that look at it.
    fn of(view: &View<'_>, free: &mut Near<'_>, goals: &[Placed<'a>]) -> Option<Self> {
        let target = &goals.first()?.1.target;
        let mut open = |unknown: Voxel| Faces::of(unknown, |_, beside| free.contains(beside));
        let unknown: Vec<(Voxel, Faces)> = target.unknown().map(|voxel| (voxel, open(voxel))).collect();
        Some(Self {
            target,
            center: view.space.center(target.voxel),
            goals: goals.len(),
            aim: goals.iter().find(|(_, _, is_first)| *is_first).map(|(n, goal, _)| (*n, *goal)),
            open: unknown.iter().fold(Faces::default(), |all, (_, open)| all.or(*open)),
            unknown,
        })
    }

    /// Whether lines from the middle of voxel `place` come to any of the unknown through a face behind which something is free.
    fn faces(&self, place: Voxel) -> bool {
        self.unknown.iter().any(|(unknown, open)| open.meets(entered(place, [*unknown; 2])))
    }

    /// Whether a camera in the middle of voxel `place` sees any of the unknown, and was not there in vain: as
    /// [`Target::seen_from`] says, which walks all lines to their ends.
    fn is_seen(&self, resolution: f64, free: &mut Near<'_>, place: Voxel) -> bool {
        let from = place.center(resolution);
        let mut sees = |(unknown, open): &(Voxel, Faces)| {
            open.meets(entered(place, [*unknown; 2]))
                && !hidden(free, place, *unknown)
                && in_sight(resolution, |voxel| free.contains(voxel), from, *unknown)
        };
        self.target.untried(place) && self.unknown.iter().any(&mut sees)
    }
}
