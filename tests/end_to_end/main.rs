//! End-to-end claims.
