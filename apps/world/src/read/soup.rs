//! What a reader has found: triangles, from polygons of any shape.

use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};

use nalgebra::Point3;

use crate::polygon::{self, Cut};
use crate::read::budget::Budget;
use crate::read::fault::{Fault, Location};
use crate::triangle::Triangle;

/// Larger coordinates than this are a mistake, and products of them no numbers.
const FARTHEST: f64 = 1e15;

/// The triangles of a file, in its own units and axes, and what was noticed on the way.
#[derive(Debug, Clone, Default)]
pub struct Soup {
    /// The triangles.
    pub triangles: Vec<Triangle>,
    /// Polygons that they were cut from.
    pub polygons: usize,
    /// Polygons without area, which are left out: they are no surface.
    pub degenerate: usize,
    /// Polygons whose outline crosses itself.
    pub crossed: usize,
    /// What else of the file is no surface here, or another one than it says.
    pub notices: Vec<Notice>,
    /// Polygons that were left out since they lie exactly on others.
    pub doubled: usize,
    /// The polygons that gave triangles.
    faces: Vec<Face>,
    budget: Budget,
}

/// Something of a file that is left out, or not read as it stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    what: &'static str,
    count: usize,
    example: String,
    first: Location,
}

impl fmt::Display for Notice {
    /// `2 statements … are left out (the first: "surf" in line 7)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, count, example, first } = self;
        let first = match first {
            Location::Line(line) => format!(" in line {line}"),
            other => other.to_string(),
        };
        write!(f, "{count} {what}")?;
        match (example.as_str(), first.as_str()) {
            ("", "") => Ok(()),
            ("", first) => write!(f, " (the first{first})"),
            (example, first) => write!(f, " (the first: {example}{first})"),
        }
    }
}

/// A polygon that gave triangles.
#[derive(Debug, Clone, Copy)]
struct Face {
    /// A hash of its corners, whichever comes first and whichever way they go.
    outline: u64,
    /// Where its triangles end among those of all.
    end: usize,
}

impl Soup {
    /// Takes a polygon: its corners in order, along holes by way of bridges to them.
    ///
    /// # Errors
    /// A corner is not a finite number, or beyond all worlds; or there are too many of them, or too many polygons.
    pub fn polygon(&mut self, corners: &[Point3<f64>], location: impl Fn() -> Location) -> Result<(), Fault> {
        let out_of_reach = |corner: &&Point3<f64>| corner.iter().any(|c| !c.is_finite() || c.abs() > FARTHEST);
        if let Some(corner) = corners.iter().find(out_of_reach) {
            let [x, y, z] = [corner.x, corner.y, corner.z];
            let why = if corner.iter().all(|c| c.is_finite()) { "beyond all worlds" } else { "not a finite number" };
            let what = format_args!("a face has the corner ({x:?}; {y:?}; {z:?}), which is {why}: export it again");
            return Err(Fault::at(location(), what));
        }
        self.budget.face(corners.len()).map_err(|what| Fault::at(location(), what))?;
        self.polygons += 1;
        let before = self.triangles.len();
        let cut = polygon::triangulate(corners, |triangle| self.triangles.push(triangle));
        if cut == Cut::Crossed {
            self.crossed += 1;
            self.notice("faces have outlines that cross themselves: what is inside is a guess", 1, "", &location);
        }
        match self.triangles.len() == before {
            true => self.degenerate += 1,
            false => self.faces.push(Face { outline: outline(corners), end: self.triangles.len() }),
        }
        Ok(())
    }

    /// Counts something of the file that is left out, or not read as it stands: `what` follows a number, `example` is a
    /// word of the first one.
    pub(crate) fn notice(&mut self, what: &'static str, count: usize, example: &str, location: impl Fn() -> Location) {
        match self.notices.iter_mut().find(|notice| notice.what == what) {
            Some(notice) => notice.count += count,
            None => self.notices.push(Notice { what, count, example: example.to_owned(), first: location() }),
        }
    }

    /// Leaves out polygons that have exactly the corners of one before. Of each triangle that is left: how often its
    /// polygon was there. To be asked once.
    pub fn leave_out_copies(&mut self) -> Vec<u32> {
        let faces = std::mem::take(&mut self.faces);
        let mut order: Vec<usize> = (0..faces.len()).collect();
        order.sort_by_key(|&i| faces[i].outline);
        let mut times = vec![0; faces.len()];
        for same in order.chunk_by(|&a, &b| faces[a].outline == faces[b].outline) {
            times[same[0]] = same.len() as u32;
        }
        self.doubled = times.iter().filter(|times| **times == 0).count();
        let mut copies = Vec::new();
        let (mut triangle, mut face) = (0, 0);
        self.triangles.retain(|_| {
            face += usize::from(triangle == faces[face].end);
            triangle += 1;
            copies.extend((times[face] > 0).then_some(times[face]));
            times[face] > 0
        });
        copies
    }

    /// Counts a part of the file that is gone through, and perhaps has no polygon: one can be named very often.
    ///
    /// # Errors
    /// It is one too many.
    pub(crate) fn part(&mut self, location: impl Fn() -> Location) -> Result<(), Fault> {
        self.budget.face(0).map_err(|what| Fault::at(location(), what))
    }
}

fn outline(corners: &[Point3<f64>]) -> u64 {
    // Two zeros are one place; a sum of edges does not mind where an outline begins and which way it goes.
    let places: Vec<u64> = corners.iter().map(|c| hashed(&[c.x, c.y, c.z].map(|c| (c + 0.0).to_bits()))).collect();
    let edges = places.iter().zip(places.iter().cycle().skip(1));
    edges.map(|(one, other)| hashed(&[*one.min(other), *one.max(other)])).fold(0, u64::wrapping_add)
}

fn hashed(all: &[u64]) -> u64 {
    let mut hasher = DefaultHasher::new();
    all.hash(&mut hasher);
    hasher.finish()
}
