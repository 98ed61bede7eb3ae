//! A corridor, drives there and back of one robot, and what was to be seen.

use crate::evaluate::experiment::mixed;
use anyhow::Context as _;
use cli::survey::{DriveLog, simulated_drive};
use map::pose2::Pose2;
use nalgebra::Isometry3;
use sim::{
    building::{Building, LandmarkTruth},
    corridor::CorridorParams,
    drive::DriveParams,
    gaze::GazeParams,
    posters,
    robot::SensorReadings,
    truth::{LandmarkView, ViewState},
};
use std::{collections::BTreeSet, sync::Arc};

/// A frame shows a poster if it is this large and no more oblique.
const MIN_SIDE_PX: f64 = 30.0;
const MAX_ANGLE_RAD: f64 = 60.0 * std::f64::consts::PI / 180.0;

/// What is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Course {
    pub(super) length_m: f64,
    pub(super) posters: usize,
    pub(super) rate_hz: f64,
    /// The camera points ahead; else a head turns it to posters.
    pub(super) ahead: bool,
    pub(super) drives: usize,
    pub(super) seed: u64,
}

/// Drives there and back.
pub(super) struct Driven {
    pub(super) building: Arc<Building>,
    pub(super) logs: Vec<DriveLog>,
    /// True mounting of the first frame.
    pub(super) mounting: Isometry3<f64>,
    /// True poses of the frames of all drives.
    pub(super) path: Vec<Pose2>,
    /// Posters that some frame shows in full.
    pub(super) shown: BTreeSet<String>,
    first_poster: u64,
}

impl Driven {
    /// Width and height of each border of an object, metres, the outer one first.
    pub(super) fn borders(&self, truth: &LandmarkTruth) -> Vec<[f64; 2]> {
        let number = truth.name.strip_prefix("poster-").and_then(|number| number.parse::<u64>().ok());
        let insets =
            number.map_or(vec![0.0], |number| posters::borders(self.first_poster.wrapping_add(number)));
        let border =
            |inset: f64| [truth.width_m, truth.height_m].map(|side| side - 2.0 * inset * truth.width_m);
        insets.into_iter().map(border).collect()
    }
}

pub(super) fn drive(course: &Course) -> anyhow::Result<Driven> {
    let corridor = CorridorParams {
        length_m: course.length_m,
        posters: course.posters,
        first_poster: mixed(&[course.seed, 21]),
        ..CorridorParams::default()
    };
    let building = Arc::new(Building::corridor_with(&corridor, course.seed));
    let params = DriveParams {
        legs: 2,
        rate_hz: course.rate_hz,
        gaze: GazeParams { look_at_posters: !course.ahead, ..GazeParams::default() },
        ..DriveParams::default()
    };
    let (mut shown, mut path) = (BTreeSet::new(), Vec::new());
    let (mut logs, mut mounting) = (Vec::new(), None);
    let is_shown = |view: &&LandmarkView| {
        view.state == ViewState::Full
            && view.min_side_px() >= MIN_SIDE_PX
            && view.view_angle_rad <= MAX_ANGLE_RAD
    };
    let robot_seed = mixed(&[course.seed, 22]);
    for number in 0..course.drives as u64 {
        // Of the first, that of its robot.
        let seed = if number == 0 { robot_seed } else { mixed(&[course.seed, 22, number]) };
        let drive = DriveParams { seed, ..params.clone() };
        let driven = simulated_drive(&building, drive, robot_seed, |readings: &SensorReadings| {
            path.push(readings.step.map_from_robot);
            let views = readings.frame.truth.landmarks.iter().filter(is_shown);
            shown.extend(views.map(|view| view.name.clone()));
        })?;
        mounting = mounting.or(Some(driven.mounting));
        logs.push(driven.log);
    }
    let posters: BTreeSet<&str> = building.posters().map(|poster| poster.name.as_str()).collect();
    shown.retain(|name| posters.contains(name.as_str()));
    let mounting = mounting.context("no drive")?;
    Ok(Driven { building, logs, mounting, path, shown, first_poster: corridor.first_poster })
}
