//! An app as one table: what it hears, what it does with it, what it remembers of its predecessor.
//!
//! The table is all that there is to say of an app on the bus; what it says is registered when the app starts, memory first.
//! A message goes to the first row that it fits, decoded; one that does not decode, or breaks a rule of its type, does not
//! get as far: that is said and counted (see [`rejection`](crate::rejection)), and so is one that no row fits.
//!
//! ```
//! use std::time::Duration;
//! use elk_bus::{App, AppError, Comms, Handlers, Key, Mail, any, number, payload};
//!
//! /// What a counter leaves to its successor.
//! #[payload]
//! pub struct Memory {
//!     /// The sum so far.
//!     pub sum: f64,
//! }
//!
//! const MEMORY: Key<Memory> = Key::new("SUM_MEMORY");
//!
//! #[derive(Default)]
//! struct Counter {
//!     sum: f64,
//! }
//!
//! impl Counter {
//!     fn on_the_bus(self) -> impl App {
//!         Handlers::<Self>::new()
//!             .recall(&MEMORY, Self::thaw)
//!             .on(number("ADD"), Self::add)
//!             .on(any("*_ERROR").from("Sensor*").every(Duration::from_secs(1)), Self::on_trouble)
//!             .on_stop(|counter, comms| comms.publish(&MEMORY, &Memory { sum: counter.sum }))
//!             .with(self)
//!     }
//!
//!     fn thaw(&mut self, _: &mut Comms, memory: Memory) -> Result<(), AppError> {
//!         self.sum = memory.sum;
//!         Ok(())
//!     }
//!
//!     fn add(&mut self, comms: &mut Comms, more: f64) -> Result<(), AppError> {
//!         self.sum += more;
//!         Ok(comms.notify("SUM", self.sum)?)
//!     }
//!
//!     fn on_trouble(&mut self, comms: &mut Comms, trouble: Mail<'_>) -> Result<(), AppError> {
//!         Ok(comms.notify("HEARD", trouble.key())?)
//!     }
//! }
//! # let _ = Counter::default().on_the_bus();
//! ```

use std::time::Duration;

use elk_drawing::{KeyPress, KeyTable, KeyUse, variables};
use elk_proto::rejection::Rejection;

use crate::app::App;
use crate::comms::Comms;
use crate::failure::AppError;
use crate::mail::Mail;
use crate::recall::{self, Recall};
use crate::subscription::{Reads, Subscribe, Terms};

/// What an app of type `S` does with which message, and when.
pub struct Handlers<S> {
    rows: Vec<Row<S>>,
    start: Act<S>,
    recalled: Option<Act<S>>,
    caught_up: Option<Act<S>>,
    after_each: Act<S>,
    iterate: Act<S>,
    period: Option<Duration>,
    stop: Act<S>,
    draw: Option<Act<S>>,
    keys: Vec<(KeyUse, OnKey<S>)>,
    gathering: Option<Duration>,
}

