//! Pixels in, analysis out: edges -> segments -> quads -> icon -> distances -> recognition -> pose;
//! learning.
//!
//! Pure: no async runtime, file, socket, clock or thread. Same input, same output, bit for bit.
//! Modules are listed in reading order; [`pipeline`] calls the stages in order.
//!
//! Conventions (method 0.2): image `u` right, `v` down, pixel centres at integer coordinates;
//! camera frame x right, y down, z forward; landmark frame origin at the rectangle's centre, x =
//! outward normal, y = to the right as seen from the front, z = up. Transforms read `a_from_b`.
//! Units end names.

pub mod random;
pub mod frame;
pub mod geometry;
pub mod params;
pub mod trace;
pub mod detect;
pub mod up;
pub mod icon;
pub mod seen_border;
pub mod recognise;
pub mod paper;
pub mod points;
pub mod model;
pub mod learn;
pub mod pose;
pub mod border;
pub mod camera_calibration;
pub mod pipeline;
