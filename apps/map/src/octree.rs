//! The map as the pruned octree that OctoMap's files hold (Hornung et al., *OctoMap*, 2013, section 3.3).
//!
//! Sixteen levels over 2¹⁶ voxels an axis; child `i` is the upper half along x, y, z where bits 0, 1, 2 of `i` are set.
//! Eight equal leaves are one leaf a level up, so a leaf above the lowest level stands for its whole cube.

use elk_geometry::Voxel;

use crate::occupancy::OccupancyMap;

/// Levels below the root.
pub const DEPTH: u32 = 16;
/// What a voxel index lacks to its OctoMap key.
const KEY_OF_ZERO: i32 = 1 << (DEPTH - 1);
/// The lowest voxel of all.
pub(crate) const ROOT: Voxel = Voxel::new(-KEY_OF_ZERO, -KEY_OF_ZERO, -KEY_OF_ZERO);

/// A node and everything below it.
#[derive(Debug, Clone, PartialEq)]
pub enum Node<V> {
    /// Nothing is known of the cube.
    Unknown,
    /// The whole cube has this value.
    Leaf(V),
    /// The eight halves-along-each-axis, at least one of them known.
    Inner(Box<[Node<V>; 8]>),
}

/// A cube of the octree that has one value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cube<V> {
    /// Its lowest voxel.
    pub min: Voxel,
    /// Its edge, in voxels.
    pub edge: u32,
    /// Its value.
    pub value: V,
}

impl<V: Copy + PartialEq> Node<V> {
    /// The pruned tree of a set of voxels, each with its value; of a voxel given twice the last value counts. Voxels
    /// outside OctoMap's 16 bits are not in it.
    pub fn from_voxels(voxels: impl IntoIterator<Item = (Voxel, V)>) -> Self {
        let mut sorted: Vec<(u64, V)> =
            voxels.into_iter().filter(|(v, _)| v.is_mappable()).map(|(v, value)| (path_of(v), value)).collect();
        sorted.sort_by_key(|(path, _)| *path);
        Self::of_sorted(&sorted, 0)
    }

    /// The tree of the voxels that share the first `depth` steps of their paths.
    fn of_sorted(voxels: &[(u64, V)], depth: u32) -> Self {
        let Some(&(_, last)) = voxels.last() else {
            return Node::Unknown;
        };
        if depth == DEPTH {
            return Node::Leaf(last);
        }
        let shift = 3 * (DEPTH - 1 - depth);
        let mut rest = voxels;
        let children = std::array::from_fn(|child| {
            let (own, others) = rest.split_at(rest.partition_point(|(path, _)| path >> shift & 7 <= child as u64));
            rest = others;
            Self::of_sorted(own, depth + 1)
        });
        Self::pruned(children)
    }

    fn pruned(children: [Node<V>; 8]) -> Self {
        match &children[0] {
            Node::Leaf(value) if children.iter().all(|c| *c == children[0]) => Node::Leaf(*value),
            _ => Node::Inner(Box::new(children)),
        }
    }

    /// Number of nodes as OctoMap counts them: leaves and inner nodes, the root included, unknown cubes not.
    pub fn count(&self) -> usize {
        match self {
            Node::Unknown => 0,
            Node::Leaf(_) => 1,
            Node::Inner(children) => 1 + children.iter().map(Node::count).sum::<usize>(),
        }
    }

    /// The value of the cube that holds a voxel; `None` if it is unknown.
    pub fn get(&self, voxel: Voxel) -> Option<V> {
        let path = path_of(voxel);
        let mut node = self;
        for depth in 0..=DEPTH {
            match node {
                Node::Unknown => return None,
                Node::Leaf(value) => return Some(*value),
                Node::Inner(_) if depth == DEPTH => return None,
                Node::Inner(children) => {
                    node = &children[(path >> (3 * (DEPTH - 1 - depth)) & 7) as usize];
                }
            }
        }
        None
    }

