//! Values of one version of a type as values of another.

use crate::cursor::Cursor;
use crate::description::{Content, Enum, Field, Kind};
use crate::json::joined;
use crate::visit::skip;
use crate::write::bytes_of;
use crate::{Description, Difference, ReadError};

/// How values of one version of a type become values of another: prepared once, and used for each of them.
#[derive(Debug)]
pub struct Conversion {
    type_name: String,
    change: Change,
}

/// What becomes of a value.
#[derive(Debug)]
enum Change {
    /// Its bytes mean the same in both.
    Same(Kind),
    Option(Box<Change>),
    List(Box<Change>),
    /// Packed values, of so many bytes each.
    Packed(Box<Change>, u64),
    Array(Box<Change>, u64),
    /// The values in a struct or a tuple, in the order of their bytes.
    Parts(Vec<Part>),
    /// Of each variant its number in the other version, and what becomes of its content.
    Variants(Vec<(u32, Change)>),
}

#[derive(Debug)]
enum Part {
    /// Both have it.
    Keep(Change),
    /// Only the one has it.
    Drop(Kind),
    /// Only the other has it: its default.
    Insert(Vec<u8>),
}

impl Description {
    /// How values of this version of a type are read as values of another. What both have stands in the same order, with the
    /// same names, units and kinds; a field that only one of them has needs a default there; the other has all variants of
    /// an enum that this one has.
    ///
    /// # Errors
    /// The first place where they differ in any other way.
    pub fn conversion_to(&self, other: &Self) -> Result<Conversion, Difference> {
        let change = change("", self.kind(), other.kind())?;
        Ok(Conversion { type_name: self.name().to_owned(), change })
    }
}

impl Conversion {
    /// The most bytes that a value becomes.
    pub const MOST_BYTES: usize = 1 << 30;

    /// The bytes of a value of the one version as the other has them.
    ///
    /// # Errors
    /// They are none of the one version, or become more than [`Conversion::MOST_BYTES`].
    pub fn convert(&self, bytes: &[u8]) -> Result<Vec<u8>, ReadError> {
        let mut converter = Converter { at: Cursor(bytes), out: Vec::with_capacity(bytes.len()) };
        let converted = converter.put(&self.change).and_then(|()| match converter.at.0.len() {
            0 => Ok(()),
            left => Err(format!("{left} bytes are left over")),
        });
        match converted {
            Ok(()) => Ok(converter.out),
            Err(reason) => Err(ReadError { type_name: self.type_name.clone(), field: String::new(), reason }),
        }
    }
}

fn change(field: &str, one: &Kind, other: &Kind) -> Result<Change, Difference> {
    if one.layout() == other.layout() {
        return Ok(Change::Same(one.clone()));
    }
    let inner = |one: &Kind, other: &Kind| change(&format!("{field}[]"), one, other).map(Box::new);
    match (measured(one), measured(other)) {
        (Kind::Unnamed(one), Kind::Unnamed(other)) if one.unit == other.unit => change(field, &one.kind, &other.kind),
        (Kind::Unnamed(one), Kind::Unnamed(other)) => Err(units_differ(field, &one.unit, &other.unit)),
        (Kind::Unnamed(one), _) => Err(units_differ(field, &one.unit, "")),
        (_, Kind::Unnamed(other)) => Err(units_differ(field, "", &other.unit)),
        (Kind::Struct(one), Kind::Struct(other)) if one.name == other.name => fields(field, &one.fields, &other.fields),
        (Kind::Enum(one), Kind::Enum(other)) if one.name == other.name => variants(field, one, other),
        (Kind::Option(one), Kind::Option(other)) => Ok(Change::Option(Box::new(change(field, one, other)?))),
        (Kind::List(one), Kind::List(other)) => Ok(Change::List(inner(one, other)?)),
        (Kind::Packed(one), Kind::Packed(other)) => {
            Ok(Change::Packed(inner(one, other)?, one.width().unwrap_or(1).max(1)))
        }
        (Kind::Array { of: one, count }, Kind::Array { of: other, count: same }) if count == same => {
            Ok(Change::Array(inner(one, other)?, *count))
        }
        (Kind::Tuple(one), Kind::Tuple(other)) if one.len() == other.len() => values(field, one, other),
        _ => Err(Difference::of(field, one, other)),
    }
}

/// The kind without what is said of it and changes nothing of what its bytes mean.
fn measured(kind: &Kind) -> &Kind {
    match kind {
        Kind::Unnamed(one) if one.unit.is_empty() => measured(&one.kind),
        _ => kind,
    }
}

fn units_differ(field: &str, one: &str, other: &str) -> Difference {
    let unit = |unit: &str| if unit.is_empty() { "without a unit".to_owned() } else { format!("in {unit}") };
    Difference::of(field, unit(one), unit(other))
}

fn values(field: &str, one: &[Kind], other: &[Kind]) -> Result<Change, Difference> {
    let pairs = one.iter().zip(other).enumerate();
    let keep = pairs.map(|(i, (one, other))| change(&format!("{field}[{i}]"), one, other).map(Part::Keep));
    keep.collect::<Result<_, _>>().map(Change::Parts)
}

