//! Bytes as JSON.

use serde_json::{Map, Number, Value};

use crate::Description;
use crate::cursor::Cursor;
use crate::description::{Content, Field, Kind};
use crate::json::{counted, shortest};

/// Why bytes are no value of a type.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the bytes are no {type_name}: {reason}{}", at(.field))]
pub struct ReadError {
    /// The type's name.
    pub type_name: String,
    /// The field at fault, with its way from the outermost value.
    pub field: String,
    /// What is wrong.
    pub reason: String,
}

fn at(field: &str) -> String {
    if field.is_empty() { String::new() } else { format!(" (at {field})") }
}

impl Description {
    /// The most values in a value that are read.
    pub const MOST_VALUES: usize = 1 << 24;

    /// A value's bytes as JSON: an object for a struct, `null` for an option without a value, a variant's name, or an
    /// object of it and what it holds. An option in an option, or of nothing, is in a list of one where it is there: `[null]`.
    /// Lists of more than `longest` values are said by their number: `"7312 points"`. JSON has no infinity and no NaN: they are
    /// the texts `"inf"`, `"-inf"` and `"NaN"`.
    ///
    /// # Errors
    /// The bytes are none of the type, or more than that.
    pub fn to_json(&self, bytes: &[u8], longest: usize) -> Result<Value, ReadError> {
        self.read(bytes, longest, endless)
    }

    /// As [`Description::to_json`], for who goes by a schema: whatever is a number or not there. Infinities and NaN are `null`.
    ///
    /// # Errors
    /// As there.
    pub fn to_finite_json(&self, bytes: &[u8], longest: usize) -> Result<Value, ReadError> {
        self.read(bytes, longest, |_| Value::Null)
    }

    fn read(&self, bytes: &[u8], longest: usize, endless: fn(f64) -> Value) -> Result<Value, ReadError> {
        let mut reader = Reader { at: Cursor(bytes), longest, endless, left: Self::MOST_VALUES, way: Vec::new() };
        let read = reader.value(self.kind()).and_then(|value| match reader.at.0.len() {
            0 => Ok(value),
            left => Err(format!("{left} bytes are left over")),
        });
        read.map_err(|reason| ReadError { type_name: self.name().to_owned(), field: way(&reader.way), reason })
    }
}

/// A step from a value to one in it.
enum Step<'a> {
    Field(&'a str),
    Index(u64),
}

fn way(steps: &[Step<'_>]) -> String {
    let mut text = String::new();
    for step in steps {
        match step {
            Step::Field(name) if text.is_empty() => text += name,
            Step::Field(name) => text += &format!(".{name}"),
            Step::Index(index) => text += &format!("[{index}]"),
        }
    }
    text
}

struct Reader<'a> {
    at: Cursor<'a>,
    longest: usize,
    /// What is said of a number that JSON does not have.
    endless: fn(f64) -> Value,
    /// How many more values are read.
    left: usize,
    /// Where it is; it stays where an error is found.
    way: Vec<Step<'a>>,
}

