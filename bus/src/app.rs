//! The app framework: MOOS' three callbacks, driven by mail or by a tick.

use std::fmt;
use std::os::fd::BorrowedFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use crate::broker::table;
use crate::client::Client;
use crate::clock::Stopwatch;
use crate::comms::{Comms, CommsError};
use crate::failure::{AppError, write_words};
use crate::inbox::Refused;
use crate::mail::Mail;
use crate::status::Status;
use crate::stop::Insistence;
use crate::wire;

/// An app: what it does when it starts, with each message, and at its tick.
///
/// ```no_run
/// use elk_bus::{App, AppError, Comms, Failure, Mail, RunOptions, run_app};
///
/// /// Says hello to everyone who says who they are.
/// struct Hello;
///
/// impl App for Hello {
///     fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
///         Ok(comms.register("WHO")?)
///     }
///
///     fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
///         Ok(comms.notify("GREETING", format!("hello, {}", mail.as_text().unwrap_or("whoever you are")))?)
///     }
/// }
///
/// fn main() -> Result<(), Failure> {
///     Ok(run_app(Box::new(Hello), &RunOptions::from_launcher()?)?)
/// }
/// ```
pub trait App: Send {
    /// Called once, when the broker has let the app in: register here.
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError>;

    /// Called with each message, in the broker's order. An app that fails with a [`DecodeError`](crate::DecodeError) or a
    /// [`Rejection`](crate::Rejection) cannot use this message: that is said and counted, and it is given the next one.
    /// Any other failure ends it.
    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError>;

    /// Called at the app's tick, if it has one.
    fn iterate(&mut self, _comms: &mut Comms) -> Result<(), AppError> {
        Ok(())
    }

    /// Called when somebody begins to look at what the app draws, if it has ever asked whether anybody does
    /// ([`Comms::is_watched`]): what there is to see is drawn here ([`Comms::draw`]).
    fn draw(&mut self, _comms: &mut Comms) -> Result<(), AppError> {
        Ok(())
    }

    /// Called on the way out, while the bus is still there.
    fn on_stop(&mut self, _comms: &mut Comms) -> Result<(), AppError> {
        Ok(())
    }

    /// Time between two calls of [`App::iterate`], of the community's clock; `None`: it is never called, the app is driven by
    /// mail alone.
    fn tick_period(&self) -> Option<Duration> {
        None
    }

    /// For how long mail may gather before the app is given it; little mail only: much comes at once. To be woken for
    /// every message costs an app that is in no hurry more than the messages do, and those that are in a hurry have to
    /// wait for the processor meanwhile. Before it ends, the app is given all that the broker has for it by then.
    fn gathering(&self) -> Option<Duration> {
        None
    }

    /// A descriptor that the app waits for besides its mail (a device, a socket, a child): [`App::on_wake`] is called while it
    /// is readable.
    fn wake_fd(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    /// Called when the descriptor of [`App::wake_fd`] is readable.
    fn on_wake(&mut self, _comms: &mut Comms) -> Result<(), AppError> {
        Ok(())
    }

    /// Whether an app with a [`App::wake_fd`] takes mail now. While it does not, its mail waits in its mailbox, which forgets the
    /// oldest when it is full, and counts.
    fn takes_mail(&self) -> bool {
        true
    }

    /// Called when the broker has refused a message or a registration of the app's; that is said and counted already.
    fn on_refused(&mut self, _comms: &mut Comms, _refused: &Refused) -> Result<(), AppError> {
        Ok(())
    }
}

/// Why an app's run ended badly.
#[derive(thiserror::Error)]
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

impl fmt::Debug for RunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_words(f, self)
    }
}

/// How long an app that is given what has gathered waits for the next of it, while the broker does not say that it was all.
const LAST_MAIL_PATIENCE: Duration = Duration::from_secs(5);
/// The longest that an app sleeps without looking whether it is to stop.
const LONGEST_SLEEP: Duration = Duration::from_millis(500);
/// As much mail (bytes) is not left to gather.
const MUCH_MAIL: usize = 64 << 10;

/// Runs an app on a connected client until it stops itself, fails, its successor is ready, or `stop` is set.
pub fn run_app_on(app: &mut dyn App, client: &mut Client, stop: &AtomicBool) -> Result<(), RunError> {
    run(app, client, stop, None)
}

/// As [`run_app_on`]; an app that is asked to stop has no time for the message that it is at, but all it needs to leave.
pub(crate) fn run(
    app: &mut dyn App,
    client: &mut Client,
    stop: &AtomicBool,
    insistence: Option<Insistence>,
) -> Result<(), RunError> {
    let served = serve(app, client, stop);
    drop(insistence);
    served.and_then(|()| leave(app, client)).map_err(|source| failed(client, source))
}

