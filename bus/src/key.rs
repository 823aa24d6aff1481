//! Typed keys: what a key's binary value is, checked by the compiler on both ends.

use std::borrow::Cow;
use std::io::{BufRead, BufReader};
use std::marker::PhantomData;

use elk_describe::{Describe, Shape};
use serde::{Deserialize, Serialize};

/// A type that can be the binary value of a key: see [`payload`](crate::payload), which implements it.
pub trait Payload {
    /// The type's name as it is shown to people and checked by receivers.
    const NAME: &'static str;
    /// What is encoded and decoded: for most types the type itself, for bulky ones a borrow of the bytes in shared memory.
    type View<'a>: Describe + Serialize + Deserialize<'a>;
    /// What its bytes are.
    const SHAPE: Shape = <Self::View<'static> as Describe>::SHAPE;
    /// A hash of [`Payload::SHAPE`], however deep: definitions that differ do not decode each other's bytes.
    const LAYOUT: u64 = Self::SHAPE.layout();
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

/// FNV-1a, usable in constants.
const fn fnv1a(text: &str) -> u64 {
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

/// FNV-1a of a file's bytes, however many they are.
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
