//! Files of worlds: one reader a format, behind one interface.
//!
//! A reader goes through the bytes and hands each polygon to the [`Soup`], with its location. What is the
//! same in all formats is done there: corners that are no numbers, polygons with more than three corners, faces without
//! area, more of them than there may be.

mod budget;
mod fault;
mod format;
mod gltf;
mod mesh;
mod obj;
mod ply;
mod soup;
mod stl;
mod text;

use std::path::Path;

pub(crate) use budget::MAX_FILE_BYTES;
pub use fault::{Fault, Location};
pub use format::Format;
pub use soup::{Notice, Soup};

/// Reads a file whose bytes are these. Its name tells the format only where the bytes do not; `folder` is where a glTF
/// file's buffers lie.
///
/// # Errors
/// It is of no format that is read here, or what is wrong with it.
pub fn read(name: &str, bytes: &[u8], folder: &Path) -> Result<(Format, Soup), Fault> {
    let format = Format::of(name, bytes)?;
    let mut soup = Soup::default();
    match format {
        Format::Obj => obj::read(bytes, &mut soup),
        Format::Stl => stl::read(bytes, &mut soup),
        Format::Ply => ply::read(bytes, &mut soup),
        Format::Gltf => gltf::read(bytes, folder, &mut soup),
    }?;
    Ok((format, soup))
}
