//! Logs of 2-D lasers as CARMEN writes them: lines of text, each a message.
//!
//! Of these, `FLASER`, `ROBOTLASER1`, which newer logs have in its place, and `ODOM` are read, all others are passed over:
//!
//! ```text
//! ODOM x y theta tv rv accel ipc_timestamp ipc_hostname logger_timestamp
//! FLASER num_readings [range_readings] x y theta odom_x odom_y odom_theta ipc_timestamp ipc_hostname logger_timestamp
//! ROBOTLASER1 laser_type start_angle field_of_view angular_resolution maximum_range accuracy remission_mode
//!     num_readings [range_readings] num_remissions [remission_values] laser_pose_x laser_pose_y laser_pose_theta
//!     robot_pose_x robot_pose_y robot_pose_theta laser_tv laser_rv forward_safety_dist side_safety_dist turn_axis
//!     ipc_timestamp ipc_hostname logger_timestamp
//! ```
//!
//! Metres and radians (CARMEN's manual, "Logger and Playback"). The beams go to the left. A `FLASER` does not say where its beams are: they
//! lie evenly over the laser's field of view, half of it on either side of ahead, and that is 180° if nobody says another
//! ([`Reader::with_field_of_view`]). A `ROBOTLASER1` says the bearing of its first beam, and over what its beams lie.

use std::f64::consts::{PI, TAU};
use std::io::{BufRead, Read};

use nalgebra::{Isometry2, Point2, Vector2};

/// One scan of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct LaserScan {
    /// Which line of the log it is, from 1.
    pub line: usize,
    /// When it was taken, seconds; none where the log says 0, as some do of all.
    pub time: Option<f64>,
    /// Ranges of the beams, metres, from right to left. What a beam without return reads is the laser's own: mostly the largest range.
    pub ranges: Vec<f32>,
    /// Where the beams are.
    pub fan: Fan,
    /// The range that a beam without return reads at least, metres, where the line says it.
    pub range_max: Option<f32>,
    /// Where the laser was, as the log says: in logs that were corrected, by whatever corrected them.
    pub pose: Isometry2<f64>,
    /// Where wheels say that it was: the motions of the log's `ODOM` lines one after the other, or what the scan says itself where there are none.
    pub odometry: Isometry2<f64>,
}

/// Where the beams of a scan are: evenly one after the other, to the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fan {
    /// The bearing of the first beam, radians, 0 ahead and positive to the left.
    pub start: f64,
    /// From a beam to the next, radians.
    pub step: f64,
    /// What all of them cover, radians.
    pub field_of_view: f64,
}

impl Fan {
    /// Of so many beams over a field of view (radians) with its middle ahead: with an even number each has its share of it, with an odd one the
    /// outermost are so far apart.
    fn even(beams: usize, field_of_view: f64) -> Self {
        let shares = beams - beams % 2;
        Self { start: -field_of_view / 2.0, step: field_of_view / shares.max(1) as f64, field_of_view }
    }

    /// Of so many beams, as a line says it: the resolution, which is rounded there, tells whether each beam has its share of the field of view, or
    /// the outermost are so far apart.
    fn said(beams: usize, start: f64, field_of_view: f64, resolution: f64) -> Result<Self, Fault> {
        let unfit = || Fault::Fan { beams, start, field_of_view, resolution };
        if start.abs() > TAU || !(field_of_view > 0.0 && field_of_view < TAU + ROUNDED) {
            return Err(unfit());
        }
        let steps = [beams, beams - 1].map(|shares| field_of_view / shares.max(1) as f64);
        let off = |step: f64| (step - resolution).abs();
        let step = if off(steps[0]) < off(steps[1]) { steps[0] } else { steps[1] };
        match beams == 1 || off(step) <= ROUNDED * step {
            true => Ok(Self { start, step, field_of_view }),
            false => Err(unfit()),
        }
    }
}

impl LaserScan {
    /// The bearing of a beam, radians, 0 ahead and positive to the left.
    pub fn bearing(&self, beam: usize) -> f64 {
        self.fan.start + beam as f64 * self.fan.step
    }

