//! Which side of a surface is free, found out where a file does not say it right.
//!
//! Files have their faces turned in any way: a room that was drawn as a box looks outwards, a chair was mirrored, a
//! face was turned over by accident. What is free can be told without it, by parity: a ray from a free place to
//! infinity meets an odd number of surfaces, one for the shell around it and two for each solid on its way. So a point
//! is taken on both sides of some faces of each shell; if one side is free and the other is not, the face has to look
//! to the free one.
//!
//! Other files have no shell around the free space: their walls are solids of their own, as in a model of a building.
//! There an even number is free, and outside is free, too.

use elk_geometry::Bounds;
use nalgebra::{Point3, Vector3};

use crate::bvh::Bvh;
use crate::ray::Ray;
use crate::topology::{Shell, Topology, bounds_of_shell};
use crate::triangle::Triangle;
use elk_geometry::random::Random;

/// Directions in which surfaces are counted; none is along an axis or a diagonal, where worlds have their edges.
pub(crate) const PROBES: [[f64; 3]; 5] = [
    [0.5377, 0.2139, 0.8156],
    [-0.4811, 0.7273, 0.4894],
    [0.8213, -0.5319, -0.2061],
    [-0.3541, -0.6037, -0.7143],
    [0.1973, 0.9041, -0.3791],
];

/// How far before and behind a face it is looked, as a share of the world's diagonal.
const STEP: f64 = 1e-6;
/// Stream of random places.
const STREAM: u64 = 2;
/// Faces that are looked at, for all shells together, and for each at least and at most.
const LOOKS: usize = 4096;
const LEAST_LOOKS: usize = 3;
const MOST_LOOKS: usize = 24;
/// Shells that are looked at: the largest. The others, crumbs beside them, are taken to be as those are.
const MOST_SHELLS: usize = 4096;
/// A shell with less than this share of the world's surface is taken for a sheet if it cannot be told how it is turned: a screw
/// does not make a room unusable.
const CRUMB: f64 = 1e-3;
/// So many times as many faces have to say one thing as the other.
const CLEARLY: usize = 9;

/// How faces were turned in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Winding {
    /// Shells in all.
    pub shells: usize,
    /// Shells of which faces were turned over.
    pub turned: usize,
    /// Faces (triangles) that were turned over.
    pub turned_faces: usize,
    /// The shell around everything was turned the wrong way as a whole: the file has its inside out.
    pub inside_out: bool,
    /// The surfaces are those of solids, walls among them, and what is in none of them is free, outside, too.
    pub solids: bool,
    /// Shells that are sheets, with free space on both sides: nothing is in them.
    pub sheets: usize,
}

/// Faces that are turned against each other, and nothing says which of them are right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Undecided {
    /// An edge between two such faces (m, world).
    pub edge: [Point3<f64>; 2],
}

/// What the faces of a shell say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Orientation {
    /// The first face, and all that are turned as it is, look to the free side.
    Right,
    /// They look away from it.
    Wrong,
    /// There is free space on both sides.
    Sheet,
    Unclear,
}

