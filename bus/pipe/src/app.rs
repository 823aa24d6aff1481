//! A program as an app of the bus: its callbacks are lines.
//!
//! What the program says is taken in its order, a line at a time, and a line that needs to know what a variable carries waits
//! for the broker's table, and with it all lines behind it. Mail is given to the program as fast as it reads; meanwhile it
//! waits in the app's mailbox, like that of any app that is busy.

use std::collections::BTreeMap;
use std::os::fd::BorrowedFd;
use std::process::Command;
use std::time::Duration;

use elk_bus::broker::table::{CommunityTable, REQUEST, TABLE};
use elk_bus::clock::Stopwatch;
use elk_bus::{
    App, AppError, Comms, CommsError, Mail, Origin, Refused, Rejection, ValueRef, asked_to_stop, child, tell,
};
use rustix::process::Signal;
use serde_json::Value;

use crate::arrays;
use crate::carried::Carried;
use crate::program::{Errors, Heard, Program};
use crate::words::{self, Arrays, Publish, Registration, Said};

/// Environment variable of a program that is an app here, `1`: one that can be on the bus itself is told that it is not.
pub const LINES: &str = "ELK_LINES";
/// How long a program that is asked to stop may take.
pub const STOP_PATIENCE: Duration = Duration::from_secs(5);
/// How long a program may take to be ready.
const READY_PATIENCE: Duration = Duration::from_secs(60);
/// How long the broker may take to say what a variable carries, before it is asked again.
const TABLE_PATIENCE: Duration = Duration::from_secs(2);
/// The longest wait without a look whether to stop.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// The largest value that a program is given (bytes): as text it may be five times as long.
const LARGEST_VALUE: usize = 8 << 20;
/// Variables of which it is kept what they carry.
const MOST_CARRIED: usize = 4096;
/// Lines that were not taken, of which the log has the reason.
const REFUSALS_IN_LOG: u64 = 10;

/// A program that is an app.
pub struct PipeApp {
    /// The program and its arguments, until it is started.
    command: Option<Command>,
    /// What it is called in messages.
    title: String,
    errors: Errors,
    parameters: Vec<(String, String)>,
    registrations: Vec<Registration>,
    program: Option<Program>,
    /// What the variables carry that the program has published.
    carried: BTreeMap<String, Carried>,
    /// The line that comes next, if it was heard already.
    next: Option<(u64, Said)>,
    /// Since when the broker is asked what that line's variable carries.
    asked: Option<Stopwatch>,
    /// Messages that found no room on their way to the program.
    unsaid: u64,
    /// Messages of whose loss the program was told.
    lost: u64,
    /// Lines of the program's that were not taken.
    refused: u64,
    /// How it is told lists of numbers.
    arrays: Arrays,
}

impl PipeApp {
    /// A program that is told these parameters. One that is registered for something here is ready from the start; any other
    /// says so itself.
    pub fn new(mut command: Command, parameters: Vec<(String, String)>, registrations: Vec<Registration>) -> Self {
        command.env(LINES, "1");
        Self {
            title: command.get_program().to_string_lossy().into_owned(),
            command: Some(command),
            errors: Errors::Inherited,
            parameters,
            registrations,
            program: None,
            carried: BTreeMap::new(),
            next: None,
            asked: None,
            unsaid: 0,
            lost: 0,
            refused: 0,
            arrays: Arrays::default(),
        }
    }

    /// With this place for its standard error.
    pub fn with_errors(self, errors: Errors) -> Self {
        Self { errors, ..self }
    }

    fn start(&mut self, comms: &Comms) -> Result<(), AppError> {
        let Some(command) = self.command.take() else { return Ok(()) };
        let started = Program::start(command, self.errors);
        let program = started.map_err(|error| {
            format!("{} cannot be started: {error}; right is a program in PATH, or a path", self.title)
        })?;
        self.program = Some(program);
        self.say(&words::hello(comms.name(), comms.community(), &self.parameters));
        Ok(())
    }

    /// Says a line to the program; whether there was room for it.
    fn say(&self, line: &Value) -> bool {
        self.program.as_ref().is_some_and(|program| program.say(&line.to_string()))
    }

    /// What the program has said next.
    fn hear(&mut self) -> Option<Heard> {
        self.program.as_mut().and_then(Program::hear)
    }

    fn ring(&self) {
        self.program.iter().for_each(Program::ring);
    }

    /// Does what a line says before the program is ready; whether it says that it is.
    fn prepare(&mut self, comms: &mut Comms, line: u64, said: Said) -> Result<bool, AppError> {
        match said {
            Said::Register(_) | Said::Unregister(_) | Said::Arrays(_) | Said::Log(_) => {
                self.obey(comms, line, said, None).map(|()| false)
            }
            Said::Ready => Ok(true),
            // Whoever has something to say is ready, and says it as soon as the app is.
            Said::Publish(_) | Said::Describe(_) => {
                self.next = Some((line, said));
                Ok(true)
            }
        }
    }

