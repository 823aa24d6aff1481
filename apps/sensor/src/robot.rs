//! A robot with a depth source: it goes where it is sent and scans there, and counts. No bus in sight.

use elk_bus::{AppError, Describe};
use elk_geometry::Pose;
use elk_spatial::Scan;
use elk_spatial::messages::{CameraPose, PoseCommand};
use elk_spatial::playback::{Playback, PoseEstimate};
use nalgebra::Point3;

use crate::localised::{Arrival, Localised};
use crate::recording::{Advance, Player};
use crate::source::{Capture, DepthSource, Obstruction, Seen, Travel, Truth};

/// There is no scan.
#[derive(Debug, thiserror::Error)]
#[error("scan {scan} from ({:.2}; {:.2}; {:.2}) m: {source}", .place.x, .place.y, .place.z)]
pub struct ScanError {
    /// Its number.
    pub scan: u64,
    /// Where it was to be taken (m, world).
    pub place: Point3<f64>,
    /// Why, as the source says it.
    pub source: AppError,
}

/// What moves it.
enum Carrier {
    /// Pose commands.
    Commanded(Box<dyn DepthSource>),
    /// Pose commands, as far as it can tell where it is.
    Estimated(Box<Localised>),
    /// Whoever carried the sensor when it was recorded.
    Recorded(Box<Player>),
}

/// The robot.
pub struct Robot {
    carrier: Carrier,
    pose: Pose,
    command: u64,
    scans: u64,
    contacts: u64,
}

impl Robot {
    /// A robot at its source's start.
    ///
    /// # Errors
    /// It cannot be there, as far as the source knows the true world.
    pub fn new(source: Box<dyn DepthSource>) -> Result<Self, Obstruction> {
        let pose = source.start();
        let robot = Self { pose, carrier: Carrier::Commanded(source), command: 0, scans: 0, contacts: 0 };
        robot.free(&robot.pose)?;
        Ok(robot)
    }

    /// A robot at its source's start that goes by an estimate.
    ///
    /// # Errors
    /// It cannot be there, as far as the source knows the true world.
    pub fn localised(localised: Localised) -> Result<Self, Obstruction> {
        let (pose, carrier) = (localised.pose(), Carrier::Estimated(Box::new(localised)));
        let robot = Self { pose, carrier, command: 0, scans: 0, contacts: 0 };
        robot.free(&robot.pose)?;
        Ok(robot)
    }

    /// A robot that goes where a recording goes: each command takes the next scan.
    pub fn carried(player: Player) -> Self {
        Self { pose: player.pose(), carrier: Carrier::Recorded(Box::new(player)), command: 0, scans: 0, contacts: 0 }
    }

    /// Its pose (world).
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// The last command carried out or refused; 0: none yet.
    pub fn command(&self) -> u64 {
        self.command
    }

    /// Scans taken, the one that is still to be taken included.
    pub fn scans(&self) -> u64 {
        self.scans
    }

    /// Motions on which the body touched the world; `None`: nobody can tell.
    pub fn contacts(&self) -> Option<u64> {
        self.truth().map(|_| self.contacts)
    }

    /// The true world, if it is known.
    pub fn truth(&self) -> Option<&dyn Truth> {
        match &self.carrier {
            Carrier::Commanded(source) => source.truth(),
            Carrier::Estimated(localised) => localised.world(),
            Carrier::Recorded(_) => None,
        }
    }

    /// How far a recording is; none: it is none.
    pub fn playback(&self) -> Option<Playback> {
        match &self.carrier {
            Carrier::Commanded(_) | Carrier::Estimated(_) => None,
            Carrier::Recorded(player) => Some(player.playback(self.command)),
        }
    }

    /// What whoever looks at the scans should know.
    pub fn remarks(&self) -> Vec<String> {
        match &self.carrier {
            Carrier::Commanded(source) => source.remarks(),
            Carrier::Estimated(localised) => localised.remarks(),
            Carrier::Recorded(player) => player.remarks(),
        }
    }

    /// Whether it can go on where another one stopped. Where one was truly that went by an estimate, nobody can tell.
    pub fn can_succeed(&self) -> bool {
        !matches!(self.carrier, Carrier::Estimated(_))
    }

    /// Goes on where another robot stopped, if it [can](Self::can_succeed): at `at`, after so many scans and contacts.
    ///
    /// # Errors
    /// It cannot be there: the world is another one.
    pub fn succeed(&mut self, at: &CameraPose, scans: u64, contacts: u64) -> Result<(), Obstruction> {
        self.free(&at.pose)?;
        (self.pose, self.command, self.scans, self.contacts) = (at.pose, at.command, scans, contacts);
        if let Carrier::Recorded(player) = &mut self.carrier {
            // What a recording was at that scan it knows itself.
            player.seek(scans);
            (self.pose, self.scans) = (player.pose(), player.scans());
        }
        Ok(())
    }

