//! Pair by pair: each looked at for the points of those before.

use std::collections::{BTreeMap, VecDeque};

use elk_geometry::{Pose, random::Random};
use elk_registration::{ConfigError, Pose as _, PoseError};
use elk_stereo::{Image, Rig};
use nalgebra::{Isometry3, Matrix3, Matrix6};

use crate::bundle::{Bundle, Sight};
use crate::config::OdometryConfig;
use crate::consensus::{Consensus, consensus};
use crate::corners::Cells;
use crate::estimate::{Estimate, Health, Lost};
use crate::keyframes::{self, Keyframe};
use crate::landmarks::Landmark;
use crate::least_squares;
use crate::patch::Patch;
use crate::pyramid::Pyramid;
use crate::reprojection::{Match, Observation};
use crate::row;
use crate::turn::{self, Thumbnail};

/// What became of a pair.
#[derive(Clone, Debug, PartialEq)]
pub enum Tracked {
    /// The map begins with it: it is the first, taken where the odometry was told to start, or those before were lost, and it is where the
    /// cameras are supposed to be. Then nobody knows where all poses from here on are to those before.
    Started,
    /// It is known where it was taken.
    Found(Box<Estimate>),
    /// Nobody knows where it was taken. The map stays as it is, and the next pairs are looked for in it.
    Lost(Lost),
}

/// Why there is no odometry.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// A setting that cannot be.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A start that is no pose.
    #[error(transparent)]
    Start(#[from] PoseError),
    /// Images in which nothing could be followed.
    #[error("images of {0} × {1} pixels: each side has to be of {least} at least", least = Odometry::LEAST_SIDE)]
    Size(usize, usize),
}

/// Why two images are no pair. It is as if there had been none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PairError {
    /// An image is of another size.
    #[error("a {side} image of {found:?} pixels: {right:?}, as the odometry was set up for, would be right")]
    Size {
        /// `left` or `right`.
        side: &'static str,
        /// Columns and rows of the image.
        found: [usize; 2],
        /// Columns and rows that were agreed upon.
        right: [usize; 2],
    },
    /// The left image is the right camera's.
    #[error(
        "{swapped} corners are seen farther right in the right image, and {matched} farther left, where they should be: are the cameras swapped?"
    )]
    Swapped {
        /// Corners with which the images match the other way round.
        swapped: usize,
        /// Corners that match.
        matched: usize,
    },
}

/// Estimates the pose of a pair of cameras from its rectified images (thesis 2.2.3). It drifts as any odometry does: the map goes as far back as
/// its window of keyframes. With a `memory` it goes farther: where the cameras come to a view that they had before, the keyframes of that time
/// are taken up again, so that it drifts where it has not been, and knows places where it has.
#[derive(Clone, Debug)]
pub struct Odometry {
    config: OdometryConfig,
    rig: Rig,
    size: [usize; 2],
    cells: Cells,
    landmarks: BTreeMap<u64, Landmark>,
    /// The number of the next point of the map.
    next: u64,
    /// The window: keyframes that are adjusted together, the last one last.
    keyframes: VecDeque<Keyframe>,
    /// How many of them, the first ones, stay where they are: those that were taken up again.
    anchored: usize,
    /// Points that the window has seen, ascending.
    current: Vec<u64>,
    /// Keyframes that have left the window, in the order in which they were taken.
    past: VecDeque<Keyframe>,
    /// The number of the next keyframe, and of the first one since the past was last taken up: those from there on have drifted together.
    next_keyframe: u64,
    drifting: u64,
    /// Cells in which there were points at the last keyframe.
    covered: usize,
    /// The last pose that was found.
    pose: Isometry3<f64>,
    /// From the last but one that was found to the last; none where a pair was lost since.
    motion: Isometry3<f64>,
    /// The last pair that was found, small.
    last: Option<Thumbnail>,
    lost: u64,
    pairs: u64,
}

