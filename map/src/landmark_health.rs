//! Moved, changed, gone: what the map says should be seen, against what is seen (issue of landmarks that do not stay).
//!
//! In: sightings with the pose that the robot has without them, and what should have been in the picture. Out: which
//! landmarks to flag, to quarantine and to trust again. A landmark is only judged by a pose that rests on others, and only
//! quarantined once another has agreed with that pose afterwards: a robot that was carried away must not condemn a room.
//! Moves nothing and forgets nothing by itself: a person decides.

mod params;
mod health;
mod place_check;
mod expected;
mod monitor;

pub use expected::{ExpectedLandmark, MountedCamera, expected};
pub use health::{Finding, HealthChange, LandmarkHealth};
pub use monitor::{HealthMonitor, MAX_WATCHED};
pub use params::HealthParams;
pub use place_check::{PlaceCheck, PlaceVerdict, check_place, drop_unreliable};

#[cfg(test)]
mod tests;
