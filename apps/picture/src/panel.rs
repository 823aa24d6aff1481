//! One view on the sheet: the world behind a cut, and the way through it.

use std::collections::BTreeMap;

use nalgebra::Point3;

use crate::canvas::{At, Canvas};
use crate::palette::{self, Rgb, mix};
use crate::scene::Scene;
use crate::view::{Frame, Sight};

/// Length of the stroke that shows where a scan looked (px).
const GLANCE_PX: f64 = 13.0;

/// How far anything is drawn beyond a view's edge (px).
const EDGE_PX: f64 = 20.0;

/// A view with its place on the sheet.
pub(crate) struct Panel {
    pub frame: Frame,
    /// The cutting plane, in cells along the frame's `away`.
    pub cut: i32,
    /// Edge of a voxel (m).
    pub resolution: f64,
    /// Pixels a metre.
    pub scale: f64,
    /// The upper left corner (px).
    pub corner: At,
}

impl Panel {
    /// Width and height (px).
    pub fn size(&self) -> (f64, f64) {
        let px = |cells: i32| (f64::from(cells) * self.resolution * self.scale).round();
        (px(self.frame.size[0]), px(self.frame.size[1]))
    }

    /// The lower edge (px).
    pub fn bottom(&self) -> f64 {
        self.corner.1 + self.size().1
    }

    /// Where coordinates along right and up (m) lie on the sheet.
    pub fn at(&self, right: f64, up: f64) -> At {
        let first = |i: usize| f64::from(self.frame.min[i]) * self.resolution;
        let (_, height) = self.size();
        (self.corner.0 + (right - first(0)) * self.scale, self.corner.1 + height - (up - first(1)) * self.scale)
    }

    /// Where a point of the world lies on the sheet; one that is far from what is shown, at its edge.
    pub fn project(&self, point: Point3<f64>) -> At {
        let (x, y) = self.at(self.frame.right.of(point), self.frame.up.of(point));
        let ((left, top), (width, height)) = (self.corner, self.size());
        (x.clamp(left - EDGE_PX, left + width + EDGE_PX), y.clamp(top - EDGE_PX, top + height + EDGE_PX))
    }

    /// The coordinate of the cutting plane along the frame's `away` (m).
    pub fn cut_m(&self) -> f64 {
        (f64::from(self.cut) + 0.5) * self.resolution
    }

    /// Draws map, frontiers, way and scans.
    pub fn draw(&self, canvas: &mut Canvas, scene: &Scene) {
        self.draw_cells(canvas, scene);
        self.draw_frontier(canvas, scene);
        self.draw_path(canvas, scene);
        self.draw_truth(canvas, scene);
        self.draw_scans(canvas, scene);
        self.draw_ends(canvas, scene);
    }

    fn cell(&self, right: i32, up: i32) -> (At, At) {
        let m = |cell: i32| f64::from(cell) * self.resolution;
        let (x0, y1) = self.at(m(right), m(up));
        let (x1, y0) = self.at(m(right + 1), m(up + 1));
        ((x0.round(), y0.round()), (x1.round(), y1.round()))
    }

    fn sight(&self, scene: &Scene, right: i32, up: i32) -> Sight {
        self.frame.look(&scene.grid, [right, up], self.cut)
    }

    fn draw_cells(&self, canvas: &mut Canvas, scene: &Scene) {
        let [right0, up0, _] = self.frame.min;
        for up in up0..up0 + self.frame.size[1] {
            for right in right0..right0 + self.frame.size[0] {
                let sight = self.sight(scene, right, up);
                let (upper, lower) = self.cell(right, up);
                canvas.rect(upper, lower, self.color(sight), 1.0);
                self.draw_edges(
                    canvas,
                    sight,
                    (upper, lower),
                    [self.sight(scene, right - 1, up), self.sight(scene, right, up + 1)],
                );
            }
        }
    }

    /// The farther, the paler: the farthest surface behind the plane is almost paper.
    fn color(&self, sight: Sight) -> Rgb {
        let deepest = f64::from(self.frame.min[2] + self.frame.size[2] - 1 - self.cut).max(1.0);
        match sight {
            Sight::Unknown => palette::UNKNOWN,
            Sight::Cut => palette::INK,
            Sight::Open => palette::PAPER,
            Sight::Surface(depth) => mix(palette::NEAR, palette::FAR, (f64::from(depth) / deepest).sqrt()),
        }
    }

    /// A thin line where the depth leaps: edges of tables, shelves and doors.
    fn draw_edges(&self, canvas: &mut Canvas, sight: Sight, (upper, lower): (At, At), [left, above]: [Sight; 2]) {
        let leaps = |other: Sight| match (sight, other) {
            (Sight::Surface(a), Sight::Surface(b)) => f64::from((a - b).abs()) * self.resolution > 0.15,
            _ => false,
        };
        if leaps(left) {
            canvas.rect(upper, (upper.0 + 1.0, lower.1), palette::SOFT_INK, 0.55);
        }
        if leaps(above) {
            canvas.rect(upper, (lower.0, upper.1 + 1.0), palette::SOFT_INK, 0.55);
        }
    }

