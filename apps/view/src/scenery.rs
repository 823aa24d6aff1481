//! The world that a mission's sensor sees, as pages draw it: read when the first page asks for it, once a run.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use axum::body::Bytes;
use axum::extract::ws::Message;
use serde_json::json;

use crate::model::message;

/// The first byte of a frame with the surfaces of a world.
const SURFACES: u8 = 4;

/// The surfaces of a world.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Surfaces {
    /// What a person is to know of them, as that they are simplified; empty: nothing.
    pub remark: String,
    /// Corners (m, world).
    pub corners: Vec<[f32; 3]>,
    /// Three corners each, by their place in the list, anticlockwise as seen from the free side.
    pub triangles: Vec<[u32; 3]>,
}

/// Whoever knows the world of a mission, behind a seam: this crate reads neither missions nor worlds. It bounds how large
/// the surfaces are.
pub trait Scenery: Send + Sync {
    /// The surfaces of the world as it is now; it may take its time.
    ///
    /// # Errors
    /// There is none to be seen; in words why.
    fn surfaces(&self) -> Result<Surfaces, String>;
}

/// The world of the run that is looked at.
pub(crate) struct Scene {
    source: Option<Arc<dyn Scenery>>,
    run: AtomicU64,
    /// What pages are sent, and of which run.
    kept: Mutex<Option<(u64, [Message; 2])>>,
}

impl Scene {
    pub fn new(source: Option<Arc<dyn Scenery>>) -> Self {
        Self { source, run: AtomicU64::new(1), kept: Mutex::new(None) }
    }

    /// Another run has begun, which may have another world.
    pub fn begin(&self) {
        self.run.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts up with each run.
    pub fn run(&self) -> u64 {
        self.run.load(Ordering::Relaxed)
    }

    /// What a page is sent that shows the world: words, and surfaces if there are any. Whoever asks while it is being read
    /// waits for that.
    pub fn messages(&self) -> Vec<Message> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let run = self.run();
        if let Some((of, messages)) = &*kept
            && *of == run
        {
            return messages.to_vec();
        }
        let missing = || Err("this view knows of no world".to_owned());
        match self.source.as_ref().map_or_else(missing, |source| source.surfaces()) {
            Ok(surfaces) => {
                let said = message(&json!({"type": "world", "ok": true, "text": surfaces.remark}));
                let messages = [said, Message::Binary(frame(&surfaces))];
                *kept = Some((run, messages.clone()));
                messages.to_vec()
            }
            Err(why) => vec![message(&json!({"type": "world", "ok": false, "text": why}))],
        }
    }
}

/// Surfaces as pages are sent them: see `PROTOCOL.md`.
fn frame(surfaces: &Surfaces) -> Bytes {
    let Surfaces { corners, triangles, .. } = surfaces;
    let mut frame = Vec::with_capacity(12 * (1 + corners.len() + triangles.len()));
    frame.extend([SURFACES, 0, 0, 0]);
    [corners.len(), triangles.len()].iter().for_each(|count| frame.extend((*count as u32).to_le_bytes()));
    corners.iter().flatten().for_each(|part| frame.extend(part.to_le_bytes()));
    triangles.iter().flatten().for_each(|corner| frame.extend(corner.to_le_bytes()));
    frame.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A world that is there from its second reading on.
    struct Late(AtomicU64);

    impl Scenery for Late {
        fn surfaces(&self) -> Result<Surfaces, String> {
            match self.0.fetch_add(1, Ordering::Relaxed) {
                0 => Err("not yet".to_owned()),
                reading => Ok(Surfaces {
                    remark: format!("reading {reading}"),
                    corners: vec![[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]],
                    triangles: vec![[0, 2, 1]],
                }),
            }
        }
    }

    fn said(messages: &[Message]) -> serde_json::Value {
        serde_json::from_str(messages[0].to_text().unwrap()).unwrap()
    }

    #[test]
    fn a_world_is_read_once_a_run_and_one_that_cannot_be_read_is_tried_again() {
        let scene = Scene::new(Some(Arc::new(Late(AtomicU64::new(0)))));
        let failed = scene.messages();
        assert_eq!((failed.len(), said(&failed)), (1, json!({"type": "world", "ok": false, "text": "not yet"})));
        for _ in 0..3 {
            let messages = scene.messages();
            assert_eq!(said(&messages), json!({"type": "world", "ok": true, "text": "reading 1"}));
            let Message::Binary(frame) = &messages[1] else { panic!("no surfaces") };
            assert_eq!((frame[0], frame.len()), (SURFACES, 12 + 3 * 12 + 12));
            assert_eq!(frame[4..12], [3, 0, 0, 0, 1, 0, 0, 0]);
            assert_eq!((&frame[12..20], &frame[52..56]), (&[0, 0, 0, 0, 0, 0, 0x80, 0x3f][..], &[2, 0, 0, 0][..]));
        }
        scene.begin();
        assert_eq!(said(&scene.messages())["text"], "reading 2");
        assert_eq!(said(&Scene::new(None).messages())["ok"], false);
    }
}
