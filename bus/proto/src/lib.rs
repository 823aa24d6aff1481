//! What clients and broker of a community say to each other, and the broker that answers.
//!
//! Nothing here reads a clock, starts a thread or opens a file: a transport carries the bytes, and whoever drives this says
//! what time it is.
//!
//! | module | one idea |
//! |---|---|
//! | [`wire`] | frames: what lies in a batch between client and broker |
//! | [`broker`] | the broker as a state machine |
//! | [`host`] | what the broker's decisions mean for clients' endpoints, the same for all transports |
//! | [`link`] | what a transport gives a client |
//! | [`names`], [`seen`], [`outbox`] | a client's own state: what numbers stand for, what it has heard, what it may have to say again |
//! | [`mail`], [`rejection`] | a message as a client gets it, and why it may be of no use |
//! | [`key`], [`value`], [`types`], [`codec`] | typed keys, the three kinds of value, what a type is, its encoding |
//! | [`community`], [`pattern`] | names of communities, wildcards |
//!
//! Apps are written against `elk-bus`, which has all of this under its own name.

// `#[payload]` names elk-bus, which everybody else writes it for; here this crate stands in its place.
extern crate self as elk_bus;

pub mod broker;
mod clock_setting;
pub mod codec;
pub mod community;
pub mod host;
pub mod key;
pub mod link;
pub mod mail;
pub mod names;
pub mod outbox;
pub mod pattern;
pub mod rejection;
pub mod seen;
pub mod types;
pub mod value;
pub mod wire;

pub use clock_setting::ClockSetting;
/// What `#[payload]` derives besides.
pub use elk_describe as describe;
use elk_describe::payload;
pub use key::{Key, Payload};
/// What `#[payload]` derives.
pub use serde;
