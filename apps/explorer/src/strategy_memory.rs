//! What a strategy leaves to the next one of its name: a value of a type of its own, under a variable of its own.

use elk_bus::codec::{self, DecodeError, EncodeError};
use elk_bus::{Payload, Type, TypeRef, ValueRef};
use elk_spatial::keys::EXPLORER_MEMORY;

/// The longest memory that a strategy leaves (bytes).
pub const LONGEST: usize = 1 << 20;

/// A value of a strategy's own type, as it travels: whoever looks at it sees its fields, as those of any payload.
#[derive(Debug, Clone, PartialEq)]
pub struct StrategyMemory {
    type_: Type,
    bytes: Vec<u8>,
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
    /// The memory that this value is.
    ///
    /// # Errors
    /// It is too long, or cannot be written.
    pub fn of<T: Payload>(value: &T::View<'_>) -> Result<Self, LeaveError> {
        let mut bytes = Vec::new();
        codec::encode_onto(value, &mut bytes)?;
        match bytes.len() {
            0..=LONGEST => Ok(Self { type_: TypeRef::of::<T>().to_type(), bytes }),
            long => Err(LeaveError::TooLong(long)),
        }
    }

    /// The memory that somebody has left as a variable's value; `None`: a number or a text is none.
    pub(crate) fn left(value: ValueRef<'_>) -> Option<Self> {
        let ValueRef::Binary { type_, bytes } = value else { return None };
        Some(Self { type_: type_.to_type(), bytes: bytes.into() })
    }

    /// The value, as it travels.
    pub(crate) fn value(&self) -> ValueRef<'_> {
        ValueRef::Binary { type_: self.type_.as_ref(), bytes: &self.bytes }
    }

    /// The value. Of another version of the type it is read as this one, as far as fields with defaults are all that they
    /// differ in.
    ///
    /// # Errors
    /// It is of another type, or of another version, or breaks the type's own rules.
    pub fn take<T: Payload>(&self) -> Result<T::View<'_>, DecodeError> {
        let whose = || ["in the strategy that left it", "in this one"].map(str::to_owned);
        self.value().decode_as::<T>(EXPLORER_MEMORY.name(), whose)
    }
}

#[cfg(test)]
mod tests {
    use elk_bus::payload;

    use super::*;

    /// What a strategy of somebody's remembers.
    #[payload]
    #[derive(Debug, Clone, PartialEq)]
    struct Visits {
        /// How often it went left.
        left: u64,
    }

    /// The same in other builds.
    mod newer {
        /// What a strategy of somebody's remembers.
        #[elk_bus::payload]
        #[derive(Debug, Clone, PartialEq)]
        pub struct Visits {
            /// How often it went left.
            pub left: u64,
            /// How often it went right.
            #[describe(default)]
            pub right: u64,
        }
    }

    mod other {
        /// What a strategy of somebody's remembers.
        #[elk_bus::payload]
        #[derive(Debug, Clone, PartialEq)]
        pub struct Visits {
            /// How often it went right.
            pub right: u64,
        }
    }

    /// As long as there are bytes.
    #[payload]
    struct Long {
        /// These.
        #[describe(any)]
        bytes: Vec<u8>,
    }

    #[test]
    fn a_memory_comes_back_to_who_knows_its_type_in_whatever_version() {
        let memory = StrategyMemory::of::<Visits>(&Visits { left: 7 }).unwrap();
        assert_eq!(memory.take::<Visits>().unwrap(), Visits { left: 7 });
        assert_eq!(memory.take::<newer::Visits>().unwrap(), newer::Visits { left: 7, right: 0 });
        assert_eq!(memory.value().to_json(10).unwrap().to_string(), r#"{"left":7}"#);
        let refused = memory.take::<other::Visits>().unwrap_err().to_string();
        assert!(refused.contains("Visits") && refused.contains("left"), "{refused}");
        assert!(memory.take::<Long>().is_err());
        assert_eq!(StrategyMemory::left(memory.value()), Some(memory));
        assert_eq!(StrategyMemory::left(ValueRef::Double(1.0)), None);
        let long = StrategyMemory::of::<Long>(&Long { bytes: vec![0; LONGEST] });
        assert!(matches!(long, Err(LeaveError::TooLong(_))));
    }
}
