//! Checked conversions between the wire and the types of `vision` and `map`. In: messages as decoded. Out: values
//! that are finite, in range and bounded, or a [`Rejection`](crate::Rejection) that names the field. What is unsure
//! is refused here, once; later stages do not check again. Deliberately knows no clock, robot list or map: that is
//! the server's part.

pub mod frame;
pub mod gaze;
pub mod geometry;
pub mod motion;
pub mod result;

pub use frame::{CheckedFrame, Encoding};
pub use gaze::CheckedGaze;
pub use motion::{CheckedOdometry, CheckedScan};
