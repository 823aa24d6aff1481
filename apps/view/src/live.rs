//! A community that runs, into the model. It is a client like any other: nobody waits for it.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::broker::table::{CommunityTable, REQUEST, TABLE, VariableKind};
use elk_bus::clock::Stopwatch;
use elk_bus::drawing::variables::{self, DRAWINGS};
use elk_bus::{Client, CommsError, Community, Payload, any};
use elk_spatial::Scan;
use elk_spatial::keys::MAP_REQUEST;
use elk_spatial::messages::CameraPose;

use crate::community;
use crate::model::{Heard, Wants, always};
use crate::shared::Shared;
use crate::table::variables;

/// How often the broker's table is asked for.
const TABLE_EVERY: Duration = Duration::from_secs(1);
/// The least time between two values of a variable that is watched, two scans, and two drawings of a name.
const VALUES_EVERY: Duration = Duration::from_millis(100);
/// The longest sleep without a look at what pages want.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Follows a community until `stop` is set, also through its end and the next one of its name.
pub(crate) fn follow(community: &Community, shared: &Shared, stop: &AtomicBool) {
    let (mut wants, mut is_first) = (Wants::default(), true);
    let listen = |client: Client| {
        shared.change(|model| {
            // What pages know is of the community before this one.
            if !std::mem::take(&mut is_first) {
                model.reset();
            }
            model.status(true, "");
        });
        shared.scene.begin();
        Following::new(client, shared).run(&mut wants, stop)
    };
    community::follow(community, "view", stop, listen, |why| shared.change(|model| model.status(false, why)));
}

/// A client that listens.
struct Following<'a> {
    client: Client,
    shared: &'a Shared,
    /// Variables that carry the camera's pose, whatever they are called.
    poses: BTreeSet<String>,
    /// The variable of the sensor's scans.
    scans: Option<String>,
    /// Patterns that are registered for besides what always is.
    registered: BTreeSet<String>,
}

impl<'a> Following<'a> {
    fn new(client: Client, shared: &'a Shared) -> Self {
        Self { client, shared, poses: BTreeSet::new(), scans: None, registered: BTreeSet::new() }
    }

    /// Listens until `stop` is set or the community ends.
    fn run(mut self, wants: &mut Wants, stop: &AtomicBool) -> Result<(), CommsError> {
        always().iter().try_for_each(|key| self.client.comms.register(any(key)))?;
        self.client.comms.notify(REQUEST, "")?;
        let mut asked_for_table = Stopwatch::start();
        self.register_wanted(wants)?;
        while !stop.load(Ordering::Relaxed) {
            let asked = self.shared.asked(Duration::ZERO);
            if let Some(wanted) = asked.wants {
                *wants = wanted;
                self.shared.change(|model| model.watch(wants.values.clone()));
                self.register_wanted(wants)?;
            }
            for press in &asked.presses {
                self.client.comms.publish(&variables::key_press(&press.app), press)?;
            }
            if asked_for_table.elapsed() >= TABLE_EVERY && self.shared.is_watched() {
                self.client.comms.notify(REQUEST, "")?;
                asked_for_table = Stopwatch::start();
            }
            if self.listen()? {
                self.register_wanted(wants)?;
            }
        }
        Ok(())
    }

    /// Hears what has come; whether there are variables of poses or scans that there were not.
    fn listen(&mut self) -> Result<bool, CommsError> {
        let (shared, mut table) = (self.shared, None);
        let messages = self.client.receive(LOOK_EVERY, |mail| {
            if mail.is(&TABLE) {
                table = mail.decode(&TABLE).ok();
                return;
            }
            let heard = Heard { key: mail.key(), source: mail.source(), time: mail.time(), value: mail.value() };
            shared.model().hear(&heard);
        })?;
        if messages > 0 {
            shared.tell();
        }
        let now = self.client.comms.time();
        if shared.model().is_over_at(now) {
            shared.change(|model| model.pass(now));
        }
        if shared.model().take_question() {
            self.client.comms.notify(MAP_REQUEST, 0.0)?;
        }
        let Some(table) = table else { return Ok(false) };
        shared.change(|model| {
            model.began(table.started);
            model.variables(&variables(&table));
        });
        Ok(self.look_for_names(&table))
    }

    fn look_for_names(&mut self, table: &CommunityTable) -> bool {
        let of = |wanted: &'static str| {
            let is = move |kind: &VariableKind| matches!(kind, VariableKind::Typed { name, .. } if name == wanted);
            table.variables.iter().filter(move |variable| is(&variable.kind)).map(|variable| variable.name.clone())
        };
        let poses: BTreeSet<String> = of(CameraPose::NAME).collect();
        // What filters leave of a scan is not what the sensor saw; the sensor's own variable came first.
        let scans = of(<Scan<'_> as Payload>::NAME).next();
        let news = poses != self.poses || scans != self.scans;
        (self.poses, self.scans) = (poses, scans);
        news
    }

    /// Registers for what is wanted now, and no longer for what is not.
    fn register_wanted(&mut self, wants: &Wants) -> Result<(), CommsError> {
        let scans = self.scans.iter().filter(|_| wants.scan);
        let mut wanted: BTreeSet<String> = wants.values.iter().chain(&self.poses).chain(scans).cloned().collect();
        wanted.extend(wants.drawings.then(|| DRAWINGS.to_owned()));
        for key in wanted.difference(&self.registered) {
            // The way goes through every pose.
            let every = if self.poses.contains(key) { Duration::ZERO } else { VALUES_EVERY };
            self.client.comms.register(any(key).every(every))?;
        }
        for key in self.registered.difference(&wanted) {
            self.client.comms.unregister(any(key))?;
        }
        self.registered = wanted;
        self.client.comms.flush()
    }
}
