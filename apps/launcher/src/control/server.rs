//! The launcher's end: never waits for anybody.

use std::io::{ErrorKind, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::Duration;

use elk_bus::clock::Stopwatch;
use elk_bus::shm::abstract_socket;
use elk_bus::{Community, Owner, own_user};
use rustix::event::{PollFd, PollFlags};

use super::socket::{MAX_ANSWER, MAX_QUESTION, address, name};
use super::words::{Answer, Order};
use crate::error::LaunchError;
use crate::supervisor::Ticket;

/// How many may ask at a time.
const MAX_ASKERS: usize = 32;
/// How long a question may take to be said, and an answer to be heard.
const PATIENCE: Duration = Duration::from_secs(5);

/// How long nobody is taken in after the system refused to.
const REST: Duration = Duration::from_millis(100);

/// The socket, and those who ask.
pub(crate) struct Server {
    listener: UnixListener,
    /// Since when nobody can be taken in, for want of descriptors.
    full: Option<Stopwatch>,
    askers: Vec<Asker>,
    next_ticket: Ticket,
}

struct Asker {
    ticket: Ticket,
    stream: UnixStream,
    heard: Vec<u8>,
    /// What it has yet to take.
    to_say: Vec<u8>,
    /// Since when it has been waited for: for its question, or to take an answer.
    waited: Stopwatch,
    phase: Phase,
}

#[derive(PartialEq, Eq)]
enum Phase {
    Asking,
    Waiting,
    /// The last answer is on its way.
    Leaving,
    Gone,
}

impl Server {
    /// Takes the community's launcher's name.
    pub fn listen(community: &Community) -> Result<Self, LaunchError> {
        let failed = |source| LaunchError::System { what: "no socket for orders", source };
        let address = address(community).map_err(failed)?;
        let listener = UnixListener::bind_addr(&address).map_err(|error| match error.kind() {
            ErrorKind::AddrInUse => {
                let holder =
                    abstract_socket::connect_now(&name(community)).and_then(|stream| Owner::at_other_end(&stream)).ok();
                LaunchError::Launched { community: community.clone(), holder }
            }
            _ => failed(error),
        })?;
        listener.set_nonblocking(true).map_err(failed)?;
        Ok(Self { listener, full: None, askers: Vec::new(), next_ticket: 1 })
    }

    /// What has to be watched for something to happen here.
    pub fn watch<'a>(&'a self, watched: &mut Vec<PollFd<'a>>) {
        if self.takes_in() {
            watched.push(PollFd::from_borrowed_fd(self.listener.as_fd(), PollFlags::IN));
        }
        for asker in &self.askers {
            let flags = match (&asker.phase, asker.to_say.is_empty()) {
                (Phase::Asking, _) => PollFlags::IN,
                (_, false) => PollFlags::OUT,
                (_, true) => continue,
            };
            watched.push(PollFd::from_borrowed_fd(asker.stream.as_fd(), flags));
        }
    }

    /// Questions that have been asked in full.
    pub fn questions(&mut self) -> Vec<(Ticket, Order)> {
        self.accept();
        let mut questions = Vec::new();
        for asker in &mut self.askers {
            questions.extend(asker.question().map(|question| (asker.ticket, question)));
            asker.say();
        }
        self.askers.retain(|asker| asker.phase != Phase::Gone);
        questions
    }

    /// Whether one more can be taken in. Whoever cannot be waits in the socket's queue, and would wake the launcher over
    /// and over.
    fn takes_in(&self) -> bool {
        self.askers.len() < MAX_ASKERS && self.full.as_ref().is_none_or(|since| since.elapsed() >= REST)
    }

    fn accept(&mut self) {
        while self.takes_in() {
            let stream = match self.listener.accept() {
                Ok((stream, _)) => stream,
                Err(error) if matches!(error.kind(), ErrorKind::Interrupted | ErrorKind::ConnectionAborted) => continue,
                Err(error) => {
                    self.full = (error.kind() != ErrorKind::WouldBlock).then(Stopwatch::start);
                    return;
                }
            };
            // Whoever is somebody else gives no orders here.
            let own = Owner::at_other_end(&stream).is_ok_and(|peer| peer.user == own_user());
            if own && stream.set_nonblocking(true).is_ok() {
                self.askers.push(Asker::new(self.next_ticket, stream));
                self.next_ticket += 1;
            }
        }
    }

    /// Answers; that the asker has gone is no failure.
    pub fn answer(&mut self, ticket: Ticket, answer: &Answer) {
        if let Some(asker) = self.askers.iter_mut().find(|asker| asker.ticket == ticket) {
            asker.answer(answer);
        }
    }

    /// Says what is left to be said, for a moment.
    pub fn finish(&mut self) {
        let clock = Stopwatch::start();
        while self.askers.iter().any(|asker| !asker.to_say.is_empty()) && clock.elapsed() < Duration::from_secs(1) {
            self.askers.iter_mut().for_each(Asker::say);
            self.askers.retain(|asker| asker.phase != Phase::Gone);
        }
    }
}

