//! The metric side: laser segments, landmark placement, localisation and fusion (method 11, 13.6,
//! 15, 17).
//!
//! Pure: no async runtime, file, socket, clock or thread (`map/clippy.toml` enforces it). Map
//! frame: x, y on the floor, z up, metres, radians. Modules are in reading order.

pub mod check;
mod digest;
pub mod gate;
pub mod pose2;
mod pose_cell;
pub mod map_links;
pub mod extrinsics;
pub mod laser;
pub mod segments;
pub mod lines;
pub mod walls;
pub mod place;
pub mod placement;
pub mod visibility;
pub mod localise;
pub mod modality_stats;
pub mod fuse;
pub mod gaze;
pub mod topology;
pub mod slam;
pub mod joint;
pub mod laser_fix;
pub mod landmark_health;
pub mod tracks;
pub mod relocalise;
pub mod guided;