/// What a pair showed of the map from a guess.
struct Attempt {
    of: usize,
    /// Numbers of points that were found, and where.
    numbers: Vec<u64>,
    matches: Vec<Match>,
    /// Numbers of points that should have been found.
    missed: Vec<u64>,
}

/// A pose that is known well enough.
struct Fix {
    attempt: Attempt,
    consensus: Consensus,
    covariance: Matrix6<f64>,
}

impl Fix {
    /// Whether it can stand for another one.
    fn is_as_good_as(&self, other: &Self) -> bool {
        self.consensus.residuals.len() as f64 >= AS_GOOD * other.consensus.residuals.len() as f64
    }

    /// Points that agree on it, by their numbers, and where they were found.
    fn seen(&self) -> Vec<(u64, Observation)> {
        let found = self.attempt.numbers.iter().zip(&self.attempt.matches).zip(&self.consensus.inliers);
        found.filter(|(_, inlier)| **inlier).map(|((&number, one), _)| (number, one.seen)).collect()
    }
}

impl Odometry {
    /// The fewest pixels that a side of an image may have.
    pub const LEAST_SIDE: usize = 64;

    /// One that has seen nothing, whose first pair is taken at `start`: rectified images of `size` columns and rows, of the cameras of a rig.
    ///
    /// # Errors
    /// Numbers out of range.
    pub fn new(rig: Rig, size: [usize; 2], config: OdometryConfig, start: Pose) -> Result<Self, SetupError> {
        config.check()?;
        start.0.check()?;
        if size.into_iter().min() < Some(Self::LEAST_SIDE) {
            return Err(SetupError::Size(size[0], size[1]));
        }
        let cells = Cells::new(config.cell, size);
        Ok(Self {
            config,
            rig,
            size,
            cells,
            landmarks: BTreeMap::new(),
            next: 0,
            keyframes: VecDeque::new(),
            anchored: 0,
            current: Vec::new(),
            past: VecDeque::new(),
            next_keyframe: 0,
            drifting: 0,
            covered: 0,
            pose: start.0,
            motion: Isometry3::identity(),
            last: None,
            lost: 0,
            pairs: 0,
        })
    }

    /// Where the cameras are supposed to be: at the last pose that was found.
    pub fn supposed(&self) -> Pose {
        Pose(self.pose)
    }

    /// Takes the next pair, rectified.
    ///
    /// # Errors
    /// Images that are no pair. It is as if there had been none.
    pub fn track(&mut self, left: &Image, right: &Image) -> Result<Tracked, PairError> {
        for (side, image) in [("left", left), ("right", right)] {
            let found = [image.width(), image.height()];
            if found != self.size {
                return Err(PairError::Size { side, found, right: self.size });
            }
        }
        let pair = [Pyramid::new(left), Pyramid::new(right)];
        let pair = [&pair[0], &pair[1]];
        let small = Thumbnail::new(pair[0]);
        if self.keyframes.is_empty() {
            return self.start(pair, small);
        }
        let mut random = Random::new(self.config.seed, self.pairs);
        match self.locate(pair, &small, &mut random) {
            Ok(fix) => Ok(Tracked::Found(Box::new(self.found(pair, small, fix, &mut random)))),
            Err(lost) => match self.recognise(pair, &small, &mut random) {
                Some(fix) => {
                    self.take_up(&fix.consensus.pose);
                    Ok(Tracked::Found(Box::new(self.found(pair, small, fix, &mut random))))
                }
                None => self.lost(pair, small, lost),
            },
        }
    }

