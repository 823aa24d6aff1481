//! Questions and answers: two ordinary variables, so that logs and `elk echo` see both, and a person can ask with `elk poke`.
//!
//! Which answer is to which question stands in the messages' source aux, as MOOS calls it: `#7` with a question, `NAME#7`
//! with the answer to number 7 of the client NAME. So any two payloads make a [`Request`], and an asker tells its own answers
//! from those to others, from late ones and from doubled ones.
//!
//! ```
//! use std::time::Duration;
//! use elk_bus::{App, AppError, Asker, Comms, Handlers, Mail, Request, payload};
//!
//! /// The city whose weather is asked for.
//! #[payload]
//! pub struct City {
//!     /// Its name.
//!     pub name: String,
//! }
//!
//! /// The weather there.
//! #[payload]
//! pub struct Weather {
//!     /// The temperature in the shade.
//!     #[describe(unit = "°C")]
//!     pub temperature: f64,
//! }
//!
//! const WEATHER: Request<City, Weather> = Request::new("WEATHER_REQUEST", "WEATHER");
//!
//! /// Who answers needs one row.
//! struct Station;
//!
//! fn station() -> impl App {
//!     Handlers::new().serve(&WEATHER, |_: &mut Station, _, _| Ok::<_, AppError>(Weather { temperature: 7.0 })).with(Station)
//! }
//!
//! /// Who asks has an asker, which knows what is still unanswered.
//! struct Walker(Asker<City, Weather>);
//!
//! impl Walker {
//!     fn on_the_bus() -> impl App {
//!         Handlers::new()
//!             .on_with(&WEATHER.answer, Self::on_weather)
//!             .caught_up(|walker: &mut Self, comms| walker.0.ask(comms, &City { name: "Athens".into() }).map(drop))
//!             .iterate(Duration::from_secs(1), Self::look)
//!             .with(Self(Asker::new(WEATHER, Duration::from_secs(5))))
//!     }
//!
//!     fn on_weather(&mut self, comms: &mut Comms, weather: Weather, mail: &Mail<'_>) -> Result<(), AppError> {
//!         match self.0.take_answer(comms, mail) {
//!             Some(_) => Ok(comms.notify("CAP", if weather.temperature < 10.0 { "wool" } else { "straw" })?),
//!             None => Ok(()),
//!         }
//!     }
//!
//!     fn look(&mut self, comms: &mut Comms) -> Result<(), AppError> {
//!         match self.0.take_overdue(comms).is_empty() {
//!             true => Ok(()),
//!             false => Ok(comms.notify("CAP", "any: nobody knows the weather")?),
//!         }
//!     }
//! }
//! # let _ = (station(), Walker::on_the_bus());
//! ```

use std::collections::BTreeMap;
use std::time::Duration;

use elk_proto::rejection::Rejection;

use crate::comms::{Comms, CommsError, Origin};
use crate::failure::AppError;
use crate::handlers::Handlers;
use crate::key::{Key, Payload};
use crate::mail::Mail;
use crate::subscription::Subscribe;
use crate::wire;

/// What can be asked, and what the answer is.
#[derive(Debug)]
pub struct Request<Q: Payload, R: Payload> {
    /// The variable of the questions.
    pub question: Key<Q>,
    /// The variable of the answers.
    pub answer: Key<R>,
}

impl<Q: Payload, R: Payload> Clone for Request<Q, R> {
    fn clone(&self) -> Self {
        Self { question: self.question.clone(), answer: self.answer.clone() }
    }
}

impl<Q: Payload, R: Payload> Request<Q, R> {
    /// Questions and answers under these two names.
    pub const fn new(question: &'static str, answer: &'static str) -> Self {
        Self { question: Key::new(question), answer: Key::new(answer) }
    }

    /// Answers a question, now or later.
    ///
    /// # Errors
    /// The bus failed.
    pub fn answer(&self, comms: &mut Comms, to: &Question, with: &R::View<'_>) -> Result<(), CommsError> {
        let source_aux = &format!("{}#{}", to.asker, to.number);
        comms.publish_from(&self.answer, with, Origin { source_aux, ..Origin::default() })
    }
}

/// Whose question it is, and which of theirs.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Question {
    /// The client that asks.
    pub asker: String,
    /// Its number; 0: it gave none, as a person does not.
    pub number: u64,
}

/// Characters of `#` and the largest number.
const MARK_BYTES: usize = 21;

impl Question {
    /// What `mail` asks.
    ///
    /// # Errors
    /// Whoever asks has a name that is too long to be answered.
    pub fn of(mail: &Mail<'_>) -> Result<Self, Rejection> {
        if mail.source().len() + MARK_BYTES > wire::MAX_NAME {
            return Err(Rejection::new("it is asked under a name that is too long to be answered"));
        }
        Ok(Self { asker: mail.source().to_owned(), number: number(mail.source_aux(), "").unwrap_or(0) })
    }
}

