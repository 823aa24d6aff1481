//! The true world: surfaces from an OBJ file, and what is free between them.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use elk_outside::file;
use elk_spatial::Bounds;
use nalgebra::{Point3, Vector3};

use crate::bvh::Bvh;
use crate::random::Random;
use crate::ray::Ray;
use crate::triangle::{Triangle, bounds_of};

/// The world that is built into the program.
pub const CAR_INTERIOR: &str = "car-interior";

const CAR_INTERIOR_OBJ: &str = include_str!("../../../mission-files/worlds/car.obj");

/// The names of the built-in worlds.
pub const BUILT_IN: [&str; 7] = [CAR_INTERIOR, "apartment", "car", "garage", "hall", "hall-long", "kitchen"];

/// The built-in world of this name, as OBJ.
fn built_in(name: &str) -> Option<&'static str> {
    Some(match name {
        CAR_INTERIOR | "car" => CAR_INTERIOR_OBJ,
        "apartment" => include_str!("../../../mission-files/worlds/apartment.obj"),
        "garage" => include_str!("../../../mission-files/worlds/garage.obj"),
        "hall" => include_str!("../../../mission-files/worlds/hall.obj"),
        "hall-long" => include_str!("../../../mission-files/worlds/hall-long.obj"),
        "kitchen" => include_str!("../../../mission-files/worlds/kitchen.obj"),
        _ => return None,
    })
}

/// Directions in which surfaces are counted; none is along an axis or a diagonal, where worlds have their edges.
const PROBES: [[f64; 3]; 5] = [
    [0.5377, 0.2139, 0.8156],
    [-0.4811, 0.7273, 0.4894],
    [0.8213, -0.5319, -0.2061],
    [-0.3541, -0.6037, -0.7143],
    [0.1973, 0.9041, -0.3791],
];

/// The largest file that is read (bytes): some five million triangles, which take a gigabyte.
const MAX_FILE_BYTES: u64 = 256 << 20;

/// Tries before a world counts as too narrow for a random start.
const START_TRIES: u32 = 100_000;

/// A closed world: a shell that looks inwards and solids in it that look outwards, so that every face is anticlockwise
/// as seen from the free side. Solids may touch, overlap and stick out through the shell.
#[derive(Debug, Clone)]
pub struct World {
    surfaces: Bvh,
    extents: Bounds,
}

/// Why a world cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// The file cannot be read.
    #[error("cannot read the world {}: {source}; World takes an OBJ file or `{CAR_INTERIOR}`", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is no OBJ.
    #[error("the world {name} is not a valid OBJ file: {source}")]
    Parse {
        /// The world.
        name: String,
        /// What the parser says.
        source: tobj::LoadError,
    },
    /// A vertex is not a number, or infinite.
    #[error(
        "the world {name} has a vertex with a coordinate that is not a finite number (triangle {triangle}): export it again"
    )]
    NotFinite {
        /// The world.
        name: String,
        /// The first triangle with such a vertex, from 0.
        triangle: usize,
    },
    /// There is no surface.
    #[error("the world {name} has no triangles: export it with its faces (lines `f …`)")]
    Empty {
        /// The world.
        name: String,
    },
    /// There is no room for a robot.
    #[error(
        "found no place in the world that is {clearance} m from every surface: is it closed, with all faces anticlockwise as \
         seen from the free side? Else say where to start (Start)"
    )]
    NoFreePlace {
        /// The clearance asked for (m).
        clearance: f64,
    },
}

impl World {
    /// The world in the OBJ file at `name`, or the built-in one of that name ([`BUILT_IN`]).
    pub fn load(name: &str) -> Result<Self, WorldError> {
        if let Some(text) = built_in(name) {
            return Self::from_obj(name, text);
        }
        let read = file::read(Path::new(name), MAX_FILE_BYTES);
        let bytes = read.map_err(|source| WorldError::Read { path: name.into(), source })?;
        Self::from_bytes(name, &bytes)
    }

