//! A drawing: what an app shows of itself, as primitives with colours, in a frame, for a time.

use elk_describe::{Describe, payload};

use crate::limits::{
    self, Checked, EDGES_M, LIFETIMES_S, MAX_PIXELS, MAX_PRIMITIVES, MAX_SIDE, MAX_VERTICES, SIZES_PX, holds,
};

/// Red, green, blue and opacity, 0 to 255 each.
pub type Colour = [u8; 4];

/// An opaque colour.
pub const fn rgb(red: u8, green: u8, blue: u8) -> Colour {
    [red, green, blue, 255]
}

/// What an app draws under one name. It takes the place of what the same app drew under that name before; a drawing without
/// primitives takes it away.
#[payload]
#[describe(check = check, drawn = "scene")]
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// Its name among the drawings of its app.
    #[describe(check = limits::name)]
    pub name: String,
    /// What its places are measured in.
    pub frame: Frame,
    /// How long it is shown (community's time); none: until it is replaced or taken away, or its app ends.
    #[describe(unit = "s", any, check = lifetime)]
    pub lifetime_s: Option<f64>,
    /// What it is made of; of what lies in one plane, later ones are drawn over earlier ones.
    #[describe(longest = MAX_PRIMITIVES)]
    pub primitives: Vec<Primitive>,
}

/// What places are measured in.
#[payload]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Frame {
    /// The world's frame: z up.
    #[default]
    World,
    /// The robot's frame: x ahead, y to the left, z up. What is drawn in it moves with the robot.
    Robot,
}

/// One colour for all vertices, or one for each.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub struct Colours(pub Vec<Colour>);

impl From<Colour> for Colours {
    fn from(colour: Colour) -> Self {
        Self(vec![colour])
    }
}

impl From<Vec<Colour>> for Colours {
    fn from(colours: Vec<Colour>) -> Self {
        Self(colours)
    }
}

impl Colours {
    /// The colour of a vertex.
    pub fn of(&self, vertex: usize) -> Colour {
        self.0.get(vertex).or_else(|| self.0.first()).copied().unwrap_or([0; 4])
    }
}

/// What a drawing is made of. Places are in metres, in the drawing's frame.
#[payload]
#[derive(Debug, Clone, PartialEq)]
pub enum Primitive {
    /// Round points.
    Points {
        /// Where.
        #[describe(unit = "m", any, longest = MAX_VERTICES, check = limits::places)]
        at: Vec<[f32; 3]>,
        /// One colour, or one a point.
        colours: Colours,
        /// Across.
        #[describe(unit = "px", range = SIZES_PX)]
        size_px: f32,
    },
    /// Straight lines.
    Lines {
        /// Their ends: from the first to the second, from the third to the fourth and so on; or, if `joined`, from each to the
        /// next one.
        #[describe(unit = "m", any, longest = MAX_VERTICES, check = limits::places)]
        at: Vec<[f32; 3]>,
        /// Whether this is one line through all places.
        joined: bool,
        /// One colour, or one an end: a line has the colour of the end at which it begins.
        colours: Colours,
        /// Across.
        #[describe(unit = "px", range = SIZES_PX)]
        width_px: f32,
    },
    /// Triangles, seen from both sides.
    Triangles {
        /// Their corners, three each.
        #[describe(unit = "m", any, longest = MAX_VERTICES, check = limits::places)]
        at: Vec<[f32; 3]>,
        /// One colour, or one a corner: a triangle has the colour of its first corner.
        colours: Colours,
    },
    /// Cubes along the frame's axes.
    Voxels {
        /// Their centres.
        #[describe(unit = "m", any, longest = MAX_VERTICES, check = limits::places)]
        at: Vec<[f32; 3]>,
        /// One colour, or one a voxel.
        colours: Colours,
        /// Their edge.
        #[describe(unit = "m", range = EDGES_M)]
        edge_m: f32,
    },
    /// A line of text that faces whoever looks.
    Text {
        /// Where its middle is.
        #[describe(unit = "m", any, check = limits::place)]
        at: [f32; 3],
        /// What it says.
        #[describe(check = limits::text)]
        text: String,
        /// Its colour.
        colour: Colour,
        /// How high its letters are.
        #[describe(unit = "px", range = SIZES_PX)]
        size_px: f32,
    },
    /// Pixels on a parallelogram, seen from both sides.
    Image {
        /// The corner where the first pixel lies.
        #[describe(unit = "m", any, check = limits::place)]
        corner: [f32; 3],
        /// From there along the first row to its end.
        #[describe(unit = "m", any, check = limits::place)]
        along: [f32; 3],
        /// From the corner over all rows.
        #[describe(unit = "m", any, check = limits::place)]
        across: [f32; 3],
        /// Pixels in a row.
        columns: u32,
        /// The pixels, row by row.
        #[describe(longest = MAX_PIXELS)]
        pixels: Vec<Colour>,
    },
}

