//! What stands in the worlds. Lengths in metres; `[x, y]` is the corner with the smallest coordinates unless said otherwise.
//!
//! Two rules keep the worlds explorable with 0.1 m voxels: things stand flush against walls or at least 0.3 m off them, and
//! nothing leaves a gap under 0.3 m; boards are at least 3 cm thick, legs 5 cm.

use super::solid::{Scenery, Solid};

/// An opening in a wall, from the wall's own coordinate `from` to `to`, between the heights `sill` and `head`.
#[derive(Debug, Clone, Copy)]
pub struct Opening {
    /// Where it begins along the wall.
    pub from: f64,
    /// Where it ends along the wall.
    pub to: f64,
    /// Height of its lower edge; that of the floor: a door.
    pub sill: f64,
    /// Height of its upper edge.
    pub head: f64,
}

impl Opening {
    /// A door from the floor up to `head`.
    pub fn door(from: f64, to: f64, head: f64) -> Self {
        Self { from, to, sill: 0.0, head }
    }
}

/// A wall that runs along one axis.
#[derive(Debug, Clone, Copy)]
pub struct Wall {
    /// The axis along which it runs: 0: x, 1: y.
    pub along: usize,
    /// Its faces' coordinates on the other axis.
    pub faces: [f64; 2],
    /// Where it begins and ends.
    pub span: [f64; 2],
    /// Its height, from the floor.
    pub height: f64,
}

/// Side to which a piece of furniture turns its back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Back {
    /// Towards smaller x.
    West,
    /// Towards larger x.
    East,
    /// Towards smaller y.
    South,
    /// Towards larger y.
    North,
}

impl Scenery {
    /// A wall with openings, in ascending order: piers between them, a parapet below and a lintel above each.
    pub fn wall(&mut self, name: &str, wall: Wall, openings: &[Opening]) {
        let mut begin = wall.span[0];
        for o in openings {
            self.wall_part(&format!("{name}-pier"), wall, [begin, o.from], [0.0, wall.height]);
            self.wall_part(&format!("{name}-parapet"), wall, [o.from, o.to], [0.0, o.sill]);
            self.wall_part(&format!("{name}-lintel"), wall, [o.from, o.to], [o.head, wall.height]);
            begin = o.to;
        }
        self.wall_part(&format!("{name}-pier"), wall, [begin, wall.span[1]], [0.0, wall.height]);
    }

    fn wall_part(&mut self, name: &str, wall: Wall, [a, b]: [f64; 2], [low, high]: [f64; 2]) {
        if a >= b || low >= high {
            return;
        }
        let [p, q] = wall.faces;
        match wall.along {
            0 => self.block(name, [a, p, low], [b, q, high]),
            _ => self.block(name, [p, a, low], [q, b, high]),
        }
    }

    /// A table: a top of 4 cm on four legs of 6 cm.
    pub fn table(&mut self, name: &str, [x, y]: [f64; 2], [w, d]: [f64; 2], height: f64) {
        self.block(name, [x, y, height - 0.04], [x + w, y + d, height]);
        self.legs(name, [x, y], [w, d], 0.06, [0.0, height - 0.04]);
    }

    fn legs(&mut self, name: &str, [x, y]: [f64; 2], [w, d]: [f64; 2], leg: f64, [low, high]: [f64; 2]) {
        for (dx, dy) in [(0.0, 0.0), (w - leg, 0.0), (0.0, d - leg), (w - leg, d - leg)] {
            let (a, b) = (x + dx, y + dy);
            self.block(&format!("{name}-leg"), [a, b, low], [a + leg, b + leg, high]);
        }
    }

    /// A chair, 0.46 m square, its seat at 0.46 m.
    pub fn chair(&mut self, name: &str, [x, y]: [f64; 2], back: Back) {
        let side = 0.46;
        self.block(name, [x, y, 0.42], [x + side, y + side, 0.46]);
        self.legs(name, [x, y], [side, side], 0.05, [0.0, 0.42]);
        self.backrest(name, [x, y], [side, side], 0.05, back, [0.46, 0.95]);
    }