    /// The world that `text`, in OBJ format, describes; polygons are cut into fans. `name` is for error messages.
    pub fn from_obj(name: &str, text: &str) -> Result<Self, WorldError> {
        Self::from_bytes(name, text.as_bytes())
    }

    /// As [`World::from_obj`], from the bytes of a file, whatever they are.
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<Self, WorldError> {
        let options =
            tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
        // Materials have no depth: a missing material library is no error.
        let no_materials = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
        let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, no_materials)
            .map_err(|source| WorldError::Parse { name: name.into(), source })?;
        Self::from_triangles(name, models.iter().flat_map(|m| triangles_of(&m.mesh)).collect())
    }

    /// The world between these triangles. `name` is for error messages.
    pub fn from_triangles(name: &str, triangles: Vec<Triangle>) -> Result<Self, WorldError> {
        let finite = |t: &Triangle| t.0.iter().all(|p| p.iter().all(|c| c.is_finite()));
        if triangles.is_empty() {
            return Err(WorldError::Empty { name: name.into() });
        }
        if let Some(triangle) = triangles.iter().position(|t| !finite(t)) {
            return Err(WorldError::NotFinite { name: name.into(), triangle });
        }
        Ok(Self { extents: bounds_of(triangles.iter().flat_map(|t| &t.0)), surfaces: Bvh::new(triangles) })
    }

    /// The smallest axis-aligned box around everything.
    pub fn extents(&self) -> Bounds {
        self.extents
    }

    /// All surfaces.
    pub fn surfaces(&self) -> &Bvh {
        &self.surfaces
    }

    /// How far from `origin` (m, world) along `direction` the first surface is, in lengths of `direction`; `None` if
    /// there is none.
    pub fn cast(&self, origin: Point3<f64>, direction: Vector3<f64>) -> Option<f64> {
        self.surfaces.nearest(&Ray::new(origin, direction))
    }

    /// Whether `point` (m, world) is inside the shell and in no solid: whether its winding number is negative, by a
    /// majority of directions, since a single ray may count an edge twice.
    pub fn is_free(&self, point: Point3<f64>) -> bool {
        if !self.extents.contains(point) {
            return false;
        }
        let votes = PROBES.iter().filter(|&&d| self.winding(point, d.into()) < 0);
        2 * votes.count() > PROBES.len()
    }

    /// Surfaces left minus surfaces entered on the way from `point` to infinity: −1 for the shell around it, +1 for
    /// each solid around it.
    fn winding(&self, point: Point3<f64>, direction: Vector3<f64>) -> i32 {
        let mut winding = 0;
        self.surfaces.hits(&Ray::new(point, direction), |hit| winding += if hit.front { -1 } else { 1 });
        winding
    }

    /// Whether a ball of `radius` (m) on its straight way between two points (m, world) touches any surface.
    pub fn touches(&self, from: Point3<f64>, to: Point3<f64>, radius: f64) -> bool {
        self.surfaces.touches(from, to, radius)
    }

    /// A free place drawn evenly from all that are farther than `clearance` (m) from every surface.
    pub fn draw_place(&self, clearance: f64, random: &mut Random) -> Result<Point3<f64>, WorldError> {
        let Bounds { min, max } = self.extents;
        (0..START_TRIES)
            .map(|_| Point3::from(std::array::from_fn(|i| random.between(min[i], max[i]))))
            .find(|&p| !self.touches(p, p, clearance) && self.is_free(p))
            .ok_or(WorldError::NoFreePlace { clearance })
    }
}

fn triangles_of(mesh: &tobj::Mesh) -> impl Iterator<Item = Triangle> {
    let corner = |index: &u32| {
        let first = *index as usize * 3;
        let at = |i: usize| mesh.positions.get(first + i).map_or(f64::NAN, |&c| f64::from(c));
        Point3::new(at(0), at(1), at(2))
    };
    mesh.indices.chunks_exact(3).map(move |t| Triangle([corner(&t[0]), corner(&t[1]), corner(&t[2])]))
}
