//! Runs strategies × worlds × starts on equal terms and says what came of it.
//!
//! | module | one idea |
//! |---|---|
//! | [`suite`] | what is to be evaluated, as a file says it |
//! | [`site`] | a world that is ready, and the missions to run in it |
//! | [`truth`] | what of a world can be known, and how much of that a map has |
//! | [`oracle`] | a short way on which a known world is seen: what all others are held against |
//! | [`stage`], [`meeting`], [`observer`] | a mission as one thread's work, where its apps meet, and what is measured of it |
//! | [`outcome`], [`tail`] | what came of a run, and what it saw late |
//! | [`pool`] | runs in parallel |
//! | [`store`] | the results' folder, and how an evaluation goes on from there |
//! | [`statistics`], [`parts`], [`table`], [`drawing`], [`evaluation`] | means, what ways are made of, tables, pictures, and all of it together |

pub mod agreement;
pub mod drawing;
pub mod evaluation;
pub mod meeting;
pub mod observer;
pub mod oracle;
pub mod outcome;
pub mod parts;
pub mod pool;
pub mod site;
pub mod stage;
pub mod statistics;
pub mod store;
pub mod suite;
pub mod table;
pub mod tail;
pub mod truth;

pub use evaluation::{Evaluation, EvaluationError, Finished, Step};
pub use outcome::{End, Outcome};
pub use site::Missions;
pub use suite::{Suite, SuiteError};
