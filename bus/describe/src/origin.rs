//! Where descriptions come from: from a type's shape, or as a text from outside.

use crate::description::{Content, Enum, Field, Struct, Variant};
use crate::range::Range;
use crate::shape::{EnumShape, FieldShape, VariantContent};
use crate::write::{bytes_of, example};
use crate::{Description, Kind, Shape};

/// Why a description from outside is none.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// It is not the JSON of one.
    #[error("this describes no type: {0}")]
    Json(String),
    /// It is longer than any type's.
    #[error("a description of {found} bytes: at most {most} are read")]
    TooLong {
        /// Its length.
        found: usize,
        /// The longest.
        most: usize,
    },
    /// It says what no bytes can be.
    #[error("this describes no type: {0}")]
    Nonsense(String),
}

impl Description {
    /// The description of a shape.
    pub fn of(shape: &Shape) -> Self {
        Self(Kind::of(shape))
    }

    /// As it travels.
    pub fn to_text(&self) -> String {
        // An empty text says that nobody has described the type.
        serde_json::to_string(self).unwrap_or_else(|error| {
            debug_assert!(false, "a tree of names and numbers can be said as JSON: {error}");
            String::new()
        })
    }

    /// Reads what somebody says that a type is.
    ///
    /// # Errors
    /// It is not the JSON of a description, or one of what no bytes can be.
    pub fn from_text(text: &str) -> Result<Self, Refused> {
        if text.len() > Self::LONGEST {
            return Err(Refused::TooLong { found: text.len(), most: Self::LONGEST });
        }
        let description: Self = serde_json::from_str(text).map_err(|error| Refused::Json(error.to_string()))?;
        description.0.check(0).map_err(Refused::Nonsense)?;
        Ok(description)
    }
}

impl Kind {
    fn of(shape: &Shape) -> Self {
        let boxed = |inner: &Shape| Box::new(Self::of(inner));
        let all = |inner: &[Shape]| inner.iter().map(Self::of).collect();
        match shape {
            Shape::Unit => Self::Unit,
            Shape::Bool => Self::Bool,
            Shape::Unsigned(bytes) => Self::Unsigned(*bytes),
            Shape::Signed(bytes) => Self::Signed(*bytes),
            Shape::Float(bytes) => Self::Float(*bytes),
            Shape::Rotation => Self::Rotation,
            Shape::Text => Self::Text,
            Shape::Option(inner) => Self::Option(boxed(inner)),
            Shape::List(inner) => Self::List(boxed(inner)),
            Shape::Packed(inner) => Self::Packed(boxed(inner)),
            Shape::Symbols(bits, letters, least) => {
                Self::Symbols { bits: *bits, letters: (*letters).to_owned(), least: *least as u64 }
            }
            Shape::Array(inner, count) => Self::Array { of: boxed(inner), count: *count as u64 },
            Shape::Tuple(inner) => Self::Tuple(all(inner)),
            Shape::Unnamed(one) => Self::Unnamed(Box::new(field_of(one))),
            Shape::Struct(one) => Self::Struct(Struct {
                name: one.name.to_owned(),
                docs: one.docs.to_owned(),
                drawn: one.drawn.to_owned(),
                fields: fields_of(one.fields),
            }),
            Shape::Enum(EnumShape { name, docs, variants }) => {
                let variants = variants.iter().map(|one| Variant {
                    name: one.name.to_owned(),
                    docs: one.docs.to_owned(),
                    content: match &one.content {
                        VariantContent::Unit => Content::Unit,
                        VariantContent::One(one) => Content::One(boxed(one)),
                        VariantContent::Tuple(inner) => Content::Tuple(all(inner)),
                        VariantContent::Fields(fields) => Content::Fields(fields_of(fields)),
                    },
                });
                Self::Enum(Enum { name: (*name).to_owned(), docs: (*docs).to_owned(), variants: variants.collect() })
            }
        }
    }

    fn check(&self, depth: usize) -> Result<(), String> {
        if depth > Description::DEEPEST {
            return Err(format!("types lie more than {} deep in each other", Description::DEEPEST));
        }
        match self {
            Self::Unsigned(1 | 2 | 4 | 8) | Self::Signed(1 | 2 | 4 | 8) | Self::Float(4 | 8) => {}
            Self::Unsigned(bytes) | Self::Signed(bytes) | Self::Float(bytes) => {
                return Err(format!("a number of {bytes} bytes"));
            }
            Self::List(inner) if inner.least_bytes() == 0 => return Err("a list of what takes no byte".to_owned()),
            Self::Packed(inner) if inner.width().is_none_or(|width| width == 0) => {
                return Err("packed values of no fixed width".to_owned());
            }
            Self::Symbols { least, .. } if *least > Description::LARGEST => {
                return Err(format!("{least} symbols at least"));
            }
            Self::Symbols { bits: bits @ (1 | 2 | 4), letters, .. } if letters.chars().count() == 1 << bits => {}
            Self::Symbols { bits, .. } => return Err(format!("symbols of {bits} bits whose letters are not 2^{bits}")),
            Self::Array { of, .. } if of.least_bytes() == 0 => return Err("an array of what takes no byte".to_owned()),
            Self::Array { .. } if self.least_bytes() > Description::LARGEST => {
                return Err(format!("an array of {} bytes", self.least_bytes()));
            }
            Self::Enum(one) if one.variants.is_empty() => return Err(format!("enum {} has no variant", one.name)),
            _ => {}
        }
        match self {
            Self::Struct(one) => check_defaults(&one.fields)?,
            Self::Unnamed(one) => check_defaults(std::slice::from_ref(one))?,
            Self::Enum(one) => one.variants.iter().try_for_each(|variant| match &variant.content {
                Content::Fields(fields) => check_defaults(fields),
                _ => Ok(()),
            })?,
            _ => {}
        }
        self.inner().try_for_each(|kind| kind.check(depth + 1))
    }
}

/// Whether all defaults are values of their fields; symbols and packed values have none, which may come to much.
fn check_defaults(fields: &[Field]) -> Result<(), String> {
    let is_bulky = |kind: &Kind| kind.any(&|kind| matches!(kind, Kind::Symbols { .. } | Kind::Packed(_)));
    fields.iter().try_for_each(|field| match &field.default {
        Some(default) if is_bulky(&field.kind) || bytes_of(&field.kind, default).is_none() => {
            Err(format!("the default of {} is no value of its kind", field.name))
        }
        _ => Ok(()),
    })
}

fn fields_of(fields: &[FieldShape]) -> Vec<Field> {
    fields.iter().map(field_of).collect()
}

fn field_of(field: &FieldShape) -> Field {
    let kind = Kind::of(&field.shape);
    Field {
        name: field.name.to_owned(),
        docs: field.docs.to_owned(),
        unit: field.unit.to_owned(),
        default: field.default.map(|default| default.to_json().unwrap_or_else(|| example(&kind))),
        range: Range::of(&field.range, &field.shape),
        kind,
    }
}
