//! The bytes of a glTF file: in the file itself, in its JSON, or in files beside it.

use std::cell::{Cell, OnceCell};
use std::io::ErrorKind;
use std::path::{Component as Step, Path};

use elk_outside::file;
use nalgebra::Point3;

use super::document::{Accessor, Document, View};
use crate::read::budget::MAX_FILE_BYTES;
use crate::read::fault::{Fault, Location};

/// Types of a `.glb` file's chunks.
const JSON: &[u8] = b"JSON";
const BINARY: &[u8] = b"BIN\0";

/// What is said where buffers come to more than [`MAX_FILE_BYTES`].
const TOO_MUCH: &str = "its buffers come to more than 256 MiB, the most that is read: export less of it";

/// The JSON of a `.glb` file, and its bytes, if it has any.
pub(super) fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Fault> {
    const HEADER: usize = 12;
    let cut_off = |at: usize| Fault::at(Location::Byte(at), "the .glb file is cut off");
    let number = |at: usize| {
        let four = bytes.get(at..at + 4).ok_or_else(|| cut_off(at))?;
        Ok(u32::from_le_bytes([four[0], four[1], four[2], four[3]]) as usize)
    };
    if number(4)? != 2 {
        return Err(Fault::whole(format_args!("this is version {} of .glb; right is 2: export it again", number(4)?)));
    }
    let (mut at, mut json, mut blob) = (HEADER, None, None);
    while at + 8 <= bytes.len() {
        let length = number(at)?;
        let chunk = bytes.get(at + 8..at + 8 + length).ok_or_else(|| cut_off(at))?;
        match &bytes[at + 4..at + 8] {
            kind if kind == JSON && json.is_none() => json = Some(chunk),
            kind if kind == BINARY && blob.is_none() => blob = Some(chunk),
            _ => {}
        }
        at += 8 + length;
    }
    json.map(|json| (json, blob)).ok_or_else(|| cut_off(at))
}

/// The buffers of a document, each read when it is asked for.
pub(super) struct Buffers<'a> {
    document: &'a Document,
    blob: Option<&'a [u8]>,
    folder: &'a Path,
    read: Vec<OnceCell<Vec<u8>>>,
    /// Bytes that all buffers together may still have.
    left: Cell<u64>,
}

impl<'a> Buffers<'a> {
    pub fn new(document: &'a Document, blob: Option<&'a [u8]>, folder: &'a Path) -> Self {
        let read = document.buffers.iter().map(|_| OnceCell::new()).collect();
        Self { document, blob, folder, read, left: Cell::new(MAX_FILE_BYTES) }
    }

    /// The points of an accessor.
    pub fn points(&self, index: usize) -> Result<Elements<'_>, String> {
        self.elements(self.accessor(index, "VEC3")?, 3)
    }

    /// The whole numbers of an accessor.
    pub fn indices(&self, index: usize) -> Result<Elements<'_>, String> {
        Ok(Elements { normalized: false, ..self.elements(self.accessor(index, "SCALAR")?, 1)? })
    }

    fn accessor(&self, index: usize, kind: &str) -> Result<&'a Accessor, String> {
        let accessor = self.document.accessors.get(index).ok_or_else(|| format!("there is no accessor {index}"))?;
        match () {
            () if accessor.sparse.is_some() => {
                Err(format!("accessor {index} is sparse, which is not read: export it again"))
            }
            () if accessor.kind != kind => Err(format!("accessor {index} is a {}; right is {kind}", accessor.kind)),
            () => Ok(accessor),
        }
    }

    /// The elements of an accessor, of so many components each.
    fn elements(&self, accessor: &Accessor, components: usize) -> Result<Elements<'_>, String> {
        let component = Component::of(accessor)?;
        let size = components * component.size();
        let index = accessor.buffer_view.ok_or("an accessor has no bufferView")?;
        let view = self.document.buffer_views.get(index).ok_or_else(|| format!("there is no bufferView {index}"))?;
        let bytes = self.view(view).map_err(|what| format!("bufferView {index}: {what}"))?;
        let stride = view.byte_stride.unwrap_or(size);
        if stride < size {
            return Err(format!("bufferView {index} has a stride of {stride} bytes, and elements of {size}"));
        }
        let count = accessor.count;
        let last = count.checked_sub(1).and_then(|last| last.checked_mul(stride));
        let end = last.and_then(|last| last.checked_add(accessor.byte_offset)?.checked_add(size));
        if count > 0 && end.is_none_or(|end| end > bytes.len()) {
            let length = bytes.len();
            return Err(format!("bufferView {index} has {length} bytes, too few for the {count} elements in it"));
        }
        let bytes = bytes.get(accessor.byte_offset..).unwrap_or_default();
        Ok(Elements { bytes, stride, component, normalized: accessor.normalized, count })
    }

    fn view(&self, view: &View) -> Result<&[u8], String> {
        if view.extensions.keys().any(|name| name.ends_with("meshopt_compression")) {
            return Err("it is compressed (meshopt); right is no compression: export it again".to_owned());
        }
        let bytes = self.buffer(view.buffer)?;
        let end = view.byte_offset.checked_add(view.byte_length);
        let (buffer, there) = (view.buffer, bytes.len());
        end.and_then(|end| bytes.get(view.byte_offset..end))
            .ok_or_else(|| format!("it lies beyond the end of buffer {buffer}, which has {there} bytes"))
    }

    fn buffer(&self, index: usize) -> Result<&[u8], String> {
        let (Some(buffer), Some(read)) = (self.document.buffers.get(index), self.read.get(index)) else {
            return Err(format!("there is no buffer {index}"));
        };
        let Some(uri) = &buffer.uri else {
            return self
                .blob
                .filter(|_| index == 0)
                .ok_or_else(|| format!("buffer {index} has neither a uri nor bytes in the file"));
        };
        if read.get().is_none() {
            let bytes =
                bytes_of(uri, self.folder, self.left.get()).map_err(|what| format!("buffer {index}: {what}"))?;
            self.left.update(|left| left.saturating_sub(bytes.len() as u64));
            let _ = read.set(bytes);
        }
        Ok(read.get().map_or(&[], Vec::as_slice))
    }
}

