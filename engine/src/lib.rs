//! The engine. In: frames, odometry and scans of robots. Out: answers and poses. It knows no
//! transport, store or HTTP: one slot a camera, workers, the snapshots that they read, and the
//! state of each robot (`motion`).
//!
//! `frame` is the way of a frame, `observers` is what watches frames and motion, `supervision` is
//! what watches threads. Imports go one way:
//! `observers -> frame -> motion -> snapshot, supervision`. The workers give answers to an
//! implementation of `Publish`. Only the journal of a mapping is written to disk.

mod frame;
mod inputs;
mod observers;
mod supervision;

pub use frame::{
    ambiguous_observations, analysis, answer, context, decode, fixes, guided, intake, landmark_checks,
    relocalise, slots, workers,
};
pub use observers::{
    Observers, answer_records, cameras, findings, frame_tap, frame_times, kept_frames, live, mapping_tap,
    prior_check, robot_activity, unknown_robots,
};
pub use supervision::{heartbeats, panics, threads, vitals};

pub mod dominant;
pub mod epochs;
pub mod gaze;
pub mod histogram;
pub mod limits;
pub mod localise;
pub mod mapping;
pub mod motion;
pub mod picture;
pub mod quotas;
pub mod replay;
pub mod scan_job;
#[cfg(any(test, feature = "scene"))]
pub mod scene;
pub mod snapshot;
pub mod survey;