type Act<S> = Box<dyn Fn(&mut S, &mut Comms) -> Result<(), AppError> + Send>;
type OnKey<S> = Box<dyn Fn(&mut S, &mut Comms, &KeyPress) -> Result<(), AppError> + Send>;
type React<S> = Box<dyn Fn(&mut S, &mut Comms, &Mail<'_>) -> Result<(), AppError> + Send>;

struct Row<S> {
    terms: Terms,
    when: When,
    react: React<S>,
}

/// When a row counts.
#[derive(Clone, Copy, PartialEq, Eq)]
enum When {
    /// While the app recalls what its predecessor has left.
    Recalling,
    /// From the start on, or for a variable that is recalled, from the end of the recollection on.
    Always,
    /// Once the app has registered for it itself.
    Wanted,
}

fn nothing<S>() -> Act<S> {
    Box::new(|_, _| Ok(()))
}

fn act<S, E: Into<AppError>>(act: impl Fn(&mut S, &mut Comms) -> Result<(), E> + Send + 'static) -> Act<S> {
    Box::new(move |app, comms| act(app, comms).map_err(Into::into))
}

impl<S> Default for Handlers<S> {
    fn default() -> Self {
        Self {
            rows: Vec::new(),
            start: nothing(),
            recalled: None,
            caught_up: None,
            after_each: nothing(),
            iterate: nothing(),
            period: None,
            stop: nothing(),
            draw: None,
            keys: Vec::new(),
            gathering: None,
        }
    }
}

impl<S> Handlers<S> {
    /// An empty table: an app that hears nothing.
    pub fn new() -> Self {
        Self::default()
    }

    fn with_row<W: Subscribe>(mut self, what: W, when: When, react: React<S>) -> Self {
        self.rows.push(Row { terms: what.subscription().terms, when, react });
        self
    }

    /// Registers for something, and has `handle` do what is to be done with each message of it, as it is read.
    pub fn on<W, F, E>(self, what: W, handle: F) -> Self
    where
        W: Subscribe,
        F: for<'a> Fn(&mut S, &mut Comms, <W::As as Reads>::View<'a>) -> Result<(), E> + Send + 'static,
        E: Into<AppError>,
    {
        self.with_row(what, When::Always, reader::<W, _, _, _>(handle))
    }

    /// As [`Handlers::on`], for who also asks when a message was said, by whom, or whether it is but the latest one.
    pub fn on_with<W, F, E>(self, what: W, handle: F) -> Self
    where
        W: Subscribe,
        F: for<'a> Fn(&mut S, &mut Comms, <W::As as Reads>::View<'a>, &Mail<'a>) -> Result<(), E> + Send + 'static,
        E: Into<AppError>,
    {
        let react = move |app: &mut S, comms: &mut Comms, mail: &Mail<'_>| {
            handle(app, comms, W::As::read(mail)?, mail).map_err(Into::into)
        };
        self.with_row(what, When::Always, Box::new(react))
    }

    /// As [`Handlers::on`], for what the app registers for itself when it wants it, and may take back.
    pub fn when_wanted<W, F, E>(self, what: W, handle: F) -> Self
    where
        W: Subscribe,
        F: for<'a> Fn(&mut S, &mut Comms, <W::As as Reads>::View<'a>) -> Result<(), E> + Send + 'static,
        E: Into<AppError>,
    {
        self.with_row(what, When::Wanted, reader::<W, _, _, _>(handle))
    }

    /// Asks for what a predecessor said last of this, before anything else is heard. It counts for no more than that: what
    /// the app itself says there does not come back to it, unless another row registers for it.
    pub fn recall<W, F, E>(self, what: W, handle: F) -> Self
    where
        W: Subscribe,
        F: for<'a> Fn(&mut S, &mut Comms, <W::As as Reads>::View<'a>) -> Result<(), E> + Send + 'static,
        E: Into<AppError>,
    {
        self.with_row(what, When::Recalling, reader::<W, _, _, _>(handle))
    }

    /// Calls `then` once all that is to be recalled is here, and before the first message of another row.
    pub fn recalled<E: Into<AppError>>(
        mut self,
        then: impl Fn(&mut S, &mut Comms) -> Result<(), E> + Send + 'static,
    ) -> Self {
        self.recalled = Some(act(then));
        self
    }

    /// Calls `then` once all latest values are here of what is registered for.
    pub fn caught_up<E: Into<AppError>>(
        mut self,
        then: impl Fn(&mut S, &mut Comms) -> Result<(), E> + Send + 'static,
    ) -> Self {
        self.caught_up = Some(act(then));
        self
    }

    /// Calls `then` after each message that was made use of, and after [`Handlers::caught_up`].
    pub fn after_each<E: Into<AppError>>(
        mut self,
        then: impl Fn(&mut S, &mut Comms) -> Result<(), E> + Send + 'static,
    ) -> Self {
        self.after_each = act(then);
        self
    }

    /// Calls `then` when the broker has let the app in, before anything is registered.
    pub fn on_start_up<E: Into<AppError>>(
        mut self,
        then: impl Fn(&mut S, &mut Comms) -> Result<(), E> + Send + 'static,
    ) -> Self {
        self.start = act(then);
        self
    }

    /// Calls `then` once in each `period` (of the community's clock; see [`App::iterate`]).
    pub fn iterate<E: Into<AppError>>(
        mut self,
        period: Duration,
        then: impl Fn(&mut S, &mut Comms) -> Result<(), E> + Send + 'static,
    ) -> Self {
        (self.period, self.iterate) = (Some(period), act(then));
        self
    }

    /// Calls `then` on the way out, while the bus is still there.
    pub fn on_stop<E: Into<AppError>>(
        mut self,
        then: impl Fn(&mut S, &mut Comms) -> Result<(), E> + Send + 'static,
    ) -> Self {
        self.stop = act(then);
        self
    }

    /// Calls `then` when somebody begins to look at what the app draws (see [`App::draw`]).
    pub fn draw<E: Into<AppError>>(
        mut self,
        then: impl Fn(&mut S, &mut Comms) -> Result<(), E> + Send + 'static,
    ) -> Self {
        self.draw = Some(act(then));
        self
    }

    /// Takes a key, and calls `then` when it is pressed; `meaning` is what people are shown (see [`Comms::take_keys`]).
    pub fn on_key<E: Into<AppError>>(
        mut self,
        key: &str,
        meaning: &str,
        then: impl Fn(&mut S, &mut Comms, &KeyPress) -> Result<(), E> + Send + 'static,
    ) -> Self {
        let declared = KeyUse { key: key.to_owned(), meaning: meaning.to_owned() };
        let on_key =
            move |app: &mut S, comms: &mut Comms, press: &KeyPress| then(app, comms, press).map_err(Into::into);
        self.keys.push((declared, Box::new(on_key)));
        self
    }

    /// Lets mail gather for so long (see [`App::gathering`]).
    pub fn gathering(mut self, time: Duration) -> Self {
        self.gathering = Some(time);
        self
    }

    /// The app that does with `state` what the table says.
    pub fn with(self, state: S) -> Handled<S> {
        let recall = Recall::of(self.of(When::Recalling).cloned());
        Handled { state, waits_for_mark: !recall.is_over() || self.caught_up.is_some(), recall, table: self }
    }

    /// The row that a message goes to.
    fn row(&self, recall: &Recall, mail: &Mail<'_>) -> Option<&Row<S>> {
        let recalling = recall.fits(mail);
        let counts = |row: &Row<S>| (row.when == When::Recalling) == recalling;
        self.rows.iter().find(|row| counts(row) && row.terms.fits(mail.key(), mail.source()))
    }

    fn of(&self, when: When) -> impl Iterator<Item = &Terms> {
        self.rows.iter().filter(move |row| row.when == when).map(|row| &row.terms)
    }
}

