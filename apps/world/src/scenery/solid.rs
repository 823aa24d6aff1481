//! Closed solids, and a world as a list of them.

use std::fmt::Write;

use nalgebra::{Point3, Vector3};

use crate::triangle::Triangle;

/// Every world is shifted by this (m), so that no wall lies on the faces of 0.1 m voxels.
pub(super) const OFF_LATTICE: Vector3<f64> = Vector3::new(0.037, 0.031, 0.023);

/// A closed surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    /// What it is, for whoever opens the file.
    pub name: String,
    /// Corners (m).
    pub vertices: Vec<Point3<f64>>,
    /// Triangles as indices of corners, anticlockwise as seen from the free side.
    pub faces: Vec<[usize; 3]>,
}

impl Solid {
    /// The polygon `profile` (convex, anticlockwise as seen from the tip of `axis`) drawn out from `low` to `high` along
    /// `axis` (0: x, 1: y, 2: z); the profile's coordinates belong to the two axes that follow it (y z, z x, x y).
    pub fn prism(name: &str, axis: usize, profile: &[[f64; 2]], low: f64, high: f64) -> Self {
        let n = profile.len();
        let corner = |[a, b]: [f64; 2], c: f64| {
            let mut p = Point3::origin();
            (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (c, a, b);
            p
        };
        let at = |c: f64| profile.iter().map(move |&p| corner(p, c));
        let caps = (1..n - 1).flat_map(|i| [[0, i + 1, i], [n, n + i, n + i + 1]]);
        let sides = (0..n).flat_map(|i| {
            let j = (i + 1) % n;
            [[i, j, n + j], [i, n + j, n + i]]
        });
        Self { name: name.into(), faces: caps.chain(sides).collect(), vertices: at(low).chain(at(high)).collect() }
    }

    /// The box between two corners.
    pub fn block(name: &str, low: [f64; 3], high: [f64; 3]) -> Self {
        let ([x0, y0, z0], [x1, y1, z1]) = (low, high);
        Self::prism(name, 2, &[[x0, y0], [x1, y0], [x1, y1], [x0, y1]], z0, z1)
    }

    /// A cylinder of `sides` flat sides along `axis`, from `low` to `high`, around `center` (on the two axes that follow),
    /// its sides at `radius`: for a number of sides that four divides it rests on a floor at that distance.
    pub fn cylinder(
        name: &str,
        axis: usize,
        center: [f64; 2],
        radius: f64,
        (low, high): (f64, f64),
        sides: u32,
    ) -> Self {
        let radius = radius / (std::f64::consts::PI / f64::from(sides)).cos();
        let corner = |i: u32| {
            // Half a step on, so that sides and not corners face along the axes.
            let angle = std::f64::consts::TAU * (f64::from(i) + 0.5) / f64::from(sides);
            [center[0] + radius * angle.cos(), center[1] + radius * angle.sin()]
        };
        let profile: Vec<_> = (0..sides).map(corner).collect();
        Self::prism(name, axis, &profile, low, high)
    }

    /// The same surface with its inside out: a shell to be in.
    pub fn inside_out(mut self) -> Self {
        for face in &mut self.faces {
            face.swap(1, 2);
        }
        self
    }
}

/// A world in the making.
#[derive(Debug, Clone, Default)]
pub struct Scenery {
    solids: Vec<Solid>,
}

impl Scenery {
    /// A world inside `shell`, which is given as a solid.
    pub fn within(shell: Solid) -> Self {
        Self { solids: vec![shell.inside_out()] }
    }

    /// The shell, and everything in it.
    pub fn solids(&self) -> &[Solid] {
        &self.solids
    }

    /// Adds a solid.
    pub fn add(&mut self, solid: Solid) {
        self.solids.push(solid);
    }

    /// Adds a box between two corners.
    pub fn block(&mut self, name: &str, low: [f64; 3], high: [f64; 3]) {
        self.add(Solid::block(name, low, high));
    }

    /// The surfaces as they stand in the file.
    pub fn triangles(&self) -> Vec<Triangle> {
        self.triangles_at(OFF_LATTICE)
    }

    /// The surfaces, shifted by `offset` (m).
    pub fn triangles_at(&self, offset: Vector3<f64>) -> Vec<Triangle> {
        let place = |solid: &Solid, face: &[usize; 3]| Triangle(face.map(|i| solid.vertices[i] + offset));
        let all = self.solids.iter().flat_map(|s| s.faces.iter().map(move |f| place(s, f)));
        all.collect()
    }

    /// The world as an OBJ file, to the millimetre; `made_by` is what made it.
    pub fn to_obj(&self, made_by: &str) -> String {
        let mut text = format!(
            "# Metres, z up; faces are anticlockwise as seen from the free side.\n\
             # Made by `{made_by}`: change it there.\n",
        );
        let mut first = 1;
        for solid in &self.solids {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "o {}", solid.name);
            for p in solid.vertices.iter().map(|v| v + OFF_LATTICE) {
                let _ = writeln!(text, "v {:.3} {:.3} {:.3}", p.x, p.y, p.z);
            }
            for [a, b, c] in &solid.faces {
                let _ = writeln!(text, "f {} {} {}", a + first, b + first, c + first);
            }
            first += solid.vertices.len();
        }
        text
    }
}
