//! The place of a landmark: a rectangle on a wall or under a ceiling, with the covariance of its
//! pose and size (method 11).

use crate::{
    check::{self, MAX_COORDINATE_M, OutOfRange},
    pose2::{Pose2, wrap_rad},
};
use nalgebra::{Isometry3, Matrix2, Matrix6, Point2, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use std::f64::consts::{FRAC_PI_2, TAU};
use vision::pose::LandmarkSize;

/// Largest height of a landmark's centre above or below the floor, metres.
pub const MAX_HEIGHT_M: f64 = 100.0;
/// Largest roll of a landmark in its wall, radians.
pub const MAX_ROLL_RAD: f64 = 0.5;

/// Place of a landmark in the map: its centre, the direction of its outward normal, its size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LandmarkPlace {
    /// Centre along x, metres, map frame.
    pub x_m: f64,
    /// Centre along y, metres, map frame.
    pub y_m: f64,
    /// Height of the centre above the floor, metres.
    pub z_m: f64,
    /// Direction of the outward normal on the floor, radians; under a ceiling, the direction of the
    /// landmark's top.
    pub theta_rad: f64,
    /// Rotation about the outward normal, radians; 0 when the sides are vertical.
    pub roll_rad: f64,
    /// Rotation of the outward normal from level downwards, radians: 0 on a wall, pi/2 under a
    /// ceiling.
    pub tilt_rad: f64,
    /// Width and height, metres.
    pub size: LandmarkSize,
    /// Covariance over (x, y, theta, z, width, height), in this order; metres and radians.
    pub covariance: Matrix6<f64>,
    /// The part of it that is common with other places; `None` where nothing is known of such.
    pub shared: Option<SharedErrors>,
}

/// Errors that all places of one survey have in common, as where the whole map is stretched or
/// bent: `error of the place = by * e + an error of its own`, e of six independent numbers of
/// variance 1 that are the same for every place of the survey.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharedErrors {
    /// The survey. Errors of two surveys are independent.
    pub survey: SurveyId,
    /// Derivative of (x, y, theta, z, width, height) by e; metres and radians.
    pub by: Matrix6<f64>,
}

/// Number of a survey: a digest of what it found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SurveyId(pub u64);

/// Standard deviations of a place that was measured by hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceSigmas {
    /// Of each coordinate of the centre, metres.
    pub position_m: f64,
    /// Of the normal's direction, radians.
    pub theta_rad: f64,
    /// Of width and height, metres.
    pub size_m: f64,
}

impl Default for PlaceSigmas {
    /// Measured with a tape: 1 cm, half a degree, 2 mm.
    fn default() -> Self {
        Self { position_m: 0.01, theta_rad: 0.5_f64.to_radians(), size_m: 0.002 }
    }
}

impl LandmarkPlace {
    /// Placed by hand, without roll: centre (x, y, z), direction of the outward normal, size.
    pub fn by_hand(
        centre_m: Vector3<f64>,
        theta_rad: f64,
        size: LandmarkSize,
        sigmas: PlaceSigmas,
    ) -> Result<Self, OutOfRange> {
        check::within("sigmas.position_m", sigmas.position_m, 0.0, 10.0)?;
        check::within("sigmas.theta_rad", sigmas.theta_rad, 0.0, 1.0)?;
        check::within("sigmas.size_m", sigmas.size_m, 0.0, 10.0)?;
        let (p, t, s) = (sigmas.position_m.powi(2), sigmas.theta_rad.powi(2), sigmas.size_m.powi(2));
        let covariance = Matrix6::from_diagonal(&Vector6::new(p, p, t, p, s, s));
        let (x_m, y_m, z_m) = (centre_m.x, centre_m.y, centre_m.z);
        let (roll_rad, tilt_rad, shared) = (0.0, 0.0, None);
        let made = Self { x_m, y_m, z_m, theta_rad, roll_rad, tilt_rad, size, covariance, shared };
        made.check()?;
        Ok(made)
    }

