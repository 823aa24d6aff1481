//! The follower as an app: camera poses, map updates and plans in; pose commands, requests and progress out.

use std::collections::VecDeque;

use elk_bus::{App, AppError, Comms, Key, Mail};
use elk_mission::{AppType, Kind, MOOS_HOST, MOOS_PORT, ParamSpec, Params};
use elk_spatial::keys::{
    CAMERA_POSE, MAP, MAP_REQUEST, MAP_UPDATE, MOTION_REPORT, PLAN, PLAN_REQUEST, POSE_COMMAND, PROGRESS, STEP,
    camera_pose,
};
use elk_spatial::messages::CameraPose;

use crate::follower::{Follower, Output};

/// The controllers that a mission file can name.
pub static TYPES: &[AppType] = &[AppType {
    element: "Controller",
    name: "MOOSSim",
    summary: "Moves a simulated camera along the explorer's paths, scanning on the way.",
    params: PARAMS,
    build: |params| Ok(Box::new(ControllerApp::new(params))),
}];

const fn param(name: &'static str, kind: Kind, default: &'static str, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind, default: Some(default), doc }
}

const PARAMS: &[ParamSpec] = &[
    param(
        "MOOSPoseVarName",
        Kind::Variable,
        CAMERA_POSE,
        "Variable under which the sensor publishes the camera's pose.",
    ),
    param("Manual", Kind::Flag, "false", "Wait for a message on STEP before each pose command."),
    MOOS_HOST,
    MOOS_PORT,
];

/// The [`Follower`] on the bus.
pub struct ControllerApp {
    follower: Follower,
    camera_pose: Key<CameraPose>,
    manual: bool,
    /// Steps that a person allowed and that were not taken yet.
    steps: u64,
    /// What the follower wants said, held back from the first command on that waits for a step.
    held: VecDeque<Output>,
}

impl ControllerApp {
    /// A controller with checked parameters.
    pub fn new(params: &Params) -> Self {
        Self {
            follower: Follower::default(),
            camera_pose: camera_pose(params.text("MOOSPoseVarName")),
            manual: params.flag("Manual"),
            steps: 0,
            held: VecDeque::new(),
        }
    }

    fn say(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        while let Some(output) = self.held.pop_front() {
            if self.manual && matches!(output, Output::Command(_)) {
                if self.steps == 0 {
                    self.held.push_front(output);
                    return Ok(());
                }
                self.steps -= 1;
            }
            publish(comms, &output)?;
        }
        Ok(())
    }
}

fn publish(comms: &mut Comms, output: &Output) -> Result<(), AppError> {
    match output {
        Output::Command(command) => comms.publish(&POSE_COMMAND, command)?,
        Output::Request(request) => comms.publish(&PLAN_REQUEST, request)?,
        Output::Progress(progress) => comms.publish(&PROGRESS, progress)?,
        Output::Finished(report) => comms.publish(&MOTION_REPORT, report)?,
        Output::MapRequest => comms.notify(MAP_REQUEST, 1.0)?,
    }
    Ok(())
}

impl App for ControllerApp {
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError> {
        comms.register(&self.camera_pose)?;
        comms.register(&MAP_UPDATE)?;
        comms.register(&MAP)?;
        comms.register(&PLAN)?;
        if self.manual {
            comms.register_variable(STEP, 0.0)?;
        }
        Ok(())
    }

    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError> {
        if mail.is(&self.camera_pose) {
            self.held.extend(self.follower.on_camera_pose(&mail.decode(&self.camera_pose)?));
        } else if mail.is(&MAP_UPDATE) {
            self.held.extend(self.follower.on_map(&mail.decode(&MAP_UPDATE)?)?);
        } else if mail.is(&MAP) {
            self.held.extend(self.follower.on_map(&mail.decode(&MAP)?)?);
        } else if mail.is(&PLAN) {
            self.held.extend(self.follower.on_plan(&mail.decode(&PLAN)?));
        } else if mail.key() == STEP {
            self.steps += 1;
        }
        self.say(comms)
    }
}
