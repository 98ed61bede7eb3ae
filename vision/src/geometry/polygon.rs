//! Convex polygons.