    /// Goes to the commanded pose, by way of the positions before it, or stays where it is, if that cannot be done. A scan is
    /// due then, in either case. Or goes where the recording was next, if it is not over: then a scan is due, and there is
    /// something to be said. The command is one that passes its check ([`elk_bus::Describe::check`]): all of it finite.
    pub fn go(&mut self, command: &PoseCommand) -> (Travel, Advance) {
        self.command = command.id;
        if let Carrier::Recorded(player) = &mut self.carrier {
            let advance = player.advance();
            (self.pose, self.scans) = (player.pose(), player.scans());
            return (Travel::default(), advance);
        }
        let ends = [self.pose.position(), command.pose.position()];
        let way: Vec<Point3<f64>> =
            std::iter::once(ends[0]).chain(command.via.iter().copied()).chain(std::iter::once(ends[1])).collect();
        self.scans += 1;
        let (travel, advance) = match &mut self.carrier {
            Carrier::Estimated(localised) => {
                let Arrival { travel, estimate, lost } = localised.go(&way, &command.pose);
                self.pose = localised.pose();
                let estimate = estimate.map(|estimate| PoseEstimate { scan: self.scans, ..estimate });
                (travel, Advance { estimates: estimate.into_iter().collect(), passed_over: lost })
            }
            _ => {
                let travel = self.truth().map(|truth| truth.travel(&way, &command.pose)).unwrap_or_default();
                if travel.refused.is_none() {
                    self.pose = command.pose;
                }
                (travel, Advance::default())
            }
        };
        self.contacts += u64::from(travel.contact);
        (travel, advance)
    }

    /// Takes the scan that is due, or the last one again.
    ///
    /// # Errors
    /// There is none, or one that no reader would believe.
    pub fn scan(&mut self, time_secs: f64) -> Result<Scan<'static>, ScanError> {
        let capture = Capture { scan: self.scans, time_secs, pose: self.pose };
        self.capture(&capture).map_err(|source| ScanError { scan: self.scans, place: self.pose.position(), source })
    }

    fn capture(&mut self, capture: &Capture) -> Result<Scan<'static>, AppError> {
        let (camera, Seen { points, no_return, pixel_runs }) = match &mut self.carrier {
            Carrier::Commanded(source) => (source.camera(), source.scan(capture)?),
            Carrier::Estimated(localised) => (localised.camera(), localised.scan()?),
            Carrier::Recorded(player) => (player.camera(), player.seen().cloned().unwrap_or_default()),
        };
        let scan = Scan::new(capture.scan, self.command, capture.pose, points);
        let scan = Scan { camera, no_return, pixel_runs, ..scan };
        scan.check()?;
        Ok(scan)
    }

    fn free(&self, pose: &Pose) -> Result<(), Obstruction> {
        self.truth().map_or(Ok(()), |truth| truth.free(pose))
    }
}

#[cfg(test)]
mod tests {
    use elk_spatial::CameraInfo;

    use super::*;

    /// A camera that sees a point 2 m ahead, but for every third scan.
    struct Flaky;

    impl DepthSource for Flaky {
        fn camera(&self) -> CameraInfo {
            CameraInfo { columns: 1, rows: 1, ..CameraInfo::default() }
        }

        fn scan(&mut self, capture: &Capture) -> Result<Seen, AppError> {
            match capture.scan % 3 {
                0 => Err("the cable is loose; push it in".into()),
                _ => Ok(Seen { points: [Point3::new(0.0, 0.0, 2.0)].into_iter().collect(), ..Seen::default() }),
            }
        }
    }

    #[test]
    fn a_real_camera_is_where_it_was_sent_and_counts_no_contacts() {
        let mut robot = Robot::new(Box::new(Flaky)).unwrap();
        let pose = |x| Pose::from_yaw_pitch(Point3::new(x, 0.0, 1.0), 0.0, 0.0);
        for id in 1..=2 {
            assert_eq!(robot.go(&PoseCommand { id, via: vec![], pose: pose(id as f64) }).0, Travel::default());
            let scan = robot.scan(0.0).unwrap();
            assert_eq!((scan.id, scan.command, scan.pose, scan.camera.columns), (id, id, pose(id as f64), 1));
        }
        assert_eq!((robot.contacts(), robot.scans()), (None, 2));
        robot.go(&PoseCommand { id: 3, via: vec![], pose: pose(3.0) });
        let failed = robot.scan(0.0).unwrap_err().to_string();
        assert_eq!(failed, "scan 3 from (3.00; 0.00; 1.00) m: the cable is loose; push it in");
        assert_eq!((robot.command(), robot.pose()), (3, pose(3.0)), "it went there all the same");
    }
}
