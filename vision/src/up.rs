//! Which corner of a quad is the top-left one (method 4, A10).
//!
//! In: quads as the detector names their corners, by +v of the image; the direction of up in the
//! camera frame, from the camera's mounting. Out: the same quads, named by that direction. Where it
//! does not decide, or is not known, they are marked, and recognition tries all four rotations.

use crate::{
    detect::{quad::Quad, refine::corners::upright_ambiguous},
    frame::Intrinsics,
    geometry::corners::Corners,
};
use nalgebra::{Point2, Unit, Vector2, Vector3};

/// Largest elevation of a line of sight, above or below the horizon, at which up in the image
/// decides. Near the zenith objects on ceilings are as likely as those on walls.
const MAX_ELEVATION_DEG: f64 = 45.0;
/// The same in a map with landmarks that are level: from lines of sight nearer to the horizon they
/// are seen at more than 70 degrees, where none is recognised.
const MAX_ELEVATION_WITH_LEVEL_DEG: f64 = 20.0;

/// Largest roll of a camera that counts as not rolled.
const MAX_ROLL_DEG: f64 = 2.0;

/// The direction of up in the camera frame, of a camera whose robot stands on the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Up {
    camera_up: Unit<Vector3<f64>>,
    max_elevation_deg: f64,
}

impl Up {
    /// From a direction of any length, camera frame (x right, y down, z forward). `None` where it
    /// has none.
    pub fn new(camera_up: Vector3<f64>) -> Option<Self> {
        let is_direction = camera_up.iter().all(|x| x.is_finite());
        let camera_up = Unit::try_new(camera_up, f64::MIN_POSITIVE).filter(|_| is_direction)?;
        Some(Self { camera_up, max_elevation_deg: MAX_ELEVATION_DEG })
    }

    /// Of a camera that looks level and is not rolled.
    pub fn level() -> Self {
        Self { camera_up: -Vector3::y_axis(), max_elevation_deg: MAX_ELEVATION_DEG }
    }

    /// Some landmarks of the map are under ceilings or on floors: they show any side to a robot.
    #[must_use]
    pub fn with_level_landmarks(self) -> Self {
        Self { max_elevation_deg: MAX_ELEVATION_WITH_LEVEL_DEG, ..self }
    }

    /// Angle of the optical axis above the horizontal, rad, of a camera whose image rows are level
    /// to within [`MAX_ROLL_DEG`]; `None` of any other, and of one that looks straight up or down.
    pub(crate) fn tilt_without_roll_rad(self) -> Option<f64> {
        let up = self.camera_up;
        let roll_rad = up.x.atan2(-up.y);
        (roll_rad.abs() <= MAX_ROLL_DEG.to_radians()).then(|| up.z.asin())
    }

    /// Which corner, 0 to 3, is the top-left one. `None` where up does not decide.
    pub fn top_left(&self, corners_px: &Corners, intrinsics: Option<&Intrinsics>) -> Option<usize> {
        let down = self.down_at(&centre(corners_px), intrinsics)?;
        let shift = corners_px.top_left(&down);
        (!upright_ambiguous(&corners_px.rotated(shift), &down)).then_some(shift)
    }

    /// The direction of gravity at `px`, in pixels (unit length): towards the vanishing point of
    /// what is vertical. `None` where the line of sight is too steep. Without intrinsics, every
    /// line of sight is taken as the optical axis.
    pub(crate) fn down_at(&self, px: &Point2<f64>, intrinsics: Option<&Intrinsics>) -> Option<Vector2<f64>> {
        let up = self.camera_up;
        let straight = intrinsics.map(|k| {
            let px = k.undistort(px).unwrap_or(*px);
            Point2::new((px.x - k.cx_px) / k.fx_px, (px.y - k.cy_px) / k.fy_px)
        });
        let ray = straight.map_or(Vector3::z(), |p| Vector3::new(p.x, p.y, 1.0));
        let sine = up.dot(&ray) / ray.norm();
        if sine.abs() > self.max_elevation_deg.to_radians().sin() {
            return None;
        }
        // The derivative of the pixel while the point on the line of sight moves down.
        let down = ray.xy() * up.z - up.xy();
        let in_px = match (straight, intrinsics) {
            (Some(p), Some(k)) => {
                let bent = k.distortion.distort(&p).by_straight * down;
                Vector2::new(k.fx_px * bent.x, k.fy_px * bent.y)
            }
            _ => down,
        };
        in_px.try_normalize(f64::MIN_POSITIVE)
    }
}

fn centre(corners_px: &Corners) -> Point2<f64> {
    corners_px.points().iter().fold(Point2::origin(), |sum: Point2<f64>, c| sum + c.coords * 0.25)
}

