//! Principal components of icons (method 7).
