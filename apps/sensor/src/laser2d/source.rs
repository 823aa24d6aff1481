//! The log: one scan after the other.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use elk_geometry::Pose;
use elk_outside::file;
use elk_registration::carmen::{CarmenError, LaserScan, Reader};
use elk_spatial::CameraInfo;
use flate2::read::MultiGzDecoder;
use nalgebra::Point3;

use crate::frame::{BadFrame, Frame};
use crate::pose_estimator::in_space;
use crate::recording::Recording;

/// So many lines that cannot be used, and no scan before them, are no log.
const HOPELESS: usize = 1000;
/// What a gzip file begins with (RFC 1952).
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// What is known of a recorded laser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// A beam that reads as much (m) or more has no return.
    pub range: f32,
    /// Its field of view (rad), of a log that does not say it: its middle is ahead.
    pub field_of_view: f64,
    /// Where the laser's plane is (m, world z).
    pub height: f64,
    /// Frames a second, where no times are recorded.
    pub frame_rate: f64,
}

/// Why a file is no log.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// It cannot be read.
    #[error(
        "there is no log {} ({why}): where the recorded data lie elsewhere, ELK_DATA or Sensor.Recording has to name it; right is a \
         CARMEN log, .gz or not", .log.display()
    )]
    Missing {
        /// The log.
        log: PathBuf,
        /// What the operating system says.
        why: std::io::Error,
    },
    /// There is no scan in it.
    #[error(
        "{}: there is no scan in it{first}; right is a CARMEN log with FLASER or ROBOTLASER1 lines, .gz or not", .log.display()
    )]
    Empty {
        /// The log.
        log: PathBuf,
        /// What is wrong with its first line that could be one.
        first: String,
    },
}

/// A recorded laser.
pub struct Laser2d {
    settings: Settings,
    reader: Reader<Box<dyn BufRead + Send>>,
    /// What was read already: up to the next scan.
    ahead: VecDeque<Result<LaserScan, CarmenError>>,
    /// The log's name, for people.
    name: String,
    camera: CameraInfo,
    start: Pose,
    /// The time of the first scan (s), if it has one.
    first: Option<f64>,
    /// Frames taken.
    taken: u64,
}

impl Laser2d {
    /// A log.
    ///
    /// # Errors
    /// There is none, or no scan in it.
    pub fn open(log: &Path, settings: Settings) -> Result<Self, LogError> {
        let missing = |why| LogError::Missing { log: log.to_owned(), why };
        let name = log.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut reader = Reader::new(&name, text(log).map_err(missing)?).with_field_of_view(settings.field_of_view);
        let mut ahead: VecDeque<_> = VecDeque::new();
        let first = loop {
            match reader.next() {
                Some(Ok(scan)) => break scan,
                Some(Err(error)) if ahead.len() < HOPELESS => ahead.push_back(Err(error)),
                _ => {
                    let first = ahead.pop_front().and_then(Result::<LaserScan, _>::err);
                    let first = first.map(|error| format!(" ({error})")).unwrap_or_default();
                    return Err(LogError::Empty { log: log.to_owned(), first });
                }
            }
        };
        let range_m = f64::from(first.range_max.map_or(settings.range, |range_max| range_max.min(settings.range)));
        let (columns, fov_x) = (first.ranges.len() as u32, first.fan.field_of_view);
        let camera = CameraInfo { columns, rows: 1, fov_x, fov_y: 0.0, range_m, inverse_depth_sigma: 0.0 };
        let (start, time) = (in_space(&first.pose, settings.height), first.time);
        ahead.push_back(Ok(first));
        Ok(Self { settings, reader, ahead, name, camera, start, first: time, taken: 0 })
    }

    fn frame(&self, scan: &LaserScan) -> Frame {
        let (mut points, mut no_return) = (Vec::new(), Vec::new());
        // A beam without return says nothing of what is farther than the laser sees.
        let seen = scan.range_max.map_or(self.settings.range, |range_max| range_max.min(self.settings.range));
        let is_as_far = f64::from(seen) >= self.camera.range_m;
        for (beam, &range) in scan.ranges.iter().enumerate().filter(|(_, range)| **range > 0.0) {
            let (sin, cos) = scan.bearing(beam).sin_cos();
            // The camera's z is ahead, its x to the right.
            let direction = Point3::new(-sin as f32, 0.0, cos as f32);
            match range < seen {
                true => points.push(direction * range),
                false if is_as_far => no_return.push(direction),
                false => {}
            }
        }
        Frame {
            name: format!("{}:{}", self.name, scan.line),
            secs: self.secs(scan),
            pose: Ok(in_space(&scan.pose, self.settings.height)),
            odometry: Some(scan.odometry),
            pair: None,
            points,
            no_return,
        }
    }

    fn secs(&self, scan: &LaserScan) -> f64 {
        match scan.time.zip(self.first) {
            Some((time, first)) => (time - first).max(0.0),
            None => self.taken as f64 / self.settings.frame_rate,
        }
    }
}

/// The text of a log, as it is or as gzip has compressed it.
fn text(log: &Path) -> std::io::Result<Box<dyn BufRead + Send>> {
    let mut file = BufReader::new(file::open(log)?);
    match file.fill_buf()?.starts_with(&GZIP) {
        true => Ok(Box::new(BufReader::new(MultiGzDecoder::new(file)))),
        false => Ok(Box::new(file)),
    }
}

impl Recording for Laser2d {
    fn camera(&self) -> CameraInfo {
        self.camera
    }

    fn next_secs(&self) -> Option<f64> {
        let mut scans = self.ahead.iter().flatten();
        match scans.next() {
            Some(scan) => Some(self.secs(scan)),
            // The last lines cannot be used.
            None => (!self.ahead.is_empty()).then_some(0.0),
        }
    }

    fn next(&mut self) -> Option<Result<Frame, BadFrame>> {
        let next = self.ahead.pop_front()?;
        if self.ahead.is_empty() {
            self.ahead.extend(self.reader.next());
        }
        let frame = next.map(|scan| self.frame(&scan));
        self.taken += 1;
        Some(
            frame.map_err(|error| BadFrame {
                frame: format!("{}:{}", error.log, error.line),
                why: error.fault.to_string(),
            }),
        )
    }

    fn start(&self) -> Pose {
        self.start
    }
}
