//! `.bt` files: occupied, free or unknown. Every inner node is a little-endian u16 with two bits a child: 0 unknown, 1 free, 2
//! occupied, 3 inner; the inner children's records follow in order.

use std::io::{self, Write};

use crate::bytes::Bytes;
use crate::octomap::header::{self, Header};
use crate::octree::Node;
use crate::tree_file::{INNER, Read, TreeFile, TreeFileError, Value};

/// How a `.bt` file begins.
pub(crate) const MAGIC: &str = "# Octomap OcTree binary file";
/// How one of before 2011 begins, whose header is binary: the number of its kind of tree.
pub(crate) const LEGACY_MAGIC: [u8; 4] = [3, 0, 0, 0];

/// Writes a `.bt` file of voxels of `resolution` (m): `true` occupied, `false` free. The same tree has the bytes that OctoMap
/// gives it.
pub fn write_bt(out: &mut impl Write, tree: &Node<bool>, resolution: f64) -> io::Result<()> {
    let split;
    let tree = match tree {
        // The root has no record in the format unless it is an inner node.
        Node::Leaf(_) => {
            split = Node::Inner(Box::new(std::array::from_fn(|_| tree.clone())));
            &split
        }
        _ => tree,
    };
    let mut data = Vec::new();
    write_node(&mut data, tree);
    header::write(out, MAGIC, tree.count(), resolution)?;
    out.write_all(&data)
}

fn write_node(data: &mut Vec<u8>, node: &Node<bool>) {
    let Node::Inner(children) = node else { return };
    let code = |child: &Node<bool>| match child {
        Node::Unknown => 0u16,
        Node::Leaf(false) => 1,
        Node::Leaf(true) => 2,
        Node::Inner(_) => 3,
    };
    let record = children.iter().rev().fold(0, |record, child| record << 2 | code(child));
    data.extend(record.to_le_bytes());
    for child in children.iter() {
        write_node(data, child);
    }
}

/// Reads a `.bt` file, of before 2011 as well.
///
/// # Errors
/// It is no such file, is cut off or damaged.
pub fn read_bt(bytes: &[u8]) -> Result<TreeFile<'_, bool>, TreeFileError> {
    let (header, data) =
        if bytes.starts_with(&LEGACY_MAGIC) { legacy_header(bytes)? } else { Header::read(bytes, MAGIC)? };
    if header.kind != "OcTree" {
        let right = "an OcTree, which alone has a .bt form: convert it with OctoMap's convert_octree";
        return Err(TreeFileError::Kind { found: header.kind, right });
    }
    header.tree(data, 0)
}

/// The header of before 2011: an i32 for the kind of tree, the resolution as an f64, and the number of nodes as a u32.
fn legacy_header(bytes: &[u8]) -> Result<(Header, Bytes<'_>), TreeFileError> {
    let mut data = Bytes::new(bytes, 0);
    data.skip(LEGACY_MAGIC.len())?;
    let (resolution, nodes) = (data.f64()?, data.u32()? as usize);
    match resolution.is_finite() && resolution > 0.0 {
        true => Ok((Header { kind: "OcTree".to_owned(), nodes, resolution }, data)),
        false => Err(TreeFileError::Resolution(resolution)),
    }
}