    /// Waits until the program is ready.
    fn get_ready(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let waited = Stopwatch::start();
        let mut ready = !self.registrations.is_empty();
        while !ready && !asked_to_stop() {
            if waited.elapsed() > READY_PATIENCE {
                let secs = READY_PATIENCE.as_secs();
                return Err(format!(
                    "{} was not ready within {secs} s; right is to say {{\"ready\": true}}",
                    self.title
                )
                .into());
            }
            self.program.iter().for_each(|program| program.wait(LOOK_EVERY));
            match self.hear() {
                None => {}
                Some(Heard::Line(line, said)) => match said.and_then(|said| Said::of(&said)) {
                    Ok(said) => ready = self.prepare(comms, line, said)?,
                    Err(reason) => self.refuse(comms, None, line, &reason),
                },
                Some(Heard::Ended(status)) => return self.over(comms, status),
            }
        }
        // What came behind it is heard when the app is.
        self.ring();
        Ok(())
    }

    /// Does what a line says, `table` being the broker's answer to what it asked for.
    fn obey(
        &mut self,
        comms: &mut Comms,
        line: u64,
        said: Said,
        table: Option<&CommunityTable>,
    ) -> Result<(), AppError> {
        match (said, table) {
            (Said::Register(wanted), _) => {
                self.take(comms, &wanted.keys, line, |comms| comms.register(wanted.subscription()))
            }
            (Said::Unregister(wanted), _) => {
                self.take(comms, &wanted.keys, line, |comms| comms.unregister(wanted.subscription()))
            }
            (Said::Arrays(wanted), _) => {
                self.arrays = wanted;
                Ok(())
            }
            (Said::Log(words), _) => {
                tell(format_args!("{}: {words}", comms.name()));
                Ok(())
            }
            (Said::Ready, _) => Ok(()),
            (Said::Describe(variable), Some(table)) => {
                let carried = Carried::of(table, &variable);
                self.say(&words::described(&variable, carried.map(|carried| carried.as_json())));
                Ok(())
            }
            (Said::Publish(said), table) if table.is_some() || self.carried.contains_key(&said.variable) => {
                match self.value(&said, table) {
                    Ok(value) => self.take(comms, &said.variable, line, |comms| {
                        comms.publish_value(&said.variable, value.as_ref(), Origin::default())
                    }),
                    Err(reason) => {
                        self.refuse(comms, Some(&said.variable), line, &reason);
                        Ok(())
                    }
                }
            }
            (said, _) => {
                self.next = Some((line, said));
                self.ask(comms)
            }
        }
    }

    /// The value that is to be published.
    fn value(&mut self, said: &Publish, table: Option<&CommunityTable>) -> Result<elk_bus::Value, String> {
        words::check_variable(&said.variable)?;
        if let Some(carried) = self.carried.get(&said.variable) {
            return carried.value(said);
        }
        let table = table.ok_or("nobody has said what it carries")?;
        let carried = Carried::of(table, &said.variable).map_or_else(|| Carried::guessed(table, said), Ok)?;
        let value = carried.value(said)?;
        if self.carried.len() >= MOST_CARRIED {
            self.carried.clear();
        }
        self.carried.insert(said.variable.clone(), carried);
        Ok(value)
    }

    /// Does something on the bus; what is too long for it is refused.
    fn take(
        &mut self,
        comms: &mut Comms,
        what: &str,
        line: u64,
        act: impl FnOnce(&mut Comms) -> Result<(), CommsError>,
    ) -> Result<(), AppError> {
        match act(comms) {
            Err(error @ (CommsError::Name(..) | CommsError::Value { .. })) => {
                self.refuse(comms, Some(what), line, &error.to_string());
                Ok(())
            }
            done => Ok(done?),
        }
    }

    /// Tells the program, and at first the log, that a line was not taken.
    fn refuse(&mut self, comms: &Comms, what: Option<&str>, line: u64, reason: &str) {
        self.refused += 1;
        if self.refused <= REFUSALS_IN_LOG {
            let last = if self.refused == REFUSALS_IN_LOG { " (of more the log says nothing)" } else { "" };
            let of = what.map_or_else(String::new, |what| format!(", {what}"));
            tell(format_args!("{}: line {line} of {}{of} was not taken: {reason}{last}", comms.name(), self.title));
        }
        self.say(&words::refused(what, Some(line), reason));
    }

    /// Asks the broker what variables carry.
    fn ask(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.asked = Some(Stopwatch::start());
        Ok(comms.notify(REQUEST, 1.0)?)
    }

    /// The broker has answered.
    fn learn(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        let table = mail.decode(&TABLE)?;
        self.asked = None;
        self.ring();
        match self.next.take() {
            Some((line, said)) => self.obey(comms, line, said, Some(&table)),
            None => Ok(()),
        }
    }

