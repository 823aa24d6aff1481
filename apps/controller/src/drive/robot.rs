//! The robot on its way: pure pursuit at the largest speed from which it can come to stand within its corridor.

use elk_geometry::random::Random;
use elk_geometry::{Polyline, Pose};
use nalgebra::{Point3, Vector3};

use super::body::{AXES, Axis, Body, LINEAR, Limits, Rates, TILT, YAW, wrapped};
use super::corridor::Corridor;

/// Between two commands to its motors (s).
const TICK_SECS: f64 = 0.05;
/// Of its largest speed it tries these shares in turn, the last two to creep along the way itself, and to turn on the spot.
const SHARES: [f64; 6] = [1.0, 0.5, 0.25, 0.1, CREEPING, 0.0];
/// Who turns on the spot does so to creep on.
const CREEPING: f64 = 0.04;
/// It heads for the point of its way where it would be after so long (s).
const LOOKAHEAD_SECS: f64 = 0.5;
/// And not for one nearer than that (m).
const LOOKAHEAD_M: f64 = 0.02;
/// Of its acceleration, what it plans to slow down with: the rest is for what goes otherwise.
const PLANNED: f64 = 0.8;
/// Of what is left of a way or a turn, it does so much in a tick at most.
const APPROACH: f64 = 0.25;
/// It is where it was sent if it is so near (m),
const ARRIVED_M: f64 = 0.005;
/// and looks where it was to if it is off by so little (rad).
const AIMED_RAD: f64 = 0.1 * std::f64::consts::PI / 180.0;
/// A robot that has to face where it goes turns on the spot first if it is off by more than that (rad).
const FACING_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Noise is cut off at so many standard deviations.
const MOST_SIGMAS: f64 = 3.0;
/// A ride that takes so many times as long as its way and a turn at the limits gets nowhere.
const MOST_TIMES: f64 = 20.0;

/// The speeds of who stands.
const STANDING: Rates = [0.0; AXES];

/// How much its motors err.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Noise {
    /// Standard deviation of the speed that an axis strives for, as a share of what it is told to.
    pub sigma: f64,
    /// What it is drawn from.
    pub seed: u64,
}

/// What a robot is sent for.
#[derive(Debug)]
pub struct Errand<'a> {
    /// The way that it is on.
    pub way: &'a Polyline,
    /// How far along that it is (m).
    pub from: f64,
    /// And how far it is to get (m): it passes there, but comes to stand at the way's end.
    pub to: f64,
    /// The pose to take at the way's end; before it, where to look.
    pub pose: Pose,
    /// Number of the errand: noise is drawn anew in each.
    pub number: u64,
}

/// What came of an errand.
#[derive(Debug, Clone, PartialEq)]
pub struct Ride {
    /// Where it went (m, world), tick by tick, from where it was.
    pub trace: Vec<Point3<f64>>,
    /// Its length (m).
    pub length_m: f64,
    /// How far along the way it got (m).
    pub done_m: f64,
    /// Whether it stands before its goal: it would have left its corridor.
    pub is_stopped: bool,
}

/// A robot: its body, its limits and its clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Robot {
    /// Where it is and how it moves.
    pub body: Body,
    /// Time that it has been on its way (s).
    pub secs: f64,
    /// How often it stopped since it would have left its corridor.
    pub stops: u64,
    /// Where its last errand began (m, world).
    pub from: Point3<f64>,
    limits: Limits,
    axes: [Axis; AXES],
    noise: Noise,
}

impl Robot {
    /// A robot that stands at `pose`, its clock at 0.
    pub fn new(pose: &Pose, limits: Limits, noise: Noise) -> Self {
        let (body, from) = (Body::at_rest(pose), pose.position());
        Self { body, secs: 0.0, stops: 0, from, limits, axes: limits.axes(), noise }
    }

    /// The same robot at the beginning of a run.
    pub fn anew(&self) -> Self {
        Self::new(&self.body.pose(), self.limits, self.noise)
    }

    /// It is found to stand at `pose`.
    pub fn stand(&mut self, pose: &Pose) {
        self.body = Body::at_rest(pose);
    }

    /// Whether it has a speed.
    pub fn moves(&self) -> bool {
        self.body.moves()
    }