    /// Frontier voxels that are seen: the more lie one behind the other, the redder. Hidden ones only tint.
    fn draw_frontier(&self, canvas: &mut Canvas, scene: &Scene) {
        let mut counts: BTreeMap<[i32; 2], u32> = BTreeMap::new();
        for voxel in &scene.frontier {
            let index = voxel.to_array();
            let [right, up, away] =
                [self.frame.right, self.frame.up, self.frame.away].map(|axis| axis.cell(index[axis.world]));
            if !self.frame.holds([right, up]) {
                continue;
            }
            *counts.entry([right, up]).or_default() += u32::from(self.shows(scene, [right, up, away]));
        }
        for ([right, up], seen) in counts {
            let alpha = if seen == 0 { 0.2 } else { (0.55 + 0.1 * f64::from(seen)).min(0.9) };
            let (upper, lower) = self.cell(right, up);
            canvas.rect(upper, lower, palette::FRONTIER, alpha);
        }
    }

    /// Whether the cell at these places along right, up and away is on the plane, or seen behind it.
    fn shows(&self, scene: &Scene, [right, up, away]: [i32; 3]) -> bool {
        let farthest = match self.sight(scene, right, up) {
            Sight::Unknown | Sight::Cut => return false,
            Sight::Open => i32::MAX,
            Sight::Surface(depth) => self.cut + depth,
        };
        (self.cut..farthest).contains(&away)
    }

    fn draw_path(&self, canvas: &mut Canvas, scene: &Scene) {
        let points: Vec<At> = scene.path.iter().map(|p| self.project(*p)).collect();
        canvas.line(&points, 7.0, palette::PAPER, 0.8);
        for (share, leg) in pieces(&scene.path) {
            let leg = leg.map(|p| self.project(p));
            canvas.line(&leg, 3.2, palette::progress(share), 1.0);
        }
    }

    fn draw_scans(&self, canvas: &mut Canvas, scene: &Scene) {
        let last = scene.scans.len().saturating_sub(1).max(1) as f64;
        for (i, pose) in scene.scans.iter().enumerate() {
            let color = palette::progress(i as f64 / last);
            let from = self.project(pose.position());
            let to = self.project(pose.position() + pose.forward() * (GLANCE_PX / self.scale));
            canvas.line(&[from, to], 1.6, color, 0.85);
            canvas.disc(from, 3.4, palette::PAPER);
            canvas.disc(from, 2.6, color);
        }
    }

    /// From scan to scan, in straight lines: where the way truly led.
    fn draw_truth(&self, canvas: &mut Canvas, scene: &Scene) {
        let points: Vec<At> = scene.truth.iter().map(|point| self.project(*point)).collect();
        canvas.line(&points, 1.2, palette::TRUTH, 0.9);
    }

    /// A ring where the way starts, a full disc where it ends.
    fn draw_ends(&self, canvas: &mut Canvas, scene: &Scene) {
        if let Some(start) = scene.path.first() {
            ring(canvas, self.project(*start), palette::progress(0.0), palette::PAPER);
        }
        if let Some(end) = scene.path.last() {
            ring(canvas, self.project(*end), palette::PAPER, palette::progress(1.0));
        }
    }
}

/// A mark of the way's start or end.
pub(crate) fn ring(canvas: &mut Canvas, at: At, outer: Rgb, inner: Rgb) {
    canvas.disc(at, 11.0, palette::PAPER);
    canvas.disc(at, 9.5, mix(outer, palette::INK, 0.15));
    canvas.disc(at, 6.5, inner);
}

/// The way in pieces short enough to each have one colour, with the share of the way at which each begins.
fn pieces(path: &[Point3<f64>]) -> Vec<(f64, [Point3<f64>; 2])> {
    const PIECE_M: f64 = 0.1;
    const MOST_PIECES: f64 = 1e5;
    let lengths: Vec<f64> = path.windows(2).map(|leg| nalgebra::distance(&leg[0], &leg[1])).collect();
    let whole = lengths.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let piece = PIECE_M.max(whole / MOST_PIECES);
    let mut travelled = 0.0;
    let mut pieces = Vec::new();
    for (leg, length) in path.windows(2).zip(lengths) {
        let count = (length / piece).ceil().max(1.0) as usize;
        let point = |i: usize| leg[0] + (leg[1] - leg[0]) * (i as f64 / count as f64);
        pieces.extend((0..count).map(|i| {
            let share = (travelled + length * i as f64 / count as f64) / whole;
            (share, [point(i), point(i + 1)])
        }));
        travelled += length;
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pieces_of_a_way_join_and_cover_it() {
        let path = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 3.0, 0.0]].map(Point3::from);
        let pieces = pieces(&path);
        assert!(pieces.windows(2).all(|w| (w[0].1[1] - w[1].1[0]).norm() < 1e-12 && w[0].0 <= w[1].0));
        assert_eq!((pieces[0].1[0], pieces[pieces.len() - 1].1[1]), (path[0], path[3]));
        assert!(pieces.iter().all(|(_, [a, b])| (b - a).norm() < 0.1 + 1e-9));
    }
}
