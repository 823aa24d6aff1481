//! The trait, for what the standard library has.

use crate::check::each;
use crate::{Invalid, Shape};

/// A type that says what its bytes are. Derive it: `#[derive(Describe)]`, beside serde's `Serialize` and `Deserialize`; of
/// what an app of elk publishes and of what lies in that, `#[elk_bus::payload]` derives all three.
///
/// | these describe themselves | as |
/// |---|---|
/// | `()`, `bool`, `u8` to `u64`, `i8` to `i64`, `f32`, `f64`, `String` | what they are |
/// | `Option<T>`, `Box<T>`, `Vec<T>`, `[T; N]`, tuples of up to four | what they hold |
/// | structs and enums of these, nested and generic ones too, that derive it | their fields and variants |
/// | nalgebra's `Point3`, `Vector3`, `Translation3`, `Quaternion` of numbers, `UnitQuaternion<f64>`, `Isometry3<f64>`, with the feature `nalgebra` of this crate or of `elk-bus` | x, y, z; x, y, z, w; a rotation; a rotation and a translation |
///
/// Of others (`u128`, `char`, `usize`, maps, `Cow`, `Duration`, matrices) put what is meant in a field that is one of these: a
/// map as a list of pairs, a duration as seconds with `unit = "s"`. No type lies in itself: a tree is a list of nodes with the
/// numbers of their parents.
///
/// | `#[describe(…)]` on a field | says |
/// |---|---|
/// | `unit = "m"` | its unit |
/// | `range = 0.0..=1.0` | what a number may be: written out, of constants, or a constant that is a `RangeInclusive` |
/// | `longest = 64` | how many entries a list may have, how many bytes a text |
/// | `count` | that it counts, or is the number of something that is counted: below 2^48 |
/// | `check = function` | its own rule, `fn(&T) -> Result<(), Invalid>` |
/// | `default`, `default = 0.5` | that it need not be there: what it is for whoever's version of the type does not have it (see below) |
/// | `any` | that it is not looked into: floating-point numbers are finite elsewhere |
/// | `shape = …` | what its bytes are, if its type does not say it |
///
/// A field that was added with a default keeps versions of a type together: whoever has it gives it its default where a writer
/// did not have it, and whoever does not have it passes over it ([`Description::conversion_to`](crate::Description::conversion_to)).
/// `default` alone is zero, an empty list or text, no option, the first variant; else it is a literal, a variant's name as a
/// text, or a list of them. What is packed or made of symbols has no default. A default that the field could not have does not
/// compile: one of another type, or a number out of the field's range; nor does a range that is empty.
///
/// ```compile_fail
/// #[derive(elk_describe::Describe)]
/// struct Wheel {
///     #[describe(range = 0.0..=1.0, default = 2.0)]
///     grip: f64,
/// }
/// ```
///
/// ```compile_fail
/// #[derive(elk_describe::Describe)]
/// struct Gear {
///     #[describe(range = 5..=1)]
///     teeth: u8,
/// }
/// ```
///
/// Ranges travel with the type (`elk info` shows them, `elk poke` keeps them) and are no part of its layout; what `longest`,
/// `check` and [`Describe::check`] ask only those know who have the type. Every reader asks it of every value
/// that it decodes; a writer does not ask it of his own.
///
/// What no description can say does not compile either: a list of what takes no byte, types more than
/// [32](crate::Description::DEEPEST) deep in each other, names and docs of more than
/// [64 KiB](crate::Description::LONGEST), a word that is said twice.
///
/// ```compile_fail
/// #[derive(elk_describe::Describe)]
/// struct Marker;
/// #[derive(elk_describe::Describe)]
/// struct Status {
///     seen: Vec<Marker>,
/// }
/// ```
///
/// ```compile_fail
/// #[derive(elk_describe::Describe)]
/// struct Status {
///     #[describe(unit = "m", unit = "mm")]
///     far: f64,
/// }
/// ```
///
/// On a struct, `check` says a rule for all of it, asked after those of its fields; and `drawn` as what viewers of a log
/// draw it:
///
/// | `drawn =` | is drawn |
/// |---|---|
/// | `"points"` | its last list of packed points (three f32; `elk_spatial::Points`), at its first pose |
/// | `"pose"` | its first pose (`Isometry3<f64>`) |
/// | `"poses"` | its poses and points, in the order of their bytes: each `[f64; 3]` is a point, an extent has fields of its own |
/// | `"scene"` | its primitives: `elk_drawing`'s `Drawing` alone |
/// | `"voxels"` | the occupied voxels of its bricks (`elk_geometry`'s `BrickStates`), as large as its first f64 says (m) |
///
/// A mark for which there is nothing to draw does not compile.
///
/// ```compile_fail
/// #[derive(elk_describe::Describe)]
/// #[describe(drawn = "points")]
/// struct Sweep {
///     points: Vec<[f32; 3]>,
/// }
/// ```
///
/// ```compile_fail
/// #[derive(elk_describe::Describe)]
/// #[describe(drawn = "pose")]
/// struct Place {
///     x: f64,
///     y: f64,
/// }
/// ```
///
/// ```compile_fail
/// #[derive(elk_describe::Describe)]
/// #[describe(drawn = "voxels")]
/// struct Room {
///     resolution: f64,
///     voxels: Vec<[i32; 3]>,
/// }
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not say what its bytes are",
    note = "if it is a struct or an enum of your own: `#[elk_bus::payload]` on it, or `#[derive(Describe)]` of elk_describe",
    note = "if it is nalgebra's Point3, Vector3, Translation3, Quaternion, UnitQuaternion<f64> or Isometry3<f64>: turn on the \
            feature `nalgebra` of elk-bus (or of elk-describe)",
    note = "of others' types, use what describes itself: bool, u8 to u64, i8 to i64, f32, f64, String, Option, Box, Vec, \
            arrays, tuples of up to four; the documentation of `Describe` has a table"
)]
pub trait Describe {
    /// What its values are.
    const SHAPE: Shape;