/// A handler of read values as one of mail.
fn reader<W, S, F, E>(handle: F) -> React<S>
where
    W: Subscribe,
    F: for<'a> Fn(&mut S, &mut Comms, <W::As as Reads>::View<'a>) -> Result<(), E> + Send + 'static,
    E: Into<AppError>,
{
    Box::new(move |app, comms, mail| handle(app, comms, W::As::read(mail)?).map_err(Into::into))
}

/// An app whose table says what it does: [`Handlers::with`].
pub struct Handled<S> {
    /// What the handlers work on.
    pub state: S,
    table: Handlers<S>,
    recall: Recall,
    /// The mark, behind all latest values, has not come yet.
    waits_for_mark: bool,
}

impl<S> Handled<S> {
    /// Ends the recollection with the first message that is none of it.
    fn end_recall(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        if self.recall.is_over() || self.recall.fits(mail) {
            return Ok(());
        }
        let recalled = self.recall.end(comms)?;
        let done = self.table.recalled.as_ref().map_or(Ok(()), |then| then(&mut self.state, comms));
        // What the app has said in the meantime is among the latest values.
        for terms in self.table.of(When::Always).filter(|terms| recalled.is_for(terms)) {
            comms.register_for(terms)?;
        }
        done
    }

    fn catch_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.waits_for_mark = false;
        recall::let_go_of_mark(comms)?;
        let Some(then) = &self.table.caught_up else { return Ok(()) };
        then(&mut self.state, comms)?;
        (self.table.after_each)(&mut self.state, comms)
    }

    /// Whether a message that no row is for came all the same: memory of others, or a mark, that was on its way already.
    fn is_expected(&self, mail: &Mail<'_>) -> bool {
        recall::is_mark(mail) || self.table.rows.iter().any(|row| row.terms.fits(mail.key(), mail.source()))
    }
}

