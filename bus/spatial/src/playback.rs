//! What the sensor of a recording says beside its scans.

use elk_bus::payload;
use elk_geometry::Pose;

use crate::checks;

/// Sensor of a recording to anyone, on start-up and after every pose command, before the scan: how far it is. Each command takes
/// the next frame of which there is a scan; frames that are none, and frames of which nobody knows where they were taken, are
/// passed over and counted.
#[payload]
#[describe(check = playback)]
#[derive(Debug, Clone, PartialEq)]
pub struct Playback {
    /// The last pose command carried out.
    #[describe(count)]
    pub command: u64,
    /// Frames taken from the recording so far.
    #[describe(count)]
    pub frames: u64,
    /// Scans that came of them.
    #[describe(count)]
    pub scans: u64,
    /// Of the frames, those that could not be used.
    #[describe(count)]
    pub bad: u64,
    /// Of the frames, those of which the estimator of poses did not find where they were taken.
    #[describe(count)]
    pub lost: u64,
    /// Length of the way from scan to scan (m).
    #[describe(unit = "m", range = checks::LENGTHS_M)]
    pub path_length_m: f64,
    /// The camera's pose (world).
    pub pose: Pose,
    /// Recorded time since the recording's beginning of the frame that the next command begins with (s); none: the recording is
    /// over.
    #[describe(unit = "s")]
    pub next_secs: Option<f64>,
    /// How far scans lie off the recorded positions, root mean square (m), both ways laid on each other at the first scan of which both are known;
    /// none: poses are not estimated, or not recorded.
    #[describe(unit = "m")]
    pub off_m: Option<f64>,
    /// Why it ended before its last frame; empty: it did not.
    #[describe(check = checks::text)]
    pub cut: String,
}

/// Sensor that estimates its poses to anyone, for each frame, or for each pose command of a robot that is sent about, before the scan that
/// comes of it, if one does.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct PoseEstimate {
    /// The scan; 0: none came of the frame.
    #[describe(count)]
    pub scan: u64,
    /// What the recording calls the frame, or which look of a robot it was.
    #[describe(check = checks::text)]
    pub frame: String,
    /// Recorded time since the recording's beginning (s).
    #[describe(unit = "s", range = checks::SUMS)]
    pub secs: f64,
    /// The camera's pose (world), as estimated; none: it is lost.
    pub pose: Option<Pose>,
    /// The camera's pose (world), as recorded, or as a simulator knows it, where it is.
    pub recorded: Option<Pose>,
    /// Covariance of the estimate, row by row: of a step of the position along the world's axes and a turn about them (m, rad; 6 × 6),
    /// or of x, y and the heading (3 × 3). It is that of the noise of independent points, the least that there is. Empty: there is no
    /// pose, it is the first, which was given, or there are directions of which the scan says nothing.
    #[describe(longest = 36, check = covariance)]
    pub covariance: Vec<f64>,
    /// The share of what it could see again that it did: of the scan, that is on surfaces seen before, or of corners of images (0 to 1).
    #[describe(range = 0.0..=1.0)]
    pub overlap: f64,
    /// Why there is no pose; empty: there is one.
    #[describe(check = checks::text)]
    pub lost: String,
}

fn playback(playback: &Playback) -> checks::Checked {
    let numbers = [("next_secs", playback.next_secs), ("off_m", playback.off_m)];
    numbers.iter().filter_map(|(name, number)| Some((name, (*number)?))).try_for_each(|(name, number)| {
        checks::holds(name, checks::SUMS.contains(&number), number, "a number of 0 to 1e12")
    })
}

fn covariance(numbers: &[f64]) -> checks::Checked {
    let odd = numbers.iter().find(|number| !checks::SUMS.contains(&number.abs()));
    odd.map_or(Ok(()), |odd| checks::holds("", false, odd, "numbers of -1e12 to 1e12"))
}
