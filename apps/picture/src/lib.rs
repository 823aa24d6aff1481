//! Draws plan and section of an explored world into a PNG.
//!
//! [`Scene::from_log`] collects what is to be seen, [`draw`] turns it into a picture; [`draw_run`] does both for the folder
//! of a run. The plan is a horizontal cut at the robot's height, looked down upon; the section is a vertical cut where
//! the most free space is, looked at from the side.

mod axes;
mod canvas;
mod palette;
mod panel;
mod scene;
mod sheet;
mod view;

use std::path::{Path, PathBuf};

use elk_log::{LogError, LogReader};

pub use scene::{Scene, SceneError};
pub use sheet::{DrawError, draw};

/// Why there is no picture of a run.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// There is no such folder.
    #[error("there is no run at {}: name a folder under logs/", .0.display())]
    NoRun(PathBuf),
    /// The log could not be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The log can be read but does not hold what a picture needs.
    #[error("{}: {source}", path.display())]
    Scene {
        /// The log.
        path: PathBuf,
        /// What it lacks.
        source: SceneError,
    },
    /// The scene could not be drawn.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// The picture could not be written.
    #[error("cannot write the picture {}: {source}", path.display())]
    Write {
        /// The picture.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Draws the log of the run in the folder `run` into `picture.png` beside it, and answers where that is.
pub fn draw_run(run: &Path) -> Result<PathBuf, PictureError> {
    if !run.is_dir() {
        return Err(PictureError::NoRun(run.into()));
    }
    let scene =
        Scene::from_log(LogReader::open(run)?).map_err(|source| PictureError::Scene { path: run.into(), source })?;
    let png = draw(&scene)?;
    let path = run.join("picture.png");
    elk_outside::file::place(&path, &png).map_err(|source| PictureError::Write { path: path.clone(), source })?;
    Ok(path)
}
