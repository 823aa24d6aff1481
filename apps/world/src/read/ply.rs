//! PLY (Stanford): elements with properties, as text or binary in either order of bytes.

use nalgebra::Point3;

use crate::read::fault::{Fault, Location};
use crate::read::mesh::Mesh;
use crate::read::soup::Soup;
use crate::read::text;

/// The names of a face's list of vertices; both are in use.
const INDICES: [&str; 2] = ["vertex_indices", "vertex_index"];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

#[derive(Debug)]
struct Property {
    name: String,
    /// The type of a list's length, if it is a list.
    length: Option<Scalar>,
    scalar: Scalar,
}

#[derive(Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Text,
    Little,
    Big,
}

/// Words of a line of the header that are looked at: one more than any has.
const MOST_WORDS: usize = 6;

/// Reads all faces.
pub(crate) fn read(bytes: &[u8], soup: &mut Soup) -> Result<(), Fault> {
    let bytes = text::without_bom(bytes);
    let header = Header::read(bytes)?;
    let mut values = Values::new(&bytes[header.length..], &header);
    let mut mesh = Mesh::new(values.kind_of_location(), 0);
    for element in header.elements.iter().filter(|element| !element.properties.is_empty()) {
        for _ in 0..element.count {
            match element.name.as_str() {
                "vertex" => vertex(element, &mut values, &mut mesh)?,
                "face" => face(element, &mut values, &mut mesh)?,
                "tristrips" => {
                    return Err(Fault::at(values.location(), "strips of triangles are not read: export it with faces"));
                }
                _ => element.properties.iter().try_for_each(|property| values.pass_over(property))?,
            }
        }
    }
    if let Some((what, count, first)) = values.left() {
        soup.notice(what, count, "", || first.clone());
    }
    mesh.put_into(soup)
}

fn vertex(element: &Element, values: &mut Values, mesh: &mut Mesh) -> Result<(), Fault> {
    let at = values.position();
    let mut point = Point3::from([f64::NAN; 3]);
    for property in &element.properties {
        match ["x", "y", "z"].iter().position(|name| *name == property.name) {
            Some(axis) if property.length.is_none() => point[axis] = values.next(property.scalar)?,
            _ => values.pass_over(property)?,
        }
    }
    mesh.vertex(at, point)
}

fn face(element: &Element, values: &mut Values, mesh: &mut Mesh) -> Result<(), Fault> {
    let at = values.position();
    let is_outline = |property: &&Property| property.length.is_some() && INDICES.contains(&property.name.as_str());
    let outline = element.properties.iter().find(is_outline);
    for property in &element.properties {
        if !outline.is_some_and(|outline| std::ptr::eq(outline, property)) {
            values.pass_over(property)?;
            continue;
        }
        for _ in 0..values.count(property)? {
            let value = values.next(property.scalar)?;
            if !(value >= 0.0 && value.fract() == 0.0) {
                let what = format_args!("a face has the vertex {value}; right is a number from 0");
                return Err(mesh.fault(at, what));
            }
            mesh.corner(at, value as u64)?;
        }
    }
    mesh.end_face(at)
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
    /// Bytes and lines of it.
    length: usize,
    lines: usize,
}

impl Header {
    fn read(bytes: &[u8]) -> Result<Self, Fault> {
        let mut header = Self { encoding: Encoding::Text, elements: Vec::new(), length: 0, lines: 0 };
        let mut format = None;
        while let Some(end) = bytes[header.length..].iter().position(|&byte| byte == b'\n') {
            let line = &bytes[header.length..header.length + end];
            header.length += end + 1;
            header.lines += 1;
            let words = text::words(line).take(MOST_WORDS);
            let words: Vec<String> = words.map(|word| String::from_utf8_lossy(word).into_owned()).collect();
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            match words.as_slice() {
                ["format", name, ..] => format = Some(encoding(name, header.lines)?),
                ["element", name, count] => header.element(name, count)?,
                ["property", rest @ ..] => header.property(rest)?,
                ["end_header"] => return header.ended(format),
                ["ply"] | ["comment" | "obj_info", ..] | [] => {}
                [word, ..] => {
                    let what = format_args!("{} is no word of a PLY's header", text::shown(word.as_bytes()));
                    return Err(Fault::line(header.lines, what));
                }
            }
        }
        Err(Fault::line(header.lines, "the PLY's header does not end: `end_header` is missing"))
    }

    fn element(&mut self, name: &str, count: &str) -> Result<(), Fault> {
        let count = count.parse().map_err(|_| {
            Fault::line(self.lines, format_args!("{} is no number of elements", text::shown(count.as_bytes())))
        })?;
        self.elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
        Ok(())
    }

    fn property(&mut self, words: &[&str]) -> Result<(), Fault> {
        let line = self.lines;
        let (length, kind, name) = match words {
            ["list", length, kind, name] => (Some(scalar(length, line)?), kind, name),
            [kind, name] => (None, kind, name),
            _ => return Err(Fault::line(line, "right is `property TYPE NAME` or `property list TYPE TYPE NAME`")),
        };
        let property = Property { name: (*name).to_owned(), length, scalar: scalar(kind, line)? };
        let Some(element) = self.elements.last_mut() else {
            return Err(Fault::line(line, "a property stands before all elements"));
        };
        element.properties.push(property);
        Ok(())
    }

