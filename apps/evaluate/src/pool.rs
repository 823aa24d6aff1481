//! Runs in parallel, a thread each: what comes of a run does not depend on how many there are.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use crate::agreement::agreement;
use crate::outcome::{Outcome, TracePoint};
use crate::site::{Missions, Noise, Plans, Site};
use crate::stage::{Came, Interrupted, Sign, run};
use crate::suite::Suite;

/// How often it is seen whether a run goes on.
const LOOK: Duration = Duration::from_millis(100);

/// A run of a suite: which world, which start, which strategy, each by its place in the suite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Case {
    /// The world.
    pub world: usize,
    /// The start.
    pub start: usize,
    /// The strategy.
    pub strategy: usize,
}

impl Case {
    /// All runs of a suite, so that those that are compared lie beside each other, and one that is cut off has had about as many
    /// starts in each world.
    pub fn all(suite: &Suite) -> Vec<Self> {
        let of = |world: usize, start: usize| {
            (0..suite.strategies.len()).map(move |strategy| Self { world, start, strategy })
        };
        let worlds = 0..suite.worlds.len();
        (0..suite.starts).flat_map(|start| worlds.clone().flat_map(move |world| of(world, start))).collect()
    }

    /// Its number among all of them, from 1.
    pub fn number(&self, suite: &Suite) -> usize {
        1 + self.strategy + suite.strategies.len() * (self.start + suite.starts * self.world)
    }
}

/// A suite with all that its runs need.
pub struct Grounds {
    /// The suite.
    pub suite: Suite,
    /// Where its missions come from.
    pub missions: Missions,
    /// The missions of each world; or why there are none.
    pub plans: Vec<Result<Plans, String>>,
    /// Each world, once it is needed.
    sites: Vec<OnceLock<Result<Site, String>>>,
}

impl Grounds {
    /// Of a suite whose missions are these.
    pub fn new(suite: Suite, missions: Missions, plans: Vec<Result<Plans, String>>) -> Self {
        let sites = plans.iter().map(|_| OnceLock::new()).collect();
        Self { suite, missions, plans, sites }
    }

    /// A world that is ready.
    ///
    /// # Errors
    /// It cannot be read, or there is no room for a robot in it.
    pub fn site(&self, world: usize) -> Result<&Site, &String> {
        let made = self.sites[world].get_or_init(|| {
            let plans = self.plans[world].as_ref().map_err(Clone::clone)?;
            plans.site(&self.suite, &self.suite.worlds[world].source)
        });
        made.as_ref()
    }

    /// A run; of one with noise that is complete, the same without as well, whose map its own is held against.
    fn carry_out(&self, case: Case, sign: &Sign, stop: &AtomicBool) -> Result<(Outcome, Vec<TracePoint>), Interrupted> {
        let (site, plans) = match (self.site(case.world), &self.plans[case.world]) {
            (Ok(site), Ok(plans)) => (site, plans),
            (Err(why), _) | (_, Err(why)) => return Ok((Outcome::failed(why), Vec::new())),
        };
        let run_with =
            |noise: Noise| match plans.mission(case.strategy, &site.starts[case.start], noise, &self.missions) {
                Ok(mission) => run(site, &mission, &self.suite.limits, (sign, stop)),
                Err(why) => Ok(Came::failed(why)),
            };
        let Came { mut outcome, trace, map } = run_with(Noise::AsSaid)?;
        if plans.is_noisy && outcome.is_complete() {
            let exact = run_with(Noise::None)?;
            let maps = exact.outcome.is_complete().then_some([&map, &exact.map]);
            outcome.agreement = maps.and_then(|maps| agreement(&site.truth, site.world.extents(), maps));
        }
        Ok((outcome, trace))
    }
}

/// What a thread has to say.
enum Word {
    /// What came of a run.
    Done(Case, Box<(Outcome, Vec<TracePoint>)>),
    /// It has nothing left to do.
    Gone,
}