/// Turns faces so that they look to the free side, where the file does not have it so. Besides what was done: which
/// triangles are of sheets.
///
/// # Errors
/// A shell has faces turned against each other, and it cannot be told which are right.
pub(crate) fn mend(
    surfaces: &mut Bvh,
    topology: &Topology,
    extents: &Bounds,
) -> Result<(Winding, Vec<bool>), Undecided> {
    let boxes: Vec<Bounds> = topology.shells.iter().map(|shell| bounds_of_shell(shell, surfaces.triangles())).collect();
    let around = outermost(&boxes);
    let inner = boxes.get(around).copied().unwrap_or(*extents);
    let classifier = Classifier::new(surfaces, topology, extents, looked_at(&topology.shells, &boxes, around));
    let mut orientations = classifier.orientations(&inner, false);
    let solids = orientations.get(around) == Some(&Orientation::Wrong)
        && most_are_wrong(&orientations, around) != Some(false)
        && classifier.rooms_are_between_solids(extents);
    if solids {
        orientations = classifier.orientations(extents, true);
    }
    let inside_out = orientations.get(around) == Some(&Orientation::Wrong);
    let others_wrong = most_are_wrong(&orientations, around).unwrap_or(inside_out);
    let mut winding = Winding { shells: topology.shells.len(), inside_out, solids, ..Winding::default() };
    let mut is_sheet = vec![false; surfaces.triangles().len()];
    let whole: f64 = surfaces.triangles().iter().map(|triangle| triangle.normal().norm()).sum();
    for (i, (shell, orientation)) in topology.shells.iter().zip(&orientations).enumerate() {
        let is_doubtful = || {
            let is_mixed = *orientation == Orientation::Unclear && shell.conflict.is_some() && !shell.closed;
            let crumb = || area(shell, surfaces.triangles(), |_| true) < CRUMB * whole;
            is_mixed && by_area(shell, &topology.against, surfaces.triangles()).is_none() && crumb()
        };
        if *orientation == Orientation::Sheet || is_doubtful() {
            winding.sheets += 1;
            shell.triangles.iter().for_each(|&i| is_sheet[i] = true);
            continue;
        }
        let turned_first = match (orientation, shell.conflict) {
            (Orientation::Wrong, _) => true,
            (Orientation::Unclear, None) => others_wrong,
            (Orientation::Unclear, Some(_)) if shell.closed => {
                let looks_outwards = volume(shell, &topology.against, surfaces.triangles()) > 0.0;
                looks_outwards == (i == around && !solids)
            }
            (Orientation::Unclear, Some(edge)) => {
                by_area(shell, &topology.against, surfaces.triangles()).ok_or(Undecided { edge })?
            }
            _ => false,
        };
        let turn: Vec<usize> =
            shell.triangles.iter().copied().filter(|&i| topology.against[i] != turned_first).collect();
        winding.turned += usize::from(!turn.is_empty());
        winding.turned_faces += turn.len();
        turn.into_iter().for_each(|i| surfaces.turn(i));
    }
    Ok((winding, is_sheet))
}

/// The volume in a closed shell (m³) all of whose faces are turned as its first one; negative if they look inwards.
fn volume(shell: &Shell, against: &[bool], triangles: &[Triangle]) -> f64 {
    let origin = triangles[shell.triangles[0]].0[0];
    let under = |i: &usize| {
        let [a, b, c] = triangles[*i].0.map(|corner| corner - origin);
        let volume = a.dot(&b.cross(&c)) / 6.0;
        if against[*i] { -volume } else { volume }
    };
    shell.triangles.iter().map(under).sum()
}

/// Whether most shells but the one around everything are turned the wrong way; `None`: it is known of none. A file
/// follows one habit: what is unclear is as the others are.
fn most_are_wrong(orientations: &[Orientation], around: usize) -> Option<bool> {
    let others = || orientations.iter().enumerate().filter(|(i, _)| *i != around).map(|(_, orientation)| orientation);
    let count = |wanted: Orientation| others().filter(|orientation| **orientation == wanted).count();
    let (right, wrong) = (count(Orientation::Right), count(Orientation::Wrong));
    (right + wrong > 0).then_some(wrong > right)
}

/// The shell with the largest box by volume; the first of them.
fn outermost(boxes: &[Bounds]) -> usize {
    let sizes: Vec<f64> = boxes.iter().map(|around| around.dim().product()).collect();
    (0..sizes.len()).rev().max_by(|&a, &b| sizes[a].total_cmp(&sizes[b])).unwrap_or_default()
}

