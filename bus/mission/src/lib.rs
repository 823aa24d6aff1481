//! Mission files: XML turned into checked apps and parameters, from one table of app types.
//!
//! [`AppType`] is a row of that table; every crate of apps brings its own rows, and a [`Registry`] holds them all. A
//! [`Mission`] is a file that was held against the registry: behind it, nothing has to be checked again.
//!
//! | an app's attribute | means |
//! |---|---|
//! | `type` | one of the element's types |
//! | `exec`, `args` | any other executable instead, with its arguments ([`split_arguments`]) |
//! | `pipe` | a program with its arguments that reads and writes lines (`elk pipe`) |
//! | `moos` | `true`: the executable of `exec` is one of MOOS'; a `.moos` file: and what that says is told it as well |
//! | `name` | its name in the mission and on the bus; the element's, numbered, if not said |
//! | `restart` | `never` (default): its death fails the mission; `on-failure`, `always`: it is started again |
//! | `restarts`, `restart-window` | how often within how many seconds (5 in 60); once more, and the mission fails |
//! | `health` | without a sign of life for so many seconds it is killed; `off`: it may be silent |
//! | any other | a parameter, as if it were a child element |
//!
//! A Scenario has `name`, `type` (`auto` or `manual`), `version`, `community`, `launch-pause`, and, for its broker, which is always started again,
//! `broker-restarts`, `broker-window`, `mailbox` and `time-warp`; on an app they are an error. Its `<Bus moos="127.0.0.1:9000"/>` lets
//! MOOS' own clients in (`from`, `sources`, `texts`: see `elk types`), and so do an app's `MOOSHost` and `MOOSPort`.
//!
//! While a mission runs, an app can be exchanged for one of another type, or another executable:
//! [`AppSpec::exchange_among`] holds that against the same registry, and against the other apps.

mod antler;
mod arguments;
mod bus;
mod describe;
mod draft;
mod effective;
pub mod element;
mod exchange;
mod executable;
mod kind;
mod mission;
mod moos;
mod name;
mod nearest;
mod outside_app;
mod params;
mod policy;
mod preflight;
mod problem;
mod registry;
mod resolve;
mod scenario;
mod setting;
mod source;
mod spec;
mod value;
pub mod variables;
mod wiring;
mod xml;

pub use arguments::{ArgumentsError, join_arguments, split_arguments};
pub use describe::{describe, describe_params};
pub use exchange::{Exchange, Exchanged};
pub use kind::{Kind, ParamSpec, joined};
pub use mission::MissionError;
pub use moos::MoosServer;
pub use name::is_app_name;
pub use nearest::{instead, nearest};
pub use outside_app::{OutsideApp, type_name};
pub use params::{ParamValue, Params};
pub use policy::{Policy, Restart};
pub use preflight::NotReady;
pub use problem::{Location, Problem, Problems};
pub use registry::Registry;
pub use setting::{Override, OverrideError};
pub use spec::{AppSpec, AppType, Mission, Mode, Preflight, PreflightReport, Program, Via, is_moos_file};
pub use value::{ValueError, expanded};
pub use xml::crowded;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
