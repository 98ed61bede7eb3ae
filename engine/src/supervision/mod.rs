//! Threads and the parts of the server: their priorities, their panics, and whether they run and
//! get on.

pub mod heartbeats;
pub mod panics;
pub mod threads;
pub mod vitals;
