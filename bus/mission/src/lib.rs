//! Mission files: XML turned into checked apps and parameters, from one table of app types.
//!
//! [`AppType`] is a row of that table; every crate of apps brings its own rows, and a [`Registry`] holds them all. A
//! [`Mission`] is a file that was held against the registry: behind it, nothing has to be checked again.
//!
//! | an app's attribute | means |
//! |---|---|
//! | `type` | one of the element's types |
//! | `exec`, `args` | any other executable instead, with its arguments |
//! | `name` | its name in the mission and on the bus; the element's, numbered, if not said |
//! | `restart` | `never` (default): its death fails the mission; `on-failure`: it is started again |
//! | any other | a parameter, as if it were a child element |

mod describe;
mod draft;
mod mission;
mod nearest;
mod params;
mod problem;
mod registry;
mod resolve;
mod scenario;
mod setting;
mod spec;
mod value;
mod wiring;

pub use describe::describe;
pub use mission::{AppSpec, Mission, MissionError, Mode, Program, Restart};
pub use nearest::{instead, nearest};
pub use params::{ParamValue, Params};
pub use problem::{Place, Problem, Problems};
pub use registry::Registry;
pub use setting::{Override, OverrideError};
pub use spec::{AppType, Kind, MOOS_HOST, MOOS_PORT, ParamSpec};
pub use value::ValueError;
