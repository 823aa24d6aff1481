//! What carries out a mission: a broker and apps, whether they are processes or threads.

pub(crate) mod environment;
pub(crate) mod processes;
pub(crate) mod threads;

use std::collections::BTreeSet;
use std::time::Duration;

use rustix::event::PollFd;

use crate::control::{AppRow, Order};
use crate::error::LaunchError;
use crate::reports::listener::Join;
use crate::reports::observer::{Losses, News};
use crate::run::launch_state::LaunchState;
use crate::supervisor::{Ticket, Word};

/// A broker and the apps of a mission.
pub(crate) trait Backend {
    /// How the launcher joins the broker's community under `name`.
    fn join(&self, name: &str) -> Join;

    /// Starts the broker.
    fn start_broker(&mut self) -> Result<(), LaunchError>;

    /// Starts the apps that `which` chooses, by element and name.
    fn start_apps(&mut self, which: &dyn Fn(&str, &str) -> bool) -> Result<(), LaunchError>;

    /// Whether every app but the loggers has ended of its own accord.
    fn all_over(&self) -> bool;

    /// Those that were started and have not registered; `clients` are those of the community.
    fn missing(&self, clients: &BTreeSet<String>) -> Vec<String>;

    /// Takes note of what was heard on the bus: news, and who was heard at all.
    fn hear(&mut self, news: &[News], signs: &BTreeSet<String>);

    /// Sees that everyone who was started is still there. Whoever may be started again is; anyone else's end is the
    /// mission's.
    fn check(&mut self, when: &'static str) -> Result<(), LaunchError>;

    /// What has to be watched for something to happen to anyone.
    fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>);

    /// How long nothing has to be done unless something happens.
    fn patience(&self) -> Option<Duration>;

    /// What is to be told to the person at the terminal; each thing once.
    fn sayings(&mut self) -> Vec<String>;

    /// Takes an order that concerns an app; how it goes is in [`Backend::words`].
    fn order(&mut self, ticket: Ticket, order: Order);

    /// How orders go; each thing once.
    fn words(&mut self) -> Vec<(Ticket, Word)>;

    /// Broker and apps, for people.
    fn rows(&mut self, losses: &Losses) -> Vec<AppRow>;

    /// Puts into `state` who runs. Whether that is of use to another launcher.
    fn note_state(&self, state: &mut LaunchState) -> bool;

    /// The explorers that ran, in the order in which they came.
    fn explorers(&self) -> Vec<String>;

    /// The apps that were swapped while they ran.
    fn swapped(&self) -> Vec<String> {
        Vec::new()
    }

    /// Ends what apps have started and left behind, once they have ended; waits a moment for those that do not listen.
    fn end_escaped(&mut self) {}

    /// Begins to end the apps, in the order in which nobody misses anybody.
    fn end_apps(&mut self);

    /// Leaves all of them to another launcher, as they run.
    fn let_go(&mut self) {}

    /// Whether all of them have ended.
    fn ended(&self) -> bool;

    /// Ends the broker, once nobody needs it any more.
    fn stop_broker(&mut self);
}