    /// Begins the map where the cameras are supposed to be, if there is anything to begin it with.
    fn start(&mut self, pair: [&Pyramid; 2], small: Thumbnail) -> Result<Tracked, PairError> {
        let points = self.new_points(pair, &[]);
        let (matched, least) = (points.len(), self.config.inliers);
        if matched < least {
            let swapped = self.new_points([pair[1], pair[0]], &[]).len();
            if swapped >= least && swapped > 3 * matched {
                return Err(PairError::Swapped { swapped, matched });
            }
            return Ok(Tracked::Lost(Lost::Featureless { points: matched, least }));
        }
        self.keyframes.clear();
        self.past.clear();
        self.landmarks.clear();
        self.anchored = 0;
        self.drifting = self.next_keyframe;
        self.motion = Isometry3::identity();
        self.lost = 0;
        self.last = Some(small.clone());
        self.add_keyframe(small, Vec::new(), points);
        Ok(Tracked::Started)
    }

    /// The map is kept, unless it has been of no use for long and this pair can begin another one.
    fn lost(&mut self, pair: [&Pyramid; 2], small: Thumbnail, lost: Lost) -> Result<Tracked, PairError> {
        if self.config.patience.is_some_and(|patience| self.lost >= patience) {
            let started = self.start(pair, small)?;
            if started == Tracked::Started {
                return Ok(started);
            }
        }
        self.motion = Isometry3::identity();
        self.lost += 1;
        self.pairs += 1;
        Ok(Tracked::Lost(lost))
    }

    /// New corners that both images show, in cells in which there is no point.
    fn new_points(&self, [left, right]: [&Pyramid; 2], seen: &[[f64; 2]]) -> Vec<(Patch, Observation)> {
        let OdometryConfig { texture, disparities, similarity, .. } = self.config;
        let corners = self.cells.corners(left.level(0), seen, texture);
        let matched = |at: [f64; 2]| {
            let look = Patch::new(left, at);
            let seen = row::match_along(&look, at, right, disparities, similarity as f32)?;
            Some((look, seen))
        };
        corners.into_iter().filter_map(matched).collect()
    }

    /// The pose of a pair in what the window saw: near where the last motion and the image's turn lead, or else near the keyframe that looks most
    /// like it.
    fn locate(&self, pair: [&Pyramid; 2], small: &Thumbnail, random: &mut Random) -> Result<Fix, Lost> {
        let predicted = self.locate_near(&self.predict(small), pair, &self.current, random);
        let Err(lost) = predicted else { return predicted };
        match keyframes::most_alike(self.keyframes.iter(), &self.rig, small).first() {
            Some(guess) => self.locate_near(guess, pair, &self.current, random).map_err(|_| lost),
            None => Err(lost),
        }
    }

    /// The pose of a pair that shows nothing of what the window saw: near one of the keyframes of the past that look most like it.
    fn recognise(&self, pair: [&Pyramid; 2], small: &Thumbnail, random: &mut Random) -> Option<Fix> {
        let near = keyframes::nearest(&self.past, &self.pose.translation.vector, LOOKED_AT);
        let guesses = keyframes::most_alike(near.into_iter(), &self.rig, small);
        guesses.iter().take(TRIED).find_map(|guess| self.recall(guess, pair, random))
    }

    /// The pose of a pair in what those keyframes of the past saw whose views are like that from a guess.
    fn recall(&self, guess: &Isometry3<f64>, pair: [&Pyramid; 2], random: &mut Random) -> Option<Fix> {
        let places = keyframes::alike(&self.past, guess, [0, self.config.window - 1]);
        let numbers = keyframes::seen(places.iter().map(|&place| &self.past[place]));
        self.locate_near(guess, pair, &numbers, random).ok()
    }

    /// Moves what was seen since the past was last taken up, by so much in the end, and evenly less before: by what it has drifted meanwhile, as a
    /// chain of poses that is closed (Shade, 2.2.4, of one loop).
    fn undrift(&mut self, by: &Isometry3<f64>) {
        let (first, count) = (self.drifting, (self.next_keyframe - self.drifting).max(1));
        let share = |number: u64| (number + 1).saturating_sub(first) as f64 / count as f64;
        let moved = |number| Isometry3::identity().try_lerp_slerp(by, share(number), 1e-9).unwrap_or(*by);
        for keyframe in self.past.iter_mut().chain(&mut self.keyframes).filter(|keyframe| keyframe.number >= first) {
            keyframe.pose = moved(keyframe.number) * keyframe.pose;
            keyframe.pose.rotation.renormalize();
        }
        for landmark in self.landmarks.values_mut().filter(|landmark| landmark.keyframe >= first) {
            landmark.go(&moved(landmark.keyframe));
        }
    }

