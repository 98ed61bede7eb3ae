//! The whole method on one page.