impl<'a> Reader<'a> {
    fn number<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut number = [0; N];
        number.copy_from_slice(self.at.take(N as u64)?);
        Ok(number)
    }

    fn float(&self, number: f64) -> Value {
        Number::from_f64(number).map_or_else(|| (self.endless)(number), Value::Number)
    }

    fn signed(&mut self, bytes: u8) -> Result<i64, String> {
        let unused = 64 - 8 * u32::from(bytes);
        // Shifted up and down again, so that its sign is that of the wide one.
        Ok((self.at.unsigned(bytes)? << unused) as i64 >> unused)
    }

    fn value(&mut self, kind: &'a Kind) -> Result<Value, String> {
        self.left =
            self.left.checked_sub(1).ok_or_else(|| format!("it has more than {} values", Description::MOST_VALUES))?;
        Ok(match kind {
            Kind::Unit => Value::Null,
            Kind::Bool => match self.at.unsigned(1)? {
                0 => Value::Bool(false),
                1 => Value::Bool(true),
                other => return Err(format!("{other} is neither 0 nor 1")),
            },
            Kind::Unsigned(bytes) => self.at.unsigned(*bytes)?.into(),
            Kind::Signed(bytes) => self.signed(*bytes)?.into(),
            Kind::Float(4) => {
                let number = shortest(f32::from_le_bytes(self.number()?));
                self.float(number)
            }
            Kind::Float(_) => {
                let number = f64::from_le_bytes(self.number()?);
                self.float(number)
            }
            Kind::Rotation => self.list(&Kind::Float(8), 4)?,
            Kind::Text => {
                let length = self.at.length()?;
                let text = std::str::from_utf8(self.at.take(length)?);
                text.map_err(|error| format!("a text is not UTF-8: {error}"))?.into()
            }
            Kind::Option(inner) => match self.at.unsigned(1)? {
                0 => Value::Null,
                1 if inner.may_be_null() => Value::Array(vec![self.value(inner)?]),
                1 => self.value(inner)?,
                other => return Err(format!("{other} is neither 0 nor 1")),
            },
            Kind::List(inner) => {
                let count = self.at.length()?;
                // Each takes a byte at least: a length that is made up asks for no memory.
                let most = self.at.0.len() as u64 / inner.least_bytes().max(1);
                if count > most {
                    return Err(format!("a list of {count}, and there are bytes for {most}"));
                }
                self.list(inner, count)?
            }
            Kind::Packed(inner) => {
                let (length, width) = (self.at.length()?, inner.width().unwrap_or(1).max(1));
                if length % width != 0 || length > self.at.0.len() as u64 {
                    return Err(format!("{length} bytes are no list of values of {width} bytes"));
                }
                self.list(inner, length / width)?
            }
            Kind::Symbols { bits, letters, .. } => {
                let length = self.at.length()?;
                let letters: Vec<char> = letters.chars().collect();
                let (bits, each) = (usize::from(*bits), 8 / usize::from(*bits));
                let bytes = self.at.take(length)?;
                if bytes.len().saturating_mul(each) > self.longest {
                    return Ok(self.counted((bytes.len() as u64).saturating_mul(each as u64)));
                }
                let symbols = bytes.iter().flat_map(|byte| (0..each).map(move |i| byte >> (i * bits)));
                let letter = |symbol: u8| letters[usize::from(symbol) & (letters.len() - 1)];
                symbols.map(letter).collect::<String>().into()
            }
            Kind::Array { of, count } => self.list(of, *count)?,
            Kind::Tuple(inner) => self.tuple(inner)?,
            Kind::Unnamed(one) => self.value(&one.kind)?,
            Kind::Struct(one) => self.fields(&one.fields)?,
            Kind::Enum(one) => {
                let number = self.at.unsigned(4)? as usize;
                let variant =
                    one.variants.get(number).ok_or_else(|| format!("{} has no variant {number}", one.name))?;
                let inner = match &variant.content {
                    Content::Unit => return Ok(variant.name.as_str().into()),
                    Content::One(inner) => self.step(Step::Field(&variant.name), |reader| reader.value(inner))?,
                    Content::Tuple(inner) => self.step(Step::Field(&variant.name), |reader| reader.tuple(inner))?,
                    Content::Fields(inner) => self.step(Step::Field(&variant.name), |reader| reader.fields(inner))?,
                };
                Map::from_iter([(variant.name.clone(), inner)]).into()
            }
        })
    }

    fn step<T>(&mut self, step: Step<'a>, read: impl FnOnce(&mut Self) -> Result<T, String>) -> Result<T, String> {
        self.way.push(step);
        let value = read(self)?;
        self.way.pop();
        Ok(value)
    }

    fn list(&mut self, inner: &'a Kind, count: u64) -> Result<Value, String> {
        let is_shown = count <= self.longest as u64;
        if let Some(bytes) = inner.width().filter(|_| !is_shown).and_then(|width| width.checked_mul(count)) {
            self.at.take(bytes)?;
            return Ok(self.counted(count));
        }
        let mut all = Vec::new();
        for index in 0..count {
            let value = self.step(Step::Index(index), |reader| reader.value(inner))?;
            if is_shown {
                all.push(value);
            }
        }
        Ok(if is_shown { all.into() } else { self.counted(count) })
    }

    /// A list in the field where the reader is, too long to be shown.
    fn counted(&self, count: u64) -> Value {
        let field =
            self.way.iter().rev().find_map(|step| if let Step::Field(name) = step { Some(*name) } else { None });
        counted(count, field.unwrap_or("values"))
    }

    fn tuple(&mut self, inner: &'a [Kind]) -> Result<Value, String> {
        let one = |(index, kind)| self.step(Step::Index(index), |reader| reader.value(kind));
        (0..).zip(inner).map(one).collect::<Result<Vec<_>, _>>().map(Value::from)
    }

    fn fields(&mut self, fields: &'a [Field]) -> Result<Value, String> {
        let mut object = Map::new();
        for field in fields {
            let value = self.step(Step::Field(&field.name), |reader| reader.value(&field.kind))?;
            object.insert(field.name.clone(), value);
        }
        Ok(object.into())
    }
}

/// A number that JSON does not have, as Rust writes it.
fn endless(number: f64) -> Value {
    number.to_string().into()
}
