//! Foxglove's published protobuf messages, as far as a log uses them: what viewers show without being told how; and one of
//! elk's own, for what they cannot show.
//!
//! The field numbers are those of <https://github.com/foxglove/foxglove-sdk/tree/main/schemas/proto>. A log carries the
//! descriptors of its messages, so that a reader needs no schema of its own. They are built here from the tables below:
//! a generator and its run time would be forty crates for some small messages.

use nalgebra::{Isometry3, Point3};

use crate::protobuf::Fields;

/// The frame that everything is given in: viewers need no transform to put it together.
pub(crate) const FRAME: &str = "world";

/// A message type with its fields and the types that these are of.
pub(crate) struct MessageType {
    package: &'static str,
    name: &'static str,
    fields: &'static [Field],
    /// The enum inside it: its name, and its values from 0; no values: it has none.
    choice: (&'static str, &'static [&'static str]),
    uses: &'static [&'static MessageType],
}

const NONE: (&str, &[&str]) = ("", &[]);

struct Field {
    name: &'static str,
    number: u32,
    repeated: bool,
    kind: FieldKind,
}

/// Field types by their numbers in protobuf's own descriptor.
enum FieldKind {
    Double,
    Int64,
    Int32,
    Fixed32,
    Bool,
    Text,
    Bytes,
    Message(&'static str),
    Enum(&'static str),
}

impl FieldKind {
    fn number(&self) -> u64 {
        match self {
            FieldKind::Double => 1,
            FieldKind::Int64 => 3,
            FieldKind::Int32 => 5,
            FieldKind::Fixed32 => 7,
            FieldKind::Bool => 8,
            FieldKind::Text => 9,
            FieldKind::Message(_) => 11,
            FieldKind::Bytes => 12,
            FieldKind::Enum(_) => 14,
        }
    }

    fn type_name(&self) -> Option<&'static str> {
        match self {
            FieldKind::Message(name) | FieldKind::Enum(name) => Some(name),
            _ => None,
        }
    }
}

const fn one(name: &'static str, number: u32, kind: FieldKind) -> Field {
    Field { name, number, repeated: false, kind }
}

const fn many(name: &'static str, number: u32, kind: FieldKind) -> Field {
    Field { name, number, repeated: true, kind }
}

const fn message(name: &'static str, fields: &'static [Field], uses: &'static [&'static MessageType]) -> MessageType {
    MessageType { package: "foxglove", name, fields, choice: NONE, uses }
}

static TIMESTAMP: MessageType = MessageType {
    package: "google.protobuf",
    name: "Timestamp",
    fields: &[one("seconds", 1, FieldKind::Int64), one("nanos", 2, FieldKind::Int32)],
    choice: NONE,
    uses: &[],
};
static VECTOR3: MessageType = message(
    "Vector3",
    &[one("x", 1, FieldKind::Double), one("y", 2, FieldKind::Double), one("z", 3, FieldKind::Double)],
    &[],
);
static QUATERNION: MessageType = message(
    "Quaternion",
    &[
        one("x", 1, FieldKind::Double),
        one("y", 2, FieldKind::Double),
        one("z", 3, FieldKind::Double),
        one("w", 4, FieldKind::Double),
    ],
    &[],
);
static POSE: MessageType = message(
    "Pose",
    &[
        one("position", 1, FieldKind::Message(".foxglove.Vector3")),
        one("orientation", 2, FieldKind::Message(".foxglove.Quaternion")),
    ],
    &[&VECTOR3, &QUATERNION],
);
static PACKED_ELEMENT_FIELD: MessageType = MessageType {
    package: "foxglove",
    name: "PackedElementField",
    fields: &[
        one("name", 1, FieldKind::Text),
        one("offset", 2, FieldKind::Fixed32),
        one("type", 3, FieldKind::Enum(".foxglove.PackedElementField.NumericType")),
    ],
    choice: ("NumericType", &["UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64"]),
    uses: &[],
};
const TIMESTAMP_FIELD: Field = one("timestamp", 1, FieldKind::Message(".google.protobuf.Timestamp"));
const FRAME_FIELD: Field = one("frame_id", 2, FieldKind::Text);

/// Points in a frame.
pub(crate) static POINT_CLOUD: MessageType = message(
    "PointCloud",
    &[
        TIMESTAMP_FIELD,
        FRAME_FIELD,
        one("pose", 3, FieldKind::Message(".foxglove.Pose")),
        one("point_stride", 4, FieldKind::Fixed32),
        many("fields", 5, FieldKind::Message(".foxglove.PackedElementField")),
        one("data", DATA, FieldKind::Bytes),
    ],
    &[&TIMESTAMP, &POSE, &PACKED_ELEMENT_FIELD],
);
/// A pose.
pub(crate) static POSE_IN_FRAME: MessageType = message(
    "PoseInFrame",
    &[TIMESTAMP_FIELD, FRAME_FIELD, one("pose", 3, FieldKind::Message(".foxglove.Pose"))],
    &[&TIMESTAMP, &POSE],
);
/// Poses one after the other: a path.
pub(crate) static POSES_IN_FRAME: MessageType = message(
    "PosesInFrame",
    &[TIMESTAMP_FIELD, FRAME_FIELD, many("poses", 3, FieldKind::Message(".foxglove.Pose"))],
    &[&TIMESTAMP, &POSE],
);

static DURATION: MessageType = MessageType {
    package: "google.protobuf",
    name: "Duration",
    fields: &[one("seconds", 1, FieldKind::Int64), one("nanos", 2, FieldKind::Int32)],
    choice: NONE,
    uses: &[],
};
static POINT3: MessageType = message("Point3", VECTOR3.fields, &[]);
static COLOR: MessageType = message(
    "Color",
    &[
        one("r", 1, FieldKind::Double),
        one("g", 2, FieldKind::Double),
        one("b", 3, FieldKind::Double),
        one("a", 4, FieldKind::Double),
    ],
    &[],
);
/// A cube, or, under the other name, a ball.
const SOLID: &[Field] = &[
    one("pose", 1, FieldKind::Message(".foxglove.Pose")),
    one("size", 2, FieldKind::Message(".foxglove.Vector3")),
    one("color", 3, FieldKind::Message(".foxglove.Color")),
];
static CUBE: MessageType = message("CubePrimitive", SOLID, &[&POSE, &VECTOR3, &COLOR]);
static SPHERE: MessageType = message("SpherePrimitive", SOLID, &[&POSE, &VECTOR3, &COLOR]);
static LINE: MessageType = MessageType {
    package: "foxglove",
    name: "LinePrimitive",
    fields: &[
        one("type", 1, FieldKind::Enum(".foxglove.LinePrimitive.Type")),
        one("pose", 2, FieldKind::Message(".foxglove.Pose")),
        one("thickness", 3, FieldKind::Double),
        one("scale_invariant", 4, FieldKind::Bool),
        many("points", 5, FieldKind::Message(".foxglove.Point3")),
        one("color", 6, FieldKind::Message(".foxglove.Color")),
        many("colors", 7, FieldKind::Message(".foxglove.Color")),
    ],
    choice: ("Type", &["LINE_STRIP", "LINE_LOOP", "LINE_LIST"]),
    uses: &[&POSE, &POINT3, &COLOR],
};
static TRIANGLE_LIST: MessageType = message(
    "TriangleListPrimitive",
    &[
        one("pose", 1, FieldKind::Message(".foxglove.Pose")),
        many("points", 2, FieldKind::Message(".foxglove.Point3")),
        one("color", 3, FieldKind::Message(".foxglove.Color")),
        many("colors", 4, FieldKind::Message(".foxglove.Color")),
    ],
    &[&POSE, &POINT3, &COLOR],
);
static TEXT: MessageType = message(
    "TextPrimitive",
    &[
        one("pose", 1, FieldKind::Message(".foxglove.Pose")),
        one("billboard", 2, FieldKind::Bool),
        one("font_size", 3, FieldKind::Double),
        one("scale_invariant", 4, FieldKind::Bool),
        one("color", 5, FieldKind::Message(".foxglove.Color")),
        one("text", 6, FieldKind::Text),
    ],
    &[&POSE, &COLOR],
);
static SCENE_ENTITY: MessageType = message(
    "SceneEntity",
    &[
        TIMESTAMP_FIELD,
        FRAME_FIELD,
        one("id", 3, FieldKind::Text),
        one("lifetime", 4, FieldKind::Message(".google.protobuf.Duration")),
        one("frame_locked", 5, FieldKind::Bool),
        many("cubes", 8, FieldKind::Message(".foxglove.CubePrimitive")),
        many("spheres", 9, FieldKind::Message(".foxglove.SpherePrimitive")),
        many("lines", 11, FieldKind::Message(".foxglove.LinePrimitive")),
        many("triangles", 12, FieldKind::Message(".foxglove.TriangleListPrimitive")),
        many("texts", 13, FieldKind::Message(".foxglove.TextPrimitive")),
    ],
    &[&TIMESTAMP, &DURATION, &CUBE, &SPHERE, &LINE, &TRIANGLE_LIST, &TEXT],
);
static SCENE_ENTITY_DELETION: MessageType = MessageType {
    package: "foxglove",
    name: "SceneEntityDeletion",
    fields: &[
        TIMESTAMP_FIELD,
        one("type", 2, FieldKind::Enum(".foxglove.SceneEntityDeletion.Type")),
        one("id", 3, FieldKind::Text),
    ],
    choice: ("Type", &["MATCHING_ID", "ALL"]),
    uses: &[&TIMESTAMP],
};
/// What is drawn, in the place of what was drawn under the same name before.
pub(crate) static SCENE_UPDATE: MessageType = message(
    "SceneUpdate",
    &[
        many("deletions", 1, FieldKind::Message(".foxglove.SceneEntityDeletion")),
        many("entities", 2, FieldKind::Message(".foxglove.SceneEntity")),
    ],
    &[&SCENE_ENTITY_DELETION, &SCENE_ENTITY],
);

/// Bytes of a type that only its writer knows.
pub(crate) static BINARY: MessageType = MessageType {
    package: "elk",
    name: "Binary",
    fields: &[one("data", DATA, FieldKind::Bytes)],
    choice: NONE,
    uses: &[],
};

/// The number of the field `data`.
pub(crate) const DATA: u32 = 6;

impl MessageType {
    /// The type's whole name, as schemas are called.
    pub fn full_name(&self) -> String {
        format!("{}.{}", self.package, self.name)
    }

