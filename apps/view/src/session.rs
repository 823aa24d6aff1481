//! One page: what it is told, what it says. Two frames are on their way to it at most; what comes meanwhile goes into the
//! next one. So a slow page has fewer and larger frames, and nobody waits for it.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket};
use elk_bus::drawing::KeyPress;
use futures_util::stream::SplitSink;
use futures_util::{SinkExt, StreamExt};
use serde_json::json;
use tokio::sync::mpsc;
use tokio::time::{Instant, interval, sleep_until, timeout};

use crate::connections::PING_EVERY;
use crate::model::{Seen, Wants, message};
use crate::shared::{Play, Shared};
use crate::tail::Tail;
use crate::words::Said;

/// Frames on their way to a page.
const IN_FLIGHT: u64 = 2;
/// Bytes of bricks in a frame.
const FRAME_BYTES: usize = 256 << 10;
/// The least time between two frames.
const FRAME_EVERY: Duration = Duration::from_millis(33);
/// How long a page may take to take a message, before it is given up.
const SEND_PATIENCE: Duration = Duration::from_secs(30);
/// How often a text log is read.
const LOG_EVERY: Duration = Duration::from_millis(500);
/// Orders of a page that are under way at a time.
const MOST_ORDERS: usize = 8;
/// What a page is told whose view ends, as WebSocket says it: that it goes away.
const AWAY: u16 = 1001;
const ENDED: &str = "the view has ended";

/// A page, told apart from the others by its number.
pub(crate) struct Session {
    number: u64,
    shared: Arc<Shared>,
    out: SplitSink<WebSocket, Message>,
    wants: Wants,
    seen: Seen,
    sent: u64,
    taken: u64,
    /// Whether the page shows the world, and of which run it was sent that.
    shows_world: bool,
    world_of: Option<u64>,
    /// The app whose text log is wanted, the log once it is found, and whether somebody looks for one.
    log_of: Option<String>,
    log: Option<Tail>,
    is_looking: bool,
    /// Where logs are found.
    finds: mpsc::Sender<(String, Option<Tail>)>,
    orders: usize,
    /// Where what was ordered is answered; `None` at the end of an order.
    answers: mpsc::Sender<(Message, bool)>,
}

/// Why a session ends: nobody is there any more.
struct Gone;

/// Serves a page until it goes.
pub(crate) async fn serve(number: u64, socket: WebSocket, shared: Arc<Shared>) {
    let (out, mut said) = socket.split();
    let (answers, mut answered) = mpsc::channel(64);
    let (finds, mut found) = mpsc::channel(1);
    let mut changes = shared.changes();
    changes.mark_changed();
    // Until a page says what it shows, it shows all.
    let (wants, seen) = (Wants { scan: true, drawings: true, ..Wants::default() }, Seen::default());
    shared.want(number, wants.clone());
    let mut session = Session {
        number,
        shared: shared.clone(),
        out,
        wants,
        seen,
        sent: 0,
        taken: 0,
        shows_world: false,
        world_of: None,
        log_of: None,
        log: None,
        is_looking: false,
        finds,
        orders: 0,
        answers,
    };
    let (mut logs, mut pings) = (interval(LOG_EVERY), interval(PING_EVERY));
    let mut ends = std::pin::pin!(shared.ended());
    let mut due = Instant::now();
    if session.send(message(&shared.hello)).await.is_ok() {
        loop {
            let has_room = session.sent - session.taken < IN_FLIGHT;
            let went_on = tokio::select! {
                heard = said.next() => match heard {
                    Some(Ok(Message::Text(text))) => session.hear(&text).await,
                    Some(Ok(Message::Binary(_))) => session.complain("a page says text only").await,
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => Ok(()),
                    Some(Ok(Message::Close(_)) | Err(_)) | None => Err(Gone),
                },
                Some((answer, is_last)) = answered.recv() => {
                    session.orders -= usize::from(is_last);
                    session.send(answer).await
                }
                _ = logs.tick(), if session.log.is_some() => session.read_log().await,
                Some(log) = found.recv() => {
                    session.take_log(log);
                    Ok(())
                }
                _ = pings.tick() => session.send(Message::Ping(Bytes::new())).await,
                () = &mut ends => {
                    let frame = CloseFrame { code: AWAY, reason: Utf8Bytes::from_static(ENDED) };
                    session.send(Message::Close(Some(frame))).await.and(Err(Gone))
                }
                changed = async { sleep_until(due).await; changes.changed().await }, if has_room => match changed {
                    Ok(()) => {
                        due = Instant::now() + FRAME_EVERY;
                        session.frame(&mut changes).await
                    }
                    Err(_) => Err(Gone),
                },
            };
            if went_on.is_err() {
                break;
            }
        }
    }
    shared.want(number, Wants::default());
}

