//! From views of one landmark to its model (method 7 to 9).

pub mod random;
pub(crate) mod texture;
pub mod synthesis;
pub mod pca;
pub mod threshold;
pub mod gates;
pub mod thinning;
pub mod exemplar;
pub mod model;
mod fitting;
mod lesson;
mod stored;