impl Asker {
    fn new(ticket: Ticket, stream: UnixStream) -> Self {
        let waited = Stopwatch::start();
        Self { ticket, stream, heard: Vec::new(), to_say: Vec::new(), waited, phase: Phase::Asking }
    }

    fn question(&mut self) -> Option<Order> {
        if self.phase != Phase::Asking {
            return None;
        }
        let over = self.read();
        let Some(end) = self.heard.iter().position(|byte| *byte == b'\n') else {
            if over || self.waited.elapsed() > PATIENCE {
                self.phase = Phase::Gone;
            } else if self.heard.len() > MAX_QUESTION {
                self.refuse(format!("a question has at most {MAX_QUESTION} bytes"));
            }
            return None;
        };
        self.phase = Phase::Waiting;
        match serde_json::from_slice(&self.heard[..end]) {
            Ok(question) => Some(question),
            Err(error) => {
                self.refuse(format!("the launcher does not understand that: {error}"));
                None
            }
        }
    }

    /// Reads what there is, up to the bound; whether the asker has gone.
    fn read(&mut self) -> bool {
        let mut bytes = [0; 4096];
        while self.heard.len() <= MAX_QUESTION {
            match self.stream.read(&mut bytes) {
                Ok(0) => return true,
                Ok(length) => self.heard.extend(&bytes[..length]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return false,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return true,
            }
        }
        false
    }

    fn refuse(&mut self, text: String) {
        self.answer(&Answer::Failed { text });
    }

    fn answer(&mut self, answer: &Answer) {
        let line = serde_json::to_vec(answer).unwrap_or_else(|error| {
            debug_assert!(false, "an answer is names, texts and numbers: {error}");
            br#"{"answer":"failed","text":"the launcher cannot put its answer into words"}"#.to_vec()
        });
        if self.to_say.is_empty() {
            self.waited = Stopwatch::start();
        }
        if self.to_say.len() + line.len() < MAX_ANSWER as usize {
            self.to_say.extend(line);
            self.to_say.push(b'\n');
        }
        if answer.is_last() {
            self.phase = Phase::Leaving;
        }
        self.say();
    }

    /// Says as much as is taken without waiting.
    fn say(&mut self) {
        while !self.to_say.is_empty() {
            match self.stream.write(&self.to_say) {
                Ok(length) => drop(self.to_say.drain(..length)),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock && self.waited.elapsed() < PATIENCE => return,
                Err(_) => {
                    self.phase = Phase::Gone;
                    self.to_say.clear();
                }
            }
        }
        if self.phase == Phase::Leaving {
            self.phase = Phase::Gone;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader};

    use super::super::client::ask;
    use super::*;

    fn community(test: &str) -> Community {
        Community::new(format!("{test}-{}", std::process::id())).unwrap()
    }

    /// Serves until `count` questions were asked, and answers each with its own words.
    fn serve(mut server: Server, count: usize) -> std::thread::JoinHandle<Vec<Order>> {
        std::thread::spawn(move || {
            let mut asked = Vec::new();
            while asked.len() < count {
                for (ticket, question) in server.questions() {
                    server.answer(ticket, &Answer::Progress { text: "soon".into() });
                    server.answer(ticket, &Answer::Done { text: format!("{question:?}") });
                    asked.push(question);
                }
                std::thread::yield_now();
            }
            server.finish();
            asked
        })
    }

    #[test]
    fn a_question_is_answered_with_progress_and_a_last_word() {
        let community = community("asked");
        let served = serve(Server::listen(&community).unwrap(), 1);
        let mut progress = Vec::new();
        let patience = Duration::from_secs(60);
        let answer = ask(&community, &Order::Pause, patience, |text| progress.push(text.to_owned())).unwrap();
        assert_eq!(answer, Answer::Done { text: "Pause".into() });
        assert_eq!(progress, ["soon"]);
        assert_eq!(served.join().unwrap(), [Order::Pause]);
    }

    #[test]
    fn a_second_launcher_is_told_who_the_first_is() {
        let community = community("second");
        let _first = Server::listen(&community).unwrap();
        let error = Server::listen(&community).err().unwrap().to_string();
        let own = std::process::id();
        assert!(
            error.contains(&format!("is launched already, by process {own} of user {}: choose another", own_user())),
            "{error}"
        );
    }

    #[test]
    fn a_launcher_that_takes_nobody_in_holds_nobody_up() {
        let community = community("crowded");
        let first = Server::listen(&community).unwrap();
        rustix::net::listen(&first.listener, 0).unwrap();
        let _queue: Vec<_> = std::iter::from_fn(|| abstract_socket::connect_now(&name(&community)).ok()).collect();
        let error = Server::listen(&community).err().unwrap();
        assert!(error.to_string().contains("is launched already, by a launcher that takes nobody in: "), "{error}");
        let error = ask(&community, &Order::Pause, Duration::from_millis(50), |_| {}).unwrap_err().to_string();
        assert!(error.contains("its queue is full"), "{error}");
    }

    #[test]
    fn a_launcher_without_descriptors_rests_before_it_takes_anybody_in() {
        let community = community("scarce");
        let mut server = Server::listen(&community).unwrap();
        server.full = Some(Stopwatch::start());
        let watches = |server: &Server| {
            let mut watched = Vec::new();
            server.watch(&mut watched);
            watched.len()
        };
        assert_eq!(watches(&server), 0);
        while !server.takes_in() {
            std::thread::yield_now();
        }
        assert_eq!(watches(&server), 1);
        // What no longer refuses is as before.
        server.questions();
        assert!(server.full.is_none());
    }

    #[test]
    fn nonsense_is_refused_and_mutes_hold_nobody_up() {
        let community = community("nonsense");
        let server = Server::listen(&community).unwrap();
        let connect = || UnixStream::connect_addr(&address(&community).unwrap()).unwrap();
        let _mute = connect();
        let mut odd = connect();
        odd.write_all(b"{\"command\":\"fly\"}\n").unwrap();
        let mut endless = connect();
        endless.set_nonblocking(true).unwrap();
        let served = serve(server, 1);
        let mut said = String::new();
        BufReader::new(odd).read_line(&mut said).unwrap();
        assert!(said.contains("the launcher does not understand that: unknown variant `fly`"), "{said}");
        // It is cut off after its bound, and reads as much.
        let mut sent = 0;
        while sent < 4 * MAX_QUESTION {
            match endless.write(&[b'x'; 4096]) {
                Ok(length) => sent += length,
                Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::yield_now(),
                Err(_) => break,
            }
        }
        let patience = Duration::from_secs(60);
        assert!(ask(&community, &Order::Step, patience, |_| {}).is_ok());
        assert_eq!(served.join().unwrap(), [Order::Step]);
    }

    #[test]
    fn without_a_launcher_it_is_said_how_to_get_one() {
        let community = community("nobody");
        let error = ask(&community, &Order::Apps, Duration::from_secs(1), |_| {}).unwrap_err().to_string();
        assert!(error.starts_with(&format!("nobody launches community {community} here:")), "{error}");
    }
}
