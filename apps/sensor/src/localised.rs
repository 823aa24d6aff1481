//! A robot that is told by an estimator alone where it is.

use std::collections::VecDeque;

use elk_bus::AppError;
use elk_geometry::Pose;
use elk_registration::ConfigError;
use elk_spatial::CameraInfo;
use elk_spatial::playback::PoseEstimate;
use nalgebra::{Isometry3, Point3};

use crate::frame::{BadFrame, Frame};
use crate::pose_estimator::{Located, MapMatching, MapMatchingSettings, PoseEstimator};
use crate::source::{Capture, DepthSource, Seen, Travel, Truth};

/// How far a robot goes, and turns, from one look to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LookSpacing {
    /// Way (m).
    pub way_m: f64,
    /// Turn (rad).
    pub turn_rad: f64,
}

impl LookSpacing {
    /// It looks at the end of its way only.
    pub const AT_THE_END: Self = Self { way_m: f64::INFINITY, turn_rad: f64::INFINITY };
}

/// Looks on one straight part of a way, however near together they are to be.
const MOST_LOOKS: f64 = 1000.0;

/// Of the places where it knew where it was, it can go back to so many: the last ones.
const MOST_BACK: usize = 256;

/// How often a step at whose end it is lost is halved.
const MOST_HALVINGS: u32 = 3;

/// How a robot that is not told where it is gets to know it.
pub struct Estimating {
    estimator: Box<dyn PoseEstimator>,
    spacing: LookSpacing,
}

impl Estimating {
    /// By an estimator that has seen nothing, from looks so far apart.
    pub fn new(estimator: impl PoseEstimator + 'static, spacing: LookSpacing) -> Self {
        Self { estimator: Box::new(estimator), spacing }
    }

    /// The same, whose estimates are made better by where scans lie on those before them.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn refined(self, settings: &MapMatchingSettings) -> Result<Self, ConfigError> {
        Ok(Self { estimator: Box::new(MapMatching::new(self.estimator, settings)?), ..self })
    }
}

/// A robot in a world that only its source knows, which goes by where an estimator takes it to be. From there to where it is sent it
/// moves exactly: it truly is off by as much as the estimator errs. On the way it looks again and again, so that the estimator can
/// follow. Where the estimator is lost the robot goes back, look by look, until it knows again, and tries steps of half the length, and of
/// half of that; where those do not help it stays.
pub struct Localised {
    source: Box<dyn DepthSource>,
    estimator: Box<dyn PoseEstimator>,
    spacing: LookSpacing,
    /// Where it truly is (world).
    truth: Pose,
    /// Where it is taken to be (world).
    believed: Pose,
    /// Where it truly was when it knew where it was (world), the last place last.
    been: VecDeque<Pose>,
    /// Looks so far.
    looks: u64,
    /// Why there are no scans any more: nobody knows where it is, or there are no images.
    lost: Option<String>,
}

/// What came of a way.
#[derive(Debug, Default)]
pub struct Arrival {
    /// Whether it touched anything, and why it stopped before its end, if something stood there.
    pub travel: Travel,
    /// What was estimated at its end.
    pub estimate: Option<PoseEstimate>,
    /// Looks at which the estimator was lost.
    pub lost: Vec<BadFrame>,
}

impl Localised {
    /// At its source's start, where it is known to be.
    pub fn new(source: Box<dyn DepthSource>, Estimating { estimator, spacing }: Estimating) -> Self {
        let start = source.start();
        let been = VecDeque::from([start]);
        Self { source, estimator, spacing, truth: start, believed: start, been, looks: 0, lost: None }
    }

    /// What its camera can see.
    pub fn camera(&self) -> CameraInfo {
        self.source.camera()
    }

    /// Where it is taken to be (world).
    pub fn pose(&self) -> Pose {
        self.believed
    }

    /// What is known of the true world.
    pub fn world(&self) -> Option<&dyn Truth> {
        self.source.truth()
    }

    /// What whoever looks at the scans should know.
    pub fn remarks(&self) -> Vec<String> {
        self.source.remarks()
    }

    /// Goes `way` (m, world), from where it is taken to be to where `end` is, in straight lines, and turns as evenly as it goes.
    pub fn go(&mut self, way: &[Point3<f64>], end: &Pose) -> Arrival {
        let mut arrival = Arrival::default();
        if let Err(error) = self.try_to_go(way, end, &mut arrival) {
            self.lost = Some(error.to_string());
        }
        arrival
    }

