//! The Waymark server: store, bus, engine and HTTP face around the pure crates `vision` and `map`.
//!
//! The way of a frame: `bus -> engine -> vision -> map -> bus`; that of a lesson:
//! `http -> store -> jobs -> store -> engine`. zenoh appears only in `bus` and `ros2`, sqlx only in
//! `store`, axum only in `http`.

pub mod config;
mod accepting;
mod identity;
mod label;
mod private_file;
mod fleet;
pub mod audit_files;
mod events;
pub mod backup;
pub mod bus;
pub mod ros2;
mod store;
mod bundle;
mod publication;
mod failed_gates;
mod learning_rules;
mod recording_answers;
mod localise_body;
mod jobs;
mod live_probes;
mod metrics;
pub mod gather;
pub mod calibrating;
mod http;
mod running;
mod start_error;
mod serving;
mod server;

pub use running::RunningServer;
pub use server::Server;
pub use start_error::StartError;
