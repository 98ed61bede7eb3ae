//! Checked conversions between the wire and the types of `vision` and `map`. In: decoded messages.
//! Out: values that are finite, in range and bounded, or a [`Rejection`](crate::Rejection) that
//! names the field. Doubtful input is refused here, once; later stages do not check again. Clock,
//! robots and maps are checked by the server.

pub mod frame;
pub mod gaze;
pub mod geometry;
pub mod image_header;
pub mod localise;
pub mod motion;
pub mod result;
mod sample_bits;

pub use frame::quads::{self, CheckedPatch, CheckedQuad};
pub use frame::{CheckedFrame, EncodedImage, Encoding, Pixels};
pub use gaze::CheckedGaze;
pub use image_header::image_header;
pub use localise::CheckedLocalise;
pub use motion::{CheckedOdometry, CheckedScan};
pub use sample_bits::sample_bits;
