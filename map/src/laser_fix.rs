//! Localisation in a finished map of walls by one scan (method 17.4, 17.5, the map frozen). In:
//! walls, a scan, a prior pose. Out: the pose with its covariance, large where the walls do not
//! determine it (along a bare corridor), or a refusal. The prior only starts and gates the search;
//! it is not part of the result, so both can be fused.

mod params;
mod index;
mod fix;
mod fit;
mod search;
mod global;

pub use fix::{LaserFix, LaserRefusal, WallPart};
pub use global::{GlobalRefusal, MAX_POSES, MAX_POSITIONS, global_laser_fixes};
pub use index::{MAX_WALLS, WallIndex};
pub use params::LaserFixParams;
pub use search::laser_fix;

#[cfg(test)]
mod tests;
