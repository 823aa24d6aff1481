//! An app whose callbacks are Python's, run by the framework that runs every app: what it is told, what it counts, how it is
//! succeeded and how it leaves are the same.

use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::{App, AppError, Client, Comms, Community, ConnectError, Mail, Refused, RunError, RunOptions, run_app_on};
use elk_pipe::Registration;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

use crate::bytes::Shelf;
use crate::carried::Known;
use crate::clock::Followed;
use crate::error::{Rejection, error};
use crate::message::Message;
use crate::outgoing::{Outgoing, Said};

/// How often a client looks whether the broker is there that it waits for.
const JOIN_EVERY: Duration = Duration::from_millis(100);

/// Name, community, parameters (name and text), other arguments.
type Launched = (String, String, Vec<(String, String)>, Vec<String>);

/// What a launcher has handed over to this program.
#[pyfunction]
pub fn launched(arguments: Vec<String>) -> PyResult<Launched> {
    let mut arguments = arguments.into_iter();
    let program = arguments.next().unwrap_or_default();
    let options = RunOptions::from_arguments(&program, arguments.collect()).map_err(error)?;
    Ok((options.name, options.community.to_string(), options.params, options.args))
}

/// A client of a community, to be run on one thread; what it says is said from any.
#[pyclass(frozen, module = "elk")]
pub struct Runner {
    options: RunOptions,
    outgoing: Arc<Outgoing>,
    shelf: Arc<Shelf>,
    known: Known,
    was_run: AtomicBool,
}

#[pymethods]
impl Runner {
    /// A client that is not run yet.
    #[new]
    fn new(name: &str, community: &str) -> PyResult<Self> {
        let community = Community::new(community).map_err(error)?;
        let options = RunOptions::new(name, community.clone()).of_build(elk_bus::build!());
        let options = options.as_launched().map_err(error)?;
        let outgoing = Arc::new(Outgoing::new()?);
        let bell = outgoing.bell.clone();
        let shelf = Arc::new(Shelf::new(move || bell.ring()));
        Ok(Self { options, outgoing, shelf, known: Known::new(name, &community), was_run: AtomicBool::new(false) })
    }

    /// Joins and runs `handler`'s callbacks on this thread until it is stopped, fails, or its successor is ready. With
    /// `waits` it waits for a broker that is not there yet.
    #[pyo3(signature = (handler, period_secs=None, waits=false))]
    fn run(&self, py: Python<'_>, handler: Py<PyAny>, period_secs: Option<f64>, waits: bool) -> PyResult<()> {
        if self.was_run.swap(true, Ordering::SeqCst) {
            return Err(error(format_args!("{} was run already; right is a new one", self.options.name)));
        }
        let period = period_secs.map(Duration::try_from_secs_f64).transpose();
        let period = period.map_err(|wrong| error(format_args!("a period of {period_secs:?} s: {wrong}")))?;
        let ended = py.detach(|| self.serve(handler, period, waits));
        self.shelf.close();
        let ended = ended.map_err(|failure| self.raised(py, failure));
        let why = ended
            .as_ref()
            .err()
            .map_or_else(|| "was stopped".to_owned(), |failure| format!("ended: {}", failure.value(py)));
        self.outgoing.close(format!("{} {why}; nothing is said any more", self.options.name));
        ended
    }

    /// Asks the run to end after the present callback.
    fn stop(&self) {
        self.outgoing.stop();
    }

    /// The descriptor that Python's signals are to be written to, so that they are seen at once.
    fn signal_fd(&self) -> i32 {
        self.outgoing.bell.writable()
    }

    /// Registers: the latest values come at once, then all new ones.
    #[pyo3(signature = (variables, sources="*", rate=None, lossless=false))]
    fn register(
        &self,
        py: Python<'_>,
        variables: &str,
        sources: &str,
        rate: Option<f64>,
        lossless: bool,
    ) -> PyResult<()> {
        if let Some(wrong) = rate.filter(|rate| !(1e-6..=1e9).contains(rate)) {
            return Err(error(format_args!(
                "rate is {wrong}; right is how many messages a second at most, from 0.000001"
            )));
        }
        let wanted = Registration { keys: variables.to_owned(), from: sources.to_owned(), rate, lossless };
        self.outgoing.say(py, Said::Register(wanted))
    }

    /// Takes a registration back.
    #[pyo3(signature = (variables, sources="*"))]
    fn unregister(&self, py: Python<'_>, variables: &str, sources: &str) -> PyResult<()> {
        let wanted = Registration { keys: variables.to_owned(), from: sources.to_owned(), rate: None, lossless: false };
        self.outgoing.say(py, Said::Unregister(wanted))
    }

    /// Publishes a value.
    #[pyo3(signature = (variable, value, time=None, type_name=None, source_aux=String::new()))]
    fn publish(
        &self,
        py: Python<'_>,
        variable: String,
        value: &Bound<'_, PyAny>,
        time: Option<f64>,
        type_name: Option<String>,
        source_aux: String,
    ) -> PyResult<()> {
        let value = self.known.value(&variable, value, type_name)?;
        self.outgoing.say(py, Said::Publish { variable, value, time, source_aux })
    }

