//! Odometries on pairs whose poses are known, as rows of a table.

use elk_geometry::Pose;
use elk_odometry::{Odometry, OdometryConfig, Tracked};
use elk_stereo::{Image, Rectification, StereoCalibration};
use nalgebra::Isometry3;

use crate::alignment::{alignment, rms};
use crate::opencv;
use crate::stopwatch;
use crate::trajectory::{relative, way};

/// Pairs as the cameras take them, and where they were taken: the rectified left camera's frame → that of the truth.
pub struct Sequence {
    pub calibration: StereoCalibration,
    pub pairs: Vec<[Image; 2]>,
    pub truth: Vec<Isometry3<f64>>,
}

impl Sequence {
    /// As cameras would see it that go faster.
    #[allow(dead_code)] // One of the benches does not ask for it.
    pub fn every(&self, step: usize) -> Self {
        Self {
            calibration: self.calibration,
            pairs: self.pairs.iter().step_by(step).cloned().collect(),
            truth: self.truth.iter().step_by(step).copied().collect(),
        }
    }
}

/// An odometry's answers.
struct Answers {
    poses: Vec<Isometry3<f64>>,
    lost: usize,
    keyframes: usize,
    /// CPU time of each pair, rectification and all, milliseconds.
    ms: Vec<f64>,
}

fn track(sequence: &Sequence, rectification: &Rectification, config: &OdometryConfig) -> Answers {
    let start = Pose(Isometry3::identity());
    let mut odometry =
        Odometry::new(*rectification.rig(), sequence.calibration.left.size, config.clone(), start).unwrap();
    let mut answers = Answers { poses: Vec::new(), lost: 0, keyframes: 0, ms: Vec::new() };
    for [left, right] in &sequence.pairs {
        let (ms, tracked) = stopwatch::least(1, || {
            let [left, right] = rectification.rectify(left, right).unwrap();
            odometry.track(&left, &right).unwrap()
        });
        answers.ms.push(ms);
        answers.lost += usize::from(matches!(tracked, Tracked::Lost(_)));
        answers.keyframes += usize::from(matches!(tracked, Tracked::Started));
        if let Tracked::Found(estimate) = &tracked {
            answers.keyframes += usize::from(estimate.health.is_keyframe);
        }
        answers.poses.push(odometry.supposed().0);
    }
    answers
}

/// Prints the rows of elk with some settings, of OpenCV, and of whoever says that nothing moves; the relative error over stretches of so many metres. Gives the poses of the first row.
pub fn show(sequence: &Sequence, stretch: f64, settings: &[(&str, OdometryConfig)]) -> Vec<Isometry3<f64>> {
    let rectification = Rectification::new(&sequence.calibration).unwrap();
    let truth = &sequence.truth;
    let length = way(truth);
    println!("{} pairs, {:.4} m of way", truth.len(), length[length.len() - 1]);
    println!(
        "| odometry | lost | off, aligned | off at the end | of the way | over {stretch} m | keyframes | ms a pair: median, 99 %, most |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let row = |name: &str, poses: &[Isometry3<f64>], lost: usize, more: &str| {
        let aligned = rms(poses, truth, &alignment(poses, truth));
        let last = poses.len() - 1;
        let off = (poses[0].inverse() * poses[last]).inverse() * (truth[0].inverse() * truth[last]);
        let (end, turned) = (off.translation.vector.norm(), off.rotation.angle().to_degrees());
        let [part, radians] = relative(poses, truth, stretch);
        let share = 100.0 * end / length[last];
        let over = format!("{:.2} %, {:.2} °/m", 100.0 * part, radians.to_degrees());
        println!(
            "| {name} | {lost} | {:.2} mm | {:.2} mm, {turned:.3}° | {share:.2} % | {over} | {more} |",
            1e3 * aligned,
            1e3 * end
        );
    };
    let mut first = None;
    for (name, config) in settings {
        let mut answers = track(sequence, &rectification, config);
        answers.ms.sort_by(f64::total_cmp);
        let at = |part: f64| answers.ms[(part * (answers.ms.len() - 1) as f64).round() as usize];
        let more = format!("{} | {:.1}, {:.1}, {:.1}", answers.keyframes, at(0.5), at(0.99), at(1.0));
        row(name, &answers.poses, answers.lost, &more);
        first = first.or(Some(answers.poses));
    }
    let rectified: Vec<_> =
        sequence.pairs.iter().map(|[left, right]| rectification.rectify(left, right).unwrap()).collect();
    match opencv::odometry(rectification.rig(), &rectified) {
        Some(of) => {
            let more = format!("| {:.1} in the mean, without rectification", of.ms);
            row(&format!("OpenCV {}, ORB and PnP", of.version), &of.poses, of.lost, &more);
        }
        None => println!(
            "OpenCV: skipped, no Python has it (pip install opencv-python-headless; ELK_PYTHON names the Python)"
        ),
    }
    row("none: it stands still", &vec![Isometry3::identity(); truth.len()], 0, "|");
    first.unwrap()
}
