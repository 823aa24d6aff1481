//! What an explorer's strategy leaves to the next one of its kind, whatever that is.

use elk_bus::codec::{self, DecodeError, EncodeError};
use elk_bus::describe::Shape;
use elk_bus::{Key, Payload, TypeRef, ValueRef, payload};

use crate::checks;

/// The longest memory that a strategy leaves (bytes).
pub const LONGEST: usize = 1 << 20;

/// Two digits a byte, the lower one first.
const DIGITS: Shape = Shape::Symbols(4, "0123456789abcdef", 0);

/// A value of a strategy's own type, as it lies in [`crate::messages::ExplorerMemory`]: nobody reads it but a strategy of the
/// same name that knows the same type.
#[payload]
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StrategyMemory {
    /// The strategy's name.
    #[describe(check = checks::text)]
    pub strategy: String,
    /// The type's name.
    #[describe(check = checks::text)]
    pub type_name: String,
    /// Its layout.
    pub layout: u64,
    /// The value, as it would travel.
    #[describe(shape = DIGITS, longest = LONGEST)]
    pub bytes: Vec<u8>,
}

/// Why a memory is not left.
#[derive(Debug, thiserror::Error)]
pub enum LeaveError {
    /// It cannot be written.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// It is too long for everybody who keeps it.
    #[error("{0} bytes of memory; right are at most {LONGEST}")]
    TooLong(usize),
}

impl StrategyMemory {
    /// The memory of the strategy of this name.
    ///
    /// # Errors
    /// It is too long, or cannot be written.
    pub fn of<T: Payload>(strategy: &str, value: &T::View<'_>) -> Result<Self, LeaveError> {
        let mut bytes = Vec::new();
        codec::encode_onto(value, &mut bytes)?;
        match bytes.len() {
            0..=LONGEST => {
                Ok(Self { strategy: strategy.to_owned(), type_name: T::NAME.to_owned(), layout: T::LAYOUT, bytes })
            }
            long => Err(LeaveError::TooLong(long)),
        }
    }

    /// The value.
    ///
    /// # Errors
    /// It is of another type, or of another build's, or breaks the type's own rules.
    pub fn take<T: Payload>(&self) -> Result<T::View<'_>, DecodeError> {
        let type_ = TypeRef::undescribed(&self.type_name, self.layout);
        ValueRef::Binary { type_, bytes: &self.bytes }.decode(&Key::<T>::named(self.strategy.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use elk_bus::Describe;

    use super::*;

    /// What a strategy of somebody's remembers.
    #[payload]
    #[derive(Debug, Clone, PartialEq)]
    struct Visits {
        /// How often it went left.
        left: u64,
    }

    /// The same in another build.
    mod newer {
        use super::super::*;

        /// What a strategy of somebody's remembers.
        #[payload]
        #[derive(Debug, Clone, PartialEq)]
        pub struct Visits {
            /// How often it went right.
            pub right: u64,
        }
    }

    #[test]
    fn a_memory_comes_back_to_who_knows_its_type_alone() {
        let memory = StrategyMemory::of::<Visits>("Lefty", &Visits { left: 7 }).unwrap();
        assert_eq!(memory.take::<Visits>().unwrap(), Visits { left: 7 });
        let refused = memory.take::<newer::Visits>().unwrap_err().to_string();
        assert!(refused.contains("Lefty") && refused.contains("Visits"), "{refused}");
        assert!(memory.take::<StrategyMemory>().is_err());
        memory.check().unwrap();
        let long = StrategyMemory::of::<StrategyMemory>("Lefty", &StrategyMemory { bytes: vec![0; LONGEST], ..memory });
        assert!(matches!(long, Err(LeaveError::TooLong(_))));
    }
}
