//! What a person wants to know of a world before a robot is sent into it.

use std::fmt::{self, Write};

use elk_geometry::Bounds;
use elk_geometry::voxel::FACES;
use nalgebra::{Point3, Vector3};
use serde::Serialize;

use crate::openness::Openness;
use crate::units::{self, Unit};
use crate::world::World;

/// Cells along the longest edge of a world in which it is looked for free space.
const CELLS: usize = 28;
/// Free places of which the distance to the next surface is looked at.
const MEASURED: usize = 400;
/// Less room gained than this share of a world's longest edge is not worth a step.
const GAIN: f64 = 1e-4;
/// Starts that are offered.
const STARTS: usize = 3;

/// A place where a robot could start.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Start {
    /// Where (m, world), rounded as [`units::digits`] says.
    pub place: Point3<f64>,
    /// Distance to the next surface (m).
    pub clearance_m: f64,
}

/// What is known of a world.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Inspection {
    /// Its name.
    pub name: String,
    /// Its file's format.
    pub format: Option<String>,
    /// The box around it (m, world).
    pub bounds: Bounds,
    /// The edges of that box (m).
    pub size: Vector3<f64>,
    /// Faces of the file.
    pub faces: usize,
    /// Faces without area, which are left out.
    pub degenerate_faces: usize,
    /// Faces whose outline crosses itself.
    pub crossed_faces: usize,
    /// Faces that lie exactly on others, which are left out.
    pub doubled_faces: usize,
    /// Triangles.
    pub triangles: usize,
    /// Area of all surfaces (m²).
    pub surface_m2: f64,
    /// Parts that hang together.
    pub shells: usize,
    /// Parts that have free space on both sides.
    pub sheets: usize,
    /// Triangles that looked away from the free side, and were turned over.
    pub turned_triangles: usize,
    /// The file has its inside out.
    pub inside_out: bool,
    /// Whether none of the rays that were cast from free places gets out.
    pub closed: bool,
    /// Where it is open.
    pub openness: Openness,
    /// Free space (m³), from samples: to a few per cent.
    pub free_volume_m3: f64,
    /// The unit that it was probably drawn in, told by its size as it is placed.
    pub unit: Option<Unit>,
    /// Places where a robot could start, in different rooms if there are any, the widest first.
    pub starts: Vec<Start>,
    /// What whoever uses it should know.
    pub remarks: Vec<String>,
}

/// Looks at a world. `name` is for people.
pub fn inspect(name: &str, world: &World) -> Inspection {
    let reading = world.reading();
    let (bounds, openness) = (world.extents(), world.openness().clone());
    let lattice = Lattice::over(world);
    let triangles = world.surfaces().triangles();
    Inspection {
        name: name.to_owned(),
        format: reading.format.map(|format| format.to_string()),
        bounds,
        size: bounds.dim(),
        faces: reading.polygons,
        degenerate_faces: reading.degenerate,
        crossed_faces: reading.crossed,
        doubled_faces: reading.doubled,
        triangles: triangles.len(),
        surface_m2: triangles.iter().map(|triangle| triangle.normal().norm() / 2.0).sum(),
        shells: reading.winding.shells,
        sheets: reading.winding.sheets,
        turned_triangles: reading.winding.turned_faces,
        inside_out: reading.winding.inside_out,
        closed: openness.places > 0 && !openness.is_open(),
        openness,
        free_volume_m3: lattice.free.len() as f64 * lattice.cell_m3,
        unit: units::guess(bounds.dim().max()),
        starts: starts_among(world, &lattice.free),
        remarks: reading.remarks(),
    }
}

/// Places where a robot could start, the widest first, none of them in sight of another.
pub fn starts(world: &World) -> Vec<Start> {
    starts_among(world, &Lattice::over(world).free)
}

/// The free ones among points that are spread evenly over a world.
struct Lattice {
    free: Vec<Point3<f64>>,
    cell_m3: f64,
}

impl Lattice {
    fn over(world: &World) -> Self {
        let Bounds { min, .. } = world.extents();
        let dim = world.extents().dim();
        let counts = [0, 1, 2].map(|axis| ((dim[axis] / dim.max() * CELLS as f64).ceil() as usize).max(1));
        let cell = Vector3::from_fn(|axis, _| dim[axis] / counts[axis] as f64);
        let all = (0..counts[0] * counts[1] * counts[2]).map(|i| {
            let index = [i / (counts[1] * counts[2]), i / counts[2] % counts[1], i % counts[2]];
            min + Vector3::from_fn(|axis, _| (index[axis] as f64 + 0.5) * cell[axis])
        });
        Self { free: all.filter(|point| world.is_free(*point)).collect(), cell_m3: cell.product() }
    }
}

