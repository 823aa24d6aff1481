//! What a shape has to keep to so that its description can travel, asserted by the compiler: the same that is asked of a
//! description from outside (see [`Description::from_text`]).

use crate::shape::{DefaultValue, EnumShape, FieldShape, Shape, VariantContent, VariantShape};
use crate::{Description, drawable};

/// How deep serde_json reads: a struct's field lies four deep in its description.
const DEEPEST_JSON: usize = 127;

/// The shape of a type, if a description of it can travel; else the type does not compile.
pub const fn sound(shape: Shape) -> Shape {
    assert!(depth(&shape, false) <= Description::DEEPEST, "types lie more than 32 deep in each other");
    assert!(depth(&shape, true) <= DEEPEST_JSON, "types lie too deep in each other for a description of them");
    assert!(length(&shape) <= Description::LONGEST, "names and docs are longer than the 64 KiB of a description");
    check(&shape);
    if let Shape::Struct(one) = &shape {
        drawable::check(one);
    }
    shape
}

const fn check(shape: &Shape) {
    match shape {
        Shape::Unsigned(bytes) | Shape::Signed(bytes) => {
            assert!(matches!(bytes, 1 | 2 | 4 | 8), "no width of an integer")
        }
        Shape::Float(bytes) => assert!(matches!(bytes, 4 | 8), "no width of a floating-point number"),
        Shape::List(inner) => {
            assert!(least_bytes(inner) > 0, "a list of what takes no byte: nothing bounds how long it is");
            check(inner);
        }
        Shape::Array(inner, _) => {
            assert!(least_bytes(inner) > 0, "an array of what takes no byte");
            assert!(least_bytes(shape) <= Description::LARGEST, "an array of more than 16 MiB");
            check(inner);
        }
        Shape::Packed(inner) => {
            assert!(has_width(inner) && least_bytes(inner) > 0, "packed values of no fixed width");
            check(inner);
        }
        Shape::Symbols(bits, letters, least) => {
            assert!(matches!(bits, 1 | 2 | 4) && letters.len() >= 1 << *bits, "symbols without a letter for each");
            assert!(*least as u64 <= Description::LARGEST, "more than 16 Mi symbols at least");
        }
        Shape::Enum(EnumShape { variants, .. }) => {
            assert!(!variants.is_empty(), "an enum without a variant has no value")
        }
        _ => {}
    }
    let (mut i, parts) = (0, parts(shape));
    while i < parts {
        check(part(shape, i));
        i += 1;
    }
}

/// How many shapes lie in this one by themselves: in a tuple, a struct, or an enum.
const fn parts(shape: &Shape) -> usize {
    match shape {
        Shape::Option(_) | Shape::Unnamed(_) => 1,
        Shape::Tuple(all) => all.len(),
        Shape::Struct(one) => one.fields.len(),
        Shape::Enum(EnumShape { variants, .. }) => {
            let (mut count, mut i) = (0, 0);
            while i < variants.len() {
                count += held(&variants[i].content);
                i += 1;
            }
            count
        }
        _ => 0,
    }
}

const fn part(shape: &Shape, index: usize) -> &Shape {
    match shape {
        Shape::Option(inner) => inner,
        Shape::Unnamed(one) => &one.shape,
        Shape::Tuple(all) => &all[index],
        Shape::Struct(one) => &one.fields[index].shape,
        Shape::Enum(EnumShape { variants, .. }) => {
            let (mut i, mut left) = (0, index);
            while left >= held(&variants[i].content) {
                left -= held(&variants[i].content);
                i += 1;
            }
            content(&variants[i].content, left)
        }
        _ => panic!("nothing lies in it by itself"),
    }
}

const fn held(content: &VariantContent) -> usize {
    match content {
        VariantContent::Unit => 0,
        VariantContent::One(_) => 1,
        VariantContent::Tuple(all) => all.len(),
        VariantContent::Fields(fields) => fields.len(),
    }
}

const fn content(content: &VariantContent, index: usize) -> &Shape {
    match content {
        VariantContent::Unit => panic!("nothing lies in it"),
        VariantContent::One(inner) => inner,
        VariantContent::Tuple(all) => &all[index],
        VariantContent::Fields(fields) => &fields[index].shape,
    }
}

/// How deep shapes lie in this one; or their descriptions, as JSON.
const fn depth(shape: &Shape, json: bool) -> usize {
    let (step, mut deepest) = match shape {
        Shape::List(inner) | Shape::Packed(inner) => (1, depth(inner, json)),
        Shape::Array(inner, _) => (2, depth(inner, json)),
        Shape::Option(_) => (1, 0),
        Shape::Tuple(_) | Shape::Unnamed(_) | Shape::Symbols(..) => (2, 0),
        Shape::Struct(_) => (4, 0),
        Shape::Enum(..) => (7, 0),
        Shape::Unsigned(_) | Shape::Signed(_) | Shape::Float(_) => (1, 0),
        _ => (0, 0),
    };
    let (mut i, parts) = (0, parts(shape));
    while i < parts {
        let inner = depth(part(shape, i), json);
        deepest = if inner > deepest { inner } else { deepest };
        i += 1;
    }
    let lies_in = parts > 0 || matches!(shape, Shape::List(_) | Shape::Packed(_) | Shape::Array(..));
    deepest + if json { step } else { lies_in as usize }
}