    /// What a variable carries, as JSON; None: nobody has said.
    fn describe(&self, py: Python<'_>, variable: &str) -> PyResult<Option<String>> {
        py.detach(|| self.known.describe(variable)).map_err(error)
    }

    /// The community's time (s), in a callback; None elsewhere.
    fn time(&self) -> Option<f64> {
        self.outgoing.with_comms(|comms| comms.time())
    }

    /// Messages that were lost so far because they were not read in time, in a callback; None elsewhere.
    fn dropped(&self) -> Option<u64> {
        self.outgoing.with_comms(|comms| comms.dropped())
    }

    /// Messages heard, and the bytes of their values; messages said, and the bytes of theirs; messages that wait to be said.
    fn counts(&self) -> (u64, u64, u64, u64, usize) {
        let ((heard, heard_bytes), (said, said_bytes)) =
            (self.outgoing.counts.heard.get(), self.outgoing.counts.said.get());
        (heard, heard_bytes, said, said_bytes, self.outgoing.unsent())
    }
}

impl Runner {
    fn serve(&self, handler: Py<PyAny>, period: Option<Duration>, waits: bool) -> Result<(), RunError> {
        let Some(mut client) = self.join(waits)? else { return Ok(()) };
        let clock = Followed::joined(client.comms.clock());
        let mut app = PyApp { runner: self, handler, period, clock };
        run_app_on(&mut app, &mut client, &self.outgoing.stop)
    }

    /// `None`: it was stopped while it waited.
    fn join(&self, waits: bool) -> Result<Option<Client>, RunError> {
        while !self.outgoing.stop.load(Ordering::Relaxed) {
            match Client::join(&self.options) {
                Err(ConnectError::NoBroker(_)) if waits => std::thread::sleep(JOIN_EVERY),
                joined => return Ok(Some(joined?)),
            }
        }
        Ok(None)
    }

    /// A failure as Python raises it: what a callback has raised is its cause.
    fn raised(&self, py: Python<'_>, failure: RunError) -> PyErr {
        let RunError::App { app, source } = failure else { return error(failure) };
        let raised = match source.downcast::<Raised>() {
            Ok(raised) => raised,
            Err(other) => return error(format_args!("{app}: {other}")),
        };
        // KeyboardInterrupt and SystemExit are no failures.
        if !raised.exception.is_instance_of::<PyException>(py) {
            return raised.exception;
        }
        let words = error(format_args!("{app}: {raised}"));
        words.set_cause(py, Some(raised.exception));
        words
    }
}

/// What a callback has raised.
#[derive(Debug)]
struct Raised {
    callback: String,
    exception: PyErr,
}

impl std::fmt::Display for Raised {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} raised {}", self.callback, self.exception)
    }
}

impl std::error::Error for Raised {}

struct PyApp<'a> {
    runner: &'a Runner,
    handler: Py<PyAny>,
    period: Option<Duration>,
    clock: Followed,
}

impl PyApp<'_> {
    /// Has Python do something, and say what it has to.
    fn call(
        &mut self,
        comms: &mut Comms,
        callback: impl FnOnce() -> String,
        act: impl FnOnce(Python<'_>, &Bound<'_, PyAny>) -> PyResult<()>,
    ) -> Result<(), AppError> {
        self.clock.follow(comms.clock());
        self.runner.outgoing.lend(comms, || {
            Python::attach(|py| {
                act(py, self.handler.bind(py)).map_err(|exception| match exception.is_instance_of::<Rejection>(py) {
                    true => AppError::from(elk_bus::Rejection::new(exception.value(py))),
                    false => AppError::from(Raised { callback: callback(), exception }),
                })
            })
        })
    }

    fn call_plain(&mut self, comms: &mut Comms, name: &'static str) -> Result<(), AppError> {
        self.call(comms, || name.to_owned(), |_, handler| handler.call_method0(name).map(drop))
    }
}

impl App for PyApp<'_> {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.call_plain(comms, "on_start_up")
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        self.runner.shelf.clear();
        self.runner.outgoing.counts.heard.add(mail.value().byte_len());
        let message = Message::of_mail(mail, &self.runner.shelf);
        let callback = || format!("on_new_mail({})", mail.key());
        self.call(comms, callback, |_, handler| handler.call_method1("on_new_mail", (message,)).map(drop))
    }

    fn iterate(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.call_plain(comms, "iterate")
    }

    fn on_stop(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.call_plain(comms, "on_stop")?;
        Ok(self.runner.outgoing.say_queued(comms)?)
    }

    fn on_refused(&mut self, comms: &mut Comms, refused: &Refused) -> Result<(), AppError> {
        self.runner.known.forget(&refused.key);
        let (key, reason) = (&refused.key, &refused.reason);
        let callback = || "on_refused".to_owned();
        self.call(comms, callback, |_, handler| handler.call_method1("on_refused", (key, reason)).map(drop))
    }

    fn tick_period(&self) -> Option<Duration> {
        self.period
    }

    fn wake_fd(&self) -> Option<BorrowedFd<'_>> {
        Some(self.runner.outgoing.bell.readable())
    }

    fn on_wake(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.runner.outgoing.bell.hush();
        self.runner.shelf.clear();
        self.runner.outgoing.say_queued(comms)?;
        let callback = || "a signal's handler".to_owned();
        self.call(comms, callback, |py, _| py.check_signals())
    }
}