    /// Every number finite and in range; the covariance possible.
    pub fn check(&self) -> Result<(), OutOfRange> {
        check::within("x_m", self.x_m, -MAX_COORDINATE_M, MAX_COORDINATE_M)?;
        check::within("y_m", self.y_m, -MAX_COORDINATE_M, MAX_COORDINATE_M)?;
        check::within("z_m", self.z_m, -MAX_HEIGHT_M, MAX_HEIGHT_M)?;
        check::within("theta_rad", self.theta_rad, -TAU, TAU)?;
        check::within("roll_rad", self.roll_rad, -MAX_ROLL_RAD, MAX_ROLL_RAD)?;
        check::within("tilt_rad", self.tilt_rad, -FRAC_PI_2, FRAC_PI_2)?;
        let (low, high) = (LandmarkSize::MIN_M, LandmarkSize::MAX_M);
        check::within("width_m", self.size.width_m, low, high)?;
        check::within("height_m", self.size.height_m, low, high)?;
        check::covariance("covariance", &self.covariance)?;
        check::covariance("shared", &self.own_covariance())
    }

    /// The covariance of the errors that no other place has.
    pub fn own_covariance(&self) -> Matrix6<f64> {
        self.shared.map_or(self.covariance, |shared| self.covariance - shared.by * shared.by.transpose())
    }

    /// The place in another frame of the floor, whose relation to this one is exact.
    #[must_use]
    pub fn moved(&self, there_from_here: &Pose2) -> Self {
        let at = there_from_here.apply(&Point2::new(self.x_m, self.y_m));
        let (s, c) = there_from_here.theta_rad.sin_cos();
        let mut turn = Matrix6::identity();
        turn.fixed_view_mut::<2, 2>(0, 0).copy_from(&Matrix2::new(c, -s, s, c));
        Self {
            x_m: at.x,
            y_m: at.y,
            theta_rad: wrap_rad(self.theta_rad + there_from_here.theta_rad),
            covariance: turn * self.covariance * turn.transpose(),
            shared: self.shared.map(|shared| SharedErrors { by: turn * shared.by, ..shared }),
            ..*self
        }
    }

    /// Angle between the outward normal and the direction from the landmark's centre to a camera,
    /// radians.
    pub fn incidence_rad(&self, camera_m: &Point3<f64>) -> f64 {
        let from_landmark = self.map_from_landmark().inverse() * camera_m;
        from_landmark.coords.yz().norm().atan2(from_landmark.x)
    }

