//! Image lines.
