//! Frames in, answers out, away from any transport: one slot per camera, workers, and the snapshot they read.

pub mod snapshot;
pub mod decode;
pub mod slots;
pub mod panics;
pub mod intake;
pub mod guided;
pub mod judging;
pub mod live;
pub mod motion;
pub mod doubles;
pub mod search;
pub mod mapping;
pub mod cameras;
pub mod picture;
pub mod dominant;
pub mod epochs;
pub mod gaze;
pub mod standing;
pub mod verdicts;
pub mod workers;
#[cfg(test)]
pub(crate) mod scene;