    /// All known cubes, in the order of the files: depth first, children by index.
    pub fn cubes(&self) -> Vec<Cube<V>> {
        let mut cubes = Vec::new();
        self.collect(Cube { min: ROOT, edge: 1 << DEPTH, value: () }, &mut cubes);
        cubes
    }

    fn collect(&self, own: Cube<()>, cubes: &mut Vec<Cube<V>>) {
        match self {
            Node::Unknown => {}
            Node::Leaf(value) => cubes.push(Cube { min: own.min, edge: own.edge, value: *value }),
            // A tree made by hand may be too deep; its cubes would be smaller than a voxel.
            Node::Inner(_) if own.edge == 1 => {}
            Node::Inner(children) => {
                (0..).zip(children.iter()).for_each(|(i, child)| child.collect(half(own, i), cubes))
            }
        }
    }
}

/// Child `i` of a cube: half as long, the upper half along x, y, z where bits 0, 1, 2 of `i` are set.
#[inline]
pub(crate) fn half(cube: Cube<()>, i: u32) -> Cube<()> {
    let edge = cube.edge / 2;
    let upper = |axis: u32| ((i >> axis & 1) * edge) as i32;
    Cube { min: cube.min + Voxel::new(upper(0), upper(1), upper(2)), edge, value: () }
}

impl OccupancyMap {
    /// The map as an octree of occupied (`true`) and free voxels: what a `.bt` file holds.
    pub fn occupancy_tree(&self) -> Node<bool> {
        Node::from_voxels(self.known().map(|(v, log_odds)| (v, log_odds > 0.0)))
    }

    /// The map as an octree of log-odds: what an `.ot` file holds.
    pub fn log_odds_tree(&self) -> Node<f32> {
        Node::from_voxels(self.known())
    }
}

/// The way from the root to a voxel, three bits a level, the root's choice highest.
fn path_of(voxel: Voxel) -> u64 {
    let [x, y, z] = voxel.to_array().map(|c| spread((c + KEY_OF_ZERO) as u16));
    x | y << 1 | z << 2
}

/// The bits of a key, two zeros between each.
fn spread(key: u16) -> u64 {
    (0..DEPTH).fold(0, |spread, bit| spread | (u64::from(key) >> bit & 1) << (3 * bit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    proptest! {
        #[test]
        fn a_tree_holds_its_voxels_and_nothing_else(voxels in prop::collection::btree_map((-3..3i32, -3..3i32, -3..3i32), any::<bool>(), 0..200)) {
            let voxels: BTreeMap<Voxel, bool> = voxels.into_iter().map(|((x, y, z), v)| (Voxel::new(x, y, z), v)).collect();
            let tree = Node::from_voxels(voxels.iter().map(|(v, o)| (*v, *o)));
            let mut back = BTreeMap::new();
            for cube in tree.cubes() {
                let edge = cube.edge as i32;
                for i in 0..edge.pow(3) {
                    back.insert(cube.min + Voxel::new(i % edge, i / edge % edge, i / edge / edge), cube.value);
                }
            }
            for (v, o) in &voxels {
                prop_assert_eq!(tree.get(*v), Some(*o));
            }
            prop_assert_eq!(back, voxels);
        }
    }

    #[test]
    fn eight_equal_leaves_are_one() {
        let cube = |value: fn(i32) -> bool| (0..8).map(move |i| (Voxel::new(i & 1, i >> 1 & 1, i >> 2), value(i)));
        assert_eq!(Node::from_voxels(cube(|_| true)).count(), 16);
        assert_eq!(Node::from_voxels(cube(|i| i == 0)).count(), 16 + 8);
        assert_eq!(Node::<bool>::from_voxels([]).count(), 0);
        assert_eq!(Node::from_voxels([(Voxel::new(40_000, 0, 0), true)]), Node::Unknown);
    }
}
