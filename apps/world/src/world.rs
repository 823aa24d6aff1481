//! The true world: surfaces from a file, and what is free between them.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use elk_geometry::Bounds;
use elk_outside::file;
use nalgebra::{Point3, Vector3};

use crate::bvh::Bvh;
use crate::openness::Openness;
use crate::partition::partitions;
use crate::placement::Placement;
use crate::ray::Ray;
use crate::read::{self, Fault, Format, MAX_FILE_BYTES, Notice, Soup};
use crate::regions::Regions;
use crate::topology::{Rim, Shell, Topology};
use crate::triangle::{Triangle, bounds_of};
use crate::units::{self, shown};
use crate::winding::{self, PROBES, Winding};
use elk_geometry::random::Random;

/// The world that is built into the program.
pub const CAR_INTERIOR: &str = "car-interior";

/// The names of the built-in worlds.
pub const BUILT_IN: [&str; 7] = [CAR_INTERIOR, "apartment", "car", "garage", "hall", "hall-long", "kitchen"];

/// A start that is drawn by lot is at least this far from every surface (m).
pub const START_CLEARANCE_M: f64 = 0.3;

/// The built-in world of this name, as OBJ.
fn built_in(name: &str) -> Option<&'static str> {
    Some(match name {
        CAR_INTERIOR | "car" => include_str!("../worlds/car.obj"),
        "apartment" => include_str!("../worlds/apartment.obj"),
        "garage" => include_str!("../worlds/garage.obj"),
        "hall" => include_str!("../worlds/hall.obj"),
        "hall-long" => include_str!("../worlds/hall-long.obj"),
        "kitchen" => include_str!("../worlds/kitchen.obj"),
        _ => return None,
    })
}

/// Rims that are kept: a surface with more ends than this is open for certain.
const MOST_RIMS: usize = 20_000;

/// Places that are drawn in search of free ones: a world in which none of them is counts as too narrow for a start.
const TRIES: u32 = 100_000;

/// A world: a shell that looks inwards and solids in it that look outwards, so that every face is anticlockwise as seen
/// from the free side. Solids may touch, overlap and stick out through the shell. Files whose faces are turned
/// otherwise are mended as they are read.
#[derive(Debug, Clone)]
pub struct World {
    surfaces: Bvh,
    /// The surfaces that something is in; `None`: all of them. Sheets have free space on both sides.
    bounding: Option<Bvh>,
    /// Some of them are open, and enclose nothing by themselves.
    has_open_shells: bool,
    /// What they enclose together, once somebody asked; `None`: the world is open.
    regions: OnceLock<Option<Regions>>,
    extents: Bounds,
    reading: Reading,
    /// Where surfaces end, once it is known.
    rims: OnceLock<Vec<Rim>>,
    /// How open it is, once somebody asked.
    pub(crate) openness: OnceLock<Openness>,
}

/// What was noticed while a world was read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reading {
    /// The file's format.
    pub format: Option<Format>,
    /// Its faces.
    pub polygons: usize,
    /// Those of them that lie exactly on others; they are left out.
    pub doubled: usize,
    /// Those of them that have no area; they are left out.
    pub degenerate: usize,
    /// Those whose outline crosses itself.
    pub crossed: usize,
    /// What else of it is left out, or not read as it stands.
    pub notices: Vec<Notice>,
    /// Shells that part what others bound.
    pub partitions: usize,
    /// How its faces were turned.
    pub winding: Winding,
}

