//! A shape that travels: what somebody who has never seen a type knows of it.

use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use crate::range::Range;
use crate::shape::Fnv;

/// What a type's bytes are, as it travels and is kept in logs: as JSON, in which it reads like the type's definition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Description(pub(crate) Kind);

/// What a value is; see [`Shape`](crate::Shape), which this mirrors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "Shape says it")]
pub enum Kind {
    Unit,
    Bool,
    Unsigned(u8),
    Signed(u8),
    Float(u8),
    Rotation,
    Text,
    Option(Box<Kind>),
    List(Box<Kind>),
    Packed(Box<Kind>),
    Symbols { bits: u8, letters: String, least: u64 },
    Array { of: Box<Kind>, count: u64 },
    Tuple(Vec<Kind>),
    Unnamed(Box<Field>),
    Struct(Struct),
    Enum(Enum),
}

/// A struct.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Struct {
    /// The type's name.
    pub name: String,
    /// What it means.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub docs: String,
    /// As what viewers draw its values (see [`crate::Describe`]); empty: as nothing.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub drawn: String,
    /// Its fields, in the order of their bytes.
    pub fields: Vec<Field>,
}

/// An enum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Enum {
    /// The type's name.
    pub name: String,
    /// What it means.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub docs: String,
    /// Its variants, in the order of their numbers.
    pub variants: Vec<Variant>,
}

/// A field of a struct, or of a tuple or a variant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Field {
    /// Its name; empty if it has none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// What it means.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub docs: String,
    /// Its unit; empty if it has none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// What it is for whoever's version of the type does not have it; `None`: it has to be there.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "said")]
    pub default: Option<Value>,
    /// What its number may be.
    #[serde(default, skip_serializing_if = "Range::is_all")]
    pub range: Range,
    /// What it is.
    pub kind: Kind,
}

/// A default that is said, `null` too.
fn said<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Value>, D::Error> {
    Value::deserialize(deserializer).map(Some)
}

/// A variant of an enum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Variant {
    /// Its name.
    pub name: String,
    /// What it means.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub docs: String,
    /// What follows its number.
    #[serde(default, skip_serializing_if = "Content::is_unit")]
    pub content: Content,
}

/// What a variant holds.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Content {
    /// Nothing.
    #[default]
    Unit,
    /// A value without a name.
    One(Box<Kind>),
    /// Several.
    Tuple(Vec<Kind>),
    /// Fields.
    Fields(Vec<Field>),
}

impl Content {
    fn is_unit(&self) -> bool {
        *self == Self::Unit
    }

    /// The kinds of what it holds.
    pub(crate) fn inner(&self) -> Box<dyn Iterator<Item = &Kind> + '_> {
        match self {
            Self::Unit => Box::new(std::iter::empty()),
            Self::One(inner) => Box::new(std::iter::once(&**inner)),
            Self::Tuple(all) => Box::new(all.iter()),
            Self::Fields(fields) => Box::new(fields.iter().map(|field| &field.kind)),
        }
    }
}

impl Description {
    /// The longest description that is read (bytes of JSON).
    pub const LONGEST: usize = 1 << 16;
    /// How deep types lie in each other at most.
    pub const DEEPEST: usize = 32;
    /// The most bytes that every value of a type may take: what arrays in arrays come to.
    pub const LARGEST: u64 = 1 << 24;

    /// What the values are.
    pub fn kind(&self) -> &Kind {
        &self.0
    }

    /// The name of the struct or enum that is described; empty if it is neither.
    pub fn name(&self) -> &str {
        match self.0.plain() {
            Kind::Struct(one) => &one.name,
            Kind::Enum(one) => &one.name,
            _ => "",
        }
    }

    /// What the type means, if it says so.
    pub fn docs(&self) -> &str {
        match &self.0 {
            Kind::Struct(one) => &one.docs,
            Kind::Enum(one) => &one.docs,
            Kind::Unnamed(one) => &one.docs,
            _ => "",
        }
    }

    /// As what viewers draw the values; empty: as nothing.
    pub fn drawn(&self) -> &str {
        if let Kind::Struct(one) = self.0.plain() { &one.drawn } else { "" }
    }

    /// The hash of everything that decides what the bytes mean: [`Shape::layout`](crate::Shape::layout) of the shape that it is of.
    pub fn layout(&self) -> u64 {
        self.0.layout()
    }

    /// Bytes that are kept of it, about.
    pub fn kept_bytes(&self) -> usize {
        self.0.kept_bytes()
    }

    /// Whether its values are made to be many bytes, and not to be read: packed values and symbols.
    pub fn is_bulky(&self) -> bool {
        self.0.any(&|kind| matches!(kind, Kind::Packed(_) | Kind::Symbols { .. }))
    }
}

impl Kind {
    /// What the bytes are, without what is said of them where they have no name.
    pub fn plain(&self) -> &Self {
        if let Self::Unnamed(one) = self { one.kind.plain() } else { self }
    }

    /// Whether a value can be `null`, so that an option of it has to be told from one without a value.
    pub(crate) fn may_be_null(&self) -> bool {
        matches!(self.plain(), Kind::Unit | Kind::Option(_))
    }

    /// The hash of everything that decides what the bytes mean.
    pub(crate) fn layout(&self) -> u64 {
        self.hash(Fnv::new()).0
    }