impl<S: Send> App for Handled<S> {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        (self.table.start)(&mut self.state, comms)?;
        self.recall.ask(comms)?;
        for terms in self.table.of(When::Always).filter(|terms| !self.recall.is_for(terms)) {
            comms.register_for(terms)?;
        }
        if self.waits_for_mark {
            recall::ask_for_mark(comms)?;
        }
        if !self.table.keys.is_empty() {
            comms.take_keys(&KeyTable { keys: self.table.keys.iter().map(|(key, _)| key.clone()).collect() })?;
        }
        if self.table.draw.is_some() {
            comms.is_watched()?;
        }
        Ok(())
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        self.end_recall(comms, mail)?;
        if self.waits_for_mark && recall::is_mark(mail) {
            self.catch_up(comms)?;
        }
        if !self.table.keys.is_empty() && mail.is(&variables::key_press(comms.name())) {
            let press = mail.decode(&variables::key_press(comms.name()))?;
            let Some((_, then)) = self.table.keys.iter().find(|(key, _)| key.key == press.key) else {
                return Err(Rejection::new(format_args!("{:?} is no key of this app's", press.key)).into());
            };
            then(&mut self.state, comms, &press)?;
            return (self.table.after_each)(&mut self.state, comms);
        }
        let Some(row) = self.table.row(&self.recall, mail) else {
            let unheard_of = || Rejection::new("it is registered for, but no row of the app's table is for it");
            return if self.is_expected(mail) { Ok(()) } else { Err(unheard_of().into()) };
        };
        (row.react)(&mut self.state, comms, mail)?;
        (self.table.after_each)(&mut self.state, comms)
    }

    fn iterate(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        (self.table.iterate)(&mut self.state, comms)
    }

    fn on_stop(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        (self.table.stop)(&mut self.state, comms)
    }

    fn draw(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        self.table.draw.as_ref().map_or(Ok(()), |then| then(&mut self.state, comms))
    }

    fn tick_period(&self) -> Option<Duration> {
        self.table.period
    }

    fn gathering(&self) -> Option<Duration> {
        self.table.gathering
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::memory::MemoryBroker;
    use crate::{BrokerConfig, Client, Clock, Community, Key, any, number, run_app_on, text};

    /// What an app was about.
    #[crate::payload]
    #[derive(Debug, PartialEq)]
    pub struct Errand {
        /// How far it was.
        pub steps: u64,
    }

    const ERRAND: Key<Errand> = Key::new("ERRAND");

    /// What it has done, in words.
    #[derive(Default)]
    struct Worker {
        done: Vec<String>,
    }

    impl Worker {
        fn done(&mut self, what: impl std::fmt::Display) -> Result<(), AppError> {
            self.done.push(what.to_string());
            Ok(())
        }

        fn on_the_bus(self) -> Handled<Self> {
            Handlers::<Self>::new()
                .recall(&ERRAND, |worker, _, errand| worker.done(format_args!("recalls {}", errand.steps)))
                .recalled(Self::begin)
                .on(&ERRAND, Self::on_errand)
                .on_with(number("STEP"), |worker, _, steps, mail| {
                    worker.done(format_args!("{} {steps}", mail.source()))
                })
                .on(text("WORD"), |worker, _, word| worker.done(word))
                .on("WHO", |worker, _, who| worker.done(who.key()))
                .on("WHO", |worker, _, _| worker.done("a second row for one message"))
                .when_wanted(number("LATER"), |worker, _, number| worker.done(number))
                .caught_up(|worker, _| worker.done("caught up"))
                .with(self)
        }

        fn on_errand(&mut self, comms: &mut Comms, errand: Errand) -> Result<(), AppError> {
            comms.stop();
            self.done(format_args!("errand {}", errand.steps))
        }

        fn begin(&mut self, comms: &mut Comms) -> Result<(), AppError> {
            comms.publish(&ERRAND, &Errand { steps: 7 })?;
            self.done("begins")
        }
    }

    struct Bench {
        broker: MemoryBroker,
        speaker: Client,
    }

    impl Bench {
        fn new() -> Self {
            let broker = MemoryBroker::new(BrokerConfig::new("handlers"), Clock::new(1.0));
            Self { speaker: Self::join(&broker, "speaker"), broker }
        }

        fn join(broker: &MemoryBroker, name: &str) -> Client {
            Client::over(broker.connect(name).unwrap(), name, &Community::new("handlers").unwrap())
        }

        /// What a worker does that is started now, until it hears of its own beginning.
        fn work(&mut self) -> Vec<String> {
            self.speaker.comms.flush().unwrap();
            let (mut app, mut client) = (Worker::default().on_the_bus(), Self::join(&self.broker, "worker"));
            run_app_on(&mut app, &mut client, &AtomicBool::new(false)).unwrap();
            assert_eq!(client.comms.rejected(), 0);
            app.state.done
        }
    }

    #[test]
    fn a_message_goes_to_the_first_row_that_it_fits_as_it_is_read() {
        let mut bench = Bench::new();
        bench.speaker.comms.notify("STEP", 2.0).unwrap();
        bench.speaker.comms.notify("WORD", "on").unwrap();
        bench.speaker.comms.notify("WHO", "me").unwrap();
        bench.speaker.comms.notify("LATER", 1.0).unwrap();
        assert_eq!(bench.work(), ["begins", "speaker 2", "on", "WHO", "caught up", "errand 7"]);
    }

    #[test]
    fn memory_comes_first_and_what_is_said_after_it_is_heard_by_who_registered_for_it() {
        let mut bench = Bench::new();
        bench.speaker.comms.publish(&ERRAND, &Errand { steps: 3 }).unwrap();
        bench.speaker.comms.notify("WORD", "on").unwrap();
        assert_eq!(bench.work(), ["recalls 3", "begins", "on", "caught up", "errand 7"]);
    }

    /// An app that is stopped by what it hears of its own, behind the mark.
    #[test]
    fn who_has_caught_up_has_heard_all_that_there_was() {
        let bench = Bench::new();
        let table = Handlers::<Worker>::new()
            .on(&ERRAND, |_, comms: &mut Comms, _| {
                comms.stop();
                Ok::<(), AppError>(())
            })
            .on(number("STEP"), |worker, _, steps| worker.done(steps))
            .caught_up(Worker::begin)
            .after_each(|worker, _| worker.done("after"));
        let (mut app, mut client) = (table.with(Worker::default()), Bench::join(&bench.broker, "worker"));
        run_app_on(&mut app, &mut client, &AtomicBool::new(false)).unwrap();
        assert_eq!(app.state.done, ["begins", "after", "after"]);
    }

    #[test]
    fn what_no_row_is_for_is_said_and_counted() {
        let mut bench = Bench::new();
        bench.speaker.comms.notify("ODD", 1.0).unwrap();
        bench.speaker.comms.notify("STOP", 1.0).unwrap();
        bench.speaker.comms.flush().unwrap();
        let table = Handlers::<Worker>::new()
            .on_start_up(|_, comms| comms.register(any("ODD*")))
            .on(number("WORD"), |worker, _, number| worker.done(number))
            .on("STOP", |_, comms: &mut Comms, _| {
                comms.stop();
                Ok::<(), AppError>(())
            });
        let mut client = Bench::join(&bench.broker, "worker");
        run_app_on(&mut table.with(Worker::default()), &mut client, &AtomicBool::new(false)).unwrap();
        assert_eq!(client.comms.rejected(), 1);
    }
}
