//! What a value has to keep to, whoever wrote it.

use std::fmt::Display;
use std::ops::{Bound, RangeBounds};

use crate::Describe;
use crate::range::words;

/// A field of a value that decodes but cannot be true.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} is {found}; it has to be {wanted}")]
pub struct Invalid {
    /// The field, with its way from the outermost value: `motion.clearance_m`, `points[3]`.
    pub field: String,
    /// What it is.
    pub found: String,
    /// What it would have to be, with the unit.
    pub wanted: String,
}

impl Invalid {
    /// A field that is `found` where `wanted` is right.
    pub fn new(field: impl Into<String>, found: impl std::fmt::Display, wanted: impl Into<String>) -> Self {
        Self { field: field.into(), found: found.to_string(), wanted: wanted.into() }
    }

    /// The same, of what lies in `field`; a value without a name has its content's way.
    #[must_use]
    pub fn within(self, field: &str) -> Self {
        if field.is_empty() {
            return self;
        }
        let joint = if self.field.is_empty() || self.field.starts_with('[') { "" } else { "." };
        Self { field: format!("{field}{joint}{}", self.field), ..self }
    }
}

/// Checks a field.
pub fn field<T: Describe + ?Sized>(name: &str, value: &T) -> Result<(), Invalid> {
    value.check().map_err(|inner| inner.within(name))
}

/// Checks the entries of a list.
pub fn each<'a, T: Describe + 'a>(all: impl IntoIterator<Item = &'a T>) -> Result<(), Invalid> {
    let mut all = all.into_iter().enumerate();
    all.try_for_each(|(i, one)| one.check().map_err(|inner| inner.within(&format!("[{i}]"))))
}

/// Checks that a number lies in a range.
pub fn range<T: PartialOrd + Display>(
    name: &str,
    value: &T,
    range: impl RangeBounds<T>,
    unit: &str,
) -> Result<(), Invalid> {
    if range.contains(value) {
        return Ok(());
    }
    use Bound::{Excluded, Included, Unbounded};
    let least = match range.start_bound() {
        Included(least) | Excluded(least) => Some(least),
        Unbounded => None,
    };
    let wanted = match range.end_bound() {
        Included(most) => words(least, Some(most), None),
        Excluded(end) => words(least, None, Some(end)),
        Unbounded => words(least, None, None),
    };
    Err(Invalid::new(name, value, format!("{wanted} {unit}").trim_end()))
}

/// The largest count, number or revision: one more never overflows, and a double holds it exactly.
pub const MAX_COUNT: u64 = (1 << 48) - 1;

/// Checks a count, or the number of something that is counted, if there is one.
pub fn count(name: &str, value: impl Into<Option<u64>>) -> Result<(), Invalid> {
    match value.into() {
        Some(value) if value > MAX_COUNT => Err(Invalid::new(name, value, "below 2^48")),
        _ => Ok(()),
    }
}

/// Checks how long a list or a text is.
pub fn longest(name: &str, found: usize, most: usize) -> Result<(), Invalid> {
    match found <= most {
        true => Ok(()),
        false => Err(Invalid::new(name, format!("{found} long"), format!("at most {most} long"))),
    }
}