/// Why a world cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// The file cannot be read.
    #[error(
        "cannot read the world {}: {source}; right is an OBJ, STL, PLY or glTF file, or built in: {}",
        path.display(), BUILT_IN.join(", ")
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Something in the file is wrong, or it is of another format.
    #[error("{name}{}: {}", .fault.location, .fault.what)]
    Wrong {
        /// The world.
        name: String,
        /// What is wrong, and where.
        fault: Fault,
    },
    /// There is no surface.
    #[error("the world {name} has no faces{}: export it with its faces", in_place_of_faces(*.degenerate, .notices))]
    Empty {
        /// The world.
        name: String,
        /// Faces that were there and have no area.
        degenerate: usize,
        /// What else was there.
        notices: Vec<Notice>,
    },
    /// Scaled, its coordinates are beyond all numbers.
    #[error("the world {name} has coordinates beyond all numbers (after Scale): {extents:?}")]
    TooLarge {
        /// The world.
        name: String,
        /// The box around it (m).
        extents: Bounds,
    },
    /// Faces are turned against each other, and it cannot be told which are right.
    #[error(
        "the world {name} has faces that are turned against each other, for example at the edge from {} to {}, and which of \
         them look to the free side cannot be told: make their normals consistent and export it again",
        shown(&.edge[0], *.digits), shown(&.edge[1], *.digits)
    )]
    Winding {
        /// The world.
        name: String,
        /// An edge between two such faces (m, world).
        edge: [Point3<f64>; 2],
        /// Digits behind the point that it is shown with.
        digits: usize,
    },
    /// There is no room for a robot.
    #[error(
        "found no place in the world that is {clearance} m from every surface: is it closed, and in metres (Scale)? `elk world \
         info` says what is known of it. Else say where to start (Start)"
    )]
    NoFreePlace {
        /// The clearance asked for (m).
        clearance: f64,
    },
}

fn first_rims(Topology { mut rims, .. }: Topology) -> Vec<Rim> {
    rims.truncate(MOST_RIMS);
    rims.shrink_to_fit();
    rims
}

fn in_place_of_faces(degenerate: usize, notices: &[Notice]) -> String {
    let without_area = if degenerate == 0 { String::new() } else { format!(" but {degenerate} without area") };
    notices.iter().fold(without_area, |words, notice| format!("{words}; {notice}"))
}

impl World {
    /// The world in the file at `name`, or the built-in one of that name ([`BUILT_IN`]).
    ///
    /// # Errors
    /// The file cannot be read, or is no world; why.
    pub fn load(name: &str, placement: &Placement) -> Result<Self, WorldError> {
        if let Some(text) = built_in(name) {
            return Self::from_bytes(name, text.as_bytes(), placement);
        }
        let read = file::read(Path::new(name), MAX_FILE_BYTES);
        let bytes = read.map_err(|source| WorldError::Read { path: name.into(), source })?;
        Self::from_bytes(name, &bytes, placement)
    }

    /// The world that the bytes of a file describe, whatever they are. `name` is for error messages; its ending counts
    /// where the bytes do not tell the format, and a glTF file's buffers are looked for beside it.
    ///
    /// # Errors
    /// It is no world; why.
    pub fn from_bytes(name: &str, bytes: &[u8], placement: &Placement) -> Result<Self, WorldError> {
        let folder = Path::new(name).parent().unwrap_or(Path::new(""));
        let wrong = |fault| WorldError::Wrong { name: name.into(), fault };
        let (format, mut soup) = read::read(name, bytes, folder).map_err(wrong)?;
        let copies = soup.leave_out_copies();
        for triangle in &mut soup.triangles {
            triangle.0 = triangle.0.map(|corner| placement.place(corner, format.up()));
        }
        if soup.triangles.is_empty() {
            let Soup { degenerate, notices, .. } = soup;
            return Err(WorldError::Empty { name: name.into(), degenerate, notices });
        }
        let (mut world, order) = Self::over(name, soup.triangles)?;
        world.reading = Reading {
            format: Some(format),
            polygons: soup.polygons,
            doubled: soup.doubled,
            degenerate: soup.degenerate,
            crossed: soup.crossed,
            notices: soup.notices,
            ..Reading::default()
        };
        let copies: Vec<u32> = order.iter().map(|&i| copies[i as usize]).collect();
        world.mend(name, &copies)?;
        Ok(world)
    }

    /// The world between these triangles, turned as they are. `name` is for error messages.
    ///
    /// # Errors
    /// There are none, or a corner is not a finite number.
    pub fn from_triangles(name: &str, triangles: Vec<Triangle>) -> Result<Self, WorldError> {
        Ok(Self::over(name, triangles)?.0)
    }