impl Value for bool {
    fn read(bits: u32, _: usize, data: &mut Bytes<'_>) -> Result<Read<Self>, TreeFileError> {
        Ok(match bits {
            INNER => Read::Inner(data.u16()?.into()),
            leaf => Read::Leaf(leaf == 2),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use elk_geometry::Voxel;
    use proptest::prelude::*;

    fn bytes_of(tree: &Node<bool>) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_bt(&mut bytes, tree, 0.1).unwrap();
        bytes
    }

    fn voxels() -> impl Strategy<Value = Vec<(Voxel, bool)>> {
        let index = || prop_oneof![-4..4i32, Just(-32768), Just(32767)];
        prop::collection::vec(
            ((index(), index(), index()).prop_map(|(x, y, z)| Voxel::new(x, y, z)), any::<bool>()),
            0..150,
        )
    }

    proptest! {
        #[test]
        fn what_was_written_is_read(voxels in voxels()) {
            let tree = Node::from_voxels(voxels);
            let bytes = bytes_of(&tree);
            let file = read_bt(&bytes).unwrap();
            prop_assert_eq!((file.resolution, file.nodes), (0.1, tree.count()));
            prop_assert_eq!(file.cubes().collect::<Vec<_>>(), tree.cubes());
        }

        #[test]
        fn damaged_files_are_refused(voxels in voxels(), cut in any::<prop::sample::Index>(), flip in any::<prop::sample::Index>(), bit in 0..8u8) {
            prop_assume!(!voxels.is_empty());
            let mut bytes = bytes_of(&Node::from_voxels(voxels));
            prop_assert!(read_bt(&bytes[..cut.index(bytes.len())]).is_err());
            // A flipped bit may make another map of it, or none; it must not do anything else.
            let at = flip.index(bytes.len());
            bytes[at] ^= 1 << bit;
            let _ = read_bt(&bytes);
        }

        #[test]
        fn any_data_are_a_tree_or_an_error(data in prop::collection::vec(any::<u8>(), 0..300)) {
            let mut bytes = format!("{MAGIC}\nid OcTree\nsize 99999999999\nres 0.1\ndata\n").into_bytes();
            bytes.extend(data);
            prop_assert!(read_bt(&bytes).is_err());
        }
    }

    #[test]
    fn every_kind_of_damage_has_its_error() {
        let file = |header: &str, data: &[u8]| [format!("{MAGIC}\n{header}data\n").as_bytes(), data].concat();
        let read = |header: &str, data: &[u8]| read_bt(&file(header, data)).unwrap_err();
        let good = "id OcTree\nsize 2\nres 0.1\n";
        assert_eq!(read_bt(b"ply\n"), Err(TreeFileError::Magic(MAGIC)));
        assert_eq!(read_bt(&file(good, &[])[..40]), Err(TreeFileError::HeaderEnd));
        assert_eq!(read("size 2\nres 0.1\n", &[]), TreeFileError::Missing("id OcTree"));
        let colours = read("id ColorOcTree\nsize 2\nres 0.1\n", &[]);
        assert!(matches!(colours, TreeFileError::Kind { found, .. } if found == "ColorOcTree"));
        assert!(matches!(read("id OcTree\nsize 2\nres -1\n", &[]), TreeFileError::Header { line: 4, .. }));
        assert!(matches!(read(good, &[1]), TreeFileError::Truncated(_)));
        assert_eq!(read(good, &[1, 0, 0]), TreeFileError::Trailing(1));
        assert_eq!(read(good, &[5, 0]), TreeFileError::Count { announced: 2, found: 3 });
        assert!(matches!(read(good, &[3, 0].repeat(20)), TreeFileError::TooDeep(_)));
    }

    #[test]
    fn a_world_of_one_value_can_be_written() {
        let bytes = bytes_of(&Node::Leaf(true));
        let file = read_bt(&bytes).unwrap();
        assert!(file.nodes == 9 && file.cubes().all(|cube| cube.value && cube.edge == 1 << 15));
        assert_eq!(file.cubes().count(), 8);
    }

    #[test]
    fn a_file_of_before_2011_is_read() {
        let tree = Node::from_voxels([(Voxel::new(0, 0, 0), true), (Voxel::new(-1, 5, 9), false)]);
        let file = bytes_of(&tree);
        let data = &file[file.windows(5).position(|w| w == b"data\n").unwrap() + 5..];
        let legacy = |resolution: f64, nodes: u32| {
            [&LEGACY_MAGIC[..], &resolution.to_le_bytes(), &nodes.to_le_bytes(), data].concat()
        };
        let nodes = tree.count() as u32;
        let bytes = legacy(0.25, nodes);
        let read = read_bt(&bytes).unwrap();
        assert_eq!((read.resolution, read.cubes().collect()), (0.25, tree.cubes()));
        assert_eq!(read_bt(&legacy(-1.0, nodes)), Err(TreeFileError::Resolution(-1.0)));
        assert!(matches!(read_bt(&legacy(0.25, u32::MAX)), Err(TreeFileError::Count { .. })));
        assert_eq!(read_bt(&legacy(0.25, nodes)[..10]), Err(TreeFileError::Truncated(10)));
    }
}
