//! The text before the nodes of a `.bt` or an `.ot` file.

use std::io::{self, Write};

use crate::bytes::Bytes;
use crate::tree_file::{Cubes, TreeFile, TreeFileError, Value};

/// What the header says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    /// The kind of tree.
    pub kind: String,
    /// Nodes that are announced.
    pub nodes: usize,
    /// Edge of a voxel (m).
    pub resolution: f64,
}

impl Header {
    /// The header that begins with `magic`, and the data behind it.
    pub fn read<'a>(bytes: &'a [u8], magic: &'static str) -> Result<(Self, Bytes<'a>), TreeFileError> {
        if !bytes.starts_with(magic.as_bytes()) {
            return Err(TreeFileError::Magic(magic));
        }
        let (mut nodes, mut resolution, mut kind) = (None, None, None);
        let mut rest = bytes;
        for number in 1.. {
            let end = rest.iter().position(|b| *b == b'\n').ok_or(TreeFileError::HeaderEnd)?;
            let line = String::from_utf8_lossy(&rest[..end]);
            rest = &rest[end + 1..];
            let text = line.split('#').next().unwrap_or_default().trim();
            let (key, value) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
            let value = value.trim();
            let wrong = |expected| TreeFileError::Header { line: number, text: shown(text), expected };
            match key {
                "data" => break,
                "id" => kind = Some(shown(value)),
                "size" => nodes = Some(value.parse().map_err(|_| wrong("size NODES"))?),
                "res" => {
                    let metres = value.parse().ok().filter(|r: &f64| r.is_finite() && *r > 0.0);
                    resolution = Some(metres.ok_or_else(|| wrong("res METRES"))?);
                }
                // Other keys may come with newer versions; OctoMap skips them as well.
                _ => {}
            }
        }
        let kind = match kind.ok_or(TreeFileError::Missing("id OcTree"))? {
            // How the first versions named their only tree.
            first if first == "1" => "OcTree".to_owned(),
            kind => kind,
        };
        let nodes = nodes.ok_or(TreeFileError::Missing("size NODES"))?;
        let resolution = resolution.ok_or(TreeFileError::Missing("res METRES"))?;
        Ok((Self { kind, nodes, resolution }, Bytes::new(rest, bytes.len() - rest.len())))
    }

    /// The tree behind this header, each of whose nodes has so many bytes `beside` its value.
    pub fn tree<V: Value>(self, data: Bytes<'_>, beside: usize) -> Result<TreeFile<'_, V>, TreeFileError> {
        let Self { nodes, resolution, .. } = self;
        let (cubes, bricks) = Cubes::of(data, nodes, beside)?;
        Ok(TreeFile { resolution, nodes, bricks, cubes })
    }
}

fn shown(text: &str) -> String {
    text.chars().take(60).collect()
}

/// Writes a header as OctoMap does. OctoMap cuts the resolution to six digits; here it has as many as it needs.
pub(super) fn write(out: &mut impl Write, magic: &str, nodes: usize, resolution: f64) -> io::Result<()> {
    write!(
        out,
        "{magic}\n# (feel free to add / change comments, but leave the first line as it is!)\n#\nid OcTree\nsize {nodes}\n\
         res {resolution}\ndata\n"
    )
}