    fn file_name(&self) -> String {
        match self.package {
            "foxglove" => format!("foxglove/{}.proto", self.name),
            package => format!("{}/{}.proto", package.replace('.', "/"), self.name.to_lowercase()),
        }
    }

    /// The `FileDescriptorSet` of the type and of all that it uses, each file after those that it needs.
    pub fn descriptor_set(&self) -> Vec<u8> {
        let mut files: Vec<&MessageType> = Vec::new();
        self.collect(&mut files);
        let mut bytes = Vec::new();
        for file in files {
            Fields(&mut bytes).message(1, |out| file.file_descriptor(out));
        }
        bytes
    }

    fn collect<'a>(&'a self, files: &mut Vec<&'a MessageType>) {
        self.uses.iter().for_each(|used| used.collect(files));
        if !files.iter().any(|file| file.name == self.name) {
            files.push(self);
        }
    }

    fn file_descriptor(&self, out: &mut Fields<'_>) {
        out.bytes(1, self.file_name().as_bytes());
        out.bytes(2, self.package.as_bytes());
        self.uses.iter().for_each(|used| out.bytes(3, used.file_name().as_bytes()));
        out.message(4, |out| self.message_descriptor(out));
        out.bytes(12, b"proto3");
    }

    fn message_descriptor(&self, out: &mut Fields<'_>) {
        out.bytes(1, self.name.as_bytes());
        for field in self.fields {
            out.message(2, |out| {
                out.bytes(1, field.name.as_bytes());
                out.varint(3, u64::from(field.number));
                out.varint(4, if field.repeated { 3 } else { 1 });
                out.varint(5, field.kind.number());
                if let Some(name) = field.kind.type_name() {
                    out.bytes(6, name.as_bytes());
                }
            });
        }
        let (choice, values) = self.choice;
        if !values.is_empty() {
            out.message(4, |out| {
                out.bytes(1, choice.as_bytes());
                for (number, name) in (0..).zip(values) {
                    out.message(2, |out| {
                        out.bytes(1, name.as_bytes());
                        out.varint(2, number);
                    });
                }
            });
        }
    }
}

