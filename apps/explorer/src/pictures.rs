//! What strategies show of what they weigh, as drawings: made only if somebody looks ([`Journal::draw`](crate::Journal::draw)).

use elk_bus::drawing::drawing::rgb;
use elk_bus::drawing::{Colour, Drawing, Primitive};
use elk_field::{Cell, Domain};
use elk_geometry::Voxel;
use elk_geometry::bricks::{BRICK, brick_of};
use nalgebra::Point3;

use crate::strategy::{Route, View};

/// Goals, and corners of streamlines, that are drawn at most.
const MOST_GOALS: usize = 4_096;
const MOST_CORNERS: usize = 20_000;
/// Pixels of a slice's side at most: of a longer one every second voxel is shown, or every third, and so on.
const MOST_PIXELS: i32 = 384;
/// How well one sees through a slice (0 to 255).
const SLICE_OPACITY: u8 = 170;

const GOAL: Colour = rgb(96, 165, 250);
const CHOSEN: Colour = rgb(251, 113, 133);
const LINE: Colour = rgb(253, 224, 71);
/// Colours of ψ from 0 (goals) to 1 (robot).
const RAMP: [[f32; 3]; 4] = [[68.0, 1.0, 84.0], [49.0, 104.0, 142.0], [53.0, 183.0, 121.0], [253.0, 231.0, 37.0]];

/// A place (m) as drawings have it.
pub(crate) fn place(point: &Point3<f64>) -> [f32; 3] {
    [point.x as f32, point.y as f32, point.z as f32]
}

/// The goals that were weighed, and the way that was found to one of them.
pub(crate) fn search(view: &View<'_>, route: Option<&Route>) -> Drawing {
    let goals = view.goals.iter().take(MOST_GOALS).map(|goal| place(&goal.position));
    let drawing = Drawing::new("search").points(goals, GOAL);
    let Some(route) = route else { return drawing };
    let chosen =
        Primitive::Points { at: vec![place(&view.space.center(route.goal))], colours: CHOSEN.into(), size_px: 9.0 };
    drawing.line_strip(route.points.iter().map(place), CHOSEN).with(chosen)
}

/// The tour over places (m), from the first of them on.
pub(crate) fn tour(places: impl IntoIterator<Item = Point3<f64>>) -> Drawing {
    let places: Vec<[f32; 3]> = places.into_iter().map(|point| place(&point)).collect();
    Drawing::new("tour").line_strip(places.iter().copied(), LINE).points(places.iter().skip(1).copied(), CHOSEN)
}

/// The edges of a tree of ways (m), and the places of the branch that is gone.
pub(crate) fn tree(edges: &[[Point3<f64>; 2]], branch: &[Point3<f64>]) -> Drawing {
    let drawing = Drawing::new("tree").lines(edges.iter().flatten().map(place), GOAL);
    match branch.len() {
        0 | 1 => drawing,
        _ => drawing.line_strip(branch.iter().map(place), CHOSEN),
    }
}

/// Streamlines (m), with corners `spacing` (m) apart at least: they are followed in steps that nobody sees. Of very many corners
/// the first ones are drawn.
pub(crate) fn streamlines(lines: &[Vec<Point3<f64>>], spacing: f64) -> Drawing {
    let mut room = MOST_CORNERS;
    let mut drawing = Drawing::new("streamlines");
    for line in lines {
        let mut corners = spaced(line, spacing);
        corners.truncate(room);
        room -= corners.len();
        if corners.len() > 1 {
            drawing = drawing.line_strip(corners, LINE);
        }
    }
    drawing
}

/// The first corner of a line, those that are `spacing` (m) from the one before at least, and the last.
fn spaced(line: &[Point3<f64>], spacing: f64) -> Vec<[f32; 3]> {
    let mut taken: Vec<&Point3<f64>> = Vec::new();
    for (i, corner) in line.iter().enumerate() {
        let is_end = i + 1 == line.len();
        if is_end || taken.last().is_none_or(|before| (corner - **before).norm() >= spacing) {
            taken.push(corner);
        }
    }
    taken.into_iter().map(place).collect()
}

