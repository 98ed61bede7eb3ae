//! Places met again. In: the key poses and how surely they are known relative to each other. Out: edges between poses
//! that the path has not joined. A loop is taken only if the scans agree, nothing is seen through, no other place in the
//! window fits as well, and, from far off, if several loops in a row say the same.

mod params;
mod reach;
mod verification;
mod closures;

pub(super) use closures::LoopCloser;
pub use closures::LoopClosure;
pub use params::LoopParams;