/// The least number of bytes that a value takes.
const fn least_bytes(shape: &Shape) -> u64 {
    match shape {
        Shape::Unit => 0,
        Shape::Bool | Shape::Option(_) => 1,
        Shape::Unsigned(bytes) | Shape::Signed(bytes) | Shape::Float(bytes) => *bytes as u64,
        Shape::Rotation => 32,
        Shape::Text | Shape::List(_) | Shape::Packed(_) | Shape::Symbols(..) => 8,
        Shape::Array(inner, count) => least_bytes(inner).saturating_mul(*count as u64),
        Shape::Unnamed(one) => least_bytes(&one.shape),
        Shape::Enum(EnumShape { variants, .. }) => 4 + least_content(variants),
        Shape::Tuple(_) | Shape::Struct(_) => {
            let (mut sum, mut i, parts) = (0u64, 0, parts(shape));
            while i < parts {
                sum = sum.saturating_add(least_bytes(part(shape, i)));
                i += 1;
            }
            sum
        }
    }
}

const fn least_content(variants: &[VariantShape]) -> u64 {
    let (mut least, mut i) = (if variants.is_empty() { 0 } else { u64::MAX - 4 }, 0);
    while i < variants.len() {
        let (mut sum, mut at) = (0u64, 0);
        while at < held(&variants[i].content) {
            sum = sum.saturating_add(least_bytes(content(&variants[i].content, at)));
            at += 1;
        }
        least = if sum < least { sum } else { least };
        i += 1;
    }
    least
}

/// Whether all values take the same number of bytes.
const fn has_width(shape: &Shape) -> bool {
    match shape {
        Shape::Text | Shape::Option(_) | Shape::List(_) | Shape::Packed(_) | Shape::Symbols(..) | Shape::Enum(..) => {
            false
        }
        Shape::Array(inner, _) => has_width(inner),
        _ => {
            let (mut all, mut i, parts) = (true, 0, parts(shape));
            while i < parts {
                all = all && has_width(part(shape, i));
                i += 1;
            }
            all
        }
    }
}

/// The most bytes that a shape's description takes as JSON.
const fn length(shape: &Shape) -> usize {
    match shape {
        Shape::Option(inner) | Shape::List(inner) | Shape::Packed(inner) => 12 + length(inner),
        Shape::Symbols(_, letters, _) => 64 + text(letters),
        Shape::Array(inner, _) => 48 + length(inner),
        Shape::Unnamed(one) => 16 + field(one),
        Shape::Struct(one) => 64 + text(one.name) + text(one.docs) + text(one.drawn) + fields(one.fields),
        Shape::Enum(EnumShape { name, docs, variants }) => {
            let (mut sum, mut i) = (72 + text(name) + text(docs), 0);
            while i < variants.len() {
                sum += variant(&variants[i]);
                i += 1;
            }
            sum
        }
        Shape::Tuple(all) => 16 + lengths(all),
        _ => 16,
    }
}

const fn lengths(all: &[Shape]) -> usize {
    let (mut sum, mut i) = (0, 0);
    while i < all.len() {
        sum += 1 + length(&all[i]);
        i += 1;
    }
    sum
}

const fn variant(variant: &VariantShape) -> usize {
    let content = match &variant.content {
        VariantContent::Unit => 0,
        VariantContent::One(inner) => length(inner),
        VariantContent::Tuple(all) => lengths(all),
        VariantContent::Fields(all) => fields(all),
    };
    64 + text(variant.name) + text(variant.docs) + content
}

const fn fields(all: &[FieldShape]) -> usize {
    let (mut sum, mut i) = (0, 0);
    while i < all.len() {
        sum += field(&all[i]);
        i += 1;
    }
    sum
}

const fn field(field: &FieldShape) -> usize {
    let default = match &field.default {
        Some(value) => default(value),
        None => 0,
    };
    160 + text(field.name) + text(field.docs) + text(field.unit) + default + length(&field.shape)
}

const fn default(value: &DefaultValue) -> usize {
    match value {
        DefaultValue::Text(said) => text(said),
        DefaultValue::List(all) => {
            let (mut sum, mut i) = (2, 0);
            while i < all.len() {
                sum += 1 + default(&all[i]);
                i += 1;
            }
            sum
        }
        _ => 32,
    }
}

/// A text as JSON has it: in quotes, with what is escaped.
const fn text(text: &str) -> usize {
    let (bytes, mut sum, mut i) = (text.as_bytes(), 2, 0);
    while i < bytes.len() {
        sum += match bytes[i] {
            b'"' | b'\\' => 2,
            0..0x20 => 6,
            _ => 1,
        };
        i += 1;
    }
    sum
}