    /// What every value has to keep to, whoever wrote it.
    ///
    /// # Errors
    /// The first field that does not.
    fn check(&self) -> Result<(), Invalid> {
        Ok(())
    }
}

macro_rules! plain {
    ($($type:ty: $shape:expr),* $(,)?) => {$(
        impl Describe for $type {
            const SHAPE: Shape = $shape;
        }
    )*};
}

plain! {
    (): Shape::Unit,
    bool: Shape::Bool,
    u8: Shape::Unsigned(1), u16: Shape::Unsigned(2), u32: Shape::Unsigned(4), u64: Shape::Unsigned(8),
    i8: Shape::Signed(1), i16: Shape::Signed(2), i32: Shape::Signed(4), i64: Shape::Signed(8),
    String: Shape::Text, str: Shape::Text, Box<str>: Shape::Text,
}

macro_rules! float {
    ($($type:ty: $bytes:expr),*) => {$(
        impl Describe for $type {
            const SHAPE: Shape = Shape::Float($bytes);

            fn check(&self) -> Result<(), Invalid> {
                match self.is_finite() {
                    true => Ok(()),
                    false => Err(Invalid::new("", self, "a finite number")),
                }
            }
        }
    )*};
}

float!(f32: 4, f64: 8);

impl<T: Describe + ?Sized> Describe for &T {
    const SHAPE: Shape = T::SHAPE;

    fn check(&self) -> Result<(), Invalid> {
        (**self).check()
    }
}

impl<T: Describe> Describe for Box<T> {
    const SHAPE: Shape = T::SHAPE;

    fn check(&self) -> Result<(), Invalid> {
        (**self).check()
    }
}

impl<T: Describe> Describe for Option<T> {
    const SHAPE: Shape = Shape::Option(&T::SHAPE);

    fn check(&self) -> Result<(), Invalid> {
        self.as_ref().map_or(Ok(()), T::check)
    }
}

impl<T: Describe> Describe for Vec<T> {
    const SHAPE: Shape = Shape::List(&T::SHAPE);

    fn check(&self) -> Result<(), Invalid> {
        each(self)
    }
}

impl<T: Describe, const N: usize> Describe for [T; N] {
    const SHAPE: Shape = Shape::Array(&T::SHAPE, N);

    fn check(&self) -> Result<(), Invalid> {
        each(self)
    }
}

macro_rules! tuple {
    ($($type:ident $index:tt),+) => {
        impl<$($type: Describe),+> Describe for ($($type,)+) {
            const SHAPE: Shape = Shape::Tuple(&[$($type::SHAPE),+]);

            fn check(&self) -> Result<(), Invalid> {
                $(self.$index.check().map_err(|inner| inner.within(concat!("[", $index, "]")))?;)+
                Ok(())
            }
        }
    };
}

tuple!(A 0);
tuple!(A 0, B 1);
tuple!(A 0, B 1, C 2);
tuple!(A 0, B 1, C 2, D 3);
