//! How a file's coordinates become metres with z up.

use std::ops::RangeInclusive;
use std::str::FromStr;

use nalgebra::Point3;

/// An axis of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "they say all themselves")]
pub enum Axis {
    X,
    Y,
    Z,
    MinusX,
    MinusY,
    MinusZ,
}

/// How long a file's unit may be (m).
pub const SCALES: RangeInclusive<f64> = 1e-6..=1e6;

/// The words for an axis that points up: as a mission says them, the format's own first.
pub const UP: &[&str] = &["format", "x", "y", "z", "-x", "-y", "-z"];

impl FromStr for Axis {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "x" => Ok(Self::X),
            "y" => Ok(Self::Y),
            "z" => Ok(Self::Z),
            "-x" => Ok(Self::MinusX),
            "-y" => Ok(Self::MinusY),
            "-z" => Ok(Self::MinusZ),
            _ => Err(format!("{text:?} is no axis; right is one of x, y, z, -x, -y, -z")),
        }
    }
}

/// What is done to a file's coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Metres that the file's unit is long.
    pub scale: f64,
    /// The file's axis that points up; `None`: the format's.
    pub up: Option<Axis>,
}

impl Default for Placement {
    /// Metres, up as the format says.
    fn default() -> Self {
        Self { scale: 1.0, up: None }
    }
}

impl Placement {
    /// As a mission says it: `scale` in metres a unit, `up` one of [`UP`].
    ///
    /// # Errors
    /// `up` is another word.
    pub fn new(scale: f64, up: &str) -> Result<Self, String> {
        let up = if up == UP[0] { None } else { Some(up.parse()?) };
        Ok(Self { scale, up })
    }

    /// Where a point of a file is in the world (m, z up). All are turned, none is mirrored, so anticlockwise stays so.
    pub(crate) fn place(&self, point: Point3<f64>, formats_up: Axis) -> Point3<f64> {
        let [x, y, z] = [point.x, point.y, point.z];
        let upright = match self.up.unwrap_or(formats_up) {
            Axis::X => [y, z, x],
            Axis::Y => [x, -z, y],
            Axis::Z => [x, y, z],
            Axis::MinusX => [z, y, -x],
            Axis::MinusY => [x, z, -y],
            Axis::MinusZ => [x, -y, -z],
        };
        Point3::from(upright) * self.scale
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;

    #[test]
    fn what_points_up_does_so_and_nothing_is_mirrored() {
        let axes = [("x", Vector3::x()), ("y", Vector3::y()), ("z", Vector3::z())];
        for (word, axis) in
            axes.into_iter().flat_map(|(word, axis)| [(word.to_owned(), axis), (format!("-{word}"), -axis)])
        {
            let placement = Placement::new(2.0, &word).unwrap();
            let placed = |v: Vector3<f64>| placement.place(v.into(), Axis::Z).coords;
            assert_eq!(placed(axis), Vector3::z() * 2.0, "{word}");
            let turned = Matrix3::from_columns(&[placed(Vector3::x()), placed(Vector3::y()), placed(Vector3::z())]);
            assert_eq!(turned.determinant(), 8.0, "{word}");
        }
        assert_eq!(Placement::new(1.0, "format"), Ok(Placement::default()));
        assert!(Placement::new(1.0, "up").is_err());
    }
}
