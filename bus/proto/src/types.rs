//! Payload types, as whoever carries a value of one knows it: by name and layout, and by what its bytes are.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use elk_describe::{Conversion, Description, Difference, ReadError, Shape};

use crate::key::Payload;

/// A payload type. The layout is a hash of all that decides what its bytes mean, so two types of one name and one layout
/// are the same, whoever describes them.
#[derive(Debug, Clone, Default)]
pub struct Type {
    name: String,
    layout: u64,
    known: Option<Arc<Known>>,
}

/// What is known of a type that somebody else has compiled in.
#[derive(Debug)]
struct Known {
    description: Description,
    /// How its values become those of the versions that are read in this program, by their layouts.
    read_as: Mutex<BTreeMap<u64, Arc<Result<Conversion, Difference>>>>,
}

impl Known {
    fn of(description: Description) -> Arc<Self> {
        Arc::new(Self { description, read_as: Mutex::default() })
    }

    /// How its values become those of the version that `T` is: worked out once.
    fn as_version<T: Payload>(&self) -> Arc<Result<Conversion, Difference>> {
        let mut read_as = self.read_as.lock().unwrap_or_else(PoisonError::into_inner);
        let work_out = || Arc::new(self.description.conversion_to(&Description::of(&T::SHAPE)));
        Arc::clone(read_as.entry(T::LAYOUT).or_insert_with(work_out))
    }
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
    By(&'a Arc<Known>),
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

/// Why a value cannot be had as one of another version of its type.
#[derive(Debug)]
pub(crate) enum ConvertError {
    /// The versions differ there.
    Differs(String),
    /// The bytes are not what their description says.
    Bytes(ReadError),
}

impl From<ReadError> for ConvertError {
    fn from(error: ReadError) -> Self {
        Self::Bytes(error)
    }
}

impl Type {
    /// A type that somebody has described.
    pub fn described(name: &str, description: Description) -> Self {
        Self { name: name.to_owned(), layout: description.layout(), known: Some(Known::of(description)) }
    }

    /// A type of which no more is known.
    pub fn undescribed(name: &str, layout: u64) -> Self {
        Self { name: name.to_owned(), layout, known: None }
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
        self.name.len() + self.known.as_ref().map_or(0, |known| known.description.kept_bytes())
    }

    /// The type where it lies.
    #[inline]
    pub fn as_ref(&self) -> TypeRef<'_> {
        let described = self.known.as_ref().map_or(Described::Not, Described::By);
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
            Described::By(known) => known.description.drawn(),
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
            Described::By(known) => Some(Cow::Borrowed(&known.description)),
        }
    }

    /// A value of this type, a writer's, as one of the version of it that `T` is here; `whose` are the words for where the one
    /// and the other version are.
    ///
    /// # Errors
    /// Where they differ, if that is more than fields with defaults; or the bytes are no value of the type.
    pub(crate) fn convert<T: Payload>(
        &self,
        bytes: &[u8],
        whose: impl FnOnce() -> [String; 2],
    ) -> Result<Vec<u8>, ConvertError> {
        let of_no_use = |difference: Option<&Difference>| {
            let [there, here] = &whose();
            let layouts = || format!("layout {:016x} {there} and {:016x} {here}", self.layout, T::LAYOUT);
            ConvertError::Differs(difference.map_or_else(layouts, |difference| difference.in_words([there, here])))
        };
        let compiled_in;
        let known = match self.described {
            Described::Not => return Err(of_no_use(None)),
            Described::ByShape(shape) => {
                compiled_in = Known::of(Description::of(shape));
                &compiled_in
            }
            Described::By(known) => known,
        };
        match &*known.as_version::<T>() {
            Ok(conversion) => Ok(conversion.convert(bytes)?),
            Err(difference) => Err(of_no_use(Some(difference))),
        }
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
        let known = match self.described {
            Described::Not => None,
            Described::ByShape(shape) => Some(Known::of(Description::of(shape))),
            Described::By(known) => Some(Arc::clone(known)),
        };
        Type { name: self.name.to_owned(), layout: self.layout, known }
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
