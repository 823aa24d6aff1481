//! What a field is for whoever's version of the type does not have it.

use serde_json::Value;

use crate::shape::{DefaultValue, EnumShape, Shape, VariantContent, VariantShape};

/// The default of a field of such a shape; one that is none does not compile.
pub const fn default_of(shape: &Shape, value: DefaultValue) -> Option<DefaultValue> {
    assert!(shape.takes(&value), "the default is no value of the field's type");
    Some(value)
}

impl DefaultValue {
    /// As a description has it; `None`: whatever is zero there.
    pub(crate) fn to_json(self) -> Option<Value> {
        Some(match self {
            Self::Zero => return None,
            Self::Bool(flag) => flag.into(),
            Self::Integer(number) => i64::try_from(number).map_or((number as u64).into(), Value::from),
            Self::Float(number) => number.into(),
            Self::Text(text) => text.into(),
            Self::List(all) => all.iter().map(|one| one.to_json()).collect::<Option<_>>()?,
        })
    }
}

impl Shape {
    /// Whether this is a value of such a shape. Symbols and packed values have no default.
    const fn takes(&self, value: &DefaultValue) -> bool {
        match (self, value) {
            (Self::Symbols(..) | Self::Packed(_), _) => false,
            (_, DefaultValue::Zero) | (Self::Bool, DefaultValue::Bool(_)) | (Self::Text, DefaultValue::Text(_)) => true,
            // Every literal is finite as an f64; as an f32 it need not be.
            (Self::Float(bytes), DefaultValue::Float(number)) => *bytes == 8 || (*number as f32).is_finite(),
            (Self::Float(_), DefaultValue::Integer(_)) => true,
            (Self::Unsigned(bytes), DefaultValue::Integer(number)) => {
                *number >= 0 && *number < 1 << (8 * *bytes as u32)
            }
            (Self::Signed(bytes), DefaultValue::Integer(number)) => {
                let end = 1i128 << (8 * *bytes as u32 - 1);
                *number >= -end && *number < end
            }
            (Self::Enum(EnumShape { variants, .. }), DefaultValue::Text(name)) => has_unit(variants, name),
            (Self::Option(inner), value) => inner.takes(value),
            (Self::List(inner), DefaultValue::List(all)) => all_are(inner, all),
            (Self::Array(inner, count), DefaultValue::List(all)) => all.len() == *count && all_are(inner, all),
            (Self::Tuple(shapes), DefaultValue::List(all)) => {
                let (mut right, mut i) = (shapes.len() == all.len(), 0);
                while right && i < all.len() {
                    right = shapes[i].takes(&all[i]);
                    i += 1;
                }
                right
            }
            _ => false,
        }
    }
}

const fn all_are(inner: &Shape, all: &[DefaultValue]) -> bool {
    let (mut right, mut i) = (true, 0);
    while right && i < all.len() {
        right = inner.takes(&all[i]);
        i += 1;
    }
    right
}

const fn has_unit(variants: &[VariantShape], name: &str) -> bool {
    let mut i = 0;
    while i < variants.len() {
        if matches!(variants[i].content, VariantContent::Unit) && is_same(variants[i].name, name) {
            return true;
        }
        i += 1;
    }
    false
}

const fn is_same(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let (mut same, mut i) = (one.len() == other.len(), 0);
    while same && i < one.len() {
        same = one[i] == other[i];
        i += 1;
    }
    same
}
