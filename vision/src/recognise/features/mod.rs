//! Icon in, features and the two distances of the paper out (method 5, 6).

pub(crate) mod separable;
pub mod harris;
pub mod descriptor;
pub mod correlation;
pub mod hausdorff;
pub mod signature;
pub mod icon_features;
