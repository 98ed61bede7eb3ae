//! The HTTP interface: the bodies of requests and answers as JSON, one file for each resource.
//!
//! The server answers with these types and the client reads them; each is declared once. Lengths
//! are metres, angles radians, counter-clockwise from the map's x axis, times milliseconds or
//! nanoseconds since the Unix epoch; the last part of a field's name is its unit. Covariances of
//! poses are over (x, y, theta), row-major, in m and rad.
//!
//! A body of a request refuses unknown fields. A body that is only answered ignores them, so that a
//! newer server can say more. With the feature `openapi` every type has a schema; the server makes
//! its OpenAPI document of them.

#[cfg(feature = "openapi")]
pub mod arrays;
pub mod audit;
pub mod backups;
pub mod cameras;
pub mod bundles;
pub mod drafts;
mod events;
pub mod failed_gates;
pub mod gathering;
pub mod health;
pub mod history;
pub mod landmark_models;
pub mod landmarks;
pub mod learning;
pub mod live;
pub mod localise;
pub mod mapping;
pub mod maps;
pub mod modalities;
pub mod page;
mod patch;
pub mod problem;
#[cfg(feature = "openapi")]
pub mod recognise;
pub mod reference_runs;
pub mod relocalisation;
pub mod robot_activity;
pub mod robot_certificates;
pub mod robots;
pub mod ros2;
pub mod servers;
pub mod stored_answers;
pub mod tokens;
pub mod topology;
pub mod underlay;
pub mod views;
pub mod visibility;
pub mod visibility_settings;
pub mod walls;

pub use audit::*;
pub use backups::*;
pub use bundles::*;
pub use cameras::*;
pub use drafts::*;
pub use events::*;
pub use failed_gates::*;
pub use gathering::*;
pub use health::*;
pub use history::*;
pub use landmark_models::*;
pub use landmarks::*;
pub use learning::*;
pub use live::*;
pub use localise::*;
pub use mapping::*;
pub use maps::*;
pub use modalities::*;
pub use page::*;
pub use problem::*;
#[cfg(feature = "openapi")]
pub use recognise::*;
pub use reference_runs::*;
pub use relocalisation::*;
pub use robot_activity::*;
pub use robot_certificates::*;
pub use robots::*;
pub use ros2::*;
pub use servers::*;
pub use stored_answers::*;
pub use tokens::*;
pub use topology::*;
pub use underlay::*;
pub use views::*;
pub use visibility::*;
pub use visibility_settings::*;
pub use walls::*;
