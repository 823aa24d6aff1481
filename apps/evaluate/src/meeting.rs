//! Where the apps of a run meet: around a broker in memory, or, where one of them is a program that is on the bus itself, in a
//! community of this machine of the run's own.
//!
//! The apps that come with elk take their turns on one thread either way. What comes of a run is the same: who is told what, and in
//! which order, is the broker's business, and every broker is the same one.

use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::channel;
use std::thread::JoinHandle;

use elk_bus::memory::MemoryBroker;
use elk_bus::{BrokerConfig, Client, Clock, Community, child, shm};
use elk_mission::AppSpec;
use elk_pipe::{Errors, Heard, Program};

/// What a run's communities are told apart by, besides the process.
static COUNT: AtomicU64 = AtomicU64::new(0);

/// A community of one run.
pub struct Meeting {
    community: Community,
    place: Place,
    programs: Vec<(String, Program)>,
}

enum Place {
    Memory(MemoryBroker),
    Machine { stop: Arc<AtomicBool>, broker: Option<JoinHandle<()>> },
}

impl Meeting {
    /// Around a broker in memory: for apps of this process.
    ///
    /// # Errors
    /// Its name is none.
    pub fn in_memory(clock: Clock) -> Result<Self, String> {
        let config = BrokerConfig::new("evaluation");
        Ok(Self {
            community: named("evaluation")?,
            place: Place::Memory(MemoryBroker::new(config, clock)),
            programs: Vec::new(),
        })
    }

    /// In a community of this machine, served by a thread of this process: for programs as well.
    ///
    /// # Errors
    /// It cannot be served.
    pub fn on_this_machine(clock: Clock) -> Result<Self, String> {
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let community = named(&format!("evaluation-{}-{count}", std::process::id()))?;
        let config = BrokerConfig::new(community.as_str());
        let (stop, (said, heard)) = (Arc::new(AtomicBool::new(false)), channel());
        let (stopped, served) = (stop.clone(), community.clone());
        // A server stays on the thread on which it was started.
        let serve = move || match shm::Server::start(served, config, clock, None) {
            Ok(mut server) => {
                let _ = said.send(Ok(()));
                server.run(&stopped);
            }
            Err(error) => _ = said.send(Err(format!("no community for a program: {error}"))),
        };
        let thread = std::thread::Builder::new().name("broker".to_owned());
        let broker = thread.spawn(serve).map_err(|error| error.to_string())?;
        heard.recv().map_err(|_| "no community for a program: its broker panicked".to_owned())??;
        Ok(Self { community, place: Place::Machine { stop, broker: Some(broker) }, programs: Vec::new() })
    }

    /// A client of this process.
    ///
    /// # Errors
    /// It is not let in.
    pub fn join(&self, name: &str) -> Result<Client, String> {
        match &self.place {
            Place::Memory(broker) => {
                let link = broker.connect(name).map_err(|error| format!("{name}: {error}"))?;
                Ok(Client::over(link, name, &self.community))
            }
            Place::Machine { .. } => Client::connect(&self.community, name).map_err(|error| format!("{name}: {error}")),
        }
    }

    /// Starts an app that is a program which is on the bus itself. It ends with the run.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(&mut self, app: &AppSpec) -> Result<(), String> {
        let command: Command = app.command("".as_ref(), &self.community, "".as_ref());
        let shown = command.get_program().to_string_lossy().into_owned();
        let program =
            Program::start(command, Errors::Kept).map_err(|error| format!("{shown} cannot be started: {error}"))?;
        // It talks over the bus, and nobody writes to it.
        program.close_input();
        self.programs.push((app.name.clone(), program));
        Ok(())
    }

    /// Whether there are programs, whose answers take as long as they take.
    pub fn has_programs(&self) -> bool {
        !self.programs.is_empty()
    }

    /// The program that has ended, and how. What they print is nobody's, and is read so that they can go on.
    pub fn ended(&mut self) -> Option<String> {
        self.programs.iter_mut().find_map(|(name, program)| {
            let ended = std::iter::from_fn(|| program.hear()).find_map(|heard| match heard {
                Heard::Line(..) => None,
                Heard::Ended(status) => Some(status),
            })?;
            let words = program.last_words().map_or(String::new(), |words| format!("; its last words: {words}"));
            Some(format!("{name} ended by itself: {}{words}", child::how(ended)))
        })
    }

    /// The broker sends everybody away: its clients may go.
    pub fn close(&mut self) {
        self.programs.clear();
        if let Place::Machine { stop, .. } = &self.place {
            stop.store(true, Ordering::Relaxed);
        }
    }
}

impl Drop for Meeting {
    fn drop(&mut self) {
        self.close();
        if let Place::Machine { broker, .. } = &mut self.place
            && let Some(broker) = broker.take()
        {
            // A broker that panicked has said so.
            let _ = broker.join();
        }
    }
}

fn named(name: &str) -> Result<Community, String> {
    Community::new(name).map_err(|error| error.to_string())
}
