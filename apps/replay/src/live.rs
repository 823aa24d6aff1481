//! Live apps as threads of this process, around a broker in memory: nobody else is there to disturb them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use elk_bus::memory::MemoryBroker;
use elk_bus::{BrokerConfig, Client, Clock, Community, run_app_on};
use elk_mission::{AppSpec, Program};

use crate::error::ReplayError;

/// Mail of an app that computes is kept, however much it is (bytes): nothing recorded is dropped.
const MAILBOX_BYTES: usize = 8 << 30;

/// A community of live apps.
pub(crate) struct Live {
    broker: MemoryBroker,
    community: Community,
    apps: Vec<Running>,
}

struct Running {
    name: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<(), String>>>,
}

impl Live {
    /// A community with nobody in it.
    pub fn new(community: Community) -> Self {
        let config = BrokerConfig { mailbox_bytes: MAILBOX_BYTES, ..BrokerConfig::new(community.as_str()) };
        Self { broker: MemoryBroker::new(config, Clock::new(1.0)), community, apps: Vec::new() }
    }

    /// Joins it under `name`.
    pub fn join(&self, name: &str) -> Result<Client, ReplayError> {
        join(&self.broker, name, &self.community)
    }

    /// Starts an app.
    pub fn start(&mut self, app: &AppSpec) -> Result<(), ReplayError> {
        let failed = |reason: String| ReplayError::App { app: app.name.clone(), reason };
        let Program::Builtin(app_type, params) = app.program.clone() else {
            return Err(failed("it is a program of its own; only elk's own apps run in this process".into()));
        };
        // What its parameters cannot be built from is said before anything is played.
        let mut built = (app_type.build)(&params).map_err(|error| failed(error.to_string()))?;
        let stop = Arc::new(AtomicBool::new(false));
        let (broker, community) = (self.broker.clone(), self.community.clone());
        let (name, stopped) = (app.name.clone(), stop.clone());
        // A client stays on the thread that it was made on.
        let run = move || {
            let mut client = join(&broker, &name, &community).map_err(|error| error.to_string())?;
            run_app_on(&mut *built, &mut client, &stopped).map_err(|error| error.to_string())
        };
        let thread = std::thread::Builder::new().name(app.name.clone()).spawn(run);
        let thread = Some(thread.map_err(|error| failed(error.to_string()))?);
        self.apps.push(Running { name: app.name.clone(), stop, thread });
        Ok(())
    }

    /// Fails if an app has ended by itself.
    pub fn check(&mut self) -> Result<(), ReplayError> {
        let ended = self.apps.iter_mut().find(|app| app.thread.as_ref().is_some_and(JoinHandle::is_finished));
        ended.map_or(Ok(()), |app| {
            let reason = app.join().err().unwrap_or_else(|| "it ended by itself".into());
            Err(ReplayError::App { app: app.name.clone(), reason })
        })
    }

    /// Ends an app, and waits until it has said its last.
    pub fn stop(&mut self, name: &str) -> Result<(), ReplayError> {
        let Some(app) = self.apps.iter_mut().find(|app| app.name == name) else {
            return Ok(());
        };
        app.stop.store(true, Ordering::Relaxed);
        app.join().map_err(|reason| ReplayError::App { app: name.into(), reason })
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        for app in &mut self.apps {
            app.stop.store(true, Ordering::Relaxed);
        }
        for app in &mut self.apps {
            // Whatever it ended with, somebody has said already why this ends.
            let _ = app.join();
        }
        self.broker.stop();
    }
}

impl Running {
    fn join(&mut self) -> Result<(), String> {
        match self.thread.take().map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(result)) => result,
            Some(Err(_)) => Err("it panicked".into()),
        }
    }
}

fn join(broker: &MemoryBroker, name: &str, community: &Community) -> Result<Client, ReplayError> {
    let refused =
        |reason: elk_bus::broker::AdmissionError| ReplayError::App { app: name.into(), reason: reason.to_string() };
    Ok(Client::over(broker.connect(name).map_err(refused)?, name, community))
}
