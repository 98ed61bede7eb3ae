//! Bounds that several parts of the engine share.

/// Robots with a state in the engine; the number of registered robots bounds it first.
pub const MAX_ROBOTS: usize = 10_000;
/// Largest scan, in bytes: [`map::laser::MAX_BEAMS`] ranges and their header.
pub const MAX_SCAN_BYTES: usize = map::laser::MAX_BEAMS * 5 + 1024;
