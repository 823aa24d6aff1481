//! The app framework: MOOS' three callbacks, driven by mail or by a tick.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::broker::table;
use crate::client::Client;
use crate::clock::{Stopwatch, process_cpu_secs};
use crate::comms::{Comms, CommsError};
use crate::inbox::Inbox;
use crate::mail::Mail;
use crate::words::tell;

/// What an app may fail with.
pub type AppError = Box<dyn std::error::Error + Send + Sync>;

/// An app: what it does when it starts, with each message, and at its tick.
///
/// ```no_run
/// use elk_bus::{App, AppError, Comms, Community, Mail, RunOptions, run_app};
///
/// /// Says hello to everyone who says who they are.
/// struct Hello;
///
/// impl App for Hello {
///     fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
///         Ok(comms.register_variable("WHO", 0.0)?)
///     }
///
///     fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
///         Ok(comms.notify("GREETING", format!("hello, {}", mail.as_text().unwrap_or("whoever you are")))?)
///     }
/// }
///
/// fn main() -> Result<(), Box<dyn std::error::Error>> {
///     Ok(run_app(Box::new(Hello), &RunOptions::new("hello", Community::new("demo")?))?)
/// }
/// ```
pub trait App: Send {
    /// Called once, when the broker has let the app in: register here.
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError>;

    /// Called with each message, in the broker's order.
    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError>;

    /// Called at the app's tick, if it has one.
    fn iterate(&mut self, _comms: &mut Comms) -> Result<(), AppError> {
        Ok(())
    }

    /// Called on the way out, while the bus is still there.
    fn on_stop(&mut self, _comms: &mut Comms) -> Result<(), AppError> {
        Ok(())
    }

    /// Whether mail that the broker has for it by the time that it is to stop is still handed to it: who records has to
    /// have it all.
    fn reads_to_the_end(&self) -> bool {
        false
    }

    /// How often [`App::iterate`] is called (Hz); `None`: never, the app is driven by mail alone.
    fn tick_hz(&self) -> Option<f64> {
        None
    }
}

/// Why an app's run ended badly.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The app could not join.
    #[error(transparent)]
    Connect(#[from] crate::shm::ConnectError),
    /// The bus failed.
    #[error(transparent)]
    Comms(#[from] CommsError),
    /// The app itself failed.
    #[error("{app}: {source}")]
    App {
        /// The app's name.
        app: String,
        /// Why.
        source: AppError,
    },
    /// Signals cannot be caught.
    #[error("signals cannot be caught: {0}")]
    Signals(std::io::Error),
}

/// How often `<APP>_STATUS` is published (s), as in MOOS.
const STATUS_PERIOD_SECS: f64 = 2.0;
/// How long an app that reads to the end waits for the next mail, while the broker does not say that there is none.
const LAST_MAIL_PATIENCE: Duration = Duration::from_secs(5);
/// The longest that an app sleeps without looking whether it is to stop.
const LONGEST_SLEEP: Duration = Duration::from_millis(500);

/// Runs an app on a connected client until it stops itself, fails, its successor is ready, or `stop` is set.
pub fn run_app_on(app: &mut dyn App, client: &mut Client, stop: &AtomicBool) -> Result<(), RunError> {
    let name = client.comms.name().to_owned();
    let failed = |source: AppError| match source.downcast::<CommsError>() {
        Ok(comms) => RunError::Comms(*comms),
        Err(source) => RunError::App { app: name.clone(), source },
    };
    client.comms.set_starting(true);
    app.on_start_up(&mut client.comms).map_err(failed)?;
    client.comms.set_starting(false);
    let mut beat = Beat::new(&*app, &client.comms);
    while !stop.load(Ordering::Relaxed) && !client.comms.stopping() && !client.inbox.retiring() {
        let pause = beat.pause(&client.comms);
        let comms = &mut client.comms;
        client.inbox.receive(comms, pause, |comms, mail| app.on_new_mail(comms, mail)).map_err(failed)?;
        if beat.tick_is_due(&client.comms) {
            app.iterate(&mut client.comms).map_err(failed)?;
        }
        report_refusals(&name, &mut client.inbox);
        beat.status(&mut client.comms, &client.inbox)?;
    }
    // What a retiring app has not read is its successor's.
    let rest = match app.reads_to_the_end() && !client.inbox.retiring() {
        true => read_rest(app, client).map_err(failed),
        false => Ok(()),
    };
    app.on_stop(&mut client.comms).map_err(failed)?;
    rest?;
    Ok(client.comms.say_goodbye()?)
}

/// Hands out the mail that is there: the broker's answer comes behind all of it.
fn read_rest(app: &mut dyn App, client: &mut Client) -> Result<(), AppError> {
    client.comms.notify(table::REQUEST, 1.0)?;
    let (mut all, mut waited) = (false, Stopwatch::start());
    while !all && waited.elapsed() < LAST_MAIL_PATIENCE {
        let comms = &mut client.comms;
        let count = client.inbox.receive(comms, LONGEST_SLEEP, |comms, mail| match mail.is(&table::TABLE) {
            true => {
                all = true;
                Ok(())
            }
            false => app.on_new_mail(comms, mail),
        })?;
        if count > 0 {
            waited = Stopwatch::start();
        }
    }
    Ok(())
}

fn report_refusals(name: &str, inbox: &mut Inbox) {
    for refused in inbox.take_refusals() {
        tell(format_args!("{name}: {} #{} was refused: {}", refused.key, refused.sequence, refused.reason));
    }
}

/// When to iterate and when to report, on the community's clock.
struct Beat {
    period_secs: Option<f64>,
    next_tick: f64,
    next_status: f64,
    running: Stopwatch,
}

impl Beat {
    fn new(app: &dyn App, comms: &Comms) -> Self {
        let now = comms.time();
        let period_secs = app.tick_hz().filter(|hz| *hz > 0.0).map(|hz| 1.0 / hz);
        Self { period_secs, next_tick: now, next_status: now, running: Stopwatch::start() }
    }

    fn pause(&self, comms: &Comms) -> Duration {
        let next = self.period_secs.map_or(self.next_status, |_| self.next_tick.min(self.next_status));
        comms.clock().real(next - comms.time()).min(LONGEST_SLEEP)
    }

    fn tick_is_due(&mut self, comms: &Comms) -> bool {
        let now = comms.time();
        let Some(period) = self.period_secs.filter(|_| now >= self.next_tick) else {
            return false;
        };
        // A tick that was missed is not made up for.
        self.next_tick = (self.next_tick + period).max(now);
        true
    }

    fn status(&mut self, comms: &mut Comms, inbox: &Inbox) -> Result<(), CommsError> {
        let now = comms.time();
        if now < self.next_status {
            return Ok(());
        }
        self.next_status = now + STATUS_PERIOD_SECS;
        let uptime = self.running.elapsed().as_secs_f64();
        let load = 100.0 * process_cpu_secs() / uptime.max(1e-3);
        let memory = peak_memory_kb();
        let (name, dropped) = (comms.name().to_owned(), inbox.dropped());
        let status = format!(
            "AppErrorFlag=false,Uptime={uptime:.1},cpuload={load:.1},memory_max_kb={memory},dropped={dropped},MOOSName={name}"
        );
        comms.notify(&format!("{}_STATUS", name.to_uppercase()), status)
    }
}

/// The most memory that the process has had resident (kB).
fn peak_memory_kb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0)
}

/// Sets `stop` on SIGTERM and SIGINT.
pub fn stop_on_signals() -> std::io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, stop.clone())?;
    }
    Ok(stop)
}
