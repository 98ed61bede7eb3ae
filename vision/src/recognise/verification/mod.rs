//! Nearest landmarks in, what template alignment says of each out.

pub mod gradient_similarity;
pub mod content;
pub mod mismatch;
pub(crate) mod icon_alignment;
pub(crate) mod short_list;
