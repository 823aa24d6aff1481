//! What keys a type's fields have, and which of its values are rows of numbers.

use std::collections::BTreeSet;

use elk_describe::{Content, Field, Kind};

/// The key of the variable, and of the time.
pub const NAME: &str = "Name";
pub const TIME: &str = "Time";
/// The key of a value that is no struct.
pub const VALUE: &str = "Value";

/// The key of a field: each word of its name with a capital.
pub fn key(field: &str) -> String {
    field
        .split('_')
        .flat_map(|word| {
            let mut letters = word.chars();
            letters.next().map(|first| first.to_uppercase().chain(letters).collect::<String>())
        })
        .collect()
}

/// What two ways of writing a key have in common.
pub fn plain(key: &str) -> String {
    key.chars().filter(|letter| *letter != '_').flat_map(char::to_lowercase).collect()
}

/// A key behind that which leads to it.
pub fn joined(way: &str, key: &str) -> String {
    if way.is_empty() { key.to_owned() } else { format!("{way}.{key}") }
}

/// Whether a type has a field at its top that goes by this key.
pub fn has_field(kind: &Kind, key: &str) -> bool {
    matches!(kind.plain(), Kind::Struct(one) if one.fields.iter().any(|field| plain(&field.name) == plain(key)))
}

/// How many numbers a value always is, if it is nothing else.
pub fn width(kind: &Kind) -> Option<usize> {
    match kind {
        Kind::Unsigned(_) | Kind::Signed(_) | Kind::Float(_) => Some(1),
        Kind::Rotation => Some(4),
        Kind::Array { of, count } => width(of)?.checked_mul(usize::try_from(*count).ok()?).filter(|width| *width > 0),
        Kind::Tuple(kinds) => sum(kinds.iter()),
        Kind::Struct(one) => sum(one.fields.iter().map(|field| &field.kind)),
        Kind::Unnamed(one) => width(&one.kind),
        _ => None,
    }
}

fn sum<'a>(mut kinds: impl Iterator<Item = &'a Kind>) -> Option<usize> {
    kinds.try_fold(0usize, |sum, kind| sum.checked_add(width(kind)?)).filter(|width| *width > 0)
}

/// Whether every name in a type can be a key, and no two of one place are the same there.
///
/// # Errors
/// Which is not.
pub fn check(kind: &Kind) -> Result<(), String> {
    match kind {
        Kind::Unnamed(one) => check(&one.kind),
        Kind::Option(inner) => check(inner),
        Kind::Struct(one) => fields(&one.fields),
        Kind::Enum(one) => {
            names(one.variants.iter().map(|variant| variant.name.as_str()))?;
            one.variants.iter().try_for_each(|variant| match &variant.content {
                Content::Unit | Content::Tuple(_) => Ok(()),
                Content::One(inner) => check(inner),
                Content::Fields(inner) => fields(inner),
            })
        }
        _ => Ok(()),
    }
}

fn fields(fields: &[Field]) -> Result<(), String> {
    names(fields.iter().map(|field| field.name.as_str()))?;
    fields.iter().try_for_each(|field| check(&field.kind))
}

fn names<'a>(names: impl Iterator<Item = &'a str>) -> Result<(), String> {
    let mut taken = BTreeSet::new();
    for name in names {
        if plain(name).is_empty() || !name.chars().all(|letter| letter.is_alphanumeric() || letter == '_') {
            return Err(format!("{name:?} cannot be a key"));
        }
        if !taken.insert(plain(name)) {
            return Err(format!("another name is the same key as {name}"));
        }
    }
    Ok(())
}