impl Session {
    async fn send(&mut self, message: Message) -> Result<(), Gone> {
        in_time(self.out.send(message)).await
    }

    async fn complain(&mut self, what: &str) -> Result<(), Gone> {
        self.send(message(&json!({"type": "answer", "ok": false, "text": format!("not understood: {what}")}))).await
    }

    /// Sends what is new.
    async fn frame(&mut self, changes: &mut tokio::sync::watch::Receiver<u64>) -> Result<(), Gone> {
        self.show_world();
        let news = self.shared.model().news(&mut self.seen, &self.wants, FRAME_BYTES);
        if news.is_empty() {
            return Ok(());
        }
        // There may be more bricks than went into it.
        changes.mark_changed();
        // What makes a frame leaves together, with the word that closes it.
        for message in news {
            in_time(self.out.feed(message)).await?;
        }
        self.sent += 1;
        self.send(message(&json!({"type": "frame", "number": self.sent}))).await
    }

    async fn hear(&mut self, text: &str) -> Result<(), Gone> {
        match Said::read(text) {
            Err(why) => self.complain(&why).await,
            // A page cannot have taken what was not sent.
            Ok(Said::Ack { number }) => {
                self.taken = self.taken.max(number.min(self.sent));
                Ok(())
            }
            Ok(Said::Watch { keys }) => {
                let new: BTreeSet<String> = keys.difference(&self.wants.values).cloned().collect();
                self.wants.values = keys;
                self.shared.want(self.number, self.wants.clone());
                let values = self.shared.model().values(&new);
                for value in values {
                    self.send(value).await?;
                }
                Ok(())
            }
            Ok(Said::Show { layers }) => {
                (self.wants.scan, self.wants.drawings) = (layers.contains("scan"), layers.contains("drawings"));
                self.shared.want(self.number, self.wants.clone());
                self.shows_world = layers.contains("world");
                // A page that hides the world forgets it.
                self.world_of = self.world_of.filter(|_| self.shows_world);
                self.show_world();
                Ok(())
            }
            Ok(Said::Logs { app }) => {
                (self.log_of, self.log) = (app, None);
                self.look_for_log();
                Ok(())
            }
            Ok(Said::Order { id, order }) => {
                self.steer(id, move |steering, on_progress| steering.order(&order, on_progress)).await
            }
            Ok(Said::Press { id, app, key, shift, alt }) => {
                let pressed = self.press(KeyPress { app, key, shift, alt });
                let (ok, text) = pressed.map_or_else(|why| (false, why), |text| (true, text));
                self.send(answer(id, Some(ok), &text)).await
            }
            Ok(Said::Poke { id, key, value }) => self.steer(id, move |steering, _| steering.poke(&key, &value)).await,
            Ok(Said::Types { id }) => {
                let elements = self.shared.steering.as_ref().map_or(json!([]), |steering| steering.types());
                self.send(message(&json!({"type": "types", "id": id, "elements": elements}))).await
            }
            Ok(Said::Play { playing, rate, looping }) => {
                self.shared.ask(|asked| asked.play = Some(Play { playing, rate, looping }));
                Ok(())
            }
            Ok(Said::Seek { time }) => {
                self.shared.ask(|asked| asked.seek = Some(time));
                Ok(())
            }
        }
    }

    /// Has the text log found that is wanted, beside all else: whoever knows may take his time.
    fn look_for_log(&mut self) {
        let Some(app) = self.log_of.clone().filter(|_| !self.is_looking) else { return };
        self.is_looking = true;
        let (steering, finds) = (self.shared.steering.clone(), self.finds.clone());
        tokio::task::spawn_blocking(move || {
            let path = steering.and_then(|steering| steering.log(&app));
            let log = path.map(|path| Tail::new(app.clone(), path));
            // A page that has gone reads no log.
            let _ = finds.blocking_send((app, log));
        });
    }

