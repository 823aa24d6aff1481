//! STL: triangles, as text or as 50 bytes each.

use nalgebra::Point3;

use crate::read::fault::{Fault, Location};
use crate::read::soup::Soup;
use crate::read::text;

/// Bytes before the number of triangles, before the first triangle, and of each of them: normal, three corners, two
/// bytes.
const HEADER: usize = 80;
const FIRST: usize = 84;
const RECORD: usize = 50;
/// Bytes of the normal, which says nothing that the corners do not.
const NORMAL: usize = 12;

/// Whether the bytes are as many as a binary file of its number of triangles has.
pub(crate) fn is_binary(bytes: &[u8]) -> bool {
    count(bytes).is_some_and(|count| FIRST as u64 + RECORD as u64 * u64::from(count) == bytes.len() as u64)
}

fn count(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(HEADER..FIRST)?;
    Some(u32::from_le_bytes([count[0], count[1], count[2], count[3]]))
}

/// Reads all triangles.
pub(crate) fn read(bytes: &[u8], soup: &mut Soup) -> Result<(), Fault> {
    let text = text::ascii_compatible(bytes);
    if is_binary(bytes) || !is_text(&text) { read_binary(bytes, soup) } else { read_text(&text, soup) }
}

/// Binary files may begin with `solid`, too; but a text has no zeros.
fn is_text(text: &[u8]) -> bool {
    let beginning = text::without_bom(text).trim_ascii_start();
    let is_solid = beginning.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    is_solid && !text.iter().take(FIRST + RECORD).any(|&byte| byte == 0)
}

fn read_binary(bytes: &[u8], soup: &mut Soup) -> Result<(), Fault> {
    let Some(count) = count(bytes) else {
        return Err(Fault::whole(format_args!("{} bytes are no STL: right are at least {FIRST}", bytes.len())));
    };
    let records = bytes[FIRST..].chunks_exact(RECORD);
    let there = records.len();
    if there < count as usize {
        return Err(Fault::whole(format_args!(
            "the STL says that it has {count} triangles, and has bytes for {there}: it is cut off, or no STL"
        )));
    }
    let (count, behind) = (count as usize, FIRST + RECORD * count as usize);
    if there > count {
        let what = "triangles behind those that the STL says it has are left out: its number is wrong, or they are";
        soup.notice(what, there - count, "", || Location::Byte(behind));
    } else if bytes.len() > behind {
        soup.notice("bytes behind the last triangle are left out", bytes.len() - behind, "", || Location::Byte(behind));
    }
    for (i, record) in records.take(count).enumerate() {
        let number = |at: usize| {
            let at = NORMAL + 4 * at;
            f64::from(f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]))
        };
        let corner = |k: usize| Point3::new(number(3 * k), number(3 * k + 1), number(3 * k + 2));
        soup.polygon(&[corner(0), corner(1), corner(2)], || Location::Byte(FIRST + RECORD * i))?;
    }
    Ok(())
}

/// `vertex` gives a corner, `endloop` ends a face; the words around them say nothing else.
fn read_text(text: &[u8], soup: &mut Soup) -> Result<(), Fault> {
    let mut corners: Vec<Point3<f64>> = Vec::new();
    let mut begun = 0;
    for (line, bytes) in text::lines(text) {
        let mut words = text::words(bytes);
        match words.next().map(<[u8]>::to_ascii_lowercase).as_deref() {
            Some(b"vertex") => corners.push(vertex(line, words)?),
            Some(b"outer") => {
                corners.clear();
                begun = line;
            }
            Some(b"endloop") => {
                if corners.len() > 3 {
                    soup.notice("facets have more than three corners: they are read as polygons", 1, "", || {
                        Location::Line(begun)
                    });
                }
                soup.polygon(&corners, || Location::Line(begun))?;
                corners.clear();
            }
            None | Some(b"solid" | b"endsolid" | b"facet" | b"endfacet" | b"color") => {}
            Some(word) => {
                let found = text::shown(word);
                return Err(Fault::line(
                    line,
                    format_args!("{found} is no word of STL; right is facet, outer loop, vertex, …"),
                ));
            }
        }
    }
    match corners.is_empty() {
        true => Ok(()),
        false => Err(Fault::line(begun, "the STL ends in the midst of a facet: it is cut off")),
    }
}

fn vertex<'a>(line: usize, mut words: impl Iterator<Item = &'a [u8]>) -> Result<Point3<f64>, Fault> {
    let mut coordinate = || match words.next() {
        Some(word) => text::number(word).map_err(|what| Fault::line(line, what)),
        None => Err(Fault::line(line, "a vertex has fewer than three coordinates; right is `vertex x y z`")),
    };
    Ok(Point3::new(coordinate()?, coordinate()?, coordinate()?))
}
