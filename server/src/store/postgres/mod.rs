//! What is of PostgreSQL alone: how a database is opened, checked and copied, and the turn to
//! write.

pub(crate) mod copies;
pub(crate) mod open;
pub(crate) mod schema;
pub(crate) mod turn;
