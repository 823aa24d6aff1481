//! A program in any language as an app: JSON lines on its standard input and output.
//!
//! | module | one idea |
//! |---|---|
//! | [`words`] | the lines: what a program says, and what it is told |
//! | `arrays` | lists of numbers as base64, and back |
//! | `program` | the process, what waits for it, and what it has said and nobody has read |
//! | [`carried`] | what a variable carries, as the broker's table says it |
//! | [`app`] | both ends together: an app of the bus whose callbacks are lines |

pub mod app;
mod arrays;
pub mod carried;
mod program;
pub mod words;

pub use app::PipeApp;
pub use program::{Errors, Heard, Program};
pub use words::Registration;
