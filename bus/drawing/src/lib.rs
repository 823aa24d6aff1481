//! What apps draw, and the keys that they take: Drawable and Keyhook of the thesis (4.4.1, Listings 3 and 4) as messages.
//!
//! | module | one idea |
//! |---|---|
//! | [`drawing`] | a drawing: primitives with colours, in a frame, for a time |
//! | [`keys`] | the keys that an app declares, and one that was pressed |
//! | [`keyboard`] | whose a key is that two apps declare |
//! | [`limits`] | what both have to keep to |
//! | [`variables`] | the variables that these travel under |
//!
//! No bus is in sight here, and no map: an app that only draws needs neither voxels nor scans. `elk-bus` offers this to apps.

// `#[payload]` names elk-bus, which stands above; here its part is played by elk-proto.
extern crate elk_proto as elk_bus;

pub mod drawing;
pub mod keyboard;
pub mod keys;
pub mod limits;
pub mod variables;

pub use drawing::{Colour, Colours, Drawing, Frame, Primitive};
pub use keyboard::{Declared, Keyboard};
pub use keys::{KeyPress, KeyTable, KeyUse};
