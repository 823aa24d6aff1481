//! An app whose callbacks are Python's, run by the framework that runs every app: what it is told, what it counts, how it is
//! succeeded and how it leaves are the same.

use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use elk_bus::wire::MAX_NAME;
use elk_bus::{
    App, AppError, Client, Comms, Community, ConnectError, Mail, Refused, RunError, RunOptions, run_app_on, tell,
};
use elk_outside::text::{self, printable};
use elk_pipe::Registration;
use pyo3::exceptions::{PyException, PySystemExit};
use pyo3::prelude::*;
use pyo3::types::PyType;

use crate::bytes::Shelf;
use crate::carried::Known;
use crate::clock::Followed;
use crate::error::{Rejection, error};
use crate::fork::Home;
use crate::message::Message;
use crate::outgoing::{Outgoing, Said};
use crate::text::{Number, Text};

/// Times between two calls of `iterate` (s).
const PERIODS: std::ops::RangeInclusive<f64> = 1e-6..=1e9;
/// Characters of an exception's words that are said at most; the exception itself is the cause of what says them.
const LONGEST_SAID: usize = 1000;
/// How often a client looks whether the broker is there that it waits for.
const JOIN_EVERY: Duration = Duration::from_millis(100);

/// Name, community, parameters (name and text), other arguments.
type Launched = (String, String, Vec<(String, String)>, Vec<String>);

/// What a launcher has handed over to this program.
#[pyfunction]
pub fn launched(arguments: Vec<Text>) -> PyResult<Launched> {
    let mut arguments = arguments.into_iter().map(|Text(argument)| argument);
    let program = arguments.next().unwrap_or_default();
    let options = RunOptions::from_arguments(&program, arguments.collect()).map_err(error)?;
    Ok((options.name, options.community.to_string(), options.params, options.args))
}

/// The first thing that a fork does: the broker no longer takes its life for that of the process that it was forked off.
#[pyfunction]
pub fn let_go_of_parent() {
    elk_bus::shm::let_go_of_parent();
}

