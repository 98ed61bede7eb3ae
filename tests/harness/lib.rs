//! Servers started and scored for the end-to-end tests.