    /// The same; and of each of its surfaces, which of the triangles it was.
    fn over(name: &str, triangles: Vec<Triangle>) -> Result<(Self, Vec<u32>), WorldError> {
        if triangles.is_empty() {
            return Err(WorldError::Empty { name: name.into(), degenerate: 0, notices: Vec::new() });
        }
        let extents = bounds_of(triangles.iter().flat_map(|t| &t.0));
        // The smallest and the largest pass over what is not a number.
        let numbers = triangles.iter().flat_map(|t| &t.0).all(|p| p.iter().all(|c| c.is_finite()));
        if !numbers || !extents.dim().norm_squared().is_finite() {
            return Err(WorldError::TooLarge { name: name.into(), extents });
        }
        let reading = Reading { polygons: triangles.len(), ..Reading::default() };
        let (surfaces, order) = Bvh::with_order(triangles);
        let (rims, openness, regions) = Default::default();
        let world =
            Self { extents, surfaces, bounding: None, has_open_shells: false, regions, reading, rims, openness };
        Ok((world, order))
    }

    /// Turns faces over that look the wrong way. `copies` says of each how often it is in the file.
    fn mend(&mut self, name: &str, copies: &[u32]) -> Result<(), WorldError> {
        let mut topology = Topology::of(self.surfaces.triangles(), &self.extents);
        let partitions = partitions(&topology, copies);
        let parting = self.taken_down(&topology, &partitions);
        if !parting.is_empty() {
            topology = Topology::of(self.surfaces.triangles(), &self.extents);
        }
        let mended = winding::mend(&mut self.surfaces, &topology, &self.extents);
        let (winding, is_sheet) = mended.map_err(|winding::Undecided { edge }| WorldError::Winding {
            name: name.into(),
            edge,
            digits: self.digits(),
        })?;
        let bounds_openly = |shell: &Shell| !shell.closed && shell.triangles.iter().any(|&i| !is_sheet[i]);
        let has_open_shells = !winding.solids && topology.shells.iter().any(bounds_openly);
        self.rims = OnceLock::from(first_rims(topology));
        self.reading.winding = winding;
        if winding.sheets > 0 {
            let all = self.surfaces.triangles().iter().zip(&is_sheet);
            let bounding: Vec<Triangle> =
                all.filter(|(_, is_sheet)| !**is_sheet).map(|(triangle, _)| *triangle).collect();
            self.bounding = (!bounding.is_empty()).then(|| Bvh::new(bounding));
        }
        if winding.turned == 0 && !self.has_room() {
            self.try_turned_over();
        }
        if !parting.is_empty() {
            self.put_up(parting, partitions.len());
        }
        self.has_open_shells = has_open_shells;
        Ok(())
    }

    /// Takes shells out of the surfaces; their triangles.
    fn taken_down(&mut self, topology: &Topology, shells: &[usize]) -> Vec<Triangle> {
        if shells.is_empty() {
            return Vec::new();
        }
        let all = self.surfaces.triangles();
        let mut is_taken = vec![false; all.len()];
        shells.iter().flat_map(|&shell| &topology.shells[shell].triangles).for_each(|&i| is_taken[i] = true);
        let some = |taken: bool| all.iter().zip(&is_taken).filter(move |(_, is)| **is == taken).map(|(one, _)| *one);
        let (taken, left): (Vec<Triangle>, Vec<Triangle>) = (some(true).collect(), some(false).collect());
        self.surfaces = Bvh::new(left);
        taken
    }

    /// Puts partitions, so many shells, back between the surfaces that something is in.
    fn put_up(&mut self, partitions: Vec<Triangle>, shells: usize) {
        let all = [self.surfaces.triangles(), &partitions].concat();
        let surfaces = std::mem::replace(&mut self.surfaces, Bvh::new(all));
        self.bounding.get_or_insert(surfaces);
        // They name triangles by their place.
        self.rims = OnceLock::new();
        self.reading.partitions = shells;
        self.reading.winding.shells += shells;
        self.reading.winding.sheets += shells;
    }

