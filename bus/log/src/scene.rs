//! A drawing as viewers show it: an entity of `foxglove.SceneUpdate`, which takes the place of the one before of its name.
//!
//! Points are balls of a size, since viewers have none in pixels; images are left out, since viewers have none in a scene. The
//! value itself is stored whole beside it. What is drawn on the robot is in the frame `robot`: a viewer shows it if it is told
//! where that is.

use elk_bus::drawing::{Colour, Colours, Drawing, Frame, Primitive};
use elk_bus::{Key, TypeRef, ValueRef};

use crate::foxglove::{FRAME, put_time};
use crate::protobuf::Fields;

/// Across a point (m).
const POINT_M: f64 = 0.05;
/// Places of a drawing that a viewer is shown, at some hundred bytes each.
const MOST_SHOWN: usize = 1 << 14;

/// Appends what viewers show of a drawing; of what is none, nothing.
pub(crate) fn put(out: &mut Fields<'_>, nanoseconds: u64, type_: TypeRef<'_>, bytes: &[u8]) {
    let key = Key::<Drawing>::new("DRAWING");
    let Ok(drawing) = (ValueRef::Binary { type_, bytes }).decode(&key) else { return };
    if drawing.primitives.is_empty() {
        return out.message(1, |out| {
            put_time(out, 1, nanoseconds);
            out.varint(2, 0);
            out.bytes(3, drawing.name.as_bytes());
        });
    }
    out.message(2, |out| {
        put_time(out, 1, nanoseconds);
        out.bytes(2, if drawing.frame == Frame::World { FRAME } else { "robot" }.as_bytes());
        out.bytes(3, drawing.name.as_bytes());
        if let Some(secs) = drawing.lifetime_s {
            put_time(out, 4, (secs * 1e9) as u64);
        }
        out.varint(5, u64::from(drawing.frame == Frame::Robot));
        let mut room = MOST_SHOWN;
        for primitive in &drawing.primitives {
            put_primitive(out, primitive, &mut room);
        }
    });
}

fn put_primitive(out: &mut Fields<'_>, primitive: &Primitive, room: &mut usize) {
    let mut shown = |places: usize| {
        let shown = places.min(*room);
        *room -= shown;
        shown
    };
    match primitive {
        Primitive::Points { at, colours, .. } => {
            let shown = shown(at.len());
            (0..shown).for_each(|i| put_solid(out, 9, at[i], POINT_M, colours.of(i)));
        }
        Primitive::Voxels { at, colours, edge_m } => {
            let shown = shown(at.len());
            (0..shown).for_each(|i| put_solid(out, 8, at[i], f64::from(*edge_m), colours.of(i)));
        }
        Primitive::Lines { at, joined, colours, width_px } => {
            let shown = shown(at.len());
            let (strip, list) = (0, 2);
            out.message(11, |out| {
                out.varint(1, if *joined { strip } else { list });
                out.double(3, f64::from(*width_px));
                out.varint(4, 1);
                at[..shown - if *joined { 0 } else { shown % 2 }].iter().for_each(|place| put_place(out, 5, *place));
                put_colours(out, (6, 7), colours, shown - if *joined { 0 } else { shown % 2 });
            });
        }
        Primitive::Triangles { at, colours } => {
            let shown = shown(at.len()) / 3 * 3;
            out.message(12, |out| {
                at[..shown].iter().for_each(|place| put_place(out, 2, *place));
                put_colours(out, (3, 4), colours, shown);
            });
        }
        Primitive::Text { at, text, colour, size_px } => out.message(13, |out| {
            put_pose(out, 1, *at);
            out.varint(2, 1);
            out.double(3, f64::from(*size_px));
            out.varint(4, 1);
            put_colour(out, 5, *colour);
            out.bytes(6, text.as_bytes());
        }),
        Primitive::Image { .. } => {}
    }
}

/// A cube or a ball.
fn put_solid(out: &mut Fields<'_>, number: u32, place: [f32; 3], size_m: f64, colour: Colour) {
    out.message(number, |out| {
        put_pose(out, 1, place);
        out.message(2, |out| (1..=3).for_each(|axis| out.double(axis, size_m)));
        put_colour(out, 3, colour);
    });
}

/// A pose that only stands somewhere.
fn put_pose(out: &mut Fields<'_>, number: u32, place: [f32; 3]) {
    out.message(number, |out| {
        put_place(out, 1, place);
        out.message(2, |out| out.double(4, 1.0));
    });
}

fn put_place(out: &mut Fields<'_>, number: u32, place: [f32; 3]) {
    out.message(number, |out| (1..).zip(place).for_each(|(axis, c)| out.double(axis, f64::from(c))));
}

