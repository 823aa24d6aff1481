//! A walk through a value's bytes.

use crate::cursor::Cursor;
use crate::description::Kind;
use crate::{Description, ReadError};

impl Description {
    /// Walks through a value in the order of its bytes, and has `see` look at every value in it whose length is plain:
    /// those of one width, texts, packed values and symbols, each with its bytes (of the last three without their length).
    /// `see` says whether it has seen enough of a value; else it is shown what lies in it.
    ///
    /// # Errors
    /// The bytes are none of the type.
    pub fn visit<'a>(&self, bytes: &'a [u8], see: &mut impl FnMut(&Kind, &'a [u8]) -> bool) -> Result<(), ReadError> {
        let mut walk = Walk { at: Cursor(bytes), see };
        walk.value(self.kind()).map_err(|reason| ReadError {
            type_name: self.name().to_owned(),
            field: String::new(),
            reason,
        })
    }
}

/// Goes past a value.
pub fn skip(at: &mut Cursor<'_>, kind: &Kind) -> Result<(), String> {
    let mut walk = Walk { at: Cursor(at.0), see: &mut |_: &Kind, _: &[u8]| true };
    walk.value(kind)?;
    at.0 = walk.at.0;
    Ok(())
}

struct Walk<'a, 's, S> {
    at: Cursor<'a>,
    see: &'s mut S,
}

impl<'a, S: FnMut(&Kind, &'a [u8]) -> bool> Walk<'a, '_, S> {
    fn value(&mut self, kind: &Kind) -> Result<(), String> {
        let kind = kind.plain();
        if let Some(width) = kind.width() {
            let here = self.at.0;
            let bytes = self.at.take(width)?;
            if !(self.see)(kind, bytes) {
                let behind = std::mem::replace(&mut self.at.0, here);
                self.inner(kind)?;
                self.at.0 = behind;
            }
            return Ok(());
        }
        self.inner(kind)
    }

    /// What lies in a value.
    fn inner(&mut self, kind: &Kind) -> Result<(), String> {
        match kind {
            Kind::Unit | Kind::Bool | Kind::Unsigned(_) | Kind::Signed(_) | Kind::Float(_) | Kind::Rotation => Ok(()),
            Kind::Text | Kind::Packed(_) | Kind::Symbols { .. } => {
                let length = self.at.length()?;
                let bytes = self.at.take(length)?;
                (self.see)(kind, bytes);
                Ok(())
            }
            Kind::Option(inner) => match self.at.unsigned(1)? {
                0 => Ok(()),
                _ => self.value(inner),
            },
            Kind::List(inner) => {
                let count = self.at.length()?;
                (0..count).try_for_each(|_| self.value(inner))
            }
            Kind::Array { of, count } => (0..*count).try_for_each(|_| self.value(of)),
            Kind::Tuple(_) | Kind::Unnamed(_) | Kind::Struct(_) => kind.inner().try_for_each(|kind| self.value(kind)),
            Kind::Enum(one) => {
                let number = self.at.unsigned(4)? as usize;
                let variant = one.variants.get(number);
                let variant = variant.ok_or_else(|| format!("{} has no variant {number}", one.name))?;
                variant.content.inner().try_for_each(|kind| self.value(kind))
            }
        }
    }
}
