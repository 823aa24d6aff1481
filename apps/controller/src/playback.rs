//! The player as an app: how far the recording is and map updates in; commands and progress out.

use std::time::Duration;

use elk_bus::{AppError, Comms, Handled, Handlers, Mail, Rejection, number, tell, text};
use elk_mission::{AppType, Kind, ParamSpec, Params};
use elk_spatial::keyframe::MapPart;
use elk_spatial::keys::{MAP, MAP_PART, MAP_RECALL, MAP_REQUEST, MAP_UPDATE, MOTION, MOTION_MEMORY, PLAYBACK, STEP};
use elk_spatial::map::{MapUpdate, UpdateError};
use elk_spatial::messages::MotionMemory;
use elk_spatial::playback::Playback;

use crate::allowance::Allowance;
use crate::app::{MANUAL, param, publish};
use crate::player::{LONGEST_GAP_SECS, Player};

/// Its row in the table of controllers.
pub(crate) const TYPE: AppType = AppType {
    element: "Controller",
    name: "Playback",
    summary: "Plays the recording of the mission's sensor, frame by frame, to its end; needs no Explorer.",
    params: PARAMS,
    build: |params| Ok(Box::new(PlaybackApp::new(params).on_the_bus())),
    preflight: None,
};

/// How often it is seen whether a frame's time has come.
const LOOK_EVERY: Duration = Duration::from_millis(5);

const PARAMS: &[ParamSpec] = &[
    param(
        "Rate",
        Kind::Number { unit: "", min: 0.0, max: 1000.0 },
        "0",
        "How many times as fast as it was recorded, a break of more than 60 s as one of 60 s; 0: as fast as the map keeps up.",
    ),
    MANUAL,
];

/// A [`Player`] on the bus.
struct PlaybackApp {
    player: Player,
    allowance: Allowance,
    /// The memory as it was last published.
    remembered: Option<MotionMemory>,
}

impl PlaybackApp {
    fn new(params: &Params) -> Self {
        let allowance = Allowance { paused: params.flag("Manual"), ..Allowance::default() };
        Self { player: Player::new(params.number("Rate")), allowance, remembered: None }
    }

    fn on_the_bus(self) -> Handled<Self> {
        let table = Handlers::<Self>::new()
            .recall(&MOTION_MEMORY, Self::succeed)
            .on(text(MOTION), |app, _, word: &str| app.allowance.obey(word))
            .on_with(number(STEP), Self::on_step)
            .on(&PLAYBACK, Self::on_playback)
            .on(&MAP, Self::on_map)
            .on(&MAP_UPDATE, Self::on_map)
            .on(&MAP_PART, Self::on_map_part)
            .on(number(MAP_RECALL), |app, comms, revision| app.player.replica().answer(comms, revision))
            .caught_up(Self::say)
            .after_each(Self::say);
        let table = if self.player.is_timed() { table.iterate(LOOK_EVERY, Self::say) } else { table };
        table.with(self)
    }

    fn succeed(&mut self, _: &mut Comms, memory: MotionMemory) -> Result<(), AppError> {
        self.allowance = self.allowance.successor(&memory);
        self.player.succeed(&memory);
        self.remembered = Some(memory);
        Ok(())
    }

    fn on_step(&mut self, _: &mut Comms, _: f64, mail: &Mail<'_>) -> Result<(), AppError> {
        self.allowance.step(mail);
        Ok(())
    }

    fn on_playback(&mut self, _: &mut Comms, playback: Playback) -> Result<(), AppError> {
        self.player.on_playback(playback);
        Ok(())
    }

    fn on_map(&mut self, comms: &mut Comms, update: MapUpdate) -> Result<(), AppError> {
        let taken = self.player.on_map(&update);
        self.ask_where_unfit(comms, taken)
    }

    fn on_map_part(&mut self, comms: &mut Comms, part: MapPart) -> Result<(), AppError> {
        let taken = self.player.on_map_part(&part);
        self.ask_where_unfit(comms, taken)
    }

    fn ask_where_unfit(&mut self, comms: &mut Comms, taken: Result<(), UpdateError>) -> Result<(), AppError> {
        if self.player.replica().take_question() {
            comms.notify(MAP_REQUEST, 1.0)?;
        }
        Ok(taken.map_err(Rejection::new)?)
    }

    /// Says what is not held back; before that it is remembered that it was going to be said.
    fn say(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        if let Some(gap) = self.player.take_long_gap() {
            tell(format_args!(
                "{}: the next frame was recorded {gap:.1} s after the one before it: with Rate, {LONGEST_GAP_SECS} s of that go by",
                comms.name()
            ));
        }
        let actions = self.player.next(comms.time(), &mut self.allowance);
        let memory = self.player.memory(&self.allowance);
        if !actions.is_empty() && memory.is_some() && self.remembered != memory {
            memory.iter().try_for_each(|memory| comms.publish(&MOTION_MEMORY, memory))?;
            self.remembered = memory;
        }
        actions.iter().try_for_each(|action| publish(comms, action))
    }
}