/// The shells that are looked at: the one around everything, those of which nothing else decides, and the largest.
fn looked_at(shells: &[Shell], boxes: &[Bounds], around: usize) -> Vec<usize> {
    let mut all: Vec<usize> = (0..shells.len()).collect();
    if all.len() > MOST_SHELLS {
        let rank = |i: usize| (i != around, shells[i].closed || shells[i].conflict.is_none());
        let size = |i: usize| boxes[i].dim().norm();
        all.sort_by(|&a, &b| rank(a).cmp(&rank(b)).then(size(b).total_cmp(&size(a))));
        all.truncate(MOST_SHELLS);
    }
    all
}

/// Twice the area of those of its triangles that are meant (m²).
fn area(shell: &Shell, triangles: &[Triangle], is_meant: impl Fn(usize) -> bool) -> f64 {
    let those = shell.triangles.iter().filter(|&&i| is_meant(i));
    those.map(|&i| triangles[i].normal().norm()).sum()
}

/// Whether those that are turned against the first have nearly all of the area; `None`: neither has.
fn by_area(shell: &Shell, against: &[bool], triangles: &[Triangle]) -> Option<bool> {
    let [with, against] = [false, true].map(|wanted| area(shell, triangles, |i| against[i] == wanted));
    let clearly = CLEARLY as f64;
    match () {
        () if with >= clearly * against => Some(false),
        () if against >= clearly * with => Some(true),
        () => None,
    }
}

struct Classifier<'a> {
    surfaces: &'a Bvh,
    topology: &'a Topology,
    step: f64,
    /// Shells that are looked at, and faces of each.
    shells: Vec<usize>,
    looks: usize,
}

impl<'a> Classifier<'a> {
    fn new(surfaces: &'a Bvh, topology: &'a Topology, extents: &Bounds, shells: Vec<usize>) -> Self {
        let looks = (LOOKS / shells.len().max(1)).clamp(LEAST_LOOKS, MOST_LOOKS);
        Self { surfaces, topology, step: extents.dim().norm() * STEP, shells, looks }
    }

    fn orientations(&self, inner: &Bounds, free_is_even: bool) -> Vec<Orientation> {
        let shells = &self.topology.shells;
        let mut orientations: Vec<Option<Orientation>> = vec![None; shells.len()];
        for &i in &self.shells {
            orientations[i] = Some(self.orientation(&shells[i], inner, free_is_even));
        }
        let open =
            || orientations.iter().zip(shells).filter(|(_, shell)| !shell.closed).map(|(orientation, _)| *orientation);
        let count = |wanted: Orientation| open().filter(|orientation| *orientation == Some(wanted)).count();
        // Where nothing is known, nothing is taken to be in them.
        let most_are_sheets = count(Orientation::Sheet) >= count(Orientation::Right).max(count(Orientation::Wrong));
        let as_others = |shell: &Shell| match !shell.closed && most_are_sheets {
            true => Orientation::Sheet,
            false => Orientation::Unclear,
        };
        orientations
            .iter()
            .zip(shells)
            .map(|(orientation, shell)| orientation.unwrap_or_else(|| as_others(shell)))
            .collect()
    }

    /// Whether the free space is that between the surfaces' solids: a house whose walls have an outside and an inside,
    /// or a wall that is a box. Then more of the space that surfaces enclose is in none of the solids than in them.
    fn rooms_are_between_solids(&self, extents: &Bounds) -> bool {
        const PLACES: usize = 1000;
        const ENCLOSED: usize = 6;
        let mut random = Random::new(0, STREAM);
        let (mut between, mut within) = (0, 0);
        for _ in 0..PLACES {
            let place = Point3::from(std::array::from_fn(|i| random.between(extents.min[i], extents.max[i])));
            let counts = PROBES.map(Vector3::from).map(|d| [d, -d].map(|d| self.crossed(place, d)));
            let odd = counts.iter().filter(|[there, _]| there % 2 == 1).count();
            let met = counts.iter().flatten().filter(|count| **count > 0).count();
            match 2 * odd > PROBES.len() {
                true => within += 1,
                false => between += usize::from(met >= ENCLOSED),
            }
        }
        between > within
    }

