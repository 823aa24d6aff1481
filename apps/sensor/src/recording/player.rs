//! Goes through a recording, scan by scan.

use elk_bus::Describe;
use elk_geometry::Pose;
use elk_spatial::CameraInfo;
use elk_spatial::checks::SUMS;
use elk_spatial::playback::{Playback, PoseEstimate};
use nalgebra::Isometry3;

use super::frames::Recording;
use crate::frame::{BadFrame, Frame};
use crate::pose_estimator::{Located, PoseEstimator};
use crate::source::Seen;

/// Frames that are taken at a time while none of them becomes a scan: what is said of them, and how long nobody else is
/// heard, is bounded by it.
const MOST_AT_A_TIME: usize = 256;

/// A recording on its way.
pub struct Player {
    recording: Box<dyn Recording>,
    estimator: Box<dyn PoseEstimator>,
    /// Frames that may still come; none: all that there are.
    left: Option<u64>,
    start: Pose,
    /// The last scan, and where it was taken (world).
    last: Option<(Pose, Seen)>,
    frames: u64,
    scans: u64,
    bad: u64,
    lost: u64,
    path_length_m: f64,
    /// Why it ends before its last frame; empty: it does not.
    cut: String,
    off: Off,
}

/// How far estimated positions lie off the recorded ones. An estimate whose first scans have no recorded pose begins somewhere else: both ways are
/// laid on each other at the first scan of which both are known.
#[derive(Debug, Default)]
struct Off {
    /// recorded · estimated⁻¹ of that scan.
    recorded_from_estimated: Option<Isometry3<f64>>,
    /// The sum of the squares of the distances (m²).
    squares: f64,
    compared: u64,
}

impl Off {
    fn add(&mut self, estimated: &Pose, recorded: &Pose) {
        let begun = *self.recorded_from_estimated.get_or_insert(recorded.0 * estimated.0.inverse());
        self.squares += (begun * estimated.position() - recorded.position()).norm_squared();
        self.compared += 1;
    }

    /// Root mean square (m); none: nothing could be compared.
    fn root_mean_square(&self) -> Option<f64> {
        (self.compared > 0).then(|| (self.squares / self.compared as f64).sqrt())
    }
}

/// What came on the way to the next scan.
#[derive(Debug, Default)]
pub struct Advance {
    /// What was estimated, a frame each.
    pub estimates: Vec<PoseEstimate>,
    /// Frames that could not be used, or of which nobody knows where they were taken.
    pub passed_over: Vec<BadFrame>,
}

impl Player {
    /// At the recording's beginning; `frames`: only so many are played.
    pub fn new(recording: Box<dyn Recording>, estimator: Box<dyn PoseEstimator>, frames: Option<u64>) -> Self {
        let start = Some(recording.start()).filter(|pose| pose.check().is_ok());
        let start = start.unwrap_or(Pose(Isometry3::identity()));
        Self {
            recording,
            estimator,
            left: frames,
            start,
            last: None,
            frames: 0,
            scans: 0,
            bad: 0,
            lost: 0,
            path_length_m: 0.0,
            cut: String::new(),
            off: Off::default(),
        }
    }

    /// What the recording's sensor can see.
    pub fn camera(&self) -> CameraInfo {
        self.recording.camera()
    }

    /// What whoever looks at the scans should know.
    pub fn remarks(&self) -> Vec<String> {
        self.recording.remarks()
    }

    /// Where the last scan was taken (world), or where the recording begins.
    pub fn pose(&self) -> Pose {
        self.last.as_ref().map_or(self.start, |(pose, _)| *pose)
    }

    /// Scans so far.
    pub fn scans(&self) -> u64 {
        self.scans
    }

    /// What the last scan saw; none: there was none.
    pub fn seen(&self) -> Option<&Seen> {
        self.last.as_ref().map(|(_, seen)| seen)
    }

    /// Takes frames until there is a scan, or no more, or many were none: then the next call goes on.
    pub fn advance(&mut self) -> Advance {
        let (mut advance, scans) = (Advance::default(), self.scans);
        for _ in 0..MOST_AT_A_TIME {
            if self.scans > scans || self.next_secs().is_none() {
                break;
            }
            let Some(next) = self.recording.next() else { break };
            self.frames += 1;
            self.left = self.left.map(|left| left.saturating_sub(1));
            let passed_over = match next {
                Ok(frame) => self.take(frame, &mut advance.estimates),
                Err(frame) => {
                    self.bad += 1;
                    Err(frame)
                }
            };
            advance.passed_over.extend(passed_over.err());
        }
        advance
    }

