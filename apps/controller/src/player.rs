//! Plays a recording: command by command, each when the scan before it is in the map and its time has come.
//!
//! The sensor says with each command how far it is ([`Playback`]), and what counts is what it says: a player that is exchanged
//! goes on from there.

use elk_spatial::Replica;
use elk_spatial::checks::{MAX_BRICKS, MAX_REVISIONS_AHEAD};
use elk_spatial::keyframe::MapPart;
use elk_spatial::map::{MapUpdate, UpdateError};
use elk_spatial::messages::{Awaited, MotionMemory, PoseCommand, Progress};
use elk_spatial::playback::Playback;
use elk_spatial::record::Record;

use crate::allowance::Allowance;
use crate::follower::Action;

/// The longest that a frame waits after the one before it (s, recorded): a longer break is played as one of so long. A clock that was
/// ahead for one frame would hold the recording up for as much otherwise.
pub(crate) const LONGEST_GAP_SECS: f64 = 60.0;

/// The state machine. Give it what arrives, and take what it wants said from [`Player::next`].
#[derive(Debug)]
pub struct Player {
    /// The map, as a reader has it.
    replica: Replica,
    /// How many times as fast as it was recorded; 0: as fast as the map keeps up.
    rate: f64,
    playback: Option<Playback>,
    record: Record,
    /// The last command that was made.
    commands: u64,
    /// Of this player: what a predecessor made was perhaps not said.
    own: bool,
    /// When the last command was said (s, the community's clock), and the recorded time that it begins with (s).
    said: Option<(f64, f64)>,
    /// The command whose long gap was told of.
    told: u64,
    is_over: bool,
}

impl Player {
    /// A player that has heard nothing, of a recording that goes `rate` times as fast as it was recorded; 0: as fast as the map
    /// keeps up.
    pub fn new(rate: f64) -> Self {
        let replica = Replica::new(None, MAX_BRICKS);
        let record = Record::default();
        Self { replica, rate, playback: None, record, commands: 0, own: true, said: None, told: 0, is_over: false }
    }

    /// Whether it has to look at the clock.
    pub fn is_timed(&self) -> bool {
        self.rate > 0.0
    }

    /// Takes the place of one that left this memory.
    pub fn succeed(&mut self, memory: &MotionMemory) {
        (self.commands, self.own) = (memory.commands, false);
        self.record = Record::from(memory.samples.clone());
    }

    /// What a successor has to know, of what a person allowed as well; none before there was anything.
    pub fn memory(&self, allowance: &Allowance) -> Option<MotionMemory> {
        let playback = self.playback.as_ref()?;
        let Allowance { allowed, steps, last_step, .. } = *allowance;
        let awaited = match self.is_over {
            true => Awaited::Over(self.progress(playback, true)),
            false => Awaited::Map(command(self.commands, playback)),
        };
        Some(MotionMemory {
            pose: playback.pose,
            awaited,
            commands: self.commands,
            allowed,
            steps,
            last_step,
            requests: 0,
            path_length_m: playback.path_length_m,
            leg: None,
            drive: None,
            samples: self.record.samples().to_vec(),
        })
    }

    /// The sensor says how far it is. It has the last word on how many commands there were, but for the one that is under way.
    pub fn on_playback(&mut self, playback: Playback) {
        if !(self.own && self.commands == playback.command + 1) {
            self.commands = playback.command;
        }
        self.own = true;
        self.playback = Some(playback);
    }

    /// The map, as a reader has it.
    pub fn replica(&mut self) -> &mut Replica {
        &mut self.replica
    }

    /// The map has changed, or it is here whole.
    ///
    /// # Errors
    /// It does not fit what is known of the map.
    pub fn on_map(&mut self, update: &MapUpdate) -> Result<(), UpdateError> {
        self.look_how_far(update.revision)?;
        self.replica.take(update).map(drop)
    }

    /// A part of the whole map is here.
    ///
    /// # Errors
    /// It does not fit what is known of the map.
    pub fn on_map_part(&mut self, part: &MapPart) -> Result<(), UpdateError> {
        self.look_how_far(part.revision)?;
        self.replica.take_part(part).map(drop)
    }

