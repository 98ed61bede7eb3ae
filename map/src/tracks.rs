//! Tracks: objects that a robot drives past, followed from frame to frame. A quad belongs to a
//! track by its place on the wall, or else by its position in the previous image, and by its
//! appearance. Of each track the views that add something new are stored
//! (`vision::learn::near_duplicates`).
//!
//! In: the quads of a frame with icon, place and identity. Out: for each, whether to store it and
//! in which track. Doubtful quads start a new track: a wrong view would spoil the model learnt from
//! the track, while two tracks of one object cost a person only a choice.

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
