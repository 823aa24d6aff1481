//! Typed keys: what a key's binary value is, checked by the compiler on both ends.

use std::borrow::Cow;
use std::io::{BufRead, BufReader};
use std::marker::PhantomData;

use serde::{Deserialize, Serialize};

/// A type that can be the binary value of a key.
///
/// `View<'a>` is what a receiver gets: for most types the type itself, for bulky ones a borrow of the bytes in shared
/// memory. Implement it with [`payload!`](crate::payload), which derives name and layout from the definition.
pub trait Payload {
    /// The type's name as it is shown to people and checked by receivers.
    const NAME: &'static str;
    /// A hash of the type's fields in order; two definitions that differ do not decode each other's bytes.
    const LAYOUT: u64;
    /// What is encoded and decoded; borrows from the received bytes where it can.
    type View<'a>: Serialize + Deserialize<'a>;

    /// What every value of this type has to keep to, whoever wrote it. Decoding asks it, so that nothing behind it has to.
    ///
    /// # Errors
    /// The first field that does not.
    fn check(_view: &Self::View<'_>) -> Result<(), Invalid> {
        Ok(())
    }
}

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
}

/// The name of a variable of the community together with the type of its value.
pub struct Key<T: Payload> {
    name: Cow<'static, str>,
    payload: PhantomData<fn() -> T>,
}

impl<T: Payload> Key<T> {
    /// A key known at compile time.
    pub const fn new(name: &'static str) -> Self {
        Self { name: Cow::Borrowed(name), payload: PhantomData }
    }

    /// A key whose name comes from a mission file.
    pub fn named(name: impl Into<String>) -> Self {
        Self { name: Cow::Owned(name.into()), payload: PhantomData }
    }

    /// The key's name.
    pub fn name(&self) -> &str {
        &self.name
    }
}

impl<T: Payload> Clone for Key<T> {
    fn clone(&self) -> Self {
        Self { name: self.name.clone(), payload: PhantomData }
    }
}

impl<T: Payload> std::fmt::Debug for Key<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({})", self.name, T::NAME)
    }
}

/// FNV-1a, usable in constants: the layout hash of [`payload!`](crate::payload).
pub const fn fnv1a(text: &str) -> u64 {
    fnv1a_on(0xcbf2_9ce4_8422_2325, text.as_bytes())
}

/// Goes on with [`fnv1a`], whose value so far is `hash`, over more bytes: what is hashed in pieces is hashed as a whole.
const fn fnv1a_on(mut hash: u64, bytes: &[u8]) -> u64 {
    let mut i = 0;
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u64).wrapping_mul(0x0100_0000_01b3);
        i += 1;
    }
    hash
}

/// [`fnv1a`] of a file's bytes, however many they are.
///
/// # Errors
/// It cannot be read, or is no ordinary file.
pub fn fnv1a_of_file(path: &std::path::Path) -> std::io::Result<u64> {
    let mut file = BufReader::new(elk_outside::file::open(path)?);
    let mut hash = fnv1a("");
    loop {
        let bytes = file.fill_buf()?;
        if bytes.is_empty() {
            return Ok(hash);
        }
        hash = fnv1a_on(hash, bytes);
        let count = bytes.len();
        file.consume(count);
    }
}

/// Defines structs (or enums, through `impl`) that travel as binary values.
///
/// ```
/// elk_bus::payload! {
///     /// Where the robot is heading.
///     #[derive(Debug, Clone, PartialEq)]
///     pub struct Heading {
///         /// Radians, anticlockwise from x.
///         pub yaw: f64,
///     }
/// }
/// # use elk_bus::Payload;
/// assert_eq!(Heading::NAME, "Heading");
/// ```
///
/// A struct that is `checked by` a function (see [`Payload::check`]) is decoded only if that finds nothing wrong:
///
/// ```
/// use elk_bus::key::Invalid;
///
/// elk_bus::payload! {
///     /// How fast the robot is.
///     pub struct Speed checked by plausible {
///         /// Metres a second.
///         pub ahead: f64,
///     }
/// }
///
/// fn plausible(speed: &Speed) -> Result<(), Invalid> {
///     match speed.ahead.abs() <= 50.0 {
///         true => Ok(()),
///         false => Err(Invalid::new("ahead", speed.ahead, "at most 50 m/s")),
///     }
/// }
/// ```
#[macro_export]
macro_rules! payload {
    ($($(#[$meta:meta])* pub struct $name:ident $(checked by $check:path)? { $($(#[$field_meta:meta])* pub $field:ident : $ty:ty),* $(,)? })+) => {$(
        $(#[$meta])*
        #[derive($crate::serde::Serialize, $crate::serde::Deserialize)]
        #[serde(crate = "::elk_bus::serde")]
        pub struct $name { $($(#[$field_meta])* pub $field: $ty),* }

        impl $crate::Payload for $name {
            const NAME: &'static str = stringify!($name);
            const LAYOUT: u64 = $crate::fnv1a(concat!(stringify!($name), $(" ", stringify!($field), ":", stringify!($ty)),*));
            type View<'a> = $name;

            $(fn check(view: &$name) -> ::core::result::Result<(), $crate::key::Invalid> {
                $check(view)
            })?
        }
    )+};
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_of_a_file_is_fnv_1a() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("world.obj");
        std::fs::write(&path, "foobar").unwrap();
        assert_eq!(fnv1a_of_file(&path).unwrap(), 0x8594_4171_f739_67e8, "as its authors give it");
        // Longer than what is read at once.
        let long = "v 0 0 0\n".repeat(5000);
        std::fs::write(&path, &long).unwrap();
        assert_eq!(fnv1a_of_file(&path).unwrap(), fnv1a(&long));
        assert!(fnv1a_of_file(folder.path()).is_err() && fnv1a_of_file(std::path::Path::new("/dev/zero")).is_err());
    }
}
