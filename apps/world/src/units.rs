//! In which unit a world was probably drawn, told by its size.

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

/// The unit that a world is probably in whose longest edge is so long in it; `None`: nothing fits. Rooms, houses and
/// sites are from half a metre to 300 m long; what is longer in metres is a room in centimetres or millimetres.
pub fn guess(longest: f64) -> Option<Unit> {
    match longest {
        0.000_5..0.05 => Some(KILOMETRES),
        0.05..300.0 => Some(METRES),
        300.0..2_500.0 => Some(CENTIMETRES),
        2_500.0..300_000.0 => Some(MILLIMETRES),
        _ => None,
    }
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
}
