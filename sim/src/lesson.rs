//! Stops of a robot that learns landmarks: in front of every poster, and on request every door and
//! window, at several distances and angles, camera aimed at it.

use map::pose2::Pose2;
use nalgebra::{Point2, Point3};
use rand::RngExt;
use serde::{Deserialize, Serialize};

use crate::building::{Building, LandmarkKind, LandmarkTruth};
use crate::drive::Step;
use crate::gaze::aim;
use crate::gaze::mounting;
use crate::seed;

/// Most stops per landmark.
pub const MAX_VIEWS: usize = 500;
/// Most draws of a stop.
const TRIES: usize = 200;

/// Viewpoints of each landmark.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LessonParams {
    /// Seed of the viewpoints.
    pub seed: u64,
    /// Stops per landmark, at most [`MAX_VIEWS`].
    pub views: usize,
    /// Doors and windows are learnt, too.
    pub fittings: bool,
    /// Nearest and furthest distance from the poster's centre.
    pub distance_m: [f64; 2],
    /// Most oblique view to either side, below 1.5 rad.
    pub max_view_angle_rad: f64,
    /// Distance kept from walls.
    pub clearance_m: f64,
    /// Height of the camera.
    pub camera_height_m: f64,
    /// Largest error of aiming to either side, radians.
    pub aim_error_rad: f64,
}

impl Default for LessonParams {
    fn default() -> Self {
        Self {
            seed: 0,
            views: 12,
            fittings: false,
            distance_m: [1.3, 4.0],
            max_view_angle_rad: 1.05,
            clearance_m: 0.35,
            camera_height_m: 1.2,
            aim_error_rad: 0.12,
        }
    }
}

/// A stop with the landmark to be learnt there.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// Name of the landmark.
    pub landmark: String,
    /// The step of the robot at the stop: odometry equals truth, as for a robot that a laser
    /// localises.
    pub step: Step,
}

/// Stops before all posters (and doors and windows), in the building's order; fewer if there is no
/// room. Views go from one side to the other, one per equal share of the angles.
pub fn stops(building: &Building, params: &LessonParams) -> Vec<Stop> {
    let mut all = vec![];
    let learnt = building.landmarks().iter().filter(|l| match l.kind {
        LandmarkKind::Poster => true,
        LandmarkKind::Door | LandmarkKind::Window => params.fittings,
        _ => false,
    });
    for (number, landmark) in learnt.enumerate() {
        let mut rng = seed::stream(params.seed ^ number as u64, 70);
        let views = params.views.min(MAX_VIEWS);
        for view in 0..views {
            let mut draw = || {
                let share = (view as f64 + rng.random_range(0.0..1.0)) / views as f64;
                let wobble = [0, 1].map(|_| params.aim_error_rad * rng.random_range(-1.0..1.0));
                (share, rng.random_range(0.0..1.0), wobble)
            };
            let robot = (0..TRIES).find_map(|_| {
                let (share, far, wobble) = draw();
                Some((viewpoint(building, landmark, params, [share, far])?, wobble))
            });
            if let Some((robot, wobble)) = robot {
                all.push(stop(landmark, robot, params, wobble, all.len() as u64));
            }
        }
    }
    all
}

/// The point of the floor at a share (0 to 1) of the angles and of the distances; `None` if the
/// robot does not fit.
fn viewpoint(
    building: &Building,
    l: &LandmarkTruth,
    p: &LessonParams,
    [share, far]: [f64; 2],
) -> Option<Point2<f64>> {
    let angle = (2.0 * share - 1.0) * p.max_view_angle_rad.clamp(0.0, 1.5);
    let distance = p.distance_m[0] + far * (p.distance_m[1] - p.distance_m[0]);
    let place = l.map_from_landmark * Point3::new(distance * angle.cos(), distance * angle.sin(), 0.0);
    let face = l.map_from_landmark * Point3::new(0.03, 0.0, 0.0);
    let fits =
        building.in_sight(&place.xy(), &face.xy()) && building.clearance_m(&place.xy()) >= p.clearance_m;
    fits.then(|| place.xy())
}

fn stop(l: &LandmarkTruth, place: Point2<f64>, p: &LessonParams, wobble: [f64; 2], index: u64) -> Stop {
    // The robot faces along the wall, as on a drive.
    let normal = l.map_from_landmark.rotation * nalgebra::Vector3::x();
    let map_from_robot = Pose2::new(place.x, place.y, normal.y.atan2(normal.x) + std::f64::consts::FRAC_PI_2);
    let (pan, tilt) = aim(&map_from_robot, p.camera_height_m, l);
    let (pan_rad, tilt_rad) = (pan + wobble[0], tilt + wobble[1]);
    let step = Step {
        index,
        time_s: index as f64,
        map_from_robot,
        odom_from_robot: map_from_robot,
        robot_from_camera: mounting(pan_rad, tilt_rad, p.camera_height_m),
        pan_rad,
        tilt_rad,
        sweep_radps: 0.0,
        target: Some(l.name.clone()),
    };
    Stop { landmark: l.name.clone(), step }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{Robot, RobotParams};
    use crate::truth::ViewState;
    use std::sync::Arc;

    #[test]
    fn every_poster_is_wholly_visible_from_many_viewpoints() {
        let building = Arc::new(Building::corridor(4));
        let params = LessonParams { views: 4, ..LessonParams::default() };
        let stops = stops(&building, &params);
        let mut robot = Robot::new(building.clone(), &RobotParams::default());
        for poster in building.posters() {
            let views: Vec<_> = stops
                .iter()
                .filter(|s| s.landmark == poster.name)
                .filter_map(|s| robot.look(&s.step).frame.truth.landmark(&s.landmark).cloned())
                .filter(|v| v.state == ViewState::Full)
                .collect();
            assert!(views.len() >= 3, "{} is visible {} times", poster.name, views.len());
            assert!(views.iter().all(|v| v.view_angle_rad < 1.2 && v.min_side_px() > 25.0));
        }
    }

    #[test]
    fn without_room_there_is_no_stop() {
        let building = Building::corridor(4);
        let cramped = LessonParams { clearance_m: 3.0, ..LessonParams::default() };
        assert!(stops(&building, &cramped).is_empty());
    }

    #[test]
    fn the_number_of_views_is_clamped() {
        let building = Building::corridor(4);
        let one = |views| {
            let p = LessonParams {
                views,
                max_view_angle_rad: 0.5,
                distance_m: [1.0, 1.5],
                ..LessonParams::default()
            };
            stops(&building, &p).iter().filter(|s| s.landmark == "poster-0").count()
        };
        assert_eq!(one(MAX_VIEWS), MAX_VIEWS);
        assert_eq!(one(MAX_VIEWS + 1), MAX_VIEWS);
    }
}
