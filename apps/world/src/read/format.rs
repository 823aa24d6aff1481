//! Which format a file has: its bytes say so, its name only where they do not.

use std::fmt;

use crate::placement::Axis;
use crate::read::fault::Fault;
use crate::read::{stl, text};

/// A format that is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Wavefront OBJ.
    Obj,
    /// STL, text or binary.
    Stl,
    /// PLY (Stanford), text or binary.
    Ply,
    /// glTF 2.0, `.gltf` or `.glb`.
    Gltf,
}

/// What is often taken for a world, how it begins, and what it is.
const OTHERS: [(&[u8], &str); 17] = [
    (b"Kaydara FBX Binary", "an FBX file"),
    (b"; FBX", "an FBX file"),
    (b"BLENDER", "a Blender file"),
    (b"PXR-USDC", "a USD file"),
    (b"#usda", "a USD file"),
    (b"PK\x03\x04", "a ZIP archive (USDZ, 3MF and others are)"),
    (b"\x1f\x8b", "compressed (gzip)"),
    (b"\x28\xb5\x2f\xfd", "compressed (zstd)"),
    (b"OFF", "an OFF file"),
    (b"#VRML", "a VRML file"),
    (b"ISO-10303-21", "a STEP file"),
    (b"# .PCD", "a cloud of points (PCD)"),
    (b"# Octomap OcTree", "an OctoMap file, which is a map and no world"),
    (b"%PDF", "a PDF"),
    (b"\x89PNG", "a picture (PNG)"),
    (b"\x89MCAP", "a log (MCAP)"),
    (b"MM\x00*", "a picture (TIFF)"),
];

impl Format {
    /// The format of a file with this name and these bytes.
    ///
    /// # Errors
    /// It is of another kind; which one, if that can be told.
    pub fn of(name: &str, bytes: &[u8]) -> Result<Self, Fault> {
        Self::by_content(bytes)?.or_else(|| Self::by_name(name)).ok_or_else(|| {
            Fault::whole("this is of no format that is known; right is an OBJ, STL, PLY or glTF (.gltf, .glb) file")
        })
    }

    fn by_content(bytes: &[u8]) -> Result<Option<Self>, Fault> {
        if bytes.starts_with(b"glTF") {
            return Ok(Some(Self::Gltf));
        }
        if stl::is_binary(bytes) {
            return Ok(Some(Self::Stl));
        }
        let beginning = text::beginning(bytes);
        let said = beginning.trim_ascii_start();
        if let Some((_, what)) = OTHERS.iter().find(|(start, _)| said.starts_with(start)) {
            return Err(Fault::whole(format_args!(
                "this is {what}; right is an OBJ, STL, PLY or glTF file: export it again"
            )));
        }
        if said.starts_with(b"<") {
            let what = if contains(said, b"<COLLADA") { "a COLLADA file" } else { "XML" };
            return Err(Fault::whole(format_args!(
                "this is {what}; right is an OBJ, STL, PLY or glTF file: export it again"
            )));
        }
        Ok(match () {
            () if said.starts_with(b"{") => Some(Self::Gltf),
            () if said.starts_with(b"ply") && said.get(3).is_some_and(u8::is_ascii_whitespace) => Some(Self::Ply),
            () if is_text_stl(said) => Some(Self::Stl),
            () if looks_like_obj(said) => Some(Self::Obj),
            () => None,
        })
    }

    /// The format that a name's ending stands for.
    fn by_name(name: &str) -> Option<Self> {
        let ending = name.rsplit_once('.')?.1.to_ascii_lowercase();
        match ending.as_str() {
            "obj" => Some(Self::Obj),
            "stl" => Some(Self::Stl),
            "ply" => Some(Self::Ply),
            "gltf" | "glb" => Some(Self::Gltf),
            _ => None,
        }
    }

    /// The axis that points up in its files, if nobody says otherwise: glTF lays down y, the others nothing.
    pub fn up(self) -> Axis {
        match self {
            Self::Gltf => Axis::Y,
            Self::Obj | Self::Stl | Self::Ply => Axis::Z,
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Obj => "OBJ",
            Self::Stl => "STL",
            Self::Ply => "PLY",
            Self::Gltf => "glTF",
        })
    }
}

fn is_text_stl(beginning: &[u8]) -> bool {
    let lower = beginning.to_ascii_lowercase();
    lower.starts_with(b"solid") && (contains(&lower, b"facet") || contains(&lower, b"endsolid"))
}

fn contains(text: &[u8], wanted: &[u8]) -> bool {
    text.windows(wanted.len()).any(|window| window == wanted)
}

/// Whether a line begins as a vertex does in OBJ.
fn looks_like_obj(beginning: &[u8]) -> bool {
    text::lines(beginning).any(|(_, line)| {
        let mut words = text::words(line);
        words.next() == Some(b"v") && words.next().is_some_and(|word| text::number(word).is_ok())
    })
}