    /// Whether a map of this revision can come of the commands so far.
    fn look_how_far(&self, update: u64) -> Result<(), UpdateError> {
        let have = self.commands;
        if update > have + MAX_REVISIONS_AHEAD { Err(UpdateError::Ahead { have, update }) } else { Ok(()) }
    }

    /// What is to be said now, at `now` (s, the community's clock): nothing, as long as the last scan is not in the map, or the
    /// next one's time has not come.
    pub fn next(&mut self, now: f64, allowance: &mut Allowance) -> Vec<Action> {
        let Some(playback) = self.playback.clone().filter(|playback| self.is_in_map(playback)) else { return vec![] };
        let mut actions = Vec::new();
        if playback.scans > self.record.scans() {
            self.record.add(self.replica.grid().free() as u64, playback.path_length_m);
            actions.push(Action::Progress(self.progress(&playback, false)));
        }
        match playback.next_secs {
            None => {
                self.is_over = true;
                actions.push(Action::Progress(self.progress(&playback, true)));
                actions.push(Action::Finished(self.record.report()));
            }
            Some(secs) if self.is_time(now, secs) && allowance.allows(self.commands + 1) => {
                self.commands += 1;
                self.said = Some((now, secs));
                actions.push(Action::Command(command(self.commands, &playback)));
            }
            Some(_) => {}
        }
        actions
    }

    /// How long (s, recorded) it would be to the next frame, where that is longer than it is waited; each is told of once.
    pub fn take_long_gap(&mut self) -> Option<f64> {
        let playback =
            self.playback.as_ref().filter(|playback| self.is_timed() && playback.command == self.commands)?;
        let gap = playback.next_secs? - self.said?.1;
        let next = self.commands + 1;
        (gap > LONGEST_GAP_SECS && std::mem::replace(&mut self.told, next) != next).then_some(gap)
    }

    /// Whether the last command is carried out, and the scan that came of it in the map.
    fn is_in_map(&self, playback: &Playback) -> bool {
        !self.is_over && playback.command == self.commands && self.replica.scan() >= playback.scans
    }

    /// Whether a frame's recorded time has come, after the one before it, or the longest gap has gone by. A pause shifts all that
    /// follows.
    fn is_time(&self, now: f64, secs: f64) -> bool {
        let gap = |before: f64| (secs - before).min(LONGEST_GAP_SECS);
        self.said.is_none_or(|(then, before)| !self.is_timed() || (now - then) * self.rate >= gap(before))
    }

    fn progress(&self, playback: &Playback, finished: bool) -> Progress {
        Progress {
            scan: playback.scans,
            revision: self.replica.grid().revision(),
            scans: playback.scans,
            path_length_m: playback.path_length_m,
            free: self.replica.grid().free() as u64,
            finished,
        }
    }
}

fn command(id: u64, playback: &Playback) -> PoseCommand {
    PoseCommand { id, via: vec![], pose: playback.pose }
}

#[cfg(test)]
mod tests {
    use elk_geometry::{OccupancyGrid, Pose};
    use nalgebra::Isometry3;

    use super::*;

    fn playback(command: u64, scans: u64, next_secs: Option<f64>) -> Playback {
        let pose = Pose(Isometry3::translation(scans as f64, 0.0, 0.0));
        let path_length_m = scans as f64;
        let cut = String::new();
        Playback { command, frames: command, scans, bad: 0, lost: 0, path_length_m, pose, next_secs, off_m: None, cut }
    }

    /// A player, what it is allowed, and a map that takes a scan when it is told.
    struct Bench(Player, Allowance, OccupancyGrid);

    impl Bench {
        fn new(rate: f64) -> Self {
            Self(Player::new(rate), Allowance::default(), OccupancyGrid::new(0.1))
        }

        fn scanned(&mut self, scan: u64) {
            self.0.on_map(&MapUpdate::new(self.2.advance(&[]), scan)).unwrap();
        }

        /// The commands that it says, and, as 0, that it is over.
        fn said(&mut self, now: f64) -> Vec<u64> {
            let said = |action| match action {
                Action::Command(command) => Some(command.id),
                Action::Finished(_) => Some(0),
                _ => None,
            };
            self.0.next(now, &mut self.1).into_iter().filter_map(said).collect()
        }
    }

