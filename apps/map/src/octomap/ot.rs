//! `.ot` files: log-odds. Every node is an f32 and a byte that says which children exist.

use std::io::{self, Write};

use crate::bytes::Bytes;
use crate::octomap::header::{self, Header};
use crate::octree::Node;
use crate::tree_file::{INNER, Read, TreeFile, TreeFileError, Value};

/// How an `.ot` file begins.
pub(crate) const MAGIC: &str = "# Octomap OcTree file";

/// Writes an `.ot` file of voxels of `resolution` (m) and their log-odds; an inner node has its largest child's. The same tree
/// has the bytes that OctoMap gives it.
pub fn write_ot(out: &mut impl Write, tree: &Node<f32>, resolution: f64) -> io::Result<()> {
    let mut data = Vec::new();
    write_node(&mut data, tree);
    header::write(out, MAGIC, tree.count(), resolution)?;
    out.write_all(&data)
}

/// Answers the node's log-odds; −∞ for an unknown one, which has no record.
fn write_node(data: &mut Vec<u8>, node: &Node<f32>) -> f32 {
    match node {
        Node::Unknown => f32::NEG_INFINITY,
        Node::Leaf(log_odds) => {
            data.extend(log_odds.to_le_bytes());
            data.push(0);
            *log_odds
        }
        Node::Inner(children) => {
            let start = data.len();
            let exists = |i: &usize| children[*i] != Node::Unknown;
            let mask = (0..8).filter(exists).fold(0, |mask, i| mask | 1u8 << i);
            data.extend([0, 0, 0, 0, mask]);
            let largest = children.iter().map(|child| write_node(data, child)).fold(f32::NEG_INFINITY, f32::max);
            data[start..start + 4].copy_from_slice(&largest.to_le_bytes());
            largest
        }
    }
}

/// Reads the log-odds of an `.ot` file: of an `OcTree`, an `OcTreeStamped` (whose times are in no file), or a `ColorOcTree`,
/// whose colours are left out.
///
/// # Errors
/// It is no such file, is cut off or damaged.
pub fn read_ot(bytes: &[u8]) -> Result<TreeFile<'_, f32>, TreeFileError> {
    let (header, data) = Header::read(bytes, MAGIC)?;
    let beside = match header.kind.as_str() {
        "OcTree" | "OcTreeStamped" => 0,
        "ColorOcTree" => 3,
        _ => {
            let right = "an OcTree, an OcTreeStamped or a ColorOcTree, which have log-odds";
            return Err(TreeFileError::Kind { found: header.kind, right });
        }
    };
    header.tree(data, beside)
}