/// The elements of an accessor, each looked at when it is asked for.
pub(super) struct Elements<'a> {
    /// From the first element on.
    bytes: &'a [u8],
    stride: usize,
    component: Component,
    normalized: bool,
    /// How many there are.
    pub count: usize,
}

impl Elements<'_> {
    /// The `i`-th as a point.
    pub fn point(&self, i: usize) -> Option<Point3<f64>> {
        let [x, y, z] = [0, 1, 2].map(|axis| self.component(i, axis));
        Some(Point3::new(x?, y?, z?))
    }

    /// The `i`-th as a whole number; `None` also if it is below 0.
    pub fn whole(&self, i: usize) -> Option<usize> {
        self.component(i, 0).filter(|value| *value >= 0.0).map(|value| value as usize)
    }

    fn component(&self, i: usize, number: usize) -> Option<f64> {
        let size = self.component.size();
        let at = i.checked_mul(self.stride)?.checked_add(number * size)?;
        let bytes = self.bytes.get(at..at.checked_add(size)?).filter(|_| i < self.count)?;
        Some(self.component.value(bytes, self.normalized))
    }
}

/// What a URI stands for: bytes that it holds itself, or a file in the folder or below it; at most so many bytes.
fn bytes_of(uri: &str, folder: &Path, most: u64) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let encoded = data.split_once(";base64,").ok_or("its data are not in base64")?.1;
        let bytes = base64(encoded).ok_or("its data are no base64")?;
        let fits = bytes.len() as u64 <= most;
        return fits.then_some(bytes).ok_or_else(|| format!("with it {TOO_MUCH}"));
    }
    let name = unescaped(uri);
    let is_below = Path::new(&name).components().all(|step| matches!(step, Step::Normal(_) | Step::CurDir));
    if uri.contains("://") || !is_below {
        let shown = elk_outside::text::name(uri);
        return Err(format!("{shown} is no file beside this one, or in a folder beside it"));
    }
    let path = folder.join(name);
    file::read(&path, most).map_err(|error| match error.kind() {
        ErrorKind::FileTooLarge => format!("with {} {TOO_MUCH}", path.display()),
        _ => format!("cannot read {}: {error}", path.display()),
    })
}

/// `%20` as the space that it stands for.
fn unescaped(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let is_code = |two: &&[u8]| first == b'%' && two.iter().all(u8::is_ascii_hexdigit);
        let digits = after.get(..2).filter(is_code).and_then(|two| std::str::from_utf8(two).ok());
        let code = digits.and_then(|digits| u8::from_str_radix(digits, 16).ok());
        bytes.push(code.unwrap_or(first));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// RFC 4648, section 4.
fn base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0_u32, 0);
    for letter in text.trim_end_matches('=').bytes() {
        let six = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(six);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
            bits &= (1 << count) - 1;
        }
    }
    Some(bytes)
}

/// The type of a component.
#[derive(Debug, Clone, Copy)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(accessor: &Accessor) -> Result<Self, String> {
        Ok(match accessor.component_type {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            other => return Err(format!("an accessor has the componentType {other}; right is 5120 to 5126")),
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The value at the beginning of some bytes, which are at least as many as it has.
    fn value(self, bytes: &[u8], normalized: bool) -> f64 {
        let mut four = [0; 4];
        let size = self.size();
        four[..size].copy_from_slice(&bytes[..size]);
        let [a, b, ..] = four;
        let (value, most) = match self {
            Self::I8 => (f64::from(a.cast_signed()), f64::from(i8::MAX)),
            Self::U8 => (f64::from(a), f64::from(u8::MAX)),
            Self::I16 => (f64::from(i16::from_le_bytes([a, b])), f64::from(i16::MAX)),
            Self::U16 => (f64::from(u16::from_le_bytes([a, b])), f64::from(u16::MAX)),
            Self::U32 => (f64::from(u32::from_le_bytes(four)), f64::from(u32::MAX)),
            Self::F32 => return f64::from(f32::from_le_bytes(four)),
        };
        if normalized { (value / most).max(-1.0) } else { value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_escaped_names_are_read() {
        assert_eq!(base64("ZWxr"), Some(b"elk".to_vec()));
        assert_eq!(base64("ZWxrIQ=="), Some(b"elk!".to_vec()));
        assert_eq!(base64("ZW xr"), None);
        assert_eq!(unescaped("my%20room%+1%.bin"), "my room%+1%.bin");
    }
}
