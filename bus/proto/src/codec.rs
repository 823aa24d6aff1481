//! The bus' encoding of typed values: bincode, kept behind this module so that it can be exchanged.
//!
//! Fixed-width little-endian integers: a value's size does not depend on its numbers, and a reader can find its way in
//! a dump. Every decode is bounded by the bytes that are there.

use bincode::config::{Configuration, Fixint, Limit, LittleEndian};
use serde::{Deserialize, Serialize};

use elk_describe::{Describe, Invalid};

use crate::key::Payload;

/// The largest value that is decoded (bytes): a lid on what a corrupt length can make the decoder allocate.
pub const MAX_VALUE_BYTES: usize = 1 << 30;

const CONFIG: Configuration<LittleEndian, Fixint, Limit<MAX_VALUE_BYTES>> =
    bincode::config::standard().with_fixed_int_encoding().with_limit::<MAX_VALUE_BYTES>();

/// Why a value could not be decoded.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// The key carries another type than the reader expects.
    #[error("{key} carries {found}, but {expected} was expected: do writer and reader mean the same variable?")]
    Type {
        /// The variable.
        key: String,
        /// The reader's type.
        expected: &'static str,
        /// What came.
        found: String,
    },
    /// The type has the expected name but other fields.
    #[error("{key} carries another {type_name} than this reader's: {difference}; build both from one version")]
    Layout {
        /// The variable.
        key: String,
        /// The type's name.
        type_name: &'static str,
        /// Where they differ.
        difference: String,
    },
    /// The bytes are a value of the type, but one that cannot be true.
    #[error("{type_name}.{invalid}")]
    Value {
        /// The type's name.
        type_name: &'static str,
        /// The field at fault.
        invalid: Invalid,
    },
    /// The bytes are not an encoding of the type.
    #[error("the bytes are no {type_name}: {reason}")]
    Bytes {
        /// The type's name.
        type_name: &'static str,
        /// What bincode says.
        reason: String,
    },
}

/// Why a value could not be encoded.
#[derive(Debug, thiserror::Error)]
#[error("the value cannot be encoded: {0}")]
pub struct EncodeError(String);

/// The number of bytes that `value` takes.
pub fn encoded_len<T: Serialize + ?Sized>(value: &T) -> Result<usize, EncodeError> {
    struct Count(usize);
    impl bincode::enc::write::Writer for Count {
        fn write(&mut self, bytes: &[u8]) -> Result<(), bincode::error::EncodeError> {
            self.0 += bytes.len();
            Ok(())
        }
    }
    let mut count = Count(0);
    encode_to(value, &mut count)?;
    Ok(count.0)
}

/// Encodes `value` behind what is in `buffer`.
pub fn encode_onto<T: Serialize + ?Sized>(value: &T, buffer: &mut Vec<u8>) -> Result<(), EncodeError> {
    struct Append<'a>(&'a mut Vec<u8>);
    impl bincode::enc::write::Writer for Append<'_> {
        fn write(&mut self, bytes: &[u8]) -> Result<(), bincode::error::EncodeError> {
            self.0.extend_from_slice(bytes);
            Ok(())
        }
    }
    encode_to(value, &mut Append(buffer))
}

/// Encodes `value` into a writer; it takes [`encoded_len`] bytes.
pub fn encode_to_writer<T: Serialize + ?Sized>(
    value: &T,
    mut writer: &mut dyn std::io::Write,
) -> Result<(), EncodeError> {
    bincode::serde::encode_into_std_write(value, &mut writer, CONFIG)
        .map(|_| ())
        .map_err(|e| EncodeError(e.to_string()))
}

fn encode_to<T: Serialize + ?Sized>(
    value: &T,
    writer: &mut impl bincode::enc::write::Writer,
) -> Result<(), EncodeError> {
    bincode::serde::encode_into_writer(value, writer, CONFIG).map_err(|e| EncodeError(e.to_string()))
}

/// Decodes a value of a payload type that fills `bytes` to the last one, and holds it against the rules of its type: nobody
/// gets hold of one that breaks them. What can borrow from the bytes does.
#[inline]
pub fn decode<T: Payload>(bytes: &[u8]) -> Result<T::View<'_>, DecodeError> {
    checked::<T>(decode_plain(bytes, T::NAME)?)
}

