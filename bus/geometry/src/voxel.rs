//! Integer cells of a cubic lattice over the world.

use elk_describe::{Describe, Invalid};
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

/// A cell of the lattice: along each axis it covers `[k·res, (k+1)·res)`, so its OctoMap key is `k + 32768`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, Describe)]
#[describe(check = check)]
pub struct Voxel {
    /// Index along world x.
    pub x: i32,
    /// Index along world y.
    pub y: i32,
    /// Index along world z.
    pub z: i32,
}

/// The six face neighbours' offsets, in the order −x +x −y +y −z +z.
pub const FACES: [Voxel; 6] = [
    Voxel::new(-1, 0, 0),
    Voxel::new(1, 0, 0),
    Voxel::new(0, -1, 0),
    Voxel::new(0, 1, 0),
    Voxel::new(0, 0, -1),
    Voxel::new(0, 0, 1),
];

/// Smallest and largest index that a map holds: OctoMap's 16 bits an axis.
pub const INDEX_RANGE: std::ops::RangeInclusive<i32> = -32768..=32767;

/// How far from the origin, along each axis and either way, a map of voxels of `resolution` (m) ends (m).
pub const fn reach_m(resolution: f64) -> f64 {
    (*INDEX_RANGE.end() + 1) as f64 * resolution
}

impl Voxel {
    /// The cell with these indices.
    #[inline]
    pub const fn new(x: i32, y: i32, z: i32) -> Self {
        Self { x, y, z }
    }

    /// The cell that holds `point` (m, world) on a lattice of `resolution` (m).
    #[inline]
    pub fn containing(point: Point3<f64>, resolution: f64) -> Self {
        let index = |c: f64| (c / resolution).floor() as i32;
        Self::new(index(point.x), index(point.y), index(point.z))
    }

    /// The cell's centre (m, world).
    #[inline]
    pub fn center(self, resolution: f64) -> Point3<f64> {
        let c = |k: i32| (f64::from(k) + 0.5) * resolution;
        Point3::new(c(self.x), c(self.y), c(self.z))
    }

    /// The six cells that share a face with this one.
    #[inline]
    pub fn face_neighbours(self) -> [Voxel; 6] {
        FACES.map(|d| self + d)
    }

    /// The 26 cells that share a face, an edge or a corner, in lexicographic order.
    #[inline]
    pub fn neighbours(self) -> impl Iterator<Item = Voxel> {
        (0..27).filter(|&i| i != 13).map(move |i| self + Voxel::new(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1))
    }

    /// Distance between the centres of two cells, in cells.
    #[inline]
    pub fn distance(self, other: Voxel) -> f64 {
        let d = self - other;
        Vector3::new(f64::from(d.x), f64::from(d.y), f64::from(d.z)).norm()
    }

    /// The smaller index of two cells along each axis.
    #[inline]
    pub fn inf(self, other: Self) -> Self {
        Self::new(self.x.min(other.x), self.y.min(other.y), self.z.min(other.z))
    }

    /// The larger index of two cells along each axis.
    #[inline]
    pub fn sup(self, other: Self) -> Self {
        Self::new(self.x.max(other.x), self.y.max(other.y), self.z.max(other.z))
    }

    /// Whether a map has a place for it: every index is in [`INDEX_RANGE`].
    pub fn is_mappable(self) -> bool {
        self.to_array().iter().all(|c| INDEX_RANGE.contains(c))
    }

    /// Sorts as voxels are numbered in a box: x fastest, z slowest.
    #[inline]
    pub fn raster(self) -> [i32; 3] {
        [self.z, self.y, self.x]
    }

    /// The indices as an array.
    #[inline]
    pub fn to_array(self) -> [i32; 3] {
        [self.x, self.y, self.z]
    }
}

/// Whether it is a voxel of a map, or one beside it.
fn check(voxel: &Voxel) -> Result<(), Invalid> {
    let range = INDEX_RANGE.start() - 1..=INDEX_RANGE.end() + 1;
    match voxel.to_array().into_iter().find(|c| !range.contains(c)) {
        None => Ok(()),
        Some(c) => Err(Invalid::new("", format!("a voxel with index {c}"), "within the 16 bits of a map")),
    }
}

impl From<[i32; 3]> for Voxel {
    fn from([x, y, z]: [i32; 3]) -> Self {
        Self { x, y, z }
    }
}

impl std::ops::Add for Voxel {
    type Output = Voxel;
    #[inline]
    fn add(self, d: Voxel) -> Voxel {
        Voxel::new(self.x + d.x, self.y + d.y, self.z + d.z)
    }
}

impl std::ops::Sub for Voxel {
    type Output = Voxel;
    #[inline]
    fn sub(self, d: Voxel) -> Voxel {
        Voxel::new(self.x - d.x, self.y - d.y, self.z - d.z)
    }
}

/// An axis-aligned box of the world (m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Smallest corner (m, world).
    pub min: Point3<f64>,
    /// Largest corner (m, world).
    pub max: Point3<f64>,
}

impl Bounds {
    /// The box of size `dim` around `mid` (both m), as a mission file's `Mid` and `Dim` give it.
    pub fn from_mid_dim(mid: Point3<f64>, dim: Vector3<f64>) -> Self {
        Self { min: mid - dim / 2.0, max: mid + dim / 2.0 }
    }

    /// Whether `point` (m, world) lies inside or on the box.
    pub fn contains(&self, point: Point3<f64>) -> bool {
        (0..3).all(|i| self.min[i] <= point[i] && point[i] <= self.max[i])
    }

    /// The box's centre (m, world).
    pub fn mid(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    /// The box's edge lengths (m).
    pub fn dim(&self) -> Vector3<f64> {
        self.max - self.min
    }
}
