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
    last_time: Option<f64>,
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
        Self { log, input, line: 0, apart: 0, is_over: false, last_time: None, reckoning, field_of_view: PI }
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
        if let (Some(found), Some(last)) = (time, self.last_time)
            && found < last
        {
            return Err(Fault::Backwards { found, last });
        }
        self.last_time = time.or(self.last_time);
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
mod tests {
    use super::*;

    /// The scans of a log, and what was wrong with it.
    fn read(log: &str) -> (Vec<LaserScan>, Vec<String>) {
        let (mut scans, mut errors) = (Vec::new(), Vec::new());
        for next in Reader::new("a.log", log.as_bytes()) {
            match next {
                Ok(scan) => scans.push(scan),
                Err(error) => errors.push(error.to_string()),
            }
        }
        (scans, errors)
    }

    #[test]
    fn a_log_has_scans_poses_and_odometry() {
        let log = "# a comment\nPARAM robot_frontlaser_offset 0.0 nohost 0\n\
            ODOM 0 0 0 0 0 0 1.0 host 1.0\nODOM 1 0 0 0 0 0 2.0 host 2.0\n\
            FLASER 3 1.0 2.0 81.91 1.5 0.25 0.5 1.5 0.25 0.5 2.5 host 2.5\n\
            ODOM 1.5 0.25 0.5 0 0 0 0 host 0\nODOM 2.5 0.25 0.5 0 0 0 3.0 host 3.0\n\
            FLASER 2 1.0 2.0 2.4 0.3 0.5 2.4 0.3 0.5 3.5 host 3.5";
        let (scans, errors) = read(log);
        assert_eq!(errors, Vec::<String>::new());
        assert_eq!((scans.len(), scans[0].line, scans[1].line), (2, 5, 8));
        assert_eq!((scans[0].time, scans[0].ranges.as_slice()), (Some(2.5), &[1.0, 2.0, 81.91][..]));
        assert_eq!(scans[0].pose, Isometry2::new(Vector2::new(1.5, 0.25), 0.5));
        assert_eq!(scans[0].odometry, Isometry2::translation(1.0, 0.0));
        // A metre along x, from where it was said to be at an angle of 0.5.
        let moved = scans[1].odometry.translation.vector - Vector2::new(1.0 + 0.5f64.cos(), -(0.5f64.sin()));
        assert!(moved.norm() < 1e-12, "{}", scans[1].odometry);

        let points = scans[0].points(50.0);
        assert_eq!(points.len(), 2, "one beam came not back");
        assert!(
            (points[0] - Point2::new(0.0, -1.0)).norm() < 1e-6 && (points[1] - Point2::new(2.0, 0.0)).norm() < 1e-6
        );
        let bearings = [0, 1].map(|beam| scans[1].bearing(beam).to_degrees());
        assert!((bearings[0] + 90.0).abs() < 1e-9 && bearings[1].abs() < 1e-9, "{bearings:?}");
    }

    /// Regression: whatever a laser saw was taken to lie over 180°.
    #[test]
    fn beams_lie_over_the_field_of_view_that_the_laser_has() {
        let scan = |beams: usize| format!("FLASER {beams}{} 0 0 0 0 0 0 0 host 0", " 1".repeat(beams));
        let bearings = |beams: usize, degrees: f64| {
            let log = scan(beams);
            let reader = Reader::new("a.log", log.as_bytes()).with_field_of_view(degrees.to_radians());
            let scan = reader.map(Result::unwrap).next().unwrap();
            [0, beams - 1].map(|beam| scan.bearing(beam).to_degrees())
        };
        for (beams, degrees, wanted) in
            [(1081, 270.0, [-135.0, 135.0]), (1080, 270.0, [-135.0, 134.75]), (360, 360.0, [-180.0, 179.0])]
        {
            let found = bearings(beams, degrees);
            assert!((0..2).all(|i| (found[i] - wanted[i]).abs() < 1e-9), "{beams} over {degrees}: {found:?}");
        }
    }

