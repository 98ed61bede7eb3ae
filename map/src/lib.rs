//! The metric side: laser segments, landmark placement, localisation and fusion (method 11, 13.6, 15, 17).
//!
//! Pure: no async runtime, file, socket, clock or thread. Map frame: x, y on the floor, z up, metres, radians.
//! Modules stand in reading order.

pub mod check;
pub mod pose2;
pub mod mounting;
pub mod gate;
pub mod laser;
pub mod segments;
pub mod place;
pub mod localise;
pub mod lines;
pub mod walls;