    /// Turns everything over if that makes free what was not: open ground says nothing by parity.
    fn try_turned_over(&mut self) {
        let count = self.surfaces.triangles().len();
        (0..count).for_each(|i| self.surfaces.turn(i));
        if self.bounding.is_none() && self.has_room() {
            let Winding { turned, turned_faces, inside_out, shells, .. } = &mut self.reading.winding;
            (*turned, *turned_faces, *inside_out) = (*shells, count, true);
        } else {
            (0..count).for_each(|i| self.surfaces.turn(i));
        }
    }

    /// Whether any of many places is free.
    fn has_room(&self) -> bool {
        const PLACES: usize = 2000;
        let mut random = Random::new(0, 0);
        let Bounds { min, max } = self.extents;
        (0..PLACES).any(|_| self.is_free(Point3::from(std::array::from_fn(|i| random.between(min[i], max[i])))))
    }

    /// The smallest axis-aligned box around everything.
    pub fn extents(&self) -> Bounds {
        self.extents
    }

    /// Digits behind the point that lengths in it (m) are shown with.
    pub(crate) fn digits(&self) -> usize {
        units::digits(self.extents.dim().max())
    }

    /// All surfaces.
    pub fn surfaces(&self) -> &Bvh {
        &self.surfaces
    }

    /// Where surfaces end: the first [`MOST_RIMS`] of such edges.
    pub(crate) fn rims(&self) -> &[Rim] {
        self.rims.get_or_init(|| first_rims(Topology::of(self.surfaces.triangles(), &self.extents)))
    }

    /// What was noticed while it was read.
    pub fn reading(&self) -> &Reading {
        &self.reading
    }

    /// How far from `origin` (m, world) along `direction` the first surface is, in lengths of `direction`; `None` if
    /// there is none.
    pub fn cast(&self, origin: Point3<f64>, direction: Vector3<f64>) -> Option<f64> {
        self.surfaces.nearest(&Ray::new(origin, direction)).map(|(t, _)| t)
    }

    /// Whether `point` (m, world) is inside the shell and in no solid. Where surfaces are open and yet enclose something together,
    /// it is that which counts; else the winding number.
    pub fn is_free(&self, point: Point3<f64>) -> bool {
        if !self.extents.contains(point) {
            return false;
        }
        let enclosed = self.regions().and_then(|regions| regions.is_free(&self.surfaces, point));
        enclosed.unwrap_or_else(|| self.is_free_by_winding(point))
    }

    /// What open surfaces enclose together.
    fn regions(&self) -> Option<&Regions> {
        let regions = || Regions::of(&self.surfaces, &self.extents, |place| self.is_free_by_winding(place));
        self.has_open_shells.then(|| self.regions.get_or_init(regions).as_ref()).flatten()
    }

    /// Whether the winding number of `point` is negative, by a majority of directions, since a single ray may count an edge twice,
    /// or leave an open world. Where walls are solids and there is no shell, it is enough to be in no solid.
    fn is_free_by_winding(&self, point: Point3<f64>) -> bool {
        let outside = i32::from(self.reading.winding.solids);
        winding::majority(&PROBES, |&direction| self.winding(point, direction.into()) < outside)
    }

    /// Surfaces left minus surfaces entered on the way from `point` to infinity: −1 for the shell around it, +1 for
    /// each solid around it.
    fn winding(&self, point: Point3<f64>, direction: Vector3<f64>) -> i32 {
        let mut winding = 0;
        let bounding = self.bounding.as_ref().unwrap_or(&self.surfaces);
        bounding.hits(&Ray::new(point, direction), |hit| winding += if hit.front { -1 } else { 1 });
        winding
    }

    /// Whether a ball of `radius` (m) on its straight way between two points (m, world) touches any surface.
    pub fn touches(&self, from: Point3<f64>, to: Point3<f64>, radius: f64) -> bool {
        self.surfaces.touches(from, to, radius)
    }

    /// A free place drawn evenly from all that are farther than `clearance` (m) from every surface.
    ///
    /// # Errors
    /// None was found.
    pub fn draw_place(&self, clearance: f64, random: &mut Random) -> Result<Point3<f64>, WorldError> {
        self.free_places(clearance, random).next().ok_or(WorldError::NoFreePlace { clearance })
    }