fn put_colour(out: &mut Fields<'_>, number: u32, colour: Colour) {
    out.message(number, |out| (1..).zip(colour).for_each(|(part, value)| out.double(part, f64::from(value) / 255.0)));
}

/// One colour under the first number, or one for each of `count` places under the second.
fn put_colours(out: &mut Fields<'_>, (one, many): (u32, u32), colours: &Colours, count: usize) {
    match colours.0.len() {
        0 | 1 => put_colour(out, one, colours.of(0)),
        _ => (0..count).for_each(|i| put_colour(out, many, colours.of(i))),
    }
}

#[cfg(test)]
mod tests {
    use elk_bus::codec;

    use super::*;
    use crate::protobuf::find_bytes;

    fn message(drawing: &Drawing) -> Vec<u8> {
        let (mut bytes, mut message) = (Vec::new(), Vec::new());
        codec::encode_onto(drawing, &mut bytes).unwrap();
        put(&mut Fields(&mut message), 1_500_000_000, TypeRef::of::<Drawing>(), &bytes);
        message
    }

    /// The bytes of fields of one message in another, the last of each number.
    fn fields<const N: usize>(message: &[u8], numbers: [u32; N]) -> [Vec<u8>; N] {
        find_bytes(message, numbers).unwrap().map(|found| found.unwrap_or_default().to_vec())
    }

    fn doubles(message: &[u8]) -> Vec<f64> {
        // Each is a tag of a byte, and eight bytes.
        message.chunks_exact(9).map(|field| f64::from_le_bytes(field[1..].try_into().unwrap())).collect()
    }

    #[test]
    fn primitives_are_an_entity_of_their_name() {
        let drawing = Drawing::new("it")
            .lasting(2.5)
            .line_strip([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], [255, 0, 51, 255])
            .voxels([[0.5; 3]], 0.25, [0, 255, 0, 255])
            .points([[7.0; 3]], [0, 0, 255, 255])
            .triangles([[0.0; 3], [1.0; 3], [9.0, 8.0, 7.0]], vec![[0, 0, 0, 255]; 3])
            .text([1.0, 0.0, 0.0], "hall", [255; 4]);
        let [entity] = fields(&message(&drawing), [2]);
        let [frame, id, lifetime] = fields(&entity, [2, 3, 4]);
        assert_eq!((frame.as_slice(), id.as_slice()), (b"world".as_slice(), b"it".as_slice()));
        assert_eq!(lifetime, [&[8, 2, 16][..], &[0x80, 0xca, 0xb5, 0xee, 0x01]].concat());
        let [cube, ball, line, triangles, text] = fields(&entity, [8, 9, 11, 12, 13]);
        let [pose, size, colour] = fields(&cube, [1, 2, 3]);
        let [position] = fields(&pose, [1]);
        assert_eq!((doubles(&position), doubles(&size)), (vec![0.5; 3], vec![0.25; 3]));
        assert_eq!(doubles(&colour), [0.0, 1.0, 0.0, 1.0]);
        let [pose] = fields(&ball, [1]);
        let [position] = fields(&pose, [1]);
        assert_eq!(doubles(&position), [7.0; 3]);
        let [last, colour] = fields(&line, [5, 6]);
        assert_eq!((doubles(&last), doubles(&colour)), (vec![4.0, 5.0, 6.0], vec![1.0, 0.0, 0.2, 1.0]));
        let [last, colour] = fields(&triangles, [2, 4]);
        assert_eq!((doubles(&last), doubles(&colour)), (vec![9.0, 8.0, 7.0], vec![0.0, 0.0, 0.0, 1.0]));
        assert_eq!(fields(&text, [6]), [b"hall"]);
    }

    #[test]
    fn what_is_taken_away_is_deleted_and_what_is_none_says_nothing() {
        let [deletion, entity] = fields(&message(&Drawing::new("it")), [1, 2]);
        assert_eq!((fields(&deletion, [3]), entity.len()), ([b"it".to_vec()], 0));
        let mut nothing = Vec::new();
        put(&mut Fields(&mut nothing), 0, TypeRef::of::<Drawing>(), &[1, 2, 3]);
        assert!(nothing.is_empty());
    }

    #[test]
    fn a_viewer_is_shown_no_more_than_so_many_places() {
        let many = Drawing::new("many").lines(vec![[1.0; 3]; (1 << 14) - 1 + 9], vec![[1; 4]; (1 << 14) + 8]);
        let twice = many.points([[0.0; 3]; 5], [1; 4]);
        assert!(message(&twice).len() < 90 << 14, "{}", message(&twice).len());
    }
}