    /// Goes on where another player has had so many scans.
    pub fn seek(&mut self, scans: u64) {
        while self.scans < scans && self.next_secs().is_some() {
            self.advance();
        }
    }

    fn next_secs(&self) -> Option<f64> {
        // A time that is none is said of its frame.
        self.recording
            .next_secs()
            .map(|secs| secs.clamp(*SUMS.start(), *SUMS.end()))
            .filter(|_| self.left != Some(0) && self.cut.is_empty())
    }

    /// How far it is, after this command.
    pub fn playback(&self, command: u64) -> Playback {
        let Self { frames, scans, bad, lost, path_length_m, .. } = *self;
        Playback {
            command,
            frames,
            scans,
            bad,
            lost,
            path_length_m,
            pose: self.pose(),
            next_secs: self.next_secs(),
            cut: self.cut.clone(),
            off_m: self.off.root_mean_square(),
        }
    }

    fn take(&mut self, frame: Frame, estimates: &mut Vec<PoseEstimate>) -> Result<(), BadFrame> {
        if !SUMS.contains(&frame.secs) {
            self.bad += 1;
            let why = format!(
                "{:e} s after the recording's beginning: at most {:e} s would be right",
                frame.secs,
                SUMS.end()
            );
            return Err(BadFrame { frame: frame.name, why });
        }
        let located = match self.estimator.locate(&frame) {
            Located::At(pose, covariance, overlap) => match pose.check() {
                Ok(()) => Located::At(pose, covariance, overlap),
                Err(invalid) => Located::Bad(format!("its pose: {invalid}")),
            },
            other => other,
        };
        let mut estimate = PoseEstimate {
            scan: 0,
            frame: frame.name.clone(),
            secs: frame.secs,
            pose: None,
            recorded: frame.pose.as_ref().ok().copied().filter(|pose| pose.check().is_ok()),
            covariance: Vec::new(),
            overlap: 0.0,
            lost: String::new(),
        };
        match located {
            Located::At(pose, covariance, overlap) => {
                self.go_to(pose, &frame, estimate.recorded);
                estimate = PoseEstimate { scan: self.scans, pose: Some(pose), covariance, overlap, ..estimate };
                estimates.extend(Some(estimate).filter(|_| self.estimator.estimates()));
                Ok(())
            }
            Located::Lost(why) => {
                self.lost += 1;
                estimates.push(PoseEstimate { lost: why.clone(), ..estimate });
                Err(BadFrame { frame: frame.name, why: format!("lost: {why}") })
            }
            Located::Apart(why) => {
                // A map that went on would be of two places at once.
                self.lost += 1;
                self.cut = format!("{}: {why}", frame.name);
                estimates.push(PoseEstimate { lost: why.clone(), ..estimate });
                Err(BadFrame { frame: frame.name, why: format!("lost for good: {why}; the recording ends here") })
            }
            Located::Bad(why) => {
                self.bad += 1;
                Err(BadFrame { frame: frame.name, why })
            }
        }
    }