/// As [`decode`], out of bytes that do not stay: what could be borrowed of them is copied. A type that can only borrow (a
/// `&str`, and not a `Cow`) is none that these bytes are.
pub fn decode_to_keep<'a, T: Payload>(bytes: &[u8]) -> Result<T::View<'a>, DecodeError> {
    struct Rest<'b>(&'b [u8]);
    impl bincode::de::read::Reader for &mut Rest<'_> {
        fn read(&mut self, bytes: &mut [u8]) -> Result<(), bincode::error::DecodeError> {
            let additional = bytes.len().saturating_sub(self.0.len());
            let taken = self.0.split_at_checked(bytes.len());
            let (read, rest) = taken.ok_or(bincode::error::DecodeError::UnexpectedEnd { additional })?;
            bytes.copy_from_slice(read);
            self.0 = rest;
            Ok(())
        }
    }
    let mut rest = Rest(bytes);
    let value = {
        let mut decoder = bincode::serde::OwnedSerdeDecoder::from_reader(&mut rest, CONFIG);
        T::View::deserialize(decoder.as_deserializer())
    };
    let value = value.map_err(|error| DecodeError::Bytes { type_name: T::NAME, reason: error.to_string() })?;
    all_read(rest.0.len(), T::NAME)?;
    checked::<T>(value)
}

/// Decodes what fills `bytes` and is no payload: what the parts of a transport say to each other.
pub fn decode_owned<T: serde::de::DeserializeOwned>(bytes: &[u8], type_name: &'static str) -> Result<T, DecodeError> {
    decode_plain(bytes, type_name)
}

#[inline]
fn decode_plain<'a, T: Deserialize<'a>>(bytes: &'a [u8], type_name: &'static str) -> Result<T, DecodeError> {
    let bad = |reason: String| DecodeError::Bytes { type_name, reason };
    let (value, read) = bincode::serde::borrow_decode_from_slice(bytes, CONFIG).map_err(|e| bad(e.to_string()))?;
    all_read(bytes.len() - read, type_name)?;
    Ok(value)
}

#[inline]
fn all_read(left: usize, type_name: &'static str) -> Result<(), DecodeError> {
    match left {
        0 => Ok(()),
        left => Err(DecodeError::Bytes { type_name, reason: format!("{left} bytes are left over") }),
    }
}

/// What keeps to the rules of its type.
#[inline]
fn checked<T: Payload>(view: T::View<'_>) -> Result<T::View<'_>, DecodeError> {
    view.check().map_err(|invalid| DecodeError::Value { type_name: T::NAME, invalid })?;
    Ok(view)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A bit of everything.
    #[crate::payload]
    #[derive(Debug, Clone, PartialEq)]
    pub struct Sample {
        /// A number.
        pub number: f64,
        /// A text.
        pub text: String,
        /// A list.
        pub list: Vec<u32>,
        /// Perhaps.
        pub perhaps: Option<i64>,
    }

    proptest! {
        #[test]
        fn what_goes_in_comes_out(number in -1e9..1e9f64, text in ".*", list in prop::collection::vec(any::<u32>(), 0..20), perhaps: Option<i64>) {
            let sample = Sample { number, text, list, perhaps };
            let mut bytes = Vec::new();
            encode_to_writer(&sample, &mut bytes).unwrap();
            prop_assert_eq!(bytes.len(), encoded_len(&sample).unwrap());
            let mut appended = Vec::new();
            encode_onto(&sample, &mut appended).unwrap();
            prop_assert_eq!(&bytes, &appended);
            prop_assert_eq!(decode::<Sample>(&bytes).unwrap(), sample);
            prop_assert!(decode::<Sample>(&bytes[..bytes.len() - 1]).is_err());
            bytes.push(0);
            prop_assert!(decode::<Sample>(&bytes).is_err(), "left over bytes are no part of the value");
        }

        /// A length from outside never makes the decoder allocate what is not there.
        #[test]
        fn any_bytes_are_an_error_or_a_value(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = decode::<Sample>(&bytes);
        }
    }
}
