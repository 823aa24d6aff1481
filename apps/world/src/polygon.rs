//! Polygons into triangles: concave ones, and ones with holes that bridges lead to, in any plane.

use earcut::Earcut;
use nalgebra::{Point2, Point3, Vector3};

use crate::triangle::Triangle;

/// What became of a polygon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cut {
    /// Its triangles cover it, and nothing else.
    Whole,
    /// It has no area, and gave no triangles.
    Nothing,
    /// Its outline crosses itself, so that what is inside is a matter of opinion; the triangles are a guess.
    Crossed,
}

/// Less height than this share of its length, and a polygon has no area.
const FLAT: f64 = 1e-12;
/// The triangles' area differs by more than this share from the polygon's where its outline crosses itself.
const DEVIATION: f64 = 1e-6;

/// Hands the triangles of a polygon to `each`, all of them turned as it is. A convex polygon is cut into the fan around
/// its first corner; any other by ears, after it was projected along the axis that its normal is nearest to, which
/// keeps coordinates as they are. Corners that lie off the polygon's plane stay where they are.
pub fn triangulate(corners: &[Point3<f64>], mut each: impl FnMut(Triangle)) -> Cut {
    let outline = without_repetition(corners);
    let normal = normal(&outline);
    let length: f64 = (0..outline.len()).map(|i| (outline[(i + 1) % outline.len()] - outline[i]).norm()).sum();
    if normal.norm() <= FLAT * length * length {
        return Cut::Nothing;
    }
    let flat = projected(&outline, &normal);
    if is_convex(&flat) {
        let fan = (1..flat.len() - 1).map(|i| [0, i, i + 1]);
        fan.filter(|&t| area(&flat, t) > 0.0).for_each(|t| each(Triangle(t.map(|i| outline[i]))));
        return Cut::Whole;
    }
    let mut covered = 0.0;
    for [a, b, c] in ears(&flat) {
        let area = area(&flat, [a, b, c]);
        covered += area.abs();
        let turned = if area > 0.0 { [a, b, c] } else { [a, c, b] };
        if area != 0.0 {
            each(Triangle(turned.map(|i| outline[i])));
        }
    }
    let own = signed_area(&flat);
    match (covered - own).abs() <= DEVIATION * own {
        true => Cut::Whole,
        false => Cut::Crossed,
    }
}

/// The corners without those that repeat the one before.
fn without_repetition(corners: &[Point3<f64>]) -> Vec<Point3<f64>> {
    let mut outline = corners.to_vec();
    outline.dedup();
    while outline.len() > 1 && outline.first() == outline.last() {
        outline.pop();
    }
    outline
}

/// Twice the area along the normal (Newell's method), taken from the first corner so that far coordinates lose nothing.
fn normal(outline: &[Point3<f64>]) -> Vector3<f64> {
    let spokes = outline.windows(2).map(|pair| (pair[0] - outline[0]).cross(&(pair[1] - outline[0])));
    spokes.fold(Vector3::zeros(), |sum, one| sum + one)
}

/// The outline without the axis that the normal is nearest to, anticlockwise, from the first corner.
fn projected(outline: &[Point3<f64>], normal: &Vector3<f64>) -> Vec<Point2<f64>> {
    let axis = normal.iamax();
    let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        std::mem::swap(&mut u, &mut v);
    }
    outline.iter().map(|corner| corner - outline[0]).map(|d| Point2::new(d[u], d[v])).collect()
}

/// Twice the area of a triangle; negative if it is clockwise.
fn area(flat: &[Point2<f64>], [a, b, c]: [usize; 3]) -> f64 {
    (flat[b] - flat[a]).perp(&(flat[c] - flat[a]))
}

/// Twice the area of the outline.
fn signed_area(flat: &[Point2<f64>]) -> f64 {
    (1..flat.len() - 1).map(|i| area(flat, [0, i, i + 1])).sum()
}

/// Whether it turns left at every corner, if at all, and goes round once.
fn is_convex(flat: &[Point2<f64>]) -> bool {
    let n = flat.len();
    let turns_left = |i: usize| area(flat, [i, (i + 1) % n, (i + 2) % n]) >= 0.0;
    (0..n).all(turns_left) && (1..n - 1).all(|i| area(flat, [0, i, i + 1]) >= 0.0)
}

