//! Mission files: XML turned into checked apps and parameters, from one table of app types.

mod spec;

pub use spec::{AppType, Kind, ParamSpec, ParamValue, Params};
