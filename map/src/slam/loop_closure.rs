//! Loop closure: constraints between keyframes far apart on the path. In: keyframes with relative
//! covariances. Out: constraints. A loop is closed only if the scans match, no beam passes through
//! a wall, no other pose in the window fits as well, and, with a large uncertainty, if several
//! loops agree.

mod params;
mod reach;
mod verification;
mod closures;

pub(super) use closures::LoopCloser;
pub use closures::LoopClosure;
pub use params::LoopParams;
