//! What feed and pages have in common.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use elk_bus::drawing::KeyPress;
use serde_json::Value;
use tokio::sync::watch;

use crate::model::{Model, Wants};
use crate::scenery::{Scene, Scenery};
use crate::steering::Steering;

/// Keys that were pressed and that the feed has not passed on yet.
const MOST_PRESSES: usize = 64;

/// How a recorded run is played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Play {
    pub playing: bool,
    /// Seconds of the recording in a second.
    pub rate: f64,
    pub looping: bool,
}

/// What pages ask of a feed. Of each thing the last word counts, so that however much a page says, no more than this waits.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Asked {
    /// This is what pages want now, all of them together.
    pub wants: Option<Wants>,
    /// A recorded run is to be played so.
    pub play: Option<Play>,
    /// A recorded run is to go on from this time (s).
    pub seek: Option<f64>,
    /// Keys that were pressed and that apps have declared, in their order.
    pub presses: Vec<KeyPress>,
}

/// The model, who changes it, and who looks at it.
pub(crate) struct Shared {
    model: Mutex<Model>,
    changed: watch::Sender<u64>,
    /// Whether the view ends.
    ends: watch::Sender<bool>,
    wanted: Mutex<BTreeMap<u64, Wants>>,
    asked: Mutex<Asked>,
    /// Somebody has asked for something.
    is_asked: Condvar,
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
    ) -> Self {
        Self {
            model: Mutex::default(),
            changed: watch::Sender::new(0),
            ends: watch::Sender::new(false),
            wanted: Mutex::default(),
            asked: Mutex::default(),
            is_asked: Condvar::new(),
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
        self.tell();
        changed
    }

    /// Tells the pages that the model has changed: whoever hears much at a time does so once.
    pub fn tell(&self) {
        self.changed.send_modify(|count| *count += 1);
    }

    /// Is told whenever the model has changed.
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.changed.subscribe()
    }

    /// The view ends: pages are told, and go.
    pub fn end(&self) {
        self.ends.send_replace(true);
    }

    /// Comes back when the view ends.
    pub async fn ended(&self) {
        // Whoever waits holds the sender.
        let _ = self.ends.subscribe().wait_for(|ends| *ends).await;
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
        self.ask(|asked| asked.wants = Some(all));
    }

    /// Has the feed do something.
    pub fn ask<T>(&self, ask: impl FnOnce(&mut Asked) -> T) -> T {
        let answer = ask(&mut self.asked.lock().unwrap_or_else(PoisonError::into_inner));
        self.is_asked.notify_all();
        answer
    }

    /// Has the feed pass on that a key was pressed; whether there was room for that.
    pub fn press(&self, press: KeyPress) -> bool {
        self.ask(|asked| {
            let has_room = asked.presses.len() < MOST_PRESSES;
            asked.presses.extend(has_room.then_some(press));
            has_room
        })
    }

    /// What was asked for since this was last called; waits for so long that something is.
    pub fn asked(&self, wait: Duration) -> Asked {
        let asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        let is_nothing = |asked: &mut Asked| *asked == Asked::default();
        let waited = self.is_asked.wait_timeout_while(asked, wait, is_nothing);
        std::mem::take(&mut waited.unwrap_or_else(PoisonError::into_inner).0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_what_is_asked_for_the_last_word_counts_and_keys_are_bounded() {
        let shared = Shared::new(Value::Null, None, None, false);
        for number in 0..10_000 {
            shared.ask(|asked| asked.seek = Some(f64::from(number)));
            let wants = Wants { scan: number % 2 == 0, ..Wants::default() };
            shared.want(1, wants);
        }
        let press = KeyPress { app: "a".into(), key: "k".into(), shift: false, alt: false };
        let taken = (0..10_000).filter(|_| shared.press(press.clone())).count();
        let asked = shared.asked(Duration::ZERO);
        assert_eq!((asked.seek, asked.wants), (Some(9_999.0), Some(Wants::default())));
        assert_eq!((taken, asked.presses.len()), (MOST_PRESSES, MOST_PRESSES));
        assert_eq!(shared.asked(Duration::ZERO), Asked::default(), "it was asked for once");
        assert!(shared.press(press));
    }
}