    fn crossed(&self, origin: Point3<f64>, direction: Vector3<f64>) -> usize {
        let mut count = 0;
        self.surfaces.hits(&Ray::new(origin, direction), |_| count += 1);
        count
    }

    /// What faces of a shell say that lie in `inner`: outside of it everything is outside.
    fn orientation(&self, shell: &Shell, inner: &Bounds, free_is_even: bool) -> Orientation {
        let (mut right, mut wrong, mut alike) = (0, 0, 0);
        let stride = shell.triangles.len().div_ceil(self.looks).max(1);
        for &index in shell.triangles.iter().step_by(stride) {
            let Some((front, back)) = self.sides(index, inner) else { continue };
            match (front != free_is_even, back != free_is_even, self.topology.against[index]) {
                (true, true, _) => alike += 1,
                (true, false, false) | (false, true, true) => right += 1,
                (true, false, true) | (false, true, false) => wrong += 1,
                (false, false, _) => {}
            }
        }
        match () {
            () if !shell.closed && alike > 2 * (right + wrong) => Orientation::Sheet,
            () if right > 0 && right >= CLEARLY * wrong => Orientation::Right,
            () if wrong > 0 && wrong >= CLEARLY * right => Orientation::Wrong,
            () => Orientation::Unclear,
        }
    }

    /// Whether rays cross an odd number of surfaces that lead away from the middle of a triangle, before and behind it.
    /// They do not meet the triangle itself, and so tell a sheet from a wall.
    fn sides(&self, index: usize, inner: &Bounds) -> Option<(bool, bool)> {
        let triangle = self.surfaces.triangles()[index];
        let middle = triangle.middle();
        let normal = triangle.normal().try_normalize(0.0)?;
        inner.contains(middle).then(|| (self.is_odd_beyond(middle, normal), self.is_odd_beyond(middle, -normal)))
    }

    fn is_odd_beyond(&self, middle: Point3<f64>, normal: Vector3<f64>) -> bool {
        let origin = middle + normal * self.step;
        let odd = |direction: &[f64; 3]| {
            let direction = Vector3::from(*direction);
            let away = if direction.dot(&normal) < 0.0 { -direction } else { direction };
            self.crossed(origin, away) % 2 == 1
        };
        majority(&PROBES, odd)
    }
}

