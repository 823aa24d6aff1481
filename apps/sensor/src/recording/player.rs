//! Goes through a recording, scan by scan.

use elk_bus::Describe;
use elk_geometry::Pose;
use elk_spatial::CameraInfo;
use elk_spatial::playback::{Playback, PoseEstimate};

use super::frames::Recording;
use crate::frame::{BadFrame, Frame};
use crate::pose_estimator::{Located, PoseEstimator};
use crate::source::Seen;

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
    /// Squares of the distances from recorded positions (m²), their sum, and how many there are.
    off: (f64, u64),
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
        let start = recording.start();
        let (last, off) = (None, (0.0, 0));
        let (frames, left) = (0, frames);
        Self {
            recording,
            estimator,
            left,
            start,
            last,
            frames,
            scans: 0,
            bad: 0,
            lost: 0,
            path_length_m: 0.0,
            cut: String::new(),
            off,
        }
    }

    /// What the recording's sensor can see.
    pub fn camera(&self) -> CameraInfo {
        self.recording.camera()
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

    /// Takes frames until there is a scan, or no more.
    pub fn advance(&mut self) -> Advance {
        let (mut advance, scans) = (Advance::default(), self.scans);
        while self.scans == scans && self.next_secs().is_some() {
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
        self.recording.next_secs().filter(|_| self.left != Some(0) && self.cut.is_empty())
    }

    /// How far it is, after this command.
    pub fn playback(&self, command: u64) -> Playback {
        let Self { frames, scans, bad, lost, path_length_m, .. } = *self;
        let (squares, compared) = self.off;
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
            off_m: (compared > 0).then(|| (squares / compared as f64).sqrt()),
        }
    }

    fn take(&mut self, frame: Frame, estimates: &mut Vec<PoseEstimate>) -> Result<(), BadFrame> {
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
            let (squares, compared) = self.off;
            self.off = (squares + (pose.position() - recorded.position()).norm_squared(), compared + 1);
        }
        let points = frame.points.iter().copied().collect();
        let no_return = frame.no_return.iter().copied().collect();
        self.last = Some((pose, Seen { points, no_return }));
        self.scans += 1;
    }
}