    #[test]
    fn a_command_waits_for_the_scan_before_it_and_the_end_for_the_last_one() {
        let mut bench = Bench::new(0.0);
        assert!(bench.said(0.0).is_empty(), "nobody knows of a recording");
        bench.0.on_playback(playback(0, 0, Some(0.0)));
        assert_eq!(bench.said(0.0), [1]);
        assert!(bench.said(0.0).is_empty(), "it is under way");
        bench.0.on_playback(playback(1, 1, Some(0.1)));
        assert!(bench.said(0.0).is_empty(), "the scan is not in the map");
        bench.scanned(1);
        assert_eq!(bench.said(0.0), [2]);
        // Of the last frames no scan came.
        bench.0.on_playback(playback(2, 1, None));
        assert_eq!(bench.said(0.0), [0]);
        assert!(bench.said(9.0).is_empty(), "once");
    }

    #[test]
    fn frames_come_at_their_time_and_a_pause_shifts_them() {
        let mut bench = Bench::new(2.0);
        bench.0.on_playback(playback(0, 0, Some(0.0)));
        assert_eq!(bench.said(5.0), [1]);
        bench.0.on_playback(playback(1, 1, Some(1.0)));
        bench.scanned(1);
        assert!(bench.said(5.4).is_empty());
        bench.1.paused = true;
        assert!(bench.said(8.0).is_empty());
        bench.1.run();
        assert_eq!(bench.said(9.0), [2]);
        bench.0.on_playback(playback(2, 2, Some(2.0)));
        bench.scanned(2);
        assert!(bench.said(9.4).is_empty());
        assert_eq!(bench.said(9.5), [3]);
    }

    /// Regression: a frame whose clock was a year ahead held the recording up for a year.
    #[test]
    fn a_frame_from_far_ahead_is_waited_for_no_longer_than_a_break() {
        let mut bench = Bench::new(2.0);
        bench.0.on_playback(playback(0, 0, Some(0.0)));
        assert_eq!(bench.said(5.0), [1]);
        bench.0.on_playback(playback(1, 1, Some(60.0)));
        assert_eq!(bench.0.take_long_gap(), None);
        bench.0.on_playback(playback(1, 1, Some(3e7)));
        bench.scanned(1);
        assert!(bench.said(34.9).is_empty());
        assert_eq!((bench.0.take_long_gap(), bench.0.take_long_gap()), (Some(3e7), None), "it is told once");
        assert_eq!(bench.said(35.0), [2]);
        // Times go on from before it.
        bench.0.on_playback(playback(2, 2, Some(2.0)));
        bench.scanned(2);
        assert_eq!((bench.0.take_long_gap(), bench.said(35.0)), (None, vec![3]));
        let mut bench = Bench::new(0.0);
        bench.0.on_playback(playback(0, 0, Some(0.0)));
        assert_eq!(bench.said(5.0), [1]);
        bench.0.on_playback(playback(1, 1, Some(3e7)));
        assert_eq!(bench.0.take_long_gap(), None, "nothing waits for times");
    }

    #[test]
    fn a_successor_goes_on_from_where_the_sensor_is() {
        let mut bench = Bench::new(0.0);
        bench.0.on_playback(playback(0, 0, Some(0.0)));
        assert_eq!(bench.said(0.0), [1]);
        bench.0.on_playback(playback(1, 1, Some(0.1)));
        bench.scanned(1);
        assert_eq!(bench.said(0.0), [2]);
        let memory = bench.0.memory(&bench.1).unwrap();
        for (carried_out, wanted) in [(1, vec![2]), (2, vec![3])] {
            let mut next = Bench::new(0.0);
            next.0.succeed(&memory);
            next.0.on_playback(playback(carried_out, carried_out, Some(0.3)));
            next.scanned(carried_out);
            assert_eq!(next.said(0.0), wanted, "perhaps it was not said, and the sensor carries it out once");
            assert_eq!(next.0.record.scans(), carried_out, "what was recorded is remembered");
        }
    }
}