    fn try_to_go(&mut self, way: &[Point3<f64>], end: &Pose, arrival: &mut Arrival) -> Result<(), AppError> {
        if self.looks == 0 {
            self.look(arrival)?;
        }
        let mut ahead: Vec<(Pose, u32)> = self.poses(way, end).into_iter().rev().map(|pose| (pose, 0)).collect();
        while let Some((pose, halved)) = ahead.pop() {
            let mut there = self.truth.0 * self.believed.0.inverse() * pose.0;
            // Of products of products the length would leave 1 faster and faster.
            there.rotation.renormalize();
            let there = Pose(there);
            let leg = [self.truth.position(), there.position()];
            let travel = self.source.truth().map(|truth| truth.travel(&leg, &there)).unwrap_or_default();
            arrival.travel.contact |= travel.contact;
            arrival.travel.refused = travel.refused;
            if travel.refused.is_some() {
                break;
            }
            self.truth = there;
            if self.look(arrival)? {
                self.been.push_back(there);
                if self.been.len() > MOST_BACK {
                    self.been.pop_front();
                }
                continue;
            }
            let places = self.been.len();
            self.go_back(arrival)?;
            // From where it was last it tries smaller steps; a way from farther back was not looked at.
            if self.been.len() < places || halved == MOST_HALVINGS {
                break;
            }
            ahead.extend([(pose, halved + 1), (halfway(&self.believed, &pose), halved + 1)]);
        }
        Ok(())
    }

    /// The way that it came, until it knows where it is: at the last of the places where it has been.
    fn go_back(&mut self, arrival: &mut Arrival) -> Result<(), AppError> {
        while let Some(back) = self.been.pop_back() {
            self.truth = back;
            if self.look(arrival)? {
                self.been.push_back(back);
                return Ok(());
            }
        }
        Err(format!(
            "the robot has gone back the way that it came, up to {MOST_BACK} looks, and does not know where it is there, either: looks \
             that are nearer together (LookWay, LookTurn), or more texture, would be right"
        )
        .into())
    }

    /// Where it looks on its way, all corners and the end included: one place at least, as it may have to look again.
    fn poses(&self, way: &[Point3<f64>], end: &Pose) -> Vec<Pose> {
        let (from, to) = (self.believed.0.rotation, end.0.rotation);
        let length: f64 = way.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        let turn = from.angle_to(&to);
        let (mut poses, mut done) = (Vec::new(), 0.0);
        for leg in way.windows(2) {
            let step = leg[1] - leg[0];
            // Where there is no way there is a turn alone.
            let share = if length > 0.0 { step.norm() / length } else { 1.0 };
            if share == 0.0 {
                continue;
            }
            let looks = (step.norm() / self.spacing.way_m).max(turn * share / self.spacing.turn_rad);
            let looks = looks.ceil().clamp(1.0, MOST_LOOKS) as usize;
            poses.extend((1..=looks).map(|look| {
                let part = look as f64 / looks as f64;
                // Half a turn has no shorter side.
                let rotation = from.try_slerp(&to, (done + share * part).min(1.0), 1e-9).unwrap_or(to);
                Pose(Isometry3::from_parts((leg[0] + step * part).into(), rotation))
            }));
            done += share;
        }
        poses.pop();
        poses.push(*end);
        poses
    }

    /// Whether it knows where it is, having looked.
    fn look(&mut self, arrival: &mut Arrival) -> Result<bool, AppError> {
        self.looks += 1;
        let name = format!("look {}", self.looks);
        let frame = Frame {
            name: name.clone(),
            secs: 0.0,
            pose: Ok(self.truth),
            odometry: None,
            pair: self.source.pair(&self.capture())?,
            points: match self.estimator.goes_by_points() {
                true => self.source.scan(&self.capture())?.points.iter().collect(),
                false => Vec::new(),
            },
            no_return: Vec::new(),
        };
        let estimate = PoseEstimate {
            scan: 0,
            frame: name.clone(),
            secs: 0.0,
            pose: None,
            recorded: Some(self.truth),
            covariance: Vec::new(),
            overlap: 0.0,
            lost: String::new(),
        };
        match self.estimator.locate(&frame) {
            Located::At(pose, covariance, overlap) => {
                self.believed = pose;
                arrival.estimate = Some(PoseEstimate { pose: Some(pose), covariance, overlap, ..estimate });
                Ok(true)
            }
            Located::Lost(why) | Located::Apart(why) | Located::Bad(why) => {
                arrival.lost.push(BadFrame { frame: name, why: format!("lost, so that the robot goes back: {why}") });
                arrival.estimate = Some(PoseEstimate { lost: why, ..estimate });
                Ok(false)
            }
        }
    }

    /// What is asked of the source at the last look.
    fn capture(&self) -> Capture {
        Capture { scan: self.looks, time_secs: 0.0, pose: self.truth }
    }

    /// What is seen from where it is.
    ///
    /// # Errors
    /// Nobody knows where that is, or there is no scan.
    pub fn scan(&mut self) -> Result<Seen, AppError> {
        match &self.lost {
            Some(lost) => Err(lost.clone().into()),
            None => self.source.scan(&self.capture()),
        }
    }
}

/// In the middle between two poses.
fn halfway(one: &Pose, other: &Pose) -> Pose {
    Pose(one.0.try_lerp_slerp(&other.0, 0.5, 1e-9).unwrap_or(other.0))
}