    /// The keyframes whose views are like that from a pose become the window.
    fn take_up(&mut self, pose: &Isometry3<f64>) {
        for keyframe in std::mem::take(&mut self.keyframes) {
            self.keep(keyframe);
        }
        let places = keyframes::alike(&self.past, pose, [1, self.config.window - 1]);
        self.keyframes = places.iter().map(|&place| self.past[place].clone()).collect();
        let mut place = 0;
        self.past.retain(|_| {
            place += 1;
            !places.contains(&(place - 1))
        });
        self.anchored = self.keyframes.len();
        self.drifting = self.next_keyframe;
        self.covered = self.keyframes.back().map_or(0, |last| self.cover(&last.seen));
        self.forget();
    }

    /// A keyframe leaves the window.
    fn keep(&mut self, keyframe: Keyframe) {
        let place = self.past.partition_point(|other| other.number < keyframe.number);
        self.past.insert(place, keyframe);
    }

    /// What neither the window nor the memory has seen is forgotten.
    fn forget(&mut self) {
        while self.past.len() > self.config.memory {
            self.past.pop_front();
        }
        self.current = keyframes::seen(self.keyframes.iter());
        let past = keyframes::seen(self.past.iter());
        let is_seen = |number: &u64| self.current.binary_search(number).is_ok() || past.binary_search(number).is_ok();
        self.landmarks.retain(|number, _| is_seen(number));
    }

    /// Where the cameras should be if they go on as they went, turned as the image is.
    fn predict(&self, small: &Thumbnail) -> Isometry3<f64> {
        let guess = self.pose * self.motion;
        let turned = self.last.as_ref().and_then(|last| {
            let turn = turn::turn(&self.rig, last, small, self.motion.rotation.inverse())?;
            Some(self.pose.rotation * turn.second_from_first.inverse())
        });
        Isometry3::from_parts(guess.translation, turned.unwrap_or(guess.rotation))
    }

    /// The pose near a guess at which a pair shows points of the map, by their numbers.
    fn locate_near(
        &self,
        guess: &Isometry3<f64>,
        pair: [&Pyramid; 2],
        numbers: &[u64],
        random: &mut Random,
    ) -> Result<Fix, Lost> {
        let OdometryConfig { tolerance, inliers: least, share, deviation: limit, .. } = self.config;
        let attempt = self.look(guess, pair, numbers);
        let matched = attempt.matches.len();
        let unseen = Lost::Unseen { matched, of: attempt.of, least };
        if matched < least {
            return Err(unseen);
        }
        let consensus = consensus(&self.rig, guess, &attempt.matches, tolerance, random).ok_or(unseen)?;
        let inliers = consensus.residuals.len();
        let agreeing =
            || attempt.matches.iter().zip(&consensus.inliers).filter_map(|(one, inlier)| inlier.then_some(one));
        let both = agreeing().filter(|one| one.seen.right.is_some()).count();
        // What is near lies left of the right image.
        let right = agreeing().filter(|one| one.is_in_right(&self.rig, &consensus.pose)).count();
        let least_both = (share * right as f64).ceil() as usize;
        if both < least_both.max(LEAST_BOTH) {
            return Err(Lost::OneSided { both, of: right, least: least_both.max(LEAST_BOTH) });
        }
        let least = least.max((share * matched as f64).ceil() as usize);
        if inliers < least {
            return Err(Lost::Disagreeing { inliers, matched, least });
        }
        let sigma = consensus.sigma().max(LEAST_SIGMA);
        let vague = |deviation: f64| Lost::Vague { deviation, limit };
        let covariance =
            least_squares::covariance(&self.rig, &consensus.pose, agreeing(), sigma).ok_or(vague(f64::INFINITY))?;
        match worst(&covariance) {
            deviation if deviation <= limit => Ok(Fix { attempt, consensus, covariance }),
            deviation => Err(vague(deviation)),
        }
    }

