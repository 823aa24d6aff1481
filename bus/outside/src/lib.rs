//! What comes from outside, taken with care: files that are files, texts that a terminal can show, numbers that are times.
//!
//! Arguments, missions, worlds, logs and the names and values of other clients are made by anybody. Whoever takes them in
//! takes them through here, so that none of them hangs, floods or breaks a program.
//!
//! | module | one idea |
//! |---|---|
//! | [`checksum`] | a checksum tells one file from another |
//! | [`colour`] | colours, where a person looks |
//! | [`mod@file`] | a file is opened without waiting, and read only if it is a file, and not too large |
//! | [`keys`] | a terminal gives its keys as they are pressed, and is as before afterwards |
//! | [`screen`] | how large a terminal is |
//! | [`text`] | a text is shown without what would rule a terminal, and only as much of it as is of use |
//! | [`time`] | a number of seconds is a time only if it is one |

pub mod checksum;
pub mod colour;
pub mod file;
pub mod keys;
pub mod screen;
pub mod text;
pub mod time;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
