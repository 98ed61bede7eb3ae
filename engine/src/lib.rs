//! Frames in, answers out, away from any transport, file and HTTP: one slot per camera, workers, the snapshot of the map that
//! they read, and what is known of every robot (`motion`).
//!
//! A frame walks `intake -> slots -> workers -> decode -> frame_analysis -> guided -> judging -> frame_answer -> motion`; its answer goes to whoever gave the
//! workers an outlet. Nothing here waits for a disk or a network.

pub mod snapshot;
pub mod decode;
pub mod slots;
pub mod panics;
pub mod intake;
pub mod guided;
pub mod judging;
pub mod limits;
pub mod live;
pub mod scan_job;
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
pub mod fixes;
pub mod frame_analysis;
pub mod frame_answer;
pub mod frame_context;
pub mod frame_tap;
pub mod vitals;
pub mod workers;
#[cfg(any(test, feature = "scene"))]
pub mod scene;