    /// The points that the beams hit nearer than `range_max` metres, in the laser's frame: x ahead, y to the left.
    pub fn points(&self, range_max: f32) -> Vec<Point2<f32>> {
        let hit = |(beam, &range): (usize, &f32)| {
            let (sin, cos) = self.bearing(beam).sin_cos();
            (range > 0.0 && range < range_max).then(|| Point2::new(cos as f32 * range, sin as f32 * range))
        };
        self.ranges.iter().enumerate().filter_map(hit).collect()
    }
}

/// A line that could not be used, or a log that could not be read on.
#[derive(Debug, thiserror::Error)]
#[error("{log}:{line}: {fault}")]
pub struct CarmenError {
    /// The log.
    pub log: String,
    /// Which line, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub fault: Fault,
}

/// What is wrong with a line.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// A word that should be a number.
    #[error("{found:?} as {what}: a finite number would be right")]
    Number {
        /// What the number would be.
        what: &'static str,
        /// The word.
        found: String,
    },
    /// A position that is on no map.
    #[error("{found} m as {what}: at most {FARTHEST} m, either way, would be right")]
    Far {
        /// Which coordinate.
        what: &'static str,
        /// The coordinate, metres.
        found: f64,
    },
    /// A range that is none.
    #[error("beam {beam} of {found} m: a finite range of at least 0 would be right")]
    Range {
        /// Which beam, from 0.
        beam: usize,
        /// The range, metres.
        found: f64,
    },
    /// A scan of no beam, or of more than a laser has.
    #[error("a scan of {found} beams: 1 to {MAX_BEAMS} would be right")]
    Beams {
        /// How many it says it has.
        found: String,
    },
    /// A number of remissions that is none.
    #[error("{found:?} remissions: 0 to {MAX_BEAMS} would be right")]
    Remissions {
        /// How many it says it has.
        found: String,
    },
    /// A laser that sees nothing.
    #[error("a largest range of {found} m: one above 0 would be right")]
    Reach {
        /// The range, metres.
        found: f64,
    },
    /// Beams that lie over no such field of view.
    #[error(
        "{beams} beams from {start} rad on, {resolution} rad from one to the next, over {field_of_view} rad: a field of view of 6.2832 rad (360°) \
         at most would be right, that as many steps of this resolution fill, or one less"
    )]
    Fan {
        /// How many beams there are.
        beams: usize,
        /// The bearing of the first, radians.
        start: f64,
        /// What they should cover, radians.
        field_of_view: f64,
        /// From one to the next, radians.
        resolution: f64,
    },
    /// A line that is not as long as its kind is.
    #[error("{kind} with {found} words: {wanted} would be right")]
    Words {
        /// The kind of line.
        kind: &'static str,
        /// How many words there are.
        found: usize,
        /// How many there should be.
        wanted: usize,
    },
    /// A scan from before the last one.
    #[error("a scan of {found} s after one of {last} s: times go forwards")]
    Backwards {
        /// Its time, seconds.
        found: f64,
        /// That of the last scan, seconds.
        last: f64,
    },
    /// A line that no laser writes.
    #[error("a line of more than {MAX_LINE} bytes: this is no CARMEN log")]
    Long,
    /// There is a lot of text, and no scan in it; the rest is not read.
    #[error("no scan in {MAX_APART} bytes: this is no CARMEN log, or none any more, and the rest of it is not read")]
    NoScan,
    /// The log cannot be read any further.
    #[error("cannot be read on: {0}")]
    Io(#[from] std::io::Error),
}

/// The farthest that a position is from the origin along either axis, metres: those of a country's grid are nearer. One that is
/// farther would spoil the sum of all motions behind it.
pub const FARTHEST: f64 = 1e7;
/// The most beams of a scan.
pub const MAX_BEAMS: usize = 10_000;
/// The most bytes of a line.
pub const MAX_LINE: u64 = 1 << 18;
/// The most bytes before the first scan, and between one and the next: hours of odometry. A compressed log can have gigabytes of
/// empty lines in a megabyte.
pub const MAX_APART: u64 = 1 << 24;

/// By so much, as a share, a resolution and a whole turn may be off: logs round them.
const ROUNDED: f64 = 0.01;

