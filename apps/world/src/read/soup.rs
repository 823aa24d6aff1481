//! What a reader has found: triangles, from polygons of any shape.

use std::hash::{DefaultHasher, Hash, Hasher};

use nalgebra::Point3;

use crate::polygon::{self, Cut};
use crate::read::budget::Budget;
use crate::read::{Fault, Place};
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
    /// Where the first of these stands.
    pub first_crossed: Option<Place>,
    /// A hash of each polygon's corners, whichever comes first and whichever way they go.
    outlines: Vec<u64>,
    budget: Budget,
}

impl Soup {
    /// Takes a polygon: its corners in order, along holes by way of bridges to them.
    ///
    /// # Errors
    /// A corner is not a finite number, or beyond all worlds; or there are too many of them, or too many polygons.
    pub fn polygon(&mut self, corners: &[Point3<f64>], place: impl Fn() -> Place) -> Result<(), Fault> {
        let out_of_reach = |corner: &&Point3<f64>| corner.iter().any(|c| !c.is_finite() || c.abs() > FARTHEST);
        if let Some(corner) = corners.iter().find(out_of_reach) {
            let [x, y, z] = [corner.x, corner.y, corner.z];
            let why = if corner.iter().all(|c| c.is_finite()) { "beyond all worlds" } else { "not a finite number" };
            let what = format_args!("a face has the corner ({x:?}; {y:?}; {z:?}), which is {why}: export it again");
            return Err(Fault::at(place(), what));
        }
        self.budget.face(corners.len()).map_err(|what| Fault::at(place(), what))?;
        self.polygons += 1;
        let before = self.triangles.len();
        let cut = polygon::triangulate(corners, |triangle| self.triangles.push(triangle));
        if cut == Cut::Crossed {
            self.crossed += 1;
            self.first_crossed.get_or_insert_with(place);
        }
        match self.triangles.len() == before {
            true => self.degenerate += 1,
            false => self.outlines.push(outline(corners)),
        }
        Ok(())
    }

    /// How many polygons have exactly the corners of one before. To be asked once.
    pub fn doubled(&mut self) -> usize {
        let mut outlines = std::mem::take(&mut self.outlines);
        outlines.sort_unstable();
        outlines.windows(2).filter(|pair| pair[0] == pair[1]).count()
    }

    /// Counts a part of the file that is gone through, and perhaps has no polygon: one can be named very often.
    ///
    /// # Errors
    /// It is one too many.
    pub(crate) fn part(&mut self, place: impl Fn() -> Place) -> Result<(), Fault> {
        self.budget.face(0).map_err(|what| Fault::at(place(), what))
    }
}

fn outline(corners: &[Point3<f64>]) -> u64 {
    // Two zeros are one place; a sum does not mind the order.
    corners.iter().map(|c| hashed(&[c.x, c.y, c.z].map(|c| (c + 0.0).to_bits()))).fold(0, u64::wrapping_add)
}

fn hashed(all: &[u64]) -> u64 {
    let mut hasher = DefaultHasher::new();
    all.hash(&mut hasher);
    hasher.finish()
}