    /// As [`Shape::layout`](crate::Shape::layout) has it.
    fn hash(&self, fnv: Fnv) -> Fnv {
        match self {
            Self::Unit => fnv.text("unit"),
            Self::Bool => fnv.text("bool"),
            Self::Unsigned(bytes) => fnv.text("u").byte(*bytes),
            Self::Signed(bytes) => fnv.text("i").byte(*bytes),
            Self::Float(bytes) => fnv.text("f").byte(*bytes),
            Self::Rotation => fnv.text("rotation"),
            Self::Text => fnv.text("text"),
            Self::Option(inner) => inner.hash(fnv.text("option")),
            Self::List(inner) => inner.hash(fnv.text("list")),
            Self::Packed(inner) => inner.hash(fnv.text("packed")),
            Self::Symbols { bits, letters, least } => {
                fnv.text("symbols").byte(*bits).text(letters).count(*least as usize)
            }
            Self::Array { of, count } => of.hash(fnv.text("array").count(*count as usize)),
            Self::Tuple(inner) => hash_all(inner, fnv.text("tuple")),
            Self::Unnamed(one) if one.unit.is_empty() => one.kind.hash(fnv),
            Self::Unnamed(one) => one.kind.hash(fnv.text("unnamed").text(&one.unit)),
            Self::Struct(one) => hash_fields(&one.fields, fnv.text("struct").text(&one.name)),
            Self::Enum(one) => {
                let fnv = fnv.text("enum").text(&one.name).count(one.variants.len());
                one.variants.iter().fold(fnv, |fnv, variant| {
                    let fnv = fnv.text(&variant.name);
                    match &variant.content {
                        Content::Unit => fnv.text("unit"),
                        Content::One(one) => one.hash(fnv.text("one")),
                        Content::Tuple(all) => hash_all(all, fnv.text("tuple")),
                        Content::Fields(fields) => hash_fields(fields, fnv.text("fields")),
                    }
                })
            }
        }
    }

    /// The kinds that lie in this one, one level down.
    pub(crate) fn inner(&self) -> Box<dyn Iterator<Item = &Self> + '_> {
        match self {
            Self::Option(inner) | Self::List(inner) | Self::Packed(inner) | Self::Array { of: inner, .. } => {
                Box::new(std::iter::once(&**inner))
            }
            Self::Tuple(all) => Box::new(all.iter()),
            Self::Unnamed(one) => Box::new(std::iter::once(&one.kind)),
            Self::Struct(one) => Box::new(one.fields.iter().map(|field| &field.kind)),
            Self::Enum(one) => Box::new(one.variants.iter().flat_map(|variant| variant.content.inner())),
            _ => Box::new(std::iter::empty()),
        }
    }

    fn kept_bytes(&self) -> usize {
        let default = |one: &Field| one.default.as_ref().map_or(0, |default| default.to_string().len());
        let field = |one: &Field| size_of::<Field>() + one.name.len() + one.docs.len() + one.unit.len() + default(one);
        let variant = |one: &Variant| {
            let fields = if let Content::Fields(fields) = &one.content { fields.as_slice() } else { &[] };
            size_of::<Variant>() + one.name.len() + one.docs.len() + fields.iter().map(field).sum::<usize>()
        };
        let words = match self {
            Self::Unnamed(one) => field(one),
            Self::Struct(one) => one.name.len() + one.docs.len() + one.fields.iter().map(field).sum::<usize>(),
            Self::Enum(one) => one.name.len() + one.docs.len() + one.variants.iter().map(variant).sum::<usize>(),
            _ => 0,
        };
        size_of::<Self>() + words + self.inner().map(Self::kept_bytes).sum::<usize>()
    }

    /// Whether this kind, or one in it, is such a one.
    pub(crate) fn any(&self, is: &impl Fn(&Self) -> bool) -> bool {
        is(self) || self.inner().any(|kind| kind.any(is))
    }

    /// The least number of bytes that a value takes: what bounds the length of a list by the bytes that are there.
    pub(crate) fn least_bytes(&self) -> u64 {
        let sum =
            |kinds: Box<dyn Iterator<Item = &Self> + '_>| kinds.map(Self::least_bytes).fold(0, u64::saturating_add);
        match self {
            Self::Unit => 0,
            Self::Bool | Self::Option(_) => 1,
            Self::Unsigned(bytes) | Self::Signed(bytes) | Self::Float(bytes) => u64::from(*bytes),
            Self::Rotation => 32,
            Self::Text | Self::List(_) | Self::Packed(_) | Self::Symbols { .. } => 8,
            Self::Array { of, count } => of.least_bytes().saturating_mul(*count),
            Self::Tuple(_) | Self::Unnamed(_) | Self::Struct(_) => sum(self.inner()),
            Self::Enum(one) => 4 + one.variants.iter().map(|variant| sum(variant.content.inner())).min().unwrap_or(0),
        }
    }

    /// The number of bytes that every value takes, if it is the same for all.
    pub(crate) fn width(&self) -> Option<u64> {
        match self {
            Self::Unit => Some(0),
            Self::Bool => Some(1),
            Self::Unsigned(bytes) | Self::Signed(bytes) | Self::Float(bytes) => Some(u64::from(*bytes)),
            Self::Rotation => Some(32),
            Self::Array { of, count } => of.width()?.checked_mul(*count),
            Self::Tuple(_) | Self::Unnamed(_) | Self::Struct(_) => {
                self.inner().try_fold(0u64, |sum, kind| sum.checked_add(kind.width()?))
            }
            _ => None,
        }
    }
}

fn hash_all(all: &[Kind], fnv: Fnv) -> Fnv {
    all.iter().fold(fnv.count(all.len()), |fnv, kind| kind.hash(fnv))
}

fn hash_fields(fields: &[Field], fnv: Fnv) -> Fnv {
    let one = |fnv: Fnv, field: &Field| field.kind.hash(fnv.text(&field.name).text(&field.unit));
    fields.iter().fold(fnv.count(fields.len()), one)
}