    /// A `ROBOTLASER1` of as many beams of 1 m, seen from (1, 2) by a laser that is 0.2 m ahead of the robot, `extra` remissions behind.
    fn robot_laser(beams: usize, angles: &str, extra: usize) -> String {
        let (ranges, remissions) = (" 1.0".repeat(beams), " 7".repeat(extra));
        format!(
            "ROBOTLASER1 4 {angles} 20.0 0.01 0 {beams}{ranges} {extra}{remissions} 1.2 2 0 1 2 0 0 0 0.3 0.3 0 5.5 host 5.6\n"
        )
    }

    #[test]
    fn a_newer_line_says_its_own_bearings_and_range() {
        let log = [
            robot_laser(1081, "-2.356194 4.712389 0.004363", 0),
            robot_laser(540, "-2.356194 4.712389 0.008727", 540),
            robot_laser(181, "-1.570796 3.141593 0.0175", 0),
            robot_laser(360, "-3.141593 6.283185 0.017453", 0),
            robot_laser(90, "0 1.570796 0.017453", 0),
        ];
        let (scans, errors) = read(&log.concat());
        assert_eq!(errors, Vec::<String>::new());
        let ends = scans.iter().map(|scan| [0, scan.ranges.len() - 1].map(|beam| scan.bearing(beam).to_degrees()));
        let wanted = [[-135.0, 135.0], [-135.0, 134.5], [-90.0, 90.0], [-180.0, 179.0], [0.0, 89.0]];
        for (found, wanted) in ends.zip(wanted) {
            assert!((0..2).all(|i| (found[i] - wanted[i]).abs() < 1e-4), "{found:?} is not {wanted:?}");
        }
        let LaserScan { pose, odometry, time, range_max, .. } = &scans[1];
        assert_eq!((*pose, *odometry), (Isometry2::translation(1.2, 2.0), Isometry2::translation(1.0, 2.0)));
        assert_eq!((*time, *range_max), (Some(5.5), Some(20.0)));
    }

    #[test]
    fn newer_lines_that_are_none_are_said() {
        let whole = robot_laser(3, "-1.570796 3.141593 1.5708", 0);
        let log = [
            robot_laser(0, "-1.57 3.14 0.01", 0),
            robot_laser(181, "-1.570796 3.141593 0.008727", 0),
            robot_laser(3, "-1.570796 nan 1.5708", 0),
            robot_laser(3, "-1.570796 6.9 3.45", 0),
            whole.replace(" 20.0 ", " 0 "),
            whole.replace(" 0 1.2", " -1 1.2"),
            whole.replace(" 5.5 ", " "),
            whole.clone(),
        ];
        let (scans, errors) = read(&log.concat());
        let wanted = [
            "a.log:1: a scan of 0 beams",
            "a.log:2: 181 beams from -1.570796 rad on, 0.008727 rad from one to the next, over 3.141593 rad: a field of",
            "a.log:3: \"nan\" as an angle",
            "a.log:4: 3 beams from -1.570796 rad on, 3.45 rad",
            "a.log:5: a largest range of 0 m: one above 0 would be right",
            "a.log:6: \"-1\" remissions: 0 to 10000 would be right",
            "a.log:7: ROBOTLASER1 with 26 words: 27 would be right",
        ];
        assert!(
            errors.len() == 7 && errors.iter().zip(wanted).all(|(said, wanted)| said.starts_with(wanted)),
            "{errors:#?}"
        );
        assert_eq!(scans.len(), 1);
    }

    #[test]
    fn a_log_without_odometry_has_that_of_its_scans() {
        let (scans, _) = read("FLASER 1 1.0 9 9 0 1 2 0 0 host 0");
        assert_eq!(scans[0].odometry, Isometry2::translation(1.0, 2.0));
        assert_eq!(scans[0].time, None);
    }

    /// Regression: one `ODOM` from nowhere made a NaN of where wheels said that the robot was, for the rest of the log.
    #[test]
    fn a_position_that_is_on_no_map_spoils_no_other() {
        let odom = |x: &str, time: f64| format!("ODOM {x} 0 0 0 0 0 {time} host {time}\n");
        let scan = |time: f64| format!("FLASER 1 1.0 0 0 0 0 0 0 {time} host {time}\n");
        let log = [odom("1", 1.0), scan(1.5), odom("1e308", 2.0), odom("-1e308", 3.0), odom("2", 4.0), scan(4.5)];
        let (scans, errors) = read(&log.concat());
        assert_eq!((scans.len(), errors.len()), (2, 2), "{errors:?}");
        assert_eq!(scans[1].odometry, Isometry2::translation(2.0, 0.0));
    }

