//! The points of the map: where they are, what they look like, and where a pair shows them.

use elk_stereo::Rig;
use nalgebra::{Isometry3, Matrix2, Point3};

use crate::patch::{LEVELS, Patch};
use crate::pyramid::{Pyramid, from_level, to_level};
use crate::reprojection::{MARGIN, Observation, project};
use crate::row;

/// A point may be seen as much as 1 / 0.4 times as large as it was first; from nearer, what is kept of its look is too coarse.
const LEAST_SCALE: f64 = 0.4;
/// Pixels about a point by which is told how its look is turned.
const STEP: f64 = 5.0;

/// A point of the map.
#[derive(Clone, Debug)]
pub(crate) struct Landmark {
    /// Where it is, metres, world.
    pub position: Point3<f64>,
    /// How often in a row it should have been seen, and was not where the others were.
    pub failures: usize,
    /// The number of the keyframe that saw it first.
    pub keyframe: u64,
    look: Patch,
    /// The pair in which it was first seen: where that was taken, at which column and row of the left image, and how far ahead, metres.
    first: Isometry3<f64>,
    at: [f64; 2],
    depth: f64,
}

impl Landmark {
    /// The point that a pair at a pose sees somewhere in both images; none where both see it in the same direction.
    pub fn new(rig: &Rig, pose: &Isometry3<f64>, look: Patch, seen: Observation, keyframe: u64) -> Option<Self> {
        let [column, row] = seen.left;
        let point = rig.point(row, column, column - seen.right?)?;
        let (position, depth) = (pose * point, point.z);
        Some(Self { position, failures: 0, keyframe, look, first: *pose, at: seen.left, depth })
    }

    /// Moves it, and from where it was first seen.
    pub fn go(&mut self, by: &Isometry3<f64>) {
        self.position = by * self.position;
        self.first = by * self.first;
    }

    /// Steps in the image of a camera at a pose → steps in the one in which the point was first seen, as on a plane that faces that one.
    fn warp(&self, rig: &Rig, pose: &Isometry3<f64>) -> Option<Matrix2<f64>> {
        let disparity = rig.focal() * rig.baseline() / self.depth;
        let seen = |dx: f64, dy: f64| {
            let point = rig.point(self.at[1] + dy, self.at[0] + dx, disparity)?;
            Some(project(rig, pose, &(self.first * point))?.xy())
        };
        let here = seen(0.0, 0.0)?;
        let there = Matrix2::from_columns(&[seen(STEP, 0.0)? - here, seen(0.0, STEP)? - here]) / STEP;
        there.try_inverse().filter(|warp| warp.determinant() > LEAST_SCALE.powi(2))
    }

    /// Where a pair that is taken at about `pose` shows it. `None`: it is not in the view of the left camera, or much larger, smaller or farther
    /// turned than it was. `Some(None)`: it should be there.
    pub fn look_for(
        &self,
        rig: &Rig,
        pose: &Isometry3<f64>,
        [left, right]: [&Pyramid; 2],
        similarity: f32,
    ) -> Option<Option<Observation>> {
        let predicted = project(rig, pose, &self.position)?;
        let image = left.level(0);
        let is_inside = |x: f64, side: usize| x >= MARGIN && x <= side as f64 - 1.0 - MARGIN;
        if !is_inside(predicted.x, image.width()) || !is_inside(predicted.y, image.height()) {
            return None;
        }
        let warp = self.warp(rig, pose)?;
        let finest = self.look.template(0, &warp)?;
        let mut at: [f64; 2] = predicted.xy().into();
        for level in (1..LEVELS).rev() {
            let found =
                self.look.template(level, &warp).and_then(|window| window.find(left.level(level), to_level(at, level)));
            // A coarse level on which there is nothing to be found, or something else is, says nothing.
            if let Some(found) = found.filter(|found| found.similarity >= similarity) {
                at = from_level(found.at, level);
            }
        }
        let found = finest.find(image, at).filter(|found| found.similarity >= similarity);
        Some(found.map(|found| {
            let disparity = predicted.x - predicted.z;
            let right = row::refine(&self.look, &warp, right, found.at, found.at[0] - disparity, similarity);
            Observation { left: found.at, right }
        }))
    }
}
