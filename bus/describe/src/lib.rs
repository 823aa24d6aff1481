//! Types that describe themselves: what each field is called, what it is, in which unit, and what it means.
//!
//! A type derives [`Describe`]. Its [`Shape`] is a constant: hashed by the compiler it tells definitions apart
//! ([`Shape::layout`]), and turned into a [`Description`] it travels to whoever has never seen the type, who then reads its
//! bytes as JSON and writes JSON as its bytes.
//!
//! ```
//! use elk_describe::{Describe, Description};
//!
//! /// Where the robot is heading.
//! #[derive(Describe)]
//! struct Heading {
//!     /// Anticlockwise from x.
//!     #[describe(unit = "rad", range = -4.0..=4.0)]
//!     yaw: f64,
//!     /// Whether somebody steers.
//!     steered: bool,
//! }
//!
//! let description = Description::of(&Heading::SHAPE);
//! let bytes = description.to_bytes(&serde_json::json!({"yaw": 1.5, "steered": true}))?;
//! assert_eq!(bytes, [&1.5f64.to_le_bytes()[..], &[1]].concat());
//! assert_eq!(description.to_json(&bytes, usize::MAX)?["yaw"], 1.5);
//! assert!(Heading { yaw: 100.0, steered: true }.check().is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The bytes are those of bincode with little-endian integers of fixed width, as serde's derive has bincode write them:
//! fields one after another, lists and texts behind their length (u64), an option behind a byte, a variant behind its
//! number (u32). A type that has serde attributes which change that cannot be described.

mod check;
mod conversion;
mod cursor;
mod default;
mod describe;
mod description;
mod difference;
mod drawable;
mod field_range;
#[cfg(feature = "nalgebra")]
mod geometry;
mod json;
mod origin;
mod range;
mod read;
mod shape;
mod sound;
mod visit;
mod write;

pub use check::{Invalid, MAX_COUNT};
pub use conversion::Conversion;
pub use describe::Describe;
pub use description::{Content, Description, Enum, Field, Kind, Struct, Variant};
pub use difference::Difference;
pub use elk_describe_derive::Describe;
#[doc(hidden)]
pub use elk_describe_derive::payload;
pub use origin::Refused;
pub use range::Range;
pub use read::ReadError;
pub use shape::{
    DefaultValue, EnumShape, FieldShape, Limit, RangeShape, Shape, StructShape, VariantContent, VariantShape,
};
pub use write::{WriteError, shown};

#[doc(hidden)]
pub mod derived {
    //! What the derive's code calls.
    pub use crate::check::{count, each, field, longest, range};
    pub use crate::default::default_of;
    pub use crate::range::range_with;
    pub use crate::sound::sound;
}

extern crate self as elk_describe;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
