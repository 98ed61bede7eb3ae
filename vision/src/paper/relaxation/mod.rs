//! The grouping of the paper: pairs by similarity, two relaxations, sets of three sides (method 2
//! to 3.5). Not the default.

pub(crate) mod profiles;
pub mod labelling;
pub mod similarity;
pub mod grouping;
pub mod three_sided;
pub mod paired_quads;