    /// Looks for points of the map from a guess.
    fn look(&self, guess: &Isometry3<f64>, pair: [&Pyramid; 2], numbers: &[u64]) -> Attempt {
        let mut attempt = Attempt { of: 0, numbers: Vec::new(), matches: Vec::new(), missed: Vec::new() };
        for &number in numbers {
            let Some(landmark) = self.landmarks.get(&number) else { continue };
            let Some(found) = landmark.look_for(&self.rig, guess, pair, self.config.similarity as f32) else {
                continue;
            };
            attempt.of += 1;
            match found {
                Some(seen) => {
                    attempt.numbers.push(number);
                    attempt.matches.push(Match { point: landmark.position, seen });
                }
                None => attempt.missed.push(number),
            }
        }
        attempt
    }

    fn found(&mut self, pair: [&Pyramid; 2], small: Thumbnail, mut fix: Fix, random: &mut Random) -> Estimate {
        self.pairs += 1;
        self.count_failures(&fix);
        let before = std::mem::replace(&mut self.pose, fix.consensus.pose);
        // After a loss nobody knows over how long a time the cameras came here.
        self.motion = if self.lost == 0 { before.inverse() * self.pose } else { Isometry3::identity() };
        let mut seen = fix.seen();
        let mut is_keyframe = self.wants_keyframe(&seen);
        if is_keyframe
            && let Some(recalled) = self.recall(&self.pose, pair, random).filter(|past| past.is_as_good_as(&fix))
        {
            fix = recalled;
            self.undrift(&(fix.consensus.pose * self.pose.inverse()));
            self.pose = fix.consensus.pose;
            self.take_up(&fix.consensus.pose);
            self.count_failures(&fix);
            seen = fix.seen();
            is_keyframe = self.wants_keyframe(&seen);
        }
        if is_keyframe {
            let at: Vec<[f64; 2]> = seen.iter().map(|(_, seen)| seen.left).collect();
            let points = self.new_points(pair, &at);
            self.add_keyframe(small.clone(), seen, points);
        }
        self.lost = 0;
        self.last = Some(small);
        let health = Health {
            of: fix.attempt.of,
            matched: fix.attempt.matches.len(),
            inliers: fix.consensus.residuals.len(),
            rms: fix.consensus.rms(),
            is_keyframe,
        };
        Estimate { pose: Pose(self.pose), covariance: fix.covariance, health }
    }

    fn count_failures(&mut self, Fix { attempt, consensus, .. }: &Fix) {
        let seen = attempt.numbers.iter().copied().zip(consensus.inliers.iter().copied());
        for (number, is_inlier) in seen.chain(attempt.missed.iter().map(|&number| (number, false))) {
            let Some(landmark) = self.landmarks.get_mut(&number) else { continue };
            landmark.failures = if is_inlier { 0 } else { landmark.failures + 1 };
            if landmark.failures > MOST_FAILURES {
                self.landmarks.remove(&number);
            }
        }
    }

    fn wants_keyframe(&self, seen: &[(u64, Observation)]) -> bool {
        let Some(last) = self.keyframes.back() else { return true };
        let Some(depth) = self.depth(seen) else { return true };
        let covered = self.cover(seen);
        let way = (self.pose.translation.vector - last.pose.translation.vector).norm();
        way > self.config.step * depth || (covered as f64) < self.config.cover * self.covered as f64
    }

    /// The median distance ahead of what was seen, metres.
    fn depth(&self, seen: &[(u64, Observation)]) -> Option<f64> {
        let ahead = |number| Some(self.pose.inverse_transform_point(&self.landmarks.get(number)?.position).z);
        let mut depths: Vec<f64> = seen.iter().filter_map(|(number, _)| ahead(number)).collect();
        depths.sort_unstable_by(f64::total_cmp);
        depths.get(depths.len() / 2).copied()
    }

