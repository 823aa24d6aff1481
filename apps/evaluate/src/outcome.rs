//! What came of a run, and how it is written down.

use std::str::FromStr;

use nalgebra::Point3;

use crate::agreement::Agreement;
use crate::tail::Tail;

/// Shares of what is truly visible of which it is said how long the way to them was.
pub const SHARES: [f64; 4] = [0.9, 0.95, 0.99, 0.999];

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The strategy says that all is explored that can be, and the robot touched nothing.
    Complete,
    /// The strategy gave up, or the robot touched the world.
    Incomplete,
    /// It took more than a run may take.
    Capped,
    /// It came to no end: an app failed, went silent, or there is no such mission.
    Failed,
}

impl End {
    /// All of them.
    const ALL: [Self; 4] = [Self::Complete, Self::Incomplete, Self::Capped, Self::Failed];

    /// In a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Incomplete => "incomplete",
            Self::Capped => "capped",
            Self::Failed => "failed",
        }
    }
}

/// What came of a run. All of it is the same in every evaluation of the same suite, but for [`Outcome::times`].
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// How it ended.
    pub end: End,
    /// Why, for people.
    pub reason: String,
    /// Length of the way (m).
    pub way_m: f64,
    /// Rotation of the camera, summed from pose to pose (degrees).
    pub rotation_deg: f64,
    /// Scans taken.
    pub scans: u64,
    /// Plans made.
    pub plans: u64,
    /// Time that the robot would be on its way (s); `None`: its controller has neither speed nor turn rate.
    pub travel_secs: Option<f64>,
    /// What it took to each of [`SHARES`]; `None`: it was not reached.
    pub marks: [Option<Mark>; 4],
    /// Length of the way to the last visible free voxel, and to the last visible surface voxel, that it came to know (m); `None`: it
    /// came to know none.
    pub last_m: [Option<f64>; 2],
    /// What it saw late could have been seen when; `None`: it did not come as far as [`tail::LATE`](crate::tail::LATE), saw nothing
    /// later, or nobody knows what its sensor sees.
    pub tail: Option<Tail>,
    /// Area above the curve of coverage over way (m): the way after which a visible voxel is known, on the mean.
    pub area_m: f64,
    /// Share of what is truly visible that is known at the end (0 to 1).
    pub coverage: f64,
    /// Of the surface voxels that can be seen, the share that the map calls occupied; `None`: there are none.
    pub recall: Option<f64>,
    /// Of the voxels that the map calls occupied, the share that a surface meets; `None`: there are none.
    pub precision: Option<f64>,
    /// How much of the map is as in that of the run without noise from the same start; `None`: there is no noise, or one of the
    /// two is not complete.
    pub agreement: Option<Agreement>,
    /// Motions on which the robot touched the world.
    pub contacts: u64,
    /// Voxels known, and a digest of the map.
    pub known: u64,
    /// Digest of the final map (FNV-1a).
    pub map: u64,
    /// What it took of the processor: not the same twice.
    pub times: Times,
}

/// What a run took of the processor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Times {
    /// The whole of it (s).
    pub cpu_secs: f64,
    /// Half of the plans took less (s).
    pub plan_p50_secs: f64,
    /// All but a hundredth of the plans took less (s).
    pub plan_p99_secs: f64,
}

/// What a run had taken by some point of it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mark {
    /// Length of the way (m).
    pub way_m: f64,
    /// Rotation of the camera, summed from pose to pose (degrees).
    pub rotation_deg: f64,
    /// Scans.
    pub scans: u64,
    /// Time on the way (s); `None`: its controller has neither speed nor turn rate.
    pub travel_secs: Option<f64>,
}

/// What was known after a scan, what it had taken, and where the camera was.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePoint {
    /// What the run had taken by then.
    pub mark: Mark,
    /// Share of the free voxels that are truly visible that is known (0 to 1).
    pub coverage: f64,
    /// Share of the surface voxels that can be seen that is known (0 to 1).
    pub surface: f64,
    /// The camera (m, world).
    pub position: Point3<f64>,
}

impl Outcome {
    /// Of a run that came to nothing.
    pub fn failed(reason: impl Into<String>) -> Self {
        Self {
            end: End::Failed,
            reason: reason.into(),
            way_m: 0.0,
            rotation_deg: 0.0,
            scans: 0,
            plans: 0,
            travel_secs: None,
            marks: [None; 4],
            last_m: [None; 2],
            tail: None,
            area_m: 0.0,
            coverage: 0.0,
            recall: None,
            precision: None,
            agreement: None,
            contacts: 0,
            known: 0,
            map: 0,
            times: Times::default(),
        }
    }

    /// Whether it counts where means are taken.
    pub fn is_complete(&self) -> bool {
        self.end == End::Complete
    }

