//! What a variable's value is: a number, a text, or bytes of a named type.

use elk_describe::Describe;

use crate::codec::{self, DecodeError};
use crate::key::{Key, Payload};
use crate::types::{ShowError, Type, TypeRef};

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

    /// Decodes the value as what `key` carries.
    ///
    /// # Errors
    /// It is of another type, of another layout of the same type, or one that cannot be true ([`Describe::check`]).
    pub fn decode<T: Payload>(&self, key: &Key<T>) -> Result<T::View<'a>, DecodeError> {
        self.decode_as::<T>(key.name())
    }

    /// Decodes the value as a `T`; `key` is the variable whose value it is.
    pub(crate) fn decode_as<T: Payload>(&self, key: &str) -> Result<T::View<'a>, DecodeError> {
        let mismatch = |found: String| DecodeError::Type { key: key.into(), expected: T::NAME, found };
        match *self {
            ValueRef::Double(number) => Err(mismatch(format!("the number {number}"))),
            ValueRef::Text(_) => Err(mismatch("a text".into())),
            ValueRef::Binary { type_, .. } if type_.name() != T::NAME => Err(mismatch(type_.name().into())),
            ValueRef::Binary { type_, .. } if type_.layout() != T::LAYOUT => {
                Err(DecodeError::Layout { key: key.into(), type_name: T::NAME, difference: type_.difference::<T>() })
            }
            ValueRef::Binary { bytes, .. } => {
                let view: T::View<'a> = codec::decode(bytes, T::NAME)?;
                view.check().map_err(|invalid| DecodeError::Value { type_name: T::NAME, invalid })?;
                Ok(view)
            }
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