    /// Such places, one after the other, among the first [`TRIES`] that are drawn.
    pub(crate) fn free_places(&self, clearance: f64, random: &mut Random) -> impl Iterator<Item = Point3<f64>> {
        let Bounds { min, max } = self.extents;
        (0..TRIES)
            .map(move |_| Point3::from(std::array::from_fn(|i| random.between(min[i], max[i]))))
            .filter(move |&p| !self.touches(p, p, clearance) && self.is_free(p))
    }
}

impl Reading {
    /// What whoever uses the world should know, a sentence each.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        let Winding { shells, turned, turned_faces, inside_out, .. } = self.winding;
        if inside_out {
            remarks.push(format!(
                "its faces looked away from the free side ({turned} of {shells} shells, {turned_faces} triangles); they were \
                 turned over"
            ));
        } else if turned > 0 {
            remarks.push(format!(
                "{turned_faces} triangles in {turned} of {shells} shells looked away from the free side; they were turned over"
            ));
        }
        if self.winding.solids {
            remarks.push(
                "its walls are solids, and there is no shell around them: all that is in none of them is free"
                    .to_owned(),
            );
        }
        remarks.extend(self.notices.iter().map(Notice::to_string));
        if self.doubled > 0 {
            remarks.push(format!(
                "{} faces lie exactly on others, as of walls that have two sides or that two rooms share: each is taken once",
                self.doubled
            ));
        }
        if self.partitions > 0 {
            remarks.push(format!(
                "{} of {shells} shells only part what others enclose, which is the same on both sides of them",
                self.partitions
            ));
        }
        remarks
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenery::{Scenery, Solid};

    /// Regression: a room whose walls were exported with both sides was misread without a word.
    #[test]
    fn faces_that_lie_on_others_are_noticed() {
        let once = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 0 0 2\nv 2 0 2\nv 2 2 2\nv 0 2 2\n\
                    f 1 2 3 4\nf 8 7 6 5\nf 5 6 2 1\nf 6 7 3 2\nf 7 8 4 3\nf 8 5 1 4\n";
        let remarks = |text: &str| {
            let world = World::from_bytes("room.obj", text.as_bytes(), &Placement::default()).unwrap();
            world.reading().remarks().join("; ")
        };
        assert!(!remarks(once).contains("lie exactly on others"));
        let twice = format!("{once}f 4 3 2 1\nf 5 6 7 8\n");
        assert!(remarks(&twice).contains("2 faces lie exactly on others"), "{}", remarks(&twice));
    }

    /// Regression: each of 64 places was looked for 100,000 times, where hardly anything of a world is free.
    #[test]
    fn places_in_a_world_that_is_hardly_free_are_looked_for_so_often_and_no_more() {
        let mut scenery = Scenery::within(Solid::block("room", [0.0; 3], [1.0; 3]));
        scenery.block("pole", [0.0, 0.0, 0.0], [1e-3, 1e-3, 1e4]);
        let world = World::from_triangles("pole", scenery.triangles_at(Vector3::zeros())).unwrap();
        let found = world.free_places(0.0, &mut Random::new(0, 1)).count();
        assert!((1..64).contains(&found), "{found}");
        assert_eq!(world.openness().places, found);
        let mut random = Random::new(0, 1);
        let first = world.draw_place(0.0, &mut random).unwrap();
        assert_eq!(world.free_places(0.0, &mut Random::new(0, 1)).next(), Some(first));
    }

    /// Regression: what hangs together was found out again each time that somebody asked where a world is open.
    #[test]
    fn where_surfaces_end_is_known_once_a_world_is_read() {
        let box_without_lid = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
                               f 1 2 3 4\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n";
        let world = World::from_bytes("box.obj", box_without_lid.as_bytes(), &Placement::default()).unwrap();
        assert_eq!(world.rims.get().map(Vec::len), Some(4));
        let again = World::from_triangles("box", world.surfaces.triangles().to_vec()).unwrap();
        let ends = |world: &World| world.rims().iter().map(|rim| rim.ends).collect::<Vec<_>>();
        assert_eq!(ends(&again), ends(&world));
    }
}
