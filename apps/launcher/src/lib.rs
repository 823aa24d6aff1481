//! Starts a mission's broker and apps as processes, watches over them, sums up.
//!
//! The rooms, each of which names only those below it:
//!
//! | room | one concern |
//! |---|---|
//! | `launch` | a launch from the checked mission to the finished run, and picking one up again |
//! | `mission_run` | one run of a mission, from the start of its broker to the end of its last app |
//! | `terminal` | the launcher's terminal: Enter and Ctrl-C, what is shown meanwhile, giving the terminal back |
//! | `backend` | what carries a mission out: processes, or threads of this process |
//! | `run` | what a run leaves behind: its folder, what it was made of, what it came to, and how it is picked up |
//! | `reports` | what the mission says of itself on the bus, and the thread that hears it |
//! | `control` | orders to a running mission: `elk apps`, `elk swap`, … |
//! | `process` | one process that inherits nothing and ends for certain, and all that descends from it |
//! | `supervisor` | who is to run, who does, and what to do about it: a state machine without processes, bus or clock |
//! | `error` | why a launch failed |

mod backend;
mod control;
mod error;
mod launch;
mod mission_run;
mod process;
mod reports;
mod run;
mod supervisor;
mod terminal;

pub use control::{Answer, AppRow, AskError, Order, ask};
pub use error::LaunchError;
pub use launch::{AttachOptions, FinishedRun, LaunchOptions, attach, launch, run_folder, running_mission};
pub use process::guard::{StandbyGuard, guard};
pub use process::handle;
pub use process::leftovers::end_leftovers;
pub use reports::steps::{Spread, StepTimes};
pub use run::folder::create as create_run_folder;
pub use run::provenance::{RerunError, is_run, mission_of_run};
pub use run::summary::Summary;
pub use terminal::detach::wait_until_begun;