    /// Reads this log from now on; if another one is wanted meanwhile, that is looked for.
    fn take_log(&mut self, (app, found): (String, Option<Tail>)) {
        self.is_looking = false;
        match self.log_of.as_ref() == Some(&app) {
            true => self.log = found,
            false => self.look_for_log(),
        }
    }

    /// Has the world read and sent, if the page shows it and has not been sent that of this run.
    fn show_world(&mut self) {
        let run = self.shared.scene.run();
        if !self.shows_world || self.world_of == Some(run) || self.orders >= MOST_ORDERS {
            return;
        }
        self.world_of = Some(run);
        self.orders += 1;
        let (shared, answers) = (self.shared.clone(), self.answers.clone());
        tokio::task::spawn_blocking(move || {
            let messages = shared.scene.messages();
            let last = messages.len() - 1;
            for (number, message) in messages.into_iter().enumerate() {
                // A page that has gone is shown nothing.
                let _ = answers.blocking_send((message, number == last));
            }
        });
    }

    /// Hands a key that was pressed to the app that has declared it; what was done, in words.
    fn press(&self, press: KeyPress) -> Result<String, String> {
        if let Some(refusal) = self.refusal() {
            return Err(refusal.to_owned());
        }
        let owner = self.shared.model().owner(&press.key).map(str::to_owned);
        if owner.as_ref() != Some(&press.app) {
            let owner = owner.unwrap_or_else(|| "nobody".to_owned());
            return Err(format!("key {:?} is not {}'s: it is {owner}'s", press.key, press.app));
        }
        let told = format!("{} is told of {:?}", press.app, press.key);
        let too_many = || "too many keys were pressed at once; try again".to_owned();
        self.shared.press(press).then_some(told).ok_or_else(too_many)
    }

    /// Why nothing can be ordered, if so.
    fn refusal(&self) -> Option<&'static str> {
        match &self.shared.steering {
            _ if self.shared.read_only => Some("this view only looks (--read-only)"),
            None => Some("nothing can be ordered in a recorded run"),
            Some(_) => None,
        }
    }

    /// Has something done that takes its time, and answers when it is done.
    async fn steer(
        &mut self,
        id: u64,
        what: impl FnOnce(&dyn crate::Steering, &mut dyn FnMut(&str)) -> Result<String, String> + Send + 'static,
    ) -> Result<(), Gone> {
        let refusal = match (self.refusal(), self.shared.steering.clone()) {
            (Some(refusal), _) => refusal.to_owned(),
            (None, Some(steering)) if self.orders < MOST_ORDERS => {
                let answers = self.answers.clone();
                self.orders += 1;
                tokio::task::spawn_blocking(move || {
                    let mut progress = |text: &str| {
                        // A page that has gone hears no answer.
                        let _ = answers.blocking_send((answer(id, None, text), false));
                    };
                    let done = what(&*steering, &mut progress);
                    let (ok, text) = done.map_or_else(|why| (false, why), |text| (true, text));
                    let _ = answers.blocking_send((answer(id, Some(ok), &text), true));
                });
                return Ok(());
            }
            (None, _) => format!("{MOST_ORDERS} orders are under way; try again"),
        };
        self.send(answer(id, Some(false), &refusal)).await
    }

    async fn read_log(&mut self) -> Result<(), Gone> {
        let lines = self.log.as_mut().and_then(Tail::read);
        match lines {
            Some(lines) => self.send(message(&lines)).await,
            None => Ok(()),
        }
    }
}

/// A page that takes too long, or is not there, has gone.
async fn in_time(sending: impl Future<Output = Result<(), axum::Error>>) -> Result<(), Gone> {
    match timeout(SEND_PATIENCE, sending).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) | Err(_) => Err(Gone),
    }
}

fn answer(id: u64, ok: Option<bool>, text: &str) -> Message {
    message(&json!({"type": "answer", "id": id, "ok": ok, "text": text}))
}