fn fields(field: &str, one: &[Field], other: &[Field]) -> Result<Change, Difference> {
    let is_in = |all: &[Field], name: &str| all.iter().any(|field| field.name == name);
    for (all, others, which) in [(one, other, 0), (other, one, 1)] {
        let alone = all.iter().find(|field| field.default.is_none() && !is_in(others, &field.name));
        if let Some(alone) = alone {
            return Err(Difference::only(joined(field, &alone.name), which));
        }
    }
    let (mut ones, mut parts) = (one.iter(), Vec::new());
    for (i, wanted) in other.iter().enumerate() {
        if !is_in(one, &wanted.name) {
            parts.push(Part::Insert(
                default_bytes(wanted).ok_or_else(|| Difference::only(joined(field, &wanted.name), 1))?,
            ));
            continue;
        }
        for found in ones.by_ref() {
            if is_in(other, &found.name) {
                parts.push(Part::Keep(same_field(field, i, found, wanted)?));
                break;
            }
            parts.push(Part::Drop(found.kind.clone()));
        }
    }
    parts.extend(ones.map(|left| Part::Drop(left.kind.clone())));
    Ok(Change::Parts(parts))
}

/// What becomes of a field that both have, if it stands in the same place.
fn same_field(of: &str, i: usize, one: &Field, other: &Field) -> Result<Change, Difference> {
    if one.name != other.name {
        let place = format!("field {} of {}", i + 1, if of.is_empty() { "it" } else { of });
        return Err(Difference::of(&place, &one.name, &other.name));
    }
    let field = joined(of, &one.name);
    match one.unit == other.unit {
        true => change(&field, &one.kind, &other.kind),
        false => Err(units_differ(&field, &one.unit, &other.unit)),
    }
}

fn default_bytes(field: &Field) -> Option<Vec<u8>> {
    bytes_of(&field.kind, field.default.as_ref()?)
}

fn variants(field: &str, one: &Enum, other: &Enum) -> Result<Change, Difference> {
    let each = one.variants.iter().map(|variant| {
        let field = joined(field, &variant.name);
        let number = other.variants.iter().position(|other| other.name == variant.name);
        let number = number.ok_or_else(|| Difference::only(field.clone(), 0))?;
        let change = match (&variant.content, &other.variants[number].content) {
            (Content::Unit, Content::Unit) => Change::Parts(Vec::new()),
            (Content::One(one), Content::One(other)) => change(&field, one, other)?,
            (Content::Tuple(one), Content::Tuple(other)) if one.len() == other.len() => values(&field, one, other)?,
            (Content::Fields(one), Content::Fields(other)) => fields(&field, one, other)?,
            _ => return Err(Difference::of(&field, "one thing", "another")),
        };
        Ok((number as u32, change))
    });
    each.collect::<Result<_, _>>().map(Change::Variants)
}

struct Converter<'a> {
    at: Cursor<'a>,
    out: Vec<u8>,
}

impl Converter<'_> {
    fn put(&mut self, change: &Change) -> Result<(), String> {
        match change {
            Change::Same(kind) => {
                let here = self.at.0;
                skip(&mut self.at, kind)?;
                self.out.extend_from_slice(&here[..here.len() - self.at.0.len()]);
                Ok(())
            }
            Change::Option(inner) => match self.copied(1)? {
                0 => Ok(()),
                _ => self.put(inner),
            },
            Change::List(inner) => {
                let count = self.copied(8)?;
                self.repeat(inner, count)
            }
            Change::Packed(inner, width) => {
                let (length, start) = (self.at.length()?, self.out.len());
                self.out.extend_from_slice(&[0; 8]);
                self.repeat(inner, length / width)?;
                let length = (self.out.len() - start - 8) as u64;
                self.out[start..start + 8].copy_from_slice(&length.to_le_bytes());
                Ok(())
            }
            Change::Array(inner, count) => self.repeat(inner, *count),
            Change::Parts(parts) => parts.iter().try_for_each(|part| self.put_part(part)),
            Change::Variants(all) => {
                let number = self.at.unsigned(4)?;
                let (number, inner) =
                    all.get(number as usize).ok_or_else(|| format!("there is no variant {number}"))?;
                self.out.extend_from_slice(&number.to_le_bytes());
                self.put(inner)
            }
        }
    }

    fn put_part(&mut self, part: &Part) -> Result<(), String> {
        match part {
            Part::Keep(change) => self.put(change),
            Part::Drop(kind) => skip(&mut self.at, kind),
            Part::Insert(bytes) if self.out.len() + bytes.len() > Conversion::MOST_BYTES => {
                Err(format!("it would become more than {} bytes", Conversion::MOST_BYTES))
            }
            Part::Insert(bytes) => {
                self.out.extend_from_slice(bytes);
                Ok(())
            }
        }
    }

    fn repeat(&mut self, change: &Change, count: u64) -> Result<(), String> {
        (0..count).try_for_each(|_| self.put(change))
    }

    /// A number of so many bytes, which is the same in both.
    fn copied(&mut self, bytes: u8) -> Result<u64, String> {
        let number = self.at.unsigned(bytes)?;
        self.out.extend_from_slice(&number.to_le_bytes()[..usize::from(bytes)]);
        Ok(number)
    }
}