/// The number in a source aux that names `asker`.
fn number(source_aux: &str, asker: &str) -> Option<u64> {
    source_aux.strip_prefix(asker)?.strip_prefix('#')?.parse().ok()
}

/// The end that asks: knows which of its questions wait for an answer, and since when.
#[derive(Debug)]
pub struct Asker<Q: Payload, R: Payload> {
    request: Request<Q, R>,
    patience: Duration,
    asked: u64,
    /// By their numbers, with when they were asked (s, the community's clock).
    waiting: BTreeMap<u64, f64>,
}

impl<Q: Payload, R: Payload> Asker<Q, R> {
    /// An asker that has asked nothing yet, and waits `patience` for an answer, of the community's clock.
    pub fn new(request: Request<Q, R>, patience: Duration) -> Self {
        Self { request, patience, asked: 0, waiting: BTreeMap::new() }
    }

    /// An asker whose predecessor came to question `number` ([`Asker::asked`]): what is late for that one is not taken for
    /// an answer to this one.
    pub fn after(self, number: u64) -> Self {
        Self { asked: number, ..self }
    }

    /// Questions asked so far, those of a predecessor included: the number of the last one.
    pub fn asked(&self) -> u64 {
        self.asked
    }

    /// Whether a question waits for its answer.
    pub fn is_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Asks; answers the question's number.
    ///
    /// # Errors
    /// The bus failed.
    pub fn ask(&mut self, comms: &mut Comms, question: &Q::View<'_>) -> Result<u64, CommsError> {
        let number = self.asked.saturating_add(1);
        let source_aux = &format!("#{number}");
        comms.publish_from(&self.request.question, question, Origin { source_aux, ..Origin::default() })?;
        self.asked = number;
        self.waiting.insert(number, comms.time());
        Ok(number)
    }

    /// The number of the question that `mail` answers; `None`: it is for somebody else, comes too late, or a second time.
    pub fn take_answer(&mut self, comms: &Comms, mail: &Mail<'_>) -> Option<u64> {
        let number = number(mail.source_aux(), comms.name()).filter(|_| mail.is(&self.request.answer))?;
        self.waiting.remove(&number).map(|_| number)
    }

    /// The numbers of the questions that have waited too long. They are given up: an answer is late from now on.
    pub fn take_overdue(&mut self, comms: &Comms) -> Vec<u64> {
        self.take_overdue_at(comms.time())
    }

    fn take_overdue_at(&mut self, now: f64) -> Vec<u64> {
        // Who drives the clock may have set it back.
        self.waiting.values_mut().for_each(|since| *since = since.min(now));
        let patience = self.patience.as_secs_f64();
        self.waiting.extract_if(.., |_, since| now - *since >= patience).map(|(number, _)| number).collect()
    }
}

