//! The HTTP face: administrators, teachers and pages. axum appears only here.
//!
//! `/api/v1`, JSON in snake_case, `application/problem+json` errors with a stable `code` and the `field`, lists in
//! pages. Handlers parse, call the store, the jobs or the engine, and shape the answer; they decide nothing.

mod error;
mod extract;
mod guard;
mod health;
mod laser;
mod landmarks;
mod maps;
mod pages;
mod resources;
mod robots;
mod router;
pub(crate) mod listen;

pub(crate) use router::router;

use crate::{config::Config, store::Store};
use std::sync::Arc;
use tokio::sync::watch;

/// What every handler shares.
#[derive(Debug)]
pub(crate) struct App {
    pub(crate) config: Arc<Config>,
    pub(crate) store: Store,
    /// Becomes true when the server stops; ends event streams.
    pub(crate) stopping: watch::Receiver<bool>,
}

/// The state of the router.
pub(crate) type Shared = Arc<App>;