impl Value for f32 {
    fn read(_: u32, beside: usize, data: &mut Bytes<'_>) -> Result<Read<Self>, TreeFileError> {
        let at = data.at();
        let log_odds = data.f32()?;
        data.skip(beside)?;
        let children = u32::from(data.u8()?);
        match (log_odds.is_finite(), children) {
            (false, _) => Err(TreeFileError::LogOdds { at, found: log_odds }),
            (true, 0) => Ok(Read::Leaf(log_odds)),
            (true, _) => Ok(Read::Inner((0..8).fold(0, |all, i| all | ((children >> i & 1) * INNER) << (2 * i)))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_geometry::Voxel;
    use proptest::prelude::*;

    fn bytes_of(tree: &Node<f32>) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_ot(&mut bytes, tree, 0.1).unwrap();
        bytes
    }

    /// Voxels with few values, so that some cubes are pruned.
    fn voxels() -> impl Strategy<Value = Vec<(Voxel, f32)>> {
        let index = || prop_oneof![-4..4i32, Just(-32768), Just(32767)];
        let value = prop_oneof![Just(-2.0f32), Just(0.85), -2.0..3.5f32];
        prop::collection::vec(((index(), index(), index()).prop_map(|(x, y, z)| Voxel::new(x, y, z)), value), 0..150)
    }

    /// The file of a tree whose nodes have `beside` bytes beside their log-odds.
    fn with_beside(tree: &Node<f32>, kind: &str, beside: usize) -> Vec<u8> {
        let file = bytes_of(tree);
        let data = file.windows(5).position(|w| w == b"data\n").unwrap() + 5;
        let header = String::from_utf8(file[..data].to_vec()).unwrap().replace("id OcTree", &format!("id {kind}"));
        let node = |node: &[u8]| [&node[..4], &vec![7; beside], &node[4..]].concat();
        [header.as_bytes(), &file[data..].chunks(5).flat_map(node).collect::<Vec<_>>()].concat()
    }

    proptest! {
        #[test]
        fn what_was_written_is_read(voxels in voxels()) {
            let tree = Node::from_voxels(voxels);
            for (kind, beside) in [("OcTree", 0), ("1", 0), ("OcTreeStamped", 0), ("ColorOcTree", 3)] {
                let bytes = with_beside(&tree, kind, beside);
                let file = read_ot(&bytes).unwrap();
                prop_assert_eq!((file.resolution, file.nodes), (0.1, tree.count()));
                prop_assert_eq!(file.cubes().collect::<Vec<_>>(), tree.cubes(), "{}", kind);
            }
        }

        #[test]
        fn damaged_files_are_refused(voxels in voxels(), cut in any::<prop::sample::Index>(), flip in any::<prop::sample::Index>(), bit in 0..8u8) {
            prop_assume!(!voxels.is_empty());
            let mut bytes = bytes_of(&Node::from_voxels(voxels));
            prop_assert!(read_ot(&bytes[..cut.index(bytes.len())]).is_err());
            // A flipped bit may make another map of it, or none; it must not do anything else.
            let at = flip.index(bytes.len());
            bytes[at] ^= 1 << bit;
            let _ = read_ot(&bytes);
        }

        #[test]
        fn any_data_are_a_tree_or_an_error(data in prop::collection::vec(any::<u8>(), 0..300)) {
            let mut bytes = format!("{MAGIC}\nid OcTree\nsize 99999999999\nres 0.1\ndata\n").into_bytes();
            bytes.extend(data);
            prop_assert!(read_ot(&bytes).is_err());
        }
    }

    #[test]
    fn every_kind_of_damage_has_its_error() {
        let file = |header: &str, data: &[u8]| [format!("{MAGIC}\n{header}data\n").as_bytes(), data].concat();
        let read = |header: &str, data: &[u8]| read_ot(&file(header, data)).unwrap_err();
        let good = "id OcTree\nsize 1\nres 0.1\n";
        let start = file(good, &[]).len();
        assert_eq!(read_ot(b"# Octomap OcTree binary file\n"), Err(TreeFileError::Magic(MAGIC)));
        let counting = read("id CountingOcTree\nsize 1\nres 0.1\n", &[]).to_string();
        assert!(counting.starts_with("the file holds a `CountingOcTree`; right is an OcTree"), "{counting}");
        assert_eq!(read(good, &[]), TreeFileError::Truncated(start));
        assert_eq!(read(good, &[0, 0, 0, 0]), TreeFileError::Truncated(start + 4));
        assert_eq!(read(good, &[0; 6]), TreeFileError::Trailing(1));
        assert_eq!(read(good, &[0, 0, 0, 0, 1, 0, 0, 0, 0, 0]), TreeFileError::Count { announced: 1, found: 2 });
        assert_eq!(read(good, &[0, 0, 0, 0, 1].repeat(20)), TreeFileError::TooDeep(start + 80));
        let infinite = [&f32::INFINITY.to_le_bytes()[..], &[0]].concat();
        assert_eq!(read(good, &infinite), TreeFileError::LogOdds { at: start, found: f32::INFINITY });
    }

    #[test]
    fn a_file_is_five_bytes_a_node_and_an_inner_node_has_its_largest_child_s_log_odds() {
        let tree = Node::from_voxels([(Voxel::new(0, 0, 0), 0.85f32), (Voxel::new(-1, 0, 0), -0.4)]);
        let bytes = bytes_of(&tree);
        let data = bytes.windows(5).position(|w| w == b"data\n").unwrap() + 5;
        assert_eq!(bytes.len() - data, 5 * tree.count());
        assert_eq!(bytes[data..data + 4], 0.85f32.to_le_bytes());
        let world = bytes_of(&Node::Leaf(0.5));
        let cubes: Vec<_> = read_ot(&world).unwrap().cubes().collect();
        assert_eq!(cubes, Node::Leaf(0.5).cubes(), "one cube is the world");
    }
}
