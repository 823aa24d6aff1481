//! glTF 2.0 (Khronos), `.gltf` and `.glb`: the triangles of all nodes of the scene, each where its node puts it.
//!
//! Only what has depth is looked at, so that a file is read whatever its materials are. What would change the depth and is
//! not read is counted, or refused where nothing right is left without it.

mod buffers;
mod document;

use std::path::Path;

use nalgebra::{Matrix4, Point3};

use crate::read::fault::{Fault, Location};
use crate::read::soup::Soup;
use buffers::{Buffers, Elements};
use document::{Document, Node, Primitive};

/// Nodes below nodes; a scene's tree is seldom deeper than ten.
const DEEPEST: usize = 256;
/// Objects and lists in the JSON: each may be a node, of which two bytes make some three hundred.
const MOST_PARTS: usize = 1 << 21;

/// Words in the names of extensions that change no depth, or are read here, or refused where they are used.
const KNOWN_EXTENSIONS: [&str; 10] =
    ["material", "texture", "light", "xmp", "anim", "audio", "quantization", "draco", "meshopt", "instancing"];

/// Reads the triangles of the scene; `folder` is where the file's buffers lie.
pub(crate) fn read(bytes: &[u8], folder: &Path, soup: &mut Soup) -> Result<(), Fault> {
    let (json, blob) = if bytes.starts_with(b"glTF") { buffers::chunks(bytes)? } else { (bytes, None) };
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let parts = json.iter().filter(|&&byte| byte == b'{' || byte == b'[').count();
    if parts > MOST_PARTS {
        return Err(Fault::whole(format_args!(
            "this glTF has {parts} parts (objects and lists in its JSON); at most {MOST_PARTS} are read: export less of it"
        )));
    }
    let document: Document = serde_json::from_slice(json).map_err(|error| match error.line() {
        0 => Fault::whole(format_args!("this is no glTF: {error}")),
        line => Fault::line(line, format_args!("this is no glTF: {error}")),
    })?;
    match document.asset.version.as_str() {
        "" => return Err(Fault::whole("this is JSON but no glTF: it has no asset.version")),
        version if version.starts_with("2.") => {}
        version => return Err(Fault::whole(format_args!("this is glTF {version}; right is 2.0: export it again"))),
    }
    let is_known = |name: &String| KNOWN_EXTENSIONS.iter().any(|word| name.to_lowercase().contains(word));
    for name in document.extensions_required.iter().filter(|name| !is_known(name)) {
        let what = "extensions that the file requires are not known: what they change is not read";
        soup.notice(what, 1, &elk_outside::text::name(name), || Location::Whole);
    }
    let mut walk = Walk {
        buffers: Buffers::new(&document, blob, folder),
        document: &document,
        visited: vec![false; document.nodes.len()],
        soup,
    };
    walk.roots()?.into_iter().try_for_each(|root| walk.node(root, &Matrix4::identity(), 0))
}

struct Walk<'a> {
    document: &'a Document,
    buffers: Buffers<'a>,
    /// A node has one parent at most.
    visited: Vec<bool>,
    soup: &'a mut Soup,
}

