//! Payload types, as whoever carries a value of one knows it: by name and layout, and by what its bytes are.

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use elk_describe::{Description, ReadError, Shape};

use crate::key::Payload;

/// A payload type. The layout is a hash of all that decides what its bytes mean, so two types of one name and one layout
/// are the same, whoever describes them.
#[derive(Debug, Clone, Default)]
pub struct Type {
    name: String,
    layout: u64,
    description: Option<Arc<Description>>,
}

/// A [`Type`], borrowed; or one that is compiled in.
#[derive(Debug, Clone, Copy)]
pub struct TypeRef<'a> {
    name: &'a str,
    layout: u64,
    described: Described<'a>,
}

#[derive(Debug, Clone, Copy)]
enum Described<'a> {
    Not,
    ByShape(&'static Shape),
    By(&'a Arc<Description>),
}

/// Why a value of a type cannot be shown.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ShowError {
    /// Nobody has said what its bytes are.
    #[error("nobody has described {0}: its writer says no more than its name")]
    Undescribed(String),
    /// Its bytes are not what its description says.
    #[error(transparent)]
    Bytes(#[from] ReadError),
}

impl Type {
    /// A type that somebody has described.
    pub fn described(name: &str, description: Description) -> Self {
        Self { name: name.to_owned(), layout: description.layout(), description: Some(Arc::new(description)) }
    }

    /// A type of which no more is known.
    pub fn undescribed(name: &str, layout: u64) -> Self {
        Self { name: name.to_owned(), layout, description: None }
    }

    /// What a stranger says of a type, its description as text; empty: it has none.
    ///
    /// # Errors
    /// The text describes no type, or another one than of this layout.
    pub fn from_text(name: &str, layout: u64, text: &str) -> Result<Self, String> {
        if text.is_empty() {
            return Ok(Self::undescribed(name, layout));
        }
        let description = Description::from_text(text).map_err(|refused| refused.to_string())?;
        match description.layout() {
            same if same == layout => Ok(Self::described(name, description)),
            other => Err(format!("the description of {name} is of layout {other:016x}, and not of {layout:016x}")),
        }
    }

    /// Bytes that are kept of it, about.
    pub fn kept_bytes(&self) -> usize {
        self.name.len() + self.description.as_ref().map_or(0, |description| description.kept_bytes())
    }

    /// The type where it lies.
    #[inline]
    pub fn as_ref(&self) -> TypeRef<'_> {
        let described = self.description.as_ref().map_or(Described::Not, Described::By);
        TypeRef { name: &self.name, layout: self.layout, described }
    }
}

impl<'a> TypeRef<'a> {
    /// A type that is compiled in.
    pub const fn of<T: Payload>() -> TypeRef<'static> {
        TypeRef { name: T::NAME, layout: T::LAYOUT, described: Described::ByShape(&T::SHAPE) }
    }

    /// A type of which no more is known.
    pub const fn undescribed(name: &'a str, layout: u64) -> Self {
        Self { name, layout, described: Described::Not }
    }

    /// The type's name.
    pub fn name(&self) -> &'a str {
        self.name
    }

    /// The hash of all that decides what its bytes mean.
    pub fn layout(&self) -> u64 {
        self.layout
    }

    /// Whether it is the type that `T` is here.
    pub fn is<T: Payload>(&self) -> bool {
        self.layout == T::LAYOUT && self.name == T::NAME
    }

    /// As what viewers draw its values (see [`elk_describe::Describe`]); empty: as nothing.
    pub fn drawn(&self) -> &'a str {
        match self.described {
            Described::ByShape(Shape::Struct(one)) => one.drawn,
            Described::By(description) => description.drawn(),
            _ => "",
        }
    }

    /// Whether it is known what its bytes are.
    pub fn is_described(&self) -> bool {
        !matches!(self.described, Described::Not)
    }

    /// What its bytes are, if that is known.
    pub fn description(&self) -> Option<Cow<'a, Description>> {
        match self.described {
            Described::Not => None,
            Described::ByShape(shape) => Some(Cow::Owned(Description::of(shape))),
            Described::By(description) => Some(Cow::Borrowed(description)),
        }
    }

    /// Where this type, a writer's, and what `T` is here differ, for people.
    pub(crate) fn difference<T: Payload>(&self) -> String {
        let difference = self.difference_to(TypeRef::of::<T>(), ["there", "here"]);
        difference.unwrap_or_else(|| format!("layout {:016x} there and {:016x} here", self.layout, T::LAYOUT))
    }

    /// Where two types of one name differ, for people, if both are described; `whose` are the words for where each is.
    pub(crate) fn difference_to(&self, other: TypeRef<'_>, whose: [&str; 2]) -> Option<String> {
        if self.name != other.name {
            return None;
        }
        self.description()?.difference(&*other.description()?, whose)
    }

    /// The description as it travels; empty if there is none.
    pub fn text(&self) -> String {
        self.description().map(|description| description.to_text()).unwrap_or_default()
    }

    /// Bytes of a value as JSON; lists with more than `longest` entries are counted instead.
    ///
    /// # Errors
    /// The type is not described, or the bytes are no value of it.
    pub fn to_json(&self, bytes: &[u8], longest: usize) -> Result<serde_json::Value, ShowError> {
        let description = self.description().ok_or_else(|| ShowError::Undescribed(self.to_string()))?;
        Ok(description.to_json(bytes, longest)?)
    }

    /// The same type, owned.
    pub fn to_type(&self) -> Type {
        let description = match self.described {
            Described::Not => None,
            Described::ByShape(shape) => Some(Arc::new(Description::of(shape))),
            Described::By(description) => Some(Arc::clone(description)),
        };
        Type { name: self.name.to_owned(), layout: self.layout, description }
    }
}

impl PartialEq for TypeRef<'_> {
    fn eq(&self, other: &Self) -> bool {
        (self.name, self.layout) == (other.name, other.layout)
    }
}

impl PartialEq for Type {
    fn eq(&self, other: &Self) -> bool {
        self.as_ref() == other.as_ref()
    }
}

impl Eq for Type {}

impl fmt::Display for TypeRef<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (layout {:016x})", self.name, self.layout)
    }
}

impl fmt::Display for Type {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_ref().fmt(f)
    }
}
