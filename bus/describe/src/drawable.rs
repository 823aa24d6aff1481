//! Whether there is something to draw in a type that is marked so, asserted by the compiler.

use crate::shape::{EnumShape, FieldShape, Shape, StructShape, VariantContent};

/// Does not compile for a struct in which nothing is as its mark says.
pub const fn check(one: &StructShape) {
    let fields = one.fields;
    match one.drawn.as_bytes() {
        b"points" => {
            assert!(any_field(fields, What::Points), "drawn = \"points\", and no field is packed points (three f32)")
        }
        b"pose" => assert!(any_field(fields, What::Pose), "drawn = \"pose\", and no field is a pose (Isometry3<f64>)"),
        b"poses" => assert!(
            any_field(fields, What::Pose) || any_field(fields, What::Point),
            "drawn = \"poses\", and no field is a pose (Isometry3<f64>) or a point (three f64)"
        ),
        b"voxels" => assert!(
            any_field(fields, What::Bricks) && any_field(fields, What::Double),
            "drawn = \"voxels\", and there are no bricks (elk_geometry's BrickStates) or no f64 that says how large voxels are"
        ),
        b"scene" => assert!(
            is_drawing(one.name),
            "drawn = \"scene\" is a mark of elk_drawing's Drawing, which everybody can send"
        ),
        _ => {}
    }
}

const fn is_drawing(name: &str) -> bool {
    matches!(name.as_bytes(), b"Drawing")
}

/// What is drawn.
#[derive(Clone, Copy)]
enum What {
    Points,
    Pose,
    Point,
    Bricks,
    Double,
}

/// Whether such a thing is this shape or lies in it.
const fn has(shape: &Shape, what: What) -> bool {
    if is(shape, what) {
        return true;
    }
    match shape {
        Shape::Option(inner) | Shape::List(inner) | Shape::Array(inner, _) => has(inner, what),
        Shape::Unnamed(one) => has(&one.shape, what),
        Shape::Tuple(all) => any(all, what),
        Shape::Struct(one) => any_field(one.fields, what),
        Shape::Enum(EnumShape { variants, .. }) => {
            let (mut found, mut i) = (false, 0);
            while i < variants.len() {
                found = found
                    || match &variants[i].content {
                        VariantContent::Unit => false,
                        VariantContent::One(inner) => has(inner, what),
                        VariantContent::Tuple(all) => any(all, what),
                        VariantContent::Fields(fields) => any_field(fields, what),
                    };
                i += 1;
            }
            found
        }
        _ => false,
    }
}

const fn any(all: &[Shape], what: What) -> bool {
    let (mut found, mut i) = (false, 0);
    while i < all.len() {
        found = found || has(&all[i], what);
        i += 1;
    }
    found
}

const fn any_field(fields: &[FieldShape], what: What) -> bool {
    let (mut found, mut i) = (false, 0);
    while i < fields.len() {
        found = found || has(&fields[i].shape, what);
        i += 1;
    }
    found
}

const fn is(shape: &Shape, what: What) -> bool {
    match (what, shape) {
        (What::Points, Shape::Packed(Shape::Array(Shape::Float(4), 3)))
        | (What::Point, Shape::Array(Shape::Float(8), 3))
        | (What::Double, Shape::Float(8)) => true,
        (What::Pose, Shape::Struct(StructShape { fields: [rotation, translation], .. })) => {
            matches!(rotation.shape, Shape::Rotation) && is(&translation.shape, What::Point)
        }
        (What::Bricks, Shape::Struct(StructShape { fields: [brick, cells], .. })) => {
            matches!(brick.shape, Shape::Array(Shape::Signed(2), 3)) && matches!(cells.shape, Shape::Symbols(2, ..))
        }
        _ => false,
    }
}
