//! The zenoh side: frames, odometry and presence in, answers and events out.