/// ψ in the layer of voxels at the height of `at` (m, world), as an image with a pixel a voxel.
pub(crate) fn slice(domain: &Domain, at: Point3<f64>, resolution: f64) -> Drawing {
    let drawing = Drawing::new("field");
    let layer = Voxel::containing(at, resolution);
    let height = brick_of(layer).z;
    let blocks = || domain.blocks().filter(|block| block.z == height);
    let Some(first) = blocks().next() else { return drawing };
    let (low, high) = blocks().fold((first, first), |(low, high), block| {
        (
            Voxel::new(low.x.min(block.x), low.y.min(block.y), height),
            Voxel::new(high.x.max(block.x), high.y.max(block.y), height),
        )
    });
    let side = BRICK;
    let (columns, rows) = (side * (high.x - low.x + 1), side * (high.y - low.y + 1));
    let step = (columns.max(rows) + MOST_PIXELS - 1) / MOST_PIXELS;
    let sampled = |count: i32| (0..count).step_by(step as usize);
    let (left, front) = (side * low.x, side * low.y);
    let pixels: Vec<Colour> = sampled(rows)
        .flat_map(|y| sampled(columns).map(move |x| (x, y)))
        .map(|(x, y)| {
            let voxel = Voxel::new(left + x, front + y, layer.z);
            match domain.cell(voxel) {
                Cell::Outside => [0; 4],
                Cell::Inside | Cell::Sink | Cell::Source => of_psi(domain.psi(voxel)),
            }
        })
        .collect();
    let metres = |voxels: i32| (f64::from(voxels) * resolution) as f32;
    let (across, up) = (sampled(columns).count() as i32, sampled(rows).count() as i32);
    drawing.with(Primitive::Image {
        corner: [metres(left), metres(front), at.z as f32],
        along: [metres(across * step), 0.0, 0.0],
        across: [0.0, metres(up * step), 0.0],
        columns: across as u32,
        pixels,
    })
}

/// ψ falls by orders of magnitude from the robot to the goals: its fourth root has contours everywhere.
fn of_psi(psi: f32) -> Colour {
    let share = psi.clamp(0.0, 1.0).sqrt().sqrt() * (RAMP.len() - 1) as f32;
    let low = (share as usize).min(RAMP.len() - 2);
    let mix = |channel: usize| {
        let (from, to) = (RAMP[low][channel], RAMP[low + 1][channel]);
        (from + (to - from) * (share - low as f32)) as u8
    };
    [mix(0), mix(1), mix(2), SLICE_OPACITY]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slice_has_a_pixel_a_voxel_where_the_field_is() {
        let mut domain = Domain::new();
        for x in 0..20 {
            domain.set(Voxel::new(x, 3, 5), if x == 0 { Cell::Source } else { Cell::Inside });
        }
        domain.set(Voxel::new(20, 3, 5), Cell::Sink);
        domain.solve(1e-6, || false);
        let drawing = slice(&domain, Point3::new(0.05, 0.35, 0.55), 0.1);
        drawing.checked().unwrap();
        let [Primitive::Image { corner, along, columns, pixels, .. }] = drawing.primitives.as_slice() else {
            panic!("{drawing:?}")
        };
        assert_eq!((*columns, pixels.len(), *corner), (24, 24 * 8, [0.0, 0.0, 0.55]));
        assert!((along[0] - 2.4).abs() < 1e-6);
        let row = &pixels[3 * 24..4 * 24];
        let drawn = pixels.iter().filter(|pixel| pixel[3] > 0).count();
        assert_eq!((drawn, row.iter().filter(|pixel| pixel[3] > 0).count()), (21, 21));
        // Bright at the robot, dark at the goal.
        assert_eq!((row[0], row[20]), ([253, 231, 37, SLICE_OPACITY], [68, 1, 84, SLICE_OPACITY]));
        assert!(row[..21].is_sorted_by(|one, next| one[1] >= next[1]), "{row:?}");
        // In another layer there is nothing.
        assert!(slice(&domain, Point3::new(0.05, 0.35, 3.0), 0.1).primitives.is_empty());
    }

    #[test]
    fn very_many_corners_are_cut() {
        let line: Vec<Point3<f64>> = (0..15_000).map(|i| Point3::new(f64::from(i), 0.0, 0.0)).collect();
        let drawing = streamlines(&[line.clone(), line.clone(), line.clone()], 0.1);
        let corners: Vec<usize> = drawing.primitives.iter().map(|one| one.size().0).collect();
        assert_eq!(corners, [15_000, 5_000]);
        drawing.checked().unwrap();
        // Of those that lie close some do, and the last one.
        let [Primitive::Lines { at, .. }] = &streamlines(&[line[..12].to_vec()], 5.0).primitives[..] else { panic!() };
        assert_eq!(at.iter().map(|place| place[0]).collect::<Vec<_>>(), [0.0, 5.0, 10.0, 11.0]);
    }
}