fn failed(client: &Client, source: AppError) -> RunError {
    match source.downcast::<CommsError>() {
        Ok(comms) => RunError::Comms(*comms),
        Err(source) => RunError::App { app: client.comms.name().to_owned(), source },
    }
}

/// Starts an app that takes turns with others on one thread ([`take_turn`]): so a whole mission is one thread's work, in an
/// order that no scheduler has a say in.
pub fn begin_app(app: &mut dyn App, client: &mut Client) -> Result<(), RunError> {
    let begun = start(app, client).and_then(|()| Ok(client.comms.flush()?));
    begun.map_err(|source| failed(client, source))
}

/// Gives an app that was begun the mail that has come, without waiting for more, and sees to it that what it says leaves;
/// answers about how many bytes it was given. Ticks are not for such an app: it is driven by mail alone.
pub fn take_turn(app: &mut dyn App, client: &mut Client) -> Result<usize, RunError> {
    let taken = receive(app, client, Duration::ZERO).and_then(|bytes| {
        hear_of_refusals(app, client)?;
        client.comms.flush()?;
        Ok(bytes)
    });
    taken.map_err(|source| failed(client, source))
}

/// Waits at most `patience` for what an app that takes turns waits for besides its mail ([`App::wake_fd`]), and wakes it;
/// answers whether it was woken. Whoever lets it wait only while nobody has mail gets the same run each time.
pub fn take_wake(app: &mut dyn App, client: &mut Client, patience: Duration) -> Result<bool, RunError> {
    let woken = app.wake_fd().map_or(Ok(false), |fd| is_readable(&[fd], patience)).and_then(|is_woken| {
        if is_woken {
            app.on_wake(&mut client.comms)?;
            client.comms.flush()?;
        }
        Ok(is_woken)
    });
    woken.map_err(|source| failed(client, source))
}

/// Starts the app and gives it its mail, until it is to leave.
fn serve(app: &mut dyn App, client: &mut Client, stop: &AtomicBool) -> Result<(), AppError> {
    start(app, client)?;
    let mut beat = Beat::new(&*app, &client.comms);
    let mut gathered = Gathered(0);
    while !stop.load(Ordering::Relaxed) && !client.comms.stopping() && !client.inbox.retiring() {
        let pause = if gathered.0 > 0 { Duration::ZERO } else { beat.pause(&client.comms) };
        let bytes = attend(app, client, pause)?;
        if let Some(time) = app.gathering() {
            gathered.rest(bytes, time);
        }
        if beat.tick_is_due(&client.comms) {
            app.iterate(&mut client.comms)?;
        }
        hear_of_refusals(app, client)?;
        beat.status.say(&mut client.comms, &client.inbox)?;
    }
    Ok(())
}

fn start(app: &mut dyn App, client: &mut Client) -> Result<(), AppError> {
    client.comms.set_starting(true);
    app.on_start_up(&mut client.comms)?;
    client.comms.set_starting(false);
    Ok(())
}

/// Has the app end, while the bus is still there.
fn leave(app: &mut dyn App, client: &mut Client) -> Result<(), AppError> {
    // What a retiring app has not read is its successor's.
    let rest = match app.gathering().is_some() && !client.inbox.retiring() {
        true => read_rest(app, client),
        false => Ok(()),
    };
    app.on_stop(&mut client.comms)?;
    rest?;
    client.comms.take_down()?;
    Ok(client.comms.say_goodbye()?)
}

fn hear_of_refusals(app: &mut dyn App, client: &mut Client) -> Result<(), AppError> {
    for refused in client.inbox.take_refusals() {
        client.comms.note_refused(&refused)?;
        app.on_refused(&mut client.comms, &refused)?;
    }
    Ok(())
}

/// Waits at most `pause` for mail and for what else the app waits for, and gives it what has come; answers about how many bytes
/// of mail that were.
fn attend(app: &mut dyn App, client: &mut Client, pause: Duration) -> Result<usize, AppError> {
    if app.wake_fd().is_none() {
        return receive(app, client, pause);
    }
    client.comms.flush()?;
    let takes_mail = app.takes_mail();
    let mail = if takes_mail { Some(client.inbox.wake_fd()?) } else { None };
    let all: Vec<BorrowedFd<'_>> = app.wake_fd().into_iter().chain(mail).collect();
    is_readable(&all, pause)?;
    if app.wake_fd().map_or(Ok(false), |fd| is_readable(&[fd], Duration::ZERO))? {
        app.on_wake(&mut client.comms)?;
    }
    if takes_mail { receive(app, client, Duration::ZERO) } else { Ok(0) }
}