    fn go_to(&mut self, pose: Pose, frame: &Frame, recorded: Option<Pose>) {
        if let Some((last, _)) = &self.last {
            self.path_length_m += (pose.position() - last.position()).norm();
        }
        if let Some(recorded) = recorded.filter(|_| self.estimator.estimates()) {
            self.off.add(&pose, &recorded);
        }
        let points = frame.points.iter().copied().collect();
        let no_return = frame.no_return.iter().copied().collect();
        self.last = Some((pose, Seen { points, no_return, pixel_runs: self.recording.pixel_runs() }));
        self.scans += 1;
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::Point3;

    use super::*;
    use crate::pose_estimator::Recorded;

    /// Frames that are none, with a scan behind each so many.
    struct Mostly {
        bad: usize,
        left: usize,
        start: Pose,
        /// The frame with so many behind it is taken at a time that is none.
        late: Option<usize>,
    }

    impl Mostly {
        fn secs(&self, left: usize) -> f64 {
            if self.late == Some(left) { 1e300 } else { 0.0 }
        }
    }

    impl Recording for Mostly {
        fn camera(&self) -> CameraInfo {
            CameraInfo { columns: 1, rows: 1, fov_x: 1.0, fov_y: 1.0, range_m: 1.0, inverse_depth_sigma: 0.0 }
        }

        fn next_secs(&self) -> Option<f64> {
            self.left.checked_sub(1).map(|left| self.secs(left))
        }

        fn next(&mut self) -> Option<Result<Frame, BadFrame>> {
            self.left = self.left.checked_sub(1)?;
            let name = self.left.to_string();
            Some(match self.left % (self.bad + 1) {
                0 => Ok(Frame {
                    name,
                    secs: self.secs(self.left),
                    pose: Ok(Pose(Isometry3::identity())),
                    odometry: None,
                    pair: None,
                    points: Vec::new(),
                    no_return: Vec::new(),
                }),
                _ => Err(BadFrame { frame: name, why: "it is none".to_owned() }),
            })
        }

        fn start(&self) -> Pose {
            self.start
        }
    }

    /// Regression: nobody believed how far a recording was that came to such a time, and its mission stood still.
    #[test]
    fn a_frame_at_a_time_that_is_none_is_passed_over() {
        let start = Pose(Isometry3::identity());
        let recording = Mostly { bad: 0, left: 3, start, late: Some(1) };
        let mut player = Player::new(Box::new(recording), Box::new(Recorded), None);
        let (mut scans, mut passed_over) = (0, Vec::new());
        while player.next_secs().is_some() {
            assert!(player.playback(scans).check().is_ok(), "{:?}", player.playback(scans));
            passed_over.extend(player.advance().passed_over);
            scans += 1;
        }
        assert_eq!((player.scans(), player.playback(scans).bad, passed_over.len()), (2, 1, 1));
        let wanted = "1e300 s after the recording's beginning: at most 1e12 s would be right";
        assert_eq!((&passed_over[0].frame[..], &passed_over[0].why[..]), ("1", wanted));
    }

    /// A player of a recording of `left` frames, of which so many are bad before each that is none, and that says it begins at x.
    pub(crate) fn player(bad: usize, left: usize, x: f64) -> Player {
        let start = Pose(Isometry3::translation(x, 0.0, 0.0));
        Player::new(Box::new(Mostly { bad, left, start, late: None }), Box::new(Recorded), None)
    }

    /// Regression: half a megabyte of a log had a sensor gather millions of bad lines before it said the first.
    #[test]
    fn frames_that_are_none_are_said_before_all_are_gone_through() {
        let mut player = player(999, 10_000, 0.0);
        let (mut calls, mut passed_over) = (0, 0);
        while player.next_secs().is_some() {
            let advance = player.advance();
            assert!(advance.passed_over.len() <= MOST_AT_A_TIME);
            (calls, passed_over) = (calls + 1, passed_over + advance.passed_over.len());
        }
        assert_eq!((player.scans(), passed_over), (10, 9990));
        assert_eq!(calls, 10 * 1000usize.div_ceil(MOST_AT_A_TIME));
    }

    #[test]
    fn who_comes_later_finds_the_scan_among_frames_that_are_none() {
        let mut player = player(999, 10_000, 0.0);
        player.seek(7);
        assert_eq!(player.scans(), 7);
        assert_eq!(player.playback(0).frames, 7000);
    }

    /// Regression: an estimate that begins where no pose is recorded was held against the recorded ones as if it began there.
    #[test]
    fn ways_are_laid_on_each_other_where_both_are_known() {
        let at = |x: f64, yaw: f64| Pose::from_yaw_pitch(Point3::new(x, 0.0, 0.0), yaw, 0.0);
        let mut off = Off::default();
        assert_eq!(off.root_mean_square(), None);
        // The recorded way begins 5 m further on, and looks to the left; both go a metre ahead.
        off.add(&at(1.0, 0.0), &at(6.0, FRAC_PI_2));
        assert!(off.root_mean_square().unwrap() < 1e-12);
        off.add(&at(2.0, 0.0), &Pose::from_yaw_pitch(Point3::new(6.0, 1.0, 0.0), FRAC_PI_2, 0.0));
        assert!(off.root_mean_square().unwrap() < 1e-12);
        off.add(&at(2.0, 0.0), &Pose::from_yaw_pitch(Point3::new(6.0, 1.0, 0.3), FRAC_PI_2, 0.0));
        assert!((off.root_mean_square().unwrap() - 0.3 / 3_f64.sqrt()).abs() < 1e-12);
    }

    /// Regression: the start of a recording was said as it was recorded, nobody believed it, and its mission stood still.
    #[test]
    fn a_start_that_cannot_be_is_not_said() {
        assert_eq!(player(1, 2, 1e300).playback(0).pose, Pose(Isometry3::identity()));
        assert_eq!(player(1, 2, 3.0).playback(0).pose.position().x, 3.0);
    }
}
