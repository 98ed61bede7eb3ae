//! The engine. In: frames, odometry and scans of robots. Out: answers and poses. It knows no transport, store or HTTP: one slot a
//! camera, workers, the snapshots that they read, and the state of each robot (`motion`).
//!
//! The way of a frame: `intake -> slots -> workers -> decode -> frame_analysis -> guided -> landmark_checks -> frame_answer ->
//! motion`. The workers give answers to an implementation of `Publish`. Only the journal of a mapping is written to disk.

pub mod snapshot;
pub mod decode;
pub mod slots;
pub mod quotas;
mod panic_text;
pub mod panics;
pub mod threads;
pub mod intake;
pub mod guided;
pub mod landmark_checks;
pub mod limits;
pub mod robot_activity;
pub mod unknown_robots;
pub mod live;
pub mod scan_job;
pub mod motion;
pub mod ambiguous_observations;
pub mod relocalise;
pub mod mapping;
pub mod cameras;
pub mod picture;
pub mod pose_refusal;
pub mod dominant;
pub mod epochs;
pub mod gaze;
pub mod findings;
pub mod prior_check;
pub mod answer_records;
pub mod kept_frames;
pub mod replay;
pub mod fixes;
pub mod localise;
pub mod frame_analysis;
pub mod frame_answer;
pub mod frame_context;
pub mod frame_tap;
pub mod histogram;
pub mod frame_times;
pub mod search_policy;
pub mod heartbeats;
pub mod vitals;
pub mod workers;
#[cfg(any(test, feature = "scene"))]
pub mod scene;
