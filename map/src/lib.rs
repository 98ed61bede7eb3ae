//! The metric side: laser segments, landmark placement, localisation and fusion (method 11, 13.6, 15, 17).
//!
//! Pure: no async runtime, file, socket, clock or thread. Map frame: x, y on the floor, z up, metres, radians.
