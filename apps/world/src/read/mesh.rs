//! Vertices, and faces that name them by number, before or behind them in the file: what OBJ and PLY have in common.

use nalgebra::Point3;

use crate::read::budget::{Budget, MOST_VERTICES};
use crate::read::fault::{Fault, Location};
use crate::read::soup::Soup;

/// A vertex that a face names, and where in the file.
#[derive(Debug, Clone, Copy)]
struct Corner {
    vertex: u64,
    at: usize,
}

/// A face: where it begins in the file, and where its corners end among those of all faces.
#[derive(Debug, Clone, Copy)]
struct Face {
    at: usize,
    end: usize,
}

/// What was read so far.
#[derive(Debug)]
pub(crate) struct Mesh {
    /// What a position in the file is: a line or a byte.
    location: fn(usize) -> Location,
    /// The number of the first vertex, as people say it.
    first_number: u64,
    vertices: Vec<Point3<f64>>,
    corners: Vec<Corner>,
    faces: Vec<Face>,
    budget: Budget,
}

impl Mesh {
    pub fn new(location: fn(usize) -> Location, first_number: u64) -> Self {
        let budget = Budget::default();
        Self { location, first_number, vertices: Vec::new(), corners: Vec::new(), faces: Vec::new(), budget }
    }

    /// How many vertices there are so far.
    pub fn vertices(&self) -> usize {
        self.vertices.len()
    }

    /// Takes the next vertex.
    ///
    /// # Errors
    /// It is one too many.
    pub fn vertex(&mut self, at: usize, vertex: Point3<f64>) -> Result<(), Fault> {
        if self.vertices.len() == MOST_VERTICES {
            let what =
                format_args!("there are more than {MOST_VERTICES} vertices, the most that are read: export less of it");
            return Err(self.fault(at, what));
        }
        self.vertices.push(vertex);
        Ok(())
    }

    /// Takes the next corner of the face that [`Mesh::end_face`] ends: a vertex, counted from 0, which may come later.
    ///
    /// # Errors
    /// The face has one too many.
    pub fn corner(&mut self, at: usize, vertex: u64) -> Result<(), Fault> {
        self.corners.push(Corner { vertex, at });
        let first = self.faces.last().map_or(0, |face| face.end);
        Budget::corners(self.corners.len() - first).map_err(|what| self.fault(at, what))
    }

    /// Ends the face that began at `at`.
    ///
    /// # Errors
    /// It is one too many.
    pub fn end_face(&mut self, at: usize) -> Result<(), Fault> {
        let first = self.faces.last().map_or(0, |face| face.end);
        let end = self.corners.len();
        self.budget.face(end - first).map_err(|what| self.fault(at, what))?;
        self.faces.push(Face { at, end });
        Ok(())
    }

    /// Hands over all faces.
    ///
    /// # Errors
    /// One of them is no polygon, or names a vertex that is not there.
    pub fn put_into(&self, soup: &mut Soup) -> Result<(), Fault> {
        let mut outline = Vec::new();
        let mut first = 0;
        for face in &self.faces {
            let corners = &self.corners[first..face.end];
            outline.clear();
            for corner in corners {
                outline.push(self.place_of(corner)?);
            }
            soup.polygon(&outline, || (self.location)(face.at))?;
            first = face.end;
        }
        Ok(())
    }

    fn place_of(&self, corner: &Corner) -> Result<Point3<f64>, Fault> {
        let vertex = usize::try_from(corner.vertex).ok().and_then(|vertex| self.vertices.get(vertex));
        vertex.copied().ok_or_else(|| {
            let (asked, there) = (corner.vertex.saturating_add(self.first_number), self.vertices.len());
            let counted = if self.first_number == 0 { ", counted from 0" } else { "" };
            self.fault(corner.at, format_args!("a face has the vertex {asked}, and the file has {there}{counted}"))
        })
    }

    /// What is wrong at a position in the file.
    pub fn fault(&self, at: usize, what: impl std::fmt::Display) -> Fault {
        Fault::at((self.location)(at), what)
    }
}