/// Waits until one of these is readable; whether one is. A signal ends the wait.
fn is_readable(fds: &[BorrowedFd<'_>], patience: Duration) -> Result<bool, AppError> {
    let mut fds: Vec<PollFd<'_>> = fds.iter().map(|fd| PollFd::from_borrowed_fd(*fd, PollFlags::IN)).collect();
    let patience = Timespec::try_from(patience).ok();
    match poll(&mut fds, patience.as_ref()) {
        Err(Errno::INTR) => Ok(false),
        ready => Ok(ready? > 0),
    }
}

/// Gives the app the mail that has come, or comes within `pause`; answers about how many bytes that were.
fn receive(app: &mut dyn App, client: &mut Client, pause: Duration) -> Result<usize, AppError> {
    let mut bytes = 0;
    client.inbox.receive(&mut client.comms, pause, |comms, mail| {
        bytes += wire::HEADER + mail.value().byte_len();
        give(app, comms, mail)
    })?;
    draw_if_asked(app, &mut client.comms)?;
    Ok(bytes)
}

/// Gives the app a message. One that it cannot use does not end it: the next one may be better.
fn give(app: &mut dyn App, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
    draw_if_asked(app, comms)?;
    app.on_new_mail(comms, mail).or_else(|failure| comms.pass_over(mail, failure))
}

/// Has the app draw if somebody has begun to look, before it is given what was said after that.
fn draw_if_asked(app: &mut dyn App, comms: &mut Comms) -> Result<(), AppError> {
    if comms.take_newly_watched() { app.draw(comms) } else { Ok(()) }
}

/// Bytes of mail since an app that lets mail gather rested last.
struct Gathered(usize);

impl Gathered {
    /// Rests once all is read that has come, unless that was much: then more is on its way.
    fn rest(&mut self, bytes: usize, time: Duration) {
        self.0 += bytes;
        if bytes == 0 {
            let little = (1..MUCH_MAIL).contains(&std::mem::take(&mut self.0));
            if little {
                std::thread::sleep(time.min(LONGEST_SLEEP));
            }
        }
    }
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
            false => give(app, comms, mail),
        })?;
        if count > 0 {
            waited = Stopwatch::start();
        }
    }
    Ok(())
}

/// When to iterate, on the community's clock, and when to report, on the wall's: whoever asks how an app is has to hear of
/// it although the community's time may stand still.
struct Beat {
    period_secs: Option<f64>,
    next_tick: f64,
    status: Status,
}

impl Beat {
    fn new(app: &dyn App, comms: &Comms) -> Self {
        let period_secs = app.tick_period().filter(|period| !period.is_zero()).map(|period| period.as_secs_f64());
        Self { period_secs, next_tick: comms.time(), status: Status::new() }
    }

    fn pause(&self, comms: &Comms) -> Duration {
        let until_tick = self.period_secs.map(|_| comms.clock().real(self.next_tick - comms.time()));
        until_tick.unwrap_or(Duration::MAX).min(self.status.pause()).min(LONGEST_SLEEP)
    }

    fn tick_is_due(&mut self, comms: &Comms) -> bool {
        let Some(period) = self.period_secs else { return false };
        let (due, next) = next_tick(comms.time(), self.next_tick, period);
        self.next_tick = next;
        due
    }
}