impl Drawing {
    /// A drawing without primitives, in the world's frame, until it is replaced. As it is, it takes away what was drawn under
    /// this name.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), frame: Frame::World, lifetime_s: None, primitives: Vec::new() }
    }

    /// The same in the robot's frame.
    #[must_use]
    pub fn on_robot(self) -> Self {
        Self { frame: Frame::Robot, ..self }
    }

    /// The same, shown for so long (s).
    #[must_use]
    pub fn lasting(self, secs: f64) -> Self {
        Self { lifetime_s: Some(secs), ..self }
    }

    /// The same with a primitive more.
    #[must_use]
    pub fn with(mut self, primitive: Primitive) -> Self {
        self.primitives.push(primitive);
        self
    }

    /// The same with points (m), 5 pixels across.
    #[must_use]
    pub fn points(self, at: impl IntoIterator<Item = [f32; 3]>, colours: impl Into<Colours>) -> Self {
        let (at, colours) = (at.into_iter().collect(), colours.into());
        self.with(Primitive::Points { at, colours, size_px: 5.0 })
    }

    /// The same with lines from each first to each second place (m), 2 pixels across.
    #[must_use]
    pub fn lines(self, at: impl IntoIterator<Item = [f32; 3]>, colours: impl Into<Colours>) -> Self {
        let (at, colours) = (at.into_iter().collect(), colours.into());
        self.with(Primitive::Lines { at, joined: false, colours, width_px: 2.0 })
    }

    /// The same with one line through all places (m), 2 pixels across.
    #[must_use]
    pub fn line_strip(self, at: impl IntoIterator<Item = [f32; 3]>, colours: impl Into<Colours>) -> Self {
        let (at, colours) = (at.into_iter().collect(), colours.into());
        self.with(Primitive::Lines { at, joined: true, colours, width_px: 2.0 })
    }

    /// The same with triangles between each three places (m).
    #[must_use]
    pub fn triangles(self, at: impl IntoIterator<Item = [f32; 3]>, colours: impl Into<Colours>) -> Self {
        let (at, colours) = (at.into_iter().collect(), colours.into());
        self.with(Primitive::Triangles { at, colours })
    }

    /// The same with cubes of this edge (m) around these places (m).
    #[must_use]
    pub fn voxels(self, at: impl IntoIterator<Item = [f32; 3]>, edge_m: f32, colours: impl Into<Colours>) -> Self {
        let (at, colours) = (at.into_iter().collect(), colours.into());
        self.with(Primitive::Voxels { at, colours, edge_m })
    }

    /// The same with a text, its letters 14 pixels high.
    #[must_use]
    pub fn text(self, at: [f32; 3], text: impl Into<String>, colour: Colour) -> Self {
        self.with(Primitive::Text { at, text: text.into(), colour, size_px: 14.0 })
    }
}

impl Primitive {
    /// Vertices, and pixels.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Points { at, .. } | Self::Lines { at, .. } | Self::Triangles { at, .. } | Self::Voxels { at, .. } => {
                (at.len(), 0)
            }
            Self::Text { .. } => (1, 0),
            Self::Image { pixels, .. } => (4, pixels.len()),
        }
    }
}

fn lifetime(lifetime: &Option<f64>) -> Checked {
    let is = lifetime.is_none_or(|secs| LIFETIMES_S.contains(&secs));
    holds("", is, lifetime.unwrap_or_default(), "0.001 to 86400 s")
}

/// Each primitive's lists are as long as each other say, and all together not too long.
fn check(drawing: &Drawing) -> Checked {
    let (mut vertices, mut pixels) = (0, 0);
    for (i, primitive) in drawing.primitives.iter().enumerate() {
        fits(primitive).map_err(|inner| inner.within(&format!("primitives[{i}]")))?;
        let (more_vertices, more_pixels) = primitive.size();
        (vertices, pixels) = (vertices + more_vertices, pixels + more_pixels);
    }
    holds(
        "primitives",
        vertices <= MAX_VERTICES,
        format!("{vertices} vertices"),
        "at most 2^18 vertices all together",
    )?;
    holds("primitives", pixels <= MAX_PIXELS, format!("{pixels} pixels"), "at most 2^20 pixels all together")
}

fn fits(primitive: &Primitive) -> Checked {
    let (at, colours) = match primitive {
        Primitive::Lines { at, joined: false, colours, .. } => {
            holds("at", at.len() % 2 == 0, format!("{} places", at.len()), "two places a line")?;
            (at, colours)
        }
        Primitive::Triangles { at, colours } => {
            holds("at", at.len() % 3 == 0, format!("{} places", at.len()), "three places a triangle")?;
            (at, colours)
        }
        Primitive::Points { at, colours, .. }
        | Primitive::Lines { at, colours, .. }
        | Primitive::Voxels { at, colours, .. } => (at, colours),
        Primitive::Text { .. } => return Ok(()),
        Primitive::Image { columns, pixels, .. } => {
            let (columns, count) = (*columns as usize, pixels.len());
            let is_whole = count > 0 && (1..=MAX_SIDE).contains(&columns) && count.is_multiple_of(columns);
            let is = is_whole && count / columns <= MAX_SIDE;
            let found = format!("{count} pixels in rows of {columns}");
            return holds("pixels", is, found, "whole rows, 1 to 4096 of them, of 1 to 4096 pixels");
        }
    };
    let count = colours.0.len();
    let found = format!("{count} colours for {} places", at.len());
    holds("colours", count == 1 || count == at.len(), found, "one colour, or one a place")
}

impl Drawing {
    /// Looks whether everybody will believe it.
    ///
    /// # Errors
    /// The first field that is not as it should be.
    pub fn checked(&self) -> Checked {
        self.check()
    }
}