/// When, and in which frame: the first two fields of all of them.
pub(crate) fn put_head(out: &mut Fields<'_>, nanoseconds: u64) {
    put_time(out, 1, nanoseconds);
    out.bytes(2, FRAME.as_bytes());
}

/// A time, or a span of time.
pub(crate) fn put_time(out: &mut Fields<'_>, number: u32, nanoseconds: u64) {
    out.message(number, |out| {
        out.varint(1, nanoseconds / 1_000_000_000);
        out.varint(2, nanoseconds % 1_000_000_000);
    });
}

/// A pose, under the number that all of them have it under.
pub(crate) fn put_pose(out: &mut Fields<'_>, pose: &Isometry3<f64>) {
    let (position, rotation) = (pose.translation.vector, pose.rotation.coords);
    out.message(3, |out| {
        out.message(1, |out| (1..).zip(position.iter()).for_each(|(number, c)| out.double(number, *c)));
        out.message(2, |out| (1..).zip(rotation.iter()).for_each(|(number, c)| out.double(number, *c)));
    });
}

/// How a point cloud's points are packed: x, y, z as little-endian f32.
pub(crate) fn put_point_fields(out: &mut Fields<'_>) {
    const FLOAT32: u64 = 7;
    out.fixed32(4, 12);
    for (name, offset) in [(b"x", 0), (b"y", 4), (b"z", 8)] {
        out.message(5, |out| {
            out.bytes(1, name);
            out.fixed32(2, offset);
            out.varint(3, FLOAT32);
        });
    }
}

/// A position as packed in a point cloud.
pub(crate) fn packed(point: Point3<f64>) -> [u8; 12] {
    let mut bytes = [0; 12];
    for (slot, coordinate) in bytes.chunks_exact_mut(4).zip(point.iter()) {
        slot.copy_from_slice(&(*coordinate as f32).to_le_bytes());
    }
    bytes
}
