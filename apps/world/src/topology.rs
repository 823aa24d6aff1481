//! Which triangles hang together, how they are turned against each other, and where a surface ends.

use std::collections::HashMap;

use elk_geometry::Bounds;
use nalgebra::Point3;

use crate::triangle::{Triangle, bounds_of};

/// Corners nearer to each other than this share of the world's diagonal are one.
pub(crate) const WELD: f64 = 1e-7;

/// What hangs together over edges that two triangles share.
#[derive(Debug, Clone)]
pub(crate) struct Shell {
    /// Its triangles, as indices.
    pub triangles: Vec<usize>,
    /// No edge of it has one triangle alone.
    pub closed: bool,
    /// An edge where two neighbours are turned against each other.
    pub conflict: Option<[Point3<f64>; 2]>,
}

/// An edge that belongs to one triangle alone.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rim {
    /// Its ends (m, world).
    pub ends: [Point3<f64>; 2],
    /// Its ends as welded corners.
    pub corners: [u32; 2],
    /// Its triangle.
    pub triangle: usize,
}

/// An edge at which three triangles or more meet.
#[derive(Debug, Clone)]
pub(crate) struct Junction {
    /// How long it is (m).
    pub length: f64,
    /// Its triangles' shells, in order; one as often as it has triangles there.
    pub shells: Vec<usize>,
}

/// How triangles hang together.
#[derive(Debug, Clone)]
pub(crate) struct Topology {
    /// In the order of their first triangles.
    pub shells: Vec<Shell>,
    /// Of each triangle: whether it is turned against the first one of its shell.
    pub against: Vec<bool>,
    /// Where surfaces end.
    pub rims: Vec<Rim>,
    /// Where more than two triangles meet.
    pub junctions: Vec<Junction>,
}

/// One side of a triangle: its edge's corners, smaller first, whether it runs from the smaller to the larger.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    edge: (u32, u32),
    triangle: usize,
    forward: bool,
}

impl Topology {
    /// That of these triangles, all of whose corners lie in `extents`.
    pub fn of(triangles: &[Triangle], extents: &Bounds) -> Self {
        let corners = welded(triangles, extents);
        let mut sides: Vec<Side> =
            corners.iter().enumerate().flat_map(|(triangle, corners)| sides(triangle, *corners)).collect();
        sides.sort_unstable();
        let mut links = Links::new(triangles.len());
        let (mut rims, mut conflicts, mut junctions) = (Vec::new(), Vec::new(), Vec::new());
        let ends = |side: &Side| {
            let at = |corner: u32| {
                let found = corners[side.triangle].iter().position(|&c| c == corner);
                debug_assert!(found.is_some(), "a side ends at corners of its triangle");
                found.unwrap_or_default()
            };
            [side.edge.0, side.edge.1].map(|corner| triangles[side.triangle].0[at(corner)])
        };
        for group in sides.chunk_by(|a, b| a.edge == b.edge) {
            match group {
                [one] => {
                    rims.push(Rim { ends: ends(one), corners: [one.edge.0, one.edge.1], triangle: one.triangle });
                }
                [a, b] => {
                    let against = a.forward == b.forward;
                    links.join(a.triangle, b.triangle, against);
                    if against {
                        conflicts.push((a.triangle, ends(a)));
                    }
                }
                more => {
                    let [from, to] = ends(&more[0]);
                    let triangles = more.iter().map(|side| side.triangle).collect();
                    junctions.push(Junction { length: (to - from).norm(), shells: triangles });
                }
            }
        }
        Self::assembled(links, rims, &conflicts, junctions)
    }

    /// The junctions have their triangles in place of the shells.
    fn assembled(
        mut links: Links,
        rims: Vec<Rim>,
        conflicts: &[(usize, [Point3<f64>; 2])],
        mut junctions: Vec<Junction>,
    ) -> Self {
        let count = links.parent.len();
        let mut shell_of_root = HashMap::new();
        let mut shells: Vec<Shell> = Vec::new();
        let mut shell_of = Vec::with_capacity(count);
        let mut against = Vec::with_capacity(count);
        for triangle in 0..count {
            let (root, turned) = links.root(triangle);
            let shell = *shell_of_root.entry(root).or_insert(shells.len());
            if shell == shells.len() {
                shells.push(Shell { triangles: Vec::new(), closed: true, conflict: None });
            }
            shells[shell].triangles.push(triangle);
            shell_of.push(shell);
            let first = shells[shell].triangles[0];
            let as_first = if first == triangle { turned } else { links.root(first).1 };
            against.push(turned != as_first);
        }
        rims.iter().for_each(|rim| shells[shell_of[rim.triangle]].closed = false);
        for (triangle, edge) in conflicts {
            shells[shell_of[*triangle]].conflict.get_or_insert(*edge);
        }
        for junction in &mut junctions {
            junction.shells.iter_mut().for_each(|triangle| *triangle = shell_of[*triangle]);
            junction.shells.sort_unstable();
        }
        Self { shells, against, rims, junctions }
    }
}

