//! OctoMap's files: `.bt` (occupied, free or unknown, two bits a child) both ways, `.ot` (log-odds) for writing.
//!
//! A text header, its last line `data`, then the nodes depth first. In a `.bt` every inner node is a little-endian u16
//! with two bits a child: 0 unknown, 1 free, 2 occupied, 3 inner, and the inner children's records follow in order. In
//! an `.ot` every node is an f32 and a byte that says which children exist.

use std::io::{self, Write};

use crate::octree::{DEPTH, Node};

/// How a `.bt` file begins.
const BT_MAGIC: &str = "# Octomap OcTree binary file";
/// How an `.ot` file begins.
const OT_MAGIC: &str = "# Octomap OcTree file";

/// A map read from a `.bt` file.
#[derive(Debug, Clone, PartialEq)]
pub struct BtFile {
    /// Edge of a voxel (m).
    pub resolution: f64,
    /// Occupied (`true`) and free cubes.
    pub tree: Node<bool>,
}

/// Why bytes are no `.bt` file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BtError {
    /// The first line is another one.
    #[error("not a .bt file: it does not begin with `{BT_MAGIC}`")]
    Magic,
    /// The header has no `data` line.
    #[error("the header has no `data` line: the file is cut off or no .bt file")]
    HeaderEnd,
    /// A header line lacks its value, or has one that makes no sense.
    #[error("header line {line}: `{text}`; expected `{expected}`")]
    Header {
        /// The line, from 1.
        line: usize,
        /// What stands there (its first 60 characters).
        text: String,
        /// What would be right.
        expected: &'static str,
    },
    /// A header line is missing.
    #[error("the header has no line `{0}`")]
    Missing(&'static str),
    /// The file holds a tree of another kind.
    #[error("the file holds a `{0}`; only `OcTree` has a .bt form: convert it with OctoMap's convert_octree")]
    Kind(String),
    /// The file ends within the tree.
    #[error("the data end at byte {0} in the middle of the tree: the file is cut off")]
    Truncated(usize),
    /// Something follows the tree.
    #[error("{0} bytes follow the end of the tree: the file is damaged")]
    Trailing(usize),
    /// An inner node where only leaves can be.
    #[error("an inner node at byte {0} lies deeper than the {DEPTH} levels of an OctoMap: the file is damaged")]
    TooDeep(usize),
    /// The header's count is not the tree's.
    #[error("the header announces {announced} nodes, the tree has {found}: the file is damaged")]
    Count {
        /// The header's `size`.
        announced: usize,
        /// Nodes in the data.
        found: usize,
    },
}

/// Writes a `.bt` file of voxels of `resolution` (m): `true` occupied, `false` free.
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
    write_bt_node(&mut data, tree);
    write_header(out, BT_MAGIC, tree.count(), resolution)?;
    out.write_all(&data)
}

fn write_bt_node(data: &mut Vec<u8>, node: &Node<bool>) {
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
        write_bt_node(data, child);
    }
}

/// Writes an `.ot` file of voxels of `resolution` (m) and their log-odds; an inner node has its largest child's.
pub fn write_ot(out: &mut impl Write, tree: &Node<f32>, resolution: f64) -> io::Result<()> {
    let mut data = Vec::new();
    write_ot_node(&mut data, tree);
    write_header(out, OT_MAGIC, tree.count(), resolution)?;
    out.write_all(&data)
}

/// Answers the node's log-odds; −∞ for an unknown one, which has no record.
fn write_ot_node(data: &mut Vec<u8>, node: &Node<f32>) -> f32 {
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
            let largest = children.iter().map(|child| write_ot_node(data, child)).fold(f32::NEG_INFINITY, f32::max);
            data[start..start + 4].copy_from_slice(&largest.to_le_bytes());
            largest
        }
    }
}

fn write_header(out: &mut impl Write, magic: &str, nodes: usize, resolution: f64) -> io::Result<()> {
    write!(out, "{magic}\n# written by elk\nid OcTree\nsize {nodes}\nres {resolution}\ndata\n")
}

/// Reads a `.bt` file. Never allocates more than a fixed multiple of the bytes that are there.
pub fn read_bt(bytes: &[u8]) -> Result<BtFile, BtError> {
    let (header, data) = Header::read(bytes)?;
    if header.nodes == 0 && data.is_empty() {
        return Ok(BtFile { resolution: header.resolution, tree: Node::Unknown });
    }
    let mut reader = Reader { data, at: 0, offset: bytes.len() - data.len() };
    let tree = reader.inner(0)?;
    if reader.at != data.len() {
        return Err(BtError::Trailing(data.len() - reader.at));
    }
    match tree.count() {
        found if found == header.nodes => Ok(BtFile { resolution: header.resolution, tree }),
        found => Err(BtError::Count { announced: header.nodes, found }),
    }
}

/// What the header says.
struct Header {
    nodes: usize,
    resolution: f64,
}