    /// Does an errand within a corridor; where it cannot but brake it is let.
    pub fn ride(&mut self, errand: &Errand<'_>, mut corridor: Corridor<'_>) -> Ride {
        braking(self.body, self.axes).for_each(|[from, to]| corridor.admit(from, to));
        let mut random = Random::new(self.noise.seed, errand.number);
        self.from = self.body.position;
        let mut ride = Ride { trace: vec![self.body.position], length_m: 0.0, done_m: errand.from, is_stopped: false };
        let mut goals = reversals(errand.way).skip_while(|goal| *goal <= errand.from);
        let (mut goal_m, mut is_there) = (goals.next().unwrap_or(errand.way.length()), false);
        let until = self.secs + self.patience_secs(errand);
        loop {
            ride.done_m = progress(errand.way, [ride.done_m, goal_m], self.body.position);
            if self.has_arrived(errand.way.at(goal_m)) {
                ride.done_m = goal_m;
                is_there |= goal_m == errand.way.length();
                goal_m = goals.next().unwrap_or(errand.way.length());
            }
            if self.has_done(errand, &ride, is_there) {
                break;
            }
            let is_late = self.secs >= until;
            let wanted =
                if is_late { STANDING } else { self.choose(errand, [ride.done_m, goal_m], is_there, &corridor) };
            if wanted == STANDING && self.body.rates == STANDING {
                ride.is_stopped = true;
                self.stops += 1;
                break;
            }
            let done = disturbed(&wanted, || self.noise.sigma * draw(&mut random));
            // It is seen within the tick how its motors err; where it could not come to stand then, it brakes instead.
            let done = if is_there || self.stays_in(&corridor, &done) { done } else { STANDING };
            self.tick(&done, &mut ride);
        }
        ride
    }

    fn tick(&mut self, wanted: &Rates, ride: &mut Ride) {
        let before = self.body.position;
        self.body = self.body.step(wanted, &self.axes, TICK_SECS);
        self.secs += TICK_SECS;
        let gone = (self.body.position - before).norm();
        if gone > 0.0 {
            ride.length_m += gone;
            ride.trace.push(self.body.position);
        }
    }

    /// How long an errand may take (s).
    fn patience_secs(&self, errand: &Errand<'_>) -> f64 {
        let slowest = self.axes[..LINEAR].iter().map(|axis| axis.speed).filter(|speed| *speed > 0.0);
        let slowest = slowest.fold(f64::INFINITY, f64::min);
        let way = errand.to - errand.from + (self.body.position - errand.way.at(errand.from)).norm() + 1.0;
        let ramps = self.axes.iter().filter(|axis| axis.speed > 0.0).map(|axis| axis.speed / axis.acceleration);
        MOST_TIMES * (way / slowest + std::f64::consts::TAU / self.axes[YAW].speed + ramps.sum::<f64>())
    }

    /// Whether it is at `place` (m, world), and as good as stands.
    fn has_arrived(&self, place: Point3<f64>) -> bool {
        let is_slow = |axis: usize| self.body.rates[axis].abs() <= self.axes[axis].acceleration * TICK_SECS;
        (place - self.body.position).norm() <= ARRIVED_M && (0..LINEAR).all(is_slow)
    }

    /// Whether it has passed where it was sent or, at the way's end, stands and looks as it was to.
    fn has_done(&self, errand: &Errand<'_>, ride: &Ride, is_there: bool) -> bool {
        if errand.to < errand.way.length() {
            return ride.done_m >= errand.to;
        }
        is_there && self.body.rates == STANDING && self.aim(&errand.pose).iter().all(|off| off.abs() <= AIMED_RAD)
    }

    /// By how much heading and elevation are off (rad).
    fn aim(&self, pose: &Pose) -> [f64; 2] {
        let forward = pose.forward();
        // Who looks straight up or down may be turned as it likes.
        let yaw = if forward.xy().norm() < 1e-6 { 0.0 } else { wrapped(pose.yaw() - self.body.yaw) };
        [yaw, pose.pitch() - self.body.pitch]
    }

    /// The fastest of its moves after which it can still come to stand within its corridor; if there is none, it brakes, as it can.
    fn choose(&self, errand: &Errand<'_>, part: [f64; 2], is_there: bool, corridor: &Corridor<'_>) -> Rates {
        if is_there {
            return self.turning(&errand.pose);
        }
        let moves = SHARES.iter().filter_map(|share| self.heading(errand, part, *share));
        let mut safe = moves.filter(|wanted| self.stays_in(corridor, wanted));
        safe.next().unwrap_or(STANDING)
    }

    /// Turning on the spot.
    fn turning(&self, pose: &Pose) -> Rates {
        let [yaw, tilt] = self.aim(pose);
        let mut wanted = STANDING;
        (wanted[YAW], wanted[TILT]) = (self.turn(YAW, yaw), self.turn(TILT, tilt));
        wanted
    }