/// A thread, as those that wait for it see it.
#[derive(Default)]
struct Lane {
    sign: Sign,
    /// The run that it is at, by its place among all; 0 stands for none, 1 for the first.
    at: AtomicUsize,
    /// Nobody waits for it any more.
    given_up: AtomicBool,
}

/// What all threads have in common.
struct Work {
    grounds: Arc<Grounds>,
    cases: Vec<Case>,
    /// The next run that nobody has begun.
    next: AtomicUsize,
    stop: Arc<AtomicBool>,
}

impl Work {
    /// Carries out one run after the other.
    fn go_on(&self, lane: &Lane, said: &Sender<(usize, Word)>, name: usize) {
        while !self.stop.load(Ordering::Relaxed) && !lane.given_up.load(Ordering::Relaxed) {
            let at = self.next.fetch_add(1, Ordering::Relaxed);
            let Some(case) = self.cases.get(at) else { break };
            lane.at.store(at + 1, Ordering::Relaxed);
            let came = catch_unwind(AssertUnwindSafe(|| self.grounds.carry_out(*case, &lane.sign, &self.stop)));
            lane.sign.rest();
            let came = came.unwrap_or_else(|panic| Ok((Outcome::failed(panicked(&*panic)), Vec::new())));
            let Ok(done) = came else { break };
            // Whoever waited is gone if nobody takes it.
            let _ = said.send((name, Word::Done(*case, Box::new(done))));
        }
        let _ = said.send((name, Word::Gone));
    }
}

fn panicked(panic: &(dyn Any + Send)) -> String {
    let words = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    format!("an app panicked: {}", words.unwrap_or("without a word"))
}

/// Carries out runs, `jobs` at a time, until all are done or `stop` is set; each is handed to `done` as soon as it is.
/// A run in which an app does not answer in time is given up, and its thread with it.
///
/// # Errors
/// What `done` fails with, or the system has no thread.
pub fn carry_out<E: From<std::io::Error>>(
    grounds: &Arc<Grounds>,
    cases: Vec<Case>,
    (jobs, stop): (usize, &Arc<AtomicBool>),
    mut done: impl FnMut(Case, Outcome, Vec<TracePoint>) -> Result<(), E>,
) -> Result<(), E> {
    let answer_secs = grounds.suite.limits.answer_secs;
    let work = Arc::new(Work { grounds: grounds.clone(), cases, next: AtomicUsize::new(0), stop: stop.clone() });
    let (said, heard) = channel::<(usize, Word)>();
    let mut lanes: Vec<Option<Arc<Lane>>> = Vec::new();
    let start = |lanes: &mut Vec<Option<Arc<Lane>>>| {
        let (lane, name, work, said) = (Arc::<Lane>::default(), lanes.len(), work.clone(), said.clone());
        lanes.push(Some(lane.clone()));
        let thread = std::thread::Builder::new().name(format!("run-{name}"));
        thread.spawn(move || work.go_on(&lane, &said, name)).map(drop)
    };
    for _ in 0..jobs.clamp(1, work.cases.len().max(1)) {
        start(&mut lanes)?;
    }
    while lanes.iter().any(Option::is_some) {
        match heard.recv_timeout(LOOK) {
            // Of a thread that was given up nobody wants to hear.
            Ok((name, _)) if lanes[name].is_none() => {}
            Ok((_, Word::Done(case, came))) => done(case, came.0, came.1)?,
            Ok((name, Word::Gone)) => lanes[name] = None,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        let stuck: Vec<(usize, String)> =
            (0..lanes.len()).filter_map(|name| Some((name, lanes[name].as_ref()?.sign.stuck(answer_secs)?))).collect();
        for (name, app) in stuck {
            let Some(lane) = lanes[name].take() else { continue };
            lane.given_up.store(true, Ordering::Relaxed);
            let case = work.cases.get(lane.at.load(Ordering::Relaxed).wrapping_sub(1)).copied();
            let why = format!("{app} did not answer a message within {answer_secs} s");
            case.map_or(Ok(()), |case| done(case, Outcome::failed(why), Vec::new()))?;
            start(&mut lanes)?;
        }
    }
    Ok(())
}
