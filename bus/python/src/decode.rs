//! Bytes as Python's values, by the description that travels with their type.
//!
//! It is what `elk echo --json` shows, as Python's own values: a struct is a dict, an option without a value None, a variant its
//! name, or a dict of it and what it holds. But numbers are numbers, infinities too, and lists of numbers, or of lists of numbers
//! of one length, are numpy arrays over the bytes where they lie.

use std::sync::Arc;

use elk_bus::Description;
use elk_bus::describe::{Content, Field, Kind};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::bytes::{Bytes, Element, View, product};
use crate::error::{decode_error, error};

/// A value's bytes as a Python value.
///
/// # Errors
/// The bytes are none of the type.
pub fn decode<'py>(py: Python<'py>, bytes: &Arc<Bytes>, description: &Description) -> PyResult<Bound<'py, PyAny>> {
    let mut reader = Reader { py, bytes, at: 0, left: Description::MOST_VALUES };
    let value = reader.value(description.kind());
    let value = value.and_then(|value| match bytes.len() - reader.at {
        0 => Ok(value),
        left => Err(error(format_args!("{left} bytes are left over"))),
    });
    value.map_err(|wrong| {
        decode_error(
            py,
            format_args!("the bytes are no {}: {} (at byte {})", description.name(), wrong.value(py), reader.at),
        )
    })
}

struct Reader<'py, 'a> {
    py: Python<'py>,
    bytes: &'a Arc<Bytes>,
    at: usize,
    /// How many more values are read.
    left: usize,
}

type Value<'py> = PyResult<Bound<'py, PyAny>>;

impl<'py, 'a> Reader<'py, 'a> {
    fn take(&mut self, count: u64) -> PyResult<&'a [u8]> {
        let left = self.bytes.get(self.at..).unwrap_or_default();
        let taken = usize::try_from(count).ok().and_then(|count| left.get(..count));
        let taken =
            taken.ok_or_else(|| error(format_args!("{count} bytes are needed, and {} are left", left.len())))?;
        self.at += taken.len();
        Ok(taken)
    }

    fn unsigned(&mut self, bytes: u8) -> PyResult<u64> {
        let mut wide = [0; 8];
        let taken = self.take(u64::from(bytes))?;
        wide.iter_mut().zip(taken).for_each(|(wide, byte)| *wide = *byte);
        Ok(u64::from_le_bytes(wide))
    }

    fn float(&mut self) -> PyResult<f64> {
        Ok(f64::from_bits(self.unsigned(8)?))
    }

    fn value(&mut self, kind: &Kind) -> Value<'py> {
        let most = || error(format_args!("it has more than {} values", Description::MOST_VALUES));
        self.left = self.left.checked_sub(1).ok_or_else(most)?;
        let py = self.py;
        match kind {
            Kind::Unit => Ok(py.None().into_bound(py)),
            Kind::Bool => match self.unsigned(1)? {
                flag @ (0 | 1) => (flag == 1).into_bound_py_any(py),
                other => Err(error(format_args!("{other} is neither 0 nor 1"))),
            },
            Kind::Unsigned(bytes) => self.unsigned(*bytes)?.into_bound_py_any(py),
            Kind::Signed(bytes) => {
                let unused = 64_u32.saturating_sub(8 * u32::from(*bytes));
                // Shifted up and down again, so that its sign is that of the wide one.
                ((self.unsigned(*bytes)? << unused) as i64 >> unused).into_bound_py_any(py)
            }
            Kind::Float(4) => f64::from(f32::from_bits(self.unsigned(4)? as u32)).into_bound_py_any(py),
            Kind::Float(_) => self.float()?.into_bound_py_any(py),
            Kind::Rotation => [self.float()?, self.float()?, self.float()?, self.float()?].into_bound_py_any(py),
            Kind::Text => {
                let length = self.unsigned(8)?;
                let text = std::str::from_utf8(self.take(length)?);
                text.map_err(|wrong| error(format_args!("a text is not UTF-8: {wrong}")))?.into_bound_py_any(py)
            }
            Kind::Option(inner) => match self.unsigned(1)? {
                0 => Ok(py.None().into_bound(py)),
                1 if matches!(inner.plain(), Kind::Unit | Kind::Option(_)) => self.list(inner, 1),
                1 => self.value(inner),
                other => Err(error(format_args!("{other} is neither 0 nor 1"))),
            },
            Kind::List(inner) => {
                let count = self.unsigned(8)?;
                match numbers(inner) {
                    Some(Numbers { number, shape }) => self.array(count, Element::Number(number), shape),
                    None => self.list(inner, count),
                }
            }
            Kind::Packed(inner) => {
                let length = self.unsigned(8)?;
                self.packed(inner, length)
            }
            Kind::Symbols { bits, letters, .. } => {
                let length = self.unsigned(8)?;
                let (letters, bits): (Vec<char>, _) = (letters.chars().collect(), usize::from(*bits).clamp(1, 8));
                let symbols = self.take(length)?.iter().flat_map(|byte| (0..8 / bits).map(move |i| byte >> (i * bits)));
                let letter = |symbol: u8| letters.get(usize::from(symbol) & ((1 << bits) - 1)).copied().unwrap_or('?');
                symbols.map(letter).collect::<String>().into_bound_py_any(py)
            }
            Kind::Array { of, count } => self.list(of, *count),
            Kind::Tuple(inner) => self.tuple(inner),
            Kind::Unnamed(one) => self.value(&one.kind),
            Kind::Struct(one) => self.fields(&one.fields),
            Kind::Enum(one) => {
                let number = self.unsigned(4)? as usize;
                let variant = one.variants.get(number);
                let variant = variant.ok_or_else(|| error(format_args!("{} has no variant {number}", one.name)))?;
                let inner = match &variant.content {
                    Content::Unit => return variant.name.as_str().into_bound_py_any(py),
                    Content::One(inner) => self.value(inner)?,
                    Content::Tuple(inner) => self.tuple(inner)?,
                    Content::Fields(inner) => self.fields(inner)?,
                };
                let held = PyDict::new(py);
                held.set_item(&variant.name, inner)?;
                Ok(held.into_any())
            }
        }
    }

    fn list(&mut self, inner: &Kind, count: u64) -> Value<'py> {
        let all = PyList::empty(self.py);
        for _ in 0..count {
            all.append(self.value(inner)?)?;
        }
        Ok(all.into_any())
    }

    fn tuple(&mut self, inner: &[Kind]) -> Value<'py> {
        let all = PyList::empty(self.py);
        inner.iter().try_for_each(|kind| all.append(self.value(kind)?))?;
        Ok(all.into_any())
    }

    fn fields(&mut self, fields: &[Field]) -> Value<'py> {
        let object = PyDict::new(self.py);
        fields.iter().try_for_each(|field| object.set_item(&field.name, self.value(&field.kind)?))?;
        Ok(object.into_any())
    }

    /// Values behind their length in bytes.
    fn packed(&mut self, inner: &Kind, length: u64) -> Value<'py> {
        let (element, shape) = match (numbers(inner), record(inner)) {
            (Some(Numbers { number, shape }), _) => (Element::Number(number), shape),
            (None, Some(fields)) => (fields, Vec::new()),
            (None, None) => {
                let end = self.at.saturating_add(usize::try_from(length).unwrap_or(usize::MAX));
                let all = PyList::empty(self.py);
                while self.at < end {
                    all.append(self.value(inner)?)?;
                }
                return Ok(all.into_any());
            }
        };
        let width = width_of(&element, &shape)?.max(1);
        match length % width {
            0 => self.array(length / width, element, shape),
            _ => Err(error(format_args!("{length} bytes are no list of values of {width} bytes"))),
        }
    }

    /// So many elements of this shape, where they lie.
    fn array(&mut self, count: u64, element: Element, inner: Vec<usize>) -> Value<'py> {
        let width = width_of(&element, &inner)?;
        if width == 0 && count > Description::MOST_VALUES as u64 {
            return Err(error(format_args!("it has more than {} values", Description::MOST_VALUES)));
        }
        let offset = self.at;
        self.take(count.saturating_mul(width))?;
        let mut shape = vec![count as usize];
        shape.extend(inner);
        View { bytes: self.bytes.clone(), offset, shape, element }.into_array(self.py)
    }
}

