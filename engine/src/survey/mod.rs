//! The map of a building from drives: walls, objects and camera in one estimate (method 29.4).
//!
//! ```text
//! follow: drive (scans' odometry, frames) -> sightings (quads of frames) -> objects (quads of one)
//! identities: objects of a later drive that are those of earlier ones
//! building: walls, objects and camera of all drives -> landmarks (objects that pass gates, and look
//!     like nothing else)
//! ```
//!
//! In: drives, each with its finished laser map. Out: walls, objects with places and views, the
//! camera as found. Commands read a drive of a file; the server's mappings make it of messages.

mod parallel;
mod drive;
mod sightings;
mod objects;
mod surveyed;
mod gates;
mod error;
mod follow;
mod solution;
mod look_alikes;
mod identities;
mod building;

pub use building::surveyed;
pub use drive::{Drive, DriveBounds, DriveFrame, DriveReading, OF_FILE, ScanStamp, WHILE_DRIVING};
pub use error::SurveyError;
pub use objects::ObjectView;
pub use parallel::Effort;
pub use sightings::picture;
pub use surveyed::{SurveyedBuilding, SurveyedObject};
