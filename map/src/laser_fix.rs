//! Where a robot is in a finished map of walls, by one scan (method 17.4, 17.5, the map frozen). In: walls, a scan, a
//! prior. Out: the pose with its covariance, wide where the walls say nothing, as along a bare corridor; or why there is
//! none. The prior only says where to look and what to refuse: it is not part of the answer, so fusing both is right.

mod params;
mod index;
mod fix;
mod fit;
mod search;

pub use fix::{LaserFix, LaserRefusal, WallPart};
pub use index::{MAX_WALLS, WallIndex};
pub use params::LaserFixParams;
pub use search::laser_fix;

#[cfg(test)]
mod tests;