    /// In how many cells points were seen.
    fn cover(&self, seen: &[(u64, Observation)]) -> usize {
        self.cells.taken(seen.iter().map(|(_, seen)| seen.left)).iter().filter(|taken| **taken).count()
    }

    /// Adds a pair at the pose to the window, with new points, and adjusts all.
    fn add_keyframe(&mut self, small: Thumbnail, mut seen: Vec<(u64, Observation)>, points: Vec<(Patch, Observation)>) {
        for (look, observation) in points {
            let landmark = Landmark::new(&self.rig, &self.pose, look, observation, self.next_keyframe);
            let Some(landmark) = landmark else { continue };
            self.landmarks.insert(self.next, landmark);
            seen.push((self.next, observation));
            self.next += 1;
        }
        self.covered = self.cover(&seen);
        let depth = self.depth(&seen).unwrap_or(0.0);
        self.keyframes.push_back(Keyframe { number: self.next_keyframe, pose: self.pose, small, depth, seen });
        self.next_keyframe += 1;
        if self.keyframes.len() > self.config.window
            && let Some(first) = self.keyframes.pop_front()
        {
            self.anchored = self.anchored.saturating_sub(1);
            self.keep(first);
        }
        self.forget();
        self.adjust();
    }

    /// Adjusts the poses of the window and the points that it has seen.
    fn adjust(&mut self) {
        let mut sights = Vec::new();
        for (pose, keyframe) in self.keyframes.iter().enumerate() {
            sights.extend(keyframe.seen.iter().map(|&(number, seen)| (number, pose, seen)));
        }
        sights.sort_by_key(|&(number, pose, _)| (number, pose));
        let mut numbers = Vec::new();
        let mut points = Vec::new();
        for &number in &self.current {
            let Some(landmark) = self.landmarks.get(&number) else { continue };
            numbers.push(number);
            points.push(landmark.position);
        }
        let place = |(number, pose, seen): (u64, usize, Observation)| {
            Some(Sight { pose, point: numbers.binary_search(&number).ok()?, seen })
        };
        let mut bundle = Bundle {
            poses: self.keyframes.iter().map(|keyframe| keyframe.pose).collect(),
            points,
            sights: sights.into_iter().filter_map(place).collect(),
        };
        bundle.adjust(&self.rig, self.anchored.max(FIXED), self.config.tolerance / 3.0);
        self.keyframes.iter_mut().zip(&bundle.poses).for_each(|(keyframe, pose)| keyframe.pose = *pose);
        for (number, point) in numbers.iter().zip(&bundle.points) {
            if let Some(landmark) = self.landmarks.get_mut(number) {
                landmark.position = *point;
            }
        }
        if let Some(pose) = bundle.poses.last() {
            self.pose = *pose;
        }
    }
}

/// Keyframes of the window that stay where they are, at least.
const FIXED: usize = 1;
/// So many keyframes of the past, those nearest to where the cameras are supposed to be, are held against a pair that is lost …
const LOOKED_AT: usize = 40;
/// … and so many of those, which look most like it, are tried.
const TRIED: usize = 3;
/// The past is taken up again where it shows so large a share of the points that the window shows at least.
const AS_GOOD: f64 = 0.5;
/// So many points of a pose have to be seen by both cameras at the least, wherever they are.
const LEAST_BOTH: usize = 4;
/// Where a point is seen is not known better, pixels, however well a few fit.
const LEAST_SIGMA: f64 = 0.05;
/// A point that was not seen so often in a row where it should have been is none.
const MOST_FAILURES: usize = 10;

/// The standard deviation of the position in its worst direction, metres.
fn worst(covariance: &Matrix6<f64>) -> f64 {
    let position: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into_owned();
    position.symmetric_eigenvalues().max().sqrt()
}