fn sides(triangle: usize, [a, b, c]: [u32; 3]) -> impl Iterator<Item = Side> {
    let side = move |(from, to): (u32, u32)| Side { edge: (from.min(to), from.max(to)), triangle, forward: from < to };
    // Two corners that were welded together have no edge between them.
    [(a, b), (b, c), (c, a)].into_iter().filter(|(from, to)| from != to).map(side)
}

/// A number for each corner; the same for those that are in one place.
fn welded(triangles: &[Triangle], extents: &Bounds) -> Vec<[u32; 3]> {
    let cell = (extents.dim().norm() * WELD).max(f64::MIN_POSITIVE);
    let mut numbers: HashMap<[i64; 3], u32> = HashMap::new();
    let mut number = |corner: Point3<f64>| {
        let key = [0, 1, 2].map(|axis| ((corner[axis] - extents.min[axis]) / cell).round() as i64);
        let next = numbers.len() as u32;
        *numbers.entry(key).or_insert(next)
    };
    triangles.iter().map(|triangle| triangle.0.map(&mut number)).collect()
}

/// Sets that are joined, each member turned with or against its set's root.
pub(crate) struct Links {
    parent: Vec<usize>,
    /// Against the parent.
    turned: Vec<bool>,
}

impl Links {
    pub fn new(count: usize) -> Self {
        Self { parent: (0..count).collect(), turned: vec![false; count] }
    }

    /// The root of a member's set, and whether the member is turned against it. The way there is shortened.
    pub fn root(&mut self, member: usize) -> (usize, bool) {
        let (mut at, mut turned) = (member, false);
        while self.parent[at] != at {
            let above = self.parent[at];
            // Half the way: to the grandparent.
            self.turned[at] ^= self.turned[above];
            self.parent[at] = self.parent[above];
            turned ^= self.turned[at];
            at = self.parent[at];
        }
        (at, turned)
    }

    /// Joins two sets. Where both are one already and disagree, the surface has one side only; the first word counts.
    pub fn join(&mut self, a: usize, b: usize, against: bool) {
        let ((root_a, turned_a), (root_b, turned_b)) = (self.root(a), self.root(b));
        if root_a != root_b {
            let (root, under) = (root_a.min(root_b), root_a.max(root_b));
            self.parent[under] = root;
            self.turned[under] = turned_a ^ turned_b ^ against;
        }
    }
}

/// The box around a shell.
pub(crate) fn bounds_of_shell(shell: &Shell, triangles: &[Triangle]) -> Bounds {
    bounds_of(shell.triangles.iter().flat_map(|&i| &triangles[i].0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenery::{Scenery, Solid};
    use nalgebra::Vector3;

    fn topology(triangles: &[Triangle]) -> Topology {
        Topology::of(triangles, &bounds_of(triangles.iter().flat_map(|t| &t.0)))
    }

    #[test]
    fn solids_are_shells_and_a_missing_face_leaves_a_rim() {
        let mut scenery = Scenery::within(Solid::block("room", [0.0; 3], [4.0, 3.0, 2.0]));
        scenery.block("box", [1.0; 3], [1.5; 3]);
        let mut triangles = scenery.triangles_at(Vector3::zeros());
        let whole = topology(&triangles);
        assert_eq!(whole.shells.iter().map(|s| (s.triangles.len(), s.closed)).collect::<Vec<_>>(), [(12, true); 2]);
        assert!(whole.rims.is_empty() && whole.against.iter().all(|&against| !against));
        triangles[3].0.swap(0, 1);
        triangles.remove(14);
        let broken = topology(&triangles);
        assert_eq!(
            broken.shells.iter().map(|s| (s.closed, s.conflict.is_some())).collect::<Vec<_>>(),
            [(true, true), (false, false)]
        );
        assert_eq!(broken.rims.len(), 3);
        assert_eq!(broken.against.iter().enumerate().filter(|(_, a)| **a).map(|(i, _)| i).collect::<Vec<_>>(), [3]);
    }
}
