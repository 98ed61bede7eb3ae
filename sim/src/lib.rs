//! A rendered building with robots and exact truth: what a camera, a laser and wheel encoders would
//! measure in a corridor with posters, and where everything really was. For the demo, the tests and
//! the evaluation.
//!
//! Pure: no file, clock, socket or thread. The same seeds give the same bytes.
//!
//! ```
//! use std::sync::Arc;
//! use sim::building::Building;
//! use sim::drive::DriveParams;
//! use sim::robot::{Robot, RobotParams};
//!
//! let building = Arc::new(Building::corridor(7));
//! // A lesson: stops before every poster, from several viewpoints.
//! let mut teacher = Robot::new(building.clone(), &RobotParams::default());
//! let stops = sim::lesson::stops(&building, &sim::lesson::LessonParams { views: 2, ..Default::default() });
//! let readings = teacher.look(&stops[0].step);
//! let view = readings.frame.truth.landmark(&stops[0].landmark).expect("the stop shows its landmark");
//! assert!(view.min_side_px() > 40.0); // view.corners_px are TL, TR, BR, BL
//!
//! // A drive: true pose, odometry, picture, scan, five times a second. Other seeds and starts: other robots.
//! let params = RobotParams { drive: DriveParams { seed: 3, start_m: 4.0, ..Default::default() }, ..Default::default() };
//! for readings in Robot::new(building, &params).take(3) {
//!     let camera = readings.step.map_from_robot.to_isometry3() * readings.step.robot_from_camera;
//!     assert_eq!(camera, readings.frame.truth.map_from_camera);
//!     assert_eq!((readings.frame.image.width(), readings.scan.ranges_m().len()), (640, 361));
//! }
//! ```
//!
//! Coordinate frames and corner order are those of method 0.2; surfaces and landmarks have x
//! outward, y the viewer's right, z up. Modules are in reading order: textures, building, camera
//! and rendering, other sensors, robots, sets.

pub(crate) mod seed;
pub mod font;
pub mod texture;
pub(crate) mod canvas;
pub mod posters;
pub mod surfaces;
pub mod lookalikes;
pub(crate) mod lighting;
pub(crate) mod wall;
pub mod building;
pub(crate) mod builder;
pub mod corridor;
pub mod framing;
pub mod camera;
pub(crate) mod raster;
pub mod truth;
pub mod sensor;
pub mod render;
pub mod exhibit;
pub mod laser;
pub mod odometry;
pub mod gaze;
pub mod drive;
pub mod steered;
pub mod robot;
pub mod lesson;
pub mod office;
pub mod export;
pub mod views;
pub mod scenes;

#[cfg(test)]
mod render_tests;