impl Walk<'_> {
    /// The nodes at the top: of the scene that is to be shown, of the first one, or all that are below no other.
    fn roots(&self) -> Result<Vec<usize>, Fault> {
        let Document { scene, scenes, nodes, .. } = self.document;
        match (scene, scenes.first()) {
            (Some(scene), _) => match scenes.get(*scene) {
                Some(scene) => Ok(scene.nodes.clone()),
                None => Err(Fault::whole(format_args!("there is no scene {scene}"))),
            },
            (None, Some(first)) => Ok(first.nodes.clone()),
            (None, None) => {
                let mut is_below = vec![false; nodes.len()];
                for &child in nodes.iter().flat_map(|node| &node.children) {
                    // A child that is not there is found when its parent is looked at.
                    is_below.get_mut(child).into_iter().for_each(|is_below| *is_below = true);
                }
                Ok((0..nodes.len()).filter(|&node| !is_below[node]).collect())
            }
        }
    }

    fn node(&mut self, index: usize, above: &Matrix4<f64>, depth: usize) -> Result<(), Fault> {
        let location = || Location::Part(format!("node {index}"));
        let node = self.document.nodes.get(index).ok_or_else(|| Fault::at(location(), "there is no such node"))?;
        if std::mem::replace(&mut self.visited[index], true) {
            return Err(Fault::at(location(), "it is below two nodes; right is a tree"));
        }
        if depth > DEEPEST {
            return Err(Fault::at(location(), format_args!("more than {DEEPEST} nodes are above it")));
        }
        if node.extensions.contains_key("EXT_mesh_gpu_instancing") {
            return Err(Fault::at(
                location(),
                "it is drawn many times (EXT_mesh_gpu_instancing), which is not read: export it without",
            ));
        }
        let here = above * node.transform();
        if let Some(mesh) = node.mesh {
            self.notice_other_shapes(node, mesh, location);
            self.mesh(mesh, &here)?;
        }
        node.children.iter().try_for_each(|&child| self.node(child, &here, depth + 1))
    }

    /// Skins bend meshes, and weights change their shapes; neither is read.
    fn notice_other_shapes(&mut self, node: &Node, mesh: usize, location: impl Fn() -> Location) {
        if node.skin.is_some() {
            let what = "meshes that joints bend (skins) are read straight, as their nodes place them";
            self.soup.notice(what, 1, "", &location);
        }
        let own = self.document.meshes.get(mesh).map_or(&[][..], |mesh| &mesh.weights);
        if node.weights.as_deref().unwrap_or(own).iter().any(|weight| *weight != 0.0) {
            self.soup.notice("meshes that are morphed (weights) are read as they are without it", 1, "", &location);
        }
    }

    fn mesh(&mut self, index: usize, transform: &Matrix4<f64>) -> Result<(), Fault> {
        let missing = || Fault::at(Location::Part(format!("mesh {index}")), "there is no such mesh");
        let mesh = self.document.meshes.get(index).ok_or_else(missing)?;
        let name =
            || mesh.name.as_deref().map(|name| format!(" ({})", elk_outside::text::name(name))).unwrap_or_default();
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let location = || Location::Part(format!("mesh {index}{}, primitive {number}", name()));
            self.primitive(primitive, transform, &location).map_err(|what| match what {
                Trouble::Said(what) => Fault::at(location(), what),
                Trouble::Fault(fault) => fault,
            })?;
        }
        Ok(())
    }

    fn primitive(
        &mut self,
        primitive: &Primitive,
        transform: &Matrix4<f64>,
        location: &impl Fn() -> Location,
    ) -> Result<(), Trouble> {
        if primitive.extensions.contains_key("KHR_draco_mesh_compression") {
            return Err(Trouble::Said(
                "it is compressed (KHR_draco_mesh_compression); right is no compression: export it again".into(),
            ));
        }
        self.soup.part(location).map_err(Trouble::Fault)?;
        let mode = primitive.mode.unwrap_or(4);
        let Some(position) = primitive.attributes.position.filter(|_| (4..=6).contains(&mode)) else { return Ok(()) };
        let vertices = self.buffers.points(position)?;
        let indices = primitive.indices.map(|indices| self.buffers.indices(indices)).transpose()?;
        // What is mirrored is turned back.
        let mirrored = transform.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        for [a, b, c] in triangles(mode, indices.as_ref().map_or(vertices.count, |indices| indices.count)) {
            let [a, b, c] = if mirrored { [a, c, b] } else { [a, b, c] };
            let corner =
                |i: usize| vertex(&vertices, indices.as_ref(), i).map(|point| transform.transform_point(&point));
            let triangle = [corner(a)?, corner(b)?, corner(c)?];
            self.soup.polygon(&triangle, location).map_err(Trouble::Fault)?;
        }
        Ok(())
    }
}

/// The `i`-th vertex of a primitive: by way of its indices, if it has any.
fn vertex(vertices: &Elements, indices: Option<&Elements>, i: usize) -> Result<Point3<f64>, String> {
    let index = indices.map_or(Some(i), |indices| indices.whole(i));
    index.and_then(|index| vertices.point(index)).ok_or_else(|| {
        let said = index.map_or("a number below 0".to_owned(), |index| format!("the vertex {index}"));
        format!("a face has {said}, and there are {}", vertices.count)
    })
}

/// What is wrong: still without its location, or with it.
enum Trouble {
    Said(String),
    Fault(Fault),
}

impl From<String> for Trouble {
    fn from(what: String) -> Self {
        Self::Said(what)
    }
}

/// Which of so many vertices are the corners of triangles that are given one by one, as a strip, or as a fan.
fn triangles(mode: u32, vertices: usize) -> impl Iterator<Item = [usize; 3]> {
    let count = if mode == 4 { vertices / 3 } else { vertices.saturating_sub(2) };
    (0..count).map(move |i| match mode {
        4 => [3 * i, 3 * i + 1, 3 * i + 2],
        5 if i % 2 == 0 => [i, i + 1, i + 2],
        5 => [i + 1, i, i + 2],
        _ => [0, i + 1, i + 2],
    })
}