impl Quad {
    /// Names the corners of quad and alternates by `up`, and marks the quad where that does not
    /// decide. `None`: up is not known, the corners stay as they are, and the quad is marked.
    #[must_use]
    pub fn named_by(self, up: Option<&Up>, intrinsics: Option<&Intrinsics>) -> Self {
        let down = up.and_then(|up| up.down_at(&centre(&self.corners_px), intrinsics));
        let Some(down) = down else { return Self { upright_ambiguous: true, ..self } };
        let shift = self.corners_px.top_left(&down);
        let corners_px = self.corners_px.rotated(shift);
        let rotated = |c: &Corners| c.rotated(c.top_left(&down));
        Self {
            corners_px,
            corner_covariance_px2: std::array::from_fn(|i| self.corner_covariance_px2[(i + shift) % 4]),
            side_support: std::array::from_fn(|i| self.side_support[(i + shift) % 4]),
            side_clipped: std::array::from_fn(|i| self.side_clipped[(i + shift) % 4]),
            upright_ambiguous: upright_ambiguous(&corners_px, &down),
            alternates: self.alternates.iter().map(rotated).collect(),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{detect::quad::QuadKind, frame::Distortion};
    use nalgebra::{Matrix2, Rotation3};

    fn camera(distortion: Distortion) -> Intrinsics {
        Intrinsics::new(500.0, 520.0, 319.5, 239.5, distortion).unwrap()
    }

    #[test]
    fn no_direction_is_no_up() {
        assert_eq!(Up::new(Vector3::zeros()), None);
        assert_eq!(Up::new(Vector3::new(f64::NAN, -1.0, 0.0)), None);
        assert_eq!(Up::new(Vector3::new(0.0, f64::NEG_INFINITY, 0.0)), None);
        assert_eq!(Up::new(Vector3::new(0.0, -3.0, 0.0)), Some(Up::level()));
    }

    #[test]
    fn down_points_to_the_vanishing_point_of_what_is_vertical() {
        let fisheye = Distortion::Equidistant([0.01, 0.0, 0.0, 0.0]);
        let bent = Distortion::PlumbBob([-0.2, 0.05, 0.001, 0.002, 0.0]);
        for distortion in [Distortion::None, bent, fisheye] {
            let camera = camera(distortion);
            for (roll, tilt) in [(0.0, 0.0), (0.4, 0.3), (2.0, -0.5), (4.0, 0.6)] {
                let turn = Rotation3::from_euler_angles(0.0, 0.0, roll)
                    * Rotation3::from_euler_angles(tilt, 0.0, 0.0);
                let up = Up::new(turn * -Vector3::y()).unwrap();
                for point in [[0.2, 0.1, 2.0], [-0.9, 0.3, 2.0], [0.0, -0.5, 2.0]] {
                    let point = Vector3::from(point);
                    let lower = point - 1e-6 * up.camera_up.into_inner();
                    let (px, below) = (camera.project(&point), camera.project(&lower));
                    let down = up.down_at(&px, Some(&camera)).unwrap();
                    assert!((down - (below - px).normalize()).norm() < 1e-5, "{down} {roll} {tilt}");
                }
            }
        }
    }

    #[test]
    fn a_steep_line_of_sight_does_not_decide() {
        let camera = camera(Distortion::None);
        let tilted =
            |deg: f64| Up::new(Vector3::new(0.0, -deg.to_radians().cos(), deg.to_radians().sin())).unwrap();
        let axis = Point2::new(319.5, 239.5);
        for intrinsics in [None, Some(&camera)] {
            for (deg, walls, level) in
                [(19.0, true, true), (-21.0, true, false), (44.0, true, false), (46.0, false, false)]
            {
                let up = tilted(deg);
                assert_eq!(up.down_at(&axis, intrinsics).is_some(), walls, "{deg}");
                assert_eq!(up.with_level_landmarks().down_at(&axis, intrinsics).is_some(), level, "{deg}");
            }
        }
        // The ray decides, not the axis.
        let high = Point2::new(319.5, 239.5 - 520.0 * 16_f64.to_radians().tan());
        assert!(tilted(30.0).down_at(&high, Some(&camera)).is_none());
        assert!(tilted(30.0).down_at(&high, None).is_some());
    }

    #[test]
    fn everything_of_a_quad_is_named_alike() {
        let corners = |half: f64| {
            let square = [[-half, -half], [half, -half], [half, half], [-half, half]];
            Corners::try_from(square.map(|[x, y]| [x + 100.0, y + 100.0])).unwrap()
        };
        let quad = Quad {
            corners_px: corners(40.0),
            corner_covariance_px2: [0.0, 1.0, 2.0, 3.0].map(|i| Matrix2::identity() * i),
            side_support: [0.0, 0.1, 0.2, 0.3],
            side_clipped: [false, true, false, false],
            score: 0.5,
            kind: QuadKind::Full,
            upright_ambiguous: true,
            // The detector names an alternate by itself.
            alternates: vec![corners(20.0).rotated(3)],
        };
        // Up is to the right: the corner to the right and above is the top-left one.
        let named = quad.clone().named_by(Up::new(Vector3::x()).as_ref(), None);
        assert_eq!(named.corners_px, corners(40.0).rotated(1));
        let is_near = |a: [f64; 4], b: [f64; 4]| a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(is_near(named.corner_covariance_px2.map(|c| c.m11), [1.0, 2.0, 3.0, 0.0]));
        assert!(is_near(named.side_support, [0.1, 0.2, 0.3, 0.0]));
        assert_eq!(named.side_clipped, [true, false, false, false]);
        assert_eq!(named.alternates, [corners(20.0).rotated(1)]);
        assert!(!named.upright_ambiguous);
        assert_eq!(Up::new(Vector3::x()).unwrap().top_left(&quad.corners_px, None), Some(1));
        assert_eq!(Up::new(Vector3::new(1.0, -1.0, 0.0)).unwrap().top_left(&quad.corners_px, None), None);
        let unknown = Quad { upright_ambiguous: false, ..quad.clone() }.named_by(None, None);
        assert_eq!(unknown, quad);
    }
}
