//! A robot that takes its time: it has a body with limits on speed and acceleration, its own clock, and noise, and follows ways
//! in a corridor that is free (thesis 4.2.1.2 and 7.2, item 3). No bus, and no time but its own: what it does is computed.
//!
//! It is steered as mobile robots are: towards a point ahead on its way (Coulter, *Implementation of the Pure Pursuit Path
//! Tracking Algorithm*, 1992), and only at speeds from which it can still come to stand within what it knows to be free (Fox,
//! Burgard and Thrun, *The Dynamic Window Approach to Collision Avoidance*, 1997).

mod body;
mod corridor;
mod robot;

pub use body::{AXES, Axis, Body, Limits, Rates, Unusable};
pub use corridor::Corridor;
pub use robot::{Errand, Noise, Ride, Robot};