/// Bytes of an array's element, in each of a shape's places.
fn width_of(element: &Element, shape: &[usize]) -> PyResult<u64> {
    let width = element.width().and_then(|width| product(width, shape));
    width.map(|width| width as u64).ok_or_else(|| error("its arrays are longer than memory can be"))
}

/// Numbers of one kind, as numpy names it, and their shape.
pub struct Numbers {
    /// As `<f4`.
    pub number: String,
    /// Of one value.
    pub shape: Vec<usize>,
}

impl Numbers {
    fn one(number: String) -> Option<Self> {
        Some(Self { number, shape: Vec::new() })
    }
}

/// The numbers that a value is, if it is nothing but numbers of one kind.
pub fn numbers(kind: &Kind) -> Option<Numbers> {
    match kind.plain() {
        Kind::Unsigned(1) => Numbers::one("|u1".to_owned()),
        Kind::Signed(1) => Numbers::one("|i1".to_owned()),
        Kind::Unsigned(bytes) => Numbers::one(format!("<u{bytes}")),
        Kind::Signed(bytes) => Numbers::one(format!("<i{bytes}")),
        Kind::Float(bytes) => Numbers::one(format!("<f{bytes}")),
        Kind::Rotation => Some(Numbers { number: "<f8".to_owned(), shape: vec![4] }),
        Kind::Array { of, count } => {
            let mut numbers = numbers(of)?;
            numbers.shape.insert(0, usize::try_from(*count).ok()?);
            Some(numbers)
        }
        _ => None,
    }
}

/// A struct of numbers as numpy's record.
fn record(kind: &Kind) -> Option<Element> {
    let Kind::Struct(one) = kind.plain() else { return None };
    let field = |field: &Field| {
        let Numbers { number, shape } = numbers(&field.kind)?;
        Some((field.name.clone(), number, shape))
    };
    let element = Element::Record(one.fields.iter().map(field).collect::<Option<_>>()?);
    // Of records of no bytes numpy cannot say how many there are.
    (element.width() != Some(0)).then_some(element)
}
