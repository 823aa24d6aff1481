//! The voxels of one size.

use nalgebra::SVector;

use crate::moments::Moments;
use crate::table::{Index, LIMIT, Table};

/// A piece of surface: of a plane in space, of a line in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Surface<const D: usize> {
    /// A point of it, metres.
    pub point: SVector<f64, D>,
    /// Its unit normal, of either sign.
    pub normal: SVector<f64, D>,
}

/// One voxel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell<const D: usize> {
    index: Index<D>,
    moments: Moments<D>,
    pub surface: Option<Surface<D>>,
    /// Whether voxels of finer levels in it have surfaces.
    pub is_refined: bool,
    /// When it last was added to, as the caller counts.
    seen: u64,
}

/// Voxels of one size, in the order in which they came.
#[derive(Clone, Debug)]
pub(crate) struct Level<const D: usize> {
    size: f64,
    table: Table<D>,
    cells: Vec<Cell<D>>,
    /// Voxels that were added to or forgotten since surfaces were up to date.
    changed: Vec<Index<D>>,
}

impl<const D: usize> Level<D> {
    /// Points that a surface needs in and around its voxel.
    const LEAST_POINTS: f64 = 5.0;
    /// What a surface has to extend to along its shorter axis, in standard deviations by edges of a voxel: more than a line of points in
    /// space, more than one point in the plane.
    const LEAST_EXTENT: f64 = 0.2;
    /// How thick it may be beside that.
    const MOST_THICKNESS: f64 = 0.7;

    pub fn new(size: f64) -> Self {
        Self { size, table: Table::new(), cells: Vec::new(), changed: Vec::new() }
    }

    pub fn size(&self) -> f64 {
        self.size
    }

    pub fn len(&self) -> usize {
        self.cells.len()
    }

    pub fn moments(&self) -> Vec<Moments<D>> {
        self.cells.iter().map(|cell| cell.moments).collect()
    }

    /// The voxel in which a place is.
    fn index(&self, place: &SVector<f64, D>) -> Index<D> {
        std::array::from_fn(|axis| ((place[axis] / self.size).floor() as i32).clamp(-LIMIT, LIMIT))
    }

    /// Adds points to the voxel in which their mean is.
    pub fn add(&mut self, moments: &Moments<D>, now: u64) {
        let index = self.index(&moments.mean);
        let place = self.table.get_or_insert(&index, self.cells.len());
        if place == self.cells.len() {
            self.cells.push(Cell { index, moments: *moments, surface: None, is_refined: false, seen: now });
            self.changed.push(index);
            return;
        }
        let cell = &mut self.cells[place];
        cell.moments.add(moments);
        if cell.seen != now {
            cell.seen = now;
            self.changed.push(index);
        }
    }

    /// Forgets the voxels that were last added to before `since`.
    pub fn forget(&mut self, since: u64) {
        let is_old = |cell: &Cell<D>| cell.seen < since;
        if !self.cells.iter().any(is_old) {
            return;
        }
        self.changed.extend(self.cells.iter().filter(|cell| is_old(cell)).map(|cell| cell.index));
        self.cells.retain(|cell| !is_old(cell));
        self.table = Table::new();
        for (place, cell) in self.cells.iter().enumerate() {
            self.table.get_or_insert(&cell.index, place);
        }
    }

    /// Brings the surfaces up to date in and around all voxels that have changed.
    pub fn update_surfaces(&mut self) {
        let all = self.changed.len() >= self.cells.len();
        let mut is_stale = vec![all; self.cells.len()];
        for index in self.changed.drain(..).filter(|_| !all) {
            around(&self.table, &index).for_each(|place| is_stale[place] = true);
        }
        for place in (0..self.cells.len()).filter(|&place| is_stale[place]) {
            self.cells[place].surface = self.surface(&self.cells[place].index);
        }
    }

    /// The surface in a voxel: of the points of it and of all that touch it, through their mean, square to the direction in which they scatter
    /// least.
    fn surface(&self, index: &Index<D>) -> Option<Surface<D>> {
        let mut moments = Moments::NONE;
        around(&self.table, index).for_each(|place| moments.add(&self.cells[place].moments));
        if moments.count < Self::LEAST_POINTS {
            return None;
        }
        let (normal, variances) = moments.principal();
        let extent = (Self::LEAST_EXTENT * self.size).powi(2);
        let is_surface = variances[1] >= extent && variances[0] <= Self::MOST_THICKNESS.powi(2) * variances[1];
        is_surface.then_some(Surface { point: moments.mean, normal })
    }