fn ears(flat: &[Point2<f64>]) -> Vec<[usize; 3]> {
    let mut indices: Vec<usize> = Vec::new();
    Earcut::new().earcut(flat.iter().map(|p| [p.x, p.y]), &[], &mut indices);
    indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn cut(corners: &[Point3<f64>]) -> (Cut, Vec<Triangle>) {
        let mut triangles = Vec::new();
        let cut = triangulate(corners, |triangle| triangles.push(triangle));
        (cut, triangles)
    }

    fn flat(corners: &[[f64; 2]]) -> Vec<Point3<f64>> {
        corners.iter().map(|&[x, y]| Point3::new(x, y, 0.0)).collect()
    }

    fn area_of(triangles: &[Triangle]) -> f64 {
        let twice = |Triangle([a, b, c]): &Triangle| (b - a).cross(&(c - a)).norm();
        triangles.iter().map(twice).sum::<f64>() / 2.0
    }

    #[test]
    fn a_doorway_stays_open_and_a_window_too() {
        let wall = flat(&[[0., 0.], [1., 0.], [1., 1.5], [2., 1.5], [2., 0.], [3., 0.], [3., 2.], [0., 2.]]);
        let (how, triangles) = cut(&wall);
        assert_eq!((how, area_of(&triangles)), (Cut::Whole, 4.5));
        // Around the outside, over a bridge to the window, clockwise around it, and back.
        let window =
            flat(&[[0., 0.], [3., 0.], [3., 3.], [0., 3.], [0., 0.], [1., 1.], [1., 2.], [2., 2.], [2., 1.], [1., 1.]]);
        let (how, triangles) = cut(&window);
        assert_eq!((how, area_of(&triangles)), (Cut::Whole, 8.0));
        let seen = |x: f64, y: f64| {
            let ray = crate::ray::Ray::new(Point3::new(x, y, 1.0), -Vector3::z());
            triangles.iter().any(|t| ray.hit(t).is_some())
        };
        assert!(!seen(1.5, 1.5) && seen(0.5, 1.5) && seen(2.5, 0.7));
    }

    #[test]
    fn convex_polygons_are_fans_and_lines_are_nothing() {
        let square = flat(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
        let fan = [[0, 1, 2], [0, 2, 3]].map(|t| Triangle(t.map(|i| square[i])));
        assert_eq!(cut(&square), (Cut::Whole, fan.to_vec()));
        let with_repetition = [&square[..1], &square, &square[..1]].concat();
        assert_eq!(cut(&with_repetition).1, fan);
        for line in [&[[0., 0.], [1., 0.], [2., 0.], [0.5, 0.]][..], &[[0., 0.]], &[], &[[0., 0.], [1., 1.]]] {
            assert_eq!(cut(&flat(line)), (Cut::Nothing, vec![]));
        }
        let bow = flat(&[[0., 0.], [2., 2.], [2., 0.], [0., 1.]]);
        assert_eq!(cut(&bow).0, Cut::Crossed);
        let star: Vec<_> = (0..5).map(|i| (f64::from(i) * 144.0).to_radians()).map(|a| [a.cos(), a.sin()]).collect();
        assert_eq!(cut(&flat(&star)).0, Cut::Crossed, "it turns left everywhere and goes round twice");
    }

    /// A star around a middle, with a hole of the same shape that a bridge leads to, if wanted.
    fn outline(radii: &[f64], hole: bool) -> Vec<[f64; 2]> {
        let at = |i: usize, share: f64| {
            let angle = std::f64::consts::TAU * i as f64 / radii.len() as f64;
            [share * radii[i] * angle.cos(), share * radii[i] * angle.sin()]
        };
        let mut outline: Vec<_> = (0..radii.len()).map(|i| at(i, 1.0)).collect();
        if hole {
            outline.push(at(0, 1.0));
            outline.push(at(0, 0.4));
            outline.extend((0..radii.len()).rev().map(|i| at(i, 0.4)));
        }
        outline
    }

    fn inside(outline: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
        let crosses = |i: usize| {
            let ([ax, ay], [bx, by]) = (outline[i], outline[(i + 1) % outline.len()]);
            (ay > y) != (by > y) && x < (bx - ax) * (y - ay) / (by - ay) + ax
        };
        (0..outline.len()).filter(|&i| crosses(i)).count() % 2 == 1
    }

    proptest! {
        /// Whatever the shape and wherever it lies: the area is kept, no triangle is outside, all are turned alike.
        #[test]
        fn triangles_cover_the_polygon_and_nothing_else(
            radii in prop::collection::vec(0.2..3.0_f64, 3..40),
            hole in any::<bool>(),
            turn in prop::array::uniform3(-3.0..3.0_f64),
            shift in prop::array::uniform3(-1000.0..1000.0_f64),
        ) {
            let shape = outline(&radii, hole);
            let place = nalgebra::Isometry3::new(shift.into(), turn.into());
            let corners: Vec<_> = shape.iter().map(|&[x, y]| place * Point3::new(x, y, 0.0)).collect();
            let (how, triangles) = cut(&corners);
            let flat: Vec<_> = shape.iter().map(|&[x, y]| Point2::new(x, y)).collect();
            prop_assume!(signed_area(&flat) > 1e-3);
            prop_assert_eq!(how, Cut::Whole);
            prop_assert!((area_of(&triangles) - signed_area(&flat) / 2.0).abs() < 1e-6);
            for Triangle(t) in &triangles {
                let [a, b, c] = t.map(|p| place.inverse_transform_point(&p));
                let turned = (b - a).cross(&(c - a));
                prop_assert!(turned.z > -1e-9);
                if turned.z > 1e-6 {
                    let middle = (a.coords + b.coords + c.coords) / 3.0;
                    prop_assert!(inside(&shape, [middle.x, middle.y]));
                }
            }
        }
    }
}
