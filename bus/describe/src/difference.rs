//! Where two versions of a type differ.

use std::fmt;

use crate::description::Kind;

/// The first place in which two versions of a type differ so that values of the one cannot be read as values of the other
/// (see [`Description::conversion_to`](crate::Description::conversion_to)).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// The field, with its way from the outermost value; empty: it is that value itself.
    field: String,
    how: How,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum How {
    /// Only the one (0) or the other (1) has it.
    Only(usize),
    /// What it is in the one, and in the other.
    Are([String; 2]),
}

impl Difference {
    pub(crate) fn only(field: String, which: usize) -> Self {
        Self { field, how: How::Only(which) }
    }

    pub(crate) fn of(field: &str, one: impl fmt::Display, other: impl fmt::Display) -> Self {
        Self { field: field.to_owned(), how: How::Are([one.to_string(), other.to_string()]) }
    }

    /// The same for people; `whose` are the words for where the one and the other version are: "there" and "here".
    pub fn in_words(&self, whose: [&str; 2]) -> String {
        let [there, here] = whose;
        let field = if self.field.is_empty() { "it" } else { &self.field };
        match &self.how {
            How::Only(0) => format!("{field} is {there} and not {here}"),
            How::Only(_) => format!("{field} is {here} and not {there}"),
            How::Are([one, other]) => format!("{field} is {one} {there} and {other} {here}"),
        }
    }
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
            Self::Unnamed(one) => write!(f, "{}{}{}", one.kind, if one.unit.is_empty() { "" } else { " " }, one.unit),
            Self::Struct(one) => f.write_str(&one.name),
            Self::Enum(one) => f.write_str(&one.name),
        }
    }
}