/// Whether most of them say so; no more are asked than are needed to know.
pub(crate) fn majority<T>(all: &[T], says: impl Fn(&T) -> bool) -> bool {
    let mut counts = [0; 2];
    for one in all {
        let count = &mut counts[usize::from(says(one))];
        *count += 1;
        if 2 * *count > all.len() {
            break;
        }
    }
    counts[1] > counts[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenery::{SITES, Scenery, Solid};
    use crate::triangle::bounds_of;

    fn mended(triangles: &[Triangle]) -> Result<(Winding, Vec<Triangle>), Undecided> {
        let extents = bounds_of(triangles.iter().flat_map(|t| &t.0));
        let mut bvh = Bvh::new(triangles.to_vec());
        let topology = Topology::of(bvh.triangles(), &extents);
        let (winding, _) = mend(&mut bvh, &topology, &extents)?;
        Ok((winding, bvh.triangles().to_vec()))
    }

    /// A room with a table, a box on it, and a beam that sticks out of it.
    fn room() -> Vec<Triangle> {
        let mut scenery = Scenery::within(Solid::block("room", [0.0; 3], [4.0, 3.0, 2.0]));
        scenery.block("table", [1.0, 1.0, 0.0], [2.0, 2.0, 0.8]);
        scenery.block("box", [1.2, 1.2, 0.8], [1.6, 1.6, 1.1]);
        scenery.block("beam", [-2.0, 0.5, 1.6], [5.5, 0.7, 1.8]);
        scenery.triangles_at(Vector3::zeros())
    }

    fn turned(triangles: &[Triangle], which: impl Fn(usize) -> bool) -> Vec<Triangle> {
        let turn = |(i, triangle): (usize, &Triangle)| {
            let [a, b, c] = triangle.0;
            if which(i) { Triangle([a, c, b]) } else { *triangle }
        };
        triangles.iter().enumerate().map(turn).collect()
    }

    #[test]
    fn what_is_right_is_left_as_it_is() {
        let mut worlds: Vec<_> = SITES.iter().map(|site| (site.name, (site.build)().triangles())).collect();
        worlds.push(("room", room()));
        for (name, triangles) in worlds {
            let (winding, after) = mended(&triangles).unwrap();
            assert_eq!((winding.turned, winding.inside_out, winding.sheets), (0, false, 0), "{name}");
            assert_eq!(after, Bvh::new(triangles).triangles(), "{name}");
        }
    }

    #[test]
    fn worlds_turned_inside_out_solids_and_single_faces_are_mended() {
        let right = Bvh::new(room()).triangles().to_vec();
        type Which = fn(usize) -> bool;
        let cases = [
            ("all", (|_| true) as Which, 4),
            ("the shell", |i| i < 12, 1),
            ("all but the shell", |i| i >= 12, 3),
            ("one face of the table", |i| i == 15, 1),
            ("every third face", |i| i % 3 == 0, 4),
        ];
        for (name, which, shells) in cases {
            let (winding, after) = mended(&turned(&room(), which)).unwrap();
            let wrong: Vec<usize> = (0..right.len()).filter(|&i| after[i] != right[i]).collect();
            assert!(wrong.is_empty(), "{name}: {wrong:?} {winding:?}");
            assert_eq!(winding.turned, shells, "{name}");
        }
    }

    #[test]
    fn a_sheet_is_told_from_a_wall() {
        let mut triangles = room();
        triangles.truncate(12);
        let curtain =
            [[[3.0, 0.5, 0.2], [3.0, 2.5, 0.2], [3.0, 2.5, 1.7]], [[3.0, 0.5, 0.2], [3.0, 2.5, 1.7], [3.0, 0.5, 1.7]]];
        triangles.extend(curtain.map(|t| Triangle(t.map(Point3::from))));
        let (winding, _) = mended(&triangles).unwrap();
        assert_eq!((winding.shells, winding.sheets, winding.turned), (2, 1, 0));
    }

    /// Regression: three faces of each shell were looked at, however many shells there were.
    #[test]
    fn of_many_shells_the_largest_speak_for_the_others() {
        let mut scenery = Scenery::within(Solid::block("room", [0.0; 3], [4.0, 3.0, 2.0]));
        let places: Vec<Vector3<f64>> = (0..5000)
            .map(|i| Vector3::new(f64::from(i % 70) * 0.03 + 1.0, f64::from(i / 70) * 0.03 + 0.4, 0.3))
            .collect();
        for at in &places {
            let [low, high] = [0.0, 0.01].map(|edge| at.add_scalar(edge).into());
            scenery.block("crumb", low, high);
        }
        let mut triangles = turned(&scenery.triangles_at(Vector3::zeros()), |i| i >= 12);
        let leaf = [[0.0, 0.0, 1.0], [0.01, 0.0, 1.0], [0.0, 0.01, 1.0]];
        triangles.extend(places.iter().map(|at| Triangle(leaf.map(|corner| Point3::from(corner) + at))));
        let extents = bounds_of(triangles.iter().flat_map(|t| &t.0));
        let topology = Topology::of(&triangles, &extents);
        let boxes: Vec<Bounds> = topology.shells.iter().map(|shell| bounds_of_shell(shell, &triangles)).collect();
        let looked_at = looked_at(&topology.shells, &boxes, 0);
        assert_eq!((topology.shells.len(), looked_at.len(), looked_at[0]), (10_001, MOST_SHELLS, 0));
        let (winding, _) = mended(&triangles).unwrap();
        assert_eq!((winding.sheets, winding.turned, winding.inside_out), (5000, 5000, false), "{winding:?}");
    }
}