    /// The names of [`Outcome::cells`].
    pub const HEADS: [&'static str; 37] = [
        "end",
        "way_m",
        "rotation_deg",
        "scans",
        "plans",
        "travel_s",
        "way_90_m",
        "rotation_90_deg",
        "scans_90",
        "travel_90_s",
        "way_95_m",
        "rotation_95_deg",
        "scans_95",
        "travel_95_s",
        "way_99_m",
        "rotation_99_deg",
        "scans_99",
        "travel_99_s",
        "way_999_m",
        "rotation_999_deg",
        "scans_999",
        "travel_999_s",
        "way_last_free_m",
        "way_last_surface_m",
        "late_voxels",
        "late_in_sight",
        "late_by_detour",
        "area_m",
        "coverage",
        "recall",
        "precision",
        "as_exact",
        "as_exact_of_known",
        "contacts",
        "known_voxels",
        "map",
        "reason",
    ];

    /// As cells of a table: numbers so that they come back as they are, what there is not empty. [`Outcome::times`] are not
    /// among them.
    pub fn cells(&self) -> Vec<String> {
        let number = |number: f64| number.to_string();
        let mut cells = vec![
            self.end.word().to_owned(),
            number(self.way_m),
            number(self.rotation_deg),
            self.scans.to_string(),
            self.plans.to_string(),
            perhaps(self.travel_secs),
        ];
        for mark in self.marks {
            cells.extend([perhaps(mark.map(|mark| mark.way_m)), perhaps(mark.map(|mark| mark.rotation_deg))]);
            cells.extend([perhaps(mark.map(|mark| mark.scans)), perhaps(mark.and_then(|mark| mark.travel_secs))]);
        }
        cells.extend(self.last_m.map(perhaps));
        cells.push(perhaps(self.tail.map(|tail| tail.voxels)));
        cells.extend([self.tail.map(|tail| tail.in_sight), self.tail.map(|tail| tail.by_detour)].map(perhaps));
        cells.extend([number(self.area_m), number(self.coverage), perhaps(self.recall), perhaps(self.precision)]);
        cells.extend([self.agreement.map(|one| one.of_world), self.agreement.map(|one| one.of_known)].map(perhaps));
        cells.extend([self.contacts.to_string(), self.known.to_string(), format!("{:016x}", self.map)]);
        cells.push(self.reason.clone());
        cells
    }

    /// What [`Outcome::cells`] were made of; `None`: they were made of none.
    pub fn from_cells(cells: &[String], times: Times) -> Option<Self> {
        if cells.len() != Self::HEADS.len() {
            return None;
        }
        let mut cells = Cells(cells.iter());
        let end = cells.text()?;
        Some(Self {
            end: End::ALL.into_iter().find(|one| one.word() == end)?,
            way_m: cells.number()?,
            rotation_deg: cells.number()?,
            scans: cells.number()?,
            plans: cells.number()?,
            travel_secs: cells.perhaps()?,
            marks: [cells.mark()?, cells.mark()?, cells.mark()?, cells.mark()?],
            last_m: [cells.perhaps()?, cells.perhaps()?],
            tail: cells.tail()?,
            area_m: cells.number()?,
            coverage: cells.number()?,
            recall: cells.perhaps()?,
            precision: cells.perhaps()?,
            agreement: cells.agreement()?,
            contacts: cells.number()?,
            known: cells.number()?,
            map: u64::from_str_radix(cells.text()?, 16).ok()?,
            reason: cells.text()?.to_owned(),
            times,
        })
    }
}

fn perhaps<T: ToString>(number: Option<T>) -> String {
    number.map_or(String::new(), |number| number.to_string())
}

/// Cells that are read one after the other.
struct Cells<'a>(std::slice::Iter<'a, String>);

impl<'a> Cells<'a> {
    fn text(&mut self) -> Option<&'a str> {
        self.0.next().map(String::as_str)
    }

    fn number<T: FromStr>(&mut self) -> Option<T> {
        self.text()?.parse().ok()
    }

    /// A number, or an empty cell where there is none.
    fn perhaps<T: FromStr>(&mut self) -> Option<Option<T>> {
        let text = self.text()?;
        if text.is_empty() { Some(None) } else { text.parse().ok().map(Some) }
    }

    fn mark(&mut self) -> Option<Option<Mark>> {
        let (way_m, rotation_deg) = (self.perhaps()?, self.perhaps()?);
        let (scans, travel_secs) = (self.perhaps()?, self.perhaps()?);
        let mark = |((way_m, rotation_deg), scans)| Mark { way_m, rotation_deg, scans, travel_secs };
        Some(way_m.zip(rotation_deg).zip(scans).map(mark))
    }

    fn tail(&mut self) -> Option<Option<Tail>> {
        let (voxels, in_sight, by_detour) = (self.perhaps()?, self.perhaps()?, self.perhaps()?);
        let tail = |((voxels, in_sight), by_detour)| Tail { voxels, in_sight, by_detour };
        Some(voxels.zip(in_sight).zip(by_detour).map(tail))
    }

    fn agreement(&mut self) -> Option<Option<Agreement>> {
        let (of_world, of_known) = (self.perhaps()?, self.perhaps()?);
        Some(of_world.zip(of_known).map(|(of_world, of_known)| Agreement { of_world, of_known }))
    }
}

