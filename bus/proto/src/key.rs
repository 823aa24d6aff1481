//! Typed keys: what a key's binary value is, checked by the compiler on both ends.

use std::borrow::Cow;
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
