//! Views of things a robot drives past, followed from frame to frame into tracks: what lies where the track lies, by its
//! place on the wall or else in the picture just before, and looks like it. Of each track the views that say something
//! new are to be kept (`vision::learn::thinning`).
//!
//! In: the quads of a frame with icon, place and what is known of their identity. Out: for each, whether to keep it and
//! in which track. Nothing is joined in doubt: a wrong view would poison the model learnt from the track, a thing that
//! is found twice is only a choice for a person.

mod params;
mod observation;
mod track;
mod tracker;

pub use observation::{Identity, QuadObservation, TrackOutcome};
pub use params::GatherParams;
pub use track::{MAX_TRACK_VIEWS, StoredTrack, Track};
pub use tracker::{MAX_TRACKS, ViewTracker};

#[cfg(test)]
mod tests;
