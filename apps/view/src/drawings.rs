//! What apps draw, kept as pages need it: of each app the latest drawing of each name, as long as it is to be seen.
//!
//! A drawing with a lifetime is there until that is over, whoever is there; one without until it is replaced or taken away,
//! or its app has gone.

use std::collections::{BTreeMap, BTreeSet};

use axum::body::Bytes;
use elk_bus::drawing::{Drawing, Frame, Primitive};
use serde_json::{Value, json};

use crate::journal::Journal;

/// Drawings that are kept, and bytes of all of them together; of more, those that were drawn longest ago go.
const MOST: usize = 256;
const MOST_BYTES: usize = 64 << 20;
/// The first byte of a frame with a drawing.
const DRAWING: u8 = 3;
/// Bytes before what a frame says in words.
const HEAD: usize = 8;

/// Whose drawing, and its name.
pub(crate) type Title = (String, String);

/// All drawings that are to be seen.
#[derive(Debug, Clone, Default)]
pub(crate) struct Drawings {
    /// As they are sent, in the order in which they were drawn.
    frames: Journal<Title, Bytes>,
    /// When each with a lifetime goes (s).
    until: BTreeMap<Title, f64>,
    bytes: usize,
    /// Clients that are there; `None`: nobody has said.
    present: Option<BTreeSet<String>>,
}

impl Drawings {
    /// An app has drawn, at `time` (s). Whether the list of drawings is another.
    pub fn take(&mut self, app: &str, time: f64, drawing: &Drawing) -> bool {
        let title = (app.to_owned(), drawing.name.clone());
        let was_there = self.remove(&title);
        let is_alive = self.present.as_ref().is_none_or(|present| present.contains(app));
        // What the broker kept of an app that has gone is not to be seen.
        if drawing.primitives.is_empty() || (drawing.lifetime_s.is_none() && !is_alive) {
            return was_there;
        }
        let frame = frame(app, drawing);
        self.bytes += frame.len();
        self.frames.put(title.clone(), frame);
        if let Some(secs) = drawing.lifetime_s {
            self.until.insert(title, time + secs);
        }
        self.make_room() || !was_there
    }

    /// Whether the lifetime of any is over at this time (s).
    pub fn is_any_over(&self, now: f64) -> bool {
        self.until.values().any(|until| *until <= now)
    }

    /// It is this time (s): drawings whose lifetime is over go. Whether there were any.
    pub fn expire(&mut self, now: f64) -> bool {
        let over: Vec<Title> =
            self.until.iter().filter(|(_, until)| **until <= now).map(|(title, _)| title.clone()).collect();
        over.iter().for_each(|title| {
            self.remove(title);
        });
        !over.is_empty()
    }

    /// These clients are there, as the broker says it: names, each with a comma behind it. Drawings of others go, but for those
    /// that go by themselves. Whether there were any.
    pub fn hear_of_clients(&mut self, names: &str) -> bool {
        let present: BTreeSet<String> = names.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect();
        let of_the_gone = |title: &Title| !present.contains(&title.0) && !self.until.contains_key(title);
        let gone: Vec<Title> =
            self.frames.since(0).map(|(_, title, _)| title).filter(|title| of_the_gone(title)).cloned().collect();
        gone.iter().for_each(|title| {
            self.remove(title);
        });
        self.present = Some(present);
        !gone.is_empty()
    }

    /// What was drawn after `seen`, oldest first, in frames of at most `most` bytes together, but one at least. The reader has
    /// seen it then.
    pub fn news(&self, seen: &mut u64, most: usize) -> Vec<Bytes> {
        let (mut news, mut bytes) = (Vec::new(), 0);
        for (number, _, frame) in self.frames.since(*seen) {
            bytes += frame.len();
            if bytes > most && !news.is_empty() {
                break;
            }
            news.push(frame.clone());
            *seen = number;
        }
        news
    }