fn starts_among(world: &World, free: &[Point3<f64>]) -> Vec<Start> {
    let stride = free.len().div_ceil(MEASURED).max(1);
    let mut places: Vec<Start> = free.iter().step_by(stride).filter_map(|point| start_near(world, *point)).collect();
    places.sort_by(|a, b| b.clearance_m.total_cmp(&a.clearance_m));
    let mut chosen: Vec<Start> = Vec::new();
    for place in places {
        let sees = |other: &Start| world.cast(place.place, other.place - place.place).is_none_or(|t| t > 1.0);
        if chosen.len() < STARTS && !chosen.iter().any(sees) {
            chosen.push(widest_near(world, place));
        }
    }
    chosen
}

/// The place with the most room that is reached by steps from one to a better one, which become smaller.
fn widest_near(world: &World, start: Start) -> Start {
    let mut best = start;
    let least = world.extents().dim().max() * GAIN;
    for step in [0.5, 0.25, 0.1, 0.05, 0.02].map(|share| share * start.clearance_m.max(least)) {
        let mut better = true;
        while better {
            let around = FACES.map(|face| Vector3::from(face.to_array().map(f64::from)) * step);
            let next = around.into_iter().filter_map(|step| start_near(world, best.place + step));
            let next = next.max_by(|a, b| a.clearance_m.total_cmp(&b.clearance_m));
            better = next.is_some_and(|next| next.clearance_m > best.clearance_m + least);
            best = next.filter(|_| better).unwrap_or(best);
        }
    }
    best
}

fn start_near(world: &World, point: Point3<f64>) -> Option<Start> {
    let place = point.map(|c| units::rounded(c, world.digits()));
    let clearance_m = world.surfaces().distance(place);
    (clearance_m > 0.0 && world.is_free(place)).then_some(Start { place, clearance_m })
}

impl Inspection {
    fn units_in_words(&self) -> String {
        match self.unit {
            Some(Unit { metres: 1.0, .. }) => "metres, by its size".to_owned(),
            Some(Unit { name, metres }) => {
                format!(
                    "{name}, by its size: a mission then says <Scale>{metres}</Scale> (elk world info --scale {metres})"
                )
            }
            None => "its size fits no unit: see whether it is to be scaled (Scale)".to_owned(),
        }
    }

    fn closed_in_words(&self) -> String {
        match (self.openness.words(), self.openness.places) {
            (Some(words), _) => format!("no: {words}"),
            (None, 0) => "nothing in it is free".to_owned(),
            (None, _) => "yes".to_owned(),
        }
    }

    fn winding_in_words(&self) -> &'static str {
        match (self.inside_out, self.turned_triangles) {
            (true, _) => "turned over, inside out",
            (false, 0) => "as it should be",
            (false, _) => "mended",
        }
    }
}

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, size, bounds: Bounds { min, max }, .. } = self;
        let format = self.format.as_deref().unwrap_or("a world");
        let digits = units::digits(size.max());
        let point = |p: &Point3<f64>| format!("{:.digits$}; {:.digits$}; {:.digits$}", p.x, p.y, p.z);
        writeln!(f, "{name}: {format}, {} faces, {} triangles", self.faces, self.triangles)?;
        writeln!(
            f,
            "  size     {:.digits$} × {:.digits$} × {:.digits$} m, from ({}) to ({})",
            size.x,
            size.y,
            size.z,
            point(min),
            point(max)
        )?;
        writeln!(f, "  unit     {}", self.units_in_words())?;
        writeln!(f, "  shells   {}{}", self.shells, self.sheets_in_words())?;
        writeln!(f, "  closed   {}", self.closed_in_words())?;
        writeln!(f, "  winding  {}", self.winding_in_words())?;
        writeln!(f, "  surface  {:.*} m²", 2 * digits - 2, self.surface_m2)?;
        writeln!(f, "  free     about {:.*} m³", 3 * digits - 5, self.free_volume_m3)?;
        match self.starts.as_slice() {
            [] => writeln!(f, "  start    nowhere: no free place was found")?,
            starts => {
                for Start { place, clearance_m } in starts {
                    writeln!(
                        f,
                        "  start    <Start>{}</Start>, {clearance_m:.digits$} m off every surface",
                        point(place)
                    )?;
                }
            }
        }
        if self.degenerate_faces > 0 {
            writeln!(f, "  note     {} faces have no area and are left out", self.degenerate_faces)?;
        }
        self.remarks.iter().try_for_each(|remark| writeln!(f, "  note     {remark}"))
    }
}

impl Inspection {
    fn sheets_in_words(&self) -> String {
        let mut words = String::new();
        if self.sheets > 0 {
            // Writing to a string cannot fail.
            let _ = write!(words, ", of which {} are sheets with free space on both sides", self.sheets);
        }
        words
    }
}
