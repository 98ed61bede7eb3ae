//! The threshold tau (method 8).
