//! Ways in straight lines from point to point, measured along their length.

use nalgebra::{Point3, Vector3};

/// A way through at least one point (m).
#[derive(Debug, Clone, PartialEq)]
pub struct Polyline {
    points: Vec<Point3<f64>>,
    /// Length of way up to each point.
    lengths: Vec<f64>,
}

impl Polyline {
    /// The way through `points`; `None` if there are none. Points that repeat the one before are left out.
    pub fn new(points: impl IntoIterator<Item = Point3<f64>>) -> Option<Self> {
        let mut points = points.into_iter();
        let first = points.next()?;
        let mut way = Self { points: vec![first], lengths: vec![0.0] };
        for p in points {
            let step = (p - way.end()).norm();
            if step > 1e-9 {
                way.lengths.push(way.length() + step);
                way.points.push(p);
            }
        }
        Some(way)
    }

    /// The points.
    pub fn points(&self) -> &[Point3<f64>] {
        &self.points
    }

    /// The last point.
    pub fn end(&self) -> Point3<f64> {
        self.points[self.points.len() - 1]
    }

    /// Its length (m).
    pub fn length(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    /// The point after `s` (m) of way; an end for an `s` beyond it.
    pub fn at(&self, s: f64) -> Point3<f64> {
        let (i, rest) = self.locate(s);
        match self.direction(i) {
            Some(direction) => self.points[i] + direction * rest,
            None => self.points[i],
        }
    }

    /// Unit vector along the way after `s` (m) of it, at a bend the one that led there; `None` if it is a single point.
    pub fn heading(&self, s: f64) -> Option<Vector3<f64>> {
        let (i, rest) = self.locate(s);
        let i = if rest <= 1e-9 { i.saturating_sub(1) } else { i };
        self.direction(i).or_else(|| self.direction(i.checked_sub(1)?))
    }

    /// The bends after `from` and before `to` (m of way).
    pub fn bends(&self, from: f64, to: f64) -> Vec<Point3<f64>> {
        let inside = |l: f64| l > from + 1e-9 && l < to - 1e-9;
        let all = self.points.iter().zip(&self.lengths);
        all.filter(|(_, l)| inside(**l)).map(|(p, _)| *p).collect()
    }

    /// The part from `from` to `to` (m of way).
    pub fn part(&self, from: f64, to: f64) -> Vec<Point3<f64>> {
        let mut points = vec![self.at(from)];
        points.extend(self.bends(from, to));
        points.push(self.at(to));
        points
    }

    /// After how much of the way (m) it comes nearest to `point`; the first of equals.
    pub fn nearest(&self, point: Point3<f64>) -> f64 {
        let mut best = ((point - self.points[0]).norm(), 0.0);
        for (ends, start) in self.points.windows(2).zip(&self.lengths) {
            let along = ends[1] - ends[0];
            let length = along.norm();
            let s = (along.dot(&(point - ends[0])) / length).clamp(0.0, length);
            let distance = (point - (ends[0] + along / length * s)).norm();
            if distance < best.0 {
                best = (distance, start + s);
            }
        }
        best.1
    }

    /// Points along the way, `step` (m) apart, its first and its last point among them; each with its length of way.
    pub fn samples(&self, step: f64) -> impl Iterator<Item = (f64, Point3<f64>)> + '_ {
        let count = (self.length() / step).ceil().max(0.0) as usize;
        (0..=count).map(move |i| {
            let s = (i as f64 * step).min(self.length());
            (s, self.at(s))
        })
    }

    /// The segment that `s` lies on, by its first point, and how far along.
    fn locate(&self, s: f64) -> (usize, f64) {
        let s = s.clamp(0.0, self.length());
        let i = self.lengths.partition_point(|l| *l <= s).max(1) - 1;
        (i, s - self.lengths[i])
    }

    fn direction(&self, i: usize) -> Option<Vector3<f64>> {
        let next = self.points.get(i + 1)?;
        (next - self.points[i]).try_normalize(1e-12)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent() -> Polyline {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]];
        Polyline::new(points.map(Point3::from)).unwrap()
    }

    #[test]
    fn the_nearest_place_of_a_way_is_between_its_points_too() {
        let points = [[0.0; 3], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0]].map(Point3::from);
        let way = Polyline::new(points).unwrap();
        for (point, s) in
            [([-1.0, 0.0, 0.0], 0.0), ([0.5, 1.0, 0.0], 0.5), ([3.0, 1.5, 1.0], 3.5), ([2.0, 9.0, 0.0], 4.0)]
        {
            assert_eq!(way.nearest(point.into()), s, "{point:?}");
        }
        assert_eq!(way.nearest([1.0, 1.0, 0.0].into()), 1.0, "of two that are as near the first");
        assert_eq!(Polyline::new([Point3::origin()]).unwrap().nearest([1.0; 3].into()), 0.0);
    }

    #[test]
    fn a_way_is_measured_along_its_length() {
        let way = bent();
        assert_eq!((way.length(), way.points().len()), (3.0, 3));
        assert_eq!(way.at(0.5), Point3::new(0.5, 0.0, 0.0));
        assert_eq!(way.at(2.0), Point3::new(1.0, 1.0, 0.0));
        assert_eq!(way.at(9.0), way.end());
        assert_eq!(way.heading(0.0), Some(Vector3::x()));
        assert_eq!(way.heading(1.0), Some(Vector3::x()));
        assert_eq!(way.heading(1.5), Some(Vector3::y()));
        assert_eq!(way.heading(3.0), Some(Vector3::y()));
        assert_eq!(way.bends(0.5, 2.0), vec![Point3::new(1.0, 0.0, 0.0)]);
        assert_eq!(way.bends(1.0, 2.0), vec![]);
        assert_eq!(way.samples(2.0).map(|s| s.0).collect::<Vec<_>>(), vec![0.0, 2.0, 3.0]);
    }

    #[test]
    fn a_single_point_is_a_way_of_no_length() {
        let here = Polyline::new([Point3::new(1.0, 2.0, 3.0)]).unwrap();
        assert_eq!((here.length(), here.at(1.0)), (0.0, here.end()));
        assert_eq!(here.heading(0.0), None);
        assert_eq!(here.samples(0.1).count(), 1);
        assert!(Polyline::new([]).is_none());
    }
}