    /// As fast about an axis as it can stop again when it has turned by `off` (rad).
    fn turn(&self, axis: usize, off: f64) -> f64 {
        if off.abs() <= 0.5 * AIMED_RAD {
            return 0.0;
        }
        off.signum() * approach(off.abs(), self.axes[axis])
    }

    /// Along a part of the way (m), at whose end it is to stand, at a share of its largest speed; `None`: it does not face there.
    fn heading(&self, errand: &Errand<'_>, [done_m, goal_m]: [f64; 2], share: f64) -> Option<Rates> {
        let Errand { way, pose, .. } = errand;
        let mut wanted = self.turning(pose);
        let ahead_m = (share.max(CREEPING) * self.limits.forward.speed * LOOKAHEAD_SECS).max(LOOKAHEAD_M);
        let ahead_m = (done_m + ahead_m).min(goal_m);
        let toward = way.at(ahead_m) - self.body.position;
        let Some(direction) = toward.try_normalize(1e-9) else { return Some(wanted) };
        let mut facing = 1.0;
        if self.limits.is_differential() && direction.xy().norm() > 1e-6 {
            let off = wrapped(direction.y.atan2(direction.x) - self.body.yaw);
            wanted[YAW] = self.turn(YAW, off);
            if off.abs() > FACING_RAD && share > 0.0 {
                return None;
            }
            facing = off.cos().max(0.0);
        }
        let inward = self.faced(&direction);
        let along = self.limits.along(&inward);
        // Off its way, it gets there first.
        let left_m = goal_m - ahead_m + toward.norm();
        let speed = approach(left_m, along).min(share * along.speed) * facing;
        (0..LINEAR).for_each(|axis| wanted[axis] = speed * inward[axis]);
        Some(wanted)
    }

    /// A direction of the world in the robot's frame; of one that has to face where it goes, once it does.
    fn faced(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        match self.limits.is_differential() {
            true => Vector3::new(direction.xy().norm(), 0.0, direction.z),
            false => self.body.inward(direction),
        }
    }

    /// Whether after a tick of this it can come to stand within the corridor.
    fn stays_in(&self, corridor: &Corridor<'_>, wanted: &Rates) -> bool {
        let next = self.body.step(wanted, &self.axes, TICK_SECS);
        corridor.has(self.body.position, next.position)
            && braking(next, self.axes).all(|[from, to]| corridor.has(from, to))
    }
}

/// The way (m, world) on which a body comes to stand that brakes, tick by tick.
fn braking(mut body: Body, axes: [Axis; AXES]) -> impl Iterator<Item = [Point3<f64>; 2]> {
    std::iter::from_fn(move || {
        let before = body;
        body = body.step(&STANDING, &axes, TICK_SECS);
        before.moves().then_some([before.position, body.position])
    })
}

/// As fast as one may be `left` (m or rad) before the end.
fn approach(left: f64, Axis { speed, acceleration }: Axis) -> f64 {
    speed.min((2.0 * PLANNED * acceleration * left).sqrt()).min(APPROACH * left / TICK_SECS)
}

/// Where on a way (m) it turns back: a robot stands there before it goes on.
fn reversals(way: &Polyline) -> impl Iterator<Item = f64> {
    let bends = way.points().windows(3);
    let mut length_m = 0.0;
    bends.filter_map(move |bend| {
        let [before, after] = [bend[1] - bend[0], bend[2] - bend[1]];
        length_m += before.norm();
        (before.dot(&after) < 0.0).then_some(length_m)
    })
}

/// How far along a part of the way (m) a robot at `position` is that was at the part's beginning before.
fn progress(way: &Polyline, [done_m, goal_m]: [f64; 2], position: Point3<f64>) -> f64 {
    // No farther than it can have gone: a way may pass the same place twice.
    let most = (done_m + (position - way.at(done_m)).norm()).min(goal_m);
    let near = Polyline::new(way.part(done_m, most)).map_or(0.0, |part| part.nearest(position));
    (done_m + near).min(goal_m)
}

fn draw(random: &mut Random) -> f64 {
    random.normal_pair().0.clamp(-MOST_SIGMAS, MOST_SIGMAS)
}

/// Each axis strives for a little more or less.
fn disturbed(wanted: &Rates, mut error: impl FnMut() -> f64) -> Rates {
    wanted.map(|rate| rate * (1.0 + error()))
}

#[cfg(test)]
mod tests;
