//! Nearest landmarks in, each verified by template alignment out.

pub mod gradient_similarity;
pub mod content;
pub mod mismatch;
pub(crate) mod icon_alignment;
pub(crate) mod short_list;