    /// The program has ended.
    fn over(&mut self, comms: &mut Comms, status: std::process::ExitStatus) -> Result<(), AppError> {
        if status.success() {
            comms.stop();
            return Ok(());
        }
        let words = self.program.as_ref().and_then(Program::last_words);
        let words = words.map_or_else(String::new, |words| format!(": {words}"));
        Err(format!("{} ended with {}{words}", self.title, child::how(status)).into())
    }

    /// Takes what the program still has to say, until it ends; whether it does.
    fn hear_out(&mut self, comms: &mut Comms) -> Result<bool, AppError> {
        let waited = Stopwatch::start();
        while waited.elapsed() < STOP_PATIENCE {
            self.program.iter().for_each(|program| program.wait(LOOK_EVERY));
            match self.hear() {
                Some(Heard::Ended(_)) => return Ok(true),
                Some(Heard::Line(line, said)) => match said.and_then(|said| Said::of(&said)) {
                    // Who is about to go is not told any more what a variable carries.
                    Ok(Said::Publish(said)) if self.carried.contains_key(&said.variable) => {
                        self.obey(comms, line, Said::Publish(said), None)?;
                    }
                    Ok(Said::Log(words)) => self.obey(comms, line, Said::Log(words), None)?,
                    _ => {}
                },
                None => {}
            }
        }
        Ok(false)
    }

    /// A message as a line.
    fn line_of(mail: &Mail<'_>, told: Arrays) -> Result<Value, Rejection> {
        let (type_name, value) = match mail.value() {
            ValueRef::Double(number) => ("number", words::number(number)),
            ValueRef::Text(text) => ("text", text.into()),
            ValueRef::Binary { type_, bytes } => {
                let name = type_.name();
                if bytes.len() > LARGEST_VALUE {
                    return Err(Rejection::new(format_args!(
                        "its value has {} bytes; a program is given {LARGEST_VALUE} at most",
                        bytes.len()
                    )));
                }
                let description = type_.description();
                let description =
                    description.ok_or_else(|| Rejection::new(format_args!("nobody has described {name}")))?;
                let value = description.to_json(bytes, usize::MAX).map_err(Rejection::new)?;
                let value = if told == Arrays::Base64 { arrays::packed(description.kind(), value) } else { value };
                (name, value)
            }
        };
        Ok(words::mail(mail, type_name, value))
    }
}

impl App for PipeApp {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.start(comms)?;
        for wanted in &self.registrations {
            comms.register(wanted.subscription())?;
        }
        self.get_ready(comms)
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        if self.asked.is_some() && mail.is(&TABLE) {
            return self.learn(comms, mail);
        }
        let line = Self::line_of(mail, self.arrays)?;
        let lost = comms.dropped() + self.unsaid;
        if lost > self.lost && self.say(&words::lost(lost - self.lost)) {
            self.lost = lost;
        }
        self.unsaid += u64::from(!self.say(&line));
        Ok(())
    }

    fn iterate(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        match &self.asked {
            // Perhaps the broker has died meanwhile.
            Some(asked) if asked.elapsed() > TABLE_PATIENCE => self.ask(comms),
            _ => Ok(()),
        }
    }

    fn tick_period(&self) -> Option<Duration> {
        Some(TABLE_PATIENCE)
    }

    fn wake_fd(&self) -> Option<BorrowedFd<'_>> {
        self.program.as_ref().map(Program::bell)
    }

    fn on_wake(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        if self.asked.is_some() {
            // With the answer it rings again.
            self.program.iter().for_each(Program::hush);
            return Ok(());
        }
        if let Some((line, said)) = self.next.take() {
            self.ring();
            return self.obey(comms, line, said, None);
        }
        match self.hear() {
            None => Ok(()),
            Some(Heard::Ended(status)) => self.over(comms, status),
            Some(Heard::Line(line, said)) => match said.and_then(|said| Said::of(&said)) {
                Ok(said) => self.obey(comms, line, said, None),
                Err(reason) => {
                    self.refuse(comms, None, line, &reason);
                    Ok(())
                }
            },
        }
    }

    fn takes_mail(&self) -> bool {
        self.program.as_ref().is_none_or(Program::reads)
    }

    fn on_refused(&mut self, _: &mut Comms, refused: &Refused) -> Result<(), AppError> {
        // It may carry something else by now.
        self.carried.remove(&refused.key);
        self.say(&words::refused(Some(&refused.key), None, &refused.reason));
        Ok(())
    }

    fn on_stop(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        let Some(program) = &self.program else { return Ok(()) };
        program.close_input();
        program.signal(Signal::TERM);
        let ended = self.hear_out(comms);
        if !matches!(ended, Ok(true)) {
            let secs = STOP_PATIENCE.as_secs();
            tell(format_args!("{}: {} did not end within {secs} s: it is killed", comms.name(), self.title));
            self.program.iter().for_each(|program| program.signal(Signal::KILL));
            self.hear_out(comms)?;
        }
        ended.map(drop)
    }
}