    fn backrest(
        &mut self,
        name: &str,
        [x, y]: [f64; 2],
        [w, d]: [f64; 2],
        thick: f64,
        back: Back,
        [low, high]: [f64; 2],
    ) {
        let (a, b) = match back {
            Back::West => ([x, y], [x + thick, y + d]),
            Back::East => ([x + w - thick, y], [x + w, y + d]),
            Back::South => ([x, y], [x + w, y + thick]),
            Back::North => ([x, y + d - thick], [x + w, y + d]),
        };
        self.block(&format!("{name}-back"), [a[0], a[1], low], [b[0], b[1], high]);
    }

    /// An open shelf that stands with its back, a board of 4 cm, on the side `back`: two sides and boards at the given
    /// heights (their upper faces).
    pub fn shelf(&mut self, name: &str, low: [f64; 2], size: [f64; 2], height: f64, back: Back, boards: &[f64]) {
        let ([x, y], [w, d]) = (low, size);
        let thick = 0.04;
        self.backrest(name, low, size, thick, back, [0.0, height]);
        let sides = match back {
            Back::West | Back::East => [([x, y], [x + w, y + thick]), ([x, y + d - thick], [x + w, y + d])],
            Back::South | Back::North => [([x, y], [x + thick, y + d]), ([x + w - thick, y], [x + w, y + d])],
        };
        for (a, b) in sides {
            self.block(&format!("{name}-side"), [a[0], a[1], 0.0], [b[0], b[1], height]);
        }
        for &top in boards {
            self.block(&format!("{name}-board"), [x, y, top - thick], [x + w, y + d, top]);
        }
    }

    /// A sofa: seat, backrest, two arms, on the floor.
    pub fn sofa(&mut self, name: &str, low: [f64; 2], size: [f64; 2], back: Back) {
        let ([x, y], [w, d]) = (low, size);
        self.block(name, [x, y, 0.0], [x + w, y + d, 0.42]);
        self.backrest(name, low, size, 0.22, back, [0.42, 0.85]);
        let arms = match back {
            Back::West | Back::East => [([x, y], [x + w, y + 0.2]), ([x, y + d - 0.2], [x + w, y + d])],
            Back::South | Back::North => [([x, y], [x + 0.2, y + d]), ([x + w - 0.2, y], [x + w, y + d])],
        };
        for (a, b) in arms {
            self.block(&format!("{name}-arm"), [a[0], a[1], 0.42], [b[0], b[1], 0.62]);
        }
    }

    /// A bed with a headboard on the side `back` and a pillow before it.
    pub fn bed(&mut self, name: &str, low: [f64; 2], size: [f64; 2], back: Back) {
        let ([x, y], [w, d]) = (low, size);
        self.block(name, [x, y, 0.0], [x + w, y + d, 0.45]);
        self.backrest(name, low, size, 0.08, back, [0.45, 0.95]);
        let (a, b) = match back {
            Back::West => ([x + 0.08, y], [x + 0.45, y + d]),
            Back::East => ([x + w - 0.45, y], [x + w - 0.08, y + d]),
            Back::South => ([x, y + 0.08], [x + w, y + 0.45]),
            Back::North => ([x, y + d - 0.45], [x + w, y + d - 0.08]),
        };
        self.block(&format!("{name}-pillow"), [a[0], a[1], 0.45], [b[0], b[1], 0.57]);
    }

    /// Something round and upright: a vase, a pot, a bottle, standing at `base` around `center`.
    pub fn round(&mut self, name: &str, center: [f64; 2], radius: f64, base: f64, height: f64) {
        self.add(Solid::cylinder(name, 2, center, radius, (base, base + height), 8));
    }

    /// A stool or a small round table: a foot, a pole and a round top.
    pub fn round_table(&mut self, name: &str, center: [f64; 2], radius: f64, height: f64) {
        self.round(&format!("{name}-foot"), center, radius * 0.6, 0.0, 0.04);
        self.round(&format!("{name}-pole"), center, 0.05, 0.04, height - 0.08);
        self.add(Solid::cylinder(name, 2, center, radius, (height - 0.04, height), 12));
    }

    /// A lamp that hangs from the ceiling on a rod: the shade's lower edge is at `low`.
    pub fn hanging_lamp(&mut self, name: &str, [x, y]: [f64; 2], low: f64, ceiling: f64) {
        self.round(&format!("{name}-rod"), [x, y], 0.04, low + 0.2, ceiling - low - 0.2);
        self.round(name, [x, y], 0.2, low, 0.2);
    }
}