    /// Marks the voxels in which finer surfaces are: those of the next finer level.
    pub fn refine(&mut self, finer: &Self) {
        self.cells.iter_mut().for_each(|cell| cell.is_refined = false);
        for cell in finer.cells.iter().filter(|cell| cell.is_refined || cell.surface.is_some()) {
            if let Some(place) = self.table.get(&cell.index.map(|i| i >> 1)) {
                self.cells[place].is_refined = true;
            }
        }
    }

    /// The surface of the voxel in which a place is.
    pub fn at(&self, place: &SVector<f64, D>) -> Option<&Surface<D>> {
        self.table.get(&self.index(place)).and_then(|place| self.cells[place].surface.as_ref())
    }

    /// The voxels that come within half an edge of a place.
    pub fn beside(&self, place: &SVector<f64, D>) -> impl Iterator<Item = (Index<D>, usize)> {
        self.table.cube(self.index(&place.add_scalar(-self.size / 2.0)), 2)
    }

    /// Those of the voxels of which a voxel of the next coarser level consists, the nearest to a place first.
    pub fn within<'a>(
        &'a self,
        coarser: &Index<D>,
        place: &SVector<f64, D>,
    ) -> impl Iterator<Item = (Index<D>, usize)> + use<'a, D> {
        let is_upper = |axis: usize| place[axis] > f64::from(2 * coarser[axis] + 1) * self.size;
        self.table.halves(coarser, (0..D).map(|axis| usize::from(is_upper(axis)) << axis).sum())
    }

    /// A voxel by its place.
    pub fn cell(&self, place: usize) -> &Cell<D> {
        &self.cells[place]
    }

    /// The voxels that have a surface and none finer in them.
    #[cfg(test)]
    pub fn unrefined_surfaces(&self) -> impl Iterator<Item = Index<D>> {
        self.cells.iter().filter(|cell| cell.surface.is_some() && !cell.is_refined).map(|cell| cell.index)
    }

    /// The surface of a voxel.
    #[cfg(test)]
    pub fn surface_at(&self, index: &Index<D>) -> Option<Surface<D>> {
        self.table.get(index).and_then(|place| self.cells[place].surface)
    }

    /// The square of a place's distance from a voxel, m².
    pub fn distance_squared(&self, index: &Index<D>, place: &SVector<f64, D>) -> f64 {
        (0..D)
            .map(|axis| {
                let least = f64::from(index[axis]) * self.size;
                (least - place[axis]).max(place[axis] - least - self.size).max(0.0).powi(2)
            })
            .sum()
    }
}

/// The places of a voxel and of those that touch it.
fn around<const D: usize>(table: &Table<D>, index: &Index<D>) -> impl Iterator<Item = usize> {
    table.cube(index.map(|i| i - 1), 3).map(|(_, place)| place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Points of a few sheets, in the order of their times.
        #[test]
        fn surfaces_are_those_of_all_points_that_are_left(
            batches in prop::collection::vec(prop::collection::vec(prop::array::uniform3(0.0..1.0f64), 0..60), 1..8),
            window in 1u64..4,
        ) {
            let mut level = Level::<3>::new(0.13);
            for (now, points) in batches.iter().enumerate() {
                for &[x, y, z] in points {
                    level.add(&Moments::of(SVector::from([x, y, 0.3 * x + 0.05 * z])), now as u64);
                }
                level.forget((now as u64 + 1).saturating_sub(window));
                level.update_surfaces();
                prop_assert!(level.cells.iter().all(|cell| cell.seen + window > now as u64));
                for cell in &level.cells {
                    prop_assert_eq!(cell.surface, level.surface(&cell.index));
                    prop_assert_eq!(level.table.get(&cell.index).map(|place| level.cells[place].index), Some(cell.index));
                }
            }
        }
    }

    #[test]
    fn a_sheet_has_surfaces_and_a_line_none() {
        let mut level = Level::<3>::new(0.2);
        for i in 0..900 {
            let (x, y) = (f64::from(i / 30) * 0.05, f64::from(i % 30) * 0.05);
            level.add(&Moments::of(SVector::from([x, y, 0.1 + 0.75 * x])), 1);
            level.add(&Moments::of(SVector::from([5.0, 5.0, f64::from(i) * 0.01])), 1);
        }
        level.update_surfaces();
        let at = |place: [f64; 3]| level.at(&SVector::from(place));
        let normal = at([0.7, 0.7, 0.625]).unwrap().normal;
        assert!(normal.dot(&SVector::from([-0.6, 0.0, 0.8])).abs() > 1.0 - 1e-9, "{normal}");
        assert_eq!(at([5.0, 5.0, 3.0]), None);
        assert_eq!(at([0.7, 0.7, 1.3]), None, "it is 0.4 m above the sheet");
    }
}
