//! A rendered building with robots and exact truth.