impl<S> Handlers<S> {
    /// Answers requests: registers for the questions, and has `answer` answer each. One that is asked a second time, because
    /// this app or the one before it was killed over it, is answered a second time; the asker passes that over.
    ///
    /// Who cannot answer at once handles the questions in a row of its own ([`Handlers::on_with`]), keeps [`Question::of`] its
    /// mail, and says [`Request::answer`] when it can.
    pub fn serve<Q, R, F, E>(self, request: &Request<Q, R>, answer: F) -> Self
    where
        Q: Payload + 'static,
        R: Payload + 'static,
        F: for<'a> Fn(&mut S, &mut Comms, Q::View<'a>) -> Result<R::View<'static>, E> + Send + 'static,
        E: Into<AppError>,
    {
        let own = request.clone();
        let react = move |app: &mut S, comms: &mut Comms, mail: Mail<'_>| -> Result<(), AppError> {
            let question = Question::of(&mail)?;
            let answer = answer(app, comms, mail.decode(&own.question)?).map_err(Into::into)?;
            Ok(own.answer(comms, &question, &answer)?)
        };
        self.on(request.question.subscription().as_it_comes(), react)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::MemoryBroker;
    use crate::{App, BrokerConfig, Client, Clock, Community, Handled};

    /// A number.
    #[crate::payload]
    #[derive(Debug, PartialEq)]
    pub struct Given {
        /// The number.
        pub number: f64,
    }

    const HALF: Request<Given, Given> = Request::new("HALF_REQUEST", "HALF");

    struct Bench {
        broker: MemoryBroker,
        service: Handled<()>,
        server: Client,
    }

    fn halve(_: &mut (), _: &mut Comms, given: Given) -> Result<Given, AppError> {
        Ok(Given { number: given.number / 2.0 })
    }

    impl Bench {
        fn new() -> Self {
            let broker = MemoryBroker::new(BrokerConfig::new("request"), Clock::new(1.0));
            let service = Handlers::new().serve(&HALF, halve).with(());
            let mut bench = Self { server: join(&broker, "server"), service, broker };
            bench.service.on_start_up(&mut bench.server.comms).unwrap();
            bench.serve();
            bench
        }

        /// Answers all that was asked.
        fn serve(&mut self) {
            let (service, Client { comms, inbox }) = (&mut self.service, &mut self.server);
            while inbox.receive(comms, Duration::ZERO, |comms, mail| service.on_new_mail(comms, mail)).unwrap() > 0 {}
            comms.flush().unwrap();
        }

        fn asker(&self, name: &str) -> (Client, Asker<Given, Given>) {
            let mut client = join(&self.broker, name);
            client.comms.register(&HALF.answer).unwrap();
            client.comms.flush().unwrap();
            (client, Asker::new(HALF, Duration::from_secs(5)))
        }
    }

    fn join(broker: &MemoryBroker, name: &str) -> Client {
        Client::over(broker.connect(name).unwrap(), name, &Community::new("request").unwrap())
    }

    fn ask((client, asker): &mut (Client, Asker<Given, Given>), number: f64) -> u64 {
        let asked = asker.ask(&mut client.comms, &Given { number }).unwrap();
        client.comms.flush().unwrap();
        asked
    }

    /// The answers that came: to which question, and what.
    fn answers((client, asker): &mut (Client, Asker<Given, Given>)) -> Vec<(Option<u64>, f64)> {
        let mut answers = Vec::new();
        let note = |comms: &mut Comms, mail: &Mail<'_>| -> Result<(), AppError> {
            answers.push((asker.take_answer(comms, mail), mail.decode(&HALF.answer)?.number));
            Ok(())
        };
        client.inbox.receive(&mut client.comms, Duration::ZERO, note).unwrap();
        answers
    }

    #[test]
    fn each_asker_is_answered_by_number_and_what_is_for_another_one_is_passed_over() {
        let mut bench = Bench::new();
        let (mut ada, mut bob) = (bench.asker("ada"), bench.asker("bob"));
        assert_eq!([ask(&mut ada, 2.0), ask(&mut bob, 6.0), ask(&mut ada, 4.0)], [1, 1, 2]);
        bench.serve();
        assert_eq!(answers(&mut ada), [(Some(1), 1.0), (None, 3.0), (Some(2), 2.0)]);
        assert_eq!(answers(&mut bob), [(None, 1.0), (Some(1), 3.0), (None, 2.0)]);
        assert!(!ada.1.is_waiting() && !bob.1.is_waiting());
    }

    #[test]
    fn an_answer_that_comes_twice_or_to_a_predecessor_is_passed_over() {
        let mut bench = Bench::new();
        let mut ada = bench.asker("ada");
        let first = ask(&mut ada, 2.0);
        bench.serve();
        let question = Question { asker: "ada".into(), number: first };
        HALF.answer(&mut bench.server.comms, &question, &Given { number: 9.0 }).unwrap();
        bench.server.comms.flush().unwrap();
        assert_eq!(answers(&mut ada), [(Some(1), 1.0), (None, 9.0)]);
        let mut successor = (ada.0, Asker::new(HALF, Duration::from_secs(5)).after(ada.1.asked()));
        assert_eq!(ask(&mut successor, 8.0), 2);
        HALF.answer(&mut bench.server.comms, &question, &Given { number: 9.0 }).unwrap();
        bench.serve();
        assert_eq!(answers(&mut successor), [(None, 9.0), (Some(2), 4.0)]);
    }

    #[test]
    fn patience_is_of_the_community_s_clock_and_what_is_late_is_no_answer() {
        let mut bench = Bench::new();
        let mut ada = bench.asker("ada");
        ada.0.comms.drive_clock(crate::Drive::standing_at(100.0)).unwrap();
        ask(&mut ada, 2.0);
        assert!(ada.1.take_overdue(&ada.0.comms).is_empty(), "its time stands still");
        ada.0.comms.drive_clock(crate::Drive::standing_at(3.0)).unwrap();
        assert!(ada.1.take_overdue(&ada.0.comms).is_empty(), "set back, it waits anew");
        ada.0.comms.drive_clock(crate::Drive::standing_at(8.0)).unwrap();
        assert_eq!(ada.1.take_overdue(&ada.0.comms), [1]);
        bench.serve();
        assert_eq!(answers(&mut ada), [(None, 1.0)]);
    }

    #[test]
    fn a_person_who_gives_no_number_is_answered_all_the_same() {
        let mut bench = Bench::new();
        let mut ada = bench.asker("ada");
        ada.0.comms.publish(&HALF.question, &Given { number: 1.0 }).unwrap();
        ada.0.comms.flush().unwrap();
        bench.serve();
        let mut aux = String::new();
        ada.0.receive(Duration::ZERO, |mail| mail.source_aux().clone_into(&mut aux)).unwrap();
        assert_eq!(aux, "ada#0");
    }

    #[test]
    fn a_mark_is_of_the_asker_whose_name_it_has_whatever_that_is() {
        assert_eq!(number("a#b#7", "a#b"), Some(7));
        for foreign in ["a#b#7", "#7", "a7", "a#", "a#-1", "a#7#7", "a#99999999999999999999"] {
            assert_eq!(number(foreign, "a"), None, "{foreign}");
        }
    }
}