    fn ended(mut self, format: Option<Encoding>) -> Result<Self, Fault> {
        self.encoding = format.ok_or_else(|| Fault::line(self.lines, "the PLY's header has no line `format …`"))?;
        if self.elements.iter().any(|element| element.name == "tristrips") {
            return Ok(self);
        }
        let faces = self.elements.iter().filter(|element| element.name == "face");
        let lists: Vec<&str> = faces
            .flat_map(|face| face.properties.iter().filter(|property| property.length.is_some()))
            .map(|list| list.name.as_str())
            .collect();
        match lists.as_slice() {
            [] => Err(Fault::whole("the PLY has no faces: it is a cloud of points; make a mesh of it first")),
            lists if lists.iter().any(|name| INDICES.contains(name)) => Ok(self),
            others => Err(Fault::whole(format_args!(
                "the PLY's faces have the lists {} and no list {}: which vertices they have is not known; name it so in the header",
                text::shown(others.join(", ").as_bytes()),
                INDICES.join(" or ")
            ))),
        }
    }
}

fn encoding(name: &str, line: usize) -> Result<Encoding, Fault> {
    match name {
        "ascii" => Ok(Encoding::Text),
        "binary_little_endian" => Ok(Encoding::Little),
        "binary_big_endian" => Ok(Encoding::Big),
        _ => {
            let found = text::shown(name.as_bytes());
            let what =
                format_args!("{found} is no format of PLY; right is ascii, binary_little_endian or binary_big_endian");
            Err(Fault::line(line, what))
        }
    }
}

fn scalar(name: &str, line: usize) -> Result<Scalar, Fault> {
    Ok(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => {
            let found = text::shown(name.as_bytes());
            return Err(Fault::line(line, format_args!("{found} is no type of PLY; right is float, int, uchar, …")));
        }
    })
}

/// The values of a PLY, one after the other, whatever their encoding.
enum Values<'a> {
    Text { words: Box<dyn Iterator<Item = (usize, &'a [u8])> + 'a>, line: usize },
    Binary { bytes: &'a [u8], at: usize, first: usize, big: bool },
}

impl<'a> Values<'a> {
    fn new(bytes: &'a [u8], header: &Header) -> Self {
        let before = header.lines;
        match header.encoding {
            Encoding::Text => {
                let lines = text::lines(bytes);
                let words =
                    lines.flat_map(move |(line, text)| text::words(text).map(move |word| (before + line, word)));
                Self::Text { words: Box::new(words), line: before + 1 }
            }
            encoding => Self::Binary { bytes, at: 0, first: header.length, big: encoding == Encoding::Big },
        }
    }

    /// Where the next value stands, or the last one of a text: the line, counted from 1, or the byte, from 0.
    fn position(&self) -> usize {
        match self {
            Self::Text { line, .. } => *line,
            Self::Binary { at, first, .. } => first + at,
        }
    }

    fn kind_of_location(&self) -> fn(usize) -> Location {
        match self {
            Self::Text { .. } => Location::Line,
            Self::Binary { .. } => Location::Byte,
        }
    }

    fn location(&self) -> Location {
        self.kind_of_location()(self.position())
    }

    /// How many values a property has: one, or as many as its list is long, which it says itself.
    fn count(&mut self, property: &Property) -> Result<u64, Fault> {
        let Some(length) = property.length else { return Ok(1) };
        let (location, length) = (self.location(), self.next(length)?);
        match length >= 0.0 && length.fract() == 0.0 {
            true => Ok(length as u64),
            false => Err(Fault::at(location, format_args!("a list has the length {length}"))),
        }
    }

    /// Passes over all values of a property.
    fn pass_over(&mut self, property: &Property) -> Result<(), Fault> {
        (0..self.count(property)?).try_for_each(|_| self.next(property.scalar).map(|_| ()))
    }

    /// What stands behind the last element: what it is, how much, and where. White space is nothing.
    fn left(self) -> Option<(&'static str, usize, Location)> {
        match self {
            Self::Text { mut words, .. } => {
                let (line, _) = words.next()?;
                let count = 1 + words.count();
                Some(("numbers or words behind the PLY's last element are left out", count, Location::Line(line)))
            }
            Self::Binary { bytes, at, first, .. } => {
                let count = bytes[at..].trim_ascii().len();
                let what = "bytes behind the PLY's last element are left out";
                (count > 0).then_some((what, count, Location::Byte(first + at)))
            }
        }
    }

    fn next(&mut self, scalar: Scalar) -> Result<f64, Fault> {
        let location = self.location();
        let ended = || Fault::at(location.clone(), "the PLY ends before all of its elements: it is cut off");
        match self {
            Self::Text { words, line } => {
                let (number, word) = words.next().ok_or_else(ended)?;
                *line = number;
                text::number(word).map_err(|what| Fault::line(number, what))
            }
            Self::Binary { bytes, at, big, .. } => {
                let size = scalar.size();
                let raw = bytes.get(*at..*at + size).ok_or_else(ended)?;
                *at += size;
                let mut ordered = [0; 8];
                ordered[..size].copy_from_slice(raw);
                if *big {
                    ordered[..size].reverse();
                }
                Ok(scalar.value(ordered))
            }
        }
    }
}

impl Scalar {
    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The value whose bytes come first, the lowest first.
    fn value(self, bytes: [u8; 8]) -> f64 {
        let [a, b, c, d, ..] = bytes;
        match self {
            Self::I8 => f64::from(a.cast_signed()),
            Self::U8 => f64::from(a),
            Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            Self::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::F64 => f64::from_le_bytes(bytes),
        }
    }
}
