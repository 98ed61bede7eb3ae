//! The pan-tilt unit, and an ideal gaze controller on ground-truth poses, which is not `map::gaze`:
//! the camera is aimed at the poster with the best view, at the speed of the unit, otherwise ahead.

use map::extrinsics::pan_tilt;
use map::pose2::{Pose2, wrap_rad};
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::building::{Building, LandmarkTruth};

/// Parameters of the pan-tilt unit and of the choice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GazeParams {
    /// Whether to aim at posters; otherwise the camera points ahead.
    pub look_at_posters: bool,
    /// Height of the camera above the floor, metres.
    pub camera_height_m: f64,
    /// Largest pan to either side, radians.
    pub max_pan_rad: f64,
    /// Largest tilt up or down, radians.
    pub max_tilt_rad: f64,
    /// Speed of pan and tilt, rad/s.
    pub rate_radps: f64,
    /// Nearest and farthest distance of a target, metres.
    pub distance_m: [f64; 2],
    /// Largest angle of view of a target, radians.
    pub max_view_angle_rad: f64,
}

impl Default for GazeParams {
    fn default() -> Self {
        Self {
            look_at_posters: true,
            camera_height_m: 1.2,
            max_pan_rad: 1.7,
            max_tilt_rad: 0.35,
            rate_radps: 1.0,
            distance_m: [0.9, 5.0],
            max_view_angle_rad: 1.15,
        }
    }
}

/// The camera's direction over time.
#[derive(Debug, Clone)]
pub(crate) struct Gaze {
    p: GazeParams,
    pan_rad: f64,
    tilt_rad: f64,
    target: Option<String>,
}

impl Gaze {
    pub(crate) fn new(p: GazeParams) -> Self {
        Self { p, pan_rad: 0.0, tilt_rad: 0.0, target: None }
    }

    pub(crate) fn pan_rad(&self) -> f64 {
        self.pan_rad
    }

    pub(crate) fn tilt_rad(&self) -> f64 {
        self.tilt_rad
    }

    pub(crate) fn robot_from_camera(&self) -> Isometry3<f64> {
        mounting(self.pan_rad, self.tilt_rad, self.p.camera_height_m)
    }

    /// Turns towards the best poster for `dt_s` seconds, or at once if `None`; returns its name.
    pub(crate) fn follow(
        &mut self,
        building: &Building,
        map_from_robot: &Pose2,
        dt_s: Option<f64>,
    ) -> Option<String> {
        let best = building
            .posters()
            .filter_map(|l| Some((l, self.score(building, map_from_robot, l)?)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let (pan, tilt) = best.map_or((0.0, 0.0), |(l, _)| aim(map_from_robot, self.p.camera_height_m, l));
        self.target = best.map(|(l, _)| l.name.clone());
        self.turn_to(pan, tilt, dt_s);
        self.target.clone()
    }

    /// Turns towards these angles for `dt_s` seconds, or at once if `None`.
    pub(crate) fn turn_to(&mut self, pan: f64, tilt: f64, dt_s: Option<f64>) {
        let most = dt_s.map_or(f64::INFINITY, |dt| (self.p.rate_radps * dt).max(0.0));
        let turn =
            |from: f64, to: f64, limit: f64| from + (to.clamp(-limit, limit) - from).clamp(-most, most);
        self.pan_rad = turn(self.pan_rad, pan, self.p.max_pan_rad.abs());
        self.tilt_rad = turn(self.tilt_rad, tilt, self.p.max_tilt_rad.abs());
    }

    /// Quality of the view of a poster; `None` without a view. The present target gets a bonus
    /// against flicker.
    fn score(&self, building: &Building, map_from_robot: &Pose2, l: &LandmarkTruth) -> Option<f64> {
        if !self.p.look_at_posters {
            return None;
        }
        let (pan, _) = aim(map_from_robot, self.p.camera_height_m, l);
        let robot = Point2::from(map_from_robot.position());
        let camera_in_landmark =
            l.map_from_landmark.inverse() * Point3::new(robot.x, robot.y, l.map_from_landmark.translation.z);
        let (distance, angle) =
            (camera_in_landmark.coords.norm(), camera_in_landmark.y.abs().atan2(camera_in_landmark.x));
        let face = l.map_from_landmark * Point3::new(0.03, 0.0, 0.0);
        let fits = (self.p.distance_m[0]..=self.p.distance_m[1]).contains(&distance)
            && angle <= self.p.max_view_angle_rad
            && pan.abs() <= self.p.max_pan_rad
            && building.in_sight(&robot, &face.xy());
        let bonus = if self.target.as_ref() == Some(&l.name) { 1.3 } else { 1.0 };
        fits.then(|| bonus * angle.cos() / distance)
    }
}

/// Pan and tilt that centre a landmark for a camera at a height over the robot's origin.
pub(crate) fn aim(map_from_robot: &Pose2, camera_height_m: f64, l: &LandmarkTruth) -> (f64, f64) {
    let centre = l.map_from_landmark.translation.vector;
    let d = centre.xy() - map_from_robot.position();
    let pan = wrap_rad(d.y.atan2(d.x) - map_from_robot.theta_rad);
    (pan, (centre.z - camera_height_m).atan2(d.norm()))
}

/// Extrinsics of the camera for a pan and tilt.
pub(crate) fn mounting(pan_rad: f64, tilt_rad: f64, height_m: f64) -> Isometry3<f64> {
    pan_tilt(pan_rad, tilt_rad, Vector3::new(0.0, 0.0, height_m))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_aimed_camera_has_the_landmark_on_its_axis() {
        let building = Building::corridor(3);
        let landmark = building.landmark("poster-1").unwrap();
        let robot = Pose2::new(landmark.map_from_landmark.translation.x - 1.0, 0.2, 2.5);
        let (pan, tilt) = aim(&robot, 1.2, landmark);
        let map_from_camera = robot.to_isometry3() * mounting(pan, tilt, 1.2);
        let centre = map_from_camera.inverse() * Point3::from(landmark.map_from_landmark.translation.vector);
        assert!(centre.x.abs() < 1e-9 && centre.y.abs() < 1e-9 && centre.z > 0.5, "{centre}");
    }

    #[test]
    fn the_pan_tilt_unit_keeps_its_speed() {
        let building = Building::corridor(3);
        let landmark = building.landmark("poster-0").unwrap();
        let robot = Pose2::new(landmark.map_from_landmark.translation.x, 0.0, 0.0);
        let mut gaze = Gaze::new(GazeParams::default());
        assert_eq!(gaze.follow(&building, &robot, Some(0.2)).as_deref(), Some("poster-0"));
        assert!((gaze.pan_rad().abs() - 0.2).abs() < 1e-9);
        let mut blind = Gaze::new(GazeParams { look_at_posters: false, ..GazeParams::default() });
        assert_eq!(blind.follow(&building, &robot, None), None);
    }
}
