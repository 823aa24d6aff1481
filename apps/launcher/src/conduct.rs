//! A mission from its first app to its last word.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::{Client, CommsError};
use elk_spatial::keys::{MAP_REQUEST, STEP};

use crate::crew::Crew;
use crate::error::LaunchError;
use crate::observer::Observer;
use crate::person;
use crate::progress::{Display, put};

/// How long apps may take to register: they load worlds first.
const REGISTER_PATIENCE: Duration = Duration::from_secs(60);
/// How long the sensor may take to hold the final map against the true world.
const JUDGE_PATIENCE: Duration = Duration::from_secs(60);
/// How long one look at the bus takes at most; then it is seen who is still alive.
const LOOK: Duration = Duration::from_millis(50);

/// One run of a mission, seen from the launcher's place on the bus.
pub(crate) struct Conduct<'a> {
    pub crew: &'a mut dyn Crew,
    pub client: Client,
    pub observer: &'a mut Observer,
    pub display: &'a mut Display,
    pub stop: &'a AtomicBool,
    /// Where the apps' text logs are.
    pub folder: &'a Path,
    /// Whether a person has to ask for each step.
    pub manual: bool,
}

impl Conduct<'_> {
    /// Starts the apps, waits until exploration is over, and has the final map judged.
    pub fn run(&mut self) -> Result<(), LaunchError> {
        self.observer.register(&mut self.client.comms)?;
        // The logger is there before anybody has anything to say.
        self.start(&|element| element == "Logger")?;
        self.start(&|element| element != "Logger")?;
        if self.manual {
            put("Enter takes a step, Ctrl-C ends the mission.\n");
        }
        while !self.observer.finished() {
            self.look("before the mission was over")?;
            self.step_by_hand()?;
            self.display.show(self.observer);
        }
        self.judge()
    }

    fn start(&mut self, which: &dyn Fn(&str) -> bool) -> Result<(), LaunchError> {
        let names: BTreeSet<String> = self.crew.start_apps(which)?.into_iter().collect();
        let clock = Stopwatch::start();
        while !names.is_subset(&self.observer.clients) {
            self.look("before it registered")?;
            if clock.elapsed() > REGISTER_PATIENCE {
                let missing = names.difference(&self.observer.clients).cloned().collect();
                let secs = REGISTER_PATIENCE.as_secs();
                let folder = self.folder.to_owned();
                return Err(LaunchError::NotRegistered { apps: missing, secs, folder });
            }
        }
        Ok(())
    }

    /// Hears what there is to hear, and sees that everyone is alive and nobody wants to stop.
    fn look(&mut self, when: &'static str) -> Result<(), LaunchError> {
        let observer = &mut *self.observer;
        let heard: Result<usize, CommsError> = self.client.receive(LOOK, |mail| observer.note(mail));
        if person::stopped(self.stop) {
            return Err(LaunchError::Stopped);
        }
        // Who died says more than that the bus broke.
        self.crew.check(when)?;
        heard?;
        Ok(())
    }

    fn step_by_hand(&mut self) -> Result<(), LaunchError> {
        if self.manual {
            for _ in 0..person::enters()? {
                self.client.comms.notify(STEP, 1.0)?;
            }
        }
        Ok(())
    }

    /// Asks for the whole map, and waits until the sensor has held it against the true world. A sensor that does not
    /// know the true world says nothing, and that is no failure.
    fn judge(&mut self) -> Result<(), LaunchError> {
        self.client.comms.notify(MAP_REQUEST, 1.0)?;
        let clock = Stopwatch::start();
        while !self.observer.judged() && clock.elapsed() < JUDGE_PATIENCE {
            self.look("before the map was judged")?;
            self.display.show(self.observer);
        }
        Ok(())
    }
}
