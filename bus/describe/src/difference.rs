//! Where two definitions of a type differ.

use std::fmt;

use crate::Description;
use crate::description::{Content, Enum, Field, Kind};
use crate::json::joined;

impl Description {
    /// The first place in which what bytes mean differs between two definitions, for people; none: they are the same.
    /// `whose` are the words for where each is: "there" and "here".
    pub fn difference(&self, other: &Self, whose: [&str; 2]) -> Option<String> {
        Words { whose }.differ("", self.kind(), other.kind())
    }
}

struct Words<'a> {
    whose: [&'a str; 2],
}

impl Words<'_> {
    fn differ(&self, field: &str, one: &Kind, other: &Kind) -> Option<String> {
        let inner = |one: &Kind, other: &Kind| self.differ(&format!("{field}[]"), one, other);
        match (one, other) {
            (Kind::Struct(one), Kind::Struct(other)) if one.name == other.name => {
                self.fields(field, &one.fields, &other.fields)
            }
            (Kind::Enum(one), Kind::Enum(other)) if one.name == other.name => self.variants(field, one, other),
            (Kind::Option(one), Kind::Option(other)) => self.differ(field, one, other),
            (Kind::List(one), Kind::List(other)) | (Kind::Packed(one), Kind::Packed(other)) => inner(one, other),
            (Kind::Array { of: one, count }, Kind::Array { of: other, count: same }) if count == same => {
                inner(one, other)
            }
            (Kind::Tuple(one), Kind::Tuple(other)) if one.len() == other.len() => self.tuples(field, one, other),
            _ if one == other => None,
            _ => Some(self.said(field, one, other)),
        }
    }

    /// `field` is `one` in the one definition and `other` in the other.
    fn said(&self, field: &str, one: impl fmt::Display, other: impl fmt::Display) -> String {
        let field = if field.is_empty() { "it" } else { field };
        format!("{field} is {one} {} and {other} {}", self.whose[0], self.whose[1])
    }

    fn fields(&self, field: &str, one: &[Field], other: &[Field]) -> Option<String> {
        let lacks = |all: &[Field], name: &str| !all.iter().any(|field| field.name == name);
        let only = |name: &str, has: usize| {
            format!("{} is {} and not {}", joined(field, name), self.whose[has], self.whose[1 - has])
        };
        if let Some(first) = one.iter().find(|field| lacks(other, &field.name)) {
            return Some(only(&first.name, 0));
        }
        if let Some(first) = other.iter().find(|field| lacks(one, &field.name)) {
            return Some(only(&first.name, 1));
        }
        one.iter().zip(other).enumerate().find_map(|(i, (one, other))| {
            if one.name != other.name {
                return Some(self.said(&format!("field {} of {}", i + 1, named(field)), &one.name, &other.name));
            }
            let field = joined(field, &one.name);
            let unit = |unit: &str| if unit.is_empty() { "without a unit".to_owned() } else { format!("in {unit}") };
            match one.unit == other.unit {
                true => self.differ(&field, &one.kind, &other.kind),
                false => Some(self.said(&field, unit(&one.unit), unit(&other.unit))),
            }
        })
    }

    fn variants(&self, field: &str, one: &Enum, other: &Enum) -> Option<String> {
        let mut pairs = one.variants.iter().zip(&other.variants).enumerate();
        let found = pairs.find_map(|(i, (one, other))| {
            if one.name != other.name {
                return Some(self.said(&format!("variant {} of {}", i + 1, named(field)), &one.name, &other.name));
            }
            let field = joined(field, &one.name);
            match (&one.content, &other.content) {
                (Content::One(one), Content::One(other)) => self.differ(&field, one, other),
                (Content::Tuple(one), Content::Tuple(other)) if one.len() == other.len() => {
                    self.tuples(&field, one, other)
                }
                (Content::Fields(one), Content::Fields(other)) => self.fields(&field, one, other),
                (one, other) if one == other => None,
                _ => Some(self.said(&field, "one thing", "another")),
            }
        });
        let count = |one: &Enum| format!("one of {} variants", one.variants.len());
        found.or_else(|| {
            (one.variants.len() != other.variants.len()).then(|| self.said(field, count(one), count(other)))
        })
    }

    fn tuples(&self, field: &str, one: &[Kind], other: &[Kind]) -> Option<String> {
        let mut pairs = one.iter().zip(other).enumerate();
        pairs.find_map(|(i, (one, other))| self.differ(&format!("{field}[{i}]"), one, other))
    }
}

fn named(field: &str) -> &str {
    if field.is_empty() { "it" } else { field }
}

/// As people write a type.
impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unit => f.write_str("()"),
            Self::Bool => f.write_str("bool"),
            Self::Unsigned(bytes) => write!(f, "u{}", 8 * u32::from(*bytes)),
            Self::Signed(bytes) => write!(f, "i{}", 8 * u32::from(*bytes)),
            Self::Float(bytes) => write!(f, "f{}", 8 * u32::from(*bytes)),
            Self::Rotation => f.write_str("rotation"),
            Self::Text => f.write_str("text"),
            Self::Option(inner) => write!(f, "{inner}?"),
            Self::List(inner) | Self::Packed(inner) => write!(f, "[{inner}]"),
            Self::Symbols { letters, .. } => write!(f, "text of {letters}"),
            Self::Array { of, count } => write!(f, "[{of}; {count}]"),
            Self::Tuple(all) => {
                let all: Vec<String> = all.iter().map(ToString::to_string).collect();
                write!(f, "({})", all.join(", "))
            }
            Self::Struct(one) => f.write_str(&one.name),
            Self::Enum(one) => f.write_str(&one.name),
        }
    }
}