/// Has what a thread's Python does come to its end by this exit, as soon as it does something.
///
/// # Errors
/// It is no SystemExit.
#[pyfunction]
pub fn interrupt(thread: std::ffi::c_long, exit: &Bound<'_, PyType>) -> PyResult<()> {
    if !exit.is_subclass_of::<PySystemExit>()? {
        return Err(error("a thread is interrupted by a SystemExit"));
    }
    // SAFETY: the interpreter's lock is held, and the exception is one. A thread that is not there any more is none to it.
    unsafe { pyo3::ffi::PyThreadState_SetAsyncExc(thread, exit.as_ptr()) };
    Ok(())
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
    fn new(name: Text, community: Text) -> PyResult<Self> {
        let (name, community) = (name.0.as_str(), community.0);
        if name.len() > MAX_NAME {
            let (beginning, length) = (printable(&name.chars().take(40).collect::<String>()).into_owned(), name.len());
            return Err(error(format_args!(
                "{beginning}… is no name for a client: it has {length} bytes, and 64 are allowed"
            )));
        }
        let community = Community::new(community).map_err(error)?;
        let options = RunOptions::new(name, community.clone()).of_build(elk_bus::build!());
        let options = options.as_launched().map_err(error)?;
        let outgoing = Arc::new(Outgoing::new(name)?);
        let bell = outgoing.bell.clone();
        let shelf = Arc::new(Shelf::new(move || bell.ring()));
        Ok(Self { options, outgoing, shelf, known: Known::new(name, &community), was_run: AtomicBool::new(false) })
    }

    /// Joins and runs `handler`'s callbacks on this thread until it is stopped, fails, or its successor is ready. With
    /// `waits` it waits for a broker that is not there yet.
    #[pyo3(signature = (handler, period_secs=None, waits=false))]
    fn run(&self, py: Python<'_>, handler: Py<PyAny>, period_secs: Option<Number>, waits: bool) -> PyResult<()> {
        self.outgoing.check()?;
        let period = period_secs.map(|Number(secs)| self.period(secs)).transpose()?;
        if self.was_run.swap(true, Ordering::SeqCst) {
            return Err(error(format_args!("{} was run already; right is a new one", self.options.name)));
        }
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
    #[pyo3(signature = (variables, sources=Text("*".to_owned()), rate=None, lossless=false))]
    fn register(
        &self,
        py: Python<'_>,
        variables: Text,
        sources: Text,
        rate: Option<Number>,
        lossless: bool,
    ) -> PyResult<()> {
        let (Text(variables), Text(sources), rate) = (variables, sources, rate.map(|Number(rate)| rate));
        if let Some(wrong) = rate.filter(|rate| !(1e-6..=1e9).contains(rate)) {
            return Err(error(format_args!(
                "the rate of {} is {wrong}; right is how many messages a second at most, from 0.000001 to 1e9",
                printable(&variables)
            )));
        }
        let wanted = Registration { keys: variables, from: sources, rate, lossless };
        self.outgoing.say(py, Said::Register(wanted))
    }

    /// Takes a registration back.
    #[pyo3(signature = (variables, sources=Text("*".to_owned())))]
    fn unregister(&self, py: Python<'_>, variables: Text, sources: Text) -> PyResult<()> {
        let (Text(variables), Text(sources)) = (variables, sources);
        let wanted = Registration { keys: variables, from: sources, rate: None, lossless: false };
        self.outgoing.say(py, Said::Unregister(wanted))
    }

    /// Publishes a value.
    #[pyo3(signature = (variable, value, time=None, type_name=None, source_aux=Text(String::new())))]
    fn publish(
        &self,
        py: Python<'_>,
        variable: Text,
        value: &Bound<'_, PyAny>,
        time: Option<Number>,
        type_name: Option<Text>,
        source_aux: Text,
    ) -> PyResult<()> {
        self.outgoing.check()?;
        let (Text(variable), Text(source_aux)) = (variable, source_aux);
        let (time, type_name) = (time.map(|Number(time)| time), type_name.map(|Text(name)| name));
        let value = self.known.value(&variable, value, type_name)?;
        self.outgoing.say(py, Said::Publish { variable, value, time, source_aux })
    }

    /// Says and counts that a message is of no use, which has left its callback.
    fn reject(&self, py: Python<'_>, message: &Message, why: Text) -> PyResult<()> {
        self.outgoing.say(py, message.rejected(why.0))
    }

    /// What a variable carries, as JSON; None: nobody has said.
    fn describe(&self, py: Python<'_>, variable: Text) -> PyResult<Option<String>> {
        self.outgoing.check()?;
        py.detach(|| self.known.describe(&variable.0)).map_err(error)
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
    fn period(&self, secs: f64) -> PyResult<Duration> {
        let right = PERIODS.contains(&secs).then(|| Duration::from_secs_f64(secs));
        right.ok_or_else(|| {
            error(format_args!(
                "the period of {} is {secs}; right is the time between two calls of iterate (s), from 0.000001 to 1e9, or None",
                printable(&self.options.name)
            ))
        })
    }

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
                // One that has only just begun answers later.
                Err(ConnectError::NoBroker(_) | ConnectError::Handshake { .. }) if waits => {
                    std::thread::sleep(JOIN_EVERY);
                }
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

/// The beginning of what somebody's exception says.
fn words(said: &impl std::fmt::Display) -> String {
    text::clipped(&said.to_string(), LONGEST_SAID).into_owned()
}

/// What a callback has raised.
#[derive(Debug)]
struct Raised {
    callback: String,
    exception: PyErr,
}

impl std::fmt::Display for Raised {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} raised {}", self.callback, words(&self.exception))
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
        let home = Home::here();
        self.runner.outgoing.lend(comms, || {
            Python::attach(|py| {
                let done = act(py, self.handler.bind(py));
                if home.is_elsewhere() {
                    home.end_fork(py, &callback(), done);
                }
                done.map_err(|exception| match exception.is_instance_of::<Rejection>(py) {
                    true => AppError::from(elk_bus::Rejection::new(words(exception.value(py)))),
                    false => AppError::from(Raised { callback: callback(), exception }),
                })
            })
        })
    }

    /// Says what other threads have said; of what there is no room for they are told as of what the broker refuses.
    fn say_queued(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        for refused in self.runner.outgoing.say_queued(comms)? {
            tell(format_args!("{}: {} was not said: {}", comms.name(), printable(&refused.key), refused.reason));
            self.on_refused(comms, &refused)?;
        }
        Ok(())
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
        self.say_queued(comms)
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
        self.say_queued(comms)?;
        let callback = || "a signal's handler".to_owned();
        self.call(comms, callback, |py, _| py.check_signals())
    }
}
