//! What a variable's value is: a number, a text, or bytes of a named type.

use crate::codec::{self, DecodeError};
use crate::key::{Key, Payload};
use crate::types::{ConvertError, ShowError, Type, TypeRef};

/// A value as an app hands it to the bus.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A number.
    Double(f64),
    /// A text that people can read and poke.
    Text(String),
    /// A typed value in the bus' encoding.
    Binary {
        /// Its type.
        type_: Type,
        /// The encoded value.
        bytes: Vec<u8>,
    },
}

/// A value where it lies: in the received batch, or in the publisher's shared memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ValueRef<'a> {
    /// A number.
    Double(f64),
    /// A text.
    Text(&'a str),
    /// A typed value in the bus' encoding.
    Binary {
        /// Its type.
        type_: TypeRef<'a>,
        /// The encoded value.
        bytes: &'a [u8],
    },
}

impl<'a> ValueRef<'a> {
    /// How long the value is (bytes).
    pub fn byte_len(&self) -> usize {
        match self {
            ValueRef::Double(number) => size_of_val(number),
            ValueRef::Text(text) => text.len(),
            ValueRef::Binary { bytes, .. } => bytes.len(),
        }
    }

    /// Decodes the value as what `key` carries. Of another version of its type that differs in fields with defaults alone, it is
    /// read as well; nothing of it is borrowed then.
    ///
    /// # Errors
    /// It is of another type, of another layout of the same type, or one that cannot be true ([`elk_describe::Describe::check`]).
    pub fn decode<T: Payload>(&self, key: &Key<T>) -> Result<T::View<'a>, DecodeError> {
        self.decode_as::<T>(key.name(), || ["there".to_owned(), "here".to_owned()])
    }

    /// Decodes the value as a `T`; `key` is the variable whose value it is, `whose` the words for where the type is as its
    /// writer has it, and as it is here.
    ///
    /// # Errors
    /// As [`ValueRef::decode`].
    pub fn decode_as<T: Payload>(
        &self,
        key: &str,
        whose: impl FnOnce() -> [String; 2],
    ) -> Result<T::View<'a>, DecodeError> {
        let mismatch = |found: String| DecodeError::Type { key: key.into(), expected: T::NAME, found };
        match *self {
            ValueRef::Double(number) => Err(mismatch(format!("the number {number}"))),
            ValueRef::Text(_) => Err(mismatch("a text".into())),
            ValueRef::Binary { type_, .. } if type_.name() != T::NAME => Err(mismatch(type_.name().into())),
            ValueRef::Binary { type_, bytes } if type_.layout() != T::LAYOUT => {
                decode_version::<T>(key, type_, bytes, whose)
            }
            ValueRef::Binary { bytes, .. } => codec::decode::<T>(bytes),
        }
    }

    /// The same value, owned.
    pub fn to_value(self) -> Value {
        match self {
            ValueRef::Double(number) => Value::Double(number),
            ValueRef::Text(text) => Value::Text(text.into()),
            ValueRef::Binary { type_, bytes } => Value::Binary { type_: type_.to_type(), bytes: bytes.into() },
        }
    }

    /// The value as JSON; lists with more than `longest` entries are counted instead. JSON has no infinity and no NaN:
    /// they become `null`.
    ///
    /// # Errors
    /// It is of a type that nobody has described, or its bytes are no value of it.
    pub fn to_json(&self, longest: usize) -> Result<serde_json::Value, ShowError> {
        match *self {
            ValueRef::Double(number) => Ok(number.into()),
            ValueRef::Text(text) => Ok(text.into()),
            ValueRef::Binary { type_, bytes } => type_.to_json(bytes, longest),
        }
    }
}

/// Decodes a value that is of another version of its type than `T` is here.
#[cold]
fn decode_version<'a, T: Payload>(
    key: &str,
    type_: TypeRef<'_>,
    bytes: &[u8],
    whose: impl FnOnce() -> [String; 2],
) -> Result<T::View<'a>, DecodeError> {
    let converted = type_.convert::<T>(bytes, whose).map_err(|error| match error {
        ConvertError::Differs(difference) => DecodeError::Layout { key: key.into(), type_name: T::NAME, difference },
        ConvertError::Bytes(error) => DecodeError::Bytes { type_name: T::NAME, reason: error.reason },
    })?;
    codec::decode_to_keep::<T>(&converted)
}

impl Value {
    /// The value where it lies.
    pub fn as_ref(&self) -> ValueRef<'_> {
        match self {
            Value::Double(number) => ValueRef::Double(*number),
            Value::Text(text) => ValueRef::Text(text),
            Value::Binary { type_, bytes } => ValueRef::Binary { type_: type_.as_ref(), bytes },
        }
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Value::Double(number)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Value::Text(text.into())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Value::Text(text)
    }
}