    /// The message that lists what is to be seen: all else is not.
    pub fn list(&self) -> Value {
        let mut titles: Vec<&Title> = self.frames.since(0).map(|(_, title, _)| title).collect();
        titles.sort();
        let rows: Vec<Value> = titles.into_iter().map(|(app, name)| json!({"app": app, "name": name})).collect();
        json!({"type": "drawings", "rows": rows})
    }

    fn remove(&mut self, title: &Title) -> bool {
        self.until.remove(title);
        let Some(frame) = self.frames.remove(title) else { return false };
        self.bytes -= frame.len();
        true
    }

    /// Lets the oldest go while there is too much; whether there was.
    fn make_room(&mut self) -> bool {
        let mut had = false;
        while self.frames.len() > MOST || (self.bytes > MOST_BYTES && self.frames.len() > 1) {
            let Some((_, oldest, _)) = self.frames.since(0).next() else { return had };
            let oldest = oldest.clone();
            had |= self.remove(&oldest);
        }
        had
    }
}

/// A drawing as pages are sent it: see `PROTOCOL.md`.
fn frame(app: &str, drawing: &Drawing) -> Bytes {
    let mut data = Vec::new();
    let primitives: Vec<Value> = drawing.primitives.iter().map(|one| put(one, &mut data)).collect();
    let frame = match drawing.frame {
        Frame::World => "world",
        Frame::Robot => "robot",
    };
    let said = json!({"app": app, "name": drawing.name, "frame": frame, "primitives": primitives}).to_string();
    let mut frame = vec![DRAWING, 0, 0, 0];
    frame.extend((said.len() as u32).to_le_bytes());
    frame.extend(said.as_bytes());
    // Numbers lie where they can be looked at in place.
    frame.resize(HEAD + said.len().next_multiple_of(4), b' ');
    frame.extend(data);
    frame.into()
}

