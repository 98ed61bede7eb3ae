//! Validation gates (method 9).
