//! Whole files: written, read, damaged, and read by programs of others.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "the crate opens no files and starts no programs; its tests do"
)]

mod damage;
mod drive;
mod packed;
mod python;
mod round_trip;