impl Times {
    /// The names of [`Times::cells`].
    pub const HEADS: [&'static str; 3] = ["cpu_s", "plan_p50_s", "plan_p99_s"];

    /// As cells of a table.
    pub fn cells(&self) -> [String; 3] {
        [self.cpu_secs, self.plan_p50_secs, self.plan_p99_secs].map(|secs| format!("{secs:.6}"))
    }

    /// What such cells were made of, to a millionth of a second.
    pub fn from_cells(cells: &[String]) -> Option<Self> {
        let [cpu, p50, p99] = cells else { return None };
        let [cpu_secs, plan_p50_secs, plan_p99_secs] = [cpu.parse().ok()?, p50.parse().ok()?, p99.parse().ok()?];
        Some(Self { cpu_secs, plan_p50_secs, plan_p99_secs })
    }
}

/// What it took until the curve of coverage over way first comes to `share`.
pub fn mark_at(trace: &[TracePoint], share: f64) -> Option<Mark> {
    trace.iter().find(|point| point.coverage >= share).map(|point| point.mark)
}

/// Length of the way until a share that only grows was as large as it came to be (m); `None`: it never was more than 0.
pub fn last_gain(trace: &[TracePoint], share: impl Fn(&TracePoint) -> f64) -> Option<f64> {
    let most = trace.iter().map(&share).fold(0.0, f64::max);
    trace.iter().find(|point| most > 0.0 && share(point) >= most).map(|point| point.mark.way_m)
}

/// The area above the curve of coverage over way (m): what is found after a scan counts from there on.
pub fn area_above(trace: &[TracePoint]) -> f64 {
    trace.windows(2).map(|pair| (1.0 - pair[0].coverage) * (pair[1].mark.way_m - pair[0].mark.way_m)).sum()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A complete run over such a way.
    pub(crate) fn complete(way_m: f64) -> Outcome {
        Outcome { end: End::Complete, way_m, coverage: 1.0, scans: 3, ..Outcome::failed("explored") }
    }

    #[test]
    fn an_outcome_comes_back_from_its_cells_bit_for_bit() {
        let outcome = Outcome {
            end: End::Capped,
            reason: "more than 5 scans, \"again\"".into(),
            way_m: 0.1 + 0.2,
            travel_secs: Some(1.0 / 3.0),
            marks: [Some(mark(1.5)), Some(Mark { travel_secs: Some(0.1), scans: 7, ..mark(2.0) }), None, None],
            last_m: [Some(0.3), None],
            tail: Some(Tail { voxels: 12, in_sight: 0.1 + 0.2, by_detour: 1.0 }),
            recall: Some(0.99),
            agreement: Some(Agreement { of_world: 0.1 + 0.2, of_known: 1.0 / 3.0 }),
            map: u64::MAX,
            ..complete(1.0)
        };
        assert_eq!(outcome.cells().len(), Outcome::HEADS.len());
        assert_eq!(Outcome::from_cells(&outcome.cells(), outcome.times), Some(outcome.clone()));
        assert_eq!(Outcome::from_cells(&outcome.cells()[1..], outcome.times), None);
        let mut torn = outcome.cells();
        torn[1] = "1.2.3".into();
        assert_eq!(Outcome::from_cells(&torn, outcome.times), None);
    }

    fn mark(way_m: f64) -> Mark {
        Mark { way_m, rotation_deg: 10.0 * way_m, ..Mark::default() }
    }

    #[test]
    fn marks_and_area_are_those_of_the_curve() {
        let point = |way_m: f64, coverage: f64, surface: f64| {
            let mark = Mark { scans: way_m as u64, ..mark(way_m) };
            TracePoint { mark, coverage, surface, position: Point3::origin() }
        };
        let trace = [point(0.0, 0.5, 0.0), point(2.0, 0.9, 0.7), point(3.0, 0.95, 0.7), point(7.0, 1.0, 0.7)];
        assert_eq!(
            [0.4, 0.9, 0.91, 1.0].map(|share| mark_at(&trace, share).map(|mark| mark.way_m)),
            [0, 2, 3, 7].map(|m| Some(f64::from(m)))
        );
        assert_eq!(mark_at(&trace, 0.9), Some(Mark { rotation_deg: 20.0, scans: 2, ..mark(2.0) }));
        assert_eq!(mark_at(&trace[..3], 0.99), None);
        let [free, surface]: [fn(&TracePoint) -> f64; 2] = [|point| point.coverage, |point| point.surface];
        assert_eq!([last_gain(&trace, free), last_gain(&trace, surface)], [Some(7.0), Some(2.0)]);
        assert_eq!(last_gain(&trace[..1], surface), None);
        // 0.5 × 2 + 0.1 × 1 + 0.05 × 4
        assert!((area_above(&trace) - 1.3).abs() < 1e-12);
        assert_eq!(area_above(&[]), 0.0);
    }
}
