//! Plane homographies (method 4).
