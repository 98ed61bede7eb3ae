//! What is of PostgreSQL alone: how a database is opened and checked, and the turn to write.

pub(crate) mod open;
pub(crate) mod schema;
pub(crate) mod turn;