/// The scans of a log, one by one. A line that cannot be used is an error, and the next one goes on behind it; whoever counts the errors knows how many
/// were left out.
pub struct Reader<R> {
    log: String,
    input: R,
    line: usize,
    /// Bytes since the last scan.
    apart: u64,
    is_over: bool,
    /// Of the last two scans that say theirs.
    times: [f64; 2],
    reckoning: Reckoning,
    /// Of a `FLASER`, radians.
    field_of_view: f64,
}

/// Where wheels say that the robot is.
#[derive(Default)]
struct Reckoning {
    /// All motions one after the other.
    pose: Isometry2<f64>,
    /// The last pose that a line said.
    said: Option<Isometry2<f64>>,
    /// That of the last scan.
    scan: Option<Isometry2<f64>>,
}

impl Reckoning {
    fn moved(&mut self, to: Isometry2<f64>, time: f64) {
        // Behind each scan that it corrected GMapping writes an `ODOM` without a time, from which odometry then goes on: nothing has moved.
        let is_corrected = time == 0.0 && self.scan == Some(to);
        match self.said {
            Some(said) if !is_corrected => self.pose *= said.inverse() * to,
            Some(_) => (),
            None => self.pose = to,
        }
        self.said = Some(to);
    }
}

impl<R: BufRead> Reader<R> {
    /// Of a log that errors call so.
    pub fn new(log: impl Into<String>, input: R) -> Self {
        let (log, reckoning) = (log.into(), Reckoning::default());
        Self {
            log,
            input,
            line: 0,
            apart: 0,
            is_over: false,
            times: [f64::NEG_INFINITY; 2],
            reckoning,
            field_of_view: PI,
        }
    }

    /// With this field of view (radians, up to 2π) of the laser whose lines do not say theirs.
    pub fn with_field_of_view(self, field_of_view: f64) -> Self {
        Self { field_of_view, ..self }
    }

    /// The next line; none at the end.
    fn line(&mut self) -> Result<Option<String>, Fault> {
        let mut bytes = Vec::new();
        self.line += 1;
        self.input.by_ref().take(MAX_LINE).read_until(b'\n', &mut bytes)?;
        self.count(bytes.len())?;
        if bytes.len() as u64 == MAX_LINE && bytes.last() != Some(&b'\n') {
            self.skip_line()?;
            return Err(Fault::Long);
        }
        Ok((!bytes.is_empty()).then(|| String::from_utf8_lossy(&bytes).into_owned()))
    }

    fn count(&mut self, bytes: usize) -> Result<(), Fault> {
        self.apart += bytes as u64;
        if self.apart > MAX_APART { Err(Fault::NoScan) } else { Ok(()) }
    }

    fn skip_line(&mut self) -> Result<(), Fault> {
        loop {
            let buffer = self.input.fill_buf()?;
            let end = buffer.iter().position(|&byte| byte == b'\n');
            let used = end.map_or(buffer.len(), |end| end + 1);
            let is_over = end.is_some() || used == 0;
            self.input.consume(used);
            self.count(used)?;
            if is_over {
                return Ok(());
            }
        }
    }

    /// The scan of a line, if it has one.
    fn scan(&mut self, line: &str) -> Result<Option<LaserScan>, Fault> {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.first() {
            Some(&"ODOM") => {
                count("ODOM", &words, 10)?;
                let time = number("a time", words[7])?;
                self.reckoning.moved(pose(&words[1..4])?, time);
                Ok(None)
            }
            Some(&"FLASER") => self.laser(&words).map(Some),
            Some(&"ROBOTLASER1") => self.robot_laser(&words).map(Some),
            _ => Ok(None),
        }
    }

    fn laser(&mut self, words: &[&str]) -> Result<LaserScan, Fault> {
        let beams = beams(words, 1)?;
        count("FLASER", words, beams + 11)?;
        let (ranges, rest) = words[2..].split_at(beams);
        self.taken(ranges, Fan::even(beams, self.field_of_view), None, rest, rest[6])
    }