    #[test]
    fn bad_lines_are_said_and_passed_over() {
        let long = format!("FLASER 1 {}\n", "1".repeat(300_000));
        let log = [
            "FLASER 0 0 0 0 0 0 0 1.0 host 1.0\n",
            "FLASER 2 1.0 NaN 0 0 0 0 0 0 1.0 host 1.0\n",
            "FLASER 2 1.0 -2 0 0 0 0 0 0 1.0 host 1.0\n",
            "FLASER 2 1.0 2.0 0 0 0 0 0 0 5.0 host 5.0\n",
            "FLASER 2 1.0 2.0 0 0 0 0 0 0 4.0 host 4.0\n",
            "FLASER 3 1.0 2.0 0 0 0 0 0 0 6.0 host 6.0\n",
            "FLASER\n",
            &long,
            "ODOM 0 nan 0 0 0 0 1.0 host 1.0\n",
            "ODOM 0 0\n",
            "ODOM 0 -1e308 0 0 0 0 1.0 host 1.0\n",
            "FLASER 2 1.0 2.0 0 0 0 0 0 0 7.0 host 7.0\n",
        ];
        let (scans, errors) = read(&log.concat());
        let wanted = [
            "a.log:1: a scan of 0 beams: 1 to 10000 would be right",
            "a.log:2: beam 1 of NaN m: a finite range of at least 0 would be right",
            "a.log:3: beam 1 of -2 m: a finite range of at least 0 would be right",
            "a.log:5: a scan of 4 s after one of 5 s: times go forwards",
            "a.log:6: FLASER with 13 words: 14 would be right",
            "a.log:7: a scan of  beams: 1 to 10000 would be right",
            "a.log:8: a line of more than 262144 bytes: this is no CARMEN log",
            "a.log:9: \"nan\" as y: a finite number would be right",
            "a.log:10: ODOM with 3 words: 10 would be right",
            &format!("a.log:11: {} m as y: at most 10000000 m, either way, would be right", -1e308),
        ];
        assert_eq!(errors, wanted);
        assert_eq!(scans.iter().map(|scan| scan.line).collect::<Vec<_>>(), [4, 12]);
    }

    /// Regression: two megabytes that gzip had made of empty lines were read for minutes, and those of one that only begins like a scan
    /// took all memory.
    #[test]
    fn a_log_with_much_text_and_no_scan_is_not_read_to_its_end() {
        let scan = b"FLASER 1 1.0 9 9 0 1 2 0 0 host 0\n";
        for filling in ["\n", "FLASER\n", "# a comment\n", "x"] {
            let endless = std::io::BufReader::new(Filling(filling.as_bytes(), 0).take(2 * MAX_APART));
            let log = std::io::Read::chain(&scan[..], endless);
            let mut reader = Reader::new("a.log", std::io::BufReader::new(log));
            assert!(reader.next().unwrap().is_ok());
            let mut last = reader.next().unwrap().unwrap_err().to_string();
            for next in reader {
                last = next.unwrap_err().to_string();
            }
            assert!(last.contains("no scan in 16777216 bytes: this is no CARMEN log"), "{filling:?}: {last}");
        }
        // What is said between two scans counts for these two.
        let hours = [scan, &b"# a comment\n".repeat(100_000)[..]].concat().repeat(20);
        assert_eq!(Reader::new("a.log", hours.as_slice()).filter(Result::is_ok).count(), 20);
    }

    /// The same bytes, over and over.
    struct Filling(&'static [u8], usize);

    impl Read for Filling {
        fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
            for byte in &mut *to {
                *byte = self.0[self.1 % self.0.len()];
                self.1 += 1;
            }
            Ok(to.len())
        }
    }

    #[test]
    fn a_log_that_breaks_off_ends() {
        struct Broken;
        impl Read for Broken {
            fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
                Err(std::io::Error::other("no disk"))
            }
        }
        let read: Vec<_> = Reader::new("a.log", std::io::BufReader::new(Broken)).take(9).collect();
        assert_eq!(read.len(), 1);
        assert_eq!(read[0].as_ref().unwrap_err().to_string(), "a.log:1: cannot be read on: no disk");
    }
}
