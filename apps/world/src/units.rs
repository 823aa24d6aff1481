//! In which unit a world was probably drawn, told by its size.

use nalgebra::Point3;
use serde::Serialize;

/// A unit that worlds are drawn in.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Unit {
    /// Its name.
    pub name: &'static str,
    /// How long it is (m): what `Scale` has to be.
    pub metres: f64,
}

const METRES: Unit = Unit { name: "metres", metres: 1.0 };
const CENTIMETRES: Unit = Unit { name: "centimetres", metres: 0.01 };
const MILLIMETRES: Unit = Unit { name: "millimetres", metres: 0.001 };
const KILOMETRES: Unit = Unit { name: "kilometres", metres: 1000.0 };

/// The unit that a world is probably in whose longest edge is so long in it; `None`: nothing fits. Worlds in metres are
/// from 5 cm to 300 m long; what is longer is taken for one in centimetres or millimetres, what is shorter for a site in
/// kilometres.
pub fn guess(longest: f64) -> Option<Unit> {
    match longest {
        0.000_5..0.05 => Some(KILOMETRES),
        0.05..300.0 => Some(METRES),
        300.0..2_500.0 => Some(CENTIMETRES),
        2_500.0..300_000.0 => Some(MILLIMETRES),
        _ => None,
    }
}

/// Digits behind the point that lengths (m) are rounded to and shown with in a world whose longest edge is so long (m):
/// three digits of it count, a centimetre in any case, and less than a micrometre in none.
pub fn digits(longest: f64) -> usize {
    (2.0 - longest.log10().floor()).clamp(2.0, 6.0) as usize
}

/// A length (m), rounded to so many digits behind the point; 0 has no sign.
pub(crate) fn rounded(length: f64, digits: usize) -> f64 {
    let grains = 10_f64.powi(digits as i32);
    (length * grains).round() / grains + 0.0
}

/// A point (m), for people.
pub(crate) fn shown(point: &Point3<f64>, digits: usize) -> String {
    let [x, y, z] = [point.x, point.y, point.z].map(|c| rounded(c, digits));
    format!("({x:.digits$}; {y:.digits$}; {z:.digits$})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_are_known_in_any_unit() {
        let said = |longest| guess(longest).map(|unit| unit.name);
        assert_eq!(said(7.0), Some("metres"));
        assert_eq!(said(400.0), Some("centimetres"));
        assert_eq!(said(7000.0), Some("millimetres"));
        assert_eq!(said(1e7), None);
        assert_eq!(said(0.0), None);
    }

    #[test]
    fn small_worlds_are_shown_with_more_digits() {
        assert_eq!([7000.0, 40.0, 7.0, 0.7, 0.007, 0.0].map(digits), [2, 2, 2, 3, 5, 6]);
        assert_eq!([2, 5].map(|digits| rounded(0.001_234_9, digits)), [0.0, 0.001_23]);
        assert_eq!(shown(&Point3::new(1.0, -0.5, -0.004), 2), "(1.00; -0.50; 0.00)");
    }
}
