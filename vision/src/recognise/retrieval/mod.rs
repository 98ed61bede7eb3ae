//! Readings of a quad in, the nearest landmarks out (method 7.5).

pub mod nearest;