/// Puts a primitive's numbers behind `data`, and answers what is to be said of it.
fn put(primitive: &Primitive, data: &mut Vec<u8>) -> Value {
    let mut vertices = |at: &[[f32; 3]], colours: &[[u8; 4]]| {
        at.iter().flatten().for_each(|c| data.extend(c.to_le_bytes()));
        data.extend(colours.as_flattened());
        (at.len(), colours.len())
    };
    match primitive {
        Primitive::Points { at, colours, size_px } => {
            let (places, colours) = vertices(at, &colours.0);
            json!({"kind": "points", "places": places, "colours": colours, "size": size_px})
        }
        Primitive::Lines { at, joined, colours, width_px } => {
            let (places, colours) = vertices(at, &colours.0);
            json!({"kind": "lines", "places": places, "colours": colours, "width": width_px, "joined": joined})
        }
        Primitive::Triangles { at, colours } => {
            let (places, colours) = vertices(at, &colours.0);
            json!({"kind": "triangles", "places": places, "colours": colours})
        }
        Primitive::Voxels { at, colours, edge_m } => {
            let (places, colours) = vertices(at, &colours.0);
            json!({"kind": "voxels", "places": places, "colours": colours, "edge": edge_m})
        }
        Primitive::Text { at, text, colour, size_px } => {
            let (places, colours) = vertices(&[*at], &[*colour]);
            json!({"kind": "text", "places": places, "colours": colours, "text": text, "size": size_px})
        }
        Primitive::Image { corner, along, across, columns, pixels } => {
            let (places, colours) = vertices(&[*corner, *along, *across], pixels);
            json!({"kind": "image", "places": places, "colours": colours, "columns": columns})
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(name: &str) -> Drawing {
        Drawing::new(name).line_strip([[0.0; 3], [1.0, 2.0, 3.0]], [1, 2, 3, 4])
    }

    fn titles(drawings: &Drawings) -> Vec<String> {
        let rows = drawings.list();
        let title = |row: &Value| format!("{}/{}", row["app"].as_str().unwrap(), row["name"].as_str().unwrap());
        rows["rows"].as_array().unwrap().iter().map(title).collect()
    }

    #[test]
    fn a_drawing_takes_the_place_of_the_one_before_of_its_app_and_name() {
        let mut drawings = Drawings::default();
        assert!(drawings.take("a", 0.0, &line("x")) && drawings.take("b", 0.0, &line("x")));
        assert!(!drawings.take("a", 1.0, &line("x").points([[0.0; 3]], [9; 4])));
        assert_eq!((titles(&drawings), drawings.frames.len()), (vec!["a/x".into(), "b/x".into()], 2));
        let mut seen = 0;
        assert_eq!(drawings.news(&mut seen, usize::MAX).len(), 2);
        assert!(drawings.news(&mut seen, usize::MAX).is_empty());
        drawings.take("a", 2.0, &Drawing::new("x"));
        assert_eq!(titles(&drawings), ["b/x"]);
        assert_eq!(drawings.bytes, drawings.frames.since(0).map(|(.., frame)| frame.len()).sum::<usize>());
    }

    #[test]
    fn a_lifetime_ends_and_what_has_none_goes_with_its_app() {
        let mut drawings = Drawings::default();
        drawings.hear_of_clients("a,view,");
        drawings.take("a", 10.0, &line("brief").lasting(2.0));
        drawings.take("a", 10.0, &line("for ever"));
        assert!(!drawings.expire(11.9));
        assert!(drawings.hear_of_clients("view,"));
        assert_eq!(titles(&drawings), ["a/brief"], "what has a lifetime stays until it is over");
        assert!(drawings.expire(12.0) && titles(&drawings).is_empty());
        // What the broker has kept of who is gone is not shown.
        drawings.take("a", 13.0, &line("for ever"));
        assert!(titles(&drawings).is_empty());
        drawings.hear_of_clients("a,");
        drawings.take("a", 14.0, &line("for ever"));
        assert_eq!(titles(&drawings), ["a/for ever"]);
        // Drawn anew without a lifetime, it has none.
        drawings.take("a", 15.0, &line("x").lasting(1.0));
        drawings.take("a", 15.0, &line("x"));
        assert!(!drawings.expire(1e9));
    }

    #[test]
    fn no_number_and_no_size_of_drawings_fills_the_memory() {
        let mut drawings = Drawings::default();
        for i in 0..10_000 {
            drawings.take("a", 0.0, &line(&i.to_string()));
        }
        assert_eq!(drawings.frames.len(), MOST);
        assert!(titles(&drawings).contains(&"a/9999".into()) && !titles(&drawings).contains(&"a/0".into()));
        let large = |name: String| Drawing::new(name).points(vec![[0.0; 3]; 1 << 18], [1; 4]);
        for i in 0..40 {
            drawings.take("b", 0.0, &large(i.to_string()));
        }
        assert!(drawings.bytes <= MOST_BYTES && drawings.frames.len() > 10, "{} bytes", drawings.bytes);
        let (mut seen, mut frames) = (0, 0);
        loop {
            let news = drawings.news(&mut seen, 1 << 20);
            assert!(news.len() <= 1);
            if news.is_empty() {
                break;
            }
            frames += 1;
        }
        assert_eq!(frames, drawings.frames.len());
    }

    #[test]
    fn a_frame_has_its_numbers_behind_its_words() {
        let drawing = line("x").text([7.0; 3], "hall", [5; 4]);
        let frame = frame("a", &drawing);
        let words = u32::from_le_bytes(frame[4..8].try_into().unwrap()) as usize;
        let said: Value = serde_json::from_slice(&frame[8..8 + words]).unwrap();
        assert_eq!((&said["app"], &said["frame"]), (&json!("a"), &json!("world")));
        assert_eq!(
            said["primitives"][1],
            json!({"kind": "text", "places": 1, "colours": 1, "text": "hall", "size": 14.0})
        );
        let data = &frame[8 + words.next_multiple_of(4)..];
        assert_eq!(data.len(), 2 * 12 + 4 + 12 + 4);
        assert_eq!(f32::from_le_bytes(data[20..24].try_into().unwrap()), 3.0);
        assert_eq!(data[24..28], [1, 2, 3, 4]);
    }
}
