//! Landmark health: compares observed and expected landmarks with the map, to find landmarks that
//! were moved or removed (docs/method/27-landmark-health.md).
//!
//! In: observations with the robot's pose by other landmarks, and the landmarks that should have
//! been visible. Out: which landmarks to flag, to quarantine and to clear. A landmark is judged
//! only by a pose that rests on others, and quarantined only after another landmark has agreed with
//! that pose: a kidnapped robot must not quarantine landmarks that are in place. Nothing is moved
//! or removed here; a person decides.

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