    fn robot_laser(&mut self, words: &[&str]) -> Result<LaserScan, Fault> {
        let beams = beams(words, 8)?;
        let said = words.get(9 + beams).copied().unwrap_or_default();
        let remissions = said.parse().ok().filter(|remissions| *remissions <= MAX_BEAMS);
        let remissions: usize = remissions.ok_or_else(|| Fault::Remissions { found: said.to_owned() })?;
        count("ROBOTLASER1", words, beams + remissions + 24)?;
        let [start, field_of_view, resolution] = [2, 3, 4].map(|word| number("an angle", words[word]));
        let fan = Fan::said(beams, start?, field_of_view?, resolution?)?;
        let range_max = match number("a largest range", words[5])? {
            found if found > 0.0 => found as f32,
            found => return Err(Fault::Reach { found }),
        };
        let (ranges, rest) = words[9..].split_at(beams);
        let rest = &rest[1 + remissions..];
        self.taken(ranges, fan, Some(range_max), rest, rest[11])
    }

    /// A scan of these ranges; `poses`: where the laser and the robot were.
    fn taken(
        &mut self,
        ranges: &[&str],
        fan: Fan,
        range_max: Option<f32>,
        poses: &[&str],
        time: &str,
    ) -> Result<LaserScan, Fault> {
        let range = |(beam, word): (usize, &&str)| {
            let found: f64 = word.parse().map_err(|_| Fault::Number { what: "a range", found: (*word).to_owned() })?;
            match found.is_finite() && found >= 0.0 {
                true => Ok(found as f32),
                false => Err(Fault::Range { beam, found }),
            }
        };
        let ranges = ranges.iter().enumerate().map(range).collect::<Result<_, _>>()?;
        let (pose, own) = (pose(&poses[..3])?, pose(&poses[3..6])?);
        let time = Some(number("a time", time)?).filter(|&time| time != 0.0);
        self.reckoning.scan = Some(pose);
        let [before, last] = self.times;
        if let Some(found) = time.filter(|found| *found < last) {
            // Where it is behind the one before the last, the last one said a time that was none: it goes on from this one.
            self.times[1] = if found >= before { found } else { last };
            return Err(Fault::Backwards { found, last });
        }
        self.times = time.map_or(self.times, |time| [last, time]);
        let odometry = if self.reckoning.said.is_some() { self.reckoning.pose } else { own };
        Ok(LaserScan { line: self.line, time, ranges, fan, range_max, pose, odometry })
    }
}

/// The number of beams that the word at `place` says.
fn beams(words: &[&str], place: usize) -> Result<usize, Fault> {
    let said = words.get(place).copied().unwrap_or_default();
    let beams = said.parse().ok().filter(|beams| (1..=MAX_BEAMS).contains(beams));
    beams.ok_or_else(|| Fault::Beams { found: said.to_owned() })
}

fn count(kind: &'static str, words: &[&str], wanted: usize) -> Result<(), Fault> {
    match words.len() == wanted {
        true => Ok(()),
        false => Err(Fault::Words { kind, found: words.len(), wanted }),
    }
}

fn number(what: &'static str, word: &str) -> Result<f64, Fault> {
    let number = word.parse().ok().filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| Fault::Number { what, found: word.to_owned() })
}

/// A pose of three words.
fn pose(words: &[&str]) -> Result<Isometry2<f64>, Fault> {
    let coordinate = |what, word| match number(what, word)? {
        found if found.abs() > FARTHEST => Err(Fault::Far { what, found }),
        found => Ok(found),
    };
    let (x, y) = (coordinate("x", words[0])?, coordinate("y", words[1])?);
    Ok(Isometry2::new(Vector2::new(x, y), number("an angle", words[2])?))
}

impl<R: BufRead> Iterator for Reader<R> {
    type Item = Result<LaserScan, CarmenError>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.is_over {
            let scan = match self.line() {
                Ok(None) => return None,
                Ok(Some(line)) => self.scan(&line),
                Err(fault) => Err(fault),
            };
            self.is_over = matches!(scan, Err(Fault::Io(_) | Fault::NoScan));
            if let Ok(Some(_)) = scan {
                self.apart = 0;
            }
            let error = |fault| CarmenError { log: self.log.clone(), line: self.line, fault };
            if let Some(next) = scan.transpose() {
                return Some(next.map_err(error));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests;
