//! The log-odds of a brick's cells, exact, in a byte each where few different ones occur.
//!
//! Whatever scans do, log-odds go up and down by the same steps between the same bounds, so a map holds few different values: a
//! dozen with a mission's settings, a few hundred where steps and bounds have no common measure, as OctoMap's. A map numbers
//! the first 256 that occur; a brick that comes to hold another one keeps all of its in full from then on.

use elk_geometry::bricks::BRICK_CELLS;

/// Values that a byte can tell apart.
const MOST: usize = 256;
/// Places among which a value's number is found: so many that it seldom takes a second look.
const SLOTS: usize = 4 * MOST;
/// A place where there is no number.
const VACANT: u16 = u16::MAX;

/// The log-odds that have a number in a map.
#[derive(Debug, Clone)]
pub(crate) struct Codes {
    /// By number; 0 is that of log-odds 0.
    values: Vec<f32>,
    /// By hash, or behind it: numbers.
    slots: Box<[u16; SLOTS]>,
}

impl Default for Codes {
    fn default() -> Self {
        let mut codes = Self { values: Vec::new(), slots: Box::new([VACANT; SLOTS]) };
        codes.number(0.0);
        codes
    }
}

impl Codes {
    /// The number of a value, to the bit; a new one if it had none, `None` if all are given out.
    #[inline]
    fn number(&mut self, value: f32) -> Option<u8> {
        let bits = value.to_bits();
        let mut slot = (bits.wrapping_mul(0x9e37_79b9) >> 22) as usize;
        // Never more than a quarter of the slots is taken.
        while self.slots[slot] != VACANT {
            let number = self.slots[slot];
            if self.values[number as usize].to_bits() == bits {
                return Some(number as u8);
            }
            slot = (slot + 1) % SLOTS;
        }
        let number = self.values.len();
        if number == MOST {
            return None;
        }
        self.values.push(value);
        self.slots[slot] = number as u16;
        Some(number as u8)
    }

    fn value(&self, number: u8) -> f32 {
        self.values[number as usize]
    }
}

/// The log-odds of a brick's cells.
#[derive(Debug, Clone)]
pub(crate) enum LogOdds {
    /// The numbers of values that have one.
    Coded(Box<[u8; BRICK_CELLS]>),
    /// Values, one of which had none.
    Full(Box<[f32; BRICK_CELLS]>),
}

impl LogOdds {
    /// 0 in every cell.
    pub fn new() -> Self {
        Self::Coded(Box::new([0; BRICK_CELLS]))
    }

    #[inline]
    pub fn get(&self, cell: usize, codes: &Codes) -> f32 {
        match self {
            Self::Coded(numbers) => codes.value(numbers[cell]),
            Self::Full(values) => values[cell],
        }
    }

    #[inline]
    pub fn set(&mut self, cell: usize, value: f32, codes: &mut Codes) {
        match (&mut *self, codes.number(value)) {
            (Self::Coded(numbers), Some(number)) => numbers[cell] = number,
            (Self::Coded(numbers), None) => {
                let mut values = Box::new(numbers.map(|number| codes.value(number)));
                values[cell] = value;
                *self = Self::Full(values);
            }
            (Self::Full(values), _) => values[cell] = value,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// However many values there are, each is had again to the bit, in bricks that have full ones and in those that do not.
        #[test]
        fn what_is_put_in_comes_out(
            puts in prop::collection::vec((0..3usize, 0..BRICK_CELLS, -400..400i32), 0..1500),
        ) {
            let mut codes = Codes::default();
            let mut bricks = [(); 3].map(|()| LogOdds::new());
            let mut model = [[0.0f32; BRICK_CELLS]; 3];
            for (brick, cell, value) in puts {
                // Steps that have no binary fraction, and 0 of both signs.
                let value = if value == -1 { -0.0 } else { value as f32 * 0.1 };
                bricks[brick].set(cell, value, &mut codes);
                model[brick][cell] = value;
            }
            for (brick, model) in bricks.iter().zip(model) {
                prop_assert!((0..BRICK_CELLS).all(|cell| brick.get(cell, &codes).to_bits() == model[cell].to_bits()));
            }
        }
    }

    #[test]
    fn a_brick_with_a_value_that_has_no_number_keeps_all_in_full() {
        let (mut codes, mut few, mut many) = (Codes::default(), LogOdds::new(), LogOdds::new());
        for value in 1..256u16 {
            few.set(value as usize, f32::from(value), &mut codes);
        }
        many.set(0, 7.0, &mut codes);
        assert!(codes.values.len() == MOST && matches!((&few, &many), (LogOdds::Coded(_), LogOdds::Coded(_))));
        many.set(1, 0.5, &mut codes);
        assert!(matches!(many, LogOdds::Full(_)));
        assert_eq!([0, 1, 2].map(|cell| many.get(cell, &codes)), [7.0, 0.5, 0.0]);
    }
}
