//! What feed and pages have in common.

use std::collections::BTreeMap;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elk_bus::drawing::KeyPress;
use serde_json::Value;
use tokio::sync::watch;

use crate::model::{Model, Wants};
use crate::scenery::{Scene, Scenery};
use crate::steering::Steering;

/// What pages have a feed do.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Command {
    /// This is what pages want, all of them together.
    Want(Wants),
    /// A recorded run is played, or held.
    Play { playing: bool, rate: f64, looping: bool },
    /// A recorded run goes on from this time (s).
    Seek(f64),
    /// A key was pressed that an app has declared.
    Press(KeyPress),
}

/// The model, who changes it, and who looks at it.
pub(crate) struct Shared {
    model: Mutex<Model>,
    changed: watch::Sender<u64>,
    wanted: Mutex<BTreeMap<u64, Wants>>,
    commands: Mutex<Sender<Command>>,
    /// What pages are told first.
    pub hello: Value,
    /// Whoever does what pages say; `None`: pages only look.
    pub steering: Option<Arc<dyn Steering>>,
    /// The world, for pages that show it.
    pub scene: Scene,
    /// Whether pages may order and poke.
    pub read_only: bool,
}

impl Shared {
    pub fn new(
        hello: Value,
        steering: Option<Arc<dyn Steering>>,
        scenery: Option<Arc<dyn Scenery>>,
        read_only: bool,
        commands: Sender<Command>,
    ) -> Self {
        Self {
            model: Mutex::default(),
            changed: watch::Sender::new(0),
            wanted: Mutex::default(),
            commands: Mutex::new(commands),
            hello,
            steering,
            scene: Scene::new(scenery),
            read_only,
        }
    }

    /// The model, to be looked at. Whoever panicked with it has left it as it was between two messages.
    pub fn model(&self) -> MutexGuard<'_, Model> {
        self.model.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the model, and tells the pages.
    pub fn change<T>(&self, change: impl FnOnce(&mut Model) -> T) -> T {
        let changed = change(&mut self.model());
        self.changed.send_modify(|count| *count += 1);
        changed
    }

    /// Is told whenever the model has changed.
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.changed.subscribe()
    }

    /// Whether there is a page.
    pub fn is_watched(&self) -> bool {
        self.changed.receiver_count() > 0
    }

    /// A page wants this now; what nobody wants need not be heard.
    pub fn want(&self, page: u64, wants: Wants) {
        let mut wanted = self.wanted.lock().unwrap_or_else(PoisonError::into_inner);
        match wants == Wants::default() {
            true => wanted.remove(&page),
            false => wanted.insert(page, wants),
        };
        let values = wanted.values().flat_map(|one| &one.values).cloned().collect();
        let any = |is: fn(&Wants) -> bool| wanted.values().any(is);
        let all = Wants { values, scan: any(|one| one.scan), drawings: any(|one| one.drawings) };
        self.command(Command::Want(all));
    }

    /// Has the feed do something; one that has ended has its reason in the model's status.
    pub fn command(&self, command: Command) {
        let _ = self.commands.lock().unwrap_or_else(PoisonError::into_inner).send(command);
    }
}