/// Whether a tick that was set for `next` is due at `now` (s), and when the next one is.
fn next_tick(now: f64, next: f64, period: f64) -> (bool, f64) {
    // Who drives the clock may have set it back.
    let was_set_back = next > now + period;
    match now >= next || was_set_back {
        true if was_set_back => (true, now + period),
        // A tick that was missed is not made up for.
        true => (true, (next + period).max(now)),
        false => (false, next),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Sender, channel};

    use super::*;
    use crate::memory::MemoryBroker;
    use crate::{BrokerConfig, Clock, Community, Key, Rejection, rejection};

    /// An app in no hurry, that tells what it was given.
    struct Calm(Sender<f64>);

    impl App for Calm {
        fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
            Ok(comms.register("N")?)
        }

        fn on_new_mail(&mut self, _: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
            Ok(self.0.send(mail.number()?)?)
        }

        fn gathering(&self) -> Option<Duration> {
            Some(LONGEST_SLEEP)
        }
    }

    #[test]
    fn an_app_that_lets_mail_gather_is_given_all_of_it_before_it_ends() {
        let broker = MemoryBroker::new(BrokerConfig::new("calm"), Clock::new(1.0));
        let community = Community::new("calm").unwrap();
        let join = |name: &str| Client::over(broker.connect(name).unwrap(), name, &community);
        let (stop, (given, heard)) = (AtomicBool::new(false), channel());
        let mut speaker = join("speaker");
        speaker.comms.notify("N", 0.0).unwrap();
        speaker.comms.flush().unwrap();
        std::thread::scope(|scope| {
            scope.spawn(|| run_app_on(&mut Calm(given), &mut join("calm"), &stop).unwrap());
            let mut numbers = vec![heard.recv().unwrap()];
            for n in 1..100 {
                speaker.comms.notify("N", f64::from(n)).unwrap();
                speaker.comms.flush().unwrap();
            }
            stop.store(true, Ordering::Relaxed);
            numbers.extend(heard.iter());
            assert!(numbers.iter().copied().eq((0..100).map(f64::from)), "{numbers:?}");
        });
    }

    /// How fast to go.
    #[crate::payload]
    #[derive(Debug)]
    pub struct Speed {
        /// Ahead.
        #[describe(unit = "m/s", range = -50.0..=50.0)]
        pub ahead: f64,
    }

    /// An app that stops at the first speed that it can use.
    #[derive(Default)]
    struct Driver {
        speeds: Vec<f64>,
    }

    impl App for Driver {
        fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
            Ok(comms.register("SPEED*")?)
        }

        fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
            let speed = mail.decode(&Key::<Speed>::named(mail.key().to_owned()))?.ahead;
            if speed < 0.0 {
                return Err(Rejection::new("this car has no reverse gear").into());
            }
            self.speeds.push(speed);
            comms.stop();
            Ok(())
        }
    }

    #[test]
    fn a_message_of_no_use_is_said_and_counted_and_does_not_end_its_reader() {
        let broker = MemoryBroker::new(BrokerConfig::new("reject"), Clock::new(1.0));
        let community = Community::new("reject").unwrap();
        let join = |name: &str| Client::over(broker.connect(name).unwrap(), name, &community);
        let mut speaker = join("speaker");
        speaker.comms.register("*").unwrap();
        speaker.comms.notify("SPEED_1", "fast").unwrap();
        speaker.comms.publish(&Key::<Speed>::named("SPEED_2"), &Speed { ahead: f64::NAN }).unwrap();
        let bytes = &[1, 2, 3];
        let cut = crate::ValueRef::Binary { type_: crate::TypeRef::of::<Speed>(), bytes };
        speaker.comms.publish_value("SPEED_3", cut, crate::Origin::default()).unwrap();
        speaker.comms.publish(&Key::<Speed>::named("SPEED_4"), &Speed { ahead: -1.0 }).unwrap();
        speaker.comms.publish(&Key::<Speed>::named("SPEED_5"), &Speed { ahead: 7.0 }).unwrap();
        speaker.comms.flush().unwrap();
        let mut driver = Driver::default();
        run_app_on(&mut driver, &mut join("driver"), &AtomicBool::new(false)).unwrap();
        assert_eq!(driver.speeds, [7.0]);
        let mut words = Vec::new();
        speaker
            .receive(Duration::ZERO, |mail| match mail.key() {
                rejection::REJECTED => words.push(mail.as_text().unwrap().to_owned()),
                "DRIVER_STATUS" => words.push(mail.as_text().unwrap().to_owned()),
                _ => {}
            })
            .unwrap();
        let said = |number: usize, parts: &[&str]| {
            assert!(parts.iter().all(|part| words[number].contains(part)), "{parts:?} in {words:?}");
        };
        said(0, &["driver rejects SPEED_1 #1 by speaker", "a text", "Speed"]);
        said(1, &["SPEED_2 #2 by speaker: Speed.ahead is NaN; it has to be -50 to 50 m/s"]);
        said(2, &["SPEED_3 #3 by speaker", "no Speed"]);
        said(3, &["SPEED_4 #4 by speaker: this car has no reverse gear"]);
        said(4, &["AppErrorFlag=false,", ",memory_kb=", ",memory_max_kb=", ",rejected=4,", ",MOOSName=driver,"]);
        let lists = words[4].split_once("MOOSName=driver,").map(|(_, lists)| lists);
        assert_eq!(lists, Some("Publishing=\"MAIL_REJECTED,\",Subscribing=\"SPEED*,\""), "as MOOS' apps say it");
    }

    #[test]
    fn ticks_follow_a_clock_that_is_set_forwards_and_back() {
        assert_eq!(next_tick(10.0, 10.5, 1.0), (false, 10.5));
        assert_eq!(next_tick(10.6, 10.5, 1.0), (true, 11.5), "a late tick shifts nothing");
        assert_eq!(next_tick(99.0, 11.5, 1.0), (true, 99.0), "what was missed is not made up for");
        assert_eq!(next_tick(10.0, 99.0, 1.0), (true, 11.0), "and nobody waits for a time that was");
    }
}
