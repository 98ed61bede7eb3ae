//! What watches frames: counts, pages, stored answers, gatherings.

pub mod answer_records;
pub mod cameras;
pub mod findings;
pub mod frame_tap;
pub mod frame_times;
pub mod kept_frames;
pub mod live;
pub mod prior_check;
pub mod robot_activity;
pub mod unknown_robots;