impl Header {
    /// The header, and the data behind it.
    fn read(bytes: &[u8]) -> Result<(Self, &[u8]), BtError> {
        if !bytes.starts_with(BT_MAGIC.as_bytes()) {
            return Err(BtError::Magic);
        }
        let (mut nodes, mut resolution, mut kind) = (None, None, None);
        let mut rest = bytes;
        for number in 1.. {
            let end = rest.iter().position(|b| *b == b'\n').ok_or(BtError::HeaderEnd)?;
            let line = String::from_utf8_lossy(&rest[..end]);
            rest = &rest[end + 1..];
            let text = line.split('#').next().unwrap_or_default().trim();
            let (key, value) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
            let value = value.trim();
            let wrong = |expected| BtError::Header { line: number, text: text.chars().take(60).collect(), expected };
            match key {
                "data" => break,
                "id" => kind = Some(value.to_string()),
                "size" => nodes = Some(value.parse().map_err(|_| wrong("size NODES"))?),
                "res" => {
                    let metres = value.parse().ok().filter(|r: &f64| r.is_finite() && *r > 0.0);
                    resolution = Some(metres.ok_or_else(|| wrong("res METRES"))?);
                }
                // Other keys may come with newer versions; OctoMap skips them as well.
                _ => {}
            }
        }
        // `1` is how the first versions named their only tree.
        match kind.ok_or(BtError::Missing("id OcTree"))? {
            kind if kind == "OcTree" || kind == "1" => {}
            kind => return Err(BtError::Kind(kind)),
        }
        let header = Self {
            nodes: nodes.ok_or(BtError::Missing("size NODES"))?,
            resolution: resolution.ok_or(BtError::Missing("res METRES"))?,
        };
        Ok((header, rest))
    }
}

/// The nodes, one after the other.
struct Reader<'a> {
    data: &'a [u8],
    at: usize,
    /// Where `data` begin in the file.
    offset: usize,
}

impl Reader<'_> {
    /// The inner node `depth` levels below the root, and what is below it. Recursion ends at [`DEPTH`].
    fn inner(&mut self, depth: u32) -> Result<Node<bool>, BtError> {
        if depth == DEPTH {
            return Err(BtError::TooDeep(self.offset + self.at));
        }
        let record = match self.data.get(self.at..self.at + 2) {
            Some(pair) => u16::from_le_bytes([pair[0], pair[1]]),
            None => return Err(BtError::Truncated(self.offset + self.data.len())),
        };
        self.at += 2;
        let mut children = Box::new([const { Node::Unknown }; 8]);
        for (i, child) in children.iter_mut().enumerate() {
            *child = match record >> (2 * i) & 3 {
                0 => Node::Unknown,
                1 => Node::Leaf(false),
                2 => Node::Leaf(true),
                _ => self.inner(depth + 1)?,
            };
        }
        Ok(Node::Inner(children))
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
            prop_assert_eq!(read_bt(&bytes_of(&tree)), Ok(BtFile { resolution: 0.1, tree }));
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
            let mut bytes = format!("{BT_MAGIC}\nid OcTree\nsize 99999999999\nres 0.1\ndata\n").into_bytes();
            bytes.extend(data);
            prop_assert!(read_bt(&bytes).is_err());
        }
    }

    #[test]
    fn every_kind_of_damage_has_its_error() {
        let file = |header: &str, data: &[u8]| [format!("{BT_MAGIC}\n{header}data\n").as_bytes(), data].concat();
        let read = |header: &str, data: &[u8]| read_bt(&file(header, data)).unwrap_err();
        let good = "id OcTree\nsize 2\nres 0.1\n";
        assert_eq!(read_bt(b"ply\n"), Err(BtError::Magic));
        assert_eq!(read_bt(&file(good, &[])[..40]), Err(BtError::HeaderEnd));
        assert_eq!(read("size 2\nres 0.1\n", &[]), BtError::Missing("id OcTree"));
        assert_eq!(read("id ColorOcTree\nsize 2\nres 0.1\n", &[]), BtError::Kind("ColorOcTree".into()));
        assert!(matches!(read("id OcTree\nsize 2\nres -1\n", &[]), BtError::Header { line: 4, .. }));
        assert!(matches!(read(good, &[1]), BtError::Truncated(_)));
        assert_eq!(read(good, &[1, 0, 0]), BtError::Trailing(1));
        assert_eq!(read(good, &[5, 0]), BtError::Count { announced: 2, found: 3 });
        assert!(matches!(read(good, &[3, 0].repeat(20)), BtError::TooDeep(_)));
    }

    #[test]
    fn a_world_of_one_value_can_be_written() {
        let file = read_bt(&bytes_of(&Node::Leaf(true))).unwrap();
        assert_eq!((file.tree.count(), file.tree.get(Voxel::new(5, -7, 9))), (9, Some(true)));
    }

    #[test]
    fn an_ot_file_is_five_bytes_a_node() {
        let tree = Node::from_voxels([(Voxel::new(0, 0, 0), 0.85f32), (Voxel::new(-1, 0, 0), -0.4)]);
        let mut bytes = Vec::new();
        write_ot(&mut bytes, &tree, 0.1).unwrap();
        let data = bytes.windows(5).position(|w| w == b"data\n").unwrap() + 5;
        assert_eq!(bytes.len() - data, 5 * tree.count());
        assert_eq!(bytes[data..data + 4], 0.85f32.to_le_bytes(), "the root has its largest child's");
    }
}