    /// Landmark coordinates (x outward normal, y the viewer's right, z up) to map coordinates.
    pub fn map_from_landmark(&self) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.theta_rad);
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.tilt_rad);
        let roll = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.roll_rad);
        Isometry3::from_parts(Translation3::new(self.x_m, self.y_m, self.z_m), turn * tilt * roll)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };

    #[test]
    fn the_viewers_right_is_y() {
        // On the north wall (normal to the south) a viewer who looks north has east, map +x, on the
        // right.
        let south = -std::f64::consts::FRAC_PI_2;
        let place =
            LandmarkPlace::by_hand(Vector3::new(2.0, 5.0, 1.5), south, SIZE, PlaceSigmas::default()).unwrap();
        let right = place.map_from_landmark() * Point3::new(0.0, 0.3, 0.42);
        assert!((right - Point3::new(2.3, 5.0, 1.92)).norm() < 1e-12);
        let front = place.map_from_landmark() * Point3::new(1.0, 0.0, 0.0);
        assert!((front - Point3::new(2.0, 4.0, 1.5)).norm() < 1e-12);
    }

    #[test]
    fn a_moved_place_by_hand() {
        let mut place =
            LandmarkPlace::by_hand(Vector3::new(2.0, 5.0, 1.5), 3.0, SIZE, PlaceSigmas::default()).unwrap();
        (place.covariance[(0, 0)], place.covariance[(1, 1)]) = (0.04, 0.01);
        let by = Matrix6::from_diagonal(&Vector6::new(0.1, 0.05, 0.0, 0.0, 0.0, 0.0));
        place.shared = Some(SharedErrors { survey: SurveyId(1), by });
        let moved = place.moved(&Pose2::new(1.0, 0.0, std::f64::consts::FRAC_PI_2));
        let wanted = Vector3::new(-4.0, 2.0, 1.5);
        assert!((moved.map_from_landmark().translation.vector - wanted).norm() < 1e-12, "{moved:?}");
        assert!(
            (moved.theta_rad - (3.0 + std::f64::consts::FRAC_PI_2 - std::f64::consts::TAU)).abs() < 1e-12
        );
        assert!(
            (moved.covariance[(0, 0)] - 0.01).abs() < 1e-12
                && (moved.covariance[(1, 1)] - 0.04).abs() < 1e-12
        );
        let own = moved.own_covariance();
        assert!((own[(0, 0)] - 0.0075).abs() < 1e-12 && (own[(1, 1)] - 0.03).abs() < 1e-12, "{own}");
        assert!(moved.check().is_ok());
        let beyond = SharedErrors { survey: SurveyId(1), by: 3.0 * by };
        let refused = LandmarkPlace { shared: Some(beyond), ..place }.check().unwrap_err();
        assert_eq!(refused.field, "shared");
    }

    #[test]
    fn roll_turns_about_the_normal() {
        let mut place = LandmarkPlace::by_hand(Vector3::zeros(), 0.4, SIZE, PlaceSigmas::default()).unwrap();
        place.roll_rad = 0.1;
        let normal = place.map_from_landmark() * Vector3::x();
        assert!((normal - Vector3::new(0.4_f64.cos(), 0.4_f64.sin(), 0.0)).norm() < 1e-12);
        let up = place.map_from_landmark() * Vector3::z();
        assert!((up.z - 0.1_f64.cos()).abs() < 1e-12);
    }

    #[test]
    fn a_ceiling_landmark_has_its_right_viewed_from_below() {
        // The top points north; a viewer below who looks up with the feet to the south has east on
        // the left.
        let mut place =
            LandmarkPlace::by_hand(Vector3::new(0.0, 0.0, 2.5), FRAC_PI_2, SIZE, PlaceSigmas::default())
                .unwrap();
        place.tilt_rad = FRAC_PI_2;
        place.check().unwrap();
        let at = |y, z| place.map_from_landmark() * Point3::new(0.0, y, z);
        assert!((at(0.0, 1.0) - Point3::new(0.0, 1.0, 2.5)).norm() < 1e-12);
        assert!((at(1.0, 0.0) - Point3::new(-1.0, 0.0, 2.5)).norm() < 1e-12);
        let normal = place.map_from_landmark() * Vector3::x();
        assert!((normal + Vector3::z()).norm() < 1e-12);
        place.tilt_rad = 1.6;
        assert_eq!(place.check().unwrap_err().field, "tilt_rad");
    }

    #[test]
    fn incidence_is_against_the_normal_in_space() {
        let mut place =
            LandmarkPlace::by_hand(Vector3::new(1.0, 1.0, 2.5), 0.3, SIZE, PlaceSigmas::default()).unwrap();
        let ahead = Point3::new(1.0 + 2.0 * 0.8_f64.cos(), 1.0 + 2.0 * 0.8_f64.sin(), 2.5);
        assert!((place.incidence_rad(&ahead) - 0.5).abs() < 1e-12);
        place.tilt_rad = FRAC_PI_2;
        assert!(place.incidence_rad(&Point3::new(1.0, 1.0, 1.2)).abs() < 1e-7, "right below");
        assert!((place.incidence_rad(&Point3::new(0.0, 1.0, 1.5)) - FRAC_PI_2 / 2.0).abs() < 1e-12);
        assert!(place.incidence_rad(&Point3::new(1.0, 1.0, 3.0)) > 3.0, "from above the ceiling");
    }

    #[test]
    fn values_out_of_range_are_refused_with_their_field() {
        let made = |z, w, sigma| {
            let size = LandmarkSize { width_m: w, height_m: 0.5 };
            let sigmas = PlaceSigmas { position_m: sigma, ..PlaceSigmas::default() };
            LandmarkPlace::by_hand(Vector3::new(0.0, 0.0, z), 0.0, size, sigmas).map_err(|e| e.field)
        };
        assert!(made(MAX_HEIGHT_M, LandmarkSize::MAX_M, 0.0).is_ok());
        assert_eq!(made(MAX_HEIGHT_M + 0.1, 1.0, 0.1), Err("z_m"));
        assert_eq!(made(1.0, LandmarkSize::MAX_M + 0.1, 0.1), Err("width_m"));
        assert_eq!(made(1.0, 0.0, 0.1), Err("width_m"));
        assert_eq!(made(1.0, f64::NAN, 0.1), Err("width_m"));
        assert_eq!(made(1.0, 1.0, -0.1), Err("sigmas.position_m"));
    }
}
