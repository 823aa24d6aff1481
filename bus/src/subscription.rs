//! What a client wants to hear, and how: said in one breath, to [`Comms::register`](crate::Comms::register) and to a table of
//! [`Handlers`](crate::Handlers) alike.
//!
//! | said as | which messages | what a handler is given |
//! |---|---|---|
//! | `&KEY` | those of a typed key | the decoded value |
//! | [`number`]`("STEP")` | those of a variable that carries numbers | an `f64` |
//! | [`text`]`("MOTION")` | those of a variable that carries texts | a `&str` |
//! | `"NAV_*"`, [`any`]`("NAV_*")` | those of all variables that match, whatever they carry | the [`Mail`] |
//!
//! ```
//! use std::time::Duration;
//! use elk_bus::{BrokerConfig, Client, Clock, Community, any, memory::MemoryBroker, number};
//!
//! # let community = Community::new("doc")?;
//! # let broker = MemoryBroker::new(BrokerConfig::new("doc"), Clock::new(1.0));
//! # let mut client = Client::over(broker.connect("reader")?, "reader", &community);
//! client.comms.register("GREETING")?;
//! client.comms.register(number("NAV_X").every(Duration::from_millis(100)))?;
//! client.comms.register(any("*_ERROR").from("Logger").lossless())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::marker::PhantomData;
use std::time::Duration;

use crate::failure::AppError;
use crate::key::{Key, Payload};
use crate::mail::Mail;
use crate::pattern::{is_literal, matches};
use crate::types::TypeRef;

/// What a client wants to hear, read as `R` says.
pub struct Subscription<R> {
    pub(crate) terms: Terms,
    reads: PhantomData<fn() -> R>,
}

/// A subscription without what the compiler knows of it.
#[derive(Debug, Clone)]
pub(crate) struct Terms {
    pub keys: String,
    pub sources: String,
    pub interval: Duration,
    pub lossless: bool,
    pub carries: Carries,
}

/// What a subscription says that its variables carry.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Carries {
    Anything,
    Numbers,
    Texts,
    Values(TypeRef<'static>),
}

impl Terms {
    /// Whether it is about a message of this variable from this source.
    pub fn fits(&self, key: &str, source: &str) -> bool {
        // Mostly a row names one variable, of whomever.
        let fits = |pattern: &str, name: &str| {
            pattern == "*" || pattern == name || !is_literal(pattern) && matches(pattern, name)
        };
        fits(&self.keys, key) && fits(&self.sources, source)
    }
}

impl<R> Subscription<R> {
    fn new(keys: &str, carries: Carries) -> Self {
        let terms = Terms {
            keys: keys.to_owned(),
            sources: "*".to_owned(),
            interval: Duration::ZERO,
            lossless: false,
            carries,
        };
        Self { terms, reads: PhantomData }
    }

    /// Only what comes from sources whose names match `sources`: `*` is any run of characters, `?` a single one.
    pub fn from(mut self, sources: &str) -> Self {
        sources.clone_into(&mut self.terms.sources);
        self
    }

    /// At most one message of a variable in this time (of the community's clock); the last one of a burst always comes.
    pub fn every(mut self, interval: Duration) -> Self {
        self.terms.interval = interval;
        self
    }

    /// Messages are taken as they come, also those that are not what was registered for.
    pub fn as_it_comes(self) -> Subscription<Any> {
        Subscription { terms: self.terms, reads: PhantomData }
    }

    /// Nothing is dropped: publishers wait if this client does not keep up, as long as it goes on reading.
    pub fn lossless(mut self) -> Self {
        self.terms.lossless = true;
        self
    }
}

/// The variable `key`, which carries numbers.
pub fn number(key: &str) -> Subscription<Number> {
    Subscription::new(key, Carries::Numbers)
}

/// The variable `key`, which carries texts.
pub fn text(key: &str) -> Subscription<Text> {
    Subscription::new(key, Carries::Texts)
}

/// All variables whose names match `keys`, those to come included, whatever they carry: `*` is any run of characters, `?` a
/// single one.
pub fn any(keys: &str) -> Subscription<Any> {
    Subscription::new(keys, Carries::Anything)
}

/// What can be registered for.
pub trait Subscribe {
    /// How its messages are read.
    type As: Reads;
    /// As a subscription, to which more can be said.
    fn subscription(self) -> Subscription<Self::As>;
}

impl<R: Reads> Subscribe for Subscription<R> {
    type As = R;
    fn subscription(self) -> Self {
        self
    }
}

impl<T: Payload> Subscribe for &Key<T> {
    type As = Typed<T>;
    fn subscription(self) -> Subscription<Typed<T>> {
        Subscription::new(self.name(), Carries::Values(TypeRef::of::<T>()))
    }
}

impl Subscribe for &str {
    type As = Any;
    fn subscription(self) -> Subscription<Any> {
        any(self)
    }
}

impl Subscribe for &String {
    type As = Any;
    fn subscription(self) -> Subscription<Any> {
        any(self)
    }
}

/// How a message is read.
pub trait Reads {
    /// What there is to read in it; bulky parts stay where they lie.
    type View<'a>;
    /// Reads it.
    ///
    /// # Errors
    /// A [`DecodeError`](crate::DecodeError) or a [`Rejection`](crate::Rejection): it is something else.
    fn read<'a>(mail: &Mail<'a>) -> Result<Self::View<'a>, AppError>;
}

/// Read as the value of a `Key<T>`.
pub struct Typed<T>(PhantomData<fn() -> T>);
/// Read as a number.
pub struct Number;
/// Read as a text.
pub struct Text;
/// Taken as it comes.
pub struct Any;

impl<T: Payload> Reads for Typed<T> {
    type View<'a> = T::View<'a>;
    fn read<'a>(mail: &Mail<'a>) -> Result<T::View<'a>, AppError> {
        Ok(mail.decode_as::<T>()?)
    }
}

impl Reads for Number {
    type View<'a> = f64;
    fn read<'a>(mail: &Mail<'a>) -> Result<f64, AppError> {
        Ok(mail.number()?)
    }
}

impl Reads for Text {
    type View<'a> = &'a str;
    fn read<'a>(mail: &Mail<'a>) -> Result<&'a str, AppError> {
        Ok(mail.text()?)
    }
}

impl Reads for Any {
    type View<'a> = Mail<'a>;
    fn read<'a>(mail: &Mail<'a>) -> Result<Mail<'a>, AppError> {
        Ok(*mail)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subscription_is_about_what_its_patterns_match() {
        let fits = |subscription: Subscription<Any>, key, source| subscription.terms.fits(key, source);
        assert!(fits(any("NAV_X"), "NAV_X", "gps") && !fits(any("NAV_X"), "NAV_XY", "gps"));
        assert!(fits(any("NAV_*").from("g?s"), "NAV_XY", "gps") && !fits(any("NAV_*").from("g?s"), "NAV_X", "ins"));
        assert!(fits(any("*"), "anything", "anybody"));
    }
}
